//! The stage controller: every 2 ms it reads three Hall and three capacitive codes over SPI
//! and sends the pose over CAN.
//!
//! Converter, pins, clocks and bit timing: [`board`]. What a tick does: the library `firmware`.
//!
//! - There are two interrupts of the same priority. Neither interrupts the other, so shared
//!   state needs no lock. RTIC checks this at compile time: state moves from `init` into the
//!   task that owns it, without `unsafe` and without cells. There are no software tasks and
//!   no timer queue.
//! - TIM2 gives the ticks on an absolute schedule. A tick triggers the converter and is
//!   finished by a second alarm when the codes have settled; it does not wait in between.
//! - Only a tick that was done before the next one was due feeds the watchdog. Faults of
//!   sensors, parameters and bus are reported and do not cause a reset.
//! - A panic, a fault of the core, a stack that overflows and a crystal that stops are noted in
//!   RAM that a reset leaves alone, and reset. The next start tells them. No tick can reach a
//!   panic: those that the linker keeps are in the HAL's set-up of the clocks.
#![no_std]
#![no_main]

mod board;
mod bus;
mod fault;
mod flash;
mod random;
mod start;
mod timer;
mod wait;
mod watchdog;

use embedded_hal::delay::DelayNs;

/// Short waits by counting cycles of the core.
pub struct Cycles;

impl DelayNs for Cycles {
    fn delay_ns(&mut self, ns: u32) {
        const CYCLES_PER_US: u32 = board::CORE_HZ / 1_000_000;
        cortex_m::asm::delay((ns / 1000 + 1) * CYCLES_PER_US);
    }

