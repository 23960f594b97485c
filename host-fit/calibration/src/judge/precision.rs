//! The rounding errors of the target: its poses in `f32` against the same model in `f64`.

use hallstage_input::dataset::{Dataset, LoggedFrame};
use rayon::prelude::*;
use runtime::capacitive::vertical_pose;
use runtime::decoder::DecoderConstants;
use runtime::model::Probes;
use runtime::real::Real;
use runtime::{AnyDecoder, PlanarPose, VerticalPose};

/// The planar pose of a row in `f64`, from the same codes and constants that were not rounded.
pub fn decode_f64(
    constants: &DecoderConstants<f64>,
    probes: &Probes<f64>,
    frame: &LoggedFrame,
    vertical: &VerticalPose<f64>,
) -> PlanarPose<f64> {
    let (rows, signal) = (&constants.planar_per_code, frame.hall().map(f64::from_code));
    let gain = constants.temperature.gain_at(frame.temperature_mc());
    let change = gain.map(|gain| gain - 1.0);
    let (_, pose) = probes.planar_pose(rows, signal, change, vertical, &PlanarPose::ZERO);
    pose
}

/// The largest difference of X, Y (m) and Rz (rad) between the target's decoder and `f64`, over
/// all rows that it decodes.
pub fn largest_difference(
    constants: &DecoderConstants<f64>,
    probes: &Probes<f64>,
    decoder: &AnyDecoder,
    dataset: &Dataset,
) -> [f64; 3] {
    let one = |row: &hallstage_input::dataset::Row| {
        let words = row
            .frame
            .decode(decoder, &PlanarPose::ZERO)
            .planar()?
            .to_array();
        let vertical = match row.frame.capacitive() {
            Some(codes) => vertical_pose(&constants.vertical_per_code, codes.map(f64::from_code)),
            None => VerticalPose::from_array(row.vertical),
        };
        let exact = decode_f64(constants, probes, &row.frame, &vertical).to_array();
        Some([0, 1, 2].map(|k| (f64::from(words[k]) - exact[k]).abs()))
    };
    let larger = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k].max(b[k]));
    dataset
        .rows
        .par_iter()
        .filter_map(one)
        .reduce(|| [0.0; 3], larger)
}
