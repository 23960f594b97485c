//! Reads `stage.toml` and checks every value of it.
//!
//! The derived types say which keys there are and what kind of value each has. All keys but
//! those of `[log]` and `[motion]` and `volts_per_count` are required, and none but the documented ones are accepted: a misspelt
//! key would otherwise be ignored without a word.

use super::document::{Document, List};
use super::error::StageError;
use super::{CodeScale, Stage, columns, motion, search};
use crate::input::source;
use runtime::capacitive::{ProbePositions, vertical_rows};
use runtime::frame::{CODE_MAGNITUDE_MAX, CodeWindow};
use runtime::geometry::ProbeCoordinates;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;
use toml::Spanned;

/// Largest stage file that is read: a sound one has a few thousand bytes.
const BYTES_MAX: u64 = 1 << 20;
/// Largest distance of a probe from the stage's centre, m: stages of this kind are decimetres.
pub(super) const COORDINATE_MAX_M: f64 = 10.0;
/// Full scales of a converter that make sense, m.
const FULL_SCALES_M: (f64, f64) = (1e-6, 0.1);
/// Shortest distance between the two Y beams that makes sense, m.
const BASELINE_MIN_M: f64 = 1e-3;
/// Servo periods that make sense, s.
const PERIODS_S: (f64, f64) = (1e-6, 10.0);
/// Smallest area of the triangle of the capacitive sensors, as a part of its longest side squared.
const TRIANGLE_MIN: f64 = 1e-3;
/// Smallest distance along X between the probes A and B, m.
const SPACING_MIN_M: f64 = 1e-4;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StageFile {
    hall: Hall,
    capacitive: Capacitive,
    interferometer: Interferometer,
    servo: Servo,
    /// Read by [`search::ranges`]: its keys depend on the terms of the models.
    #[serde(rename = "search")]
    _search: BTreeMap<String, IgnoredAny>,
    /// Read by [`motion::motion`].
    #[serde(rename = "motion")]
    _motion: Option<BTreeMap<String, IgnoredAny>>,
    /// Read by [`columns::log_layout`].
    #[serde(rename = "log")]
    _log: Option<BTreeMap<String, IgnoredAny>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Hall {
    h1x_m: Spanned<f64>,
    h1y_m: Spanned<f64>,
    h2x_m: Spanned<f64>,
    h2y_m: Spanned<f64>,
    h3x_m: Spanned<f64>,
    h3y_m: Spanned<f64>,
    m_per_count: Spanned<f64>,
    /// Read by [`columns::log_layout`].
    #[serde(rename = "volts_per_count")]
    _volts_per_count: Option<IgnoredAny>,
    code_min: Spanned<i64>,
    code_max: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Capacitive {
    probes_m: List<List<Spanned<f64>>>,
    m_per_count: Spanned<f64>,
    /// Read by [`columns::log_layout`].
    #[serde(rename = "volts_per_count")]
    _volts_per_count: Option<IgnoredAny>,
    code_min: Spanned<i64>,
    code_max: Spanned<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Interferometer {
    y_baseline_m: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct Servo {
    period_s: Spanned<f64>,
}

impl Stage {
    /// Reads and checks a `stage.toml`.
    ///
    /// # Errors
    /// Every variant of [`StageError`]; each names the file and, inside it, line and key.
    pub fn from_file(path: &Path) -> Result<Self, StageError> {
        let bytes = source::read_whole(path, BYTES_MAX)?;
        let text = String::from_utf8(bytes).map_err(|error| StageError::NotText {
            path: path.to_path_buf(),
            offset: error.utf8_error().valid_up_to(),
        })?;
        Self::from_toml(&text, path)
    }

    /// Checks the text of a `stage.toml`; `path` is only named in errors.
    ///
    /// # Errors
    /// As [`Stage::from_file`], without those of reading.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, StageError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let document = &Document::parse(text, path)?;
        let file: StageFile = document.read_all()?;
        let (hall, gaps) = (&file.hall, &file.capacitive);
        let (beams, servo) = (&file.interferometer, &file.servo);
        let designed = designed_probes(document, hall)?;
        let scale =
            |m_per_count, code_min, code_max| code_scale(document, m_per_count, code_min, code_max);
        let capacitive = scale(&gaps.m_per_count, &gaps.code_min, &gaps.code_max)?;
        Ok(Self {
            designed,
            hall: scale(&hall.m_per_count, &hall.code_min, &hall.code_max)?,
            capacitive_probes_m: capacitive_probes(document, gaps, &capacitive)?,
            capacitive,
            y_baseline_m: document.within(
                &beams.y_baseline_m,
                BASELINE_MIN_M,
                COORDINATE_MAX_M,
                "m",
            )?,
            servo_period_s: document.within(&servo.period_s, PERIODS_S.0, PERIODS_S.1, "s")?,
            search: search::ranges(document, &designed)?,
            motion: motion::motion(document)?,
            log: columns::log_layout(document)?,
        })
    }
}

fn designed_probes(
    document: &Document<'_>,
    hall: &Hall,
) -> Result<ProbeCoordinates<f64>, StageError> {
    let at = |value| document.within(value, -COORDINATE_MAX_M, COORDINATE_MAX_M, "m");
    let probes = ProbeCoordinates {
        h1x_m: at(&hall.h1x_m)?,
        h1y_m: at(&hall.h1y_m)?,
        h2x_m: at(&hall.h2x_m)?,
        h2y_m: at(&hall.h2y_m)?,
        h3x_m: at(&hall.h3x_m)?,
        h3y_m: at(&hall.h3y_m)?,
    };
    // The determinant of the designed PM is the distance of A and B along X.
    if (probes.h1x_m + probes.h2x_m).abs() < SPACING_MIN_M {
        let problem = "A (+h1x_m) and B (-h2x_m) stand at the same x, so Y and Rz cannot be told \
                       apart; correct one of them";
        return Err(document.refuse(hall.h2x_m.span(), problem));
    }
    Ok(probes)
}

fn code_scale(
    document: &Document<'_>,
    m_per_count: &Spanned<f64>,
    code_min: &Spanned<i64>,
    code_max: &Spanned<i64>,
) -> Result<CodeScale, StageError> {
    let code = |value: &Spanned<i64>| {
        let code = i32::try_from(*value.get_ref()).ok();
        let inside = code.filter(|code| code.unsigned_abs() <= CODE_MAGNITUDE_MAX.unsigned_abs());
        let problem = format!(
            "{} is beyond 24 bits; codes of up to {CODE_MAGNITUDE_MAX} are decoded exactly, so \
             scale the converter's codes down",
            value.get_ref()
        );
        inside.ok_or_else(|| document.refuse(value.span(), problem))
    };
    let (low, high) = (code(code_min)?, code(code_max)?);
    let window = CodeWindow::between_rails(low, high).ok_or_else(|| {
        let problem = format!(
            "no code lies between code_min = {low} and code_max = {high}; give the converter's \
             smallest and largest code"
        );
        document.refuse(code_max.span(), problem)
    })?;
    let scale = document.within(m_per_count, f64::MIN, f64::MAX, "m per code")?;
    let full_scale_m = scale * f64::from(window.low.abs().max(window.high.abs()));
    let (least, most) = FULL_SCALES_M;
    if !(least..=most).contains(&full_scale_m) {
        let problem = format!(
            "{scale:e} m per code makes a full scale of {full_scale_m:e} m, outside {least:e} to \
             {most:e} m; check the scale and its unit (m per code)"
        );
        return Err(document.refuse(m_per_count.span(), problem));
    }
    Ok(CodeScale {
        m_per_count: scale,
        window,
    })
}

fn capacitive_probes(
    document: &Document<'_>,
    gaps: &Capacitive,
    scale: &CodeScale,
) -> Result<ProbePositions<f64>, StageError> {
    let pairs: &[_; 3] = document.exactly(&gaps.probes_m)?;
    let mut probes = [[0.0; 2]; 3];
    for (probe, pair) in probes.iter_mut().zip(pairs) {
        let pair: &[_; 2] = document.exactly(pair)?;
        for (at, value) in probe.iter_mut().zip(pair) {
            *at = document.within(value, -COORDINATE_MAX_M, COORDINATE_MAX_M, "m")?;
        }
    }
    let [p, q, r] = probes;
    let side = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
    let (u, v, w) = (side(p, q), side(p, r), side(q, r));
    let squares = [u, v, w].map(|[x, y]| x * x + y * y);
    let twice_area = (u[0] * v[1] - u[1] * v[0]).abs();
    if twice_area <= TRIANGLE_MIN * squares.into_iter().fold(0.0, f64::max) {
        let problem = "the three sensors stand in one line and define no plane; give the (x, y) of \
                       three sensors in a triangle";
        return Err(document.refuse(gaps.probes_m.span(), problem));
    }
    let code = scale.window.low.abs().max(scale.window.high.abs());
    let full_scale_m = scale.m_per_count * f64::from(code);
    let rotation_rad = |row: [f64; 3]| row.iter().map(|x| x.abs()).sum::<f64>() * full_scale_m;
    let [_, rx, ry] = vertical_rows(&probes).unwrap_or([[f64::INFINITY; 3]; 3]);
    let largest_rad = rotation_rad(rx).max(rotation_rad(ry));
    if largest_rad > TAU {
        let problem = format!(
            "the sensors stand so near each other that codes of {full_scale_m:e} m mean a rotation \
             of {largest_rad:.3e} rad, and rotations are to be small; check the places (m) and \
             m_per_count"
        );
        return Err(document.refuse(gaps.probes_m.span(), problem));
    }
    Ok(probes)
}
