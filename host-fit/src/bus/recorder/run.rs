//! Asks the controller for codes, records the bus, and asks the controller to stop.

use super::{MISSING_ONE_IN, Monitor, RecordSettings, Recorded, RecorderError};
use crate::bus::live::{Bus, BusError, now_us};
use crate::bus::update::{Link, Talk, UpdateError};
use crate::output::record_file::RecordFile;
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::table::TABLE;
use hal_adapters::can::update::Key;
use hal_adapters::can::{BusFrame, Message, StampedFrame};
use hal_adapters::candump::LogLine;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a frame: how soon Ctrl-C is noticed on a silent bus.
const WAIT_MAX: Duration = Duration::from_millis(50);
/// How long a request may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_millis(20);
/// Time from request to request for codes that stay away.
const SILENCE: Duration = Duration::from_secs(1);
/// Time from display to display.
const SHOWN_EVERY: Duration = Duration::from_millis(200);

/// Records until Ctrl-C or the end of the duration.
///
/// # Errors
/// See [`RecorderError`]. Without codes there is no file.
pub(crate) fn run(
    args: &RecordSettings,
    key: Option<Key>,
    shows: bool,
    stop: &AtomicBool,
) -> Result<Recorded, RecorderError> {
    let messages: Vec<Message> = TABLE.iter().map(|row| row.message).collect();
    let mut session = Session {
        args,
        key,
        shows,
        bus: Bus::open(&args.can.interface, args.can.node, &messages)?,
        file: RecordFile::create(&args.out).map_err(RecorderError::NoRecord)?,
        watch: Monitor::default(),
        failure: None,
        // A node ignores a request that equals the last one: another token for each program.
        token: now_us() as u8,
        started: Instant::now(),
        shown: None,
    };
    if let Err(error) = session.ask(true) {
        session.file.discard();
        return Err(error);
    }
    let recorded = session.record(stop);
    let end_us = now_us();
    let stopped = session.ask(false);
    if let Err(error) = recorded {
        // What came is kept.
        let _ = session.finish(end_us);
        return Err(error);
    }
    let is_stopped = match stopped {
        Ok(()) => true,
        // The codes are in the file: a controller that does not stop to send them spoils nothing.
        Err(RecorderError::NoAnswer { .. } | RecorderError::Refused { .. }) => false,
        Err(error) => {
            let _ = session.finish(end_us);
            return Err(error);
        }
    };
    let watch = session.finish(end_us)?;
    Ok(Recorded { watch, is_stopped })
}

struct Session<'s> {
    args: &'s RecordSettings,
    key: Option<Key>,
    shows: bool,
    bus: Bus,
    file: RecordFile,
    watch: Monitor,
    token: u8,
    /// Why the dialog ended, if not by an answer.
    failure: Option<RecorderError>,
    started: Instant,
    shown: Option<Instant>,
}

