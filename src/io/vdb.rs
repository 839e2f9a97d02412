//! Shim only: the project has a real one.
use std::path::Path;

use crate::scene::Volume;
use crate::{Error, Result};

/// Shim.
#[derive(Debug, Default)]
pub struct WriteOptions {}

/// Shim.
pub fn read(_path: &Path, _member: Option<&str>) -> Result<Volume> {
    Err(Error::Machine("OpenVDB is not in this crate".to_owned()))
}

/// Shim.
pub fn write(_path: &Path, _grids: &[(&str, &Volume)], _options: WriteOptions) -> Result<()> {
    Err(Error::Machine("OpenVDB is not in this crate".to_owned()))
}
