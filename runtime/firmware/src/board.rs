//! The board: converter, pins, clocks, bit timing. For a board of your own change this file
//! and nothing else; for another chip also `memory.x` at the top of the repository and the HAL's
//! feature in `Cargo.toml`. The pins are in the README beside this crate.

use core::convert::Infallible;
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use hal_adapters::adc::{Channels, FrameSampler};
use stm32f4xx_hal::can::CanExt;
use stm32f4xx_hal::gpio::{Output, PA4, PB0, PC1, PinState, Speed};
use stm32f4xx_hal::pac::{CAN1, GPIOA, GPIOB, GPIOC, SPI1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};
use stm32f4xx_hal::time::Hertz;

/// The converter: any part with a driver that implements [`FrameSampler`].
#[cfg(not(feature = "ads8688"))]
pub type Converter = hal_adapters::adc::Ads131m08<SpiDevice, ControlPin>;
/// The converter: any part with a driver that implements [`FrameSampler`].
#[cfg(feature = "ads8688")]
pub type Converter = hal_adapters::adc::Ads8688<SpiDevice, ControlPin>;

/// Which input of the converter carries which sensor.
const CHANNELS: Channels = Channels::IN_ORDER;

/// The SPI bus with chip select, to the converter alone.
pub type SpiDevice = ExclusiveDevice<stm32f4xx_hal::spi::Spi<SPI1>, PA4<Output>, NoDelay>;
/// SYNC/RESET of an ADS131M08, RST/PD of an ADS8688. High at rest.
pub type ControlPin = PB0<Output>;
/// The LED, on when high.
pub type Led = PC1<Output>;
/// The CAN controller.
pub type Can = bxcan::Can<CanPins>;
/// The CAN controller's registers with its pins.
pub type CanPins = stm32f4xx_hal::can::Can<CAN1>;

/// Frequency of the crystal. CAN needs a crystal: the internal oscillator is too inexact.
const CRYSTAL_HZ: u32 = 8_000_000;
/// Frequency of the core.
pub const CORE_HZ: u32 = 168_000_000;
/// Clock of the first peripheral bus.
const BUS_1_HZ: u32 = CORE_HZ / 4;
/// Clock of the second peripheral bus, from which SPI1 divides its own.
const BUS_2_HZ: u32 = CORE_HZ / 2;
/// Clock of the timers on the first peripheral bus: twice that bus.
pub const TIMER_HZ: u32 = 2 * BUS_1_HZ;

/// 168 MHz from the crystal; 42 MHz and 84 MHz on the peripheral buses.
pub fn clocks() -> Config {
    Config::hse(Hertz::from_raw(CRYSTAL_HZ))
        .sysclk(Hertz::from_raw(CORE_HZ))
        .pclk1(Hertz::from_raw(BUS_1_HZ))
        .pclk2(Hertz::from_raw(BUS_2_HZ))
}

/// What the board allows: data come up to 20 ns after the edge that shifts them (ADS131M08, 3 V)
/// and must be there 6.5 ns (F405) before the edge that samples them, half a period later. 10.5 MHz
/// leaves 21 ns for wires and buffers, 21 MHz would be 3 ns too fast.
const SPI_HZ_MAX: u32 = 12_000_000;

/// SPI clock: the fastest that board and converter allow. SPI divides its bus clock by a power of
/// two.
const SPI_HZ: u32 = {
    let mut hz = BUS_2_HZ / 2;
    while hz > Converter::SPI_HZ_MAX || hz > SPI_HZ_MAX {
        hz /= 2;
    }
    hz
};

/// 1 Mbit/s from 42 MHz: 42 = 3 * (1 + 11 + 2), sampled at 86 %. One quantum of resynchronisation.
pub const CAN_BIT_TIMING: u32 = (2 - 1) << 20 | (11 - 1) << 16 | (3 - 1);

/// The watchdog resets this long after the last tick that was done on schedule, ms. That is ten
/// ticks by the nominal clock of the watchdog, 7 to 19 by its tolerance.
pub const WATCHDOG_MS: u32 = 20;

/// The stage that this controller belongs to, if the program was built with `STAGE_SERIAL` in
/// the environment: blobs of other stages are refused.
pub const STAGE_SERIAL: Option<&str> = option_env!("STAGE_SERIAL");

/// What hangs on the pins.
pub struct Parts {
    /// The converter, not started yet.
    pub converter: Converter,
    /// The CAN controller, not set up yet.
    pub can: CanPins,
    /// The LED.
    pub led: Led,
}

/// Sets the pins up.
pub fn set_up(
    (gpioa, gpiob, gpioc): (GPIOA, GPIOB, GPIOC),
    spi1: SPI1,
    can1: CAN1,
    rcc: &mut Rcc,
) -> Parts {
    let (gpioa, gpiob, gpioc) = (gpioa.split(rcc), gpiob.split(rcc), gpioc.split(rcc));
    let mut select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
    select.set_speed(Speed::VeryHigh);
    let mut control = gpiob.pb0.into_push_pull_output_in_state(PinState::High);
    control.set_speed(Speed::High);
    let pins = (
        Some(gpioa.pa5.into_alternate().speed(Speed::VeryHigh)),
        Some(gpioa.pa6.into_alternate().speed(Speed::VeryHigh)),
        Some(gpioa.pa7.into_alternate().speed(Speed::VeryHigh)),
    );
    let spi = spi1.spi(pins, Converter::SPI_MODE, Hertz::from_raw(SPI_HZ), rcc);
    let spi = infallible(ExclusiveDevice::new_no_delay(spi, select));
    Parts {
        converter: Converter::new(spi, control, CHANNELS),
        can: can1.can((gpiob.pb9, gpiob.pb8), rcc),
        led: gpioc.pc1.into_push_pull_output(),
    }
}

/// The value of a result that has no error: writing to these pins cannot fail.
fn infallible<T>(result: Result<T, Infallible>) -> T {
    match result {
        Ok(value) => value,
        Err(never) => match never {},
    }
}
