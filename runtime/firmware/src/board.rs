//! The board: clocks, pins, bit timing. For a board of your own change this file, and
//! `memory.x` at the top of the repository for another chip.
//!
//! | signal | pin | goes to |
//! |---|---|---|
//! | SPI1 SCK, MISO, MOSI | PA5, PA6, PA7 | converter SCLK, DOUT/SDO, DIN/SDI |
//! | chip select | PA4 | converter CS |
//! | SYNC | PB0 | SYNC/RESET of an ADS131M08, RST/PD of an ADS8688: idles high |
//! | CAN1 RX, TX | PB8, PB9 | CAN transceiver RXD, TXD |
//! | LED | PC1 | LED to ground, on when high |
//! | crystal | PH0, PH1 | 8 MHz |
//!
//! Inputs of the converter: Hall probes A, B, C on 0, 1, 2 and gaps 1, 2, 3 on 3, 4, 5.

use hal_adapters::adc::Channels;
use stm32f4xx_hal::pac::{CAN1, SPI1};
use stm32f4xx_hal::rcc::Config;
use stm32f4xx_hal::time::Hertz;

/// Frequency of the crystal. CAN needs one: the internal oscillator is too coarse.
const CRYSTAL_HZ: u32 = 8_000_000;
/// Frequency of the core.
pub const CORE_HZ: u32 = 168_000_000;

/// 168 MHz from the crystal; 42 MHz and 84 MHz on the peripheral buses.
pub fn clocks() -> Config {
    Config::hse(Hertz::from_raw(CRYSTAL_HZ))
        .sysclk(Hertz::from_raw(CORE_HZ))
        .pclk1(Hertz::from_raw(CORE_HZ / 4))
        .pclk2(Hertz::from_raw(CORE_HZ / 2))
}

/// Clock of the timers on the first peripheral bus: twice that bus.
pub const TIMER_HZ: u32 = CORE_HZ / 2;

/// SPI clock: the next one below what the converter takes (84 MHz / 4 and / 8).
#[cfg(not(feature = "ads8688"))]
pub const SPI_HZ: u32 = 21_000_000;
/// SPI clock: the next one below what the converter takes (84 MHz / 4 and / 8).
#[cfg(feature = "ads8688")]
pub const SPI_HZ: u32 = 10_500_000;

/// 1 Mbit/s from 42 MHz: 42 = 3 * (1 + 11 + 2), sampled at 86 %. One quantum of resynchronisation.
pub const CAN_BIT_TIMING: u32 = (2 - 1) << 20 | (11 - 1) << 16 | (3 - 1);

/// Which input of the converter carries which sensor.
pub const CHANNELS: Channels = Channels::IN_ORDER;

/// How long the watchdog waits for a tick that was done on schedule, ms: ten ticks. Its
/// oscillator is coarse: 7 to 19 ticks.
pub const WATCHDOG_MS: u32 = 20;

/// The stage that this controller belongs to, if the program was built with `STAGE_SERIAL` in
/// the environment: blobs of other stages are refused.
pub const STAGE_SERIAL: Option<&str> = option_env!("STAGE_SERIAL");

/// The CAN controller.
pub type Can = bxcan::Can<stm32f4xx_hal::can::Can<CAN1>>;
/// The SPI bus to the converter.
pub type Spi = stm32f4xx_hal::spi::Spi<SPI1>;
