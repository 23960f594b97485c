//! What stands around the runtime in the examples of tasks: converters, coils, a timer.

use crate::semihost::exit;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use runtime::{BlobError, ParameterSet, PlanarPose, RawFrame};

/// The servo period, us.
pub const PERIOD_US: u32 = 2_000;

/// From the sample to the change of the forces, us.
pub const FORCES_US: u32 = 300;

/// The parameters of the shipped stage; a controller reads them from its flash by `ParameterSet::from_flash`.
///
/// # Errors
/// A blob that is refused.
pub fn parameters() -> Result<ParameterSet, BlobError> {
    ParameterSet::from_bytes(include_bytes!("../../../runtime/examples/stage.bin"))
}

/// A tick every servo period, of a core at 25 MHz.
pub fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(25 * PERIOD_US - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

/// Codes of a stage that moves evenly along X.
pub const fn converters(period: u32) -> RawFrame {
    RawFrame::new(
        [120, 90, 70 + 160 * (period as i32)],
        [300, -200, 100],
        period,
        PERIOD_US.wrapping_mul(period),
    )
}

/// Takes the pose that the forces answer. Ends in the twelfth period, well if there is a pose.
pub fn coils(period: u32, pose: Option<PlanarPose<f32>>) {
    if period == 11 {
        exit(pose.is_some_and(|pose| pose.x_m > 100e-6));
    }
}
