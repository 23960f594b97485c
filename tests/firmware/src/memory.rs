//! Memory that the emulated core sees.

/// Bytes that begin at a page.
#[repr(C, align(4096))]
pub struct Memory<const N: usize>(pub [u8; N]);

impl<const N: usize> Default for Memory<N> {
    fn default() -> Self {
        Self([0; N])
    }
}
