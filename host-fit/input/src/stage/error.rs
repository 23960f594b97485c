//! Why a `stage.toml` is refused.

use crate::source::SourceError;
use std::path::PathBuf;

/// A position in a text file; line and column count from 1, the column in characters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextPosition {
    /// The file.
    pub path: PathBuf,
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl core::fmt::Display for TextPosition {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}:{}:{}", self.path.display(), self.line, self.column)
    }
}

/// What is wrong with a `stage.toml`: where, which key, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The file cannot be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The file is not text.
    #[error("{}: not a text file: byte {offset} is not UTF-8; name a stage.toml, or save it as UTF-8", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
        /// First bad byte, from 0.
        offset: usize,
    },
    /// The text is not TOML.
    #[error("{place}: not TOML: {message}; correct this line")]
    Syntax {
        /// Where.
        place: TextPosition,
        /// What the parser says.
        message: String,
    },
    /// A key that is missing or unknown, or a value that is of another kind than it should be
    /// or cannot be true.
    #[error("{place}: `{key}`: {problem}")]
    Key {
        /// Where; the table's for a missing key.
        place: TextPosition,
        /// The key in full, as in `search.a_per_m[0]`.
        key: String,
        /// What is wrong, and what to do.
        problem: String,
    },
}
