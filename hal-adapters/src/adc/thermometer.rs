//! Temperature sensors at the converter's free inputs: codes to m degC, read every 100 ms and held.
//!
//! | part | kind | at the input | source |
//! |---|---|---|---|
//! | [`ntc_103at`] | Semitec 103AT-2, thermistor of 10 kOhm, B 3435 K | to ground, with a resistor to the supply | table of the sheet (P12-13), every 5 K |
//! | [`tmp235`] | TI TMP235, 0.5 V + 10 mV/K | its output | SBOS857, table of the transfer function |
//!
//! A sensor is a [`Curve`], computed for the converter when the program is built. An open or shorted sensor gives codes
//! outside its curve: its temperature is then [missing](runtime::frame::MISSING_CODE), and the status of the pose says
//! so. A constant offset of a sensor cancels in a calibration, within 0.1 K.

use super::channels::INPUTS;
use runtime::frame::MISSING_CODE;

/// From one reading of a sensor to the next, us.
pub const REFRESH_US: u32 = 100_000;

/// An input of a converter, as the source of its voltage sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalogInput {
    /// Codes of one volt.
    pub codes_per_v: f64,
    /// Its resistance to ground, Ohm.
    pub ohm: f64,
}

/// Codes at temperatures of equal distance, rising or falling; straight lines between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Curve {
    first_mc: i32,
    step_mc: i32,
    codes: &'static [i32],
}

impl Curve {
    /// Codes at `first_mc`, m degC, and every `step_mc` from there.
    pub const fn new(first_mc: i32, step_mc: i32, codes: &'static [i32]) -> Self {
        Self {
            first_mc,
            step_mc,
            codes,
        }
    }

    /// The temperature of a code, m degC; [`MISSING_CODE`] where no temperature of the curve gives it.
    pub fn temperature_mc(&self, code: i32) -> i32 {
        let mut start_mc = self.first_mc;
        for pair in self.codes.windows(2) {
            if let [start, end] = *pair
                && (start.min(end)..=start.max(end)).contains(&code)
            {
                let part = (code - start) as f32 / (end - start) as f32;
                return start_mc + (part * self.step_mc as f32) as i32;
            }
            start_mc += self.step_mc;
        }
        MISSING_CODE
    }
}

/// A sensor at an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thermometer {
    /// The input, 0 to 7.
    pub input: u8,
    /// Its codes.
    pub curve: Curve,
}

/// Semitec 103AT-2, -10 to 70 degC.
pub mod ntc_103at {
    use super::{AnalogInput, Curve};

    /// Resistance every 5 K from -15 to 75 degC, Ohm.
    const OHM: [f64; 19] = [
        53_410.0, 42_470.0, 33_900.0, 27_280.0, 22_050.0, 17_960.0, 14_690.0, 12_090.0, 10_000.0,
        8_313.0, 6_940.0, 5_827.0, 4_911.0, 4_160.0, 3_536.0, 3_020.0, 2_588.0, 2_228.0, 1_924.0,
    ];
    /// Codes every 2.5 K from -10 to 70 degC.
    pub const POINTS: usize = 33;

    /// Its codes at an input with `series_ohm` to a supply of `supply_v`.
    pub const fn codes(input: &AnalogInput, supply_v: f64, series_ohm: f64) -> [i32; POINTS] {
        let mut exact = [0.0; OHM.len()];
        let mut k = 0;
        while k < OHM.len() {
            let siemens = 1.0 / series_ohm + 1.0 / OHM[k] + 1.0 / input.ohm;
            exact[k] = supply_v / series_ohm / siemens * input.codes_per_v;
            k += 1;
        }
        let mut codes = [0; POINTS];
        let mut k = 0;
        while k < POINTS {
            let at = k / 2 + 1;
            let code = if k % 2 == 0 {
                exact[at]
            } else {
                // In the middle of four points, by the cubic through them.
                (9.0 * (exact[at] + exact[at + 1]) - (exact[at - 1] + exact[at + 2])) / 16.0
            };
            codes[k] = (code + 0.5) as i32;
            k += 1;
        }
        codes
    }

    /// The curve of codes that [`codes`] gave.
    pub const fn curve(codes: &'static [i32; POINTS]) -> Curve {
        Curve::new(-10_000, 2_500, codes)
    }
}

/// TI TMP235, -40 to 65 degC: above 70 degC an ADS131M08 is at its rail.
pub mod tmp235 {
    use super::{AnalogInput, Curve};

    /// Its codes at -40 and 65 degC.
    pub const fn codes(input: &AnalogInput) -> [i32; 2] {
        [
            (0.1 * input.codes_per_v + 0.5) as i32,
            (1.15 * input.codes_per_v + 0.5) as i32,
        ]
    }

    /// The curve of codes that [`codes`] gave.
    pub const fn curve(codes: &'static [i32; 2]) -> Curve {
        Curve::new(-40_000, 105_000, codes)
    }
}

/// The last temperatures of mount and body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    temperature_mc: [i32; 2],
    /// Time of the reading, us.
    read_us: Option<u32>,
}

impl Held {
    /// Before the first reading.
    pub(super) const MISSING: Self = Self {
        temperature_mc: [MISSING_CODE; 2],
        read_us: None,
    };

