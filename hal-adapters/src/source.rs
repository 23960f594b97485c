//! Where frames come from.

/// Gives one frame after the other: a converter, a bus, a log.
///
/// `Frame` is a [`runtime::RawFrame`] for whole ticks, or a
/// [`StampedFrame`](crate::can::StampedFrame) for the frames of a bus. The wrappers of
/// [`crate::fault`] and [`crate::record`] work on either.
pub trait FrameSource {
    /// What one call gives.
    type Frame;
    /// The error of the bus or file below, kept whole.
    type Error;

    /// The next frame; `Ok(None)` when none is there now (a bus that is silent) or ever
    /// again (a log that ended): the source says which.
    ///
    /// # Errors
    /// Whatever the bus or file below reports.
    fn next_frame(&mut self) -> Result<Option<Self::Frame>, Self::Error>;
}

impl<S: FrameSource + ?Sized> FrameSource for &mut S {
    type Frame = S::Frame;
    type Error = S::Error;

    fn next_frame(&mut self) -> Result<Option<Self::Frame>, Self::Error> {
        (**self).next_frame()
    }
}

/// Replays a slice, once: after its last frame it gives `None` for ever.
#[derive(Clone, Debug)]
pub struct SliceSource<'s, T> {
    left: core::slice::Iter<'s, T>,
}

impl<'s, T> SliceSource<'s, T> {
    /// A source that starts at the first frame of `frames`.
    pub fn new(frames: &'s [T]) -> Self {
        Self {
            left: frames.iter(),
        }
    }
}

impl<T: Clone> FrameSource for SliceSource<'_, T> {
    type Frame = T;
    type Error = core::convert::Infallible;

    fn next_frame(&mut self) -> Result<Option<T>, Self::Error> {
        Ok(self.left.next().cloned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_is_replayed_in_order_and_then_ends() {
        let mut source = SliceSource::new(&[3, 1, 2]);
        for want in [Some(3), Some(1), Some(2), None, None] {
            assert_eq!(source.next_frame(), Ok(want));
        }
    }
}
