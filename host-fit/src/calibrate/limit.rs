//! Largest rms errors: `--limit x=1.5um,y=1um,rz=4urad`.

use hallstage_calibration::budget::Budget;
use hallstage_calibration::diagnose::refusal::{Beyond, Refusal};
use hallstage_calibration::judge::predicted::Predicted;
use hallstage_calibration::judge::verdict::{LIMITED_MAX, Verdict};
use hallstage_input::axis::PLANAR;
use hallstage_input::log::layout::Dimension;
use hallstage_input::stage::CertificateTable;
use std::str::FromStr;

/// Standard uncertainties of an error that cover 95 % of its magnitudes.
const COVERED: f64 = 1.96;
/// The kinds of units of X, Y, Rz.
const KINDS: [Dimension; 3] = [Dimension::Length, Dimension::Length, Dimension::Angle];

/// The largest rms errors of X, Y, Rz that a fit may have: m, m, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorLimits {
    /// Errors that are accepted: the limits less the guard bands; `None` where any will do.
    pub accepted: [Option<f64>; 3],
    /// The guard bands.
    pub guards: [f64; 3],
}

impl FromStr for ErrorLimits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut limits = Self::default();
        for part in text.split(',') {
            let wrong =
                || format!("`{part}` is no limit: write for instance x=1.5um,y=1um,rz=4urad");
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            let axis = PLANAR.iter().position(|axis| axis.key == name.trim());
            let axis = axis.ok_or_else(wrong)?;
            let is_digit = |c: char| c.is_ascii_digit() || c == '.';
            let (number, unit) = value.split_at(value.rfind(is_digit).map_or(0, |at| at + 1));
            let si = KINDS[axis].unit(unit).ok_or_else(wrong)?;
            let number = number.trim().parse();
            let number: f64 = number.map_err(|_| wrong())?;
            if !(number.is_finite() && number > 0.0) {
                return Err(format!("`{part}`: a limit above zero is needed"));
            }
            if limits.accepted[axis].replace(number * si).is_some() {
                return Err(format!("{name} has two limits"));
            }
        }
        Ok(limits)
    }
}

impl ErrorLimits {
    /// These, else the limits of the certificate. A guarded limit is less by the amount that the rms error may be
    /// larger than predicted with 95 %: by the log, and by the declared inputs of the budget.
    #[must_use]
    pub fn or(
        self,
        table: &CertificateTable,
        predicted: Option<&Predicted>,
        budget: Option<&Budget>,
    ) -> Self {
        let declared = budget.map_or([0.0; 3], Budget::declared);
        let guarded = predicted.filter(|_| table.is_guarded);
        let guard = |k: usize| {
            guarded.map_or(0.0, |of| {
                of.range[k][1].hypot(COVERED * declared[k]) - of.rms[k]
            })
        };
        let guards = [0, 1, 2].map(guard);
        let limit = |k: usize| self.accepted[k].or(table.limits[k]);
        Self {
            accepted: [0, 1, 2].map(|k| Some((limit(k)? - guards[k]).max(0.0))),
            guards,
        }
    }

    /// The refusal of errors in service beyond these limits; where the verdict refuses, also beyond the usual ones.
    pub fn refusal(&self, predicted: &Predicted, verdict: Option<Verdict>) -> Option<Refusal> {
        let is_refused = verdict == Some(Verdict::Refused);
        let usual = |k: usize| is_refused.then_some(LIMITED_MAX * predicted.noise(k));
        let limit = |k: usize| {
            self.accepted[k]
                .into_iter()
                .chain(usual(k))
                .reduce(f64::min)
        };
        let all = Self {
            accepted: [0, 1, 2].map(limit),
            ..*self
        };
        let errors = all.exceeded(predicted.rms);
        (!errors.is_empty()).then_some(Refusal::BeyondLimit {
            errors,
            is_in_service: true,
        })
    }

    /// The rms errors (m, m, rad) that are beyond their limits.
    pub fn exceeded(&self, rms: [f64; 3]) -> Vec<Beyond> {
        let beyond = |axis: usize| {
            let (limit, rms) = (self.accepted[axis]?, rms[axis]);
            let axis = &PLANAR[axis];
            (rms > limit).then_some(Beyond { axis, rms, limit })
        };
        (0..3).filter_map(beyond).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_with_their_units() {
        let read = |text: &str| text.parse::<ErrorLimits>().map(|limits| limits.accepted);
        assert_eq!(
            read("x=1.5um, rz = 4 urad"),
            Ok([Some(1.5 * 1e-6), None, Some(4.0 * 1e-6)])
        );
        assert_eq!(read("y=2mm"), Ok([None, Some(2.0 * 1e-3), None]));
        for wrong in [
            "",
            "x",
            "x=1",
            "x=um",
            "z=1um",
            "rz=1um",
            "x=-1um",
            "x=NaNum",
            "x=1um,x=2um",
            "x=1um,",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_guarded_limit_is_less_what_the_error_may_be_larger_than_predicted() {
        let predicted = Predicted {
            rms: [1e-6; 3],
            ratio: [1.0; 3],
            range: [[0.9e-6, 1.2e-6]; 3],
        };
        let mut table = CertificateTable {
            limits: [Some(1.1e-6), None, Some(1.25e-6)],
            ..CertificateTable::default()
        };
        let given = ErrorLimits {
            accepted: [None, Some(1.5e-6), None],
            ..ErrorLimits::default()
        };
        let refused = |table: &CertificateTable| {
            let limits = given.or(table, Some(&predicted), None);
            let refusal = limits.refusal(&predicted, Some(Verdict::Good));
            refusal.map(|refusal| match refusal {
                Refusal::BeyondLimit { errors, .. } => errors.iter().map(|e| e.axis.key).collect(),
                _ => Vec::new(),
            })
        };
        assert_eq!(refused(&table), None);
        table.is_guarded = true;
        assert_eq!(refused(&table), Some(vec!["x"]));
        // The usual limit, 1.30 times the noise: a sensor that stays late does not refuse.
        let poor = Predicted {
            ratio: [1.4; 3],
            ..predicted
        };
        let usual = |verdict| {
            ErrorLimits::default()
                .refusal(&poor, Some(verdict))
                .is_some()
        };
        assert!(usual(Verdict::Refused) && !usual(Verdict::Limited));
    }
}
