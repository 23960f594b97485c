//! Tests of the tick: limits, `f32` against `f64`. Every status bit, what is zero when and no NaN:
//! `decoder_word_tests.rs`.

use super::*;
use crate::calibration::Calibration;
use crate::model::Sensitivity;
use crate::sample;

const HALL: [i32; 3] = [1200, 900, 700];
const CAPACITIVE: [i32; 3] = [300, -200, 100];

type Linear = Decoder<LinearModel>;

fn decoder() -> Linear {
    match sample::parameters().decoder() {
        AnyDecoder::Linear(decoder) => decoder,
        AnyDecoder::Field(_) => panic!("the sample is of Model (31)"),
    }
}

/// The sample's decoder with something changed in its constants or coefficients.
pub(super) fn changed(
    change: impl FnOnce(&mut DecoderConstants<f32>, &mut [Sensitivity<f32>; 3]),
) -> Linear {
    let (mut constants, mut probes) = (*decoder().constants(), *decoder().probes());
    change(&mut constants, &mut probes);
    Decoder::new(constants, probes)
}

pub(super) fn frame(hall: [i32; 3], capacitive: [i32; 3]) -> RawFrame {
    RawFrame::new(hall, capacitive, 0, 0)
}

fn decode(decoder: &Linear, hall: [i32; 3], capacitive: [i32; 3]) -> Reading {
    decoder.decode(&frame(hall, capacitive), &PlanarPose::ZERO)
}

pub(super) fn words(reading: &Reading) -> [u32; 7] {
    let [x, y, rz] = reading.pose.planar.to_array().map(f32::to_bits);
    let [z, rx, ry] = reading.pose.vertical.to_array().map(f32::to_bits);
    [x, y, rz, z, rx, ry, reading.status.bits()]
}

/// All other sensitivities: `decoder_word_tests.rs`.
#[test]
fn a_sensitivity_below_its_limit_takes_x_y_and_rz() {
    for probe in 0..3 {
        for (eta, is_decoded) in [(0.1, true), (-0.1, true), (0.0999, false), (-0.0999, false)] {
            let decoder = changed(|_, probes| probes[probe] = Sensitivity::constant(eta));
            let reading = decode(&decoder, HALL, CAPACITIVE);
            assert_eq!(reading.planar().is_some(), is_decoded, "eta {eta}");
            let bit = Status::SENSITIVITY_A.bits() << probe;
            assert_eq!(reading.status.any(Status::from_bits(bit)), !is_decoded);
        }
    }
}

#[test]
fn a_pose_outside_the_calibrated_range_is_marked_and_given() {
    let good = decode(&decoder(), HALL, CAPACITIVE);
    for axis in 0..3 {
        // The limit itself lies within the range, on either side; the next number beyond does not.
        type Limits = fn(&mut DecoderConstants<f32>) -> &mut [f32; 3];
        let planar: (_, Limits, _) = (
            good.pose.planar.to_array(),
            |c| &mut c.calibrated_planar,
            Status::PLANAR_EXTRAPOLATED,
        );
        let vertical: (_, Limits, _) = (
            good.pose.vertical.to_array(),
            |c| &mut c.calibrated_vertical,
            Status::VERTICAL_EXTRAPOLATED,
        );
        for (pose, limits, bit) in [planar, vertical] {
            let limit = pose[axis];
            let limited = |limit: f32| changed(|c, _| limits(c)[axis] = limit);
            let at = decode(&limited(limit.abs()), HALL, CAPACITIVE);
            assert!(at.status.is_good());
            let below = f32::from_bits(limit.abs().to_bits() - 1);
            let beyond = decode(&limited(below), HALL, CAPACITIVE);
            assert_eq!(beyond.status, bit);
            assert_eq!(beyond.pose, good.pose);
        }
    }
}

#[test]
fn a_known_vertical_pose_decodes_like_the_codes_that_give_it() {
    let by_codes = decode(&decoder(), HALL, CAPACITIVE);
    let by_pose = decoder().decode_at(HALL, [0; 2], by_codes.pose.vertical, &PlanarPose::ZERO);
    assert_eq!(words(&by_codes), words(&by_pose));
    let nan = VerticalPose {
        z_m: f32::NAN,
        ..VerticalPose::ZERO
    };
    let status = decoder()
        .decode_at(HALL, [0; 2], nan, &PlanarPose::ZERO)
        .status;
    assert!(status.any(Status::VERTICAL_NOT_FINITE) && status.any(Status::PLANAR_INVALID));
}

