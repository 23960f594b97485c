//! Files that a command does not replace: it did not write them, so they may hold a measurement.

use super::blob_file;
use super::error::{OutputError, OutputProblem};
use super::posterior_file;
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
/// A simulated or joined log starts like a measured log.
pub const LOG: &[&[u8]] = &[];

/// How a page of this program starts; its title follows.
const PAGE: &str = concat!(
    "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n",
    "<meta name=\"generator\" content=\"host-fit\">\n<title>"
);

/// The title of a page that may be a certificate.
pub const CERTIFICATE: &str = "Calibration certificate";

/// Length of a start.
const START: u64 = 256;

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

/// Refuses to replace a page of another program, or a certificate.
///
/// # Errors
/// [`OutputProblem::NotOwn`], [`OutputProblem::IsCertificate`].
pub fn check_own_page(path: &Path) -> Result<(), OutputError> {
    let start = start_of(path).unwrap_or_default();
    match start.strip_prefix(PAGE.as_bytes()) {
        Some(title) if title.starts_with(CERTIFICATE.as_bytes()) => {
            Err(OutputError::new(path, OutputProblem::IsCertificate))
        }
        None if !start.is_empty() => Err(OutputError::new(path, OutputProblem::NotOwn)),
        _ => Ok(()),
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

/// The certificates of a blob that takes the place of one of its stage: where it is the same one, it keeps its own. The numbers
/// `before` are of the blob that it was recalibrated from. A warning says where the posterior that is there does not tell.
pub fn certificates(
    path: &Path,
    set: &ParameterSet,
    before: &[String],
    warnings: &mut Vec<String>,
) -> Certificates {
    let there = blob_file::read(path).ok();
    let there = there.filter(|there| there.serial == set.serial);
    let is_same = there.as_ref() == Some(set);
    let known = there.map(|there| posterior_file::read(&there, path));
    let known = known.transpose().unwrap_or_else(|cause| {
        warnings.push(format!(
            "whether the number of the certificate is taken is not known: {cause}"
        ));
        None
    });
    let there = known.flatten().map(|known| known.certificates);
    let there = there.unwrap_or_default();
    let mut all = if is_same { there } else { there.next() };
    let new = before.iter().filter(|number| !all.has(number));
    let new: Vec<String> = new.cloned().collect();
    all.before.extend(new);
    all
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
