//! Temperatures from the thermometers to the pose: the host's words at the temperatures on the bus, and the
//! mark of every pose with a broken thermometer.

use super::no_resets;
use super::parameters::for_stage_7;
use super::start::tick_now;
use crate::adc_model::thermometers::Wiring;
use crate::bench::{Bench, Seen, Words};
use hal_adapters::can::status::board_check;
use runtime::frame::MISSING_CODE;
use runtime::{ParameterSet, Status};

/// A blob with temperature terms, for about 20.1 and 21.3 degC.
const WARM: &[u8] = include_bytes!("../../../../runtime/examples/warm.bin");
/// Ticks from a change of temperature until it is read and in the poses.
const READ: u64 = 52;
/// Ticks of each step: a page of health comes once in 192.
const TICKS: u64 = 400;

/// Poses follow the temperatures of the stage. An open or shorted thermometer is missing, and back when it is
/// mended.
pub fn follow_the_stage(bench: &Bench) {
    let (blob, set) = for_stage_7(WARM);
    let mut machine = bench.machine([&blob, &[]]);
    let mut worst_mk = 0;
    let mut words = 0;
    let sound = [Wiring::Sound; 2];
    for (celsius, wiring) in [
        ([24.3, 26.1], sound),
        ([21.0, 19.5], sound),
        ([33.2, 30.0], sound),
        ([33.2, 30.0], [Wiring::Open, Wiring::Sound]),
        ([33.2, 30.0], [Wiring::Sound, Wiring::Open]),
        ([33.2, 30.0], [Wiring::Shorted, Wiring::Shorted]),
        ([22.0, 23.0], sound),
    ] {
        machine.chip.adc.thermometers.celsius = celsius;
        machine.chip.adc.thermometers.wiring = wiring;
        let first = tick_now(&machine);
        let what = format!("{celsius:?} {wiring:?}");
        let seen = Seen::after(&mut machine, TICKS);
        words += same_words(bench, &set, &seen, &what);
        let (_, last_mc) = *seen.temperatures.last().expect("no temperatures");
        for k in 0..2 {
            if wiring[k] != Wiring::Sound {
                assert_eq!(last_mc[k], MISSING_CODE, "{what}");
                continue;
            }
            let off_mk = (f64::from(last_mc[k]) - 1e3 * celsius[k]).abs() as i32;
            worst_mk = worst_mk.max(off_mk);
            assert!(off_mk <= 60, "{what}: {last_mc:?}");
        }
        let is_missing = wiring != sound;
        let late = seen.axes.iter().filter(|axis| axis.tick > first + READ);
        let marked = late.clone().filter(|axis| axis.status & MARK != 0).count();
        let wanted = if is_missing { late.count() } else { 0 };
        assert_eq!(marked, wanted, "{what}: words that are marked");
        let checks = seen.page(11).expect("no page 11");
        assert_eq!(
            checks & board_check::TEMPERATURE_MISSING != 0,
            is_missing,
            "{what}: page 11"
        );
    }
    println!("RESULT firmware_temperature_off_max_mk={worst_mk}");
    println!("RESULT firmware_temperature_words={words}");
    no_resets(&machine);
}

/// The bit of a valid pose on the bus with a missing temperature.
const MARK: u32 = Status::TEMPERATURE_MISSING.bits();

/// The words equal the host's words at the last temperatures on the bus. Returns their number.
fn same_words(bench: &Bench, set: &ParameterSet, seen: &Seen, what: &str) -> u64 {
    let decoder = set.decoder();
    let mut words = 0;
    for axis in &seen.axes {
        let sent = seen.temperatures.iter().rev();
        let Some((_, temperature_mc)) = sent.clone().find(|(tick, _)| *tick <= axis.tick) else {
            // Before the first frame since the last step.
            continue;
        };
        let row = bench.rows[axis.tick as usize % bench.rows.len()];
        let want = Words::decoded(&decoder, row, *temperature_mc);
        assert!(axis.equals(&want), "{what}: {axis:?}, not {want:?}");
        words += 1;
    }
    assert!(words > 3 * (TICKS - READ), "{what}: only {words} words");
    words
}
