//! The columns of a log: quantity, default name, unit.
//!
//! | key in `[log]` | default column | holds |
//! |---|---|---|
//! | `movement` | `movement` | number of the movement |
//! | `time` | `t_us` | time of the sample |
//! | `ifm_x`, `ifm_y1`, `ifm_y2` | `ifm_x_nm`, `ifm_y1_nm`, `ifm_y2_nm` | displacement read by the beams |
//! | `x`, `y`, `rz` | `x_m`, `y_m`, `rz_rad` | reference pose, in place of the beams |
//! | `cap_1`, `cap_2`, `cap_3` | `cap1_cnt`, `cap2_cnt`, `cap3_cnt` | capacitive codes |
//! | `gap_1`, `gap_2`, `gap_3` | `gap1_m`, `gap2_m`, `gap3_m` | gaps as lengths, in place of the codes |
//! | `z`, `rx`, `ry` | `z_m`, `rx_rad`, `ry_rad` | vertical pose, in place of the codes |
//! | `cmd_x`, `cmd_y`, `cmd_rz` | `cmd_x_m`, `cmd_y_m`, `cmd_rz_rad` | commanded pose |
//! | `hall_a`, `hall_b`, `hall_c` | `hall_a_cnt`, `hall_b_cnt`, `hall_c_cnt` | Hall codes |
//!
//! A column that `[log]` does not name is also known by its key, its default name or a usual name, with a unit in any
//! spelling of `units.rs`: `ifm_x [um]`, `X/mm`, `Time (s)`.

use super::units;

/// The dimension of the numbers in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
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

/// A row of the table of quantities.
#[derive(Debug)]
struct Entry {
    /// Key in the table `[log]` of `stage.toml`.
    key: &'static str,
    /// Its column in a log, unless `[log]` names another.
    default_column: &'static str,
    kind: Dimension,
    /// The table of `stage.toml` that describes its converter; empty if it has none.
    converter: &'static str,
    /// Its description in a draft of `stage.toml`.
    meaning: &'static str,
    /// Usual names, without unit, spaces and underscores, in lower case.
    words: &'static [&'static str],
}

/// Makes [`Quantity`] and its table, one row for each quantity.
macro_rules! quantities {
    ($($name:ident, $key:literal, $column:literal, $kind:ident, $converter:literal, $meaning:literal, [$($word:literal)*];)*) => {
        /// A quantity that a column can hold.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        #[expect(missing_docs, reason = "the table of the module describes each")]
        pub enum Quantity { $($name,)* }

        impl Quantity {
            /// All of them, in the order of the module's table.
            pub const ALL: [Self; [$($key),*].len()] = [$(Self::$name),*];
        }

        static TABLE: [Entry; Quantity::ALL.len()] = [$(Entry {
            key: $key,
            default_column: $column,
            kind: Dimension::$kind,
            converter: $converter,
            meaning: $meaning,
            words: &[$($word),*],
        }),*];
    };
}

