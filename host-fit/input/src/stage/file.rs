//! Reads `stage.toml` and checks every value of it.
//!
//! The keys of the file and the kinds of their values are known to be right. `direction_deg`, `volts_per_count` and the tables `[search]`, `[motion]`,
//! `[temperature]` and `[log]` are optional, key by key.

use super::document::{Document, Value};
use super::error::StageError;
use super::{
    CodeScale, Probe, Stage, beams, certificate, columns, motion, paper_signs, search, temperature,
    uncertainty,
};
use crate::source;
use nalgebra::Matrix3;
use runtime::capacitive::{ProbePositions, vertical_per_gap};
use runtime::frame::{CODE_MAGNITUDE_MAX, CodeWindow};
use runtime::geometry::ProbeGeometry;
use runtime::matrix::inverse_and_determinant;
use std::f64::consts::TAU;
use std::path::Path;

/// Largest stage file that is read: a sound one has a few thousand bytes.
const BYTES_MAX: u64 = 1 << 20;
/// Largest distance of a probe from the stage's centre, m: stages of this kind are decimetres.
pub(super) const COORDINATE_MAX_M: f64 = 10.0;
const COORDINATES_M: (f64, f64) = (-COORDINATE_MAX_M, COORDINATE_MAX_M);
/// Full scales of a converter that make sense, m.
const FULL_SCALES_M: (f64, f64) = (1e-6, 0.1);
/// Errors of a reset that make sense, m or rad.
const RESETS: (f64, f64) = (1e-9, 1e-3);
/// Servo periods that make sense, s.
const PERIODS_S: (f64, f64) = (1e-6, 10.0);
const LATENCIES_US: (f64, f64) = (-1e5, 1e5);
/// Smallest area of the triangle of the capacitive sensors, as a part of its longest side squared.
const TRIANGLE_MIN: f64 = 1e-3;
/// Smallest determinant of the designed PM, m: with the paper's directions the distance of A and B
/// along X.
const SPACING_MIN_M: f64 = 1e-4;

/// Directions for theta = 0, counterclockwise from X: A and B sense Y, C senses X.
const STANDARD_DEG: [f64; 3] = [90.0, 90.0, 0.0];

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
    /// As [`Stage::from_file`], without errors of reading.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, StageError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let document = &Document::parse(text, path)?;
        let probes = designed_probes(document)?;
        let capacitive = code_scale(document, "capacitive")?;
        let servo_period_s = document.required("servo", "period_s", PERIODS_S, "s")?;
        let interferometer = beams::interferometer(document)?;
        let uncertainty = uncertainty::uncertainty(document, &interferometer)?;
        let stage = Self {
            probes,
            hall: code_scale(document, "hall")?,
            capacitive_probes_m: capacitive_probes(document, &capacitive)?,
            capacitive,
            interferometer,
            reset_sd: reset_sd(document)?,
            latency_s: latency_s(document)?,
            servo_period_s,
            search: search::ranges(document, &probes, &uncertainty)?,
            motion: motion::motion(document)?,
            temperature: temperature::temperature(document)?,
            uncertainty,
            certificate: certificate::certificate(document)?,
            log: columns::log_layout(document, servo_period_s)?,
        };
        Ok(stage)
    }
}

fn designed_probes(document: &Document<'_>) -> Result<[Probe; 3], StageError> {
    let at = |key| document.required("hall", key, COORDINATES_M, "m");
    let places_m = paper_signs([
        [at("h1x_m")?, at("h1y_m")?],
        [at("h2x_m")?, at("h2y_m")?],
        [at("h3x_m")?, at("h3y_m")?],
    ]);
    let mut theta_rad = [0.0; 3];
    let directions = document.get("hall", "direction_deg");
    let directions = directions.iter().flat_map(Value::items).enumerate();
    for (k, direction) in directions {
        let direction = document.within(&direction, (-360.0, 360.0), "degrees")?;
        theta_rad[k] = (direction - STANDARD_DEG[k]).to_radians();
    }
    let plane = ProbeGeometry::from_places(places_m, theta_rad).plane();
    if inverse_and_determinant(&plane).1.abs() < SPACING_MIN_M {
        let problem = "the probes cannot tell X, Y and Rz apart: A (+h1x_m) and B (-h2x_m) stand at \
                       the same x, or two probes sense the same motion; correct place or direction";
        return Err(document.refuse(&document.require("hall", "h2x_m")?, problem));
    }
    Ok([0, 1, 2].map(|k| Probe {
        place_m: places_m[k],
        theta_rad: theta_rad[k],
    }))
}

