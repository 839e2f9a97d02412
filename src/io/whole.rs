use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// Writes a file whole or not at all: `write` fills a temporary file beside `path`, which then takes its name.
///
/// Errors: what `write` returns, or [`Error::File`] when the folder or the disk refuses. Either way an older file at
/// `path` stays as it was and no temporary one is left.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
    write_whole_seekable(path, |file| write(file))
}

/// [`write_whole`] for formats that go back to fill in what they learn later.
pub(super) fn write_whole_seekable(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>,
) -> Result<()> {
    let refused = |action| move |source| Error::File { action, path: path.to_owned(), source };
    let temporary = temporary_beside(path).map_err(refused("create"))?;
    let mut file = BufWriter::new(temporary.as_file());
    write(&mut file)?;
    file.flush().map_err(refused("write"))?;
    drop(file);
    // Without this a power cut after the rename could leave the new name on an empty file.
    temporary.as_file().sync_all().map_err(refused("write"))?;
    temporary.persist(path).map_err(|failed| refused("rename")(failed.error))?;
    Ok(())
}

/// In the same folder, as a rename does not cross file systems.
fn temporary_beside(path: &Path) -> std::io::Result<NamedTempFile> {
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let mut builder = tempfile::Builder::new();
    builder.prefix(".unscatter-").suffix(".part");
    #[cfg(unix)]
    {
        // The umask takes its part of this; the default of `tempfile` would keep results from everyone else.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder.unwrap_or(Path::new(".")))
}

#[cfg(test)]
mod tests {
    use std::io::{Seek, SeekFrom};

    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
        write_whole(path, |file| {
            file.write_all(bytes).map_err(|source| Error::File {
                action: "write",
                path: path.to_owned(),
                source,
            })
        })
    }

    #[test]
    fn the_new_content_replaces_the_old() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_bytes(&path, &[1; 100_000]).unwrap();
        write_bytes(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["a.bin"]);
    }

    #[test]
    fn a_writer_that_fails_half_way_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_bytes(&path, b"old").unwrap();
        let failed = write_whole(&path, |file| {
            file.write_all(&[7; 1 << 20]).unwrap();
            Err(Error::Machine("stopped".to_owned()))
        });
        assert!(matches!(failed, Err(Error::Machine(_))));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names_in(folder.path()), ["a.bin"]);
    }

    /// Root may write into any folder, so the folders here are ones that nobody can write into.
    #[test]
    fn a_folder_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        write_bytes(&file, b"x").unwrap();
        for path in [file.join("a.bin"), folder.path().join("missing/a.bin")] {
            let failed = write_bytes(&path, b"y");
            assert!(
                matches!(failed, Err(Error::File { action: "create", path: named, .. }) if named == path)
            );
        }
    }

    #[test]
    fn a_name_that_is_taken_by_a_folder_leaves_no_temporary() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).unwrap();
        write_bytes(&taken.join("inside"), b"x").unwrap();
        assert!(matches!(write_bytes(&taken, b"y"), Err(Error::File { action: "rename", .. })));
        assert_eq!(names_in(folder.path()), ["taken"]);
    }

    #[test]
    fn seekable_writers_may_go_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_whole_seekable(&path, |file| {
            file.write_all(b"____ body").unwrap();
            file.seek(SeekFrom::Start(0)).unwrap();
            file.write_all(b"head").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"head body");
    }

    #[cfg(unix)]
    #[test]
    fn files_have_the_permissions_that_files_usually_have() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, usual) = (folder.path().join("ours"), folder.path().join("usual"));
        write_bytes(&ours, b"x").unwrap();
        std::fs::write(&usual, b"x").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&usual));
    }
}
