//! Which file a name means.

use super::error::{OutputError, OutputProblem};
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};

/// As many links as Linux follows.
const LINKS_MAX: usize = 40;

/// A file, whether it is there or not: equal where two names lead to the same file, hard links
/// included.
#[derive(Clone, Debug)]
pub struct FileIdentity {
    path: PathBuf,
    /// Device and number on it of a file that is there.
    inode: Option<(u64, u64)>,
}

impl FileIdentity {
    /// The file that a name leads to.
    pub fn of(path: &Path) -> Self {
        let end = end_of_links(path);
        // A file that is not there yet is known by its folder and its name.
        let new = || Some(folder_of(&end).canonicalize().ok()?.join(end.file_name()?));
        let there = path.canonicalize().ok().or_else(new);
        Self {
            path: there.unwrap_or_else(|| path.to_owned()),
            inode: fs::metadata(path).ok().as_ref().and_then(inode),
        }
    }
}

impl PartialEq for FileIdentity {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path || (self.inode.is_some() && self.inode == other.inode)
    }
}

#[cfg(unix)]
fn inode(metadata: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

/// Other systems do not show it.
#[cfg(not(unix))]
fn inode(_metadata: &Metadata) -> Option<(u64, u64)> {
    None
}

/// Whether a name means standard output, or standard input: `-`.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Whether an output by this name goes to standard output.
pub fn is_standard_output(path: &Path) -> bool {
    let there = |path: &Path| fs::metadata(path).ok().as_ref().and_then(inode);
    let standard = || there(Path::new("/dev/stdout"));
    names_standard_output(path) || there(path).is_some_and(|inode| standard() == Some(inode))
}

/// Whether this is a name of standard output, which then is not opened anew: that waits forever for a
/// pipe that nobody reads.
pub(super) fn names_standard_output(path: &Path) -> bool {
    let name = path.to_str();
    matches!(
        name,
        Some("-" | "/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1")
    )
}

/// The name at the end of the links that a name leads along; nothing need be there.
pub(super) fn end_of_links(path: &Path) -> PathBuf {
    let mut end = path.to_path_buf();
    for _ in 0..LINKS_MAX {
        let Ok(next) = fs::read_link(&end) else { break };
        end = folder_of(&end).join(next);
    }
    end
}

/// The file that an output `path` leads to, and what is there now.
pub(super) fn resolve(path: &Path) -> Result<(PathBuf, Option<Metadata>), OutputError> {
    let refused = |problem| Err(OutputError::new(path, problem));
    match fs::metadata(path) {
        _ if path.as_os_str().is_empty() => refused(OutputProblem::NoName),
        Ok(metadata) if metadata.is_dir() => refused(OutputProblem::IsFolder),
        Ok(metadata) if metadata.is_file() && metadata.permissions().readonly() => {
            refused(OutputProblem::ReadOnly)
        }
        // A link keeps its place: what it leads to is replaced.
        Ok(metadata) => {
            let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
            Ok((target, Some(metadata)))
        }
        Err(_) if path.file_name().is_none() || ends_in_separator(path) => {
            refused(OutputProblem::IsFolder)
        }
        Err(source) => match end_of_links(path) {
            // Links in a circle.
            end if end.is_symlink() => refused(OutputProblem::Failed { source }),
            end => Ok((end, None)),
        },
    }
}

/// Whether `path` is something to write to, not to replace: a device, a pipe, or the
/// standard streams under their names in the file system, which a shell may have led to files.
pub(super) fn is_stream(path: &Path, metadata: &Metadata) -> bool {
    let names = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc/self/fd"];
    let named_stream = cfg!(unix) && names.iter().any(|name| path.starts_with(name));
    named_stream || !metadata.is_file()
}

/// Whether the name asks for a folder, as `out/` does.
fn ends_in_separator(path: &Path) -> bool {
    let last = path.as_os_str().as_encoded_bytes().last();
    last.is_some_and(|last| std::path::is_separator(char::from(*last)))
}

/// The folder that a file is in.
pub(super) fn folder_of(target: &Path) -> PathBuf {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    }
}
