//! The decision rule of a certificate (ISO/IEC 17025, 7.8.6, JCGM 106): the errors that are accepted.

use super::figure::{Group, group, micro};
use hallstage_calibration::budget::Budget;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::diagnose::refusal::{Beyond, Refusal};
use hallstage_calibration::judge::predicted::Predicted;
use hallstage_calibration::judge::verdict::{LIMITED_MAX, Verdict};
use hallstage_input::axis::{Axis, PLANAR, sign};
use hallstage_input::stage::Stage;

/// Standard uncertainties of an error that cover 95 % of its magnitudes.
const COVERED: f64 = 1.96;

/// Limits of the rms errors of X, Y, Rz: m, m, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Decision {
    /// The limits that are asked for.
    pub limits: [Option<f64>; 3],
    /// The guard bands that are taken off these limits; `None` for simple acceptance.
    pub guards: Option<[f64; 3]>,
    /// 1.30 times the noise floor, where it is a limit, too.
    pub of_noise: [Option<f64>; 3],
    /// Whether the limits hold for the errors in service, in place of the errors on the log.
    pub in_service: bool,
}

impl Decision {
    /// These limits of the errors in service of a calibration, if they are predicted, else the limits of its errors on the log.
    pub fn new(
        [in_service, on_log]: [[Option<f64>; 3]; 2],
        stage: &Stage,
        diagnosis: &Diagnosis,
        is_field: bool,
    ) -> Self {
        let predicted = diagnosis.predicted.as_ref().filter(|_| is_field);
        predicted.map_or(Self::on_log(on_log), |predicted| {
            let by = (predicted, diagnosis.budget.as_ref());
            Self::in_service(
                in_service,
                stage.certificate.is_guarded,
                by,
                diagnosis.verdict,
            )
        })
    }

    /// The limits of errors on a log.
    pub fn on_log(limits: [Option<f64>; 3]) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// The limits of errors in service. A guard band is the amount that the rms error may be larger than predicted with 95 %:
    /// by the log, and by the declared inputs of the budget. Late or disturbed sensors may exceed 1.30 times the noise floor
    /// without a refusal by the verdict: the calibration is not at fault.
    pub fn in_service(
        limits: [Option<f64>; 3],
        is_guarded: bool,
        (predicted, budget): (&Predicted, Option<&Budget>),
        verdict: Option<Verdict>,
    ) -> Self {
        let declared = budget.map_or([0.0; 3], Budget::declared);
        let guard =
            |k: usize| predicted.range[k][1].hypot(COVERED * declared[k]) - predicted.rms[k];
        let of_noise = |k: usize| {
            let limit = LIMITED_MAX * predicted.noise(k);
            let counts = verdict == Some(Verdict::Refused) || predicted.rms[k] <= limit;
            counts.then_some(limit)
        };
        Self {
            limits,
            guards: is_guarded.then(|| [0, 1, 2].map(guard)),
            of_noise: [0, 1, 2].map(of_noise),
            in_service: true,
        }
    }

    /// The largest error of an axis that is accepted; `None` where any will do.
    pub fn accepted(&self, axis: usize) -> Option<f64> {
        let guard = self.guards.map_or(0.0, |guards| guards[axis]);
        let asked = self.limits[axis].map(|limit| (limit - guard).max(0.0));
        asked
            .into_iter()
            .chain(self.of_noise[axis])
            .reduce(f64::min)
    }

    /// Whether each error is accepted; `None` without a limit.
    pub fn passes(&self, rms: [f64; 3]) -> [Option<bool>; 3] {
        [0, 1, 2].map(|axis| self.accepted(axis).map(|limit| rms[axis] <= limit))
    }

    /// The refusal of rms errors (m, m, rad) beyond their limits.
    pub fn refusal(&self, rms: [f64; 3]) -> Option<Refusal> {
        let beyond = |k: usize| {
            let (axis, limit, rms) = (&PLANAR[k], self.accepted(k)?, rms[k]);
            (rms > limit).then_some(Beyond { axis, rms, limit })
        };
        let errors: Vec<Beyond> = (0..3).filter_map(beyond).collect();
        let is_in_service = self.in_service;
        (!errors.is_empty()).then_some(Refusal::BeyondLimit {
            errors,
            is_in_service,
        })
    }

