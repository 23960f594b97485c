//! The stage controller: every 2 ms it reads three Hall and three capacitive codes over SPI
//! and sends the pose over CAN.
//!
//! Pins, clocks and bit timing: [`board`]. What a tick does: the library `firmware`.
//!
//! - Two interrupts of one priority, so that none interrupts the other and nothing is shared
//!   that needs a lock. RTIC checks just this at compile time: state moves from `init` into the
//!   task that owns it, without `unsafe` and without cells. There are no software tasks and
//!   no timer queue.
//! - TIM2 gives the ticks on an absolute schedule. A tick triggers the converter and is
//!   finished when the codes have settled; nothing is waited for in between.
//! - The watchdog is fed by a tick that was done before the next one was due, and by nothing
//!   else. Faults of sensors, parameters and bus are reported, never reset.
//! - A panic stops everything, and the watchdog resets. None can be reached from a tick: the
//!   one that the linker keeps there lies behind a check of the length of received frames.
#![no_std]
#![no_main]

mod board;
mod bus;
mod flash;
mod timer;

use core::convert::Infallible;
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

#[panic_handler]
fn stop(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::nop();
    }
}

/// A pin whose writes cannot fail has no error to tell.
fn infallible<T>(result: Result<T, Infallible>) -> T {
    match result {
        Ok(value) => value,
        Err(never) => match never {},
    }
}

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use super::{Cycles, board, bus::Bus, flash, infallible, timer::Clock};
    use embedded_hal_bus::spi::ExclusiveDevice;
    use embedded_hal_bus::spi::NoDelay;
    use firmware::acquisition::Acquisition;
    use firmware::fpu::{Fpu, FpuSettings};
    use firmware::node::{Facts, Node, Parameters, SampleFault};
    use firmware::schedule::{Schedule, Tick};
    use firmware::slots::{self, Loaded};
    use firmware::telemetry::{Counters, Ended, STAGE};
    use hal_adapters::adc::FrameSampler;
    use runtime::{OnInvalid, Servo};
    use stm32f4xx_hal::can::CanExt;
    use stm32f4xx_hal::gpio::{Output, PA4, PB0, PC1, PinState, Speed};
    use stm32f4xx_hal::pac::TIM2;
    use stm32f4xx_hal::prelude::*;
    use stm32f4xx_hal::rcc::Enable;
    use stm32f4xx_hal::time::Hertz;
    use stm32f4xx_hal::watchdog::IndependentWatchdog;

    type Device = ExclusiveDevice<board::Spi, PA4<Output>, NoDelay>;
    #[cfg(not(feature = "ads8688"))]
    type Converter = hal_adapters::adc::Ads131m08<Device, PB0<Output>>;
    #[cfg(feature = "ads8688")]
    type Converter = hal_adapters::adc::Ads8688<Device>;

    #[shared]
    struct Shared {
        #[lock_free]
        bus: Bus,
    }

    #[local]
    struct Local {
        clock: Clock,
        schedule: Schedule,
        /// The tick whose codes settle.
        open: Option<Tick>,
        acquisition: Acquisition<Converter>,
        node: Node<'static>,
        watchdog: IndependentWatchdog,
        led: PC1<Output>,
        overrun_ticks: u32,
        /// Keeps the pin of the converter's reset at rest where the driver does not own it.
        #[cfg(feature = "ads8688")]
        _reset: PB0<Output>,
    }

    #[init(local = [loaded: Option<Loaded> = None])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let device = cx.device;
        let watchdog_reset = device.RCC.csr().read().wdgrstf().bit_is_set();
        device.RCC.csr().modify(|_, w| w.rmvf().set_bit());
        STAGE.put_watchdog_reset(watchdog_reset);

        let mut rcc = device.RCC.freeze(board::clocks());
        let gpioa = device.GPIOA.split(&mut rcc);
        let gpiob = device.GPIOB.split(&mut rcc);
        let gpioc = device.GPIOC.split(&mut rcc);

        let mut select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
        select.set_speed(Speed::VeryHigh);
        let mut sync = gpiob.pb0.into_push_pull_output_in_state(PinState::High);
        sync.set_speed(Speed::High);
        let pins = (
            Some(gpioa.pa5.into_alternate().speed(Speed::VeryHigh)),
            Some(gpioa.pa6.into_alternate().speed(Speed::VeryHigh)),
            Some(gpioa.pa7.into_alternate().speed(Speed::VeryHigh)),
        );
        #[cfg(not(feature = "ads8688"))]
        let mode = hal_adapters::adc::ads131m08::MODE;
        #[cfg(feature = "ads8688")]
        let mode = hal_adapters::adc::ads8688::MODE;
        let spi = device
            .SPI1
            .spi(pins, mode, Hertz::from_raw(board::SPI_HZ), &mut rcc);
        let spi = infallible(ExclusiveDevice::new_no_delay(spi, select));
        #[cfg(not(feature = "ads8688"))]
        let converter = Converter::new(spi, sync, board::CHANNELS);
        #[cfg(feature = "ads8688")]
        let converter = Converter::new(spi, board::CHANNELS);

        let bus = Bus::new(device.CAN1.can((gpiob.pb9, gpiob.pb8), &mut rcc));

        let memory = flash::parameter_slots();
        let choice = slots::choose(memory, board::STAGE_SERIAL);
        let loaded = choice
            .slot
            .and_then(|slot| memory.get(slot))
            .and_then(|slot| slots::load(slot));
        // A warm start may come with any settings; then the arithmetic must be as the host's.
        Fpu.restore();
        let sound = runtime::arithmetic::check().is_ok() && Fpu::defaults_are_sound();
        let parameters = if !sound {
            Parameters::SelfTestFailed
        } else if let Some(loaded) = loaded {
            let loaded: &'static Loaded = cx.local.loaded.insert(loaded);
            Parameters::Usable {
                servo: Servo::new(&*loaded.decoder, OnInvalid::Zero),
                serial: &loaded.serial,
                other_slot: choice.refusal,
            }
        } else {
            Parameters::None {
                refusal: choice.refusal.unwrap_or(slots::Refusal::NEITHER),
            }
        };
        let mut acquisition = Acquisition::new(converter);
        // A converter that is not there yet is started again by the ticks, which tell why.
        let _ = acquisition.start(&mut Cycles);

        TIM2::enable(&mut rcc);
        let mut clock = Clock::new(device.TIM2);
        let schedule = Schedule::starting(clock.now_us());
        clock.set_tick_alarm(schedule.due_us());
        let mut watchdog = IndependentWatchdog::new(device.IWDG);
        // Else halting in a debugger would reset.
        watchdog.stop_on_debug(&device.DBGMCU, true);
        watchdog.start(board::WATCHDOG_MS.millis());

        (
            Shared { bus },
            Local {
                clock,
                schedule,
                open: None,
                acquisition,
                node: Node::new(parameters, watchdog_reset),
                watchdog,
                led: gpioc.pc1.into_push_pull_output(),
                overrun_ticks: 0,
                #[cfg(feature = "ads8688")]
                _reset: sync,
            },
        )
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// A tick: its trigger, and its codes once they have settled.
    #[task(
        binds = TIM2,
        priority = 1,
        local = [clock, schedule, open, acquisition, node, watchdog, led, overrun_ticks],
        shared = [bus]
    )]
    fn tick(cx: tick::Context) {
        let tick::LocalResources {
            clock,
            schedule,
            open,
            acquisition,
            node,
            watchdog,
            led,
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
            // A tick that is still open is overtaken: it never ends, and feeds no watchdog.
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

        let sample = acquisition.sample(tick.sequence, tick.started_us, &mut Cycles);
        bus.start_tick();
        let facts = Facts {
            missed_ticks: schedule.missed(),
            bus_off: bus.bus_off(),
        };
        let sample = sample.map_err(|fault| SampleFault::from(&fault));
        let reading = node.tick(sample, &facts, &mut Fpu, &mut bus.outbox);
        // Behind the pose, so that its frames find the mailboxes empty.
        bus.receive(node);
        bus.send();
        led.set_state(PinState::from(node.light()));

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
