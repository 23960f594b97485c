//! Reads `stage.toml` and checks every value of it.
//!
//! All keys but those of `[log]` are required, and none but the documented ones are
//! accepted: a misspelt key would otherwise be ignored without a word.

use super::error::{StageError, ValueFault};
use super::ranges::search_ranges;
use super::value::{Document, Table, Value};
use super::{CodeScale, Stage};
use crate::input::log::layout::LogLayout;
use runtime::capacitive::ProbePositions;
use runtime::frame::{CODE_MAGNITUDE_MAX, CodeWindow};
use runtime::geometry::ProbeCoordinates;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Largest stage file that is read: a sound one has a few thousand bytes.
const BYTES_MAX: u64 = 1 << 20;
/// Largest distance of a probe from the stage's centre, m: stages of this kind are decimetres.
pub(super) const COORDINATE_MAX_M: f64 = 10.0;
/// Smallest full scale of a converter that makes sense, m.
const FULL_SCALE_MIN_M: f64 = 1e-6;
/// Largest full scale of a converter that makes sense, m.
const FULL_SCALE_MAX_M: f64 = 0.1;
/// Shortest distance between the two Y beams that makes sense, m.
const BASELINE_MIN_M: f64 = 1e-3;
/// Shortest servo period that makes sense, s.
const PERIOD_MIN_S: f64 = 1e-6;
/// Longest servo period that makes sense, s.
const PERIOD_MAX_S: f64 = 10.0;
/// Smallest area of the triangle of the capacitive sensors, as a part of its longest side squared.
const TRIANGLE_MIN: f64 = 1e-3;
/// Smallest distance along X between the probes A and B, m.
const SPACING_MIN_M: f64 = 1e-4;

impl Stage {
    /// Reads and checks a `stage.toml`.
    ///
    /// # Errors
    /// Every variant of [`StageError`]; each names the file and, inside it, line and key.
    pub fn from_file(path: &Path) -> Result<Self, StageError> {
        let mut bytes = Vec::new();
        // One byte more than is allowed: a device may have no end.
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(BYTES_MAX + 1).read_to_end(&mut bytes));
        read.map_err(|source| {
            if source.kind() == ErrorKind::IsADirectory || path.is_dir() {
                StageError::IsFolder {
                    path: path.to_path_buf(),
                }
            } else {
                StageError::Unreadable {
                    path: path.to_path_buf(),
                    source,
                }
            }
        })?;
        if bytes.len() as u64 > BYTES_MAX {
            return Err(StageError::TooLarge {
                path: path.to_path_buf(),
                limit_bytes: BYTES_MAX,
            });
        }
        let text = String::from_utf8(bytes).map_err(|error| StageError::NotText {
            path: path.to_path_buf(),
            offset: error.utf8_error().valid_up_to(),
        })?;
        Self::from_toml(&text, path)
    }

    /// Checks the text of a `stage.toml`; `path` is only named in errors.
    ///
    /// # Errors
    /// As [`Stage::from_file`], but for reading.
    pub fn from_toml(text: &str, path: &Path) -> Result<Self, StageError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let document = Document { path, text };
        let parsed = toml::de::DeTable::parse(text).map_err(|error| StageError::Syntax {
            place: document.place(error.span().map_or(0, |span| span.start)),
            message: error.message().to_owned(),
        })?;
        let top = Table::top(document, parsed.get_ref());
        top.only(&[
            "hall",
            "capacitive",
            "interferometer",
            "servo",
            "search",
            "log",
        ])?;
        let hall = top.table("hall", "[hall]: probe coordinates and scale of the codes")?;
        let gaps = top.table("capacitive", "[capacitive]: sensor positions and scale")?;
        let beams = top.table("interferometer", "[interferometer]: y_baseline_m")?;
        let servo = top.table("servo", "[servo]: period_s")?;
        let search = top.table("search", "[search]: the ranges of the fit")?;
        hall.only(&[
            "h1x_m",
            "h1y_m",
            "h2x_m",
            "h2y_m",
            "h3x_m",
            "h3y_m",
            "m_per_count",
            "code_min",
            "code_max",
        ])?;
        gaps.only(&["probes_m", "m_per_count", "code_min", "code_max"])?;
        beams.only(&["y_baseline_m"])?;
        servo.only(&["period_s"])?;
        let designed = designed_probes(&hall)?;
        Ok(Self {
            designed,
            hall: code_scale(&hall)?,
            capacitive_probes_m: capacitive_probes(&gaps)?,
            capacitive: code_scale(&gaps)?,
            y_baseline_m: beams
                .require("y_baseline_m", "distance between the Y beams, m")?
                .positive(BASELINE_MIN_M, COORDINATE_MAX_M, "m")?,
            servo_period_s: servo.require("period_s", "servo period, s")?.positive(
                PERIOD_MIN_S,
                PERIOD_MAX_S,
                "s",
            )?,
            search: search_ranges(&search, &designed)?,
            log: match top.get("log") {
                None => LogLayout::default(),
                Some(table) => super::columns::log_layout(&table.table()?)?,
            },
        })
    }
}

