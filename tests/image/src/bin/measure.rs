//! Runs the pose kernel and the tick over many inputs, for an emulator's log of executed
//! instructions to be counted, and prints the stack that each has touched.
//!
//! One call of each function `counted_*` is counted, from its first instruction to its return. `counted_loop_1000` is a check of the counting: its
//! length is known.
#![no_std]
#![no_main]

use core::array::from_fn;
use core::fmt::Write;
use core::hint::black_box;
use cortex_m_rt::entry;
use hal_adapters::can::{Coded, Layout, Message, SensorReceiver, Timing, sensor};
use image::job;
use image::semihost::{CONSOLE, File, exit};
use runtime::decoder::Decoder;
use runtime::model::{FieldProbe, Sensitivity};
use runtime::{
    AnyDecoder, CommandedMotion, Decode, FieldModel, LinearModel, Model, MotionCorrection,
    OnInvalid, ParameterSet, PlanarPose, PoseTracker, Predictor, RawFrame, Reading, VerticalPose,
};

const MODEL_31: &[u8] = include_bytes!("../../../../runtime/examples/stage.bin");
const FIELD_MODEL: &[u8] = include_bytes!("../../../../runtime/examples/field.bin");

/// Without FPU a tick takes up to 80 times as long in the emulator.
const ROUNDS: u32 = if cfg!(target_abi = "eabihf") { 300 } else { 40 };

/// Displacements read by the probes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Signal([f32; 3], [f32; 3]);

/// What the pose kernel reads of a calibration.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Kernel {
    planar_per_code: [[f32; 3]; 3],
    probes: [Sensitivity<f32>; 3],
}

/// The pose kernel, Model (31): three sensitivities, three quotients, X, Y, Rz.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn counted_kernel(
    c: &Kernel,
    signal: &Signal,
    vertical: &VerticalPose<f32>,
    zero: &PlanarPose<f32>,
    pose: &mut PlanarPose<f32>,
) {
    let rows = &c.planar_per_code;
    (_, *pose) = LinearModel::planar_pose(&c.probes, rows, signal.0, signal.1, vertical, zero);
}

#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn counted_tick(
    decoder: &Decoder<LinearModel>,
    frame: &RawFrame,
    zero: &PlanarPose<f32>,
    reading: &mut Reading,
) {
    *reading = decoder.decode(frame, zero);
}

/// What the pose kernel of the field model reads of a calibration.
struct FieldKernel {
    planar_per_code: [[f32; 3]; 3],
    probes: [FieldProbe<f32>; 3],
}

/// The pose kernel of the field model.
#[unsafe(no_mangle)]
#[inline(never)]
fn counted_field_kernel(
    c: &FieldKernel,
    signal: &Signal,
    vertical: &VerticalPose<f32>,
    zero: &PlanarPose<f32>,
    pose: &mut PlanarPose<f32>,
) {
    let rows = &c.planar_per_code;
    (_, *pose) = FieldModel::planar_pose(&c.probes, rows, signal.0, signal.1, vertical, zero);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn counted_field_tick(
    decoder: &Decoder<FieldModel>,
    frame: &RawFrame,
    zero: &PlanarPose<f32>,
    reading: &mut Reading,
) {
    *reading = decoder.decode(frame, zero);
}

#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn counted_servo_tick(
    tracker: &mut PoseTracker<&dyn Decode>,
    frame: &RawFrame,
    reading: &mut Reading,
) {
    *reading = tracker.tick(frame);
}

/// What a prediction adds to a servo's tick: the pose taken, and one predicted.
#[unsafe(no_mangle)]
#[inline(never)]
fn counted_prediction(
    predictor: &mut Predictor,
    tracker: &PoseTracker<&dyn Decode>,
    frame: &RawFrame,
    reading: &Reading,
) -> Option<PlanarPose<f32>> {
    predictor.take(tracker, frame, reading);
    predictor.pose_at(frame.time_us.wrapping_add(300))
}

/// The pose without the errors that follow the commanded motion.
#[unsafe(no_mangle)]
#[inline(never)]
fn counted_motion(
    correction: &MotionCorrection,
    pose: &PlanarPose<f32>,
    commanded: &CommandedMotion,
    corrected: &mut Option<PlanarPose<f32>>,
) {
    *corrected = correction.correct(*pose, commanded);
}

/// Codes the two bus frames of a tick (16-bit layout).
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn counted_can_code(frame: &RawFrame, coded: &mut [Coded; 2]) {
    *coded = sensor::frames_16(frame);
}

