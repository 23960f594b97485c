//! Which mistake alone explains a log: each [`Hypothesis`] is undone and the log fitted again.
//!
//! Every mistake with order, sign or scale is a linear change of the Hall signals, of the reference
//! or of the vertical pose, and Model (31) with free parameters absorbs it: the residual stays that
//! of the sound log. What gives it away is where the parameters end up. So a hypothesis explains
//! the log if, undone, the fit within the search ranges of `stage.toml` is as good as the fit without
//! them, and the vertical terms put each probe where it stands: phi falls with the height at the
//! probe, a (Z + y Rx - x Ry), so that b/a = y and c/a = -x.

use super::finding::{Code, Finding, Severity};
use super::hypothesis::{Hypothesis, Scale, planar, scale, vertical};
use super::trials::{Trial, Trials, unlimited, zeros_free};
use super::{warning, zeros};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use runtime::ModelKind;

/// Scales within this factor of the designed ones are no mistake but tolerances.
const FACTOR_MIN: f64 = 1.4;
/// Factors beyond this are a unit, not a scale.
const FACTOR_OF_UNITS: f64 = 30.0;

/// What keeps a log from being fitted as it is: the mistake that alone explains it, with severity
/// [`Severity::Refuse`], or that there is none that does.
pub fn causes(dataset: &Dataset, stage: &Stage) -> Vec<Finding> {
    // What does not move shows no mistake.
    let planar_model = Model::of(ModelKind::M30);
    if check_motion(dataset, stage, dataset.rows.len(), planar_model).is_err() {
        return Vec::new();
    }
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trials = Trials::new(dataset, stage, &zeros_free, &unlimited);
    let Some(plain) = trials.of(None) else {
        return Vec::new();
    };
    let mut findings: Vec<Finding> = zeros::clipped(dataset, stage, trials.problem(), &plain.free)
        .into_iter()
        .collect();
    if plain.fits() {
        return findings;
    }
    let mut hypotheses = planar(stage);
    if trials.has_codes() {
        hypotheses.extend(vertical(stage));
    }
    hypotheses.extend(scales(dataset, stage, &plain.free));
    let mut explaining: Vec<(&Hypothesis, Trial)> = (hypotheses.iter())
        .filter_map(|hypothesis| Some((hypothesis, trials.of(Some(hypothesis))?)))
        .filter(|(_, trial)| trial.fits())
        .collect();
    // The same change under two names is one.
    explaining.dedup_by(|(later, _), (earlier, _)| later.is_same_change(earlier));
    findings.extend(match explaining.as_slice() {
        [] => unexplained(&plain),
        [(hypothesis, trial)] => Some(named(dataset, stage, hypothesis, &plain, trial)),
        several => Some(Finding {
            severity: Severity::Refuse,
            message: format!(
                "the log does not fit as it is ({:.2} um rms within the search ranges, {:.2} um without them), and fits if {}: \
                 it cannot tell which. {WIRES_AND_STAGE}",
                plain.within_um,
                plain.free_um,
                several
                    .iter()
                    .map(|(hypothesis, trial)| format!("{} ({:.2} um)", hypothesis.cure, trial.within_um))
                    .collect::<Vec<_>>()
                    .join(", or if ")
            ),
            ..warning(Code::TermsAtLimit)
        }),
    });
    findings
}

const WIRES_AND_STAGE: &str = "Check wiring, columns and stage.toml";

fn named(
    dataset: &Dataset,
    stage: &Stage,
    hypothesis: &Hypothesis,
    plain: &Trial,
    trial: &Trial,
) -> Finding {
    let as_it_is = if plain.is_within() {
        "as it is, the sensitivity does not follow the height at the probes".to_owned()
    } else if plain.within_um.is_finite() {
        format!("as it is, {:.2} um are left", plain.within_um)
    } else {
        "as it is, not at all".to_owned()
    };
    let span = if hypothesis.factor.is_some() {
        format!(
            "; the reference spans {}, the Hall signals {}, and {} is the range of service",
            length(span_m(dataset, |row| row.reference)),
            length(span_m(dataset, |row| row.signal_m)),
            length(
                2.0 * stage.motion.axes[0]
                    .service
                    .max(stage.motion.axes[1].service)
            ),
        )
    } else {
        String::new()
    };
    Finding {
        severity: Severity::Refuse,
        message: format!(
            "the log fits if {} ({:.2} um rms by Model (31); {as_it_is}{span}): {}",
            hypothesis.cure, trial.within_um, hypothesis.remedy
        ),
        channel: hypothesis.channel.clone(),
        value: Some(hypothesis.factor.unwrap_or(trial.within_um)),
        unit: Some(if hypothesis.factor.is_some() {
            ""
        } else {
            "um"
        }),
        ..warning(hypothesis.code)
    }
}

