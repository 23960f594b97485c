//! Models of the converters, written from their data sheets: bytes out for bytes in, registers,
//! pins, and what they make of their inputs over time. Faults of parts and wires are added here.

pub mod ads131m08;
pub mod ads8688;
mod filter;
pub mod input;
pub mod thermometers;

use ads131m08::{Ads131m08, Variant};
use ads8688::Ads8688;
pub use input::{Input, Row};
use thermometers::Thermometers;

/// What is wrong with the converter or its wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcFault {
    /// Nothing.
    None,
    /// The data line always reads this byte.
    Line(u8),
    /// The codes stay as they were when the fault began.
    Stuck,
    /// The codes of one sensor, 0 to 5, stay as they were when the fault began.
    Frozen(usize),
    /// One bit of every frame of codes is wrong.
    FlippedBit,
    /// One sensor, 0 to 5, is at its upper rail: its input is open and has a resistor to the supply.
    Rail(usize),
    /// The wire to SYNC/RESET or RST/PD is cut; a resistor keeps the pin high.
    Control,
    /// The wire of chip select is cut.
    Select,
    /// The part has no clock. (Of the ADS131M08; the other one has its own.)
    Clock,
}

/// Which part is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// TI ADS131M08.
    Ads131m08,
    /// TI ADS8688.
    Ads8688,
}

impl Part {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Ads131m08, Self::Ads8688];

    /// Its name, as that of its image.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ads131m08 => "ads131m08",
            Self::Ads8688 => "ads8688",
        }
    }
}

enum Model {
    Ads131m08(Box<Ads131m08>),
    Ads8688(Ads8688),
}

/// A converter.
pub struct Adc {
    model: Model,
    /// What is wrong.
    pub fault: AdcFault,
    /// What is at its inputs.
    pub input: Input,
    /// What is at inputs 7 and 8.
    pub thermometers: Thermometers,
    part: Part,
    faulty: Faulty,
}

/// What faults make of codes.
struct Faulty {
    fault: AdcFault,
    last: Row,
    rail: i32,
}

impl Faulty {
    fn codes(&mut self, codes: Row) -> Row {
        let mut out = codes;
        match self.fault {
            AdcFault::Stuck => out = self.last,
            AdcFault::Frozen(k) => out[k] = self.last[k],
            AdcFault::Rail(k) => out[k] = self.rail,
            _ => {}
        }
        if !matches!(self.fault, AdcFault::Stuck | AdcFault::Frozen(_)) {
            self.last = out;
        }
        out
    }
}

impl Adc {
    /// A part whose supply came at time 0.
    pub fn new(part: Part, input: Input) -> Self {
        let (model, rail) = match part {
            Part::Ads131m08 => (Model::Ads131m08(Box::default()), 0x7f_ffff),
            Part::Ads8688 => (Model::Ads8688(Ads8688::new()), 0x7fff),
        };
        let fault = AdcFault::None;
        Self {
            model,
            fault,
            input,
            thermometers: Thermometers::default(),
            part,
            faulty: Faulty {
                fault,
                last: [0; 6],
                rail,
            },
        }
    }

    /// What of the data sheet is left open goes this way, for the ADS131M08.
    pub fn set_variant(&mut self, variant: Variant) {
        if let Model::Ads131m08(part) = &mut self.model {
            part.variant = variant;
        }
    }

    /// The supply comes back after a gap.
    pub fn power_up(&mut self, now_ns: u64) {
        match &mut self.model {
            Model::Ads131m08(part) => part.power_up(now_ns),
            Model::Ads8688(part) => part.power_up(now_ns),
        }
    }

    /// Bits of a register change by themselves.
    pub fn flip(&mut self, register: u8, bits: u16, now_ns: u64) {
        match &mut self.model {
            Model::Ads131m08(part) => part.flip(register, bits, now_ns),
            Model::Ads8688(part) => part.flip(register, bits),
        }
    }

    /// The level of SYNC/RESET or RST/PD.
    pub fn control(&mut self, high: bool, now_ns: u64) {
        let high = high || self.fault == AdcFault::Control;
        match &mut self.model {
            Model::Ads131m08(part) => {
                part.set_clock(self.fault != AdcFault::Clock, now_ns);
                part.sync(high, now_ns);
            }
            Model::Ads8688(part) => part.reset_pin(high, now_ns),
        }
    }

    /// Chip select falls.
    pub fn select(&mut self, now_ns: u64) {
        if self.fault == AdcFault::Select {
            return;
        }
        self.faulty.fault = self.fault;
        let warmth = self.thermometers.codes(self.part);
        match &mut self.model {
            Model::Ads131m08(part) => {
                part.set_clock(self.fault != AdcFault::Clock, now_ns);
                let flipped = self.fault == AdcFault::FlippedBit;
                let faulty = &mut self.faulty;
                let faulty = |codes| with(faulty.codes(codes), warmth);
                part.select(now_ns, &self.input, faulty, flipped);
            }
            Model::Ads8688(part) => {
                let (now, faulty) = (self.input.at(now_ns), &mut self.faulty);
                let codes = now.map(|code| code.round() as i32);
                part.select(now_ns, with(codes, warmth), |codes| {
                    let [a, b, c, d, e, f, mount, body] = codes;
                    with(faulty.codes([a, b, c, d, e, f]), [mount, body])
                });
            }
        }
    }

    /// One byte each way.
    pub fn exchange(&mut self, out: u8) -> u8 {
        let byte = match &mut self.model {
            _ if self.fault == AdcFault::Select => 0xff,
            Model::Ads131m08(part) => part.exchange(out),
            Model::Ads8688(part) => part.exchange(out, self.fault == AdcFault::FlippedBit),
        };
        match self.fault {
            AdcFault::Line(level) => level,
            _ => byte,
        }
    }

    /// Chip select rises.
    pub fn deselect(&mut self, now_ns: u64) {
        if self.fault == AdcFault::Select {
            return;
        }
        match &mut self.model {
            Model::Ads131m08(part) => part.deselect(now_ns),
            Model::Ads8688(part) => part.deselect(),
        }
    }
}

/// The codes of all eight inputs.
const fn with([a, b, c, d, e, f]: Row, [mount, body]: [i32; 2]) -> [i32; 8] {
    [a, b, c, d, e, f, mount, body]
}

#[cfg(test)]
mod driver_tests;
