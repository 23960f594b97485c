//! Which column of a log holds what, and in which unit.
//!
//! | key in `[log]` | default column | holds |
//! |---|---|---|
//! | `movement` | `movement` | number of the movement |
//! | `time` | `t_us` | time of the sample |
//! | `ifm_x`, `ifm_y1`, `ifm_y2` | `ifm_x_nm`, `ifm_y1_nm`, `ifm_y2_nm` | displacement read by the beams |
//! | `x`, `y`, `rz` | `x_m`, `y_m`, `rz_rad` | reference pose, in place of the beams |
//! | `cap_1`, `cap_2`, `cap_3` | `cap1_cnt`, `cap2_cnt`, `cap3_cnt` | capacitive codes |
//! | `z`, `rx`, `ry` | `z_m`, `rx_rad`, `ry_rad` | vertical pose, in place of the codes |
//! | `hall_a`, `hall_b`, `hall_c` | `hall_a_cnt`, `hall_b_cnt`, `hall_c_cnt` | Hall codes |

/// A quantity that a column can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
#[expect(missing_docs, reason = "the module's table says what each holds")]
pub enum Quantity {
    Movement,
    Time,
    BeamX,
    BeamY1,
    BeamY2,
    X,
    Y,
    Rz,
    Gap1,
    Gap2,
    Gap3,
    Z,
    Rx,
    Ry,
    HallA,
    HallB,
    HallC,
}

/// What the numbers of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number that names something.
    Index,
    /// A time; scales lead to us.
    Time,
    /// A displacement; scales lead to m.
    Length,
    /// An angle; scales lead to rad.
    Angle,
    /// A converter's code.
    Code,
}

impl Quantity {
    /// All of them, in the order of the module's table.
    pub const ALL: [Self; 17] = [
        Self::Movement,
        Self::Time,
        Self::BeamX,
        Self::BeamY1,
        Self::BeamY2,
        Self::X,
        Self::Y,
        Self::Rz,
        Self::Gap1,
        Self::Gap2,
        Self::Gap3,
        Self::Z,
        Self::Rx,
        Self::Ry,
        Self::HallA,
        Self::HallB,
        Self::HallC,
    ];
    /// The Hall codes of A, B, C.
    pub const HALL: [Self; 3] = [Self::HallA, Self::HallB, Self::HallC];
    /// The codes of the gaps 1, 2, 3.
    pub const GAPS: [Self; 3] = [Self::Gap1, Self::Gap2, Self::Gap3];
    /// The vertical pose in SI units.
    pub const VERTICAL: [Self; 3] = [Self::Z, Self::Rx, Self::Ry];
    /// The three beams.
    pub const BEAMS: [Self; 3] = [Self::BeamX, Self::BeamY1, Self::BeamY2];
    /// The reference pose in SI units.
    pub const PLANAR: [Self; 3] = [Self::X, Self::Y, Self::Rz];

    /// Its key in the table `[log]` of `stage.toml`.
    pub const fn key(self) -> &'static str {
        self.names().0
    }

    /// Its column in a log, unless `[log]` names another.
    pub const fn default_column(self) -> &'static str {
        self.names().1
    }

    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Movement => ("movement", "movement"),
            Self::Time => ("time", "t_us"),
            Self::BeamX => ("ifm_x", "ifm_x_nm"),
            Self::BeamY1 => ("ifm_y1", "ifm_y1_nm"),
            Self::BeamY2 => ("ifm_y2", "ifm_y2_nm"),
            Self::X => ("x", "x_m"),
            Self::Y => ("y", "y_m"),
            Self::Rz => ("rz", "rz_rad"),
            Self::Gap1 => ("cap_1", "cap1_cnt"),
            Self::Gap2 => ("cap_2", "cap2_cnt"),
            Self::Gap3 => ("cap_3", "cap3_cnt"),
            Self::Z => ("z", "z_m"),
            Self::Rx => ("rx", "rx_rad"),
            Self::Ry => ("ry", "ry_rad"),
            Self::HallA => ("hall_a", "hall_a_cnt"),
            Self::HallB => ("hall_b", "hall_b_cnt"),
            Self::HallC => ("hall_c", "hall_c_cnt"),
        }
    }

    /// What its numbers are.
    pub const fn kind(self) -> Kind {
        match self {
            Self::Movement => Kind::Index,
            Self::Time => Kind::Time,
            Self::BeamX | Self::BeamY1 | Self::BeamY2 | Self::X | Self::Y | Self::Z => Kind::Length,
            Self::Rz | Self::Rx | Self::Ry => Kind::Angle,
            Self::Gap1 | Self::Gap2 | Self::Gap3 => Kind::Code,
            Self::HallA | Self::HallB | Self::HallC => Kind::Code,
        }
    }
}

