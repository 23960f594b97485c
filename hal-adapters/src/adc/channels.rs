//! The inputs of the sensors.

use super::thermometer::Thermometer;
use runtime::RawFrame;

/// Inputs of both parts.
pub(super) const INPUTS: usize = 8;

/// The inputs of the six sensors, and of thermometers where there are any: 0 to 7, all different.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels {
    pub(super) hall: [u8; 3],
    capacitive: [u8; 3],
    pub(super) thermometers: [Option<&'static Thermometer>; 2],
    /// The inputs that are read, thermometers included: bit k for input k.
    pub(super) read: u8,
}

impl Channels {
    /// Hall probes A, B, C on inputs 0, 1, 2 and gaps 1, 2, 3 on inputs 3, 4, 5.
    pub const IN_ORDER: Self = Self {
        hall: [0, 1, 2],
        capacitive: [3, 4, 5],
        thermometers: [None; 2],
        read: 0x3f,
    };

    /// The inputs of Hall probes A, B, C and of capacitive gaps 1, 2, 3; `None` unless all six are below 8 and
    /// differ.
    pub const fn new(hall: [u8; 3], capacitive: [u8; 3]) -> Option<Self> {
        let ([a, b, c], [d, e, f]) = (hall, capacitive);
        let Some(read) = with_inputs(0, &[a, b, c, d, e, f]) else {
            return None;
        };
        Some(Self {
            hall,
            capacitive,
            thermometers: [None; 2],
            read,
        })
    }

    /// With thermometers at the magnets' mount and on the stage body at the Hall elements; `None` unless their inputs
    /// are below 8 and free.
    #[must_use]
    pub const fn with_thermometers(
        self,
        thermometers: [Option<&'static Thermometer>; 2],
    ) -> Option<Self> {
        let sensors = self.mask();
        let read = match thermometers {
            [Some(mount), Some(body)] => with_inputs(sensors, &[mount.input, body.input]),
            [Some(one), None] | [None, Some(one)] => with_inputs(sensors, &[one.input]),
            [None, None] => Some(sensors),
        };
        let Some(read) = read else {
            return None;
        };
        Some(Self {
            thermometers,
            read,
            ..self
        })
    }

    /// The inputs of the six sensors: bit k for input k.
    pub const fn mask(&self) -> u8 {
        let ([a, b, c], [d, e, f]) = (self.hall, self.capacitive);
        1 << a | 1 << b | 1 << c | 1 << d | 1 << e | 1 << f
    }

    /// The frame of one period, from the codes of all inputs.
    pub(super) fn frame(&self, codes: &[i32; INPUTS], sequence: u32, time_us: u32) -> RawFrame {
        // Every index is below 8 already: the mask lets the compiler drop its check, and the panic.
        let code = |input: u8| codes[usize::from(input & 7)];
        let ([a, b, c], [d, e, f]) = (self.hall, self.capacitive);
        let (hall, capacitive) = ([code(a), code(b), code(c)], [code(d), code(e), code(f)]);
        RawFrame::new(hall, capacitive, sequence, time_us)
    }
}

/// A mask with further inputs; `None` if one is not below 8, or taken.
const fn with_inputs(mut mask: u8, inputs: &[u8]) -> Option<u8> {
    let mut k = 0;
    while k < inputs.len() {
        if inputs[k] as usize >= INPUTS || mask >> inputs[k] & 1 == 1 {
            return None;
        }
        mask |= 1 << inputs[k];
        k += 1;
    }
    Some(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_beyond_the_part_or_used_twice_are_refused() {
        assert_eq!(Channels::new([0, 1, 8], [3, 4, 5]), None);
        assert_eq!(Channels::new([0, 1, 2], [3, 4, 0]), None);
        assert_eq!(
            Channels::new([0, 1, 2], [3, 4, 5]),
            Some(Channels::IN_ORDER)
        );
    }

    #[test]
    fn a_thermometer_needs_a_free_input() {
        use crate::adc::thermometer::Curve;
        extern crate std;
        let at = |input| -> &'static Thermometer {
            let curve = Curve::new(0, 1, &[]);
            std::boxed::Box::leak(std::boxed::Box::new(Thermometer { input, curve }))
        };
        let with = |mount, body| Channels::IN_ORDER.with_thermometers([mount, body]);
        assert_eq!(with(Some(at(5)), None), None);
        assert_eq!(with(None, Some(at(8))), None);
        assert_eq!(with(Some(at(6)), Some(at(6))), None);
        let both = with(Some(at(7)), Some(at(6))).expect("free");
        assert_eq!((both.mask(), both.read), (0x3f, 0xff));
        assert_eq!(with(None, None), Some(Channels::IN_ORDER));
    }

    #[test]
    fn each_sensor_gets_the_code_of_its_input() {
        let channels = Channels::new([7, 0, 3], [1, 6, 2]).expect("six inputs");
        assert_eq!(channels.mask(), 0b1100_1111);
        let codes = [10, 11, 12, 13, 14, 15, 16, 17];
        let frame = channels.frame(&codes, 7, 14_000);
        let want = RawFrame::new([17, 10, 13], [11, 16, 12], 7, 14_000);
        assert_eq!(frame, want);
    }
}
