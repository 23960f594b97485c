//! The stage controller: every 2 ms it reads three Hall and three capacitive codes over SPI
//! and sends the pose over CAN.
//!
//! Converter, pins, clocks and bit timing: [`board`]. What a tick does: the crate `stage_node`.
//!
//! - Two interrupts have the same priority, so shared state needs no lock. RTIC checks this at compile time:
//!   state moves from `init` into the tasks that use it, without `unsafe` and without cells.
//! - TIM2 gives the ticks on an absolute schedule. A tick triggers the converter and is
//!   finished by the next alarm when the codes have settled; it does not wait in between.
//! - Only a tick that was done before the next one was due feeds the watchdog. Faults of
//!   sensors, parameters and bus are reported and do not cause a reset.
//! - A panic, a fault of the core, a stack overflow, a crystal that stops and parameters that change in RAM are noted
//!   in RAM that survives a reset, and reset. The next start reports them. No tick can reach a panic: the linker keeps only panics of
//!   the HAL's set-up of the clocks.
#![no_std]
#![no_main]

mod board;
mod bus;
mod chip;
mod fault;
mod flash;
mod log;
mod random;
mod seal;
mod spi;
mod start;
mod supply;
mod timer;
mod wait;
mod watchdog;

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::board::{self, Converter};
    use super::fault::{self, RETAINED};
    use super::timer::Clock;
    use super::{bus::BxCan, chip::Chip, flash, random::Random, seal, start, supply};
    use super::{wait::Stopwatch, watchdog::Watchdog};
    use hal_adapters::can::status::{bit, board_check};
    use stage_node::controller::{Controller, Parts};
    use stage_node::retained::Step;
    use stage_node::start_up::Stop;
    use stm32f4xx_hal::pac::TIM2;
    use stm32f4xx_hal::rcc::Enable;

    #[shared]
    struct Shared {
        #[lock_free]
        controller: Controller<'static, Converter, BxCan, flash::Sectors, Chip>,
    }

    #[local]
    struct Local {
        clock: Clock,
    }

    #[init]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        fault::guard_stack(&mut cx.core.MPU);
        let device = cx.device;
        let mut stopwatch = Stopwatch::new(cx.core.SYST);
        let mut before = start::before(&device.RCC);
        let mut watchdog = Watchdog::start(device.IWDG, &device.DBGMCU, &mut stopwatch);
        // Before anything runs faster or is written.
        supply::wait(&device.PWR, &device.RCC, &mut watchdog, &mut stopwatch);
        let (mut rcc, crystal) = start::clocks(&before, device.RCC, &mut watchdog, &mut stopwatch);

        watchdog.feed();
        if seal::program_has_changed() {
            before.stop_by(Stop::ProgramChanged);
        }
        RETAINED.begin(Step::Peripherals);
        let ports = (device.GPIOA, device.GPIOB, device.GPIOC);
        let serial = (device.SPI1, device.DMA2);
        TIM2::enable(&mut rcc);
        let mut clock = Clock::new(device.TIM2);
        let pins = board::set_up(ports, serial, &mut rcc);
        let can = BxCan::new(device.CAN1, &mut rcc, crystal, &mut stopwatch);
        let options = device.FLASH.optcr().read().bits();
        let checks =
            pins.not_pulled_up | seal::checks() | bit(board_check::INTERNAL_OSCILLATOR, !crystal);
        let parts = Parts {
            converter: pins.converter,
            can,
            slots: flash::slots(device.FLASH),
            board: Chip {
                watchdog,
                stopwatch,
                random: Random::new(device.RNG, &mut rcc),
                led: pins.led,
                servo: pins.servo,
            },
        };
        let facts = start::board_facts(&before, options, checks);
        let controller = Controller::start(parts, board::settings(), &before, facts);
        clock.set_alarm(controller.due_us());
        (Shared { controller }, Local { clock })
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// Half of a tick: the trigger, or, once the codes have settled, the rest.
    #[task(binds = TIM2, priority = 1, local = [clock], shared = [controller])]
    fn tick(cx: tick::Context) {
        cx.local.clock.silence();
        let due_us = cx.shared.controller.turn();
        cx.local.clock.set_alarm(due_us);
    }

    /// A mailbox has become empty: the next frame.
    #[task(binds = CAN1_TX, priority = 1, shared = [controller])]
    fn mailbox_empty(cx: mailbox_empty::Context) {
        cx.shared.controller.mailbox_empty();
    }
}
