//! The posterior of a fit as a file beside its blob: the prior of a recalibration.
//!
//! `params.bin.posterior` stands beside `params.bin`: the magic `HALLPOS4` in ASCII, the fields of `Content` in postcard,
//! and the SHA-256 of all before it.

use crate::output::file::is_stream;
use crate::output::{OutputError, Outputs, blob_file};
use hallstage_calibration::budget::Budget;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::source::{SourceError, read_whole};
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::whiten::Noise;
use nalgebra::{Cholesky, DMatrix};
use runtime::ParameterSet;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"HALLPOS4";
/// Rows of the covariance without and with k and h.
const ROWS: [usize; 2] = [COUNT, COUNT + 6];
/// Largest file that is read.
const BYTES_MAX: u64 = 1 << 20;

/// What the file holds: SHA-256 of the blob that it belongs to; white noise of the probes A, B, C, m, and walk of the reference in
/// X, Y, Rz in a second, m, m, rad; the lower triangle of the covariance, row by row; all else.
type Content<K> = ([u8; 32], [[f64; 3]; 2], Vec<f64>, K);

/// Why there is no posterior.
#[derive(Debug, thiserror::Error)]
pub enum PosteriorFileError {
    /// The file is not there.
    #[error(
        "{}.posterior does not exist: `host-fit fit` writes it beside a blob of the field model. Copy it there, fit again, or \
         recalibrate gains only (--what gains)", blob.display()
    )]
    Missing {
        /// The blob.
        blob: PathBuf,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] SourceError),
    /// It is no posterior, or a damaged one.
    #[error("{} is no posterior of this program: {problem}. Copy it again, or make it again with host-fit fit", path.display())]
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
            outputs.add(&beside, &to_bytes(&blob, known))?;
        }
        (None, Some(beside)) => outputs.remove(beside),
        (_, None) => {}
    }
    outputs.add(path, &blob)
}

/// Reads what is known of the blob `set`, which was read from `blob`; `None` where no posterior stands beside it.
///
/// # Errors
/// See [`PosteriorFileError`], without `Missing`.
pub fn read(
    set: &ParameterSet,
    blob: &Path,
) -> Result<Option<StoredPosterior>, PosteriorFileError> {
    let Some(path) = beside(blob).filter(|path| path.exists()) else {
        return Ok(None);
    };
    let path = path.as_path();
    let bytes = read_whole(path, BYTES_MAX)?;
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
    Ok(Some(known))
}

fn blob_hash(set: &ParameterSet) -> Result<[u8; 32], runtime::BlobError> {
    let mut buffer = [0; runtime::blob::MAX_BYTES];
    Ok(Sha256::digest(set.to_bytes(&mut buffer)?).into())
}

/// The file beside a blob.
pub fn to_bytes(blob: &[u8], known: &StoredPosterior) -> Vec<u8> {
    let StoredPosterior {
        covariance, noise, ..
    } = known;
    let rows = 0..covariance.nrows();
    let triangle = rows.flat_map(|i| (0..=i).map(move |j| covariance[(i, j)]));
    let noise = [noise.white_m, noise.drift];
    let blob = Sha256::digest(blob).into();
    let content: Content<&StoredPosterior> = (blob, noise, triangle.collect(), known);
    // Into memory it does not fail.
    let mut bytes = postcard::to_extend(&content, MAGIC.to_vec()).unwrap_or_default();
    bytes.extend(Sha256::digest(&bytes));
    bytes
}

/// The SHA-256 of the blob and what is known.
///
/// # Errors
/// What is wrong with the file.
pub fn from_bytes(bytes: &[u8]) -> Result<([u8; 32], StoredPosterior), String> {
    let Some(start) = bytes.strip_prefix(MAGIC) else {
        return Err("it does not begin with HALLPOS4".to_owned());
    };
    let parts = start.split_last_chunk::<32>();
    let (content, hash) = parts.ok_or("it is cut")?;
    if Sha256::digest(&bytes[..MAGIC.len() + content.len()])[..] != hash[..] {
        return Err("it is damaged, its check does not fit".to_owned());
    }
    let content = postcard::from_bytes(content).map_err(|error| error.to_string())?;
    let (blob, noise, triangle, known): Content<StoredPosterior> = content;
    let [white_m, drift] = noise;
    let has_rows = |rows: &usize| triangle.len() == rows * (rows + 1) / 2;
    let rows = ROWS
        .into_iter()
        .find(has_rows)
        .ok_or("it has not 81 or 87 parameters")?;
    let covariance = DMatrix::from_fn(rows, rows, |i, j| {
        let (row, column) = (i.max(j), i.min(j));
        triangle[row * (row + 1) / 2 + column]
    });
    let mut figures = noise.as_flattened().iter().chain([&known.misfit]);
    if !figures.all(|x| *x >= 0.0 && x.is_finite())
        || !is_covariance(&covariance)
        || !known.budget.iter().all(Budget::is_finite)
    {
        return Err("its numbers are no noise and no covariance".to_owned());
    }
    let known = StoredPosterior {
        covariance,
        noise: Noise { white_m, drift },
        ..known
    };
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
pub(super) mod tests {
    use super::*;
    use hallstage_calibration::recalibrate::Certificates;
    use hallstage_input::dataset::Dataset;

    pub fn known() -> StoredPosterior {
        known_with_rows(COUNT)
    }

    fn known_with_rows(rows: usize) -> StoredPosterior {
        StoredPosterior {
            covariance: DMatrix::from_fn(rows, rows, |i, j| {
                let size = |k: usize| 1e-6 * (1.0 + k as f64);
                size(i) * size(j) * if i == j { 1.0 } else { 0.5 }
            }),
            noise: Noise {
                white_m: [5e-7, 4e-7, 6e-7],
                drift: [1e-7, 0.0, 2e-7],
            },
            misfit: 1.02,
            repaired: Vec::new(),
            budget: None,
            up_to: None,
            marks: vec![3],
            certificates: Certificates {
                own: "7".to_owned(),
                before: vec!["6".to_owned()],
            },
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let bytes = to_bytes(b"blob", &known());
        assert_eq!(
            from_bytes(&bytes),
            Ok((Sha256::digest(b"blob").into(), known()))
        );
        let repaired = StoredPosterior {
            repaired: vec![
                "the gain of Hall B changes by 1 µV".to_owned(),
                "a step".to_owned(),
            ],
            ..known()
        };
        let bytes = to_bytes(b"blob", &repaired);
        assert_eq!(
            from_bytes(&bytes),
            Ok((Sha256::digest(b"blob").into(), repaired))
        );
        let with_temperature = known_with_rows(COUNT + 6);
        let bytes = to_bytes(b"blob", &with_temperature);
        assert_eq!(
            from_bytes(&bytes),
            Ok((Sha256::digest(b"blob").into(), with_temperature))
        );
    }

    #[test]
    fn a_posterior_of_any_number_of_logs_can_be_read() {
        let mut known = known_with_rows(COUNT + 6);
        known.marks = vec![u32::MAX; 1 << 18];
        let bytes = to_bytes(b"blob", &known.with_logs(&Dataset::default()));
        assert!((bytes.len() as u64) < BYTES_MAX / 2, "{}", bytes.len());
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
            assert_eq!(read(&set, &path).expect("sound").as_ref(), known);
        }
    }

    #[test]
    fn what_is_damaged_cut_or_no_covariance_is_refused() {
        let bytes = to_bytes(b"blob", &known());
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
            let sound = from_bytes(&to_bytes(b"blob", &known));
            assert!(sound.is_err(), "{value}");
        }
    }
}
