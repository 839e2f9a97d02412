//! scene file
