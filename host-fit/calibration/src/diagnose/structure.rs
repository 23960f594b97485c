//! Mistakes between stage, wires, log and `stage.toml`: order, signs and scales of channels, places of sensors.
//!
//! Every such mistake is a linear change of the Hall signals, of the reference or of the vertical pose. A probe that is
//! fitted by itself absorbs it without a larger residual, but its parameters come out wrong. So each probe is fitted
//! once, and a mistake that is set right is a change of its parameters. Then its direction, lever arm and sensitivity
//! must agree with the drawing, and the sensitivity must fall with the height at its place: b/a = y and c/a = -x.

use super::limits::{MEANS_MAX, RARITY, ROUNDS, SPANS, UNDECIDED};
use super::mistakes::{Mistake, Transform, cause, mistakes};
use crate::judge::identify::check_motion;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::{Input, Range, Stage};
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::{FALL_PER_M, FieldParameters, place};
use hallstage_solver::estimator::rows::{FieldRow, Rows};
use hallstage_solver::estimator::terms::{CARRY, ETA, LEVER_ARM, PER_PROBE, SLOPES, THETA};
use nalgebra::{Cholesky, DMatrix, Matrix3, SMatrix, SVector, Vector3};
use runtime::ModelKind;
use runtime::geometry::SensingAxes;

/// For how long a model errs alike, s: its errors go with the motion. What stays unexplained
/// counts as one residual in that time.
const ALIKE_S: f64 = 0.5;
/// Unknowns of a probe: gains and their slopes, the shift of the probe by height and tilts, and the lags of the beams.
const UNKNOWNS: usize = 12;

/// Tolerances, standard deviations, up to four times the spread of simulated stages: of theta, and of a/eta (1/mm).
const TOLERANCES: [f64; 2] = [0.04, 0.025];
/// The same of a lever arm, m: from the drawing, and from the place that the slopes of the field model show.
const LEVER_ARMS_M: [f64; 2] = [0.035, 0.004];
/// b/eta and c/eta show the place of a probe. Magnets turn it by a third of the tolerance of the place.
const SLOPES_TO_PLACE: f64 = 4.0 / 3.0 * -FALL_PER_M * UNIT;
/// A sensitivity that nothing is known of.
const ANY_ETA: Range = Range::new(0.5, 1.5);
/// Columns of a fit are in this unit, m and rad: all unknowns are then about as large.
const UNIT: f64 = 1e-3;
/// Precision of a weak prior over the residual's, in this unit: unknowns that the log does not show stay finite.
const WEAK: f64 = 0.01;
/// Sum of squared distances over tolerances of three probes: one sound log in a thousand has more.
const SOUND_MAX: f64 = 42.0;

/// Magnets of another workshop are up to this many times the tolerances off. Residuals and prediction show their
/// cost.
const UNUSUAL_MAX: f64 = 2.0;
/// Farther off, several mistakes at once are likely.
const STRANGE_MAX: f64 = 4.0;
/// Mistakes are linear. They are no cause where more than this part of the variance of a signal is not linear.
const LEFT_MAX: f64 = 0.1;

type Vector = SVector<f64, 6>;
type Covariance = SMatrix<f64, 6, 6>;

/// Parameters of the field model with their covariance.
pub(super) type Known<'a> = (&'a FieldParameters, &'a DMatrix<f64>);

/// A probe fitted by itself: gains by X, Y, Rz, and slopes over gain by Z, Rx, Ry, per [`UNIT`].
#[derive(Clone, Copy, Debug)]
struct Fitted {
    at: Vector,
    covariance: Covariance,
    /// The part of the variance of the signal that is left.
    left: f64,
}

impl Fitted {
    /// A probe by a fit of the field model.
    fn of_field(probe: usize, (parameters, covariance): Known<'_>) -> Self {
        let at = |values: &[f64]| {
            let (eta, [along_x, along_y]) =
                (values[ETA], SensingAxes::at([values[THETA]; 3]).0[probe]);
            let gains = [along_x, along_y, values[LEVER_ARM]].map(|by| eta * by);
            let slopes = values[SLOPES..CARRY].iter().map(|slope| slope / eta * UNIT);
            Vector::from_iterator(gains.into_iter().chain(slopes))
        };
        let values = parameters.probes[probe];
        let mut by = Covariance::zeros();
        for k in 0..CARRY {
            let mut moved = values;
            let step = 1e-6 * values[k].abs().max(1e-3);
            moved[k] += step;
            by.set_column(k, &((at(&moved) - at(&values)) / step));
        }
        let own = probe * PER_PROBE;
        let known = covariance.fixed_view::<CARRY, CARRY>(own, own);
        Self {
            at: at(&values),
            covariance: by * known * by.transpose(),
            left: 0.0,
        }
    }
}