#[rustfmt::skip]
quantities! {
    Movement, "movement", "movement", Index, "", "number of the movement", ["movement" "move" "run" "segment" "motion" "trial"];
    Time, "time", "t_us", Time, "", "time of the sample", ["t" "time" "timestamp" "datetime" "elapsed" "zeit" "zeitstempel" "xvalue" "xaxis"];
    BeamX, "ifm_x", "ifm_x_nm", Length, "", "interferometer along X", ["ifmx" "interferometerx" "laserx" "beamx" "x1"];
    BeamY1, "ifm_y1", "ifm_y1_nm", Length, "", "interferometer along Y at x = +baseline/2", ["ifmy1" "interferometery1" "lasery1" "beamy1" "y1"];
    BeamY2, "ifm_y2", "ifm_y2_nm", Length, "", "interferometer along Y at x = -baseline/2", ["ifmy2" "interferometery2" "lasery2" "beamy2" "y2"];
    X, "x", "x_m", Length, "", "reference pose", ["x" "xref" "stagex" "posx" "xpos"];
    Y, "y", "y_m", Length, "", "reference pose", ["y" "yref" "stagey" "posy" "ypos"];
    Rz, "rz", "rz_rad", Angle, "", "reference pose", ["rz" "rzref" "thetaz" "yaw" "rotz"];
    CommandedX, "cmd_x", "cmd_x_m", Length, "", "commanded pose, for decode", ["cmdx" "commandedx" "xcmd" "setx"];
    CommandedY, "cmd_y", "cmd_y_m", Length, "", "commanded pose, for decode", ["cmdy" "commandedy" "ycmd" "sety"];
    CommandedRz, "cmd_rz", "cmd_rz_rad", Angle, "", "commanded pose, for decode", ["cmdrz" "commandedrz" "rzcmd" "setrz"];
    Gap1, "cap_1", "cap1_cnt", Code, "capacitive", "capacitive sensor, in the order of probes_m", ["cap1" "capacitive1" "gap1" "capa"];
    Gap2, "cap_2", "cap2_cnt", Code, "capacitive", "capacitive sensor, in the order of probes_m", ["cap2" "capacitive2" "gap2" "capb"];
    Gap3, "cap_3", "cap3_cnt", Code, "capacitive", "capacitive sensor, in the order of probes_m", ["cap3" "capacitive3" "gap3" "capc"];
    GapLength1, "gap_1", "gap1_m", Length, "", "gap of a capacitive sensor, in the order of probes_m", ["cap1" "capacitive1" "gap1" "capa"];
    GapLength2, "gap_2", "gap2_m", Length, "", "gap of a capacitive sensor, in the order of probes_m", ["cap2" "capacitive2" "gap2" "capb"];
    GapLength3, "gap_3", "gap3_m", Length, "", "gap of a capacitive sensor, in the order of probes_m", ["cap3" "capacitive3" "gap3" "capc"];
    Z, "z", "z_m", Length, "", "pose by the capacitive sensors", ["z" "stagez" "posz" "height"];
    Rx, "rx", "rx_rad", Angle, "", "pose by the capacitive sensors", ["rx" "thetax" "rotx"];
    Ry, "ry", "ry_rad", Angle, "", "pose by the capacitive sensors", ["ry" "thetay" "roty"];
    HallA, "hall_a", "hall_a_cnt", Code, "hall", "Hall probe A (h1), senses Y", ["halla" "hall1" "probea" "hallsensora" "hallprobea"];
    HallB, "hall_b", "hall_b_cnt", Code, "hall", "Hall probe B (h2), senses Y", ["hallb" "hall2" "probeb" "hallsensorb" "hallprobeb"];
    HallC, "hall_c", "hall_c_cnt", Code, "hall", "Hall probe C (h3), senses X", ["hallc" "hall3" "probec" "hallsensorc" "hallprobec"];
}

impl Quantity {
    /// The Hall codes of A, B, C.
    pub const HALL: [Self; 3] = [Self::HallA, Self::HallB, Self::HallC];
    /// The codes of the gaps 1, 2, 3.
    pub const GAPS: [Self; 3] = [Self::Gap1, Self::Gap2, Self::Gap3];
    /// The gaps 1, 2, 3 as lengths.
    pub const GAP_LENGTHS: [Self; 3] = [Self::GapLength1, Self::GapLength2, Self::GapLength3];
    /// The vertical pose in SI units.
    pub const VERTICAL: [Self; 3] = [Self::Z, Self::Rx, Self::Ry];
    /// The three beams.
    pub const BEAMS: [Self; 3] = [Self::BeamX, Self::BeamY1, Self::BeamY2];
    /// The reference pose in SI units.
    pub const PLANAR: [Self; 3] = [Self::X, Self::Y, Self::Rz];
    /// The commanded pose in SI units.
    pub const COMMANDED: [Self; 3] = [Self::CommandedX, Self::CommandedY, Self::CommandedRz];
    /// Alternative sets for the reference.
    pub const REFERENCES: [[Self; 3]; 2] = [Self::BEAMS, Self::PLANAR];
    /// Alternative sets for the vertical pose.
    pub const VERTICALS: [[Self; 3]; 3] = [Self::GAPS, Self::GAP_LENGTHS, Self::VERTICAL];

