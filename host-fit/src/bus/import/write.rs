//! The calibration log and the report of an import, as text.

use super::ImportReport;
use super::join::JoinedRow;
use super::reference::Reference;
use crate::input::log::layout::Quantity;
use crate::input::stage::Stage;
use std::fmt::{Display, Formatter, Result as FmtResult, Write};

/// The log as CSV, in the columns and units that the stage names.
pub fn to_csv(rows: &[JoinedRow], reference: &Reference, stage: &Stage) -> String {
    let quantities = [Quantity::Movement, Quantity::Time]
        .into_iter()
        .chain(reference.quantities)
        .chain(Quantity::GAPS)
        .chain(Quantity::HALL);
    let names: Vec<String> = quantities
        .map(|q| quoted(&stage.log.column(q).name))
        .collect();
    let us_per_unit = stage.log.column(Quantity::Time).scale;
    let mut text = String::with_capacity(64 * rows.len());
    text.push_str(&names.join(","));
    text.push('\n');
    for row in rows {
        let time = row.t_us as f64 / us_per_unit;
        let [x, y, z] = row.values;
        let code = |quantity, code: i32| f64::from(code) / stage.log.column(quantity).scale;
        let [g1, g2, g3] = [0, 1, 2].map(|k| code(Quantity::GAPS[k], row.capacitive[k]));
        let [a, b, c] = [0, 1, 2].map(|k| code(Quantity::HALL[k], row.hall[k]));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{time},{x},{y},{z},{g1},{g2},{g3},{a},{b},{c}",
            row.movement
        );
    }
    text
}

/// A column's name as a CSV cell.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '#', '\n']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

impl Display for ImportReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> FmtResult {
        let (bus, health) = (&self.bus, &self.bus.health);
        writeln!(
            f,
            "bus: {} frames, {} whole ticks, {} missing in {} gaps; {} lines left out, {} of another kind",
            bus.frames, bus.ticks, bus.ticks_missing, bus.gaps, bus.bad_lines, bus.other_lines
        )?;
        writeln!(
            f,
            "  frames lost {}, repeated {}, out of sequence {}, damaged {}, of wrong length {}, late {}; ticks incomplete {}",
            health.lost,
            health.repeated,
            health.wrong_sequence,
            health.wrong_check,
            health.wrong_length,
            health.late,
            health.incomplete
        )?;
        let times = &self.smoothing;
        writeln!(
            f,
            "  {:.3} us a tick; receive times {:.1} us rms and at most {:.1} us from even ones, in {} stretches",
            times.period_us, times.rms_us, times.max_us, times.stretches
        )?;
        let reference = &self.reference;
        writeln!(
            f,
            "reference: {} rows, {} duplicates left out, {} gaps, {} movements whose time started anew{}",
            reference.rows,
            reference.duplicates,
            reference.gaps,
            reference.restarts,
            if reference.has_movements {
                ""
            } else {
                "; no column for the movement: all is movement 0"
            }
        )?;
        write!(f, "offset of the clocks: {:.1} us", self.offset.us)?;
        match self.offset.explained {
            Some(share) => writeln!(
                f,
                " in the middle of the record; the clock of the bus runs {} by {:.2} parts in a million; both estimated: \
                 the reference explains {:.2} % of the Hall signals' motion",
                if self.offset.rate < 0.0 {
                    "slower"
                } else {
                    "faster"
                },
                1e6 * self.offset.rate.abs(),
                100.0 * share
            )?,
            None => f.write_str(", as given\n")?,
        }
        let join = &self.join;
        writeln!(
            f,
            "joined: {} rows; left out: {} ticks outside the reference, {} between movements, {} further than the \
             tolerance from a sample; nearest sample at most {:.1} us away",
            join.rows, join.outside, join.between_movements, join.too_far, join.nearest_max_us
        )
    }
}
