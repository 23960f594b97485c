//! The report of an import as text.

use super::ImportReport;
use std::fmt::{Display, Formatter, Result as FmtResult};

impl Display for ImportReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> FmtResult {
        let (bus, health) = (&self.bus, &self.bus.health);
        writeln!(
            f,
            "bus: {} frames, {} whole ticks, {} missing in {} gaps; {} lines left out, {} of another kind; {} ticks left out, \
             a code at a rail of its converter, {} beside a loss or at an end of the record, which have no certain time",
            bus.frames,
            bus.ticks,
            bus.ticks_missing,
            bus.gaps,
            bus.bad_lines,
            bus.other_lines,
            bus.saturated,
            bus.untimed
        )?;
        if bus.restarts > 0 {
            writeln!(
                f,
                "  the sensor node started again {} times: only the longest part is imported",
                bus.restarts
            )?;
        }
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
        if self.temperatures_left_out {
            writeln!(
                f,
                "  temperatures are left out: name their columns in [temperature] of the stage file (mount, body)"
            )?;
        }
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
        let (error_us, faster) = (seen.standard_error_us, 1e6 * self.offset.rate);
        match seen.apart_us {
            None => write!(f, " in the middle of the record, estimated")?,
            Some(apart_us) => write!(f, ", as given; the motion asks for {apart_us:.1} us more")?,
        }
        write!(
            f,
            ", with a standard error of at most {error_us:.1} us; the sensor node's clock runs faster by {faster:.2} parts in a million"
        )?;
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
