//! Temperature sensors at the converter's free inputs: codes to m degC, read every 100 ms and held.
//!
//! | part | what it is | at the input | known from |
//! |---|---|---|---|
//! | [`ntc_103at`] | Semitec 103AT-2, thermistor of 10 kOhm, B 3435 K | to ground, with a resistor to the supply | table of the sheet (P12-13), every 5 K |
//! | [`tmp235`] | TI TMP235, 0.5 V + 10 mV/K | its output | SBOS857, table of the transfer function |
//!
//! A sensor is a [`Curve`], computed for the converter when the program is built. Both give codes
//! outside of theirs when they are open or shorted: that temperature is then
//! [missing](runtime::frame::MISSING_CODE), which the status of the pose says. What a sensor is off
//! by cancels in a calibration, as long as it stays the same within 0.1 K.

use super::Channels;
use runtime::frame::MISSING_CODE;

/// From one reading of a sensor to the next, us.
pub const REFRESH_US: u32 = 100_000;

/// An input of a converter, as the source of its voltage sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalogInput {
    /// Codes of one volt.
    pub codes_per_v: f64,
    /// Its resistance, Ohm.
    pub ohm: f64,
    /// The voltage at the other end of that resistance, V.
    pub bias_v: f64,
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
            let ampere = supply_v / series_ohm + input.bias_v / input.ohm;
            exact[k] = ampere / siemens * input.codes_per_v;
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

/// TI TMP235, -40 to 65 degC: beyond 70 an ADS131M08 is at its rail.
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

/// The temperatures of mount and body as they were read last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    temperature_mc: [i32; 2],
    /// When both were read, us.
    read_us: u32,
    /// The sensor that is read next: 0 or 1, or both once their time has come.
    turn: u8,
}

impl Held {
    const BOTH: u8 = 2;

    /// Nothing is read yet.
    pub(super) const NOTHING: Self = Self {
        temperature_mc: [MISSING_CODE; 2],
        read_us: 0,
        turn: 0,
    };

    /// The sensor that is to be read at `now_us`, if one is: the mount's, and the body's in the next
    /// period.
    pub(super) fn due(
        &mut self,
        channels: &Channels,
        now_us: u32,
    ) -> Option<(usize, &'static Thermometer)> {
        if self.turn >= Self::BOTH {
            if now_us.wrapping_sub(self.read_us) < REFRESH_US {
                return None;
            }
            self.turn = 0;
        }
        let sensors = (0..).zip(channels.thermometers);
        let mut left = sensors.skip(self.turn.into());
        let next = left.find_map(|(which, thermometer)| Some((which, thermometer?)));
        if self.turn == 0 {
            self.read_us = now_us;
        }
        self.turn = next.map_or(Self::BOTH, |(which, _)| which as u8 + 1);
        next
    }

    /// Takes the code of a sensor that was due.
    pub(super) fn take(&mut self, (which, thermometer): (usize, &Thermometer), code: i32) {
        if let Some(held) = self.temperature_mc.get_mut(which) {
            *held = thermometer.curve.temperature_mc(code);
        }
    }

