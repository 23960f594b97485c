//! The refractive index of air for the light of a helium-neon laser.
//!
//! Edlén's equation as revised by K. P. Birch and M. J. Downs, Metrologia 30 (1993) 155 and 31 (1994) 315, with the effect of
//! water vapour at other temperatures as in J. A. Stone and J. H. Zimmerman, NIST Engineering Metrology Toolbox, A-IV.

/// Vacuum wavelength of a helium-neon laser, um.
const WAVELENGTH_UM: f64 = 0.632_991;

/// The refractive index at a temperature (degC), a pressure (Pa) and a relative humidity (0 to 1), to 3e-8.
pub(super) fn refractive_index(temperature_c: f64, pressure_pa: f64, humidity: f64) -> f64 {
    let s = 1.0 / (WAVELENGTH_UM * WAVELENGTH_UM);
    let standard = 1e-8 * (8342.54 + 2_406_147.0 / (130.0 - s) + 15_998.0 / (38.9 - s));
    let density = pressure_pa * (1.0 + 1e-8 * (0.601 - 0.00972 * temperature_c) * pressure_pa)
        / (96_095.43 * (1.0 + 0.003661 * temperature_c));
    let vapour_pa = humidity * saturation_pa(temperature_c);
    let vapour = 1e-10 * 292.75 / (temperature_c + 273.15) * (3.7345 - 0.0401 * s) * vapour_pa;
    1.0 + standard * density - vapour
}

/// Saturation pressure of water vapour, Pa. A. L. Buck's equation of 1996: within 0.1 %, which is 1e-9 of the index at 30 degC.
fn saturation_pa(temperature_c: f64) -> f64 {
    let t = temperature_c;
    611.21 * libm::exp((18.678 - t / 234.5) * t / (257.14 + t))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "Modified Edlén" at 633 nm in the comparison of equations of the NIST Engineering Metrology Toolbox.
    #[test]
    fn the_index_is_that_of_the_published_table() {
        for (temperature_c, pressure_pa, humidity, want) in [
            (20.0, 101_325.0, 0.0, 1.000_271_799),
            (20.0, 60_000.0, 0.0, 1.000_160_920),
            (20.0, 120_000.0, 0.0, 1.000_321_918),
            (50.0, 100_000.0, 0.0, 1.000_243_270),
            (5.0, 100_000.0, 0.0, 1.000_282_750),
            (20.0, 100_000.0, 1.0, 1.000_267_394),
            (40.0, 120_000.0, 0.75, 1.000_299_406),
            (50.0, 120_000.0, 1.0, 1.000_287_864),
        ] {
            let have = refractive_index(temperature_c, pressure_pa, humidity);
            assert!((have - want).abs() < 3e-9, "{have} {want}");
        }
    }
}
