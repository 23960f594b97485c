//! The posterior of a fit as a file beside its blob: the prior of a recalibration.
//!
//! `params.bin.posterior` stands beside `params.bin`. All numbers are little-endian.
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 8 | magic, `HALLPOST` in ASCII |
//! | 8 | 4 | layout version: 1, 2 with the text below, or 3 with k and h |
//! | 12 | 32 | SHA-256 of the blob that it belongs to |
//! | 44 | 24 | white noise of the probes A, B, C, mm, as `f64` |
//! | 68 | 24 | walk of the reference in X, Y, Rz in a second, mm, mm, mrad, as `f64` |
//! | 92 | 8 | chi-square over residuals, as `f64` |
//! | 100 | 26,568 | covariance of the 81 parameters, the lower triangle row by row, as `f64` |
//! | 26,668 | 4,056 | layout 3: six more rows of it, of k and h of A, B and C |
//! | | | layouts 2 and 3: the faults of the log that the calibration is without, a line each, in UTF-8 |
//! | the end | 32 | SHA-256 of everything before it |

use crate::output::file::is_stream;
use crate::output::{OutputError, Outputs, blob_file};
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::source::{SourceError, SourceProblem, read_whole};
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::whiten::Noise;
use nalgebra::{Cholesky, DMatrix};
use runtime::ParameterSet;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

const MAGIC: [u8; 8] = *b"HALLPOST";
/// Rows of the covariance with k and h.
const ROWS_MAX: usize = COUNT + 6;
const HASH_BYTES: usize = 32;
const HEADER_BYTES: usize = 12 + HASH_BYTES;
const TEXT_BYTES_MAX: usize = 8192;

/// Length without text.
const fn bytes(rows: usize) -> usize {
    HEADER_BYTES + 8 * (7 + rows * (rows + 1) / 2) + HASH_BYTES
}

/// Why there is no posterior.
#[derive(Debug, thiserror::Error)]
pub enum PosteriorFileError {
    /// The file is not there.
    #[error(
        "{} does not exist: `host-fit fit` writes it beside a blob of the field model. Copy it there, fit again, or \
         recalibrate gains only (--what gains)", path.display()
    )]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] SourceError),
    /// It is no posterior, or a damaged one.
    #[error("{} is no posterior of this program: {problem}. Copy it again, or fit again", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// It was written beside another blob.
    #[error(
        "{} belongs to another blob than {}: copy the two together, or fit again; without that file, gains can be found \
         alone", path.display(), blob.display()
    )]
    OtherBlob {
        /// The file.
        path: PathBuf,
        /// The blob.
        blob: PathBuf,
    },
}

/// The file beside a blob; `None` if the blob is a device, a pipe or standard output.
pub fn beside(blob: &Path) -> Option<PathBuf> {
    if is_stream(blob) {
        return None;
    }
    let mut name = blob.as_os_str().to_owned();
    name.push(".posterior");
    Some(name.into())
}

/// Adds a blob to the outputs, and before it the posterior beside it. Without a posterior, the file of an older blob
/// goes, since it would be refused beside the new one.
///
/// # Errors
/// [`OutputError`].
pub fn add_calibration(
    outputs: &mut Outputs,
    path: &Path,
    set: &ParameterSet,
    known: Option<&StoredPosterior>,
) -> Result<(), OutputError> {
    let blob = blob_file::to_bytes(path, set)?;
    match (known, beside(path)) {
        (Some(known), Some(beside)) => {
            outputs.add(&beside, &encode(&Sha256::digest(&blob).into(), known))?;
        }
        (None, Some(beside)) => outputs.remove(beside),
        (_, None) => {}
    }
    outputs.add(path, &blob)
}

