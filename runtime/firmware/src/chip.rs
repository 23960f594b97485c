//! What the controller needs of this chip in every tick.

use crate::board::{self, CORE_HZ, Led, ServoPin};
use crate::fault::RETAINED;
use crate::random::Random;
use crate::wait::Stopwatch;
use crate::{timer, watchdog::Watchdog};
use cortex_m::peripheral::SCB;
use hal_adapters::can::update::Nonce;
use stage_node::board::Board;
use stage_node::retained::RetainedRam;
use stm32f4xx_hal::gpio::PinState;

/// Its parts.
pub struct Chip {
    /// The watchdog.
    pub watchdog: Watchdog,
    /// Bounds the changes of its period.
    pub stopwatch: Stopwatch,
    /// Random numbers.
    pub random: Random,
    /// The LED.
    pub led: Led,
    /// Whether the servo is off.
    pub servo: ServoPin,
}

impl Board for Chip {
    fn now_us(&mut self) -> u32 {
        timer::now_us()
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn expect_erase(&mut self, is_next: bool) {
        (self.watchdog).set_period(CORE_HZ / 1_000_000, is_next, &mut self.stopwatch);
    }

    fn light(&mut self, is_on: bool) {
        self.led.set_state(PinState::from(is_on));
    }

    fn servo_is_off(&mut self) -> Option<bool> {
        board::servo_is_off(&self.servo)
    }

    fn nonce(&mut self) -> Option<Nonce> {
        self.random.nonce()
    }

    fn record(&self) -> &RetainedRam {
        &RETAINED
    }

    fn reset(&mut self) {
        SCB::sys_reset();
    }
}
