//! Room for a decoder, a servo and a predictor, of a size that C knows.

use crate::types::{HALL_LAYOUT_VERSION, HallReading};
use core::mem::{MaybeUninit, align_of, size_of};
use runtime::tracker::Health;
use runtime::{AnyDecoder, CommandedMotion, MotionCorrection, PoseTracker, Predictor, RawFrame};

/// Words of 64 bits of a decoder.
pub const HALL_DECODER_WORDS: usize = 63;
/// Of a servo.
pub const HALL_SERVO_WORDS: usize = 29;
/// Of a predictor.
pub const HALL_PREDICTOR_WORDS: usize = 19;

/// A decoder, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallDecoder {
    mark: u64,
    opaque: [MaybeUninit<u64>; HALL_DECODER_WORDS],
}

/// A servo, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallServo {
    mark: u64,
    opaque: [MaybeUninit<u64>; HALL_SERVO_WORDS],
}

/// A predictor, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallPredictor {
    mark: u64,
    opaque: [MaybeUninit<u64>; HALL_PREDICTOR_WORDS],
}

/// The sizes that a program has compiled in are those of its layout: with another one, raise it.
const _: () = assert!(
    HALL_LAYOUT_VERSION == 1
        && size_of::<HallDecoder>() == 512
        && size_of::<HallServo>() == 240
        && size_of::<HallPredictor>() == 160
        && size_of::<RawFrame>() == 40
        && size_of::<HallReading>() == 28
        && size_of::<Health>() == 24
        && size_of::<MotionCorrection>() == 108
        && size_of::<CommandedMotion>() == 36,
    "another size: raise HALL_LAYOUT_VERSION"
);

/// Lets a room be filled with its content and marked as filled. A room of C may never have been
/// filled: then its words are zero, or arbitrary, and equal the mark with a chance of 2^-64.
macro_rules! room {
    ($room:ident, $words:expr, $content:ty, $mark:expr) => {
        // A pointer of a computer takes eight bytes.
        const _: () = assert!(size_of::<$content>() <= 8 * $words);
        const _: () = assert!(align_of::<$content>() <= align_of::<$room>());

        impl $room {
            pub(crate) fn new(content: $content) -> Self {
                let mut room = Self {
                    mark: $mark,
                    opaque: [MaybeUninit::uninit(); $words],
                };
                // SAFETY: the room is large enough and aligned.
                unsafe { (&raw mut room.opaque).cast::<$content>().write(content) };
                room
            }

            /// What is in the room, if `new` filled it.
            pub(crate) fn get(&self) -> Option<&$content> {
                // SAFETY: the mark is set by `new` only, together with a content.
                (self.mark == $mark).then(|| unsafe { &*(&raw const self.opaque).cast() })
            }
        }
    };
}

/// Lets the content of a room be changed.
macro_rules! changing_room {
    ($room:ident, $content:ty) => {
        impl $room {
            /// As `get`, to be changed.
            pub(crate) fn get_mut(&mut self) -> Option<&mut $content> {
                self.get()?;
                // SAFETY: as in `get`; the borrow is unique.
                Some(unsafe { &mut *(&raw mut self.opaque).cast() })
            }
        }
    };
}

room!(HallDecoder, HALL_DECODER_WORDS, AnyDecoder, 0x9c3e_51d7);
room!(
    HallServo,
    HALL_SERVO_WORDS,
    PoseTracker<&'static AnyDecoder>,
    0x6ab4_e825
);
room!(HallPredictor, HALL_PREDICTOR_WORDS, Predictor, 0x5e17_c2a9);
changing_room!(HallServo, PoseTracker<&'static AnyDecoder>);
changing_room!(HallPredictor, Predictor);
