//! A calibration log as text, in the columns and units that the stage names.

use crate::input::log::layout::Quantity;
use crate::input::stage::Stage;
use std::fmt::Write;

/// How a log is written.
#[derive(Clone, Debug)]
pub struct LogFormat {
    header: String,
    us_per_unit: f64,
    /// Codes per unit of the columns of gaps and Hall sensors.
    codes_per_unit: [[f64; 3]; 2],
}

impl LogFormat {
    /// With a reference of these three quantities.
    pub fn new(reference: [Quantity; 3], stage: &Stage) -> Self {
        let quantities = [Quantity::Movement, Quantity::Time]
            .into_iter()
            .chain(reference)
            .chain(Quantity::GAPS)
            .chain(Quantity::HALL);
        let mut header = csv::WriterBuilder::new()
            .comment(Some(b'#'))
            .from_writer(Vec::new());
        // Writing to memory cannot fail, here and below.
        let _ = header.write_record(quantities.map(|q| &stage.log.column(q).name));
        let header = header.into_inner().unwrap_or_default();
        let scale = |quantity: Quantity| stage.log.column(quantity).scale;
        Self {
            header: String::from_utf8(header).unwrap_or_default(),
            us_per_unit: scale(Quantity::Time),
            codes_per_unit: [Quantity::GAPS, Quantity::HALL].map(|set| set.map(scale)),
        }
    }

    /// The first line.
    pub fn header(&self) -> String {
        self.header.clone()
    }

    /// Appends a row; the reference is in the units of its columns.
    pub fn append(
        &self,
        text: &mut String,
        (movement, t_us): (i64, i64),
        [x, y, z]: [f64; 3],
        [gaps, hall]: [[i32; 3]; 2],
    ) {
        let time = t_us as f64 / self.us_per_unit;
        let [gaps_per_unit, hall_per_unit] = self.codes_per_unit;
        let in_units = |codes: [i32; 3], per_unit: [f64; 3]| {
            [0, 1, 2].map(|k| f64::from(codes[k]) / per_unit[k])
        };
        let [g1, g2, g3] = in_units(gaps, gaps_per_unit);
        let [a, b, c] = in_units(hall, hall_per_unit);
        let _ = writeln!(
            text,
            "{movement},{time},{x},{y},{z},{g1},{g2},{g3},{a},{b},{c}"
        );
    }
}
