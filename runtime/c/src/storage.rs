//! Room for a decoder and a servo, of a size that C knows.

use core::mem::{ManuallyDrop, MaybeUninit, align_of, size_of};
use runtime::{AnyDecoder, Servo};

/// Words of a decoder.
pub const HALL_DECODER_WORDS: usize = 114;
/// Words of a servo.
pub const HALL_SERVO_WORDS: usize = 56;

/// A decoder, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallDecoder {
    opaque: [MaybeUninit<u32>; HALL_DECODER_WORDS],
}

/// A servo, as C sees it. Its contents are private.
#[repr(C)]
pub struct HallServo {
    opaque: [MaybeUninit<u32>; HALL_SERVO_WORDS],
}

const _: () = assert!(size_of::<AnyDecoder>() == size_of::<HallDecoder>());
const _: () = assert!(align_of::<AnyDecoder>() == align_of::<HallDecoder>());
const _: () = assert!(size_of::<Servo<'static>>() == size_of::<HallServo>());
const _: () = assert!(align_of::<Servo<'static>>() == align_of::<HallServo>());

/// Gives a type its room, whose size and alignment are asserted to be its own above.
macro_rules! room {
    ($room:ty, $content:ty) => {
        impl $room {
            pub(crate) fn new(content: $content) -> Self {
                // SAFETY: same size and alignment, and words that need not be set.
                unsafe { core::mem::transmute_copy(&ManuallyDrop::new(content)) }
            }

            pub(crate) const fn get(&self) -> &$content {
                // SAFETY: a room is only made by `new`, from a content.
                unsafe { &*core::ptr::from_ref(self).cast() }
            }
        }
    };
}

room!(HallDecoder, AnyDecoder);
room!(HallServo, Servo<'static>);

impl HallServo {
    pub(crate) const fn get_mut(&mut self) -> &mut Servo<'static> {
        // SAFETY: as in `get`; the borrow is unique.
        unsafe { &mut *core::ptr::from_mut(self).cast() }
    }
}
