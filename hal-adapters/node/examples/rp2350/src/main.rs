//! The stage controller on an RP2350 (Raspberry Pi Pico 2): an ADS8688 on SPI0, an MCP2515 with a crystal of 16 MHz on SPI1.
//! What a tick does is the code of every chip, `stage_node`. It is built by the tests; no board has run it.
//!
//! | signal | pin |
//! |---|---|
//! | ADS8688: SCLK, SDI, SDO, CS, RST/PD | GPIO 2, 3, 4, 5, 6 |
//! | MCP2515: SCK, SI, SO, CS | GPIO 10, 11, 12, 13 |
//! | servo off, low while it is off | GPIO 14 |
//! | LED | GPIO 25 |
//!
//! ```sh
//! cd hal-adapters/node/examples/rp2350
//! STAGE_SERIAL=STAGE-7 ../../../../tests/arm-cargo thumbv8m.main-none-eabihf build --release
//! ```
#![no_std]
#![no_main]

mod can;
mod chip;

use can::Mcp2515;
use chip::{Chip, Clock, RETAINED, now_us};
use core::panic::PanicInfo;
use embassy_rp::flash::{Blocking, ERASE_SIZE, Flash};
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::peripherals::{FLASH, TRNG};
use embassy_rp::spi::{Config, Phase, Polarity, Spi};
use embassy_rp::trng::{InterruptHandler, Trng};
use embassy_rp::watchdog::{ResetReason, Watchdog};
use embedded_hal_bus::spi::ExclusiveDevice;
use hal_adapters::adc::{Ads8688, Channels};
use hal_adapters::can::status::board_check;
use hal_adapters::can::update::Identity;
use runtime::zero_offset::ZeroOffsetSettings;
use stage_node::controller::{Controller, Parts};
use stage_node::node::Settings;
use stage_node::retained::{FaultKind, Step};
use stage_node::schedule::Period;
use stage_node::start_up::{Before, Cause};
use stage_node::store::Slots;

embassy_rp::bind_interrupts!(struct Interrupts {
    TRNG_IRQ => InterruptHandler<TRNG>;
});

const FLASH_BYTES: usize = 4 << 20;

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_rp::init(embassy_rp::config::Config::default());
    let mut watchdog = Watchdog::new(p.WATCHDOG);
    let cause = match watchdog.reset_reason() {
        // Or the pin RUN.
        None => Cause::PowerOn,
        Some(ResetReason::Forced) => Cause::Reset,
        Some(ResetReason::TimedOut) => Cause::Watchdog,
    };
    let before = Before::of_ram(cause, &RETAINED);
    watchdog.start(chip::WATCHDOG);
    RETAINED.begin(Step::Peripherals);

    let mut config = Config::default();
    // The MCP2515 takes 10 MHz at most.
    config.frequency = 10_000_000;
    let spi = Spi::new_blocking(p.SPI1, p.PIN_10, p.PIN_11, p.PIN_12, config.clone());
    let Ok(bus) = ExclusiveDevice::new_no_delay(spi, Output::new(p.PIN_13, Level::High));
    // Mode 1. The ADS8688 takes 17 MHz at most and needs 9.5 MHz.
    (config.frequency, config.polarity) = (12_000_000, Polarity::IdleLow);
    config.phase = Phase::CaptureOnSecondTransition;
    let spi = Spi::new_blocking(p.SPI0, p.PIN_2, p.PIN_3, p.PIN_4, config);
    let Ok(spi) = ExclusiveDevice::new_no_delay(spi, Output::new(p.PIN_5, Level::High));
    let reset = Output::new(p.PIN_6, Level::High);

    let parts = Parts {
        converter: Ads8688::new(spi, reset, Clock, Channels::IN_ORDER),
        can: Mcp2515::new(bus),
        slots: Slots {
            flash: Flash::<FLASH, Blocking, FLASH_BYTES>::new_blocking(p.FLASH),
            // The last two sectors: `memory.x` gives the program the flash before them.
            first: (FLASH_BYTES - 2 * ERASE_SIZE) as u32,
            // The brown-out detector resets the chip, which runs from this flash.
            supply_is_low: || false,
        },
        board: Chip {
            watchdog,
            led: Output::new(p.PIN_25, Level::Low),
            servo: Input::new(p.PIN_14, Pull::Up),
            random: Trng::new(p.TRNG, Interrupts, Default::default()),
        },
    };
    let settings = Settings {
        identity: Identity {
            serial: option_env!("STAGE_SERIAL"),
            key: None,
            program_version: 0x00_02_00,
            ..Identity::default()
        },
        period: const { Period::from_us(2000).expect("a period") },
        rezero_limits: ZeroOffsetSettings::default(),
    };
    let facts = before.record.facts(0, board_check::NO_KEY);
    let mut controller = Controller::start(parts, settings, &before, facts);
    let mut due_us = controller.due_us();
    loop {
        while !is_past(due_us) {
            controller.mailbox_empty();
        }
        due_us = controller.turn();
    }
}

fn is_past(us: u32) -> bool {
    now_us().wrapping_sub(us) as i32 >= 0
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let line = info.location().map_or(0, |place| place.line());
    RETAINED.update(|record| record.note(FaultKind::Panic, 0, line));
    // The watchdog resets.
    loop {}
}
