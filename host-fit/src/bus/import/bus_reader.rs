//! Lines of a candump log to ticks.

use super::bus_log::{BusCounts, BusTick, Collector};
use super::input::{Input, LINE_BYTES_MAX, Line, Lines};
use super::numbering::Numbering;
use super::{ImportError, ImportSettings};
use crate::input::log::layout::Quantity;
use crate::input::stage::{CodeScale, Stage};
use hal_adapters::can::StampedFrame;
use hal_adapters::can::sensor::read_time;
use hal_adapters::candump::{LineError, LogLine};

/// A record of the bus, read tick by tick.
pub(super) struct BusReader<'s> {
    settings: &'s ImportSettings,
    stage: &'s Stage,
    lines: Lines,
    /// The line in hand, from 1.
    line: usize,
    interface: Option<String>,
    collector: Collector,
    numbering: Numbering,
    is_read: bool,
    /// Those that the collector and the numbering do not know.
    counts: BusCounts,
    /// The frame before, with its line: it is taken once the time of the next one confirms its own.
    waiting: Option<(StampedFrame, usize)>,
    /// When the frame before that was received, us.
    before_us: u64,
}

impl<'s> BusReader<'s> {
    /// Reads from the start.
    ///
    /// # Errors
    /// `Bus`.
    pub(super) fn open(
        input: &Input,
        what: &'static str,
        settings: &'s ImportSettings,
        stage: &'s Stage,
    ) -> Result<Self, ImportError> {
        Ok(Self {
            settings,
            stage,
            lines: Lines::new(input.open()?, what),
            line: 0,
            interface: settings.interface.clone(),
            collector: Collector::new(settings.layout),
            numbering: Numbering::new(stage.servo_period_s * 1e6),
            is_read: false,
            counts: BusCounts::default(),
            waiting: None,
            before_us: 0,
        })
    }

    /// The next whole tick that has its number by the sensor node's count, its codes between the
    /// rails of the converters.
    ///
    /// # Errors
    /// `Bus`, `BadLine`, `NotText`, `SeveralInterfaces`, `OutsideConverter`, `ClockBackwards`.
    pub(super) fn next_tick(&mut self) -> Result<Option<BusTick>, ImportError> {
        loop {
            while let Some(tick) = self.numbering.next() {
                if !tick.is_saturated {
                    return Ok(Some(tick));
                }
            }
            if self.is_read {
                return Ok(None);
            }
            self.read_line()?;
        }
    }

    fn read_line(&mut self) -> Result<(), ImportError> {
        self.line += 1;
        let parsed = match self.lines.next()? {
            None => {
                self.is_read = true;
                if let Some((last, line)) = self.waiting.take() {
                    self.take(&last, line)?;
                }
                self.numbering.end();
                return Ok(());
            }
            Some(Line::Long) => Err(LineError::Trailing {
                column: LINE_BYTES_MAX,
            }),
            Some(Line::Whole(line)) => {
                let line = line.trim_ascii();
                if line.is_empty() {
                    return Ok(());
                }
                match std::str::from_utf8(line) {
                    Ok(text) => LogLine::parse(text),
                    Err(_) if self.settings.skip_bad_lines => Err(LineError::BadTime),
                    Err(_) => {
                        return Err(ImportError::NotText {
                            path: self.settings.bus.clone(),
                            line: self.line,
                        });
                    }
                }
            }
        };
        let frame = match parsed {
            Ok(found) => match chosen(&mut self.interface, &found, self.settings, self.line)? {
                true => Some(found.stamped()),
                false => None,
            },
            Err(LineError::ErrorFrame | LineError::FlexibleDataRate) => {
                self.counts.other_lines += 1;
                None
            }
            Err(_) if self.settings.skip_bad_lines => {
                self.counts.bad_lines += 1;
                None
            }
            Err(fault) => {
                return Err(ImportError::BadLine {
                    path: self.settings.bus.clone(),
                    line: self.line,
                    fault,
                });
            }
        };
        frame.map_or(Ok(()), |stamped| self.confirm(stamped))
    }

