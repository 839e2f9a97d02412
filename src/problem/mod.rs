//! From a scene and what is painted on it to a least-squares problem.

mod painting;