    /// The rule in words; `None` without a limit.
    pub fn text(&self) -> Option<String> {
        let by_axis = |text: &dyn Fn(usize) -> Option<String>| {
            let text = |(k, axis): (usize, &Axis)| {
                Some(format!("{} {} {}", axis.name, text(k)?, sign(axis.micro)))
            };
            let texts: Vec<String> = PLANAR.iter().enumerate().filter_map(text).collect();
            (!texts.is_empty()).then(|| texts.join(", "))
        };
        let asked = by_axis(&|k| {
            let limit = self.limits[k]? * 1e6;
            Some(match self.guards.map(|guards| guards[k] * 1e6) {
                Some(guard) => format!("{limit:.3} - {guard:.3} = {:.3}", (limit - guard).max(0.0)),
                None => format!("{limit:.2}"),
            })
        });
        let of_noise = by_axis(&|k| Some(format!("{:.2}", self.of_noise[k]? * 1e6)));
        let guarded = asked.as_ref().and(self.guards);
        let asked = asked.map(|limits| match guarded {
            Some(_) => format!("the limit less a guard band: {limits}"),
            None => format!("the limit: {limits}"),
        });
        let is_open = self.in_service && self.of_noise.contains(&None);
        let of_noise = of_noise.map(|limits| {
            let open = match is_open {
                true => " (not where late or disturbed sensors exceed it)",
                false => "",
            };
            format!("{LIMITED_MAX:.2} times the noise of the sensors: {limits}{open}")
        });
        let limits: Vec<String> = asked.into_iter().chain(of_noise).collect();
        let (kind, meaning) = match guarded {
            Some(_) => (
                "guarded",
                ". The guard band is the uncertainty of the rms error, by the log (one-sided 95 %) and by the declared inputs (1.96 \
                 standard uncertainties)",
            ),
            None => ("simple", ""),
        };
        let place = if self.in_service {
            "in service"
        } else {
            "on the log"
        };
        (!limits.is_empty()).then(|| {
            let limits = limits.join("; and at most ");
            format!("{kind} acceptance (JCGM 106): rms errors {place} at most {limits}{meaning}")
        })
    }

    /// Error, limit and pass of each axis, for programs.
    pub fn figures(&self, rms: [f64; 3], passes: [Option<bool>; 3]) -> Group {
        let axis = |(k, axis): (usize, &Axis)| {
            let figures = group! {
                "error" => micro(axis, rms[k]),
                "limit" => micro(axis, self.accepted(k).unwrap_or(f64::NAN)),
                "pass" => passes[k],
            };
            (axis.key.to_owned(), figures.into())
        };
        Group(PLANAR.iter().enumerate().map(axis).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guarded_limit_is_less_what_the_error_may_be_larger_than_predicted() {
        let predicted = Predicted {
            rms: [1e-6; 3],
            ratio: [1.0; 3],
            range: [[0.9e-6, 1.2e-6]; 3],
        };
        let limits = [Some(1.1e-6), Some(1.5e-6), Some(1.25e-6)];
        let rule = |is_guarded, of: &Predicted, verdict| {
            Decision::in_service(limits, is_guarded, (of, None), Some(verdict))
        };
        let simple = rule(false, &predicted, Verdict::Good);
        assert_eq!(simple.refusal(predicted.rms), None);
        assert_eq!(simple.accepted(1), Some(LIMITED_MAX * 1e-6));
        let guarded = rule(true, &predicted, Verdict::Good);
        let refused = guarded.refusal(predicted.rms).map(|refusal| match refusal {
            Refusal::BeyondLimit { errors, .. } => errors.iter().map(|e| e.axis.key).collect(),
            _ => Vec::new(),
        });
        assert_eq!(refused, Some(vec!["x"]));
        assert_eq!(guarded.passes([0.89e-6; 3])[0], Some(true));
        let text = guarded.text().expect("a rule");
        for part in [
            "guarded acceptance",
            "Y 1.500 - 0.200 = 1.300 µm",
            "Rz 1.30 µrad",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn what_sensors_that_stay_late_exceed_is_no_limit_and_is_not_called_one() {
        let predicted = Predicted {
            rms: [1.4e-6, 1e-6, 1e-6],
            ratio: [1.4, 1.0, 1.0],
            range: [[1e-6; 2]; 3],
        };
        let rule =
            |verdict| Decision::in_service([None; 3], false, (&predicted, None), Some(verdict));
        let [refused, limited] = [Verdict::Refused, Verdict::Limited].map(rule);
        assert_eq!(refused.passes(predicted.rms)[0], Some(false));
        assert_eq!(limited.passes(predicted.rms)[0], None);
        let text = |of: Decision| of.text().expect("a rule");
        assert!(text(refused).contains("X 1.30 µm"));
        let limited = text(limited);
        assert!(
            !limited.contains("X 1.30") && limited.contains("not where late"),
            "{limited}"
        );
    }

    #[test]
    fn a_rule_without_limits_is_none_and_a_rule_of_a_log_says_so() {
        assert_eq!(Decision::on_log([None; 3]).text(), None);
        let text = Decision::on_log([None, Some(2e-6), None]).text();
        assert_eq!(
            text.as_deref(),
            Some(
                "simple acceptance (JCGM 106): rms errors on the log at most the limit: Y 2.00 µm"
            )
        );
    }
}
