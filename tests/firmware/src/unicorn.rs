//! The few functions of the emulator Unicorn 2.1 that the bench calls, found in its library at
//! run time.

use libloading::Library;
use std::ffi::{OsStr, c_int, c_uint, c_void};

/// Handle of an emulator, as its callbacks get it.
pub type Handle = *mut c_void;
/// Gives the value of a register of a peripheral: handle, offset, bytes, user data.
pub type ReadCallback = extern "C" fn(Handle, u64, c_uint, *mut c_void) -> u64;
/// Takes the value of a register of a peripheral: handle, offset, bytes, value, user data.
pub type WriteCallback = extern "C" fn(Handle, u64, c_uint, u64, *mut c_void);
/// Called before an instruction: handle, address, bytes, user data.
pub type CodeCallback = extern "C" fn(Handle, u64, u32, *mut c_void);

/// Registers by the library's numbers.
pub mod register {
    /// FPSCR.
    pub const FPSCR: i32 = 6;
    /// Link register.
    pub const LR: i32 = 10;
    /// Program counter.
    pub const PC: i32 = 11;
    /// Stack pointer.
    pub const SP: i32 = 12;
    /// R0; R1 to R3 follow.
    pub const R0: i32 = 66;
    /// R12.
    pub const R12: i32 = 78;
    /// S0; S1 to S15 follow.
    pub const S0: i32 = 79;
    /// Program status.
    pub const XPSR: i32 = 120;
}

const ARCH_ARM: c_int = 1;
const MODE_THUMB_MCLASS: c_int = 16 | 32;
const CORTEX_M4: c_int = 9;
/// Write one argument: the CPU model.
const CTL_WRITE_CPU_MODEL: c_uint = 7 | 1 << 26 | 1 << 30;
const HOOK_CODE: c_int = 4;
const PROT_ALL: u32 = 7;

type Open = unsafe extern "C" fn(c_int, c_int, *mut Handle) -> c_int;
type Ctl = unsafe extern "C" fn(Handle, c_uint, ...) -> c_int;
type Close = unsafe extern "C" fn(Handle) -> c_int;
/// Reads or writes a register: handle, number, value.
pub type Register = unsafe extern "C" fn(Handle, c_int, *mut c_void) -> c_int;
type MapPointer = unsafe extern "C" fn(Handle, u64, u64, u32, *mut c_void) -> c_int;
type MapIo = unsafe extern "C" fn(
    Handle,
    u64,
    u64,
    ReadCallback,
    *mut c_void,
    WriteCallback,
    *mut c_void,
) -> c_int;
type Start = unsafe extern "C" fn(Handle, u64, u64, u64, usize) -> c_int;
/// Ends a run from within a callback: handle.
pub type Stop = unsafe extern "C" fn(Handle) -> c_int;
type HookAdd = unsafe extern "C" fn(
    Handle,
    *mut usize,
    c_int,
    *mut c_void,
    *mut c_void,
    u64,
    u64,
    ...
) -> c_int;

/// An emulated core.
pub struct Unicorn {
    handle: Handle,
    close: Close,
    read: Register,
    /// Sets a register, also from within a callback.
    pub write: Register,
    map_pointer: MapPointer,
    map_io: MapIo,
    start: Start,
    /// Ends a run from within a callback.
    pub stop: Stop,
    hook_add: HookAdd,
    _library: Library,
}

/// What cannot fail on a sound installation.
fn check(what: &str, number: c_int) {
    assert_eq!(number, 0, "the emulator: {what}");
}

/// A function of the library.
///
/// # Safety
/// It must have the type.
unsafe fn function<F: Copy>(library: &Library, name: &[u8]) -> F {
    // SAFETY: as the caller promises.
    *unsafe { library.get(name) }.expect("a function of Unicorn 2.1")
}

impl Unicorn {
    /// A Cortex-M4 with FPU, from the library at `path`.
    pub fn open(path: &OsStr) -> Self {
        // SAFETY: the library is Unicorn 2.1, and the types above repeat the declarations of its `unicorn.h`.
        unsafe {
            let library = Library::new(path).expect("the emulator's library");
            let open: Open = function(&library, b"uc_open");
            let ctl: Ctl = function(&library, b"uc_ctl");
            let mut handle = std::ptr::null_mut();
            let ok = open(ARCH_ARM, MODE_THUMB_MCLASS, &mut handle);
            check("open", ok);
            let ok = ctl(handle, CTL_WRITE_CPU_MODEL, CORTEX_M4);
            check("model", ok);
            Self {
                handle,
                close: function(&library, b"uc_close"),
                read: function(&library, b"uc_reg_read"),
                write: function(&library, b"uc_reg_write"),
                map_pointer: function(&library, b"uc_mem_map_ptr"),
                map_io: function(&library, b"uc_mmio_map"),
                start: function(&library, b"uc_emu_start"),
                stop: function(&library, b"uc_emu_stop"),
                hook_add: function(&library, b"uc_hook_add"),
                _library: library,
            }
        }
    }

    /// The value of a register of the core.
    pub fn get(&self, register: i32) -> u32 {
        let mut value = 0u32;
        // SAFETY: every register used here has 32 bits.
        unsafe { (self.read)(self.handle, register, (&raw mut value).cast()) };
        value
    }

    /// Sets a register of the core.
    pub fn set(&self, register: i32, mut value: u32) {
        // SAFETY: as in `get`.
        unsafe { (self.write)(self.handle, register, (&raw mut value).cast()) };
    }

    /// Lets the core see `memory` at `address`.
    ///
    /// # Safety
    /// The memory must live as long as the emulator, and be touched only while it stands.
    pub unsafe fn map_memory(&self, address: u64, memory: *mut u8, bytes: usize) {
        // SAFETY: as the caller promises.
        let ok = unsafe {
            (self.map_pointer)(self.handle, address, bytes as u64, PROT_ALL, memory.cast())
        };
        check("map memory", ok);
    }

    /// Sends reads and writes of a range to callbacks.
    ///
    /// # Safety
    /// `user` must be what the callbacks take it for, as long as the emulator lives.
    pub unsafe fn map_io(
        &self,
        (address, bytes): (u64, u64),
        read: ReadCallback,
        write: WriteCallback,
        user: *mut c_void,
    ) {
        // SAFETY: as the caller promises.
        let ok = unsafe { (self.map_io)(self.handle, address, bytes, read, user, write, user) };
        check("map registers", ok);
    }

    /// Calls back before instructions from `first` to `last`.
    ///
    /// # Safety
    /// As [`Self::map_io`].
    pub unsafe fn hook_code(
        &self,
        callback: CodeCallback,
        user: *mut c_void,
        (first, last): (u64, u64),
    ) {
        let mut hook = 0;
        // SAFETY: as the caller promises.
        let ok = unsafe {
            (self.hook_add)(
                self.handle,
                &mut hook,
                HOOK_CODE,
                callback as *mut c_void,
                user,
                first,
                last,
            )
        };
        check("hook", ok);
    }

    /// Runs from `address` until `until`, a halt, or a fault, which has the library's number.
    pub fn run(&self, address: u32, until: u32) -> Result<(), c_int> {
        // SAFETY: the core is set up; callbacks only touch their own state.
        match unsafe { (self.start)(self.handle, u64::from(address | 1), until.into(), 0, 0) } {
            0 => Ok(()),
            fault => Err(fault),
        }
    }
}

impl Drop for Unicorn {
    fn drop(&mut self) {
        // SAFETY: nothing runs any more, and the handle is not used again.
        unsafe { (self.close)(self.handle) };
    }
}
