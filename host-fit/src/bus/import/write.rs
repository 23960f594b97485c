//! The calibration log and the report of an import, as text.

use super::ImportReport;
use super::join::JoinedRow;
use crate::input::log::layout::Quantity;
use crate::input::stage::Stage;
use std::fmt::{Display, Formatter, Result as FmtResult, Write};

/// How a log is written: in the columns and units that the stage names.
pub(super) struct LogFormat {
    header: String,
    us_per_unit: f64,
    /// Codes per unit of the columns of gaps and Hall sensors.
    codes_per_unit: [[f64; 3]; 2],
}

impl LogFormat {
    /// With a reference of these three quantities.
    pub(super) fn new(reference: [Quantity; 3], stage: &Stage) -> Self {
        let quantities = [Quantity::Movement, Quantity::Time]
            .into_iter()
            .chain(reference)
            .chain(Quantity::GAPS)
            .chain(Quantity::HALL);
        let names: Vec<String> = quantities
            .map(|q| quoted(&stage.log.column(q).name))
            .collect();
        let scale = |quantity: Quantity| stage.log.column(quantity).scale;
        Self {
            header: names.join(","),
            us_per_unit: scale(Quantity::Time),
            codes_per_unit: [Quantity::GAPS, Quantity::HALL].map(|set| set.map(scale)),
        }
    }

    /// The first line.
    pub(super) fn header(&self) -> String {
        format!("{}\n", self.header)
    }

    /// Appends the line of a row.
    pub(super) fn append(&self, row: &JoinedRow, text: &mut String) {
        let (movement, time) = (row.movement, row.t_us as f64 / self.us_per_unit);
        let [x, y, z] = row.values;
        let [gaps, hall] = self.codes_per_unit;
        let in_units = |codes: [i32; 3], per_unit: [f64; 3]| {
            [0, 1, 2].map(|k| f64::from(codes[k]) / per_unit[k])
        };
        let [g1, g2, g3] = in_units(row.capacitive, gaps);
        let [a, b, c] = in_units(row.hall, hall);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{movement},{time},{x},{y},{z},{g1},{g2},{g3},{a},{b},{c}"
        );
    }
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
            "bus: {} frames, {} whole ticks, {} missing in {} gaps; {} lines left out, {} of another kind, {} received at a time after the next; {} ticks left out, \
             a code at a rail of its converter, {} beside a loss, a restart or an end of the record, which have no certain time",
            bus.frames,
            bus.ticks,
            bus.ticks_missing,
            bus.gaps,
            bus.bad_lines,
            bus.other_lines,
            bus.mistimed,
            bus.saturated,
            bus.unnumbered + self.smoothing.untimed as u64
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
            "  {:.3} us a tick; receive times {:.1} us rms and at most {:.1} us from even ones, in {} stretches; the earliest of each half second \
             at most {:.1} us",
            times.period_us, times.rms_us, times.max_us, times.stretches, times.off_us
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
        let seen = &self.offset.seen;
        match seen.apart_us {
            None => write!(
                f,
                " in the middle of the record; the clock of the bus runs {} by {:.2} parts in a million; both estimated, with a \
                 standard error of at most {:.1} us",
                if self.offset.rate < 0.0 {
                    "slower"
                } else {
                    "faster"
                },
                1e6 * self.offset.rate.abs(),
                seen.standard_error_us
            )?,
            Some(apart_us) => write!(
                f,
                ", as given; by the motion it lacks at most {apart_us:.1} us, with a standard error of {:.1} us",
                seen.standard_error_us
            )?,
        }
        writeln!(
            f,
            ": the reference explains {:.2} % of the Hall signals' motion in {} ticks",
            100.0 * seen.explained,
            seen.ticks
        )?;
        let join = &self.join;
        writeln!(
            f,
            "joined: {} rows of {} ticks, for {:.1} s of the reference's {:.1} s; left out: {} ticks outside the reference, {} \
             between movements, {} further than the tolerance from a sample; nearest sample at most {:.1} us away",
            join.rows,
            join.ticks,
            join.covered_s,
            join.reference_s,
            join.outside,
            join.between_movements,
            join.too_far,
            join.nearest_max_us
        )
    }
}