/// Checks them and puts the tick together, in sequence; gives whether it is whole.
#[unsafe(no_mangle)]
#[inline(never)]
extern "C" fn counted_can_check(
    receiver: &mut SensorReceiver,
    [first, second]: &[Coded; 2],
    now_us: u32,
    frame: &mut RawFrame,
) -> bool {
    const HALL: u16 = Message::Hall.spec().id;
    const CAPACITIVE: u16 = Message::Capacitive.spec().id;
    receiver.take_data(HALL, &first.bytes, now_us);
    let taken = receiver.take_data(CAPACITIVE, &second.bytes, now_us);
    match taken.tick {
        Some(tick) => {
            *frame = tick;
            true
        }
        None => false,
    }
}

#[cfg(c_reference)]
#[allow(improper_ctypes)] // repr(C) structs of numbers; Status is transparent
unsafe extern "C" {
    fn counted_c_kernel(
        c: &Kernel,
        signal: &Signal,
        vertical: &VerticalPose<f32>,
        zero: &PlanarPose<f32>,
        pose: &mut PlanarPose<f32>,
    );
    fn counted_c_tick(
        decoder: &Decoder<LinearModel>,
        frame: &RawFrame,
        zero: &PlanarPose<f32>,
        reading: &mut Reading,
    );
}

// A loop of 3 + 1000 * 3 instructions.
core::arch::global_asm!(
    ".global counted_loop_1000",
    ".type counted_loop_1000, %function",
    ".thumb_func",
    "counted_loop_1000:",
    "ldr r0, =1000",
    "2:",
    "nop",
    "subs r0, #1",
    "bne 2b",
    "nop",
    "bx lr",
    ".size counted_loop_1000, . - counted_loop_1000",
    ".ltorg",
);

unsafe extern "C" {
    fn counted_loop_1000();
}

/// Bytes below the stack pointer that are painted, above those that painting itself uses.
const PAINTED: usize = 2048;
const PAINT: u32 = 0xa5a5_5a5a;

/// Paints the unused stack, runs `work`, and gives the bytes that it has touched.
#[inline(never)]
fn touched(work: impl FnOnce()) -> usize {
    let top = cortex_m::register::msp::read() as usize;
    let cells = |k: usize| (top - 4 * (k + 1)) as *mut u32;
    for k in 0..PAINTED / 4 {
        // SAFETY: below the stack pointer of this function, which calls nothing meanwhile, lies
        // nothing but unused stack; no interrupt is enabled.
        unsafe { cells(k).write_volatile(PAINT) };
    }
    work();
    // SAFETY: as above; reads what was painted.
    let clean = (0..PAINTED / 4)
        .rev()
        .take_while(|&k| unsafe { cells(k).read_volatile() } == PAINT);
    PAINTED - 4 * clean.count()
}

/// What the check of arithmetic says with FPSCR set to `settings`.
#[cfg(target_abi = "eabihf")]
fn check_with(settings: u32) -> Result<(), runtime::arithmetic::ArithmeticFault> {
    let set = |fpscr: u32| {
        // SAFETY: writes a register of the FPU; not `pure`, so it stays before and after
        // the check; its operands pass through memory.
        unsafe { core::arch::asm!("vmsr fpscr, {}", in(reg) fpscr, options(nostack)) }
    };
    set(settings);
    let found = runtime::arithmetic::check();
    set(0);
    found
}

/// There is none to be set.
#[cfg(not(target_abi = "eabihf"))]
fn wrong_settings_are_found() -> bool {
    true
}

/// Whether the check of arithmetic finds each setting of the FPU that would change results.
#[cfg(target_abi = "eabihf")]
fn wrong_settings_are_found() -> bool {
    use runtime::arithmetic::ArithmeticFault;
    let rounding = Err(ArithmeticFault::RoundingChanged);
    check_with(0).is_ok()
        && check_with(1 << 24) == Err(ArithmeticFault::SubnormalsLost)
        && (1..=3).all(|mode| check_with(mode << 22) == rounding)
}

/// A plain pseudo-random sequence (xorshift).
struct Words(u32);

impl Words {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Codes of 16 bits, or of any in each fourth round.
    fn codes(&mut self, round: u32) -> RawFrame {
        job::frame(from_fn(|_| match round % 4 {
            3 => self.next(),
            _ => (self.next() as i32 >> 16) as u32,
        }))
    }
}

/// The decoder of a blob.
fn decoder(blob: &[u8]) -> AnyDecoder {
    match ParameterSet::from_bytes(blob) {
        Ok(set) => set.decoder(),
        Err(_) => exit(false),
    }
}

