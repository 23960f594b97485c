//! What the controller needs of this chip in every tick.

use embassy_rp::gpio::{Input, Output};
use embassy_rp::peripherals::TRNG;
use embassy_rp::trng::Trng;
use embassy_rp::watchdog::Watchdog;
use embassy_time::{Duration, Instant};
use hal_adapters::adc;
use hal_adapters::can::update::Nonce;
use stage_node::board::Board;
use stage_node::retained::RetainedRam;

/// The watchdog resets this long after it was last fed.
pub const WATCHDOG: Duration = Duration::from_millis(20);
/// While a sector may be erased: 0.4 s at most on a W25Q32.
const WATCHDOG_IN_ERASE: Duration = Duration::from_secs(2);

/// The record that survives a reset.
#[unsafe(link_section = ".uninit.RETAINED")]
pub static RETAINED: RetainedRam = RetainedRam::new();

/// Now, us.
pub fn now_us() -> u32 {
    Instant::now().as_micros() as u32
}

/// The clock of the converter.
pub struct Clock;

impl adc::Clock for Clock {
    fn now_us(&mut self) -> u32 {
        now_us()
    }
}

/// The board.
pub struct Chip {
    /// The watchdog, started.
    pub watchdog: Watchdog,
    /// The LED, on when high.
    pub led: Output<'static>,
    /// Low while the servo is off, and pulled up.
    pub servo: Input<'static>,
    /// Random numbers.
    pub random: Trng<'static, TRNG>,
}

impl Board for Chip {
    fn now_us(&mut self) -> u32 {
        now_us()
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed(WATCHDOG);
    }

    fn expect_erase(&mut self, is_next: bool) {
        self.watchdog
            .feed(if is_next { WATCHDOG_IN_ERASE } else { WATCHDOG });
    }

    fn light(&mut self, is_on: bool) {
        self.led.set_level(is_on.into());
    }

    fn servo_is_off(&mut self) -> Option<bool> {
        Some(self.servo.is_low())
    }

    fn nonce(&mut self) -> Option<Nonce> {
        Some([(); 4].map(|()| self.random.blocking_next_u32()))
    }

    fn record(&self) -> &RetainedRam {
        &RETAINED
    }

    fn reset(&mut self) {
        self.watchdog.trigger_reset();
    }
}