/// The mistake that explains a log of another stage than designed, if there is one; `None` for a log without motion.
/// A mistake can also make parts of the log `disagree`: then weaker evidence is a warning. A fit of the field model knows
/// the probes better.
pub fn structure(
    dataset: &Dataset,
    stage: &Stage,
    disagree: bool,
    field: Option<Known<'_>>,
) -> Option<Finding> {
    let planar = Model::from_kind(ModelKind::M30);
    check_motion(dataset, stage, dataset.rows.len(), planar).ok()?;
    // A log may be thinned.
    let period_s = dataset.period_s(0..dataset.rows.len());
    let by_itself = fitted(dataset, period_s.unwrap_or(stage.servo_period_s));
    let each = by_itself.iter().flatten().zip(Channel::SINGLE);
    let strange = each.filter_map(|(of, channel)| (of.left > LEFT_MAX).then_some(channel));
    let strange: Vec<Channel> = strange.collect();
    let spans = spans(dataset);
    // A probe along an axis that hardly moves shows all but a line.
    let moves = beyond_motion(stage, &spans, &Transform::nothing()) == 0.0;
    if moves && !strange.is_empty() {
        let found = Finding::new(Kind::NotLinear {}).with_severity(Severity::Refuse);
        return Some(Finding {
            channels: strange,
            ..found
        });
    }
    let fitted = match field {
        Some(known) => [0, 1, 2].map(|probe| Fitted::of_field(probe, known)),
        None => by_itself?,
    };
    let drawing = Drawing::new(stage, field.is_some());
    let distance = |change: &Transform| drawing.distance(&fitted, change);
    let as_logged = distance(&Transform::nothing());
    let mut rows = dataset.rows.iter();
    let mut mistakes = mistakes(stage, rows.all(|row| row.frame.capacitive().is_some()));
    // Chance does not lower the distance by more than this.
    let usual = mistakes.iter().filter(|mistake| mistake.penalty == 0.0);
    let sure = 2.0 * libm::log(RARITY * usual.count() as f64);
    let likely = if disagree { UNDECIDED } else { sure };
    // The declared motion separates mistakes that the geometry cannot.
    let rank = |mistake: &Mistake| {
        let of_motion = beyond_motion(stage, &spans, &mistake.change);
        distance(&mistake.change) + of_motion + mistake.penalty
    };
    if as_logged < likely {
        mistakes.retain(Mistake::is_other_pass);
    }
    let ranks = mistakes.iter().map(rank);
    let mut ranked: Vec<(f64, &Mistake)> = ranks.zip(&mistakes).collect();
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let gain = as_logged - ranked.first()?.0;
    if gain < likely {
        // Single pass taken for double pass needs no odds for a warning: it is common, and a factor of two in each pose.
        ranked.retain(|(rank, mistake)| mistake.is_other_pass() && *rank < as_logged);
    }
    let is_sure = gain > sure;
    let least = ranked.first().map_or(f64::INFINITY, |(rank, _)| *rank);
    if least > SOUND_MAX {
        let tolerances = (as_logged / SOUND_MAX).sqrt();
        let severity = match tolerances {
            ..1.0 => return None,
            ..UNUSUAL_MAX => Severity::Note,
            ..STRANGE_MAX => Severity::Warn,
            _ => Severity::Refuse,
        };
        let found = Finding::new(Kind::OtherProbes { tolerances });
        return Some(found.with_severity(severity));
    }
    let near = ranked
        .iter()
        .take_while(|(rank, _)| *rank < least + UNDECIDED);
    let mut named: Vec<Vec<&Mistake>> = Vec::new();
    for &(_, mistake) in near {
        match named
            .iter_mut()
            .find(|alike| alike[0].correction == mistake.correction)
        {
            Some(alike) => alike.push(mistake),
            None => named.push(vec![mistake]),
        }
    }
    Some(finding(&named, is_sure))
}

fn finding(named: &[Vec<&Mistake>], is_sure: bool) -> Finding {
    let may_be_magnets = named.iter().any(|alike| alike[0].may_be_magnets);
    let found = Finding::new(Kind::Mistake {
        code: named[0][0].code,
        causes: named.iter().map(|alike| cause(alike)).collect(),
        is_sure,
        may_be_magnets,
    });
    // Other magnets are no mistake, and scales of gaps make heights and tilts wrong, not X, Y, Rz.
    let leaves_pose = named.iter().flatten().all(|mistake| mistake.leaves_pose());
    let severity = match is_sure && !may_be_magnets && !leaves_pose {
        true => Severity::Refuse,
        false => Severity::Warn,
    };
    let channels = match named {
        [alike] => alike[0].correction.channels(),
        _ => Vec::new(),
    };
    Finding {
        channels,
        severity,
        ..found
    }
}

