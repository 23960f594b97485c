//! When the conversions end, by the edges of DRDY, and which conversion a frame carries.

use super::conversions::Conversions;
use super::{Ads131m08, Frame};
use crate::adc::{AdcError, DataReady};
use core::ops::RangeInclusive;
use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal::spi::SpiDevice;

/// A conversion takes so long, us: 64 with CLKIN at 8 MHz.
const PERIODS_US: RangeInclusive<u32> = 60..=68;
/// Conversions that are measured.
const MEASURED: u32 = 4;
/// From a trigger until an edge has come in any case, us.
const FIRST_EDGE_US: u32 = 200;
/// An edge that lies further from its place behind the trigger is none of a conversion, ns.
const EDGE_OFF_NS: u32 = 3000;
/// A pulse on SYNC lasts 1 to 2047 periods of CLKIN: 0.125 to 256 us.
const SYNC_US: u32 = 2;
/// By a clock that is 6 % fast an edge comes this much later, us.
const SLOW_EDGE_US: u32 = 12;
/// From the last sample of a conversion to its edge, ns: 0 or 11 us.
const EDGE_LATE_NS: u32 = 5_500;
/// Looks at the clock until a wait is given up, because the clock stands.
const LOOKS_MAX: u32 = 100_000;

impl<SPI: SpiDevice, SYNC: OutputPin, READY: DataReady> Ads131m08<SPI, SYNC, READY> {
    /// Starts the filters anew.
    pub(super) fn pulse(&mut self) -> Result<(), AdcError<SPI::Error>> {
        self.sync.set_low().map_err(|e| AdcError::Pin(e.kind()))?;
        self.triggered_us = self.ready.now_us();
        // Earlier edges do not count.
        let _ = self.ready.fell_us();
        self.wait_us(SYNC_US);
        self.sync.set_high().map_err(|e| AdcError::Pin(e.kind()))
    }

    /// The time from edge to edge by the controller's clock, and the place of the edges behind a trigger.
    pub(super) fn measure_edges(&mut self) -> Result<(), AdcError<SPI::Error>> {
        self.pulse()?;
        self.wait_us(FIRST_EDGE_US);
        let first_us = self.ready.fell_us().ok_or(AdcError::UnknownInstant)?;
        let mut last_us = first_us;
        for _ in 0..MEASURED {
            let fell_us = self.next_edge_us(last_us);
            let fell_us = fell_us.filter(|us| PERIODS_US.contains(&us.wrapping_sub(last_us)));
            last_us = fell_us.ok_or(AdcError::UnknownInstant)?;
        }
        self.period_ns = last_us.wrapping_sub(first_us) * 1000 / MEASURED;
        self.place_ns = self.place_ns(first_us).unwrap_or(0);
        Ok(())
    }

    /// The edge after another one, if it comes within a period.
    fn next_edge_us(&mut self, last_us: u32) -> Option<u32> {
        for _ in 0..LOOKS_MAX {
            let fell_us = self.ready.fell_us();
            if fell_us.is_some() || self.ready.now_us().wrapping_sub(last_us) > *PERIODS_US.end() {
                return fell_us;
            }
        }
        None
    }

    /// How far an edge lies behind the trigger and whole periods. `None` before the period is known.
    fn place_ns(&self, edge_us: u32) -> Option<u32> {
        let since_us = edge_us.wrapping_sub(self.triggered_us).min(1_000_000);
        (since_us * 1000).checked_rem(self.period_ns)
    }

    /// Waits, one us less at most.
    pub(super) fn wait_us(&mut self, us: u32) {
        let from_us = self.ready.now_us();
        (0..LOOKS_MAX).find(|_| self.ready.now_us().wrapping_sub(from_us) >= us);
    }

    /// The ends of the conversions by the last edge, which was not disturbed by a frame. At least two have ended since the
    /// trigger, so that the store is full.
    pub(super) fn conversions(&mut self) -> Option<Conversions> {
        let mut edge_us = self.ready.fell_us()?;
        let fills_us = self.period_ns / 2000 * 5;
        if edge_us.wrapping_sub(self.triggered_us) <= fills_us {
            // By a clock that is fast the third edge comes later.
            self.wait_us(SLOW_EDGE_US);
            edge_us = self.ready.fell_us()?;
        }
        let is_full = edge_us.wrapping_sub(self.triggered_us) > fills_us;
        let off_ns = self.place_ns(edge_us)?.abs_diff(self.place_ns);
        let is_in_place = off_ns.min(self.period_ns - off_ns) <= EDGE_OFF_NS;
        // The conversion has ended in any case.
        (0..LOOKS_MAX).find(|_| self.ready.now_us().wrapping_sub(edge_us) > EDGE_OFF_NS / 1000);
        (is_full && is_in_place).then(|| Conversions::after(edge_us, self.period_ns))
    }

    /// A frame, while no conversion ends that a full store would lose.
    pub(super) fn next_frame(
        &mut self,
        command: u16,
        conversions: &mut Conversions,
    ) -> Result<Frame, AdcError<SPI::Error>> {
        let now_us = self.ready.now_us();
        if let Some(until_us) = conversions.wait_until_us(now_us, self.frame_us) {
            self.wait_us(until_us.wrapping_sub(now_us));
        }
        self.exchange(command, 0)
    }

    /// When the codes of a conversion were sampled, us, if they are settled.
    pub(super) fn instant_us(&self, conversions: &Conversions, number: u32) -> Option<u32> {
        let end_us = conversions.end_us(number);
        let since_us = end_us.wrapping_sub(self.triggered_us);
        let is_settled = since_us > self.period_ns / 2000 * 7;
        let late_us = (self.period_ns / 2 * 3 + EDGE_LATE_NS) / 1000;
        is_settled.then(|| end_us.wrapping_sub(late_us))
    }
}