/// Motion over the whole calibrated range, codes as the converters would give them: `f32`
/// stays within 0.25 nm and 1 nrad (the field model: 0.7 nrad) of the same constants in `f64`.
#[test]
fn f32_follows_f64_over_the_range_of_motion() {
    for (calibration, most_rad) in [
        (sample::calibration(), 1e-9),
        (sample::field_calibration(), 0.7e-9),
    ] {
        let (worst_m, worst_rad) = largest_difference_from_f64(&calibration);
        let model = calibration.model;
        assert!(
            worst_m > 0.0 && worst_m <= 0.25e-9,
            "{model}: {worst_m:e} m"
        );
        assert!(
            worst_rad > 0.0 && worst_rad <= most_rad,
            "{model}: {worst_rad:e} rad"
        );
    }
}

/// Of lengths, m, and angles, rad.
fn largest_difference_from_f64(calibration: &Calibration) -> (f64, f64) {
    let exact = calibration.constants().expect("a sound stage");
    let set = calibration
        .prepare(&sample::origin())
        .expect("a sound stage");
    let decoder = set.decoder();
    let steps = [-20_000, -6_001, -17, 0, 3, 9_999, 20_000];
    let (mut worst_m, mut worst_rad) = (0f64, 0f64);
    for &a in &steps {
        for &b in &steps {
            for &c in &steps {
                let hall = [a, b, c].map(|code: i32| code / 3);
                let capacitive = [b, c, a].map(|code: i32| code * 4 / 5);
                let reading = decoder.decode(&frame(hall, capacitive), &PlanarPose::ZERO);
                let v = vertical_pose(&exact.vertical_per_code, capacitive.map(f64::from));
                if !reading.status.is_good() {
                    continue;
                }
                let hall = hall.map(f64::from);
                let rows = &exact.planar_per_code;
                let zero = PlanarPose::ZERO;
                let (_, q) = calibration
                    .probes
                    .planar_pose(rows, hall, [0.0; 3], &v, &zero);
                let off = |have: f32, want: f64| (f64::from(have) - want).abs();
                let (p, w) = (reading.pose.planar, reading.pose.vertical);
                worst_m = worst_m
                    .max(off(p.x_m, q.x_m))
                    .max(off(p.y_m, q.y_m))
                    .max(off(w.z_m, v.z_m));
                worst_rad = (worst_rad.max(off(p.rz_rad, q.rz_rad)))
                    .max(off(w.rx_rad, v.rx_rad))
                    .max(off(w.ry_rad, v.ry_rad));
            }
        }
    }
    (worst_m, worst_rad)
}

/// A set with temperatures, and the same without.
fn warm_and_cold() -> [crate::AnyDecoder; 2] {
    let warm = sample::warm_parameters();
    let mut cold = warm.clone();
    cold.constants.temperature = crate::Temperature::NONE;
    [warm.decoder(), cold.decoder()]
}

#[test]
fn at_t0_the_words_are_those_without_temperatures() {
    let [warm, cold] = warm_and_cold();
    for k in -9..10 {
        let codes = frame([700 * k, 900 - 500 * k, 600 * k], [400 * k, -90 * k, 1000]);
        let at_t0 = codes.with_temperature_mc(sample::temperature().zero_mc);
        let zero = PlanarPose::ZERO;
        assert_eq!(
            words(&warm.decode(&at_t0, &zero)),
            words(&cold.decode(&codes, &zero))
        );
    }
}

#[test]
fn a_temperature_that_is_missing_is_marked_and_the_pose_is_that_at_t0() {
    let [warm, cold] = warm_and_cold();
    let zero = PlanarPose::ZERO;
    let [mount, body] = sample::temperature().zero_mc;
    let codes = frame(HALL, CAPACITIVE);
    let plain = cold.decode(&codes, &zero);
    for lost in [[crate::frame::MISSING_CODE, body], [mount, body + 30_001]] {
        let reading = warm.decode(&codes.with_temperature_mc(lost), &zero);
        assert_eq!(reading.status, Status::TEMPERATURE_MISSING);
        assert_eq!(reading.pose, plain.pose);
        assert!(reading.planar().is_some());
    }
}

#[test]
fn warm_magnets_give_a_smaller_signal_for_the_same_displacement() {
    let [warm, cold] = warm_and_cold();
    let zero = PlanarPose::ZERO;
    let [mount, body] = sample::temperature().zero_mc;
    let codes = frame(HALL, CAPACITIVE);
    let y_m = |reading: Reading| reading.pose.planar.y_m;
    let at_t0 = y_m(cold.decode(&codes, &zero));
    let ten_warmer = codes.with_temperature_mc([mount + 10_000, body]);
    let gain = y_m(warm.decode(&ten_warmer, &zero)) / at_t0;
    // k of A and B is -0.11 and -0.12 % per kelvin.
    assert!((1.011..1.0125).contains(&gain), "{gain}");
}
