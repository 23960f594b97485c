//! Thermometers at inputs 7 and 8: at the magnets' mount a Semitec 103AT-2 to ground with 68 kOhm to
//! 3.3 V, on the stage body a TI TMP235.

/// Rows of the 103AT-2's sheet (Semitec P12-13): degC, Ohm.
const THERMISTOR: [(f64, f64); 4] = [
    (20.0, 12_090.0),
    (25.0, 10_000.0),
    (30.0, 8_313.0),
    (35.0, 6_940.0),
];
const SUPPLY_V: f64 = 3.3;
const SERIES_OHM: f64 = 68e3;

/// A sensor and its wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// No fault.
    Sound,
    /// The sensor is torn off: the rest of its circuit stays at the input.
    Open,
    /// Both wires touch.
    Shorted,
}

/// Both sensors.
#[derive(Clone, Copy, Debug)]
pub struct Thermometers {
    /// Temperatures of mount and body, degC.
    pub celsius: [f64; 2],
    /// Their wiring.
    pub wiring: [Wiring; 2],
}

impl Default for Thermometers {
    fn default() -> Self {
        Self {
            celsius: [24.3, 26.1],
            wiring: [Wiring::Sound; 2],
        }
    }
}

/// Between two rows ln R is a line in 1/T, which is what a B value says.
fn thermistor_ohm(celsius: f64) -> f64 {
    let mut rows = THERMISTOR.array_windows();
    let [(t0, r0), (t1, r1)] = rows.find(|[_, high]| celsius <= high.0).expect("a row");
    let inverse = |t: f64| 1.0 / (t + 273.15);
    let part = (inverse(celsius) - inverse(*t0)) / (inverse(*t1) - inverse(*t0));
    r0 * (r1 / r0).powf(part)
}

impl Thermometers {
    /// Codes of inputs 7 and 8.
    pub fn codes(&self) -> [i32; 2] {
        let [mount, body] = self.celsius;
        let mount_ohm = match self.wiring[0] {
            Wiring::Sound => thermistor_ohm(mount),
            Wiring::Open => 1e12,
            Wiring::Shorted => 1e-3,
        };
        // Voltage and resistance of each source without the converter.
        let mount = (
            SUPPLY_V * mount_ohm / (SERIES_OHM + mount_ohm),
            SERIES_OHM * mount_ohm / (SERIES_OHM + mount_ohm),
        );
        let body = match self.wiring[1] {
            Wiring::Sound => (0.5 + 0.010 * body, 1.0),
            Wiring::Open => (0.0, 1e12),
            Wiring::Shorted => (0.0, 1e-3),
        };
        // SBAS950: an input has 330 kOhm to ground, and 24 bits for +-1.2 V.
        const INPUT_OHM: f64 = 330e3;
        const FULL_SCALE: f64 = 8_388_608.0;
        [mount, body].map(|(volt, ohm)| {
            let at_pin = volt * INPUT_OHM / (INPUT_OHM + ohm);
            let code = (at_pin / 1.2 * FULL_SCALE).round();
            code.clamp(-FULL_SCALE, FULL_SCALE - 1.0) as i32
        })
    }
}
