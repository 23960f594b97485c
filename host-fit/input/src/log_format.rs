//! A calibration log as text, in the columns and units that the stage names.

use crate::dataset::LoggedFrame;
use crate::log::layout::Quantity;
use crate::stage::Stage;
use runtime::frame::MISSING_CODE;
use std::fmt::Write;

/// The columns and units of a log that is written.
#[derive(Clone, Debug)]
pub struct LogFormat {
    header: String,
    us_per_unit: f64,
    /// Codes, or m and rad, per unit of the columns of the gaps or the vertical pose; codes per unit of the Hall columns.
    vertical_per_unit: [f64; 3],
    hall_per_unit: [f64; 3],
    /// m degC per unit of the columns of mount and body, and at zero; `None` where there is none.
    temperature_mc: [Option<[f64; 2]>; 2],
}

impl LogFormat {
    /// With a reference of these three quantities and the vertical motion in these three, codes or a pose;
    /// `with_temperature`, with the columns of temperatures that the stage names.
    pub fn new(
        reference: [Quantity; 3],
        vertical: [Quantity; 3],
        with_temperature: bool,
        stage: &Stage,
    ) -> Self {
        let quantities = [Quantity::Movement, Quantity::Time]
            .into_iter()
            .chain(reference)
            .chain(vertical)
            .chain(Quantity::HALL);
        let mut header = csv::WriterBuilder::new()
            .comment(Some(b'#'))
            .from_writer(Vec::new());
        let temperatures = stage.temperature.columns.each_ref();
        let temperatures = temperatures.map(|column| column.as_ref().filter(|_| with_temperature));
        let names = quantities.map(|q| &stage.log.column(q).name);
        // Writing to memory cannot fail, here and below.
        let _ = header.write_record(names.chain(temperatures.into_iter().flatten()));
        let header = header.into_inner().unwrap_or_default();
        let scale = |quantity: Quantity| stage.log.column(quantity).scale;
        Self {
            header: String::from_utf8(header).unwrap_or_default(),
            us_per_unit: scale(Quantity::Time),
            vertical_per_unit: vertical.map(scale),
            hall_per_unit: Quantity::HALL.map(scale),
            temperature_mc: temperatures.map(|column| column.map(|_| stage.temperature.scale_mc)),
        }
    }

    /// The first line.
    pub fn header(&self) -> String {
        self.header.clone()
    }

    /// Appends a row; the reference is in the units of its columns. A temperature (m degC) of
    /// [`MISSING_CODE`] gives an empty cell.
    pub fn append(
        &self,
        text: &mut String,
        (movement, t_us): (i64, i64),
        [x, y, z]: [f64; 3],
        frame: &LoggedFrame,
    ) {
        let time = t_us as f64 / self.us_per_unit;
        let in_units =
            |values: [f64; 3], per_unit: [f64; 3]| [0, 1, 2].map(|k| values[k] / per_unit[k]);
        let codes = &frame.codes;
        let vertical = match &frame.vertical {
            Some(pose) => pose.to_array().map(f64::from),
            None => codes.capacitive.map(f64::from),
        };
        let [g1, g2, g3] = in_units(vertical, self.vertical_per_unit);
        let [a, b, c] = in_units(codes.hall.map(f64::from), self.hall_per_unit);
        let _ = write!(
            text,
            "{movement},{time},{x},{y},{z},{g1},{g2},{g3},{a},{b},{c}"
        );
        for (column, read_mc) in self.temperature_mc.into_iter().zip(codes.temperature_mc) {
            let _ = match column {
                None => Ok(()),
                Some(_) if read_mc == MISSING_CODE => text.write_str(","),
                Some([per_unit, zero]) => {
                    write!(text, ",{}", (f64::from(read_mc) - zero) / per_unit)
                }
            };
        }
        text.push('\n');
    }
}
