//! A sensor node: samples a converter and sends its codes over CAN. Any [`FrameSampler`] will do: a driver of
//! [`hal_adapters::adc`] on a real node, a simulated one here. The frames are printed as a `candump -L` log.
//!
//! ```sh
//! cargo run -p hal-adapters --example sensor_node
//! ```

use embedded_hal::spi::{MODE_1, Mode};
use hal_adapters::adc::{AdcError, FrameSampler};
use hal_adapters::can::sensor::TemperatureSender;
use hal_adapters::can::{BusFrame, Layout, sensor};
use hal_adapters::candump::LogLine;
use runtime::RawFrame;
use std::convert::Infallible;
use std::time::Duration;

const PERIOD_US: u32 = 2000;

fn main() -> Result<(), AdcError<Infallible>> {
    run(&mut Simulated, 3, |time_us, frame| {
        let line = LogLine {
            time_us: time_us.into(),
            interface: "can0",
            frame,
        };
        println!("{line}");
    })
}

/// Samples and sends this number of ticks.
fn run<S: FrameSampler>(
    converter: &mut S,
    ticks: u32,
    mut send: impl FnMut(u32, BusFrame),
) -> Result<(), AdcError<S::Bus>> {
    let mut temperatures = TemperatureSender::START;
    converter.start()?;
    for sequence in 0..ticks {
        // A real node is woken by a timer, on an absolute schedule.
        converter.trigger()?;
        std::thread::sleep(Duration::from_micros(S::SETTLE_US.into()));
        let frame = converter.sample(sequence)?;
        let temperatures = temperatures.frame(&frame).into_iter();
        let layout = Layout::from_bits(S::CODE_BITS);
        for coded in temperatures.chain(sensor::frames(layout, &frame)) {
            // On a controller: `coded.to_frame()` gives the frame type of its driver.
            send(frame.time_us, BusFrame::from(coded));
        }
    }
    Ok(())
}

/// A converter with the codes 0, 100, ... 500.
struct Simulated;

impl FrameSampler for Simulated {
    type Bus = Infallible;
    const SPI_MODE: Mode = MODE_1;
    const SPI_HZ_MAX: u32 = 10_000_000;
    const SETTLE_US: u32 = 10;
    const CODE_BITS: u32 = 16;

    fn start(&mut self) -> Result<(), AdcError<Infallible>> {
        Ok(())
    }

    fn trigger(&mut self) -> Result<(), AdcError<Infallible>> {
        Ok(())
    }

    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<Infallible>> {
        let (hall, gaps) = ([0, 100, 200], [300, 400, 500]);
        Ok(RawFrame::new(hall, gaps, sequence, sequence * PERIOD_US))
    }
}
