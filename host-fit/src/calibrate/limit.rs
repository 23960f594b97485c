//! Largest rms errors: `--limit x=1.5um,y=1um,rz=4urad`.

use hallstage_input::axis::PLANAR;
use hallstage_input::log::layout::Dimension;
use hallstage_input::stage::CertificateTable;
use std::str::FromStr;

/// The kinds of units of X, Y, Rz.
const KINDS: [Dimension; 3] = [Dimension::Length, Dimension::Length, Dimension::Angle];

/// The largest rms errors of X, Y, Rz that a fit may have, m, m, rad; `None` where any will do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorLimits(pub [Option<f64>; 3]);

impl FromStr for ErrorLimits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut limits = Self::default();
        for part in text.split(',') {
            let wrong =
                || format!("`{part}` is no limit: write for instance x=1.5um,y=1um,rz=4urad");
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            let axis = PLANAR.iter().position(|axis| axis.key == name.trim());
            let axis = axis.ok_or_else(wrong)?;
            let is_digit = |c: char| c.is_ascii_digit() || c == '.';
            let (number, unit) = value.split_at(value.rfind(is_digit).map_or(0, |at| at + 1));
            let si = KINDS[axis].unit(unit).ok_or_else(wrong)?;
            let number = number.trim().parse();
            let number: f64 = number.map_err(|_| wrong())?;
            if !(number.is_finite() && number > 0.0) {
                return Err(format!("`{part}`: a limit above zero is needed"));
            }
            if limits.0[axis].replace(number * si).is_some() {
                return Err(format!("{name} has two limits"));
            }
        }
        Ok(limits)
    }
}

impl ErrorLimits {
    /// These, else the limits of the certificate.
    pub fn or(self, table: &CertificateTable) -> [Option<f64>; 3] {
        [0, 1, 2].map(|k| self.0[k].or(table.limits[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_with_their_units() {
        let read = |text: &str| text.parse::<ErrorLimits>().map(|limits| limits.0);
        assert_eq!(
            read("x=1.5um, rz = 4 urad"),
            Ok([Some(1.5 * 1e-6), None, Some(4.0 * 1e-6)])
        );
        assert_eq!(read("y=2mm"), Ok([None, Some(2.0 * 1e-3), None]));
        for wrong in [
            "",
            "x",
            "x=1",
            "x=um",
            "z=1um",
            "rz=1um",
            "x=-1um",
            "x=NaNum",
            "x=1um,x=2um",
            "x=1um,",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