    fn entry(self) -> &'static Entry {
        &TABLE[self as usize]
    }

    /// Its key in the table `[log]` of `stage.toml`.
    pub fn key(self) -> &'static str {
        self.entry().key
    }

    /// Its column in a log, unless `[log]` names another.
    pub fn default_column(self) -> &'static str {
        self.entry().default_column
    }

    /// The table of `stage.toml` that describes its converter; empty if it has none.
    pub(crate) fn table(self) -> &'static str {
        self.entry().converter
    }

    /// Its description in a draft of `stage.toml`.
    pub(crate) fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// The dimension of its numbers.
    pub fn dimension(self) -> Dimension {
        self.entry().kind
    }

    /// The probable quantity of a column with this name and unit, for a draft that the user corrects.
    pub(crate) fn guess(name: &str, unit: Option<&str>) -> Option<Self> {
        let base = units::split(name).0;
        let word = units::to_key(base).replace('_', "");
        let is_one = |quantity: &Self| quantity.entry().words.contains(&word.as_str());
        let found = Self::ALL.into_iter().find(is_one)?;
        Some(found.in_unit(unit))
    }

    /// The same quantity; but a capacitive column in a unit of length holds a gap, and no codes.
    pub(super) fn in_unit(self, unit: Option<&str>) -> Self {
        let is_length = unit.is_some_and(|unit| Dimension::Length.unit(unit).is_some());
        let gap = Self::GAPS.iter().position(|gap| *gap == self);
        match gap.filter(|_| is_length) {
            Some(gap) => Self::GAP_LENGTHS[gap],
            None => self,
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

/// The columns of all quantities, and the columns to leave out.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLayout {
    columns: [Column; Quantity::ALL.len()],
    /// Whether `[log]` names the column of each quantity.
    mapped: [bool; Quantity::ALL.len()],
    /// Columns to leave out.
    pub ignored: Vec<String>,
    /// Time of one row, us: the servo period.
    pub row_us: f64,
    /// Voltage of one Hall code, V.
    pub hall_volts_per_count: Option<f64>,
    /// Voltage of one capacitive code, V.
    pub capacitive_volts_per_count: Option<f64>,
}

/// The meaning of a column's name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meaning<'n> {
    /// The exact name of the column of this quantity.
    Exact(Quantity),
    /// Another name of this quantity, which `[log]` does not map, with its unit, if it has one.
    WithUnit(Quantity, Option<&'n str>),
    /// The column is in `ignore`.
    Ignored,
    /// The name is not known.
    Unknown,
}

/// Why a unit cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitFault {
    /// No unit of this kind.
    Unknown,
    /// A voltage, and the volts per code are not known.
    NoVoltsPerCount,
}

impl Default for LogLayout {
    fn default() -> Self {
        let column = |quantity: Quantity| {
            let name = quantity.default_column();
            Column {
                name: name.to_owned(),
                scale: quantity.dimension().unit_in_name(name).unwrap_or(1.0),
            }
        };
        Self {
            columns: Quantity::ALL.map(column),
            mapped: [false; Quantity::ALL.len()],
            ignored: Vec::new(),
            row_us: 2000.0,
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

    /// The meaning of a name.
    pub(crate) fn meaning<'n>(&self, name: &'n str) -> Meaning<'n> {
        if self.ignored.iter().any(|ignored| ignored == name) {
            return Meaning::Ignored;
        }
        let mut all = Quantity::ALL.into_iter();
        if let Some(exact) = all.find(|quantity| self.column(*quantity).name == name) {
            return Meaning::Exact(exact);
        }
        let (base, unit) = units::split(name);
        let key = units::to_key(base);
        let named = |quantity: &Quantity| {
            let default = units::split(quantity.default_column()).0;
            !self.is_mapped(*quantity) && (key == quantity.key() || key == default)
        };
        let guessed = || Quantity::guess(name, unit).filter(|quantity| !self.is_mapped(*quantity));
        let found = Quantity::ALL.into_iter().find(named).or_else(guessed);
        found.map_or(Meaning::Unknown, |quantity| {
            Meaning::WithUnit(quantity, unit)
        })
    }

    /// Whether a column of this name holds a quantity.
    pub fn knows(&self, name: &str) -> bool {
        let meaning = self.meaning(name);
        matches!(meaning, Meaning::Exact(_) | Meaning::WithUnit(..))
    }

    /// m, rad, us or codes per `symbol` of a quantity.
    pub(crate) fn scale(&self, quantity: Quantity, symbol: &str) -> Result<f64, UnitFault> {
        let kind = quantity.dimension();
        if matches!(kind, Dimension::Code | Dimension::Index) && units::is_count(symbol) {
            return Ok(1.0);
        }
        if kind == Dimension::Time && units::is_rows(symbol) {
            return Ok(self.row_us);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_name_is_guessed_and_so_are_common_ones() {
        let guess = |name| Quantity::guess(name, units::split(name).1);
        for quantity in Quantity::ALL {
            assert_eq!(guess(quantity.default_column()), Some(quantity));
            // `gap_1` without a unit may hold codes.
            if !Quantity::GAP_LENGTHS.contains(&quantity) {
                assert_eq!(guess(quantity.key()), Some(quantity));
            }
        }
        assert_eq!(guess("Cap. 2 (\u{b5}m)"), Some(Quantity::GapLength2));
        assert_eq!(guess("Interferometer Y1 [nm]"), Some(Quantity::BeamY1));
        assert_eq!(guess("Hall-Sensor B (V)"), Some(Quantity::HallB));
        assert_eq!(guess("temperature"), None);
        assert_eq!(guess(""), None);
    }
}
