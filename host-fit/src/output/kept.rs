//! Files that a command does not replace: it did not write them, so they may hold a measurement.

use super::error::{OutputError, OutputProblem};
use super::{blob_file, posterior_file};
use flate2::read::MultiGzDecoder;
use hallstage_calibration::recalibrate::Certificates;
use runtime::ParameterSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// How the files of a command start, so that it knows them again.
pub const BLOB: &[&[u8]] = &[b"HALL"];
/// See [`BLOB`].
pub const JSON: &[&[u8]] = &[b"{"];
/// See [`BLOB`].
pub const IMAGE: &[&[u8]] = &[b":", b"HALL"];
/// See [`BLOB`].
pub const POSES: &[&[u8]] = &[b"movement,t_us,x_um,y_um,", b"\x93NUMPY"];
/// See [`BLOB`].
pub const PLAN: &[&[u8]] = &[b"t_us,x_um,y_um,"];
/// See [`BLOB`].
pub const TRUTH: &[&[u8]] = &[b"movement,t_us,x_nm,y_nm,"];
/// A simulated log starts like a measured log.
pub const LOG: &[&[u8]] = &[];

/// Length of a start.
const START: u64 = 64;

/// Refuses to replace a file that does not start like this, unless it is empty.
///
/// # Errors
/// [`OutputProblem::NotOwn`].
pub fn check_own(path: &Path, starts: &[&[u8]]) -> Result<(), OutputError> {
    let start = start_of(path).unwrap_or_default();
    match start.is_empty() || starts.iter().any(|own| start.starts_with(own)) {
        true => Ok(()),
        false => Err(OutputError::new(path, OutputProblem::NotOwn)),
    }
}

/// Refuses to replace a blob of another stage.
///
/// # Errors
/// [`OutputProblem::NotOwn`], [`OutputProblem::OtherSerial`].
pub fn check_own_blob(path: &Path, serial: &str) -> Result<(), OutputError> {
    check_own(path, BLOB)?;
    let there = blob_file::read(path).ok().filter(|_| path.is_file());
    let there = there.map(|set| set.serial.as_str().to_owned());
    match there.filter(|there| !there.is_empty() && there != serial) {
        Some(there) => Err(OutputError::new(path, OutputProblem::OtherSerial(there))),
        None => Ok(()),
    }
}

/// The certificates of a blob that takes the place of the one that is there: where it is the same one, it keeps its own.
pub fn certificates(path: &Path, set: &ParameterSet) -> Certificates {
    let there = blob_file::read(path).ok();
    let is_same = there.as_ref() == Some(set);
    let known = there.and_then(|there| posterior_file::read(&there, path).ok()?);
    let there = known.map(|known| known.certificates).unwrap_or_default();
    if is_same { there } else { there.next() }
}

/// The first bytes of a file, unpacked; none of devices and pipes.
fn start_of(path: &Path) -> Option<Vec<u8>> {
    let start_of = |from: &mut dyn Read| {
        let mut start = Vec::new();
        // A damaged file shows what it can.
        let _ = from.take(START).read_to_end(&mut start);
        start
    };
    let mut file = File::open(path).ok().filter(|_| path.is_file())?;
    let start = start_of(&mut file);
    match start.starts_with(b"\x1f\x8b") {
        true => Some(start_of(&mut MultiGzDecoder::new(File::open(path).ok()?))),
        false => Some(start),
    }
}
