//! The loop of `live`: the node on an interface, recorded and shown.

use super::bus::now_us;
use super::display::{self, Shown, show};
use super::node::{Node, NodeSettings};
use super::{Bus, BusError, LiveError, LiveSettings};
use crate::bus::BusAddress;
use crate::output::record_file::RecordFile;
use crate::output::{OutputError, blob_file, is_standard_output};
use crate::scope::{History, Scale, ScopeRow, Screen, Wish};
use hal_adapters::can::{BusFault, BusFrame, Coded, Layout, StampedFrame, Timing};
use hal_adapters::candump::LogLine;
use runtime::{ParameterSet, RawFrame, Reading};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a frame: how soon Ctrl-C is noticed on a silent bus.
const WAIT_MAX: Duration = Duration::from_millis(100);

/// Time between two pictures of the scope.
const PICTURE: Duration = Duration::from_millis(100);

/// The servo period of a bus, s.
const SERVO_S: f64 = 0.002;

/// A node that skips more ticks has started again: a minute of them.
const TICKS_MAX: u32 = 30_000;

/// How long a frame may wait for a place in the transmit queue: half a servo period.
const SEND_DEADLINE: Duration = Duration::from_millis(1);

/// Runs until Ctrl-C, the end of the duration, or an error.
///
/// # Errors
/// See [`LiveError`]. An interface that goes down is waited for, not an error.
pub(crate) fn run(settings: &LiveSettings, stop: &AtomicBool) -> Result<(), LiveError> {
    let set = blob_file::read(&settings.params)?;
    check_serial(&set, settings)?;
    let node = NodeSettings {
        layout: layout_of(&set).ok_or_else(|| LiveError::CodesTooWide {
            path: settings.params.clone(),
        })?,
        timing: Timing {
            assembly_us: settings.assembly_us,
            stale_us: settings.stale_us,
        },
        on_invalid: settings.hold,
    };
    let bus = Bus::open(
        &settings.can.interface,
        settings.can.node,
        &Node::messages(node.layout),
    )?;
    let record = match &settings.record {
        Some(path) => Some(RecordFile::create(path).map_err(LiveError::NoRecord)?),
        None => None,
    };
    let takes_output = settings.record.as_deref().is_some_and(is_standard_output);
    let has_scope = !settings.plain && !takes_output && std::io::stdout().is_terminal();
    let scope = match has_scope {
        true => Some(Scope::open(&set, settings)?),
        false => None,
    };
    let every = if has_scope { PICTURE } else { settings.every };
    let decoder = set.decoder();
    let mut session = Session {
        node: Node::new(decoder, &node),
        bus,
        address: &settings.can,
        record,
        record_ended: None,
        sends: !settings.listen_only,
        shows_on_stderr: takes_output,
        scope,
        started: Instant::now(),
        shown_at: (0, Duration::ZERO),
        rate_hz: 0.0,
        last: None,
        out: Vec::new(),
        not_sent: 0,
        is_down: false,
    };
    let ended = session.until(stop, settings.duration, every);
    // What was recorded is kept whatever ended the run.
    session.write(RecordFile::finish);
    let shown = session.show();
    drop(session.scope.take());
    ended?;
    shown?;
    match session.record_ended {
        None => Ok(()),
        Some(ended) => Err(ended),
    }
}

/// The layout that carries every code that the blob accepts, its converter's rails included.
fn layout_of(set: &ParameterSet) -> Option<Layout> {
    let (hall, gaps) = (set.constants.hall_window, set.constants.capacitive_window);
    let low = hall.low.min(gaps.low).saturating_sub(1);
    let high = hall.high.max(gaps.high).saturating_add(1);
    Layout::from_range(low, high)
        .or_else(|| Layout::from_range(low.saturating_add(1), high.saturating_sub(1)))
}

fn check_serial(set: &ParameterSet, settings: &LiveSettings) -> Result<(), LiveError> {
    match &settings.serial {
        Some(serial) if set.expect_serial(serial).is_err() => Err(LiveError::OtherStage {
            path: settings.params.clone(),
            found: set.serial.to_string(),
            expected: serial.clone(),
        }),
        _ => Ok(()),
    }
}