/// The probes in the drawing.
struct Drawing {
    eta: [f64; 3],
    theta: [f64; 3],
    places: [[f64; 2]; 3],
    /// Whether slopes show places well enough for lever arms.
    has_slopes: bool,
    tolerances: [Vector; 3],
}

impl Drawing {
    fn new(stage: &Stage, has_slopes: bool) -> Self {
        let geometry = Parameters::designed(stage).geometry();
        let etas = stage.search.get("eta").unwrap_or([ANY_ETA; 3]);
        let (eta, places) = (
            etas.map(|range| 0.5 * (range.low + range.high)),
            stage.places_m(),
        );
        let known = |input: Input| stage.uncertainty.known(input);
        // Parts of a lever arm and of a place.
        let turn = known(Input::Baseline) / stage.interferometer.y_baseline_m;
        let sides = stage.capacitive_probes_m.map(|[x, y]| x.hypot(y));
        let tilt = known(Input::GapPlaces) / sides.into_iter().fold(f64::MIN_POSITIVE, f64::max);
        let tolerances = [0, 1, 2].map(|probe| {
            let of_eta = etas[probe].width() / (eta[probe] * 12f64.sqrt());
            let [of_theta, of_fall] = TOLERANCES;
            let of_lever_arm = LEVER_ARMS_M[usize::from(has_slopes)];
            let [x, y] = places[probe];
            let reach = x.hypot(y);
            let of_place = SLOPES_TO_PLACE * known(Input::ProbePlaces).hypot(reach * tilt);
            Vector::from([
                of_eta,
                of_theta,
                of_lever_arm.hypot(reach * turn.hypot(tilt)),
                of_fall.hypot(FALL_PER_M * UNIT * known(Input::GapScale)),
                of_place,
                of_place,
            ])
        });
        Self {
            eta,
            theta: geometry.misalignment_rad,
            places,
            has_slopes,
            tolerances,
        }
    }

    /// The differences of a fitted probe from the drawing.
    fn features(&self, probe: usize, at: &Vector) -> Vector {
        let [x, y, turn, a, b, c] = (*at).into();
        // A and B sense Y, C senses X.
        let theta = match probe {
            2 => libm::atan2(y, x),
            _ => libm::atan2(-x, y),
        };
        let off = theta - self.theta[probe];
        let eta = x.hypot(y).max(f64::MIN_POSITIVE);
        let [place_x, place_y] = self.places[probe];
        let mut slopes = [0.0; PER_PROBE];
        if self.has_slopes {
            slopes[SLOPES..CARRY].copy_from_slice(&[a, b, c].map(|slope| slope / UNIT));
        }
        let [there_x, there_y] = place(&slopes, self.places[probe]).0;
        let (sin, cos) = libm::sincos(theta);
        let lever_arm = match probe {
            2 => there_x * sin - there_y * cos,
            _ => there_x * cos + there_y * sin,
        };
        Vector::from([
            libm::log(eta / self.eta[probe]),
            libm::atan2(libm::sin(off), libm::cos(off)),
            turn / eta - lever_arm,
            a - FALL_PER_M * UNIT,
            b - a * place_y,
            c + a * place_x,
        ])
    }

    /// Sum of squared differences of three probes over tolerances and uncertainties of the fit.
    fn distance(&self, fitted: &[Fitted; 3], change: &Transform) -> f64 {
        let of_probe = |probe: usize| self.distance_of(probe, fitted, change);
        let all = (0..3).map(of_probe);
        all.map(|of| of.unwrap_or(f64::INFINITY)).sum()
    }

    fn distance_of(&self, probe: usize, fitted: &[Fitted; 3], change: &Transform) -> Option<f64> {
        let Transform([signal, reference, vertical]) = change;
        let from = (0..3).find(|&from| signal[(probe, from)] != 0.0)?;
        let by_gain = reference.try_inverse()?.transpose() * signal[(probe, from)];
        let by_slope = vertical.try_inverse()?.transpose();
        let mut turned = Covariance::zeros();
        turned.fixed_view_mut::<3, 3>(0, 0).copy_from(&by_gain);
        turned.fixed_view_mut::<3, 3>(3, 3).copy_from(&by_slope);
        let at = turned * fitted[from].at;
        let here = self.features(probe, &at);
        let mut by = Covariance::zeros();
        for k in 0..6 {
            let step = 1e-6 * at.fixed_rows::<3>(k / 3 * 3).norm().max(1e-9);
            let moved = at + step * Vector::ith(k, 1.0);
            by.set_column(k, &((self.features(probe, &moved) - here) / step));
        }
        let by = by * turned;
        let tolerances = self.tolerances[probe].map(|x| x * x);
        let open = by * fitted[from].covariance * by.transpose();
        let spread = Cholesky::new(Covariance::from_diagonal(&tolerances) + open)?;
        Some(here.dot(&spread.solve(&here)))
    }
}

