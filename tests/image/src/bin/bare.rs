//! The least that a controller links: a blob loaded from flash, the tick of a servo with
//! hold and re-zero. Its size is the size of the runtime in flash.
#![no_std]
#![no_main]

use core::hint::black_box;
use cortex_m_rt::entry;
use runtime::blob::MAX_BYTES;
use runtime::zero_offset::ZeroOffsetSettings;
use runtime::{OnInvalid, ParameterSet, PoseTracker, RawFrame};

extern crate image;

#[entry]
fn main() -> ! {
    let memory = black_box([0xff; MAX_BYTES]);
    if let Ok(set) = ParameterSet::from_flash(&memory)
        && set.expect_serial("HS-0007").is_ok()
    {
        let decoder = set.decoder();
        let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: 3 });
        tracker.start_zero_offset(ZeroOffsetSettings::default());
        loop {
            let frame = black_box(RawFrame::new([0; 3], [0; 3], 0, 0));
            black_box(tracker.tick(&frame));
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}
