//! The display of `live`: a few lines that stay in place on a terminal, plain lines elsewhere.

use hal_adapters::can::BusHealth;
use runtime::tracker::Health;
use runtime::{Reading, Status};
use std::io::{IsTerminal, Write};
use std::time::Duration;

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

/// Shows on standard output, or on standard error if standard output carries the record.
#[derive(Debug)]
pub(super) struct Display {
    on_stderr: bool,
    in_place: bool,
    lines_up: usize,
}

impl Display {
    pub(super) fn new(on_stderr: bool) -> Self {
        Self {
            on_stderr,
            in_place: match on_stderr {
                true => std::io::stderr().is_terminal(),
                false => std::io::stdout().is_terminal(),
            },
            lines_up: 0,
        }
    }

    /// Time from one display to the next: ten times a second on a terminal.
    pub(super) const fn interval(&self, every: Duration) -> Duration {
        if self.in_place {
            Duration::from_millis(100)
        } else {
            every
        }
    }

    /// Shows the present state. A closed standard output is no reason to stop decoding.
    pub(super) fn show(&mut self, shown: &Shown<'_>) {
        let mut out: Box<dyn Write> = match self.on_stderr {
            true => Box::new(std::io::stderr().lock()),
            false => Box::new(std::io::stdout().lock()),
        };
        if self.in_place {
            let lines = block(shown);
            let up = match self.lines_up {
                0 => String::new(),
                lines => format!("\x1b[{lines}A"),
            };
            self.lines_up = lines.len();
            let text: String = lines.iter().map(|l| format!("\x1b[2K{l}\n")).collect();
            let _ = write!(out, "{up}{text}");
        } else {
            let words = |line: &String| line.split_whitespace().collect::<Vec<_>>().join(" ");
            let line: Vec<String> = block(shown).iter().map(words).collect();
            let _ = writeln!(out, "{}", line.join("; "));
        }
        let _ = out.flush();
    }

    /// Prints a message in a line of its own.
    pub(super) fn say(&mut self, what: &str) {
        self.lines_up = 0;
        let _ = writeln!(std::io::stderr(), "{what}");
    }
}

fn state(shown: &Shown<'_>) -> String {
    let status = shown.reading.map_or(Status::GOOD, |r| r.status);
    if shown.is_down {
        "interface down".to_owned()
    } else if shown.reading.is_none() {
        "no frames yet".to_owned()
    } else if shown.is_stale {
        "stale: no good frames".to_owned()
    } else if status.is_good() {
        "good".to_owned()
    } else {
        status.names().collect::<Vec<_>>().join(", ")
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

fn faults(bus: &BusHealth) -> String {
    format!(
        "good {}, lost {}, repeated {}, sequence {}, check {}, length {}, late {}, incomplete ticks {}, stale {}",
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

fn block(shown: &Shown<'_>) -> Vec<String> {
    let [x, y, rz, z, rx, ry] = shown.reading.map(pose).unwrap_or_default();
    vec![
        format!("{:9.1} s   {}", shown.elapsed_s, state(shown)),
        format!("X  {x:10.3} um    Y  {y:10.3} um    Rz {rz:10.3} urad"),
        format!("Z  {z:10.3} um    Rx {rx:10.3} urad  Ry {ry:10.3} urad"),
        format!("{:.1} ticks/s", shown.rate_hz),
        format!(
            "ticks {}, missed {}, dropped {}, not sent {}; invalid {} planar, {} vertical",
            shown.servo.ticks,
            shown.servo.frames_missed,
            shown.dropped,
            shown.not_sent,
            shown.servo.planar_invalid,
            shown.servo.vertical_invalid
        ),
        format!("frames: {}", faults(&shown.bus)),
    ]
}