    fn delay_us(&mut self, us: u32) {
        self.delay_ns(us.saturating_mul(1000));
    }
}

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::start::{self, Found, OptionBytes, ZeroKeeper};
    use super::{Cycles, board, board::Converter, bus::Bus, fault, flash, timer::Clock};
    use super::{random::Random, wait::Stopwatch, watchdog::Watchdog};
    use cortex_m::peripheral::SCB;
    use firmware::acquisition::Acquisition;
    use firmware::fpu::{Fpu, FpuSettings};
    use firmware::node::{Facts, Node, Parameters, SampleFault};
    use firmware::records::Records;
    use firmware::retained::{Retained, Step};
    use firmware::schedule::{Schedule, Tick};
    use firmware::slots::Loaded;
    use firmware::start_up::{Cause, PROVEN_TICKS};
    use firmware::store::Record;
    use firmware::telemetry::{Counters, Ended, STAGE};
    use hal_adapters::adc::FrameSampler;
    use hal_adapters::can::Layout;
    use hal_adapters::can::update::Identity;
    use stm32f4xx_hal::gpio::PinState;
    use stm32f4xx_hal::pac::TIM2;
    use stm32f4xx_hal::rcc::Enable;

    const CORE_MHZ: u32 = board::CORE_HZ / 1_000_000;
    /// Where no other node acknowledges the answers, a reset waits no longer.
    const RESET_TICKS_MAX: u32 = 100;

    #[shared]
    struct Shared {
        #[lock_free]
        bus: Bus,
    }

    #[local]
    struct Local {
        clock: Clock,
        schedule: Schedule,
        /// The tick whose codes are still settling.
        open: Option<Tick>,
        acquisition: Acquisition<Converter>,
        node: &'static mut Node<'static>,
        facts: Facts,
        zero: ZeroKeeper,
        records: Records<flash::Sectors>,
        random: Random,
        /// Ticks for which a reset has waited until the answers have left.
        reset_waits: u32,
        watchdog: Watchdog,
        led: board::Led,
        servo: board::ServoPin,
        overrun_ticks: u32,
    }

    #[init(local = [
        loaded: Option<Loaded> = None,
        node_place: Option<Node<'static>> = None,
        record: Record = Record::EMPTY,
    ])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        fault::guard_stack(&mut cx.core.MPU);
        let device = cx.device;
        let mut stopwatch = Stopwatch::new(cx.core.SYST);
        let before = start::before(&device.RCC);
        let mut watchdog = Watchdog::start(device.IWDG, &device.DBGMCU, &mut stopwatch);
        let (mut rcc, crystal) = start::clocks(&before, device.RCC, &mut stopwatch);

        watchdog.feed();
        fault::begin(Step::Peripherals);
        let ports = (device.GPIOA, device.GPIOB, device.GPIOC);
        let parts = board::set_up(ports, device.SPI1, device.CAN1, &mut rcc);
        let bus = Bus::new(parts.can, crystal, &mut stopwatch);
        let random = Random::new(device.RNG, &mut rcc);

        watchdog.feed();
        fault::begin(Step::Parameters);
        // A sector may be erased, and the core stands meanwhile.
        watchdog.set_period(CORE_MHZ, true, &mut stopwatch);
        let options = OptionBytes::read(&device.FLASH);
        let sectors = flash::Sectors::new(device.FLASH);
        let is_faulty = before.blames_newest();
        let check = before.check(board::stage_serial(), |crc| {
            fault::update(|record| record.checked_blob = crc.unwrap_or(0));
        });
        let (mut records, found) = Records::start(sectors, cx.local.record, check, is_faulty);
        let program_hash = flash::program_crc();
        // After a warm start the FPU may have any settings; with these the arithmetic is the host's.
        Fpu.restore();
        let sound = runtime::arithmetic::check().is_ok() && Fpu::defaults_are_sound();
        // What does not decode does not run.
        let runs = found.blob.filter(|_| sound);
        let loaded = runs.and_then(|blob| records.load(blob, cx.local.loaded));
        watchdog.set_period(CORE_MHZ, false, &mut stopwatch);
        let blob = loaded.map_or(0, |loaded| loaded.crc);
        let parameters = Parameters::at_start(loaded, found.refusal, sound);
        let identity = Identity {
            serial: board::stage_serial(),
            key: board::stage_key(),
            program_version: board::PROGRAM_VERSION,
            program_hash,
        };
        let node = node(cx.local.node_place, parameters, before.by_fault, identity);
        let zero_lost = before.restore_zero(node, blob);
        let zero = ZeroKeeper::new(node.decodes().then_some(blob), node.zero());

        watchdog.feed();
        fault::begin(Step::Converter);
        let mut acquisition = Acquisition::new(parts.converter);
        // If the converter is not there yet, the ticks report why and start it again.
        let _ = acquisition.start(&mut Cycles);

        let board = start::board_facts(
            &before,
            options,
            &Found {
                pulled_up: parts.pulled_up,
                crystal,
                can_started: bus.takes_part(),
                zero_lost,
            },
        );
        STAGE.put_start(before.cause == Cause::Watchdog, &board);
        TIM2::enable(&mut rcc);
        let mut clock = Clock::new(device.TIM2);
        let schedule = Schedule::starting(clock.now_us());
        clock.set_tick_alarm(schedule.due_us());
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
                    internal_oscillator: !crystal,
                    board,
                    ..Facts::default()
                },
                zero,
                records,
                random,
                reset_waits: 0,
                watchdog,
                led: parts.led,
                servo: parts.servo,
                overrun_ticks: 0,
            },
        )
    }

    /// Puts the node where it stays. In a function of its own, what that takes of the stack is not
    /// there while the parameters are read.
    #[inline(never)]
    fn node(
        place: &'static mut Option<Node<'static>>,
        parameters: Parameters<'static>,
        by_fault: bool,
        identity: Identity<'static>,
    ) -> &'static mut Node<'static> {
        let layout = Layout::for_bits(Converter::CODE_BITS);
        let node = Node::new(parameters, by_fault, layout, identity);
        place.insert(node.recording(cfg!(feature = "record")))
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
            clock, schedule, open, acquisition, node, facts, zero, records, random, reset_waits,
            watchdog, led, servo, overrun_ticks
        ],
        shared = [bus]
    )]
    fn tick(cx: tick::Context) {
        let tick::LocalResources {
            clock,
            schedule,
            open,
            acquisition,
            node,
            facts,
            zero,
            records,
            random,
            reset_waits,
            watchdog,
            led,
            servo,
            overrun_ticks,
            ..
        } = cx.local;
        let bus = cx.shared.bus;

        let alarms = clock.take_alarms();
        if alarms.tick {
            let started_us = clock.now_us();
            let tick = schedule.start_tick(started_us);
            acquisition.trigger(&mut Cycles);
            clock.set_tick_alarm(schedule.due_us());
            // A tick that is still open is abandoned: it never feeds the watchdog.
            if open.replace(tick).is_some() {
                *overrun_ticks = overrun_ticks.saturating_add(1);
            }
            if Converter::SETTLE_US > 0 {
                clock.set_settled_alarm(started_us.wrapping_add(Converter::SETTLE_US));
                return;
            }
        } else if !alarms.settled {
            return;
        }
        let Some(tick) = open.take() else { return };

        let sampled_us = tick.started_us.wrapping_add(Converter::SAMPLE_US);
        let sample = acquisition.sample(tick.sequence, sampled_us, &mut Cycles);
        bus.start_tick();
        if node.wants_reset() {
            *reset_waits += 1;
            if bus.is_idle() || *reset_waits > RESET_TICKS_MAX {
                SCB::sys_reset();
            }
        }
        facts.missed_ticks = schedule.missed();
        facts.bus_off = bus.bus_off();
        facts.note_bus(bus.takes_part());
        facts.servo_off_pin = Some(servo.is_high());
        let sample = sample.map_err(|fault| SampleFault::from(&fault));
        let reading = node.tick(sample, facts, &mut Fpu, &mut bus.outbox);
        // After the pose, whose frames then find the mailboxes empty.
        bus.receive(node, records, random);
        bus.send();
        led.set_state(PinState::from(node.light()));
        zero.keep(node.zero());
        if node.ticks() == PROVEN_TICKS {
            fault::update(Retained::prove);
            records.prove();
        }
        node.update(&mut bus.outbox, records);
        bus.send();

        let (state, reason) = node.state();
        STAGE.put(&Ended {
            state: (state as u8, reason),
            ticks: node.ticks(),
            sequence: tick.sequence,
            time_us: tick.started_us,
            reading,
            counters: Counters {
                missed_ticks: schedule.missed(),
                overrun_ticks: *overrun_ticks,
                adc_faults: acquisition.faults(),
                adc_starts: acquisition.starts(),
                frames_sent: bus.sent(),
                frames_dropped: bus.outbox.dropped(),
                bus_off: bus.bus_off(),
                fpu_restored: node.fpu_restored(),
            },
        });
        let now_us = clock.now_us();
        STAGE.put_duration(now_us.wrapping_sub(tick.started_us));
        if tick.on_schedule(now_us) {
            watchdog.feed();
        } else {
            *overrun_ticks = overrun_ticks.saturating_add(1);
        }
    }

    /// A mailbox has become empty: the next frame.
    #[task(binds = CAN1_TX, priority = 1, shared = [bus])]
    fn mailbox_empty(cx: mailbox_empty::Context) {
        cx.shared.bus.send();
    }
}
