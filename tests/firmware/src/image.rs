//! The program as an ELF file: its bytes in flash and its symbols.

use object::read::elf::{FileHeader, ProgramHeader};
use object::{Object, ObjectSymbol};
use std::ops::Range;
use std::path::Path;

/// Start of flash.
pub const FLASH: u32 = 0x0800_0000;
/// Bytes of flash.
pub const FLASH_BYTES: usize = 1 << 20;
/// Start of RAM.
pub const RAM: u32 = 0x2000_0000;
/// Bytes of RAM.
pub const RAM_BYTES: usize = 128 << 10;

/// A program.
pub struct Image {
    /// Flash after flashing onto an erased chip.
    pub flash: Vec<u8>,
    /// Bytes of flash that the program takes: code, constants, initial values.
    pub text_bytes: usize,
    /// Bytes of RAM that its statics take.
    pub static_bytes: usize,
    /// Bytes of RAM below its statics, where the stack lies.
    pub stack_bytes: usize,
    symbols: Vec<(String, Range<u32>)>,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Panics
    /// If it is no program for this chip.
    pub fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("an image");
        let elf =
            object::elf::FileHeader32::<object::Endianness>::parse(&*bytes).expect("an ELF file");
        let endian = elf.endian().expect("an ELF file");
        let mut flash = vec![0xff; FLASH_BYTES];
        let (mut text_bytes, mut static_end) = (0, RAM);
        for segment in elf.program_headers(endian, &*bytes).expect("segments") {
            if segment.p_type(endian) != object::elf::PT_LOAD {
                continue;
            }
            let data = segment.data(endian, &*bytes).expect("its bytes");
            let (load, run) = (segment.p_paddr(endian), segment.p_vaddr(endian));
            if !data.is_empty() {
                flash[(load - FLASH) as usize..][..data.len()].copy_from_slice(data);
                text_bytes += data.len();
            }
            if run >= RAM {
                static_end = static_end.max(run + segment.p_memsz(endian));
            }
        }
        let file = object::File::parse(&*bytes).expect("an ELF file");
        let symbols = file
            .symbols()
            .filter_map(|s| {
                let start = s.address() as u32 & !1;
                Some((s.name().ok()?.to_owned(), start..start + s.size() as u32))
            })
            .collect();
        let mut static_start = RAM;
        if let Some(symbol) = file.symbols().find(|s| s.name() == Ok("_stack_start")) {
            static_start = symbol.address() as u32;
        }
        let static_bytes = static_end.saturating_sub(static_start) as usize;
        Self {
            flash,
            text_bytes,
            static_bytes,
            stack_bytes: (static_start - RAM) as usize,
            symbols,
        }
    }

    /// Address of the symbol with `part` in its name, without the Thumb bit.
    pub fn address(&self, part: &str) -> u32 {
        self.range(part).expect(part).start
    }

    /// Addresses of the function or static with `part` in its name, without the Thumb bit.
    pub fn range(&self, part: &str) -> Option<Range<u32>> {
        let exact = self.symbols.iter().find(|(name, _)| name == part);
        let found = exact.or_else(|| self.symbols.iter().find(|(name, _)| name.contains(part)));
        found.map(|(_, range)| range.clone())
    }

    /// A word of flash.
    pub fn word(&self, address: u32) -> u32 {
        let at = (address - FLASH) as usize;
        self.flash
            .get(at..at + 4)
            .map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }
}