const LENGTHS: [(&str, f64); 5] = [
    ("m", 1.0),
    ("mm", 1e-3),
    ("um", 1e-6),
    ("nm", 1e-9),
    ("pm", 1e-12),
];
const ANGLES: [(&str, f64); 5] = [
    ("rad", 1.0),
    ("mrad", 1e-3),
    ("urad", 1e-6),
    ("nrad", 1e-9),
    ("deg", core::f64::consts::PI / 180.0),
];
const TIMES_TO_US: [(&str, f64); 4] = [("s", 1e6), ("ms", 1e3), ("us", 1.0), ("ns", 1e-3)];

impl Kind {
    const fn table(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &LENGTHS,
            Self::Angle => &ANGLES,
            Self::Time => &TIMES_TO_US,
            Self::Index | Self::Code => &[],
        }
    }

    /// What one `symbol` is in m, rad or us; `None` if this kind has no such unit.
    pub fn unit(self, symbol: &str) -> Option<f64> {
        let found = self.table().iter().find(|(name, _)| *name == symbol)?;
        Some(found.1)
    }

    /// The unit that a column's name ends in, as `_nm` in `ifm_x_nm`.
    pub fn unit_of_name(self, name: &str) -> Option<f64> {
        self.unit(name.rsplit('_').next()?)
    }

    /// The units of this kind, for messages.
    pub const fn units(self) -> &'static str {
        match self {
            Self::Length => "m, mm, um, nm, pm",
            Self::Angle => "rad, mrad, urad, nrad, deg",
            Self::Time => "s, ms, us, ns",
            Self::Index | Self::Code => "none",
        }
    }

    /// The SI unit in which a `scale` is given.
    pub const fn scale_unit(self) -> &'static str {
        match self {
            Self::Length => "m",
            Self::Angle => "rad",
            Self::Time => "s",
            Self::Index | Self::Code => "",
        }
    }

    /// A `scale` in SI units times this leads to m, rad or us.
    pub const fn per_si(self) -> f64 {
        match self {
            Self::Time => 1e6,
            _ => 1.0,
        }
    }
}

/// The column of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name in the header.
    pub name: String,
    /// m, rad or us per unit of the column; 1 for codes and indices.
    pub scale: f64,
}

/// The columns of all quantities, and those to leave out.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLayout {
    columns: [Column; 17],
    /// Columns to leave out.
    pub ignored: Vec<String>,
}

impl Default for LogLayout {
    fn default() -> Self {
        let column = |quantity: Quantity| {
            let name = quantity.default_column();
            Column {
                name: name.to_owned(),
                scale: quantity.kind().unit_of_name(name).unwrap_or(1.0),
            }
        };
        Self {
            columns: Quantity::ALL.map(column),
            ignored: Vec::new(),
        }
    }
}

impl LogLayout {
    /// The column of a quantity.
    pub const fn column(&self, quantity: Quantity) -> &Column {
        &self.columns[quantity as usize]
    }

    /// Names another column for a quantity.
    pub fn set(&mut self, quantity: Quantity, column: Column) {
        self.columns[quantity as usize] = column;
    }

    /// The quantity whose column has this name, unless the column is to be left out.
    pub fn quantity(&self, name: &str) -> Option<Quantity> {
        Quantity::ALL
            .into_iter()
            .find(|quantity| self.column(*quantity).name == name)
    }

    /// Whether the column of this name is to be left out.
    pub fn ignores(&self, name: &str) -> bool {
        self.ignored.iter().any(|ignored| ignored == name)
    }
}
