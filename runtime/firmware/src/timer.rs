//! TIM2 as a clock in us that never stops, with an alarm. Its 32 bits wrap after 71
//! minutes, like the time of a frame. Its third channel notes when the converter's data-ready line falls.

use crate::board;
use hal_adapters::adc::DataReady;
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::pac::tim2::RegisterBlock;

/// The clock.
pub struct Clock {
    timer: TIM2,
}

impl Clock {
    /// Starts the clock. TIM2 must have been switched on.
    pub fn new(timer: TIM2) -> Self {
        timer
            .psc()
            .write(|w| w.psc().set((board::TIMER_HZ / 1_000_000 - 1) as u16));
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.egr().write(|w| w.ug().set_bit());
        timer.sr().write(|w| w.uif().clear_bit());
        // Channel 3 captures the falling edges of its own input (RM0090 rev. 18, section 18.3.5).
        timer.ccmr2_input().write(|w| w.cc3s().ti3());
        (timer.ccer()).write(|w| w.cc3p().set_bit().cc3e().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        Self { timer }
    }

    /// Sets the alarm off at `due_us`; at once, if that is past.
    pub fn set_alarm(&mut self, due_us: u32) {
        self.timer.ccr(0).write(|w| w.ccr().set(due_us));
        // A match with the register's earlier value is no alarm.
        self.silence();
        self.timer.dier().write(|w| w.cc1ie().set_bit());
        if now_us().wrapping_sub(due_us) < u32::MAX / 2 {
            self.timer.egr().write(|w| w.cc1g().set_bit());
        }
    }

    /// Ends the alarm.
    pub fn silence(&mut self) {
        // Writing 1 does not change a flag; the flags of other channels are not used.
        self.timer.sr().write(|w| w.cc1if().clear_bit());
    }
}

/// The data-ready line of the converter, at channel 3 of the running clock.
#[derive(Default)]
pub struct ReadyLine {
    seen_us: u32,
}

/// The timer, which [`Clock`] has started.
const fn timer() -> &'static RegisterBlock {
    // SAFETY: two registers are read, and reading CCR3 changes a flag that nothing uses.
    unsafe { &*TIM2::PTR }
}

/// Now, us.
pub fn now_us() -> u32 {
    timer().cnt().read().cnt().bits()
}

impl hal_adapters::adc::Clock for ReadyLine {
    fn now_us(&mut self) -> u32 {
        now_us()
    }
}

impl DataReady for ReadyLine {
    fn fell_us(&mut self) -> Option<u32> {
        let fell_us = timer().ccr(2).read().ccr().bits();
        (core::mem::replace(&mut self.seen_us, fell_us) != fell_us).then_some(fell_us)
    }
}
