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
//!
//! A column that `[log]` leaves to its default is also known by its key or by the default name
//! with another unit, in any of the spellings of `units.rs`: `ifm_x [um]`, `X/mm`, `Time (s)`.

use super::units;

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
    /// A converter's code, or the voltage that makes it; scales lead to codes.
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

    /// The table of `stage.toml` that describes its converter; empty if it has none.
    pub(crate) const fn table(self) -> &'static str {
        match self {
            Self::HallA | Self::HallB | Self::HallC => "hall",
            Self::Gap1 | Self::Gap2 | Self::Gap3 => "capacitive",
            _ => "",
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

/// The column of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name in the header.
    pub name: String,
    /// m, rad, us or codes per unit of the column; 1 for codes and indices.
    pub scale: f64,
}

/// The columns of all quantities, and those to leave out.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLayout {
    columns: [Column; 17],
    /// Whether `[log]` names the column of each quantity.
    mapped: [bool; 17],
    /// Columns to leave out.
    pub ignored: Vec<String>,
    /// Voltage of one Hall code, V.
    pub hall_volts_per_count: Option<f64>,
    /// Voltage of one capacitive code, V.
    pub capacitive_volts_per_count: Option<f64>,
}

/// What a column's name says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meaning<'n> {
    /// It is the name of this quantity's column, letter for letter.
    Exact(Quantity),
    /// It is that of a quantity which `[log]` does not name, with this unit, if it has one.
    WithUnit(Quantity, Option<&'n str>),
    /// It is in `ignore`.
    Ignored,
    /// Nothing that is known.
    Unknown,
}

/// Why a unit leads nowhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitFault {
    /// There is no such unit of this kind.
    Unknown,
    /// A voltage, and how many volts a code has is not known.
    NoVoltsPerCount,
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
            mapped: [false; 17],
            ignored: Vec::new(),
            hall_volts_per_count: None,
            capacitive_volts_per_count: None,
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
        self.mapped[quantity as usize] = true;
    }

    /// Whether the column of this quantity was [`set`](Self::set).
    pub const fn is_mapped(&self, quantity: Quantity) -> bool {
        self.mapped[quantity as usize]
    }

    /// What a column of this name holds.
    pub(crate) fn meaning<'n>(&self, name: &'n str) -> Meaning<'n> {
        if self.ignored.iter().any(|ignored| ignored == name) {
            return Meaning::Ignored;
        }
        let mut all = Quantity::ALL.into_iter();
        if let Some(exact) = all.find(|quantity| self.column(*quantity).name == name) {
            return Meaning::Exact(exact);
        }
        let (base, unit) = units::split(name);
        let key = units::key_of(base);
        let named = |quantity: &Quantity| {
            let default = units::split(quantity.default_column()).0;
            !self.is_mapped(*quantity) && (key == quantity.key() || key == default)
        };
        let found = Quantity::ALL.into_iter().find(named);
        found.map_or(Meaning::Unknown, |quantity| {
            Meaning::WithUnit(quantity, unit)
        })
    }

    /// Whether a column of this name holds a quantity.
    pub(crate) fn knows(&self, name: &str) -> bool {
        let meaning = self.meaning(name);
        matches!(meaning, Meaning::Exact(_) | Meaning::WithUnit(..))
    }

    /// m, rad, us or codes per `symbol` of a quantity.
    pub(crate) fn scale(&self, quantity: Quantity, symbol: &str) -> Result<f64, UnitFault> {
        let kind = quantity.kind();
        if matches!(kind, Kind::Code | Kind::Index) && units::is_count(symbol) {
            return Ok(1.0);
        }
        let unit = kind.unit(symbol).ok_or(UnitFault::Unknown)?;
        let volts_per_count = match quantity.table() {
            "" => return Ok(unit),
            "hall" => self.hall_volts_per_count,
            _ => self.capacitive_volts_per_count,
        };
        let volts_per_count = volts_per_count.ok_or(UnitFault::NoVoltsPerCount)?;
        Ok(unit / volts_per_count)
    }
}
