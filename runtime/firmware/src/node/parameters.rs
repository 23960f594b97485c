//! Why a node decodes or does not.

use crate::records::{Loaded, Refusal};
use crate::start_up::Stop;
use runtime::{AnyDecoder, OnInvalid, PoseTracker};

/// Why a node decodes or does not.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, in a static, and no heap"
)]
pub enum Parameters<'d> {
    /// There are parameters.
    Usable {
        /// Runs their decoder.
        servo: PoseTracker<&'d AnyDecoder>,
        /// What is wrong with parameters that are not used.
        other_slot: Option<Refusal>,
    },
    /// There are none, or none that are sound.
    None {
        /// What is wrong with the slots.
        refusal: Refusal,
    },
    /// None run until that is acknowledged.
    Stopped(Stop),
    /// The controller failed its own test and must not decode.
    SelfTestFailed,
}

impl<'d> Parameters<'d> {
    /// At start-up: what was loaded, what is wrong with the rest, and why nothing is to run. Without
    /// `is_sound`, whether the arithmetic is that of the host, nothing is decoded.
    pub fn at_start(
        loaded: Option<&'d Loaded>,
        refusal: Option<Refusal>,
        stop: Option<Stop>,
        is_sound: bool,
    ) -> Self {
        match (loaded, stop) {
            _ if !is_sound => Self::SelfTestFailed,
            (_, Some(stop)) => Self::Stopped(stop),
            (Some(loaded), None) => Self::Usable {
                servo: PoseTracker::new(&loaded.decoder, OnInvalid::Zero),
                other_slot: refusal,
            },
            (None, None) => Self::None {
                refusal: refusal.unwrap_or(Refusal::NEITHER),
            },
        }
    }

    /// The servo, where there are parameters.
    pub(super) const fn servo(&self) -> Option<&PoseTracker<&'d AnyDecoder>> {
        match self {
            Self::Usable { servo, .. } => Some(servo),
            _ => None,
        }
    }

    /// The same, to be changed.
    pub(super) const fn servo_mut(&mut self) -> Option<&mut PoseTracker<&'d AnyDecoder>> {
        match self {
            Self::Usable { servo, .. } => Some(servo),
            _ => None,
        }
    }
}
