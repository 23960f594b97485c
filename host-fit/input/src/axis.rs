//! The axes of the pose and the Hall probes, in the order of every array of them; units as people write them.

/// An axis of the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its key in files: "rz".
    pub key: &'static str,
    /// Its name in texts: "Rz".
    pub name: &'static str,
    /// SI unit of a pose: "m" or "rad".
    pub unit: &'static str,
    /// Unit of an error, a millionth of the SI unit: "um" or "urad".
    pub micro: &'static str,
}

const fn length(key: &'static str, name: &'static str) -> Axis {
    let (unit, micro) = ("m", "um");
    Axis {
        key,
        name,
        unit,
        micro,
    }
}

const fn angle(key: &'static str, name: &'static str) -> Axis {
    let (unit, micro) = ("rad", "urad");
    Axis {
        key,
        name,
        unit,
        micro,
    }
}

/// X, Y, Rz, which the Hall probes measure, then Z, Rx, Ry, which the capacitive sensors measure.
pub const AXES: [Axis; 6] = [
    length("x", "X"),
    length("y", "Y"),
    angle("rz", "Rz"),
    length("z", "Z"),
    angle("rx", "Rx"),
    angle("ry", "Ry"),
];

/// X, Y, Rz.
pub const PLANAR: [Axis; 3] = [AXES[0], AXES[1], AXES[2]];

/// Names of the Hall probes.
pub const PROBES: [&str; 3] = ["A", "B", "C"];

/// A number of things: "1 gap", "2 gaps".
pub fn counted(count: usize, thing: &str) -> String {
    let end = if count == 1 { "" } else { "s" };
    format!("{count} {thing}{end}")
}

/// A unit as a sentence or a table shows it: `um` as µm, and a pure number without one.
pub fn sign(unit: &str) -> &str {
    match unit {
        "1" => "",
        "um" => "µm",
        "urad" => "µrad",
        "us" => "µs",
        "um/(m/s2)" => "µm/(m/s²)",
        "degC" => "°C",
        unit => unit,
    }
}
