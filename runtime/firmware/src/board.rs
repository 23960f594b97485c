//! The board: converter, pins, clocks, bit timing. For a board of your own change this file
//! and nothing else; for another chip also `memory.x` at the top of the repository and the HAL's
//! feature in `Cargo.toml`. The pins are in the README beside this crate.

use crate::spi::SpiDma;
use crate::timer::ReadyLine;
use crate::wait::Pause;
use embedded_hal_bus::spi::ExclusiveDevice;
use hal_adapters::adc::thermometer::{Thermometer, ntc_103at, tmp235};
use hal_adapters::adc::{Channels, FrameSampler};
use hal_adapters::can::NodeNumber;
use hal_adapters::can::status::{bit, board_check};
use hal_adapters::can::update::Identity;
use runtime::zero_offset::ZeroOffsetSettings;
use stage_node::node::Settings;
use stage_node::schedule::Period;
use stm32f4xx_hal::gpio::{Input, Output, PA4, PB0, PB1, PC1, PinState, Pull, Speed};
use stm32f4xx_hal::pac::{DMA2, GPIOA, GPIOB, GPIOC, SPI1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};
use stm32f4xx_hal::time::Hertz;

/// The converter: any part with a driver that implements [`FrameSampler`].
pub type Converter = hal_adapters::adc::Ads131m08<SpiDevice, ControlPin, ReadyLine>;

/// The inputs of the sensors.
const CHANNELS: Channels = match Channels::IN_ORDER.with_thermometers(THERMOMETERS) {
    Some(channels) => channels,
    None => panic!("a thermometer needs a free input"),
};

/// Codes of the thermistor with 68 kOhm to 3.3 V: its voltage stays within the range of the ADS131M08 above -10
/// degC.
const THERMISTOR: [i32; ntc_103at::POINTS] = ntc_103at::codes(&Converter::INPUT, 3.3, 68e3);
const LINEAR: [i32; 2] = tmp235::codes(&Converter::INPUT);

/// The thermometers at the magnets' mount and on the stage body at the Hall elements; `None` where
/// there is none.
const THERMOMETERS: [Option<&Thermometer>; 2] = [
    Some(&Thermometer {
        input: 6,
        curve: ntc_103at::curve(&THERMISTOR),
    }),
    Some(&Thermometer {
        input: 7,
        curve: tmp235::curve(&LINEAR),
    }),
];

/// The SPI bus with chip select, to the converter alone.
pub type SpiDevice = ExclusiveDevice<SpiDma, PA4<Output>, Pause>;
/// SYNC/RESET of the converter. High at rest.
pub type ControlPin = PB0<Output>;
/// The LED, on when high.
pub type Led = PC1<Output>;
/// Driven low while the servo is off. Pulled up: where the line is open, the servo counts as on.
pub type ServoPin = PB1<Input>;
/// Whether the board has that line. Without it a program with a key goes by the request "servo off"
/// alone, and one without a key takes the servo for on.
const HAS_SERVO_LINE: bool = true;

/// Whether the servo is off, if the board has a line that says so.
pub fn servo_is_off(pin: &ServoPin) -> Option<bool> {
    HAS_SERVO_LINE.then(|| pin.is_low())
}

/// Frequency of the crystal.
const CRYSTAL_HZ: u32 = 8_000_000;
/// Frequency of the core after a reset, MHz: the internal oscillator.
pub const INTERNAL_MHZ: u32 = 16;
/// Frequency of the core.
pub const CORE_HZ: u32 = 168_000_000;
/// Clock of the first peripheral bus.
const BUS_1_HZ: u32 = CORE_HZ / 4;
/// Clock of the second peripheral bus; SPI1 divides it.
const BUS_2_HZ: u32 = CORE_HZ / 2;
/// Clock of the timers on the first peripheral bus: twice that bus.
pub const TIMER_HZ: u32 = 2 * BUS_1_HZ;

/// 168 MHz from the crystal or from the internal oscillator; 42 MHz and 84 MHz on the peripheral
/// buses.
pub fn clocks(crystal: bool) -> Config {
    let source = match crystal {
        true => Config::hse(Hertz::from_raw(CRYSTAL_HZ)),
        false => Config::hsi(),
    };
    source
        .sysclk(Hertz::from_raw(CORE_HZ))
        .pclk1(Hertz::from_raw(BUS_1_HZ))
        .pclk2(Hertz::from_raw(BUS_2_HZ))
}

/// Fastest clock of the board: data come up to 20 ns after the edge that shifts them (ADS131M08, 3 V) and must be there
/// 6.5 ns (F405) before the edge that samples them, half a period later. At 10.5 MHz 21 ns remain for wires and
/// buffers; 21 MHz would be 3 ns too fast.
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

/// Periods of the clock of the first peripheral bus in a quantum. A bit has 14 quanta.
pub const CAN_PRESCALER: u16 = 3;

/// 1 Mbit/s: 42 = 3 * 14. By the crystal sampled at 86 % with the least resynchronisation; by the
/// internal oscillator at 71 % with the most.
///
/// With n = 14 quanta a bit, each node's clock may differ from the nominal one by s / 20 n and by
/// p / 2 (13 n - p) at most, s the jump and p the shorter of the phase segments (F. Hartwich and A.
/// Bassemir, The Configuration of the CAN Bit Timing, 6th iCC, 1999; both nodes may differ, in
/// opposite directions). That is 0.36 % with s = 1, p = 2, and 1.1 % with s = p = 4, or 2.2 %
/// beside a node with a crystal. The internal oscillator keeps 1 % at 25 degC, and 4 % from -10 to
/// 85 degC (DS8626, HSI oscillator characteristics): in a laboratory that is enough. Elsewhere it
/// may not be; see `Bus::new`.
///
/// Returns the quanta before the sample, without the first; the quanta after it; and the largest resynchronisation.
pub const fn can_bit_timing(crystal: bool) -> (u8, u8, u8) {
    if crystal { (11, 2, 1) } else { (9, 4, 4) }
}

