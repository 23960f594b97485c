//! What is wrong with a reading: a bit mask. All is good when no bit is set, or bit 19 alone. The
//! bits mean the same everywhere; a CAN bus has bits 0 to 19.
//!
//! | bit | value | meaning | effect |
//! |---|---|---|---|
//! | 0, 1, 2 | 1, 2, 4 | Hall code A, B, C at a rail, implausible or missing | X, Y, Rz invalid |
//! | 3, 4, 5 | 8, 16, 32 | capacitive code 1, 2, 3 likewise | all six invalid |
//! | 6, 7, 8 | 64, 128, 256 | phi of A, B, C too near zero, or not finite | X, Y, Rz invalid |
//! | 9 | 512 | a planar result is not finite | X, Y, Rz invalid |
//! | 10 | 1024 | a vertical result is not finite | all six invalid |
//! | 11 | 2048 | vertical pose outside the calibrated range | none: extrapolated |
//! | 12 | 4096 | planar pose outside the calibrated range | none: extrapolated |
//! | 13 | 8192 | X, Y, Rz invalid in this period | they are 0, or held |
//! | 14 | 16384 | Z, Rx, Ry invalid in this period | they are 0, or held |
//! | 15 | 32768 | a temperature is missing or implausible | none: decoded as if at T0 |
//! | 16 | 65536 | the parameters were written by `--force`: their log was refused | none: errors may be large |
//! | 17 | 131072 | one or more servo periods before this frame had no frame | |
//! | 18 | 262144 | the frame repeats an earlier sequence number: nothing new | all six invalid |
//! | 19 | 524288 | a zero deviation is subtracted from X, Y, Rz | none: no fault |
//! | 20 | 1048576 | X, Y, Rz are the last valid ones, repeated | |
//! | 21 | 2097152 | Z, Rx, Ry are the last valid ones, repeated | |
//!
//! Bits 11 and 12 mean something only while bits 14 and 13 are clear.

/// The status of one reading, as a bit mask. See the module's table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(transparent)]
pub struct Status(u32);

impl Status {
    /// All good.
    pub const GOOD: Self = Self(0);
    /// Hall code A bad; B and C are the next two bits.
    pub const HALL_A: Self = Self(1 << 0);
    /// Any Hall code bad.
    pub const HALL: Self = Self(0b111);
    /// Capacitive code 1 bad; 2 and 3 are the next two bits.
    pub const CAPACITIVE_1: Self = Self(1 << 3);
    /// Any capacitive code bad.
    pub const CAPACITIVE: Self = Self(0b111 << 3);
    /// phi of probe A too near zero or not finite; B and C are the next two bits.
    pub const SENSITIVITY_A: Self = Self(1 << 6);
    /// Any phi too near zero or not finite.
    pub const SENSITIVITY: Self = Self(0b111 << 6);
    /// A planar result is not finite.
    pub const PLANAR_NOT_FINITE: Self = Self(1 << 9);
    /// A vertical result is not finite.
    pub const VERTICAL_NOT_FINITE: Self = Self(1 << 10);
    /// The vertical pose lies outside the calibrated range.
    pub const VERTICAL_EXTRAPOLATED: Self = Self(1 << 11);
    /// The planar pose lies outside the calibrated range.
    pub const PLANAR_EXTRAPOLATED: Self = Self(1 << 12);
    /// X, Y, Rz are invalid.
    pub const PLANAR_INVALID: Self = Self(1 << 13);
    /// Z, Rx, Ry are invalid.
    pub const VERTICAL_INVALID: Self = Self(1 << 14);
    /// A temperature is missing or implausible: the pose was decoded as if at T0.
    pub const TEMPERATURE_MISSING: Self = Self(1 << 15);
    /// The parameters were written by `--force`, of a log that was refused.
    pub const FORCED: Self = Self(1 << 16);
    /// Frames are missing before this frame.
    pub const FRAMES_MISSED: Self = Self(1 << 17);
    /// The frame is not new.
    pub const FRAME_REPEATED: Self = Self(1 << 18);
    /// A zero deviation is subtracted from X, Y, Rz. No fault.
    pub const ZERO_SET: Self = Self(1 << 19);
    /// X, Y, Rz are repeated.
    pub const PLANAR_HELD: Self = Self(1 << 20);
    /// Z, Rx, Ry are repeated.
    pub const VERTICAL_HELD: Self = Self(1 << 21);

