//! A source that shows every frame to a recorder before it hands it on.

use crate::source::FrameSource;

/// Takes a copy of every frame: a file, a buffer, a closure.
pub trait Recorder<T> {
    /// Why a frame could not be recorded.
    type Error;

    /// Records one frame.
    ///
    /// # Errors
    /// Whatever the recorder's file or buffer reports.
    fn record(&mut self, frame: &T) -> Result<(), Self::Error>;
}

impl<T, E, F: FnMut(&T) -> Result<(), E>> Recorder<T> for F {
    type Error = E;

    fn record(&mut self, frame: &T) -> Result<(), E> {
        self(frame)
    }
}

/// Which side of a recorded source failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordError<S, R> {
    /// The source gave no frame.
    Source(S),
    /// The frame was read but not recorded; it is lost.
    Recorder(R),
}

impl<S: core::fmt::Display, R: core::fmt::Display> core::fmt::Display for RecordError<S, R> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Source(error) => write!(f, "no frame: {error}"),
            Self::Recorder(error) => write!(f, "frame not recorded: {error}"),
        }
    }
}

impl<S, R> core::error::Error for RecordError<S, R>
where
    S: core::error::Error + 'static,
    R: core::error::Error + 'static,
{
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Source(error) => Some(error),
            Self::Recorder(error) => Some(error),
        }
    }
}

/// Records what a source gives.
#[derive(Clone, Debug)]
pub struct Recorded<S, R> {
    source: S,
    recorder: R,
}

impl<S, R> Recorded<S, R> {
    /// Wraps a source.
    pub const fn new(source: S, recorder: R) -> Self {
        Self { source, recorder }
    }

    /// The source and the recorder.
    pub fn into_parts(self) -> (S, R) {
        (self.source, self.recorder)
    }
}

impl<S: FrameSource, R: Recorder<S::Frame>> FrameSource for Recorded<S, R> {
    type Frame = S::Frame;
    type Error = RecordError<S::Error, R::Error>;

    fn next_frame(&mut self) -> Result<Option<S::Frame>, Self::Error> {
        let Some(frame) = self.source.next_frame().map_err(RecordError::Source)? else {
            return Ok(None);
        };
        self.recorder
            .record(&frame)
            .map_err(RecordError::Recorder)?;
        Ok(Some(frame))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::source::SliceSource;
    use core::convert::Infallible;
    use std::vec::Vec;

    #[test]
    fn the_record_holds_every_frame_that_was_handed_on() {
        let mut kept = Vec::new();
        let recorder = |frame: &u8| {
            kept.push(*frame);
            Ok::<(), Infallible>(())
        };
        let mut source = Recorded::new(SliceSource::new(&[3, 1, 4]), recorder);
        let mut given = Vec::new();
        while let Ok(Some(frame)) = source.next_frame() {
            given.push(frame);
        }
        assert_eq!((kept, given), ([3, 1, 4].to_vec(), [3, 1, 4].to_vec()));
    }

    #[test]
    fn a_recorder_that_fails_is_named() {
        let full = |_: &u8| Err("disk full");
        let mut source = Recorded::new(SliceSource::new(&[1u8]), full);
        assert_eq!(source.next_frame(), Err(RecordError::Recorder("disk full")));
    }
}
