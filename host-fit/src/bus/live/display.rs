//! The lines that `live` shows.

use hal_adapters::can::BusHealth;
use runtime::tracker::Health;
use runtime::{Reading, Status};
use std::io::Write;

/// The displayed state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown<'s> {
    pub(super) elapsed_s: f64,
    pub(super) reading: Option<&'s Reading>,
    /// Ticks per second.
    pub(super) rate_hz: f64,
    pub(super) servo: Health,
    pub(super) bus: BusHealth,
    pub(super) dropped: u32,
    pub(super) not_sent: u32,
    pub(super) is_stale: bool,
    pub(super) is_down: bool,
}

/// Shows a line on standard output, or on standard error if standard output carries the record. A closed output is no
/// reason to stop decoding.
pub(super) fn show(shown: &Shown<'_>, on_stderr: bool) {
    let line = line(shown);
    let _ = match on_stderr {
        true => writeln!(std::io::stderr(), "{line}"),
        false => writeln!(std::io::stdout(), "{line}"),
    };
}

/// Prints a message in a line of its own.
pub(super) fn say(what: &str) {
    let _ = writeln!(std::io::stderr(), "{what}");
}

/// The state, with the status bits in words.
pub(super) fn state(shown: &Shown<'_>) -> String {
    let status = shown.reading.map_or(Status::GOOD, |r| r.status);
    if shown.is_down {
        "interface down".to_owned()
    } else if shown.reading.is_none() {
        "no frames yet".to_owned()
    } else if shown.is_stale {
        "stale: no good frames".to_owned()
    } else {
        status.to_string()
    }
}

/// X, Y, Rz, Z, Rx, Ry in um and urad.
fn pose(reading: &Reading) -> [f64; 6] {
    let (p, v) = (
        reading.pose.planar.to_array(),
        reading.pose.vertical.to_array(),
    );
    let [x, y, rz] = p.map(|q| f64::from(q) * 1e6);
    let [z, rx, ry] = v.map(|q| f64::from(q) * 1e6);
    [x, y, rz, z, rx, ry]
}

fn line(shown: &Shown<'_>) -> String {
    let [x, y, rz, z, rx, ry] = shown.reading.map(pose).unwrap_or_default();
    let bus = &shown.bus;
    format!(
        "{:.1} s {}; X {x:.3} um Y {y:.3} um Rz {rz:.3} urad; Z {z:.3} um Rx {rx:.3} urad Ry {ry:.3} urad; {:.1} ticks/s; \
         ticks {}, missed {}, dropped {}, not sent {}; invalid {} planar, {} vertical; \
         frames: good {}, lost {}, repeated {}, sequence {}, check {}, length {}, late {}, incomplete ticks {}, stale {}",
        shown.elapsed_s,
        state(shown),
        shown.rate_hz,
        shown.servo.ticks,
        shown.servo.frames_missed,
        shown.dropped,
        shown.not_sent,
        shown.servo.planar_invalid,
        shown.servo.vertical_invalid,
        bus.good,
        bus.lost,
        bus.repeated,
        bus.wrong_sequence,
        bus.wrong_check,
        bus.wrong_length,
        bus.late,
        bus.incomplete,
        bus.stale
    )
}
