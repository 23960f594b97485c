//! When the conversions end, by the edges of DRDY, and which conversion a frame carries.

use super::conversions::Conversions;
use super::{Ads131m08, Frame};
use crate::adc::{AdcError, DataReady};
use core::ops::RangeInclusive;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

/// A conversion, ns, with CLKIN at 8 MHz.
pub(super) const PERIOD_NS: u32 = 64_000;
/// The measured period lies in this range.
const PERIODS_NS: RangeInclusive<u32> = 60_000..=68_000;
/// The period is measured over this time: four conversions.
const MEASURE_US: u32 = 260;
/// Among more periods one that is 6 % off would be miscounted.
const COUNT_MAX: u32 = 8;
/// From a change of the oversampling until the first edge has come in any case, us.
const FIRST_EDGE_US: u32 = 200;
/// By a clock that is 6 % fast an edge comes this much later, us.
const SLOW_EDGE_US: u32 = 12;
/// From the last sample of a conversion to its edge, ns: 0 or 11 us.
const EDGE_LATE_NS: u32 = 5_500;
/// Looks at the clock until a wait is given up, because the clock stands.
const LOOKS_MAX: u32 = 100_000;

impl<SPI: SpiDevice, SYNC: OutputPin, READY: DataReady> Ads131m08<SPI, SYNC, READY> {
    /// The time from edge to edge by the controller's clock.
    pub(super) fn measure_period(&mut self) -> Result<(), AdcError<SPI::Error>> {
        self.wait_us(FIRST_EDGE_US);
        let first_us = self.ready.fell_us().ok_or(AdcError::UnknownInstant)?;
        let from_us = self.ready.now_us();
        let (mut last_us, mut shortest_us) = (first_us, u32::MAX);
        for _ in 0..LOOKS_MAX {
            if let Some(us) = self.ready.fell_us() {
                shortest_us = shortest_us.min(us.wrapping_sub(last_us));
                last_us = us;
            }
            if self.ready.now_us().wrapping_sub(from_us) > MEASURE_US {
                break;
            }
        }
        let span_ns = last_us.wrapping_sub(first_us).min(1_000_000) * 1000;
        let count = (span_ns + PERIOD_NS / 2) / PERIOD_NS;
        let period_ns = span_ns.checked_div(count).unwrap_or(0);
        // If the period is a multiple of a conversion, so is the shortest distance of edges.
        let is_single = shortest_us < PERIOD_NS / 1000 * 3 / 2;
        if count > COUNT_MAX || !is_single || !PERIODS_NS.contains(&period_ns) {
            return Err(AdcError::UnknownInstant);
        }
        self.period_ns = period_ns;
        Ok(())
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
        is_full.then(|| Conversions::after(edge_us, self.period_ns))
    }

    /// A frame, while no conversion ends that a full store would lose.
    pub(super) fn next_frame(
        &mut self,
        command: u16,
        conversions: &mut Option<Conversions>,
    ) -> Result<Frame, AdcError<SPI::Error>> {
        let now_us = self.ready.now_us();
        let wait = conversions
            .as_mut()
            .and_then(|c| c.wait_until_us(now_us, self.frame_us));
        if let Some(until_us) = wait {
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

/// The conversion that a frame carries, if it is known.
pub(super) fn follow(
    conversions: &mut Option<Conversions>,
    frame: &Frame,
    is_ready: bool,
) -> Option<u32> {
    conversions
        .as_mut()?
        .read(frame.from_us, frame.to_us, is_ready)
}
