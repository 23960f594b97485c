//! The parameter slots of `memory.x`.

unsafe extern "C" {
    static _parameter_slot_0: u8;
    static _parameter_slot_1: u8;
    static _parameter_slot_bytes: u8;
}

/// The bytes of both slots.
pub fn parameter_slots() -> [&'static [u8]; 2] {
    // SAFETY: the linker's script gives the addresses and the length of two sectors of flash
    // that hold nothing else and that this program never writes; only the addresses of these
    // symbols are used.
    unsafe {
        let bytes = &raw const _parameter_slot_bytes as usize;
        [
            core::slice::from_raw_parts(&raw const _parameter_slot_0, bytes),
            core::slice::from_raw_parts(&raw const _parameter_slot_1, bytes),
        ]
    }
}