/// Reads what is known beside the blob `set`, which was read from `blob`.
///
/// # Errors
/// See [`PosteriorFileError`].
pub fn read(
    path: &Path,
    set: &ParameterSet,
    blob: &Path,
) -> Result<StoredPosterior, PosteriorFileError> {
    let most = (self::bytes(ROWS_MAX) + TEXT_BYTES_MAX) as u64;
    let bytes = match read_whole(path, most) {
        Err(error) if matches!(error.problem, SourceProblem::NotFound) => {
            return Err(PosteriorFileError::Missing { path: error.path });
        }
        read => read?,
    };
    let unusable = |problem| PosteriorFileError::Unusable {
        path: path.to_owned(),
        problem,
    };
    let (hash, known) = from_bytes(&bytes).map_err(unusable)?;
    let own = blob_hash(set).map_err(|cause| unusable(cause.to_string()))?;
    if hash != own {
        return Err(PosteriorFileError::OtherBlob {
            path: path.to_owned(),
            blob: blob.to_owned(),
        });
    }
    Ok(known)
}

fn blob_hash(set: &ParameterSet) -> Result<[u8; HASH_BYTES], runtime::BlobError> {
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    Ok(Sha256::digest(set.to_bytes(&mut buffer)?).into())
}

fn encode(blob: &[u8; HASH_BYTES], known: &StoredPosterior) -> Vec<u8> {
    let mut bytes = Vec::new();
    let StoredPosterior {
        covariance,
        noise: Noise { white_mm, drift_mm },
        misfit,
        repaired,
    } = known;
    let rows = covariance.nrows();
    let version: u32 = match (rows > COUNT, repaired.is_empty()) {
        (true, _) => 3,
        (false, true) => 1,
        (false, false) => 2,
    };
    bytes.extend(MAGIC);
    bytes.extend(version.to_le_bytes());
    bytes.extend(blob);
    let triangle = (0..rows).flat_map(|i| (0..=i).map(move |j| covariance[(i, j)]));
    let numbers = white_mm.iter().chain(drift_mm).chain([misfit]).copied();
    for number in numbers.chain(triangle) {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(repaired.join("\n").bytes());
    let hash = Sha256::digest(&bytes);
    bytes.extend(hash);
    bytes
}

/// The hash of the blob and what is known, or what is wrong.
fn from_bytes(bytes: &[u8]) -> Result<([u8; HASH_BYTES], StoredPosterior), String> {
    if !bytes.starts_with(&MAGIC) {
        return Err("it does not begin with HALLPOST".to_owned());
    }
    let version = bytes
        .get(MAGIC.len()..)
        .and_then(|bytes| bytes.first_chunk());
    let version = version.map(|version| u32::from_le_bytes(*version));
    let rows = if version == Some(3) { ROWS_MAX } else { COUNT };
    let least = self::bytes(rows);
    let (content, hash) = match bytes.split_last_chunk::<HASH_BYTES>() {
        Some(parts) if (least..=least + TEXT_BYTES_MAX).contains(&bytes.len()) => parts,
        _ => {
            return Err(format!(
                "it has not the {least} bytes or more that it should have"
            ));
        }
    };
    if Sha256::digest(content)[..] != hash[..] {
        return Err("it is damaged, its check does not fit".to_owned());
    }
    let (numbers, text) = content.split_at(least - HASH_BYTES);
    if version != Some(3) && version != Some(if text.is_empty() { 1 } else { 2 }) {
        return Err("its layout is not 1, 2 or 3".to_owned());
    }
    let text = str::from_utf8(text).map_err(|error| error.to_string())?;
    let (head, numbers) = numbers.split_at(HEADER_BYTES);
    let mut blob = [0; HASH_BYTES];
    blob.copy_from_slice(&head[HEADER_BYTES - HASH_BYTES..]);
    let (numbers, _) = numbers.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|n| f64::from_le_bytes(*n)).collect();
    let (noise, triangle) = numbers.split_at(7);
    let covariance = DMatrix::from_fn(rows, rows, |i, j| {
        let (row, column) = (i.max(j), i.min(j));
        triangle[row * (row + 1) / 2 + column]
    });
    let known = StoredPosterior {
        covariance,
        noise: Noise {
            white_mm: [noise[0], noise[1], noise[2]],
            drift_mm: [noise[3], noise[4], noise[5]],
        },
        misfit: noise[6],
        repaired: text.lines().map(str::to_owned).collect(),
    };
    let sound = noise.iter().all(|x| *x >= 0.0 && x.is_finite());
    if !sound || !is_covariance(&known.covariance) {
        return Err("its numbers are no noise and no covariance".to_owned());
    }
    Ok((blob, known))
}