struct Session<'d> {
    node: Node,
    bus: Bus,
    address: &'d BusAddress,
    record: Option<RecordFile>,
    record_ended: Option<LiveError>,
    sends: bool,
    shows_on_stderr: bool,
    scope: Option<Scope>,
    started: Instant,
    /// Decoded ticks and time at the last display.
    shown_at: (u32, Duration),
    /// Ticks per second between the last two displays.
    rate_hz: f64,
    last: Option<Reading>,
    out: Vec<Coded>,
    not_sent: u32,
    is_down: bool,
}

impl Session<'_> {
    fn until(
        &mut self,
        stop: &AtomicBool,
        end: Option<Duration>,
        every: Duration,
    ) -> Result<(), LiveError> {
        let mut next_show = every;
        while !stop.load(Ordering::Relaxed) {
            let elapsed = self.started.elapsed();
            if end.is_some_and(|end| elapsed >= end) {
                break;
            }
            if elapsed >= next_show {
                next_show = elapsed + every;
                let (ticks, since) = self.shown_at;
                let now = self.node.tracker().health().ticks;
                let s = (elapsed - since).as_secs_f64();
                self.rate_hz = f64::from(now - ticks) / s;
                self.shown_at = (now, elapsed);
                if self.show()? == Wish::Quit {
                    break;
                }
            }
            self.turn()?;
            self.write(RecordFile::keep_up);
        }
        Ok(())
    }

    /// Takes all frames that have come, or lets time pass; then sends what the node has to say.
    fn turn(&mut self) -> Result<(), LiveError> {
        let mut frame = self.receive(Duration::ZERO)?;
        if frame.is_none() {
            let patience = self.node.patience_us(now_us());
            let wait = patience.map_or(WAIT_MAX, |us| Duration::from_micros(us.into()));
            frame = self.receive(wait.min(WAIT_MAX))?;
        }
        if frame.is_none() {
            // The time is taken before the bus is asked again, so all frames before it were read.
            let time_us = now_us();
            frame = self.receive(Duration::ZERO)?;
            if frame.is_none() {
                let step = self.node.poll(time_us, &mut self.out);
                self.note(step.fault);
            }
        }
        while let Some(stamped) = frame {
            self.take(&stamped);
            if !self.bus.has_frame() {
                break;
            }
            frame = self.receive(Duration::ZERO)?;
        }
        self.publish()
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<StampedFrame>, LiveError> {
        match self.bus.receive(wait) {
            Ok(Some(frame)) => {
                if self.is_down {
                    self.is_down = false;
                    self.say("the interface is up again");
                }
                Ok(Some(frame))
            }
            Ok(None) => Ok(None),
            Err(error) => self.wait_out(error).map(|()| None),
        }
    }

    fn take(&mut self, frame: &StampedFrame) {
        self.record(frame);
        let step = self.node.take(frame, &mut self.out);
        if let Some((raw, reading)) = step.tick {
            self.last = Some(reading);
            if let Some(scope) = &mut self.scope {
                scope.push(&raw);
            }
        }
        if let Some(command) = step.command {
            self.say(&format!("request: {command:?}"));
        }
        self.note(step.fault);
    }

    fn record(&mut self, stamped: &StampedFrame) {
        let line = LogLine {
            time_us: stamped.time_us,
            interface: &self.address.interface,
            frame: self.address.node.to_bus(&stamped.frame),
        };
        self.write(|record| record.line(line));
    }

    /// A record that cannot be written ends; decoding goes on.
    fn write(&mut self, work: impl FnOnce(&mut RecordFile) -> Result<(), OutputError>) {
        let Some(record) = &mut self.record else {
            return;
        };
        if let Err(source) = work(record) {
            let ended = LiveError::RecordEnded {
                source,
                after_s: self.started.elapsed().as_secs_f64(),
            };
            self.say(&format!("{ended}; decoding goes on"));
            self.record = None;
            self.record_ended = Some(ended);
        }
    }

    fn note(&mut self, fault: Option<BusFault>) {
        if let Some(fault @ (BusFault::Stale { .. } | BusFault::SenderRestarted)) = fault {
            self.say(&fault.to_string());
        }
    }

    /// Sends what the node has to say.
    fn publish(&mut self) -> Result<(), LiveError> {
        if self.out.is_empty() || !self.sends || self.is_down {
            self.out.clear();
            return Ok(());
        }
        let frames: Vec<BusFrame> = self.out.drain(..).map(BusFrame::from).collect();
        if let Err(error) = self.bus.send_all(&frames, SEND_DEADLINE) {
            let count = u32::try_from(frames.len()).unwrap_or(u32::MAX);
            self.not_sent = self.not_sent.saturating_add(count);
            return self.wait_out(error);
        }
        let time_us = now_us();
        for frame in frames {
            self.record(&StampedFrame { time_us, frame });
        }
        Ok(())
    }

    /// An interface that is down and a queue that is full are waited for; the rest ends the
    /// run.
    fn wait_out(&mut self, error: BusError) -> Result<(), LiveError> {
        if matches!(error, BusError::Down { .. }) {
            if !self.is_down {
                self.is_down = true;
                self.say(&format!("{error}; waiting for it"));
            }
            std::thread::sleep(Duration::from_millis(1));
            Ok(())
        } else if matches!(error, BusError::QueueFull { .. }) {
            Ok(())
        } else {
            Err(error.into())
        }
    }

    fn say(&mut self, what: &str) {
        match &mut self.scope {
            Some(scope) => what.clone_into(&mut scope.note),
            None => display::say(what),
        }
    }

    fn show(&mut self) -> Result<Wish, LiveError> {
        let shown = Shown {
            elapsed_s: self.started.elapsed().as_secs_f64(),
            reading: self.last.as_ref(),
            rate_hz: self.rate_hz,
            servo: self.node.tracker().health(),
            bus: *self.node.receiver().health(),
            dropped: self.bus.dropped(),
            not_sent: self.not_sent,
            is_stale: self.node.receiver().is_stale(),
            is_down: self.is_down,
        };
        match &mut self.scope {
            Some(scope) => Ok(scope.show(&shown)?),
            None => {
                show(&shown, self.shows_on_stderr);
                Ok(Wish::GoOn)
            }
        }
    }
}