    /// Mount and body at `now_us`, m degC; read from the codes of all inputs if the last reading is old.
    pub(super) fn at(
        &mut self,
        thermometers: &[Option<&Thermometer>; 2],
        codes: &[i32; INPUTS],
        now_us: u32,
    ) -> [i32; 2] {
        if self
            .read_us
            .is_none_or(|read_us| now_us.wrapping_sub(read_us) >= REFRESH_US)
        {
            self.read_us = Some(now_us);
            for (held, thermometer) in self.temperature_mc.iter_mut().zip(thermometers) {
                *held = thermometer.map_or(MISSING_CODE, |thermometer| {
                    let code = codes[usize::from(thermometer.input & 7)];
                    thermometer.curve.temperature_mc(code)
                });
            }
        }
        self.temperature_mc
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::adc::Ads131m08;
    use crate::adc::testing::{Broken, Line, NoPin};

    const SUPPLY_V: f64 = 3.3;
    const SERIES_OHM: f64 = 68e3;
    const INPUT: AnalogInput = <Ads131m08<Broken, NoPin, Line>>::INPUT;
    static NTC: [i32; ntc_103at::POINTS] = ntc_103at::codes(&INPUT, SUPPLY_V, SERIES_OHM);
    static LINEAR: [i32; 2] = tmp235::codes(&INPUT);

    /// The code of a voltage behind a resistance.
    fn code(volt: f64, ohm: f64) -> i32 {
        let at_pin = volt * INPUT.ohm / (ohm + INPUT.ohm);
        (at_pin.clamp(-1.2, 1.2) * INPUT.codes_per_v).round() as i32
    }

    fn thermistor(ohm: f64) -> i32 {
        let parallel = SERIES_OHM * ohm / (SERIES_OHM + ohm);
        code(SUPPLY_V * ohm / (SERIES_OHM + ohm), parallel)
    }

    /// Rows of the sheet, degC and Ohm. Between rows 5 K apart ln R is linear in 1/T, as by a B value.
    #[test]
    fn the_thermistor_reads_the_temperatures_of_its_sheet() {
        const SHEET: [(f64, f64); 9] = [
            (0.0, 27_280.0),
            (5.0, 22_050.0),
            (20.0, 12_090.0),
            (25.0, 10_000.0),
            (30.0, 8_313.0),
            (35.0, 6_940.0),
            (40.0, 5_827.0),
            (60.0, 3_020.0),
            (65.0, 2_588.0),
        ];
        let curve = ntc_103at::curve(&NTC);
        for pair in SHEET.windows(2) {
            let ((t0, r0), (t1, r1)) = (pair[0], pair[1]);
            for part in [0.0, 0.1, 0.25, 0.4, 0.5, 0.75, 0.9] {
                if part > 0.0 && t1 - t0 > 5.0 {
                    continue;
                }
                let celsius = t0 + part * (t1 - t0);
                let inverse = |t: f64| 1.0 / (t + 273.15);
                let along = (inverse(celsius) - inverse(t0)) / (inverse(t1) - inverse(t0));
                let ohm = (r0.ln() + along * (r1 / r0).ln()).exp();
                let read = 1e-3 * f64::from(curve.temperature_mc(thermistor(ohm)));
                assert!((read - celsius).abs() < 0.05, "{celsius}: {read}");
            }
        }
    }

    #[test]
    fn the_linear_sensor_reads_the_temperatures_of_its_sheet() {
        for celsius in [-39.0, 0.0, 25.0, 64.0] {
            let code = code(0.5 + 0.01 * celsius, 0.0);
            let read = tmp235::curve(&LINEAR).temperature_mc(code);
            assert!((1e-3 * f64::from(read) - celsius).abs() < 0.04, "{read}");
        }
    }

    #[test]
    fn an_open_or_shorted_sensor_has_no_temperature() {
        let ntc = ntc_103at::curve(&NTC);
        for ohm in [0.0, 1e12] {
            assert_eq!(ntc.temperature_mc(thermistor(ohm)), MISSING_CODE);
        }
        // The wire to the input is cut, or shorted to ground or to the supply.
        for (volt, ohm) in [(0.0, 1e12), (0.0, 0.0), (SUPPLY_V, 0.0)] {
            for curve in [ntc, tmp235::curve(&LINEAR)] {
                assert_eq!(curve.temperature_mc(code(volt, ohm)), MISSING_CODE);
            }
        }
        for code in [i32::MIN, i32::MAX, 1 << 23, NTC[0] + 1, NTC[32] - 1] {
            assert_eq!(ntc.temperature_mc(code), MISSING_CODE, "{code}");
        }
        assert_eq!(ntc.temperature_mc(NTC[0]), -10_000);
        assert_eq!(ntc.temperature_mc(NTC[32]), 70_000);
    }

    #[test]
    fn sensors_are_read_every_100_ms() {
        let body = Thermometer {
            input: 7,
            curve: tmp235::curve(&LINEAR),
        };
        let mut held = Held::MISSING;
        for (us, code, body_mc) in [
            (0, LINEAR[0], -40_000),
            (99_999, LINEAR[1], -40_000),
            (100_000, LINEAR[1], 65_000),
        ] {
            // The clock wraps.
            let now_us = (u32::MAX - 50_000).wrapping_add(us);
            let read = held.at(&[None, Some(&body)], &[code; INPUTS], now_us);
            assert_eq!(read, [MISSING_CODE, body_mc], "{us}");
        }
    }
}
