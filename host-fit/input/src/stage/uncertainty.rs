//! Reads the optional table `[uncertainty]`: standard uncertainties of inputs that no log shows. A missing key
//! has its default; an input without one is not known.
//!
//! ```toml
//! [uncertainty]
//! probes_m = 0.03          # of the drawing: priors of a fit, and limits beyond which a log does not match
//! baseline_m = 0.02e-3     # of the reference: the budget of a calibration
//! ```

use super::document::Document;
use super::error::StageError;
use super::interferometer::Interferometer;

/// Least uncertainty that makes sense, in any unit.
const LEAST: f64 = 1e-12;

/// An input of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Places of the Hall probes, along X and Y.
    ProbePlaces,
    /// Sensitivities of the Hall probes, a part.
    Sensitivity,
    /// Places of the capacitive sensors, along X and Y.
    GapPlaces,
    /// Scale of the capacitive codes, a part.
    GapScale,
    /// Scale that the beams have in common, ppm.
    BeamScale,
    /// Distance of the two beams along Y.
    Baseline,
    /// Places of the beams, each coordinate.
    BeamPlaces,
    /// Angles of the beams, each direction.
    BeamAngles,
    /// Sensors of temperature.
    Temperature,
    /// Gain of each Hall probe since the calibration, a part.
    Drift,
}

/// Key, unit and largest sensible value of each input, and its default where a standard or a data sheet gives one:
/// `REFERENCE.md` names the sources.
const TABLE: [(&str, &str, f64, Option<f64>); 10] = [
    ("probes_m", "m", 1.0, Some(0.03)),
    ("sensitivity", "", 0.5, Some(0.25)),
    ("capacitive_places_m", "m", 0.1, Some(0.17e-3)),
    ("capacitive_scale", "", 0.5, Some(1e-3)),
    ("beam_scale_ppm", "ppm", 1e4, Some(0.3)),
    ("baseline_m", "m", 0.1, Some(0.17e-3)),
    ("beam_places_m", "m", 0.1, Some(0.3e-3)),
    ("beam_angles_rad", "rad", 0.1, None),
    ("temperature_k", "K", 10.0, Some(0.12)),
    ("drift", "", 0.1, None),
];

impl Input {
    /// Its key in the table.
    pub const fn key(self) -> &'static str {
        TABLE[self as usize].0
    }

    /// The unit of its value; empty for a part.
    pub const fn unit(self) -> &'static str {
        TABLE[self as usize].1
    }
}

/// Standard uncertainties of the inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty([Option<f64>; TABLE.len()]);

impl Uncertainty {
    /// Of an input, in its unit; `None` where nothing is known of it.
    pub const fn get(&self, input: Input) -> Option<f64> {
        self.0[input as usize]
    }

    /// Of an input that has a default.
    pub fn known(&self, input: Input) -> f64 {
        self.get(input).unwrap_or(0.0)
    }
}

/// The table, with defaults for missing keys. Beams at places that nobody declared have no default: nothing is known of them.
pub(super) fn uncertainty(
    document: &Document<'_>,
    beams: &Interferometer,
) -> Result<Uncertainty, StageError> {
    let mut out = TABLE.map(|(.., default)| default);
    out[Input::BeamPlaces as usize].take_if(|_| !beams.has_places());
    for (value, (key, unit, most, _)) in out.iter_mut().zip(TABLE) {
        let given = document.number("uncertainty", key, (LEAST, most), unit)?;
        *value = given.or(*value);
    }
    Ok(Uncertainty(out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped;
    use crate::stage::Stage;
    use crate::stage::tests::SOUND;

    /// In the order of [`TABLE`].
    const ALL: [Input; TABLE.len()] = [
        Input::ProbePlaces,
        Input::Sensitivity,
        Input::GapPlaces,
        Input::GapScale,
        Input::BeamScale,
        Input::Baseline,
        Input::BeamPlaces,
        Input::BeamAngles,
        Input::Temperature,
        Input::Drift,
    ];

    fn parse(text: &str) -> Result<Uncertainty, String> {
        let stage = Stage::from_toml(&format!("{SOUND}{text}"), "stage.toml".as_ref());
        stage
            .map(|stage| stage.uncertainty)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn an_input_has_the_value_of_its_key_or_its_default() {
        for (k, input) in ALL.into_iter().enumerate() {
            assert_eq!(input as usize, k);
            let (key, value) = (input.key(), 1.5e-3);
            let found = parse(&format!("[uncertainty]\n{key} = {value}\n")).expect("sound");
            let defaults = parse("").expect("sound");
            for other in ALL {
                let want = match other == input {
                    true => Some(value),
                    false => defaults.get(other),
                };
                assert_eq!(found.get(other), want, "{key}");
            }
        }
    }

    #[test]
    fn beams_without_declared_places_have_no_uncertainty() {
        let declared = SOUND.replace("[servo]", "x = { z_m = 0.01 }\n[servo]");
        let of = |text: &str| {
            let stage = Stage::from_toml(text, "stage.toml".as_ref()).expect("sound");
            stage.uncertainty.get(Input::BeamPlaces)
        };
        assert_eq!((of(SOUND), of(&declared)), (None, Some(0.3e-3)));
    }

    #[test]
    fn the_shipped_file_has_the_defaults() {
        assert_eq!(parse("").expect("sound"), shipped::stage().uncertainty);
    }

    #[test]
    fn mm_for_m_and_negative_values_are_refused() {
        for (key, value) in [
            ("probes_m", "30.0"),
            ("baseline_m", "-1e-4"),
            ("drift", "0.0"),
        ] {
            let message = parse(&format!("[uncertainty]\n{key} = {value}\n")).expect_err(key);
            assert!(
                message.contains(&format!("`uncertainty.{key}`")),
                "{message}"
            );
        }
    }
}
