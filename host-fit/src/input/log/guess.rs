//! Guesses by its name what a column holds, for a draft of `stage.toml` that the user corrects.

use super::layout::Quantity;
use super::units;

/// Words for each quantity, without unit, spaces and underscores, in lower case.
const WORDS: [(Quantity, &[&str]); 17] = [
    (
        Quantity::Movement,
        &["movement", "move", "run", "segment", "motion", "trial"],
    ),
    (
        Quantity::Time,
        &["t", "time", "timestamp", "datetime", "elapsed", "zeit"],
    ),
    (
        Quantity::BeamX,
        &["ifmx", "interferometerx", "laserx", "beamx", "x1"],
    ),
    (
        Quantity::BeamY1,
        &["ifmy1", "interferometery1", "lasery1", "beamy1", "y1"],
    ),
    (
        Quantity::BeamY2,
        &["ifmy2", "interferometery2", "lasery2", "beamy2", "y2"],
    ),
    (Quantity::X, &["x", "xref", "stagex", "posx", "xpos"]),
    (Quantity::Y, &["y", "yref", "stagey", "posy", "ypos"]),
    (Quantity::Rz, &["rz", "rzref", "thetaz", "yaw", "rotz"]),
    (Quantity::Gap1, &["cap1", "capacitive1", "gap1", "capa"]),
    (Quantity::Gap2, &["cap2", "capacitive2", "gap2", "capb"]),
    (Quantity::Gap3, &["cap3", "capacitive3", "gap3", "capc"]),
    (Quantity::Z, &["z", "stagez", "posz", "height"]),
    (Quantity::Rx, &["rx", "thetax", "rotx"]),
    (Quantity::Ry, &["ry", "thetay", "roty"]),
    (
        Quantity::HallA,
        &["halla", "hall1", "probea", "hallsensora", "hallprobea"],
    ),
    (
        Quantity::HallB,
        &["hallb", "hall2", "probeb", "hallsensorb", "hallprobeb"],
    ),
    (
        Quantity::HallC,
        &["hallc", "hall3", "probec", "hallsensorc", "hallprobec"],
    ),
];

/// What a column of this name seems to hold.
pub(crate) fn guess(name: &str) -> Option<Quantity> {
    let base = units::split(name).0;
    let word = units::key_of(base).replace('_', "");
    let found = WORDS
        .iter()
        .find(|(_, words)| words.contains(&word.as_str()))?;
    Some(found.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_name_is_guessed_and_so_are_common_ones() {
        for quantity in Quantity::ALL {
            assert_eq!(guess(quantity.default_column()), Some(quantity));
            assert_eq!(guess(quantity.key()), Some(quantity));
        }
        assert_eq!(guess("Interferometer Y1 [nm]"), Some(Quantity::BeamY1));
        assert_eq!(guess("Hall-Sensor B (V)"), Some(Quantity::HallB));
        assert_eq!(guess("temperature"), None);
        assert_eq!(guess(""), None);
    }
}