#[entry]
fn main() -> ! {
    let (Ok(mut console), AnyDecoder::Linear(decoder), AnyDecoder::Field(field)) = black_box((
        File::write_to(CONSOLE),
        decoder(MODEL_31),
        decoder(FIELD_MODEL),
    )) else {
        exit(false)
    };
    let zero = black_box(PlanarPose::ZERO);
    let mut words = Words(0x1234_5678);
    let mut reading = Reading::default();
    // SAFETY: the loop above, which touches r0 and the flags.
    unsafe { counted_loop_1000() };
    let kernel = Kernel {
        planar_per_code: decoder.constants().planar_per_code,
        probes: *decoder.probes(),
    };
    let field_kernel = FieldKernel {
        planar_per_code: field.constants().planar_per_code,
        probes: *field.probes(),
    };
    for round in 0..ROUNDS {
        let frame = black_box(words.codes(round));
        let signal = Signal(frame.hall.map(|code| code as f32), [0.0; 3]);
        let vertical = VerticalPose::from_array(frame.capacitive.map(|code| code as f32 * 1e-8));
        let mut pose = PlanarPose::ZERO;
        counted_kernel(&kernel, &signal, &vertical, &zero, &mut pose);
        black_box(&pose);
        counted_tick(&decoder, &frame, &zero, &mut reading);
        black_box(&reading);
        #[cfg(c_reference)]
        // SAFETY: structs of the same layout, as the C file declares them.
        unsafe {
            counted_c_kernel(&kernel, &signal, &vertical, &zero, &mut pose);
            counted_c_tick(&decoder, &frame, &zero, &mut reading);
        }
        counted_field_kernel(&field_kernel, &signal, &vertical, &zero, &mut pose);
        black_box(&pose);
        counted_field_tick(&field, &frame, &zero, &mut reading);
        black_box(&reading);
        let mut number = |_| words.next() as i32 as f32 * 1e-15;
        let correction = MotionCorrection {
            acceleration_s2: [(); 3].map(|()| [0; 6].map(&mut number)),
            velocity_s: [(); 3].map(|()| [0; 3].map(&mut number)),
        };
        let commanded = CommandedMotion {
            velocity: [0; 3].map(&mut number),
            acceleration: [0; 6].map(&mut number),
        };
        let mut corrected = None;
        counted_motion(&correction, &pose, &commanded, &mut corrected);
        black_box(corrected);
    }
    let mut tracker = PoseTracker::new(&decoder as &dyn Decode, OnInvalid::Hold { ticks: 3 });
    let mut predictor = Predictor::new(4_000);
    let mut frame = RawFrame::new([900, -800, 700], [50, 60, 70], 0, 0);
    for k in 0..100 {
        frame.sequence += 1 + u32::from(k % 7 == 0);
        frame.hall[0] = if k % 5 == 0 { i32::MIN } else { 900 };
        frame.time_us += 2_000;
        counted_servo_tick(&mut tracker, black_box(&frame), &mut reading);
        black_box(counted_prediction(
            &mut predictor,
            &tracker,
            &frame,
            &reading,
        ));
    }
    let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
    let mut coded = sensor::frames_16(&frame);
    // The first tick starts the sequence; from then on every frame is due.
    for first in sensor::frames_16(&RawFrame {
        sequence: 0,
        ..frame
    }) {
        receiver.take_data(first.message.id().as_raw(), &first.bytes, 0);
    }
    for k in 1..100 {
        let mut sent = words.codes(0);
        sent.sequence = k;
        counted_can_code(black_box(&sent), &mut coded);
        counted_can_check(&mut receiver, black_box(&coded), 2000 * k, &mut sent);
        black_box(&sent);
    }
    let base = touched(|| ());
    let tick = touched(|| counted_tick(&decoder, &frame, &PlanarPose::ZERO, &mut reading));
    let field_tick =
        touched(|| counted_field_tick(&field, &frame, &PlanarPose::ZERO, &mut reading));
    frame.sequence += 1;
    let servo_tick = touched(|| counted_servo_tick(&mut tracker, &frame, &mut reading));
    let stacks = [
        ("tick", tick),
        ("field_tick", field_tick),
        ("servo_tick", servo_tick),
    ];
    let printed = stacks.into_iter().try_for_each(|(name, bytes)| {
        writeln!(console, "RESULT painted_stack_{name}={}", bytes - base)
    });
    let found = wrong_settings_are_found();
    let printed = printed.and_then(|()| writeln!(console, "wrong FPU settings found: {found}"));
    exit(printed.is_ok() && found && image::fpu_at_reset())
}