impl Session<'_> {
    /// Asks for codes, or for an end of them, and waits for the answer.
    fn ask(&mut self, on: bool) -> Result<(), RecorderError> {
        // Each dialog uses five tokens at most for each tag.
        self.token = self.token.wrapping_add(40);
        let (key, token) = (self.key, self.token);
        let mut talk = Talk::new(&mut *self, token);
        let answered = talk.exchange_tagged(key.as_ref(), Request::Record { on });
        match answered {
            Ok((Outcome::Done, _)) => Ok(()),
            Ok((outcome, _)) => Err(RecorderError::Refused {
                outcome: Some(outcome),
            }),
            Err(UpdateError::Unexpected { outcome }) => Err(RecorderError::Refused { outcome }),
            Err(UpdateError::NoRandomNumber) => Err(RecorderError::Refused {
                outcome: Some(Outcome::NoRandomNumber),
            }),
            Err(_) => Err(self.failure.take().unwrap_or(RecorderError::NoAnswer {
                address: self.args.can.clone(),
            })),
        }
    }

    fn record(&mut self, stop: &AtomicBool) -> Result<(), RecorderError> {
        let started = Instant::now();
        let mut asked = started;
        while !stop.load(Ordering::Relaxed) {
            let left = match self.args.seconds {
                None => WAIT_MAX,
                Some(duration) => match duration.checked_sub(started.elapsed()) {
                    None => break,
                    Some(left) => left,
                },
            };
            self.turn(left)?;
            self.file.keep_up()?;
            self.show();
            // A controller that was reset sends no codes until it is asked again.
            if asked.elapsed() > SILENCE && self.watch.missing_at_the_end(now_us()) > 0 {
                match self.ask(true) {
                    Ok(())
                    | Err(RecorderError::NoAnswer { .. } | RecorderError::Refused { .. }) => {}
                    Err(error) => return Err(error),
                }
                asked = Instant::now();
            }
        }
        Ok(())
    }

    /// Records the next frame, waiting for it no longer than `wait`.
    fn turn(&mut self, wait: Duration) -> Result<Option<BusFrame>, RecorderError> {
        let stamped = match self.bus.receive(wait.min(WAIT_MAX)) {
            Ok(Some(stamped)) => stamped,
            Ok(None) => return Ok(None),
            Err(error) => return self.wait_out(error).map(|()| None),
        };
        self.write(&stamped)?;
        self.watch.take(&stamped);
        Ok(Some(stamped.frame))
    }

    fn request(&mut self, frame: BusFrame) -> Result<(), RecorderError> {
        match self.bus.send_all(&[frame], SEND_DEADLINE) {
            Ok(()) => self.write(&StampedFrame {
                time_us: now_us(),
                frame,
            }),
            Err(error) => self.wait_out(error),
        }
    }

    fn failed(&mut self, error: RecorderError) -> UpdateError {
        let link = UpdateError::Link(error.to_string());
        self.failure = Some(error);
        link
    }

    fn write(&mut self, stamped: &StampedFrame) -> Result<(), RecorderError> {
        self.file.line(LogLine {
            time_us: stamped.time_us,
            interface: &self.args.can.interface,
            frame: self.args.can.node.to_bus(&stamped.frame),
        })?;
        Ok(())
    }

    /// An interface that is down and a queue that is full may pass; the ticks that are lost
    /// then are counted.
    fn wait_out(&self, error: BusError) -> Result<(), RecorderError> {
        if !matches!(error, BusError::Down { .. } | BusError::QueueFull { .. }) {
            return Err(error.into());
        }
        std::thread::sleep(Duration::from_millis(1));
        Ok(())
    }

    /// One line that stays in place; a closed standard error is no reason to end.
    fn show(&mut self) {
        let mut out = std::io::stderr().lock();
        let due = self.shown.is_none_or(|last| last.elapsed() >= SHOWN_EVERY);
        if self.shows && due && out.is_terminal() {
            self.shown = Some(Instant::now());
            let seconds = self.started.elapsed().as_secs_f64();
            let _ = write!(out, "\r\x1b[2K{seconds:.1} s: {}", self.watch);
            let _ = out.flush();
        }
    }

    fn finish(mut self, end_us: u64) -> Result<Monitor, RecorderError> {
        if self.shown.is_some() {
            let _ = write!(std::io::stderr(), "\r\x1b[2K");
        }
        let counts = self.watch.counts();
        if counts.ticks == 0 {
            self.file.discard();
            return Err(RecorderError::NoCodes {
                seconds: self.started.elapsed().as_secs_f64(),
                state: self.watch.state(),
            });
        }
        self.file.finish()?;
        let missing = counts.ticks_missing + self.watch.missing_at_the_end(end_us);
        let came = counts.ticks as u64;
        if missing * MISSING_ONE_IN > missing + came {
            return Err(RecorderError::TicksLost {
                missing,
                ticks: missing + came,
                cause: match self.bus.dropped() {
                    0 => self.watch.state(),
                    frames => format!("this computer was too busy and dropped {frames} frames"),
                },
                path: self.args.out.clone(),
            });
        }
        Ok(self.watch)
    }
}

impl Link for &mut Session<'_> {
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError> {
        self.request(frame).map_err(|error| self.failed(error))
    }

    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError> {
        let wait = Duration::from_micros(until_us.saturating_sub(Link::now_us(self)));
        self.turn(wait).map_err(|error| self.failed(error))
    }

    fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap_or(u64::MAX)
    }
}