/// A fit that needs more room than the search ranges give, for no reason that could be named.
fn unexplained(plain: &Trial) -> Option<Finding> {
    let message = if !plain.is_within() {
        format!(
            "within the search ranges of stage.toml the log fits to {:.2} um rms, without them to {:.2} um, and no single \
             mistake with channels, signs or scales explains it: check the designed values and the ranges in stage.toml",
            plain.within_um, plain.free_um
        )
    } else if !plain.is_in_place() {
        "the sensitivity of a probe does not follow the height at the place where stage.toml has it, and no single mistake \
         with the capacitive sensors explains it: check their order, signs and places, and the coordinates of the probes"
            .to_owned()
    } else {
        return None;
    };
    Some(Finding {
        message,
        value: Some(plain.within_um),
        unit: Some("um"),
        ..warning(Code::TermsAtLimit)
    })
}

/// The scales that the free parameters, which absorb them, show to be wrong.
fn scales(dataset: &Dataset, stage: &Stage, free: &Parameters) -> Vec<Hypothesis> {
    let mut out = Vec::new();
    let eta = free.eta().map(f64::abs);
    if let Some(ranges) = stage.search.of("eta") {
        let ratio = |k: usize| eta[k] / (0.5 * (ranges[k].low + ranges[k].high));
        let product = ratio(0) * ratio(1) * ratio(2);
        let too_large = rounded(product.cbrt());
        if is_scale(too_large) {
            let off = |span_m: f64| {
                let range = stage.motion.axes[0]
                    .service
                    .max(stage.motion.axes[1].service);
                (span_m / (2.0 * range)).ln().abs()
            };
            let reference = off(span_m(dataset, |row| row.reference));
            let is_unit = !(1.0 / FACTOR_OF_UNITS..FACTOR_OF_UNITS).contains(&too_large);
            if is_unit && reference > off(span_m(dataset, |row| row.signal_m)) {
                out.push(scale(Scale::Reference, too_large));
            } else {
                out.push(scale(Scale::Hall, 1.0 / too_large));
            }
        }
    }
    let arms = free.geometry().lever_arm_m;
    let designed = Parameters::designed(stage).geometry().lever_arm_m;
    let squares: f64 = designed.iter().map(|arm| arm * arm).sum();
    let product: f64 = arms.iter().zip(designed).map(|(arm, d)| arm * d).sum();
    let too_large = rounded(product / squares);
    if is_scale(too_large) {
        out.push(scale(Scale::Baseline, too_large));
    }
    out
}

fn is_scale(factor: f64) -> bool {
    factor.is_normal() && factor > 0.0 && !(1.0 / FACTOR_MIN..FACTOR_MIN).contains(&factor)
}

/// The power of ten, two or a half that lies within a third of the factor, else the factor itself.
fn rounded(factor: f64) -> f64 {
    let powers = (-12..=12).map(|power| 10f64.powi(power));
    let near = |round: &f64| (0.75..1.33).contains(&(factor / round));
    powers.chain([0.5, 2.0]).find(near).unwrap_or(factor)
}

/// The largest span of X and Y, or of the three probes, within a movement, m.
fn span_m(dataset: &Dataset, of: impl Fn(&Row) -> [f64; 3]) -> f64 {
    let mut span = 0.0f64;
    for movement in &dataset.movements {
        for axis in 0..2 {
            let values = || {
                dataset.rows[movement.rows.clone()]
                    .iter()
                    .map(|row| of(row)[axis])
            };
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            span = span.max(high - low);
        }
    }
    span
}

/// A length in words, in the unit that suits it.
fn length(m: f64) -> String {
    match m {
        m if m < 1e-3 => format!("{:.1} um", m * 1e6),
        m if m < 1.0 => format!("{:.1} mm", m * 1e3),
        m => format!("{m:.1} m"),
    }
}
