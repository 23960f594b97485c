//! What `seal` puts into the built image: the check of the program, and the key of the stage. Both are read in flash.

use core::slice;
use crc::{CRC_32_ISO_HDLC, Crc};
use hal_adapters::can::status::{bit, board_check};
use hal_adapters::can::update::Key;
use stm32f4xx_hal::pac::__INTERRUPTS;

/// As `gzip` computes it.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Words of the vector table before the interrupts.
const VECTORS: usize = 16;

/// Erased bytes stand for nothing.
#[repr(C)]
struct Seal {
    crc: u32,
    key: Key,
}

// By assembler: the compiler must not compute with the erased bytes.
core::arch::global_asm!(
    ".section .seal, \"a\", %progbits",
    ".balign 4",
    ".global _seal",
    "_seal: .fill 5, 4, -1",
    ".text",
);

unsafe extern "C" {
    static _seal: Seal;
    static __vector_table: u8;
    static __stext: u8;
    static __erodata: u8;
    static __sidata: u8;
    static __sdata: u8;
    static __edata: u8;
}

fn seal() -> &'static Seal {
    // SAFETY: words of the flash, which no code writes.
    unsafe { &_seal }
}

/// The key of the stage. Without a key every sender on the bus may replace the parameters while the servo is off.
pub fn key() -> Option<&'static Key> {
    Some(&seal().key).filter(|key| **key != [0xff; 16])
}

/// Whether the program in flash differs from its check.
pub fn program_has_changed() -> bool {
    let mut digest = CRC.digest();
    // SAFETY: sections of the flash, as the linker has placed them.
    unsafe {
        let bytes = |from: *const u8, to: *const u8| to.addr() - from.addr();
        let vectors = VECTORS * size_of::<usize>() + size_of_val(&__INTERRUPTS);
        for (start, length) in [
            (&raw const __vector_table, vectors),
            (
                &raw const __stext,
                bytes(&raw const __stext, &raw const __erodata),
            ),
            (
                &raw const __sidata,
                bytes(&raw const __sdata, &raw const __edata),
            ),
        ] {
            digest.update(slice::from_raw_parts(start, length));
        }
    }
    seal().crc != u32::MAX && seal().crc != digest.finalize()
}

/// Bits of [`board_check`]: what the image lacks.
pub fn checks() -> u32 {
    bit(board_check::NO_KEY, key().is_none()) | bit(board_check::NOT_SEALED, seal().crc == u32::MAX)
}
