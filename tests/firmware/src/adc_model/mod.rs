//! The converter at the SPI: the model of an ADS131M08, the signals at its inputs, and faults of the part
//! and its wires.

pub mod ads131m08;
mod filter;
pub mod input;
pub mod thermometers;

use ads131m08::Ads131m08;
pub use input::{Input, Row};
use thermometers::Thermometers;

/// Upper rail of a code.
const RAIL: i32 = 0x7f_ffff;

/// A fault of the converter or its wires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdcFault {
    /// No fault.
    #[default]
    None,
    /// The data line always reads this byte.
    Line(u8),
    /// All codes freeze when the fault begins.
    Stuck,
    /// The codes of one sensor, 0 to 5, freeze when the fault begins.
    Frozen(usize),
    /// One bit of every frame of codes is wrong.
    FlippedBit,
    /// One sensor, 0 to 5, is at its upper rail: its input is open and has a resistor to the supply.
    Rail(usize),
    /// The wire to SYNC/RESET is cut; a resistor keeps the pin high.
    Control,
    /// The wire of DRDY is cut.
    Ready,
    /// The wire of chip select is cut.
    Select,
    /// CLKIN stands still.
    Clock,
}

/// A converter.
#[derive(Default)]
pub struct Adc {
    /// The part.
    pub part: Ads131m08,
    /// The fault that is present.
    pub fault: AdcFault,
    /// The signals at inputs 1 to 6.
    pub input: Input,
    /// The thermometers at inputs 7 and 8.
    pub thermometers: Thermometers,
    /// Codes before a fault froze them.
    last: Row,
}

impl Adc {
    /// A converter that gets its supply at time 0.
    pub fn new(input: Input) -> Self {
        let mut new = Self {
            input,
            ..Self::default()
        };
        new.part.power_up(0);
        new
    }

    /// The level of SYNC/RESET.
    pub fn control(&mut self, high: bool, now_ns: u64) {
        self.part.set_clock(self.fault != AdcFault::Clock, now_ns);
        self.part
            .sync(high || self.fault == AdcFault::Control, now_ns);
    }

    /// When DRDY fell last, ns, if its wire is whole.
    pub fn ready_fell_ns(&mut self, now_ns: u64) -> Option<u64> {
        self.part.set_clock(self.fault != AdcFault::Clock, now_ns);
        let fell_ns = self.part.fell_ns(now_ns);
        fell_ns.filter(|_| self.fault != AdcFault::Ready)
    }

    /// Chip select falls.
    pub fn select(&mut self, now_ns: u64) {
        let fault = self.fault;
        if fault == AdcFault::Select {
            return;
        }
        self.part.set_clock(fault != AdcFault::Clock, now_ns);
        let (last, thermometers) = (&mut self.last, self.thermometers.codes());
        let faulty = |mut codes: Row| {
            match fault {
                AdcFault::Stuck => codes = *last,
                AdcFault::Frozen(k) => codes[k] = last[k],
                AdcFault::Rail(k) => codes[k] = RAIL,
                _ => {}
            }
            *last = codes;
            all_inputs(codes, thermometers)
        };
        let flipped = fault == AdcFault::FlippedBit;
        self.part.select(now_ns, &self.input, faulty, flipped);
    }

    /// One byte each way.
    pub fn exchange(&mut self, out: u8) -> u8 {
        match self.fault {
            AdcFault::Select => 0xff,
            AdcFault::Line(level) => {
                self.part.exchange(out);
                level
            }
            _ => self.part.exchange(out),
        }
    }

    /// Chip select rises.
    pub fn deselect(&mut self, now_ns: u64) {
        if self.fault != AdcFault::Select {
            self.part.deselect(now_ns);
        }
    }
}

/// The codes of all eight inputs.
const fn all_inputs([a, b, c, d, e, f]: Row, [mount, body]: [i32; 2]) -> [i32; 8] {
    [a, b, c, d, e, f, mount, body]
}

#[cfg(test)]
mod driver_tests;
