//! A candump log to ticks with the times of their samples.

use super::node_clock::{NodeClock, NodeRun};
use super::{JoinError, JoinSettings};
use crate::bus::bus_log::{BusCounts, BusTick, Collector};
use hal_adapters::can::sensor::read_time;
use hal_adapters::can::{NodeNumber, StampedFrame};
use hal_adapters::candump::{LineError, LogLine};
use hallstage_input::log::BadRows;
use hallstage_input::log::layout::Quantity;
use hallstage_input::log::lines::Lines;
use hallstage_input::stage::Stage;
use hallstage_input::text::TextReader;
use hallstage_input::watch::Watch;
use std::path::PathBuf;

/// Most ticks of a record: two hours at 500 Hz.
const TICKS_MAX: usize = 3_600_000;

/// Reads a record of the bus: the ticks of its longest run, and its counts.
///
/// # Errors
/// `Log`, `BadLine`, `SeveralInterfaces`, `OutsideConverter`, `TwoRecords`, `TooLong`, `NoTicks`.
pub(super) fn read(
    text: TextReader<'_>,
    settings: &JoinSettings,
    stage: &Stage,
    watch: Watch<'static>,
) -> Result<(NodeRun, BusCounts), JoinError> {
    let path = text.path().to_path_buf();
    let mut reader = BusReader {
        path: path.clone(),
        settings,
        stage,
        line: 0,
        interface: settings.interface.as_ref().map(|at| at.interface.clone()),
        node: settings
            .interface
            .as_ref()
            .map_or(NodeNumber::default(), |at| at.node),
        collector: Collector::default(),
        clock: NodeClock::new(stage.servo_period_s * 1e6),
        counts: BusCounts::default(),
    };
    let mut lines = Lines::new(text).watched(watch, "reading the bus");
    while let Some(line) = lines.next_line()? {
        reader.take_line(&String::from_utf8_lossy(line))?;
        if reader.clock.timed() > TICKS_MAX {
            return Err(JoinError::TooLong {
                path,
                what: "ticks",
                most: TICKS_MAX,
            });
        }
    }
    let restarts = reader.clock.restarts;
    let (run, untimed) = reader.clock.into_longest();
    let counts = BusCounts {
        bad_lines: reader.counts.bad_lines,
        other_lines: reader.counts.other_lines,
        saturated: reader.counts.saturated,
        untimed,
        restarts,
        ..reader.collector.counts()
    };
    if run.ticks.len() < TICKS_MIN {
        return Err(JoinError::NoTicks {
            path,
            frames: counts.frames,
            saturated: counts.saturated,
            ticks: counts.ticks,
        });
    }
    Ok((run, counts))
}

/// Fewest ticks of a record: a quarter of a second.
pub(super) const TICKS_MIN: usize = 125;

/// A record of the bus while it is read.
struct BusReader<'s> {
    path: PathBuf,
    settings: &'s JoinSettings,
    stage: &'s Stage,
    /// Number of the current line, from 1.
    line: usize,
    interface: Option<String>,
    node: NodeNumber,
    collector: Collector,
    clock: NodeClock,
    /// Counts that the collector and the clock do not have.
    counts: BusCounts,
}

impl BusReader<'_> {
    fn take_line(&mut self, line: &str) -> Result<(), JoinError> {
        self.line += 1;
        if line.trim_ascii().is_empty() {
            return Ok(());
        }
        match LogLine::parse(line.trim_ascii()) {
            Ok(found) if self.is_chosen(&found)? => match self.node.from_bus(&found.frame) {
                Some(frame) => self.take(&StampedFrame {
                    frame,
                    ..found.stamped()
                }),
                None => Ok(()),
            },
            Ok(_) => Ok(()),
            Err(LineError::ErrorFrame | LineError::FlexibleDataRate) => {
                self.counts.other_lines += 1;
                Ok(())
            }
            Err(_) if self.settings.bad_rows == BadRows::Skip => {
                self.counts.bad_lines += 1;
                Ok(())
            }
            Err(fault) => Err(JoinError::BadLine {
                path: self.path.clone(),
                line: self.line,
                fault,
            }),
        }
    }

    fn take(&mut self, stamped: &StampedFrame) -> Result<(), JoinError> {
        if let Some(mut tick) = self.collector.take(stamped) {
            tick.is_saturated = self.is_saturated(&tick)?;
            self.counts.saturated += usize::from(tick.is_saturated);
            self.clock.take(tick);
        } else if let Some(time) = read_time(&stamped.frame) {
            let taken = self.clock.take_time(time, stamped.time_us);
            taken.map_err(|back_us| JoinError::TwoRecords {
                path: self.path.clone(),
                line: self.line,
                back_s: back_us as f64 * 1e-6,
            })?;
        }
        Ok(())
    }

    /// Whether a tick has a code at a rail of its converter.
    fn is_saturated(&self, tick: &BusTick) -> Result<bool, JoinError> {
        let (hall, gaps) = (&self.stage.hall, &self.stage.capacitive);
        let hall = (Quantity::HALL.into_iter().zip(tick.codes.hall)).map(|code| (hall, code));
        let gaps = (Quantity::GAPS.into_iter().zip(tick.codes.capacitive)).map(|code| (gaps, code));
        let mut is_sound = true;
        for (converter, (quantity, code)) in hall.chain(gaps) {
            let (code_min, code_max) = (converter.window.low - 1, converter.window.high + 1);
            if !(code_min..=code_max).contains(&code) {
                return Err(JoinError::OutsideConverter {
                    path: self.path.clone(),
                    line: self.line,
                    sensor: quantity.key(),
                    code,
                    code_min,
                    code_max,
                });
            }
            is_sound &= converter.window.contains(code);
        }
        Ok(!is_sound)
    }

    /// Whether a frame belongs to the chosen interface, or without a choice to the interface of the first frame.
    fn is_chosen(&mut self, found: &LogLine<'_>) -> Result<bool, JoinError> {
        let interface = self
            .interface
            .get_or_insert_with(|| found.interface.to_owned());
        if interface == found.interface || self.settings.interface.is_some() {
            return Ok(interface == found.interface);
        }
        Err(JoinError::SeveralInterfaces {
            path: self.path.clone(),
            line: self.line,
            interface: interface.clone(),
            other: found.interface.to_owned(),
        })
    }
}