    /// Mount and body, m degC.
    pub(super) const fn temperature_mc(&self) -> [i32; 2] {
        self.temperature_mc
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::adc::{Ads131m08, Ads8688, FrameSampler};

    const SUPPLY_V: f64 = 3.3;
    const SERIES_OHM: f64 = 68e3;
    const INPUTS: [AnalogInput; 2] = [
        <Ads131m08<super::super::testing::Broken, super::super::testing::NoPin>>::INPUT,
        <Ads8688<super::super::testing::Broken, super::super::testing::NoPin>>::INPUT,
    ];
    static NTC: [[i32; ntc_103at::POINTS]; 2] = [
        ntc_103at::codes(&INPUTS[0], SUPPLY_V, SERIES_OHM),
        ntc_103at::codes(&INPUTS[1], SUPPLY_V, SERIES_OHM),
    ];
    static LINEAR: [[i32; 2]; 2] = [tmp235::codes(&INPUTS[0]), tmp235::codes(&INPUTS[1])];

    /// The code that a voltage behind a resistance gives.
    fn code(input: &AnalogInput, volt: f64, ohm: f64) -> i32 {
        let at_pin = volt + (input.bias_v - volt) * ohm / (ohm + input.ohm);
        let rail = if input.codes_per_v > 1e6 { 1.2 } else { 10.24 };
        (at_pin.clamp(-rail, rail) * input.codes_per_v).round() as i32
    }

    fn thermistor(input: &AnalogInput, ohm: f64) -> i32 {
        let parallel = SERIES_OHM * ohm / (SERIES_OHM + ohm);
        code(input, SUPPLY_V * ohm / (SERIES_OHM + ohm), parallel)
    }

    /// Rows of the sheet, degC and Ohm, and between them a line in ln R over 1/T: what B is in.
    #[test]
    fn the_thermistor_reads_what_its_sheet_says() {
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
        for (input, codes) in INPUTS.iter().zip(&NTC) {
            let curve = ntc_103at::curve(codes);
            // One code of 16 bits is 22 mK at 25 degC, and 60 at 65.
            let resolution_k = |celsius: f64| match input.codes_per_v > 1e6 {
                true => 0.0,
                false => 0.02 + 1e-3 * celsius,
            };
            for pair in SHEET.windows(2) {
                let [(t0, r0), (t1, r1)] = *pair else {
                    continue;
                };
                for part in [0.0, 0.1, 0.25, 0.4, 0.5, 0.75, 0.9] {
                    if part > 0.0 && t1 - t0 > 5.0 {
                        continue;
                    }
                    let celsius = t0 + part * (t1 - t0);
                    let inverse = |t: f64| 1.0 / (t + 273.15);
                    let along = (inverse(celsius) - inverse(t0)) / (inverse(t1) - inverse(t0));
                    let ohm = (r0.ln() + along * (r1 / r0).ln()).exp();
                    let read = 1e-3 * f64::from(curve.temperature_mc(thermistor(input, ohm)));
                    let off = (read - celsius).abs();
                    assert!(off < 0.05 + resolution_k(celsius), "{celsius}: {read}");
                }
            }
        }
    }

    #[test]
    fn the_linear_sensor_reads_what_its_sheet_says() {
        for (input, codes) in INPUTS.iter().zip(&LINEAR) {
            for celsius in [-39.0, 0.0, 25.0, 64.0] {
                let code = code(input, 0.5 + 0.01 * celsius, 0.0);
                let read = tmp235::curve(codes).temperature_mc(code);
                assert!((1e-3 * f64::from(read) - celsius).abs() < 0.04, "{read}");
            }
        }
    }

    #[test]
    fn a_sensor_that_is_open_or_shorted_has_no_temperature() {
        for k in 0..2 {
            let (input, ntc) = (&INPUTS[k], ntc_103at::curve(&NTC[k]));
            for ohm in [0.0, 1e12] {
                assert_eq!(ntc.temperature_mc(thermistor(input, ohm)), MISSING_CODE);
            }
            // The wire to the input is cut, or shorted to ground or to the supply.
            for (volt, ohm) in [(0.0, 1e12), (0.0, 0.0), (SUPPLY_V, 0.0)] {
                let code = code(input, volt, ohm);
                for curve in [ntc, tmp235::curve(&LINEAR[k])] {
                    assert_eq!(curve.temperature_mc(code), MISSING_CODE, "{volt} {ohm}");
                }
            }
        }
    }

    #[test]
    fn any_code_gives_a_temperature_of_the_curve_or_none() {
        let curve = ntc_103at::curve(&NTC[0]);
        for code in [
            i32::MIN,
            i32::MAX,
            0,
            -1,
            1 << 23,
            NTC[0][0] + 1,
            NTC[0][32] - 1,
        ] {
            assert_eq!(curve.temperature_mc(code), MISSING_CODE, "{code}");
        }
        assert_eq!(curve.temperature_mc(NTC[0][0]), -10_000);
        assert_eq!(curve.temperature_mc(NTC[0][32]), 70_000);
    }

    #[test]
    fn each_sensor_is_read_every_100_ms_one_in_a_tick() {
        static MOUNT: Thermometer = Thermometer {
            input: 6,
            curve: tmp235::curve(&LINEAR[0]),
        };
        static BODY: Thermometer = Thermometer { input: 7, ..MOUNT };
        let channels = Channels::IN_ORDER.with_thermometers([Some(&MOUNT), Some(&BODY)]);
        let channels = channels.expect("free inputs");
        let (mut held, mut read) = (Held::NOTHING, std::vec::Vec::new());
        for tick in 0..101u32 {
            // The clock wraps.
            let now_us = (u32::MAX - 50_000).wrapping_add(2_000 * tick);
            if let Some(due) = held.due(&channels, now_us) {
                read.push((tick, due.1.input));
                held.take(due, LINEAR[0][0]);
            }
        }
        assert_eq!(read, [(0, 6), (1, 7), (50, 6), (51, 7), (100, 6)]);
        assert_eq!(held.temperature_mc(), [-40_000; 2]);
        let (mut none, channels) = (Held::NOTHING, Channels::IN_ORDER);
        assert_eq!(
            (none.due(&channels, 0), none.due(&channels, 1)),
            (None, None)
        );
    }
}