/// The ticks from one number to the next. A node that starts again counts from anywhere.
const fn ticks_between(before: u32, now: u32) -> u32 {
    match now.wrapping_sub(before) {
        ticks @ 1..TICKS_MAX => ticks,
        _ => 1,
    }
}

/// The codes of the bus in a terminal.
struct Scope {
    screen: Screen,
    history: History,
    /// Number and time of the last tick, us: frames come in bunches, and ticks do not.
    tick: (u32, f64),
    /// What happened last.
    note: String,
}

impl Scope {
    fn open(set: &ParameterSet, settings: &LiveSettings) -> std::io::Result<Self> {
        let (hall, gaps) = (set.constants.hall_window, set.constants.capacitive_window);
        let scales = Scale::six("codes", [(1.0, hall), (1.0, gaps)]);
        let title = format!("{} {}", settings.can.interface, set.serial);
        Ok(Self {
            screen: Screen::open()?,
            history: History::new(title, scales, SERVO_S),
            tick: (0, 0.0),
            note: String::new(),
        })
    }

    fn push(&mut self, raw: &RawFrame) {
        let (number, t_us) = self.tick;
        let ticks = ticks_between(number, raw.sequence);
        self.tick = (raw.sequence, t_us + 1e6 * SERVO_S * f64::from(ticks));
        let [a, b, c] = raw.hall;
        let [p, q, r] = raw.capacitive;
        self.history.push(ScopeRow {
            t_us: self.tick.1,
            codes: [a, b, c, p, q, r],
            designed_m: None,
        });
    }

    fn show(&mut self, shown: &Shown<'_>) -> std::io::Result<Wish> {
        let state = display::state(shown);
        self.history.state = format!("{state}  {:.0} ticks/s  {}", shown.rate_hz, self.note);
        self.screen.draw(&self.history)?;
        self.screen.keys(&mut self.history, Duration::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::ticks_between;

    #[test]
    fn ticks_are_counted_over_a_loss_and_not_over_a_restart() {
        for (before, now, ticks) in [(5, 6, 1), (u32::MAX, 2, 3), (9, 3, 1), (0, 1 << 30, 1)] {
            assert_eq!(ticks_between(before, now), ticks);
        }
    }
}
