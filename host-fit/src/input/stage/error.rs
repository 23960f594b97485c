//! Why a `stage.toml` is refused.

use std::path::PathBuf;

/// A place in a text file; line and column count from 1, the column in characters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub path: PathBuf,
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}:{}:{}", self.path.display(), self.line, self.column)
    }
}

/// What is wrong with a `stage.toml`: where, which key, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The file can't be read.
    #[error("{}: cannot read the stage file: {source}; check the path given with --stage", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A folder was named.
    #[error("{}: is a folder; name the stage.toml in it", path.display())]
    IsFolder {
        /// The folder.
        path: PathBuf,
    },
    /// More bytes than any stage file has.
    #[error("{}: more than {limit_bytes} bytes, so no stage file; name a stage.toml", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// How many bytes are read at most.
        limit_bytes: u64,
    },
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
        place: Place,
        /// What the parser says.
        message: String,
    },
    /// A key or a whole table is missing.
    #[error("{place}: `{key}` is missing; add it ({hint})")]
    Missing {
        /// The table that it belongs to, or the end of the file.
        place: Place,
        /// The key, with its table.
        key: String,
        /// What it should hold.
        hint: String,
    },
    /// A key that this program does not know: perhaps misspelt, so it is not ignored.
    #[error(
        "{place}: unknown key `{key}`; remove it or correct its spelling (known here: {known})"
    )]
    Unknown {
        /// Where.
        place: Place,
        /// The key, with its table.
        key: String,
        /// Keys that belong here.
        known: String,
    },
    /// A value of another kind than the key asks for.
    #[error("{place}: `{key}` is {found} where {expected} belongs; write {expected}")]
    WrongType {
        /// Where.
        place: Place,
        /// The key, with its table.
        key: String,
        /// What belongs there.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A value of the right kind that cannot be true.
    #[error("{place}: `{key}`: {fault}")]
    Absurd {
        /// Where.
        place: Place,
        /// The key, with its table.
        key: String,
        /// What is wrong with it and what to do.
        fault: ValueFault,
    },
}

/// Why a value of `stage.toml` cannot be true.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueFault {
    /// NaN or an infinity.
    #[error("{value} is not a finite number; give a measured or designed value")]
    NotFinite {
        /// The value.
        value: f64,
    },
    /// Zero or below where only more than zero makes sense.
    #[error("{value} is not above zero; give a positive value in {unit}")]
    NotPositive {
        /// The value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// Outside every sensible magnitude.
    #[error(
        "{value} {unit} is outside {low:e} to {high:e} {unit}; check the value and its unit (SI)"
    )]
    Implausible {
        /// The value.
        value: f64,
        /// Smallest sensible value.
        low: f64,
        /// Largest sensible value.
        high: f64,
        /// The unit of all three.
        unit: &'static str,
    },
    /// `code_min` is not below `code_max`, or no code lies between the two.
    #[error(
        "code_min = {code_min} and code_max = {code_max} leave no code between the converter's rails; give its smallest and its largest code"
    )]
    NoCodes {
        /// Smallest code of the converter.
        code_min: i64,
        /// Largest code of the converter.
        code_max: i64,
    },
    /// A code that needs more than 24 bits.
    #[error(
        "code {code} is beyond 24 bits; codes from -8388608 to 8388608 are decoded exactly, so scale the converter's codes down to 24 bits"
    )]
    Beyond24Bits {
        /// The code.
        code: i64,
    },
    /// A converter whose full scale makes no sense.
    #[error(
        "{m_per_count:e} m per code makes a full scale of {full_scale_m:e} m, outside {low_m:e} to {high_m:e} m; check the scale and its unit (m per code)"
    )]
    FullScale {
        /// The scale, m per code.
        m_per_count: f64,
        /// The scale times the largest code, m.
        full_scale_m: f64,
        /// Smallest sensible full scale, m.
        low_m: f64,
        /// Largest sensible full scale, m.
        high_m: f64,
    },
    /// The capacitive sensors stand in one line, or nearly.
    #[error(
        "the three capacitive sensors stand in one line and define no plane; give the (x, y) of three sensors in a triangle"
    )]
    ProbesInLine,
    /// The designed Hall probes cannot tell X, Y and Rz apart.
    #[error(
        "probes A and B stand at the same x ({x_m} m), so Y and Rz cannot be told apart; A sits at +h1x_m, B at -h2x_m"
    )]
    ProbesAlike {
        /// Their x coordinate, m.
        x_m: f64,
    },
    /// The lower end lies above the upper one.
    #[error("the range [{low}, {high}] is reversed; write the lower end first")]
    Reversed {
        /// First number.
        low: f64,
        /// Second number.
        high: f64,
    },
    /// The range leaves out the value that the stage was designed with.
    #[error(
        "the range [{low}, {high}] excludes the designed value {designed}; widen the range or correct the designed value"
    )]
    ExcludesDesigned {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
        /// The designed value.
        designed: f64,
    },
    /// A unit that this kind of column cannot have.
    #[error("unknown unit \"{unit}\"; use one of {known}, or give `scale`")]
    UnknownUnit {
        /// The unit.
        unit: String,
        /// Units that can stand here.
        known: &'static str,
    },
    /// A column name without a unit, where one is needed.
    #[error(
        "the unit of column \"{column}\" is unknown; write {{ column = \"{column}\", unit = \"...\" }} with one of {known}"
    )]
    NoUnit {
        /// The column.
        column: String,
        /// Units that can stand here.
        known: &'static str,
    },
    /// `unit` and `scale` are both given.
    #[error("`unit` and `scale` are both given; keep one of them")]
    UnitAndScale,
    /// A unit or a scale where the column holds plain numbers or codes.
    #[error("this column holds {what}, which have neither unit nor scale; give only its name")]
    NoScaleHere {
        /// What it holds.
        what: &'static str,
    },
    /// Two quantities come from one column, or a column in use is to be ignored.
    #[error("the column \"{column}\" is named twice (also by `{other}`); give each column one use")]
    ColumnTwice {
        /// The column.
        column: String,
        /// The other key.
        other: &'static str,
    },
    /// An empty column name.
    #[error("the column name is empty; give the name that stands in the log's header")]
    NoName,
}
