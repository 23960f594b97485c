//! Files and exit status of the host, through semihosting.

use core::ffi::CStr;
use cortex_m_semihosting::{debug, syscall};

/// A file of the host.
pub struct File(usize);

/// Why the host did not do it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The file cannot be opened.
    Open,
    /// Reading or writing stopped in the middle.
    Transfer,
}

/// The host's console.
pub const CONSOLE: &CStr = c":tt";

impl File {
    /// Opens a file to read bytes.
    pub fn read_from(name: &CStr) -> Result<Self, Fault> {
        Self::open(name, 1)
    }

    /// Creates a file, or empties it, to write bytes.
    pub fn write_to(name: &CStr) -> Result<Self, Fault> {
        Self::open(name, 5)
    }

    fn open(name: &CStr, mode: usize) -> Result<Self, Fault> {
        // SAFETY: the host reads the name, which outlives the call.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.count_bytes()) };
        if handle == usize::MAX {
            return Err(Fault::Open);
        }
        Ok(Self(handle))
    }

    /// Fills `bytes` with the next ones of the file; `false` if the file has ended before.
    pub fn read(&self, bytes: &mut [u8]) -> Result<bool, Fault> {
        // SAFETY: the host writes at most `len` bytes into the slice.
        let left = unsafe { syscall!(READ, self.0, bytes.as_mut_ptr(), bytes.len()) };
        match left {
            0 => Ok(true),
            left if left == bytes.len() => Ok(false),
            _ => Err(Fault::Transfer),
        }
    }

    /// Appends the bytes.
    pub fn write(&self, bytes: &[u8]) -> Result<(), Fault> {
        // SAFETY: the host reads `len` bytes of the slice.
        let left = unsafe { syscall!(WRITE, self.0, bytes.as_ptr(), bytes.len()) };
        if left == 0 {
            Ok(())
        } else {
            Err(Fault::Transfer)
        }
    }
}

impl core::fmt::Write for File {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        self.write(text.as_bytes()).map_err(|_| core::fmt::Error)
    }
}

/// Ends the run with exit status 0, or 1.
pub fn exit(good: bool) -> ! {
    debug::exit(if good {
        debug::EXIT_SUCCESS
    } else {
        debug::EXIT_FAILURE
    });
    loop {
        cortex_m::asm::wfi();
    }
}
