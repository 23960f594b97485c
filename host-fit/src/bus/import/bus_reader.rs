//! Lines of a candump log to ticks.

use super::bus_log::{BusCounts, BusTick, Collector};
use super::input::{Input, LINE_BYTES_MAX, Line, Lines};
use super::{ImportError, ImportSettings};
use crate::input::log::layout::Quantity;
use crate::input::stage::{CodeScale, Stage};
use hal_adapters::candump::{LineError, LogLine};
use std::path::Path;

/// A record of the bus, read tick by tick.
pub(super) struct BusReader<'s> {
    settings: &'s ImportSettings,
    stage: &'s Stage,
    lines: Lines,
    /// The line in hand, from 1.
    line: usize,
    interface: Option<String>,
    collector: Collector,
    /// Those that the collector does not know.
    counts: BusCounts,
    /// When the tick before was received, us.
    before_us: Option<u64>,
    /// Whether the next tick follows on those before, if it says so.
    follows: bool,
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
            counts: BusCounts::default(),
            before_us: None,
            follows: true,
        })
    }

    /// The next whole tick, its codes within the converters' ranges and after the one before.
    ///
    /// # Errors
    /// `Bus`, `BadLine`, `NotText`, `SeveralInterfaces`, `OutsideConverter`, `ClockBackwards`.
    pub(super) fn next_tick(&mut self) -> Result<Option<BusTick>, ImportError> {
        loop {
            self.line += 1;
            let parsed = match self.lines.next()? {
                None => return Ok(None),
                Some(Line::Long) => Err(LineError::Trailing {
                    column: LINE_BYTES_MAX,
                }),
                Some(Line::Whole(line)) => {
                    let line = line.trim_ascii();
                    if line.is_empty() {
                        continue;
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
            let tick = match parsed {
                Ok(found) => {
                    let interface = &mut self.interface;
                    match chosen(interface, &found, self.settings, self.line)? {
                        true => self.collector.take(&found.stamped()),
                        false => None,
                    }
                }
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
            if let Some(mut tick) = tick {
                // What a tick that is left out does not follow on, the next one does not either.
                tick.follows &= core::mem::replace(&mut self.follows, true);
                if self.is_sound(&tick)? {
                    return Ok(Some(tick));
                }
                self.follows = tick.follows;
            }
        }
    }

    /// What the record held as far as it was read.
    pub(super) fn counts(&self) -> BusCounts {
        BusCounts {
            bad_lines: self.counts.bad_lines,
            other_lines: self.counts.other_lines,
            saturated: self.counts.saturated,
            ..self.collector.counts()
        }
    }

    fn path(&self) -> &Path {
        &self.settings.bus
    }

    /// Whether a tick belongs into a log; those with a code at a rail are counted.
    fn is_sound(&mut self, tick: &BusTick) -> Result<bool, ImportError> {
        let step_us = (self.stage.servo_period_s * 1e6) as u64;
        if let Some(before_us) = self.before_us
            && tick.received_us.saturating_add(step_us) < before_us
        {
            return Err(ImportError::ClockBackwards {
                path: self.path().to_path_buf(),
                line: self.line,
                back_s: (before_us - tick.received_us) as f64 * 1e-6,
            });
        }
        self.before_us = Some(tick.received_us);
        let mut is_sound = true;
        let sensors = [
            (&self.stage.hall, Quantity::HALL, tick.hall),
            (&self.stage.capacitive, Quantity::GAPS, tick.capacitive),
        ];
        for (converter, quantities, codes) in sensors {
            for (quantity, code) in quantities.into_iter().zip(codes) {
                is_sound &= self.is_inside(converter, quantity, code)?;
            }
        }
        self.counts.saturated += usize::from(!is_sound);
        Ok(is_sound)
    }

    /// Whether a code is between the rails of its converter.
    fn is_inside(
        &self,
        converter: &CodeScale,
        quantity: Quantity,
        code: i32,
    ) -> Result<bool, ImportError> {
        let (code_min, code_max) = (converter.window.low - 1, converter.window.high + 1);
        if (code_min..=code_max).contains(&code) {
            return Ok(converter.window.contains(code));
        }
        Err(ImportError::OutsideConverter {
            path: self.path().to_path_buf(),
            line: self.line,
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