    /// Takes the frame before, unless the clock of the recording computer leapt ahead for that frame alone.
    fn confirm(&mut self, stamped: StampedFrame) -> Result<(), ImportError> {
        let period_us = self.stage.servo_period_s * 1e6;
        let back_us = |before_us: u64| before_us.saturating_sub(stamped.time_us) as f64;
        if back_us(self.before_us) > period_us {
            return Err(ImportError::ClockBackwards {
                path: self.settings.bus.clone(),
                line: self.line,
                back_s: back_us(self.before_us) * 1e-6,
            });
        }
        match self.waiting.replace((stamped, self.line)) {
            Some((before, _)) if back_us(before.time_us) > period_us => {
                self.counts.mistimed += 1;
                Ok(())
            }
            Some((before, line)) => self.take(&before, line),
            None => Ok(()),
        }
    }

    fn take(&mut self, stamped: &StampedFrame, line: usize) -> Result<(), ImportError> {
        self.before_us = stamped.time_us;
        if let Some(mut tick) = self.collector.take(stamped) {
            tick.is_saturated = self.is_saturated(&tick, line)?;
            self.counts.saturated += usize::from(tick.is_saturated);
            self.numbering.take(tick);
        } else if let Some(time) = read_time(&stamped.frame) {
            self.numbering.take_time(time);
        }
        Ok(())
    }

    /// What the record held as far as it was read.
    pub(super) fn counts(&self) -> BusCounts {
        let numbered = self.numbering.counts();
        BusCounts {
            bad_lines: self.counts.bad_lines,
            other_lines: self.counts.other_lines,
            mistimed: self.counts.mistimed,
            saturated: self.counts.saturated,
            unnumbered: numbered.unnumbered,
            ticks_missing: numbered.missing,
            gaps: numbered.gaps,
            ..self.collector.counts()
        }
    }

    /// Whether a tick has a code at a rail of its converter.
    fn is_saturated(&self, tick: &BusTick, line: usize) -> Result<bool, ImportError> {
        let mut is_sound = true;
        let sensors = [
            (&self.stage.hall, Quantity::HALL, tick.hall),
            (&self.stage.capacitive, Quantity::GAPS, tick.capacitive),
        ];
        for (converter, quantities, codes) in sensors {
            for (quantity, code) in quantities.into_iter().zip(codes) {
                is_sound &= self.is_inside(converter, quantity, code, line)?;
            }
        }
        Ok(!is_sound)
    }

    /// Whether a code is between the rails of its converter.
    fn is_inside(
        &self,
        converter: &CodeScale,
        quantity: Quantity,
        code: i32,
        line: usize,
    ) -> Result<bool, ImportError> {
        let (code_min, code_max) = (converter.window.low - 1, converter.window.high + 1);
        if (code_min..=code_max).contains(&code) {
            return Ok(converter.window.contains(code));
        }
        Err(ImportError::OutsideConverter {
            path: self.settings.bus.clone(),
            line,
            sensor: quantity.key(),
            code,
            code_min,
            code_max,
        })
    }
}

/// Whether a frame belongs to the interface that is read; the first one's, if none was named.
fn chosen(
    interface: &mut Option<String>,
    found: &LogLine<'_>,
    settings: &ImportSettings,
    line: usize,
) -> Result<bool, ImportError> {
    match interface {
        None => *interface = Some(found.interface.to_owned()),
        Some(name) if name == found.interface => {}
        Some(_) if settings.interface.is_some() => return Ok(false),
        Some(name) => {
            return Err(ImportError::SeveralInterfaces {
                path: settings.bus.clone(),
                line,
                interface: name.clone(),
                other: found.interface.to_owned(),
            });
        }
    }
    Ok(true)
}
