//! The limits that the tests of the diagnosis share.

use hallstage_input::finding::Severity;
pub(super) use hallstage_input::statistics::CLEAR;

/// Prior odds: one log in 100 has a fault large enough to matter.
pub(super) const RARITY: f64 = 100.0;
/// Two causes are undecided where their chi-squares differ by less: odds of 20 to 1.
pub(super) const UNDECIDED: f64 = 6.0;
/// Rounds until an estimate that is not linear settles.
pub(super) const ROUNDS: usize = 8;
/// A long log is scanned in about this many means: a scan is quick, and onsets are known within 0.1 s.
pub(super) const MEANS_MAX: usize = 4000;
/// An axis that moves by a smaller or a larger part of its declared range may have a wrong scale: no log shows a
/// scale that all channels of a kind share.
pub(super) const SPANS: (f64, f64) = (0.1, 2.0);
/// Errors beyond this many times their white noise are more than the drift of an interferometer.
pub const ERROR_TO_NOISE_MAX: f64 = 3.0;

/// A fault in this share of the rows, of the noise or of a period is worth a warning.
const WARN_MIN: f64 = 0.02;
/// A fault in this share of the rows is refused: the rest may be another stage than the log shows.
const REFUSED_MIN: f64 = 0.08;

/// The severity of a fault by its share of the rows, of the noise or of a period.
pub(super) const fn severity_of_share(share: f64) -> Severity {
    match share {
        REFUSED_MIN.. => Severity::Refuse,
        WARN_MIN.. => Severity::Warn,
        _ => Severity::Note,
    }
}
