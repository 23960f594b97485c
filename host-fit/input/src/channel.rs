//! Every channel of a log, every group of channels and every axis of the pose, in one list.

use serde::{Serialize, Serializer};

macro_rules! channels {
    ($($(#[doc = $doc:literal])* $channel:ident, $name:literal, $title:literal;)*) => {
        /// A channel, a group of channels that share a cause, or an axis of the pose.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[expect(missing_docs, reason = "the titles say what they are")]
        pub enum Channel { $($channel,)* }

        impl Channel {
            /// The name in JSON.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$channel => $name,)* }
            }

            /// The name in a sentence.
            pub const fn title(self) -> &'static str {
                match self { $(Self::$channel => $title,)* }
            }
        }
    };
}

channels! {
    HallA, "hall_a", "Hall A";
    HallB, "hall_b", "Hall B";
    HallC, "hall_c", "Hall C";
    BeamX, "ifm_x", "beam X";
    BeamY1, "ifm_y1", "beam Y1";
    BeamY2, "ifm_y2", "beam Y2";
    Gap1, "cap_1", "capacitive sensor 1";
    Gap2, "cap_2", "capacitive sensor 2";
    Gap3, "cap_3", "capacitive sensor 3";
    Halls, "hall", "all Hall probes";
    Beams, "ifm", "all beams";
    Gaps, "cap", "all capacitive sensors";
    X, "x", "X";
    Y, "y", "Y";
    Rz, "rz", "Rz";
    Z, "z", "Z";
    Rx, "rx", "Rx";
    Ry, "ry", "Ry";
}

impl Channel {
    /// The nine channels of a log: Hall A, B, C, beams X, Y1, Y2, capacitive sensors 1, 2, 3.
    pub const SINGLE: [Self; 9] = [
        Self::HallA,
        Self::HallB,
        Self::HallC,
        Self::BeamX,
        Self::BeamY1,
        Self::BeamY2,
        Self::Gap1,
        Self::Gap2,
        Self::Gap3,
    ];
    /// All channels of a kind, in the order of [`SINGLE`](Self::SINGLE).
    pub const GROUPS: [Self; 3] = [Self::Halls, Self::Beams, Self::Gaps];
    /// The axes of the pose; the Hall probes and the beams show the first three.
    pub const POSE: [Self; 6] = [Self::X, Self::Y, Self::Rz, Self::Z, Self::Rx, Self::Ry];

    /// Whether it is a beam, or all of them.
    pub const fn is_beam(self) -> bool {
        matches!(
            self,
            Self::BeamX | Self::BeamY1 | Self::BeamY2 | Self::Beams
        )
    }

    /// Whether it is an axis of the pose.
    pub fn is_pose(self) -> bool {
        Self::POSE.contains(&self)
    }

    /// The unit of an axis in JSON: "um" or "urad".
    pub const fn micro_unit(self) -> &'static str {
        match self {
            Self::Rz | Self::Rx | Self::Ry => "urad",
            _ => "um",
        }
    }
}

impl Serialize for Channel {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