/// Whether a matrix is a covariance. It is scaled to a diagonal of ones first.
fn is_covariance(matrix: &DMatrix<f64>) -> bool {
    let scale = matrix.diagonal().map(f64::sqrt);
    let (rows, columns) = matrix.shape();
    let scaled = DMatrix::from_fn(rows, columns, |i, j| matrix[(i, j)] / (scale[i] * scale[j]));
    scaled.iter().all(|x| x.is_finite()) && Cholesky::new(scaled).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> StoredPosterior {
        known_with_rows(COUNT)
    }

    fn known_with_rows(rows: usize) -> StoredPosterior {
        StoredPosterior {
            covariance: DMatrix::from_fn(rows, rows, |i, j| {
                let size = |k: usize| 1e-6 * (1.0 + k as f64);
                size(i) * size(j) * if i == j { 1.0 } else { 0.5 }
            }),
            noise: Noise {
                white_mm: [5e-4, 4e-4, 6e-4],
                drift_mm: [1e-4, 0.0, 2e-4],
            },
            misfit: 1.02,
            repaired: Vec::new(),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let bytes = encode(&[7; HASH_BYTES], &known());
        assert_eq!(bytes.len(), 26_700);
        assert_eq!(from_bytes(&bytes), Ok(([7; HASH_BYTES], known())));
        let repaired = StoredPosterior {
            repaired: vec![
                "the gain of Hall B changes by 1 µV".to_owned(),
                "a step".to_owned(),
            ],
            ..known()
        };
        let bytes = encode(&[7; HASH_BYTES], &repaired);
        assert_eq!(from_bytes(&bytes), Ok(([7; HASH_BYTES], repaired)));
        let with_temperature = known_with_rows(COUNT + 6);
        let bytes = encode(&[7; HASH_BYTES], &with_temperature);
        assert_eq!(bytes.len(), 26_700 + 4_056);
        assert_eq!(from_bytes(&bytes), Ok(([7; HASH_BYTES], with_temperature)));
    }

    #[test]
    fn a_blob_without_posterior_takes_the_older_one_away() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("params.bin");
        let set = include_bytes!("../../../runtime/examples/field.bin");
        let set = ParameterSet::from_bytes(set).expect("sound");
        for known in [Some(&known()), None] {
            let mut outputs = Outputs::default();
            add_calibration(&mut outputs, &path, &set, known).expect("added");
            outputs.commit().expect("written");
            let beside = beside(&path).expect("a file");
            assert_eq!(read(&beside, &set, &path).ok().as_ref(), known);
        }
    }

    #[test]
    fn what_is_damaged_cut_or_no_covariance_is_refused() {
        let bytes = encode(&[7; HASH_BYTES], &known());
        for place in (0..bytes.len()).step_by(997).chain([9, bytes.len() - 1]) {
            let mut damaged = bytes.clone();
            damaged[place] ^= 0x10;
            assert!(from_bytes(&damaged).is_err(), "{place}");
        }
        for length in [0, 5, 8, 12, 100, bytes.len() - 1] {
            assert!(from_bytes(&bytes[..length]).is_err(), "{length}");
        }
        assert!(from_bytes(&[bytes.as_slice(), &[0]].concat()).is_err());
        for value in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1.0] {
            let mut known = known();
            known.covariance[(3, 2)] = value;
            known.covariance[(2, 3)] = value;
            known.covariance[(2, 2)] = value.min(1e-12);
            let sound = from_bytes(&encode(&[7; HASH_BYTES], &known));
            assert!(sound.is_err(), "{value}");
        }
    }
}
