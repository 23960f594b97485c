//! What a user should know of a fit that is good nevertheless.

use super::Fit;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::{Range, Stage};
use hallstage_solver::estimator::least_squares::at_limit;
use hallstage_solver::estimator::model::ParameterId;
use hallstage_solver::estimator::paper_terms::shown;
use hallstage_solver::estimator::sandwich::ReferenceLag;
use hallstage_solver::estimator::zero_deviation::ZeroDeviation;

/// Warn of a lag from this part of a servo period on, ...
const LAG_MIN: f64 = 0.1;
/// ... and from this many of its standard errors.
const LAG_ERRORS_MIN: f64 = 3.0;
/// A sensitivity farther beyond its range, in parts of the range, may be a wrong scale.
const SCALE_PART: f64 = 0.05;

/// Zero deviations beyond their range, and rows that the decoder refuses.
pub fn counted(zeros: &[ZeroDeviation], undecoded: usize) -> impl Iterator<Item = Finding> {
    let movements = zeros.iter().filter(|zero| zero.is_beyond).count();
    let deltas = zeros.iter().flat_map(|zero| zero.delta_m);
    let largest_um = 1e6 * deltas.fold(0.0, |most: f64, delta| most.max(delta.abs()));
    let of = zeros.len();
    let clipped = Kind::ZerosClipped {
        movements,
        of,
        largest_um,
    };
    let clipped = (movements > 0).then(|| Finding::new(clipped));
    clipped.into_iter().chain(codes_refused(undecoded))
}

/// Rows that the decoder refuses, which count in no error.
pub fn codes_refused(rows: usize) -> Option<Finding> {
    (rows > 0).then(|| Finding::new(Kind::CodesRefused { rows }))
}

/// Whether the lag of the reference is large and beyond doubt.
pub(crate) fn is_clear(lag: &ReferenceLag, stage: &Stage) -> bool {
    is_significant(lag) && lag.value_s.abs() > LAG_MIN * stage.servo_period_s
}

pub(crate) fn is_significant(lag: &ReferenceLag) -> bool {
    lag.value_s.abs() > LAG_ERRORS_MIN * lag.standard_error_s
}

impl Fit {
    /// What the user should know, of a fit to the rows of a dataset.
    pub fn warnings(&self, dataset: &Dataset, stage: &Stage) -> Vec<Finding> {
        let mut warnings = Vec::new();
        let parameters = self.estimate.parameters.model_31();
        let at_limit = at_limit(stage, self.model, &parameters);
        // No range bounds the field model, so it lacks nothing there. But no residual shows a wrong scale.
        let is_scale = |id: &ParameterId| {
            let ranges = stage.search.get("eta").filter(|_| id.term.name == "eta");
            ranges.is_some_and(|ranges| {
                let (range, eta) = (ranges[id.probe], parameters.values[id.index]);
                let room = SCALE_PART * range.width();
                !Range::new(range.low - room, range.high + room).contains(eta)
            })
        };
        let severity = |is_scale: bool| match self.field {
            Some(_) if !is_scale => Severity::Note,
            _ => Severity::Warn,
        };
        for id in &at_limit {
            let value = parameters.values[id.index];
            let unit = id.term.unit;
            let kind = Kind::AtLimit {
                parameter: id.name(),
                shown: shown(value, unit),
                value,
                unit,
            };
            let found = Finding::new(kind).with_channel(Channel::SINGLE[id.probe]);
            warnings.push(found.with_severity(severity(is_scale(id))));
        }
        if self.model.has_zero_deviation {
            warnings.extend(missed(dataset, &self.fitted.numbers));
        }
        let judgement = &self.judgement;
        warnings.extend(counted(&judgement.zeros, judgement.undecoded));
        warnings
    }
}

/// Movements without a row in the draw.
fn missed(dataset: &Dataset, selected: &[usize]) -> Option<Finding> {
    let mut present = vec![false; dataset.movements.len()];
    for &row in selected {
        present[dataset.rows[row].movement] = true;
    }
    let all = present.iter().zip(&dataset.movements);
    let missed = all.filter(|(present, _)| !**present);
    let movements: Vec<String> = missed.map(|(_, of)| dataset.movement_name(of)).collect();
    (!movements.is_empty()).then(|| Finding::new(Kind::MovementsMissed { movements }))
}
