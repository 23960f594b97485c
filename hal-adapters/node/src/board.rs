//! The parts of chip and board that the controller needs besides converter, CAN and flash.

use crate::retained::RetainedRam;
use hal_adapters::can::update::Nonce;

/// Clock, watchdog, light, random numbers, servo line, and the RAM that survives a reset.
pub trait Board {
    /// Now, us, wrapping. The clock never stops.
    fn now_us(&mut self) -> u32;

    /// The watchdog starts its period anew. Its period is longer than two ticks.
    fn feed_watchdog(&mut self);

    /// `true`: a sector is erased next, and the core may stand for half a second; `false`: no longer.
    fn expect_erase(&mut self, is_next: bool);

    /// Switches the LED.
    fn light(&mut self, is_on: bool);

    /// Whether the servo line says that the servo is off; `None` without such a line.
    fn servo_is_off(&mut self) -> Option<bool>;

    /// A random number that was never given before; `None` without a source of any.
    fn nonce(&mut self) -> Option<Nonce>;

    /// The record that survives a reset.
    fn record(&self) -> &RetainedRam;

    /// Resets the chip.
    fn reset(&mut self);
}
