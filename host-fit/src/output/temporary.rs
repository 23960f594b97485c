//! New files on their way to the place of an output, and what a killed program left of them.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Error;
use std::path::Path;
use tempfile::NamedTempFile;

/// How their names begin.
const PREFIX: &str = ".host-fit-";

/// How often a new file is made where others are swept at the same time.
const ATTEMPTS: u8 = 16;

/// A new file in `folder` with the permissions of any new file; removed unless persisted. It is
/// locked as long as it is open, so that [`sweep`] tells it from one whose program is gone.
pub(super) fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    for _ in 0..ATTEMPTS {
        let file = create(folder)?;
        // Where a file system has no locks, nothing is swept.
        let is_taken = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
        if !is_taken && !is_removed(file.as_file())? {
            return Ok(file);
        }
    }
    Err(Error::other("other programs remove its temporary files"))
}

fn create(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Less the user's umask.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    // Without the temporary name, which means nothing to the user.
    builder
        .tempfile_in(folder)
        .map_err(|error| Error::from(error.kind()))
}

/// Whether an open file was swept before it was locked.
#[cfg(unix)]
fn is_removed(file: &File) -> std::io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    Ok(file.metadata()?.nlink() == 0)
}

/// An open file cannot be removed on other systems.
#[cfg(not(unix))]
fn is_removed(_file: &File) -> std::io::Result<bool> {
    Ok(false)
}

/// Removes the new files that killed programs left in `folder`: those that nobody has locked.
/// What cannot be read or removed stays.
pub(super) fn sweep(folder: &Path) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
        if !is_ours || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let left = OpenOptions::new().write(true).open(entry.path());
        if left.is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}