    /// Every bit with its name, lowest first, for reports.
    pub const NAMES: [(Self, &'static str); 22] = [
        (Self(1), "Hall code A bad"),
        (Self(1 << 1), "Hall code B bad"),
        (Self(1 << 2), "Hall code C bad"),
        (Self(1 << 3), "capacitive code 1 bad"),
        (Self(1 << 4), "capacitive code 2 bad"),
        (Self(1 << 5), "capacitive code 3 bad"),
        (Self(1 << 6), "sensitivity of A too near zero"),
        (Self(1 << 7), "sensitivity of B too near zero"),
        (Self(1 << 8), "sensitivity of C too near zero"),
        (Self::PLANAR_NOT_FINITE, "planar pose not finite"),
        (Self::VERTICAL_NOT_FINITE, "vertical pose not finite"),
        (
            Self::VERTICAL_EXTRAPOLATED,
            "vertical pose outside the calibrated range",
        ),
        (
            Self::PLANAR_EXTRAPOLATED,
            "planar pose outside the calibrated range",
        ),
        (Self::PLANAR_INVALID, "planar pose invalid"),
        (Self::VERTICAL_INVALID, "vertical pose invalid"),
        (
            Self::TEMPERATURE_MISSING,
            "temperature missing or implausible",
        ),
        (Self::FORCED, "parameters written by --force"),
        (Self::FRAMES_MISSED, "frames missed"),
        (Self::FRAME_REPEATED, "frame repeated"),
        (Self::ZERO_SET, "zero deviation subtracted"),
        (Self::PLANAR_HELD, "planar pose held"),
        (Self::VERTICAL_HELD, "vertical pose held"),
    ];

    /// The mask as a number, for bus and log.
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// A status from its mask, for readers of logs and buses. Unknown bits are kept.
    #[inline(always)]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Whether nothing at all is wrong: no bit is set but [`Status::ZERO_SET`].
    #[inline(always)]
    pub const fn is_good(self) -> bool {
        self.0 & !Self::ZERO_SET.0 == 0
    }

    /// Whether any bit of `other` is set.
    #[inline(always)]
    pub const fn any(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Both masks together.
    #[inline(always)]
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// This bit and the next two, where the three lowest bits of `which` are set.
    #[inline(always)]
    pub(crate) const fn with_next(self, which: u32) -> Self {
        Self(which << self.0.trailing_zeros())
    }

    /// This bit if the condition holds, without a branch.
    #[inline(always)]
    pub(crate) const fn when(self, condition: bool) -> Self {
        self.with_next(condition as u32)
    }

    /// The names of the bits that are set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .iter()
            .filter(move |(bit, _)| self.any(*bit))
            .map(|(_, name)| *name)
    }
}

impl core::ops::BitOr for Status {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.with(other)
    }
}

/// The names of the bits that are set, or "good".
impl core::fmt::Display for Status {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.is_good() {
            return f.write_str("good");
        }
        for (k, name) in self.names().enumerate() {
            f.write_str(if k > 0 { ", " } else { "" })?;
            f.write_str(name)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::string::ToString;

    #[test]
    fn a_status_is_shown_by_the_names_of_its_bits() {
        assert_eq!(Status::ZERO_SET.to_string(), "good");
        let two = Status::PLANAR_INVALID | Status::HALL_A;
        let shown = "Hall code A bad, planar pose invalid";
        assert_eq!(two.to_string(), shown);
    }

    #[test]
    fn every_bit_of_the_table_has_one_name() {
        for (k, (bit, _)) in Status::NAMES.iter().enumerate() {
            assert_eq!(bit.bits(), 1 << k);
        }
        let all = Status::NAMES
            .iter()
            .fold(Status::GOOD, |sum, (bit, _)| sum.with(*bit));
        assert_eq!(all.names().count(), Status::NAMES.len());
    }
    #[test]
    fn only_a_zero_deviation_is_no_fault() {
        for (bit, name) in Status::NAMES {
            assert_eq!(bit.is_good(), bit == Status::ZERO_SET, "{name}");
            assert!(!bit.with(Status::HALL_A).is_good());
        }
    }
}
