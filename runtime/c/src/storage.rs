//! Room for a decoder, a servo and a predictor, of a size that C knows.

use core::mem::{ManuallyDrop, MaybeUninit, align_of, size_of};
use runtime::{AnyDecoder, PoseTracker, Predictor};

/// Words of a decoder.
pub const HALL_DECODER_WORDS: usize = 124;
/// Words of a servo.
pub const HALL_SERVO_WORDS: usize = 55;

/// Words of a predictor.
pub const HALL_PREDICTOR_WORDS: usize = 37;

/// A decoder, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallDecoder {
    mark: u32,
    opaque: [MaybeUninit<u32>; HALL_DECODER_WORDS],
}

/// A servo, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallServo {
    mark: u32,
    opaque: [MaybeUninit<u32>; HALL_SERVO_WORDS],
}

/// A predictor, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallPredictor {
    mark: u32,
    opaque: [MaybeUninit<u32>; HALL_PREDICTOR_WORDS],
}

/// Lets a room be filled with its content and marked as filled. A room of C may never have been
/// filled: then its words are zero, or arbitrary, and equal the mark with a chance of 2^-32.
macro_rules! room {
    ($room:ident, $words:expr, $content:ty, $mark:expr) => {
        const _: () = assert!(size_of::<$content>() == 4 * $words);
        const _: () = assert!(align_of::<$content>() == align_of::<$room>());

        impl $room {
            pub(crate) fn new(content: $content) -> Self {
                Self {
                    mark: $mark,
                    // SAFETY: same size and alignment, and words that need not be set.
                    opaque: unsafe { core::mem::transmute_copy(&ManuallyDrop::new(content)) },
                }
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