/// Each Hall signal by itself: s = (1 + a Z + b Rx + c Ry) g q + e V + f dq/dt + a constant of each movement. The
/// residuals follow the motion, so neighbours are alike; `None` where too few others show how large they are.
fn fitted(dataset: &Dataset, period_s: f64) -> Option<[Fitted; 3]> {
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let rows = Rows::new(dataset, &all);
    let apart = all.len().div_ceil(MEANS_MAX);
    let count = all.len() as f64 / apart as f64;
    let others = count.min(all.len() as f64 * period_s / ALIKE_S);
    // For the mean of a variance over all that its residuals allow.
    let freedom = others - (UNKNOWNS + rows.movements.len() + 2) as f64;
    let of_probe = |probe: usize| {
        let mut at = SVector::<f64, UNKNOWNS>::zeros();
        let mut covariance = SMatrix::zeros();
        let (mut variance, mut left) = (f64::MIN_POSITIVE, 1.0);
        for _ in 0..ROUNDS {
            let column = |row: &FieldRow| {
                let [x, y, rz, ..] = row.rate;
                let parts = [row.reference, row.vertical, [x, y, rz]];
                let [q, v, rate] = parts.map(|part| Vector3::from(part) / UNIT);
                let by = |k: usize, of: &Vector3<f64>| at.fixed_rows::<3>(k).dot(of);
                let (moved, grown) = (by(0, &q), 1.0 + by(3, &v));
                let rest = row.signal_m[probe] / UNIT - grown * moved - by(6, &v) - by(9, &rate);
                let parts = [q * grown, v * moved, v, rate];
                let parts = parts.iter().flatten().copied().chain([rest]);
                SVector::<f64, { UNKNOWNS + 1 }>::from_iterator(parts)
            };
            let mut products = SMatrix::<f64, { UNKNOWNS + 1 }, { UNKNOWNS + 1 }>::zeros();
            for movement in rows.movement_rows() {
                let some = rows.rows[movement].iter().step_by(apart);
                let columns: Vec<_> = some.map(column).collect();
                let mean = columns.iter().sum::<SVector<_, _>>() / columns.len() as f64;
                let off = columns.iter().map(|column| column - mean);
                off.for_each(|off| products.ger(1.0, &off, &off, 1.0));
            }
            let rest = products[(UNKNOWNS, UNKNOWNS)] / count;
            variance = variance.max(rest);
            let mut own = products.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned();
            let open = (WEAK * rest).max(f64::MIN_POSITIVE);
            own += SMatrix::from_diagonal_element(open);
            let factor = Cholesky::new(own)?;
            at += factor.solve(&products.fixed_view::<UNKNOWNS, 1>(0, UNKNOWNS));
            covariance = factor.inverse() * (rest * count / freedom);
            left = rest / variance;
        }
        let found = Fitted {
            at: at.fixed_rows::<6>(0).into(),
            covariance: covariance.fixed_view::<6, 6>(0, 0).into(),
            left,
        };
        let is_known = freedom > 0.0 && found.at.iter().all(|x| x.is_finite());
        is_known.then_some(found)
    };
    Some([of_probe(0)?, of_probe(1)?, of_probe(2)?])
}

/// Mean products of the axes of the reference and of the vertical pose: m2, rad2.
fn spans(dataset: &Dataset) -> [Matrix3<f64>; 2] {
    let mut sums = [Matrix3::zeros(); 2];
    for row in &dataset.rows {
        for (sum, pose) in sums.iter_mut().zip([row.reference, row.vertical]) {
            let pose = Vector3::from(pose);
            *sum += pose * pose.transpose();
        }
    }
    sums.map(|sum| sum / dataset.rows.len().max(1) as f64)
}

/// The penalty for a correction that makes the motion much larger or smaller than declared.
fn beyond_motion(stage: &Stage, spans: &[Matrix3<f64>; 2], change: &Transform) -> f64 {
    let mut sum = 0.0;
    for (half, by) in change.0[1..].iter().enumerate() {
        let products = by * spans[half] * by.transpose();
        for axis in 0..3 {
            let service = stage.motion.axes[3 * half + axis].service;
            // The rms of a sine is 0.71 of its range.
            let part = products[(axis, axis)].max(0.0).sqrt() * std::f64::consts::SQRT_2 / service;
            let log = libm::log(part.max(f64::MIN_POSITIVE));
            let beyond = f64::max(log - libm::log(SPANS.1), libm::log(SPANS.0) - log).max(0.0);
            // A factor of two beyond costs as much as an undecided cause.
            sum += UNDECIDED * (beyond.min(20.0) / std::f64::consts::LN_2).powi(2);
        }
    }
    sum
}
