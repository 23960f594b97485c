//! The stage controller: every 2 ms it reads three Hall and three capacitive codes over SPI
//! and sends the pose over CAN.
//!
//! Converter, pins, clocks and bit timing: [`board`]. What a tick does: the library `firmware`.
//!
//! - Two interrupts have the same priority, so shared state needs no lock. RTIC checks this at compile time:
//!   state moves from `init` into the task that owns it, without `unsafe` and without cells.
//! - TIM2 gives the ticks on an absolute schedule. A tick triggers the converter and is
//!   finished by a second alarm when the codes have settled; it does not wait in between.
//! - Only a tick that was done before the next one was due feeds the watchdog. Faults of
//!   sensors, parameters and bus are reported and do not cause a reset.
//! - A panic, a fault of the core, a stack overflow, a crystal that stops and parameters that change in RAM are noted
//!   in RAM that survives a reset, and reset. The next start reports them. No tick can reach a panic: the linker keeps only panics of
//!   the HAL's set-up of the clocks.
#![no_std]
#![no_main]

mod board;
mod bus;
mod constants;
mod fault;
mod flash;
mod random;
mod spi;
mod start;
mod supply;
mod timer;
mod wait;
mod watchdog;

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::start;
    use super::timer::{SETTLED, TICK};
    use super::{
        board, board::Converter, bus::Bus, constants::Constants, fault, flash, timer::Clock,
    };
    use super::{random::Random, supply::Supply, wait::Stopwatch, watchdog::Watchdog};
    use cortex_m::peripheral::SCB;
    use hal_adapters::adc::FrameSampler;
    use hal_adapters::can::Layout;
    use hal_adapters::can::status::{bit, board_check};
    use hal_adapters::can::update::Identity;
    use runtime::{PlanarPose, Status};
    use stage_node::acquisition::Acquisition;
    use stage_node::fpu;
    use stage_node::node::{Facts, Node, Parameters, SampleFault};
    use stage_node::records::{Loaded, Records};
    use stage_node::retained::{FaultKind, Retained, Step};
    use stage_node::schedule::{Schedule, TICKS_PER_S, Tick};
    use stage_node::start_up::PROVEN_TICKS;
    use stage_node::telemetry::STAGE;
    use stm32f4xx_hal::gpio::PinState;
    use stm32f4xx_hal::pac::TIM2;
    use stm32f4xx_hal::rcc::Enable;

    const CORE_MHZ: u32 = board::CORE_HZ / 1_000_000;
    /// Longest wait of a reset or an erase for the answers to leave.
    const SILENCE_TICKS_MAX: u32 = TICKS_PER_S / 5;

    #[shared]
    struct Shared {
        #[lock_free]
        bus: Bus,
    }

    #[local]
    struct Local {
        clock: Clock,
        schedule: Schedule,
        /// The tick while its codes settle.
        open: Option<Tick>,
        acquisition: Acquisition<Converter>,
        node: Node<'static>,
        facts: Facts,
        /// The zero deviation in the retained record.
        zero: PlanarPose<f32>,
        records: Records<flash::Sectors>,
        constants: Option<Constants>,
        random: Random,
        /// Ticks that a reset or an erase has waited for the answers to leave.
        silence_waits: u32,
        watchdog: Watchdog,
        stopwatch: Stopwatch,
        led: board::Led,
        servo: board::ServoPin,
        overrun_ticks: u32,
    }

    #[init(local = [loaded: Option<Loaded> = None])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        fault::guard_stack(&mut cx.core.MPU);
        let device = cx.device;
        let mut stopwatch = Stopwatch::new(cx.core.SYST);
        let before = start::before(&device.RCC);
        let mut watchdog = Watchdog::start(device.IWDG, &device.DBGMCU, &mut stopwatch);
        // Before anything runs faster or is written.
        let supply = Supply::wait(device.PWR, &device.RCC, &mut watchdog, &mut stopwatch);
        let (mut rcc, crystal) = start::clocks(&before, device.RCC, &mut watchdog, &mut stopwatch);

        watchdog.feed();
        fault::begin(Step::Peripherals);
        let ports = (device.GPIOA, device.GPIOB, device.GPIOC);
        let serial = (device.SPI1, device.DMA2);
        TIM2::enable(&mut rcc);
        let mut clock = Clock::new(device.TIM2);
        let ready = clock.data_ready();
        let parts = board::set_up(ports, serial, device.CAN1, ready, &mut rcc);
        let bus = Bus::new(parts.can, board::STAGE_NODE, crystal, &mut stopwatch);
        let random = Random::new(device.RNG, &mut rcc);

        watchdog.feed();
        fault::begin(Step::Parameters);
        let options = device.FLASH.optcr().read().bits();
        let sectors = flash::Sectors::new(device.FLASH, supply);
        let (mut records, refusal) = Records::start(sectors, before.choice, board::STAGE_SERIAL);
        // After a warm start the FPU may have any settings. These give the host's arithmetic.
        fpu::restore();
        let sound = runtime::arithmetic::check().is_ok() && fpu::defaults_are_sound();
        // Without sound arithmetic no blob runs.
        let loaded = match sound {
            true => records.load(before.choice, cx.local.loaded),
            false => None,
        };
        let blob = loaded.map_or(0, |loaded| loaded.crc);
        let stop = before.stop(loaded.is_some());
        let parameters = Parameters::at_start(loaded, refusal, stop, sound);
        let identity = Identity {
            serial: board::STAGE_SERIAL,
            key: board::STAGE_KEY,
            program_version: board::PROGRAM_VERSION,
        };
        let layout = Layout::from_bits(Converter::CODE_BITS);
        let node = Node::new(parameters, before.by_fault, layout, identity);
        let mut node = node.with_rezero_limits(board::rezero_limits());
        let zero_lost = before.restore_zero(&mut node, blob);
        let zero = node.zero();
        // Without a running blob the record stays for a later start.
        if node.decodes() {
            fault::update(|record| record.runs(blob, zero));
        }

        watchdog.feed();
        fault::begin(Step::Converter);
        let mut acquisition = Acquisition::new(parts.converter);
        // The ticks report a failure and start it again.
        let _ = acquisition.start();

        let checks = parts.not_pulled_up
            | bit(board_check::INTERNAL_OSCILLATOR, !crystal)
            | bit(board_check::CAN_NOT_STARTED, !bus.takes_part())
            | bit(board_check::ZERO_LOST, zero_lost);
        let board = start::board_facts(&before, options, checks);
        let schedule = Schedule::starting(clock.now_us());
        clock.set_alarm::<TICK>(schedule.due_us());
        watchdog.feed();
        fault::begin(Step::Ticking);

        (
            Shared { bus },
            Local {
                clock,
                schedule,
                open: None,
                acquisition,
                node,
                facts: Facts {
                    board,
                    ..Facts::default()
                },
                zero,
                records,
                constants: loaded.map(Constants::new),
                random,
                silence_waits: 0,
                watchdog,
                stopwatch,
                led: parts.led,
                servo: parts.servo,
                overrun_ticks: 0,
            },
        )
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// A tick: the trigger, and, once the codes have settled, the rest.
    #[task(
        binds = TIM2,
        priority = 1,
        local = [
            clock, schedule, open, acquisition, node, facts, zero, records, constants, random,
            silence_waits, watchdog, stopwatch, led, servo, overrun_ticks
        ],
        shared = [bus]
    )]
    fn tick(cx: tick::Context) {
        let local = cx.local;
        let bus = cx.shared.bus;

        let alarms = local.clock.take_alarms();
        if alarms.tick {
            let started_us = local.clock.now_us();
            let tick = local.schedule.start_tick(started_us);
            local.acquisition.trigger();
            local.clock.set_alarm::<TICK>(local.schedule.due_us());
            // A tick that is still open is abandoned: it never feeds the watchdog.
            if local.open.replace(tick).is_some() {
                *local.overrun_ticks = local.overrun_ticks.saturating_add(1);
            }
            if Converter::SETTLE_US > 0 {
                local
                    .clock
                    .set_alarm::<SETTLED>(started_us.wrapping_add(Converter::SETTLE_US));
                return;
            }
        } else if !alarms.settled {
            return;
        }
        let Some(tick) = local.open.take() else {
            return;
        };

        let sample = local.acquisition.sample(tick.sequence);
        bus.start_tick();
        // Its announcement has left, or nobody listens.
        let is_silent = bus.is_idle() || *local.silence_waits > SILENCE_TICKS_MAX;
        let waits = local.node.wants_reset() || local.node.is_storing();
        *local.silence_waits = if waits { *local.silence_waits + 1 } else { 0 };
        if local.node.wants_reset() && is_silent {
            fault::update(Retained::activate);
            SCB::sys_reset();
        }
        local.facts.missed_ticks = local.schedule.missed();
        local.facts.bus_off = bus.bus_off;
        let is_low = local.records.flash().supply.is_low();
        (local.facts).note(board_check::SUPPLY_LOW, is_low);
        (local.facts).note(board_check::CAN_NOT_STARTED, !bus.takes_part());
        local.facts.servo_off_pin = board::servo_is_off(local.servo);
        let sample = sample.map_err(|fault| SampleFault::from(&fault));
        let reading = local.node.tick(sample, local.facts, &mut bus.outbox);
        let is_missing = reading.status.any(Status::TEMPERATURE_MISSING);
        (local.facts).note(board_check::TEMPERATURE_MISSING, is_missing);
        // After the pose: its frames find the mailboxes empty.
        bus.receive(local.node, local.records, local.random);
        bus.send();
        if !(local.constants.as_mut()).is_none_or(Constants::are_sound) {
            fault::reset_by(FaultKind::Constants, 0, 0);
        }
        local.led.set_state(PinState::from(local.node.light()));
        if *local.zero != local.node.zero() {
            *local.zero = local.node.zero();
            fault::update(|record| record.zero = *local.zero);
        }
        if local.node.ticks() == PROVEN_TICKS {
            fault::update(Retained::prove);
        }
        if waits && is_silent {
            // A sector is erased, and the core stands meanwhile.
            local.watchdog.set_period(CORE_MHZ, true, local.stopwatch);
            local.node.store(&mut bus.outbox, local.records);
            local.watchdog.set_period(CORE_MHZ, false, local.stopwatch);
        }
        bus.send();

        let counters = [
            *local.overrun_ticks,
            local.acquisition.faults(),
            local.acquisition.starts(),
            bus.sent,
            bus.outbox.dropped(),
            bus.overruns,
            local.node.fpu_restored(),
        ];
        STAGE.put(tick.sequence, tick.started_us, &reading, counters);
        if tick.on_schedule(local.clock.now_us()) {
            local.watchdog.feed();
        } else {
            *local.overrun_ticks = local.overrun_ticks.saturating_add(1);
        }
    }

    /// A mailbox has become empty: the next frame.
    #[task(binds = CAN1_TX, priority = 1, shared = [bus])]
    fn mailbox_empty(cx: mailbox_empty::Context) {
        cx.shared.bus.send();
    }
}
