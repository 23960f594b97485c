//! The models as a fit sees them: which terms they have and which are fitted.

use super::paper_terms::{MODEL_31, PaperTerm};
use hallstage_input::channel::Channel;
use hallstage_input::stage::Stage;
use runtime::ModelKind;
use std::f64::consts::FRAC_1_SQRT_2;

/// Terms before the slopes: lever arm, misalignment, eta.
pub const GAIN_TERMS: usize = 3;
/// How many parameters there are: three probes have each term.
pub const COUNT: usize = 3 * MODEL_31.len();

/// A measurement model.
#[derive(Debug)]
pub struct Model {
    /// Name on the command line and in reports: the number of its equation in the paper.
    pub name: &'static str,
    /// What it has, for the help text.
    pub summary: &'static str,
    /// Its tag in the blob.
    pub kind: ModelKind,
    /// How many of the terms [`MODEL_31`] are fitted; the others keep [`PaperTerm::fixed`].
    pub fitted: usize,
    /// Whether each movement of a log has a zero deviation of its own.
    pub has_zero_deviation: bool,
}

/// The models of the paper, and the field model.
pub static MODELS: [Model; 5] = [
    Model {
        name: "12",
        summary: "Geometry only",
        kind: ModelKind::M12,
        fitted: 2,
        has_zero_deviation: false,
    },
    Model {
        name: "15",
        summary: "Geometry and sensitivity",
        kind: ModelKind::M15,
        fitted: 3,
        has_zero_deviation: false,
    },
    Model {
        name: "30",
        summary: "As 15, with a zero deviation for each movement",
        kind: ModelKind::M30,
        fitted: 3,
        has_zero_deviation: true,
    },
    Model {
        name: "31",
        summary: "As 30, with a sensitivity that follows Z, Rx, Ry",
        kind: ModelKind::M31,
        fitted: 6,
        has_zero_deviation: true,
    },
    // Its terms here are those that it shares with (31); the rest is in [`terms`](super::terms).
    Model {
        name: "field",
        summary: "As 31, with what a magnet's field does beside its centre line; all six axes must move at once",
        kind: ModelKind::Field,
        fitted: 6,
        has_zero_deviation: true,
    },
];

impl Model {
    /// The model of a blob's tag.
    pub const fn from_kind(kind: ModelKind) -> &'static Self {
        &MODELS[match kind {
            ModelKind::M12 => 0,
            ModelKind::M15 => 1,
            ModelKind::M30 => 2,
            ModelKind::M31 => 3,
            ModelKind::Field => 4,
        }]
    }

    /// How a title names it: `Model (31)`, `Field model`.
    pub fn title(&self) -> String {
        match self.kind {
            ModelKind::Field => "Field model".to_owned(),
            _ => format!("Model ({})", self.name),
        }
    }

    /// The parameters in the order of every list: each term for A, B, C.
    pub fn parameters(&'static self) -> impl Iterator<Item = ParameterId> {
        let with_probes =
            |(place, term)| (0..3).map(move |probe| ParameterId::new(place, term, probe));
        MODEL_31.iter().enumerate().flat_map(with_probes)
    }

    /// The parameters that the model fits.
    pub fn free(&'static self) -> impl Iterator<Item = ParameterId> {
        self.parameters().take(3 * self.fitted)
    }

    /// How many parameters it fits, zero deviations not counted.
    pub const fn free_count(&self) -> usize {
        3 * self.fitted
    }

    /// Whether it fits the slopes.
    pub const fn fits_slopes(&self) -> bool {
        self.fitted > GAIN_TERMS
    }

    /// Whether it fits eta, which makes the gain an arbitrary matrix.
    pub const fn fits_gain(&self) -> bool {
        self.fitted >= GAIN_TERMS
    }
}

/// One parameter: a term of one probe.
#[derive(Clone, Copy, Debug)]
pub struct ParameterId {
    /// Its place in the order of [`Model::parameters`].
    pub index: usize,
    /// What it is.
    pub term: &'static PaperTerm,
    /// Probe, 0 to 2 for A to C.
    pub probe: usize,
}

impl ParameterId {
    const fn new(place: usize, term: &'static PaperTerm, probe: usize) -> Self {
        Self {
            index: 3 * place + probe,
            term,
            probe,
        }
    }

    /// Name in reports and JSON, for instance `lever_arm_a`, `theta_b`, `eta_c`, `a_a`.
    pub fn name(&self) -> String {
        format!("{}_{}", self.term.name, ["a", "b", "c"][self.probe])
    }

    /// The axis that has to move to show it on this stage: X and Y change places for a probe that is mounted
    /// nearer to the other axis than in the paper.
    pub fn seen_in(&self, stage: &Stage) -> Channel {
        let turned = libm::sin(stage.probes[self.probe].theta_rad).abs() > FRAC_1_SQRT_2;
        match self.term.seen_in[self.probe] {
            Channel::X if turned => Channel::Y,
            Channel::Y if turned => Channel::X,
            axis => axis,
        }
    }

    /// Whether it is a slope: a change of sensitivity with the vertical pose.
    pub const fn is_slope(&self) -> bool {
        self.index >= 3 * GAIN_TERMS
    }
}

/// Parameters of one model are known by their place.
impl PartialEq for ParameterId {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_model_stands_at_the_place_of_its_tag() {
        for model in &MODELS {
            assert_eq!(Model::from_kind(model.kind).name, model.name);
            let places = model.parameters().map(|id| id.index);
            assert!(places.eq(0..COUNT));
        }
    }
}
