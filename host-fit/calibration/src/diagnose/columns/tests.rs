use super::*;
use hallstage_input::channels::columns;
use hallstage_input::dataset::Row;
use hallstage_input::finding::Code;
use hallstage_input::log::{self, ReadOptions};
use hallstage_input::shipped::{RUN_GZ, stage};
use hallstage_solver::estimator::paper::Parameters;

/// The faults of the shipped run with a fault in each row.
fn faults_of(fault: impl Fn(usize, &mut Row)) -> ColumnFaults {
    let stage = stage();
    let reading = log::read_bytes(RUN_GZ, "run.csv.gz".as_ref(), &stage, &ReadOptions::FIT);
    let mut dataset = reading.expect("a log").dataset;
    let rows = dataset.rows.iter_mut().enumerate();
    rows.for_each(|(k, row)| fault(k, row));
    let parameters = FieldParameters::from_model_31(&Parameters::designed(&stage), &stage);
    ColumnFaults::new(
        &columns(&dataset, &stage),
        &dataset,
        &stage,
        &parameters,
        [0.0; 3],
    )
}

/// The only finding: its code, channel and cost.
fn only(fault: impl Fn(usize, &mut Row)) -> (Code, Channel, Option<f64>) {
    let findings = faults_of(fault).findings;
    let [found] = &findings[..] else {
        panic!("{findings:#?}");
    };
    (found.code(), found.channels[0], found.cost)
}

#[test]
fn a_sound_log_has_no_finding() {
    let none = faults_of(|_, _| ());
    assert_eq!(none.findings, []);
    let short = faults_of(|k, row| row.movement = k / 5);
    assert_eq!(short.findings, []);
}

/// The noise of the probes is 8 codes. A bit of 32 codes adds a variance of 256, and one probe of three has it.
#[test]
fn a_missing_bit_costs_its_variance() {
    let stuck = |bit: u32| move |_: usize, row: &mut Row| row.frame.codes.hall[0] |= 1 << bit;
    let (code, channel, cost) = only(stuck(5));
    assert_eq!((code, channel), (Code::StuckBit, Channel::HallA));
    let cost = cost.expect("a cost");
    assert!(
        cost > 1.4 && cost < (1.0f64 + 256.0 / 64.0).sqrt(),
        "{cost}"
    );
    assert_eq!(
        faults_of(stuck(1)).findings,
        [],
        "two codes are below the noise"
    );
}

#[test]
fn steps_cost_the_variance_of_rounding_and_steps_of_a_beam_cast_doubt() {
    let coarse = |codes: i32| {
        move |_: usize, row: &mut Row| {
            row.frame
                .codes
                .hall
                .iter_mut()
                .for_each(|code| *code -= code.rem_euclid(codes));
        }
    };
    assert_eq!(faults_of(coarse(4)).findings, []);
    let found = faults_of(coarse(40)).findings;
    assert_eq!(found.len(), 3, "{found:?}");
    for found in found {
        let want = (1.0f64 + 40.0 * 40.0 / 12.0 / 64.0).sqrt();
        let cost = found.cost.expect("a cost");
        // Each probe alone makes a part of it.
        assert!(
            found.code() == Code::Coarse && cost > 1.2 && cost < want,
            "{found:?}"
        );
    }
    let rounded = |step_m: f64| {
        move |_: usize, row: &mut Row| {
            row.reference[0] = (row.reference[0] / step_m).round() * step_m
        }
    };
    assert_eq!(faults_of(rounded(1e-6)).findings, []);
    assert_eq!(only(rounded(10e-6)), (Code::Coarse, Channel::BeamX, None));
}

#[test]
fn a_noisy_probe_costs_its_excess_over_its_siblings() {
    let noisy = |_: usize, row: &mut Row| row.frame.codes.hall[1] += random(row.t_us, 30);
    let (code, channel, cost) = only(noisy);
    assert_eq!((code, channel), (Code::Noisy, Channel::HallB));
    assert!(cost > Some(2.0), "{cost:?}");
}

#[test]
fn noise_that_one_probe_has_at_times_is_not_that_of_all() {
    let at_times = |k: usize, row: &mut Row| {
        let deviation = if k % 500 < 100 { 16 } else { 0 };
        row.frame.codes.hall[0] += random(row.t_us, deviation);
    };
    let (code, channel, cost) = only(at_times);
    assert_eq!((code, channel), (Code::Noisy, Channel::HallA));
    assert!(cost < Some(1.3), "{cost:?}");
}

/// Even numbers with this deviation, by the time.
fn random(t_us: i64, deviation: i32) -> i32 {
    let mixed = (t_us as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 33;
    let uniform = mixed as f64 / 2f64.powi(31) - 0.5;
    (12f64.sqrt() * uniform * f64::from(deviation)).round() as i32
}

/// The noise of all probes alike is 4 times their own, and a code of 4 times the noise is an outlier in 1 % of the rows.
#[test]
fn what_a_sensor_shows_in_the_log_stays_in_service() {
    let ratio = |found: &ColumnFaults| found.stays.map(|m2| m2.sqrt() * 1e6);
    let shared = faults_of(|_, row| {
        let codes = random(row.t_us, 32);
        row.frame
            .codes
            .hall
            .iter_mut()
            .for_each(|code| *code += codes);
    });
    let [found] = &shared.findings[..] else {
        panic!("{:#?}", shared.findings);
    };
    assert_eq!(
        (found.code(), found.channels[0]),
        (Code::Noisy, Channel::Halls)
    );
    assert!(found.cost > Some(4.0), "{found:?}");
    assert!(found.severity == Severity::Warn, "the calibration is right");
    let spikes = |k: usize, row: &mut Row| {
        row.frame.codes.hall[0] += if k % 101 == 3 { 400 } else { 0 };
        row.reference[0] += if k % 101 == 9 { 30e-6 } else { 0.0 };
    };
    let spikes = faults_of(spikes);
    let codes: Vec<_> = spikes
        .findings
        .iter()
        .map(|f| (f.code(), f.channels[0]))
        .collect();
    assert_eq!(
        codes,
        [
            (Code::Outliers, Channel::HallA),
            (Code::Outliers, Channel::BeamX)
        ]
    );
    assert_eq!(spikes.findings[1].cost, None, "service has no beams");
    // The variance of 400 codes in one of 101 rows is 25 times the noise.
    assert!((ratio(&spikes)[1] > 1.0), "{:?}", ratio(&spikes));
    let cost = spikes.findings[0].cost.expect("a cost");
    assert!(cost > 2.5 && cost < 26f64.sqrt(), "{cost}");
    let hum = |k: usize, row: &mut Row| {
        let sine = libm::sin(std::f64::consts::TAU * 0.0746 * k as f64);
        row.frame
            .codes
            .hall
            .iter_mut()
            .for_each(|code| *code += (16.0 * sine) as i32);
    };
    let hum = faults_of(hum);
    assert!(
        hum.findings.iter().all(|found| found.code() == Code::Hum),
        "{hum:#?}",
        hum = hum.findings
    );
    // In phase it adds up.
    let alone = hum
        .findings
        .iter()
        .filter_map(|found| found.cost)
        .fold(0.0, f64::max);
    let floor = (hum.stays[0].sqrt() + hum.stays[1].sqrt()) * 1e6;
    assert!(alone > 1.2 && floor > 0.5, "{alone} {floor}");
}
