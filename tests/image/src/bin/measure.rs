#![no_std]
#![no_main]
use core::hint::black_box;
use cortex_m_rt::entry;
use runtime::decoder::{Decoder, DecoderConstants, Reading};
use runtime::frame::{CodeWindow, RawFrame};
use runtime::model::{Sensitivity, planar_pose, sensitivity_at};
use runtime::{PlanarPose, Servo, OnInvalid, VerticalPose};

unsafe extern "C" { fn a_panic_can_be_reached() -> !; }
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! { unsafe { a_panic_can_be_reached() } }

#[repr(C)]
#[derive(Clone, Copy)]
pub struct Signal([f32; 3]);

#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn measured_kernel_by_value(c: &DecoderConstants<f32>, s: Signal, v: VerticalPose<f32>, zero: PlanarPose<f32>) -> PlanarPose<f32> {
    let phi = [
        sensitivity_at(&c.sensitivity[0], &v),
        sensitivity_at(&c.sensitivity[1], &v),
        sensitivity_at(&c.sensitivity[2], &v),
    ];
    planar_pose(&c.planar_per_code, s.0, phi, &zero)
}
#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn measured_kernel(c: &DecoderConstants<f32>, s: &Signal, v: &VerticalPose<f32>, zero: &PlanarPose<f32>, out: &mut PlanarPose<f32>) {
    let phi = [
        sensitivity_at(&c.sensitivity[0], v),
        sensitivity_at(&c.sensitivity[1], v),
        sensitivity_at(&c.sensitivity[2], v),
    ];
    *out = planar_pose(&c.planar_per_code, s.0, phi, zero)
}
#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn measured_tick(d: &Decoder, f: &RawFrame, zero: &PlanarPose<f32>, out: &mut Reading) {
    d.decode_into(&f.hall, &f.capacitive, zero, out);
}
#[unsafe(no_mangle)]
#[inline(never)]
pub extern "C" fn measured_servo(s: &mut Servo<'_>, f: &RawFrame, out: &mut Reading) {
    *out = s.tick(f);
}

fn constants() -> DecoderConstants<f32> {
    DecoderConstants {
        vertical_per_code: [[1e-9, 2e-9, 3e-9]; 3],
        sensitivity: [Sensitivity { eta: 0.8, per_z_m: -100., per_rx_rad: 20., per_ry_rad: 30. }; 3],
        planar_per_code: [[1e-9, 2e-9, 3e-9]; 3],
        calibrated_vertical: [1e-3; 3],
        calibrated_planar: [1e-3; 3],
        sensitivity_min: 0.1,
        hall_window: CodeWindow { low: -32767, high: 32766 },
        capacitive_window: CodeWindow { low: -32767, high: 32766 },
    }
}

#[entry]
fn main() -> ! {
    let d = Decoder::new(black_box(constants()));
    let f = black_box(RawFrame { hall: [1000, 2000, 3000], capacitive: [100, 200, 300], sequence: 1, time_us: 2 });
    let mut r = Reading::default();
    measured_tick(black_box(&d), &f, &PlanarPose::ZERO, &mut r);
    black_box(&r);
    let mut p = PlanarPose::ZERO;
    measured_kernel(black_box(d.constants()), &Signal([1., 2., 3.]), &VerticalPose::ZERO, &PlanarPose::ZERO, &mut p);
    black_box(&p);
    let p = measured_kernel_by_value(black_box(d.constants()), Signal([1., 2., 3.]), VerticalPose::ZERO, PlanarPose::ZERO);
    black_box(&p);
    let mut s = Servo::new(&d, OnInvalid::Hold { ticks: 3 });
    measured_servo(black_box(&mut s), &f, &mut r);
    black_box(&r);
    cortex_m_semihosting::debug::exit(cortex_m_semihosting::debug::EXIT_SUCCESS);
    loop {}
}
