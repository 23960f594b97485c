//! A sensor node: reads a converter over embedded-hal and sends its codes over CAN. Any
//! [`FrameSampler`], any SPI device and pin, any CAN controller will do; here they are simulated,
//! and the frames are printed as a `candump -L` log.
//!
//! ```sh
//! cargo run -p hal-adapters --example sensor_node
//! ```

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use hal_adapters::adc::ads8688::REFERENCE_US;
use hal_adapters::adc::{AdcError, Ads8688, Channels, FrameSampler};
use hal_adapters::can::sensor::TemperatureSender;
use hal_adapters::can::{BusFrame, Layout, sensor};
use hal_adapters::candump::LogLine;
use std::convert::Infallible;
use std::time::Duration;

const PERIOD_US: u32 = 2000;

fn main() -> Result<(), AdcError<Infallible>> {
    run(3, |time_us, frame| {
        let line = LogLine {
            time_us: time_us.into(),
            interface: "can0",
            frame,
        };
        println!("{line}");
    })
}

/// Samples and sends this number of ticks, once the converter's reference has settled.
fn run(ticks: u32, mut send: impl FnMut(u32, BusFrame)) -> Result<(), AdcError<Infallible>> {
    let mut converter = Ads8688::new(Part::default(), Pin, Channels::IN_ORDER);
    let mut temperatures = TemperatureSender::START;
    converter.start(&mut Sleep)?;
    let settled = REFERENCE_US / PERIOD_US;
    for sequence in 0..settled + ticks {
        // A real node is woken by a timer, on an absolute schedule.
        let time_us = sequence * PERIOD_US + Ads8688::<Part, Pin>::SAMPLE_US;
        converter.trigger(&mut Sleep)?;
        Sleep.delay_us(Ads8688::<Part, Pin>::SETTLE_US);
        let frame = match converter.sample(sequence, time_us) {
            Err(AdcError::NotReady { .. }) if sequence < settled => continue,
            sampled => sampled?,
        };
        // These `Channels` have no thermometers, so there is no such frame.
        let temperatures = temperatures.frame(&frame).into_iter();
        for coded in temperatures.chain(sensor::frames(Layout::Bits16, &frame)) {
            // On a controller: `coded.to_frame()` gives the frame type of its driver.
            send(time_us, BusFrame::from(coded));
        }
    }
    Ok(())
}

/// A simulated ADS8688 with the code 100 * k at input k.
#[derive(Default)]
struct Part {
    registers: [u8; 32],
    next_input: u8,
}

impl Part {
    /// Replaces the bytes of one frame by the part's answer.
    fn answer(&mut self, frame: &mut [u8]) {
        let &mut [command, value, ref mut answer @ ..] = frame else {
            return;
        };
        match command {
            0x85 => self.registers[1] = 0xff,
            0xa0 => self.next_input = 0,
            0x00 => {
                let code = 0x8000 + 100 * u16::from(self.next_input);
                let [high, low] = code.to_be_bytes();
                answer[..3].copy_from_slice(&[high, low, self.next_input << 4 | 0b0100]);
                self.next_input += 1;
            }
            _ => {
                let register = &mut self.registers[usize::from(command >> 1)];
                if command & 1 == 1 {
                    *register = value;
                }
                answer[0] = *register;
            }
        }
    }
}

impl spi::ErrorType for Part {
    type Error = Infallible;
}

impl SpiDevice for Part {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            if let Operation::TransferInPlace(frame) = operation {
                self.answer(frame);
            }
        }
        Ok(())
    }
}

/// The part's pin RST/PD.
struct Pin;

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct Sleep;

impl DelayNs for Sleep {
    fn delay_ns(&mut self, ns: u32) {
        std::thread::sleep(Duration::from_nanos(ns.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_adapters::can::{SensorReceiver, Timing};

    #[test]
    fn a_receiver_gets_the_codes_of_every_tick() {
        let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
        let mut ticks = 0;
        run(20, |time_us, frame| {
            let taken = receiver.take(&frame, time_us);
            assert_eq!(taken.fault, None);
            let Some(frame) = taken.tick else { return };
            assert_eq!(frame.hall, [0, 100, 200]);
            assert_eq!(frame.capacitive, [300, 400, 500]);
            ticks += 1;
        })
        .expect("a simulated part has no faults");
        assert_eq!(ticks, 20);
    }
}
