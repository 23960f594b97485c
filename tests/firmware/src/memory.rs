//! Memory that the emulated core sees.

/// Bytes that begin at a page.
#[repr(C, align(4096))]
pub struct Memory<const N: usize>(pub [u8; N]);

/// Memory full of one byte, made where it stays: it may be larger than the stack.
pub fn memory<const N: usize>(fill: u8) -> Box<Memory<N>> {
    let filled = vec![fill; N].into_boxed_slice();
    let layout = std::alloc::Layout::new::<Memory<N>>();
    // SAFETY: the memory is allocated with the layout of the type and filled before it is used.
    unsafe {
        let raw = std::alloc::alloc(layout).cast::<Memory<N>>();
        assert!(!raw.is_null(), "no memory for the emulated chip");
        std::ptr::copy_nonoverlapping(filled.as_ptr(), raw.cast(), N);
        Box::from_raw(raw)
    }
}
