//! The models as a fit sees them: which terms they have and which of these are fitted.

use super::terms::{MODEL_31, Term};
use runtime::ModelKind;

/// Terms before the slopes: lever arm, misalignment, eta.
pub const GAIN_TERMS: usize = 3;
/// Room for the slopes of any model. Sizes of matrices follow from it; a model with fewer
/// leaves the rest zero and fixed.
pub const SLOPES_MAX: usize = 4;
/// Room for the parameters of any model: three probes have each term.
pub const COUNT: usize = 3 * (GAIN_TERMS + SLOPES_MAX);

/// A measurement model.
#[derive(Debug)]
pub struct Model {
    /// Name on the command line and in reports: the number of its equation in the paper.
    pub name: &'static str,
    /// What it has, for the help text.
    pub summary: &'static str,
    /// Its tag in the blob.
    pub kind: ModelKind,
    /// Its terms: the three of the gain, then at most [`SLOPES_MAX`] slopes.
    pub terms: &'static [Term],
    /// How many of the terms are fitted; the others keep [`Term::fixed`].
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
        terms: &MODEL_31,
        fitted: 2,
        has_zero_deviation: false,
    },
    Model {
        name: "15",
        summary: "Geometry and sensitivity",
        kind: ModelKind::M15,
        terms: &MODEL_31,
        fitted: 3,
        has_zero_deviation: false,
    },
    Model {
        name: "30",
        summary: "As 15, with a zero deviation for each movement",
        kind: ModelKind::M30,
        terms: &MODEL_31,
        fitted: 3,
        has_zero_deviation: true,
    },
    Model {
        name: "31",
        summary: "As 30, with a sensitivity that follows Z, Rx, Ry",
        kind: ModelKind::M31,
        terms: &MODEL_31,
        fitted: 6,
        has_zero_deviation: true,
    },
    // Its terms here are those that it shares with (31); the rest is in `solve::field`.
    Model {
        name: "field",
        summary: "As 31, with what a magnet's field does beside its centre line; all six axes must move at once",
        kind: ModelKind::Field,
        terms: &MODEL_31,
        fitted: 6,
        has_zero_deviation: true,
    },
];

impl Model {
    /// The model of a blob's tag.
    pub const fn of(kind: ModelKind) -> &'static Self {
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
        let of_term = |(place, term)| (0..3).map(move |probe| ParameterId::new(place, term, probe));
        self.terms.iter().enumerate().flat_map(of_term)
    }

    /// Those that it fits.
    pub fn free(&'static self) -> impl Iterator<Item = ParameterId> {
        self.parameters().take(3 * self.fitted)
    }

    /// How many parameters it fits, zero deviations not counted.
    pub const fn free_count(&self) -> usize {
        3 * self.fitted
    }

    /// The terms of the sensitivity beside eta, fitted or not.
    pub fn slopes(&self) -> &'static [Term] {
        &self.terms[GAIN_TERMS..]
    }

    /// How many slopes it fits.
    pub const fn fitted_slopes(&self) -> usize {
        self.fitted.saturating_sub(GAIN_TERMS)
    }

    /// Whether it fits eta, which makes the gain an arbitrary matrix.
    pub const fn fits_gain(&self) -> bool {
        self.fitted >= GAIN_TERMS
    }

    /// What the coefficients of the slopes are multiplied with at (Z, Rx, Ry), m, rad, rad; zero
    /// beyond the slopes that the model has.
    pub fn slopes_at(&self, vertical: [f64; 3]) -> [f64; SLOPES_MAX] {
        let mut out = [0.0; SLOPES_MAX];
        for (out, term) in out.iter_mut().zip(self.slopes()) {
            *out = (term.in_phi)(vertical);
        }
        out
    }
}

/// One parameter: a term of one probe.
#[derive(Clone, Copy, Debug)]
pub struct ParameterId {
    /// Its place in the order of [`Model::parameters`].
    pub index: usize,
    /// What it is.
    pub term: &'static Term,
    /// Probe, 0 to 2 for A to C.
    pub probe: usize,
}

impl ParameterId {
    const fn new(place: usize, term: &'static Term, probe: usize) -> Self {
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
    use crate::problem::parameters::Parameters;
    use runtime::VerticalPose;
    use runtime::model::sensitivity_at;

    #[test]
    fn the_sum_over_the_terms_is_the_sensitivity_of_the_runtime() {
        let mut values = [0.0; COUNT];
        for (k, value) in values.iter_mut().enumerate().take(18) {
            *value = 0.7 + 13.0 * k as f64;
        }
        let parameters = Parameters { values };
        let vertical = [1.7e-4, -3.1e-4, 4.3e-4];
        for probe in 0..3 {
            let ids = Model::of(ModelKind::M31).parameters();
            let of_probe = ids.filter(|id| id.probe == probe);
            let sum: f64 = of_probe
                .map(|id| values[id.index] * (id.term.in_phi)(vertical))
                .sum();
            let pose = VerticalPose::from_array(vertical);
            let phi = sensitivity_at(&parameters.sensitivity()[probe], &pose);
            assert!((sum - phi).abs() < 1e-12, "probe {probe}: {sum} {phi}");
        }
    }

    #[test]
    fn each_model_stands_at_the_place_of_its_tag_and_has_room() {
        for model in &MODELS {
            assert_eq!(Model::of(model.kind).name, model.name);
            assert!(model.slopes().len() <= SLOPES_MAX);
            let places = model.parameters().map(|id| id.index);
            assert!(places.eq(0..3 * model.terms.len()));
        }
    }
}
