//! What the pose of a calibration is the pose of.

use hallstage_input::stage::Stage;

/// The calibrated point, and where the beams are taken to be.
pub fn reference(stage: &Stage) -> String {
    let beams = match stage.interferometer.has_places() {
        false => "beams on the axes".to_owned(),
        true => {
            let [x, y1, y2] = stage
                .interferometer
                .places_m()
                .map(|at| at.map(|m| m * 1e3));
            format!(
                "X beam at y {:.1}, z {:.1} mm, Y beams at x {:.1} and {:.1}, z {:.1} and {:.1} mm",
                x[1], x[2], y1[0], y2[0], y1[2], y2[2]
            )
        }
    };
    format!("pose of the tool point, the origin of stage.toml; interferometers X, Y1, Y2, {beams}")
}