/// The stage.
pub fn settings() -> Settings<'static> {
    Settings {
        identity: Identity {
            serial: STAGE_SERIAL,
            key: crate::seal::key(),
            node: STAGE_NODE,
            program_version: PROGRAM_VERSION,
        },
        period: PERIOD,
        // Limits of rest at the zero. A stage may rest lower or tilted while its servo is off: then `vertical_max` and the
        // range of its calibration must hold this position.
        rezero_limits: ZeroOffsetSettings::default(),
    }
}

/// The controller's stage, `STAGE_SERIAL` in the environment of the build: blobs of other stages are refused.
const STAGE_SERIAL: Option<&str> = option_env!("STAGE_SERIAL");

/// The stage's number on its bus, `STAGE_NODE` in the environment of the build. The default, 0, has the standard
/// identifiers of the table.
pub const STAGE_NODE: NodeNumber = match option_env!("STAGE_NODE") {
    Some(digits) => match NodeNumber::new(number(digits)) {
        Some(node) => node,
        None => panic!("STAGE_NODE is to be 0 to 262143"),
    },
    None => NodeNumber::TABLE,
};

/// The servo period, us: `STAGE_PERIOD_US` in the environment of the build, or 2000.
pub const PERIOD: Period = match Period::from_us(match option_env!("STAGE_PERIOD_US") {
    Some(digits) => number(digits),
    None => 2000,
}) {
    Some(period) => period,
    None => panic!("STAGE_PERIOD_US is to be 1000 to 10000, and a divisor of 1000000"),
};

/// Major, minor and patch of the program's version in bits 16 to 23, 8 to 15, 0 to 7.
const PROGRAM_VERSION: u32 = number(env!("CARGO_PKG_VERSION_MAJOR")) << 16
    | number(env!("CARGO_PKG_VERSION_MINOR")) << 8
    | number(env!("CARGO_PKG_VERSION_PATCH"));

const fn number(text: &str) -> u32 {
    match u32::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("digits are expected"),
    }
}

/// The parts on the pins.
pub struct Parts {
    /// The converter, not started yet.
    pub converter: Converter,
    /// The LED.
    pub led: Led,
    /// Whether the servo is off.
    pub servo: ServoPin,
    /// Bits of [`board_check`]: lines to the converter without a pull-up of 10 kOhm or less, found against an internal
    /// resistor of 30 kOhm at least. They must be high before the program drives them.
    pub not_pulled_up: u32,
}

/// Time for a line to follow the internal resistor of 30 to 50 kOhm, us: three time constants with 50 pF.
const PULL_US: u32 = 8;

/// Sets the pins up. The clock must run.
pub fn set_up(
    (gpioa, gpiob, gpioc): (GPIOA, GPIOB, GPIOC),
    (spi1, dma2): (SPI1, DMA2),
    rcc: &mut Rcc,
) -> Parts {
    let (gpioa, gpiob, gpioc) = (gpioa.split(rcc), gpiob.split(rcc), gpioc.split(rcc));
    let (select, control) = (
        gpioa.pa4.into_pull_down_input(),
        gpiob.pb0.into_pull_down_input(),
    );
    cortex_m::asm::delay(PULL_US * (CORE_HZ / 1_000_000));
    let not_pulled_up = bit(board_check::NO_PULL_UP_ON_SELECT, select.is_low())
        | bit(board_check::NO_PULL_UP_ON_CONTROL, control.is_low());
    let mut select = select.into_push_pull_output_in_state(PinState::High);
    select.set_speed(Speed::VeryHigh);
    let mut control = control.into_push_pull_output_in_state(PinState::High);
    control.set_speed(Speed::High);
    // DRDY, at TIM2_CH3.
    gpioa
        .pa2
        .into_alternate::<1>()
        .set_internal_resistor(Pull::Up);
    // The output of an unselected converter is open.
    let pins = (
        Some(gpioa.pa5.into_alternate().speed(Speed::VeryHigh)),
        Some(gpioa.pa6.into_alternate().internal_resistor(Pull::Up)),
        Some(gpioa.pa7.into_alternate().speed(Speed::VeryHigh)),
    );
    let (spi1, _) = spi1
        .spi(pins, Converter::SPI_MODE, Hertz::from_raw(SPI_HZ), rcc)
        .release();
    let spi = SpiDma::new(spi1, dma2, rcc);
    // Writing to the pin cannot fail.
    let Ok(spi) = ExclusiveDevice::new(spi, select, Pause);
    // Without a transceiver the bus looks idle.
    gpiob
        .pb8
        .into_alternate::<9>()
        .set_internal_resistor(Pull::Up);
    // At the lowest speed an edge takes 100 ns of a bit of 1000 (DS8626, I/O AC characteristics).
    gpiob.pb9.into_alternate::<9>().set_speed(Speed::High);
    Parts {
        converter: Converter::new(spi, control, ReadyLine::default(), CHANNELS),
        led: gpioc.pc1.into_push_pull_output(),
        servo: gpiob.pb1.into_pull_up_input(),
        not_pulled_up,
    }
}