fn latency_s(document: &Document<'_>) -> Result<Option<f64>, StageError> {
    let latency_us = document.number("interferometer", "latency_us", LATENCIES_US, "us")?;
    Ok(latency_us.map(|us| us * 1e-6))
}

/// All three or none.
fn reset_sd(document: &Document<'_>) -> Result<Option<[f64; 3]>, StageError> {
    const TABLE: &str = "interferometer.reset_sd";
    let keys = ["x_m", "y_m", "rz_rad"];
    if keys.iter().all(|key| document.get(TABLE, key).is_none()) {
        return Ok(None);
    }
    let mut out = [0.0; 3];
    for (out, key) in out.iter_mut().zip(keys) {
        let unit = key.rsplit('_').next().unwrap_or_default();
        *out = document.required(TABLE, key, RESETS, unit)?;
    }
    Ok(Some(out))
}

fn code_scale(document: &Document<'_>, table: &str) -> Result<CodeScale, StageError> {
    let m_per_count = document.require(table, "m_per_count")?;
    let code = |key| {
        let value = document.require(table, key)?;
        let number: i64 = document.read(&value)?;
        let code = i32::try_from(number).ok();
        let inside = code.filter(|code| code.unsigned_abs() <= CODE_MAGNITUDE_MAX.unsigned_abs());
        let problem = format!(
            "{number} is beyond 24 bits; codes of up to {CODE_MAGNITUDE_MAX} are decoded exactly, so \
             scale the converter's codes down"
        );
        inside.ok_or_else(|| document.refuse(&value, problem))
    };
    let (low, high) = (code("code_min")?, code("code_max")?);
    let most = document.require(table, "code_max")?;
    let window = CodeWindow::between_rails(low, high).ok_or_else(|| {
        let problem = format!(
            "no code lies between code_min = {low} and code_max = {high}; give the converter's \
             smallest and largest code"
        );
        document.refuse(&most, problem)
    })?;
    let scale = document.within(&m_per_count, (f64::MIN, f64::MAX), "m per code")?;
    let full_scale_m = scale * f64::from(window.low.abs().max(window.high.abs()));
    let (least, most) = FULL_SCALES_M;
    if !(least..=most).contains(&full_scale_m) {
        let problem = format!(
            "{scale:e} m per code makes a full scale of {full_scale_m:e} m, outside {least:e} to \
             {most:e} m; check the scale and its unit (m per code)"
        );
        return Err(document.refuse(&m_per_count, problem));
    }
    Ok(CodeScale {
        m_per_count: scale,
        window,
    })
}

fn capacitive_probes(
    document: &Document<'_>,
    scale: &CodeScale,
) -> Result<ProbePositions<f64>, StageError> {
    let list = document.require("capacitive", "probes_m")?;
    let mut probes = [[0.0; 2]; 3];
    let numbers = list.items().into_iter().flat_map(|pair| pair.items());
    for (at, value) in probes.as_flattened_mut().iter_mut().zip(numbers) {
        *at = document.within(&value, COORDINATES_M, "m")?;
    }
    let [p, q, r] = probes;
    let side = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
    let (u, v, w) = (side(p, q), side(p, r), side(q, r));
    let squares = [u, v, w].map(|[x, y]| x * x + y * y);
    let twice_area = (u[0] * v[1] - u[1] * v[0]).abs();
    if twice_area <= TRIANGLE_MIN * squares.into_iter().fold(0.0, f64::max) {
        let problem = "the three sensors stand in one line and define no plane; give the (x, y) of \
                       three sensors in a triangle";
        return Err(document.refuse(&list, problem));
    }
    let code = scale.window.low.abs().max(scale.window.high.abs());
    let full_scale_m = scale.m_per_count * f64::from(code);
    let per_gap = vertical_per_gap(&probes).unwrap_or(Matrix3::repeat(f64::INFINITY));
    let rotation_rad = |axis| per_gap.row(axis).abs().sum() * full_scale_m;
    let largest_rad = rotation_rad(1).max(rotation_rad(2));
    if largest_rad > TAU {
        let problem = format!(
            "the sensors stand so near each other that codes of {full_scale_m:e} m mean a rotation \
             of {largest_rad:.3e} rad, and rotations are to be small; check the places (m) and \
             m_per_count"
        );
        return Err(document.refuse(&list, problem));
    }
    Ok(probes)
}
