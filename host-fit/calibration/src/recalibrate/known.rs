//! What is kept beside a blob: its posterior, marks of the rows that it was fitted to, and its certificate.

use crate::budget::Budget;
use crate::fit::Fit;
use crate::judge::in_motion::UpTo;
use hallstage_input::dataset::{Dataset, LogSource, Row};
use hallstage_solver::estimator::whiten::Noise;
use nalgebra::DMatrix;
use runtime::ParameterSet;
use serde::{Deserialize, Serialize};

/// Marks of a log.
const MARKS: usize = 256;
/// Marks that are kept.
const MARKS_MAX: usize = 256 * MARKS;
/// Marks that a log and the logs of a fit share only where it is one of them, or a part: 1 s of 30 in half of
/// the cases, 2 s always.
const SHARED_MIN: usize = 8;
/// Numbers of certificates that are kept.
const NUMBERS_MAX: usize = 1000;

/// What is kept of a fit of the field model beside its blob: the prior of a recalibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredPosterior {
    /// Covariance of the parameters, and of k and h: see [`Posterior::covariance`](hallstage_solver::estimator::posterior::Posterior::covariance).
    #[serde(skip)]
    pub covariance: DMatrix<f64>,
    /// The noise of the log.
    #[serde(skip)]
    pub noise: Noise,
    /// Chi-square over residuals of the fit; above 1 where the model is incomplete.
    pub misfit: f64,
    /// The faults of the log that the calibration is without, in words: see
    /// [`Repair`](crate::fit::Repair).
    pub repaired: Vec<String>,
    /// The uncertainty in service, source by source.
    pub budget: Option<Budget>,
    /// The largest motion with good errors, without correction.
    pub up_to: Option<UpTo>,
    /// Marks of the logs that the blob was fitted to, of the latest 256.
    pub marks: Vec<u32>,
    /// The certificates of it, and of the calibrations before it.
    pub certificates: Certificates,
}

/// The numbers of the certificates of a calibration, and of those that it replaces or was recalibrated from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Certificates {
    /// Of the calibration; empty without one.
    pub own: String,
    /// Of the calibrations before it, the latest last.
    pub before: Vec<String>,
}

impl Certificates {
    /// Those of a calibration that comes after it, and has no certificate yet.
    #[must_use]
    pub fn next(mut self) -> Self {
        if !self.own.is_empty() {
            self.before.push(std::mem::take(&mut self.own));
        }
        let beyond = self.before.len().saturating_sub(NUMBERS_MAX);
        self.before.drain(..beyond);
        self
    }

    /// The same once the calibration has a certificate with this number.
    #[must_use]
    pub fn with(self, number: String) -> Self {
        match self.own == number {
            true => self,
            false => Self {
                own: number,
                ..self.next()
            },
        }
    }

    /// Whether an earlier calibration has this number, in upper or lower case.
    pub fn has(&self, number: &str) -> bool {
        let plain = |number: &str| number.trim().to_lowercase();
        self.before.iter().any(|of| plain(of) == plain(number))
    }
}

impl StoredPosterior {
    /// Of a fit; `None` of other models than the field model.
    pub fn from_fit(fit: &Fit) -> Option<Self> {
        let figures = fit.field.as_ref()?;
        let score = figures.score;
        Some(Self {
            covariance: fit.estimate.posterior.covariance.clone(),
            noise: Noise {
                white_m: fit.estimate.posterior.white_m,
                ..figures.noise
            },
            misfit: score.chi_squared / score.residuals.max(1) as f64,
            repaired: Vec::new(),
            budget: None,
            up_to: None,
            marks: Vec::new(),
            certificates: Certificates::default(),
        })
    }

    /// The same of a blob that was fitted to these logs, too.
    #[must_use]
    pub fn with_logs(mut self, dataset: &Dataset) -> Self {
        for log in &dataset.logs {
            self.marks.extend(marks(dataset, log).iter().take(MARKS));
        }
        let beyond = self.marks.len().saturating_sub(MARKS_MAX);
        self.marks.drain(..beyond);
        self
    }
}

/// A hash of the codes of each row that has no equal in its log, in ascending order. The first ones mark the log: they are rows
/// at random, so an excerpt, in whatever form, has its share of them.
fn marks(dataset: &Dataset, log: &LogSource) -> Vec<u32> {
    let rows = dataset.rows.get(log.rows.clone()).unwrap_or_default();
    let mark = |row: &Row| {
        let vertical = row
            .frame
            .vertical
            .map(|pose| pose.to_array().map(f32::to_bits));
        let codes = row
            .frame
            .capacitive()
            .unwrap_or_default()
            .map(i32::cast_unsigned);
        let hall = row.frame.hall().map(i32::cast_unsigned);
        let words = [hall, vertical.unwrap_or(codes)].concat().into_iter();
        // FNV-1a by words, and the mixing of MurmurHash3, so that the smallest ones are spread over the log.
        let hash = words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x100_0000_01b3)
        });
        let mixed = (hash ^ hash >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
        (mixed >> 32) as u32
    };
    let mut all: Vec<u32> = rows.iter().map(mark).collect();
    all.sort_unstable();
    let alone = all.chunk_by(PartialEq::eq).filter(|same| same.len() == 1);
    alone.map(|same| same[0]).collect()
}

/// The names of the logs that a blob was fitted to, whole or in part: they are no evidence of it.
pub fn own_logs(
    set: &ParameterSet,
    known: Option<&StoredPosterior>,
    dataset: &Dataset,
) -> Vec<String> {
    let is_same = set.logs_sha256 == dataset.sha256;
    let of_fit = known.map_or(&[][..], |known| &known.marks);
    let is_own = |log: &&LogSource| {
        let marks = marks(dataset, log);
        let shared = marks.iter().filter(|mark| of_fit.contains(mark)).count();
        is_same || log.sha256 == set.logs_sha256 || shared >= SHARED_MIN
    };
    let own = dataset.logs.iter().filter(is_own);
    own.map(LogSource::name).collect()
}
