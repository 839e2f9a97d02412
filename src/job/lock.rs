//! A folder of results that one run has.

use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The file that says which run has a folder.
pub(super) const LOCK: &str = ".unscatter-lock";

/// What one run has a folder by. It is gone when the run is, however that ends.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// Held as long as it is open; none where the file system has no locks.
    file: Option<File>,
}

impl Lock {
    /// Errors: [`Error::Machine`] where another run has the folder.
    pub(super) fn of(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK);
        let failed = |source| Error::File { action: "write into", path: folder.to_owned(), source };
        loop {
            let opened = File::options().create(true).truncate(false).read(true).write(true).open(&path);
            let mut file = opened.map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut who = String::new();
                    _ = file.read_to_string(&mut who);
                    let by = if who.is_empty() { "another run".to_owned() } else { format!("process {who}") };
                    let folder = folder.display();
                    return Err(Error::Machine(format!(
                        "{folder} is in use by {by}; wait for it, or choose another folder"
                    )));
                }
                Err(TryLockError::Error(_)) => return Ok(Self { path, file: None }),
            }
            // Whoever had it may have removed the file that was opened here.
            if is_at(&file, &path) {
                let id = std::process::id().to_string();
                file.set_len(0).and_then(|()| file.write_all(id.as_bytes())).map_err(failed)?;
                return Ok(Self { path, file: Some(file) });
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // As long as it is locked: nobody else can have it.
        _ = std::fs::remove_file(&self.path);
        drop(self.file.take());
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |about: std::fs::Metadata| (about.dev(), about.ino());
    file.metadata().map(id).ok() == std::fs::metadata(path).map(id).ok()
}

/// Where a file that is open cannot be removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}