fn coordinate(value: &Value<'_>) -> Result<f64, StageError> {
    value.within(value.number()?, -COORDINATE_MAX_M, COORDINATE_MAX_M, "m")
}

fn designed_probes(hall: &Table<'_>) -> Result<ProbeCoordinates<f64>, StageError> {
    let at = |key| coordinate(&hall.require(key, "designed coordinate of a Hall probe, m")?);
    let probes = ProbeCoordinates {
        h1x_m: at("h1x_m")?,
        h1y_m: at("h1y_m")?,
        h2x_m: at("h2x_m")?,
        h2y_m: at("h2y_m")?,
        h3x_m: at("h3x_m")?,
        h3y_m: at("h3y_m")?,
    };
    // The determinant of the designed PM is the distance of A and B along X.
    if (probes.h1x_m + probes.h2x_m).abs() < SPACING_MIN_M {
        let x_m = probes.h1x_m;
        return Err(hall
            .require("h2x_m", "")?
            .absurd(ValueFault::ProbesAlike { x_m }));
    }
    Ok(probes)
}

fn code_scale(table: &Table<'_>) -> Result<CodeScale, StageError> {
    let scale = table.require("m_per_count", "displacement per code, m")?;
    let m_per_count = scale.positive(0.0, f64::MAX, "m per code")?;
    let code = |key, hint| -> Result<(Value<'_>, i64), StageError> {
        let value = table.require(key, hint)?;
        let code = value.integer()?;
        if code.unsigned_abs() > u64::from(CODE_MAGNITUDE_MAX.unsigned_abs()) {
            return Err(value.absurd(ValueFault::Beyond24Bits { code }));
        }
        Ok((value, code))
    };
    let (_, code_min) = code("code_min", "smallest code of the converter")?;
    let (value, code_max) = code("code_max", "largest code of the converter")?;
    let window = i32::try_from(code_min)
        .ok()
        .zip(i32::try_from(code_max).ok())
        .and_then(|(low, high)| CodeWindow::between_rails(low, high))
        .ok_or_else(|| value.absurd(ValueFault::NoCodes { code_min, code_max }))?;
    let full_scale_m = m_per_count * f64::from(window.low.abs().max(window.high.abs()));
    if !(FULL_SCALE_MIN_M..=FULL_SCALE_MAX_M).contains(&full_scale_m) {
        return Err(scale.absurd(ValueFault::FullScale {
            m_per_count,
            full_scale_m,
            low_m: FULL_SCALE_MIN_M,
            high_m: FULL_SCALE_MAX_M,
        }));
    }
    Ok(CodeScale {
        m_per_count,
        window,
    })
}

fn capacitive_probes(gaps: &Table<'_>) -> Result<ProbePositions<f64>, StageError> {
    let value = gaps.require("probes_m", "[[x, y], [x, y], [x, y]] of the sensors, m")?;
    let mut probes = [[0.0; 2]; 3];
    for (probe, pair) in probes
        .iter_mut()
        .zip(value.items::<3>("a list of three [x, y] pairs in m")?)
    {
        for (at, number) in probe.iter_mut().zip(pair.items::<2>("a pair [x, y] in m")?) {
            *at = coordinate(&number)?;
        }
    }
    let [p, q, r] = probes;
    let side = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
    let (u, v, w) = (side(p, q), side(p, r), side(q, r));
    let longest_squared = [u, v, w]
        .iter()
        .map(|[x, y]| x * x + y * y)
        .fold(0.0, f64::max);
    let twice_area = (u[0] * v[1] - u[1] * v[0]).abs();
    if twice_area <= TRIANGLE_MIN * longest_squared {
        return Err(value.absurd(ValueFault::ProbesInLine));
    }
    Ok(probes)
}
