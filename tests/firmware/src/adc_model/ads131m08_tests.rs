//! The tables and texts of the data sheet, one test each.

use super::frames::crc;
use super::*;
use crate::adc_model::Input;

const T_0: u64 = 10_000_000;
const CONSTANT: Row = [60_000, -60_000, 1, 0, -1, 600];

fn input() -> Input {
    Input::held(vec![CONSTANT])
}

/// A part at its data rate of 32 us, that was read to its end before `T_0`.
fn running(variant: Variant) -> Ads131m08 {
    let mut part = Ads131m08 {
        variant,
        ..Default::default()
    };
    part.power_up(0);
    frame(&mut part, T_0 - 500_000, 0x6180, 0xff02);
    for _ in 0..3 {
        frame(&mut part, T_0 - 500_000, 0, 0);
    }
    part
}

/// A whole frame: response and codes.
fn frame(part: &mut Ads131m08, now_ns: u64, command: u16, data: u16) -> (u16, [i32; 8]) {
    let sent = [command.to_be_bytes(), data.to_be_bytes()];
    let mut out = vec![sent[0][0], sent[0][1], 0, sent[1][0], sent[1][1]];
    out.resize(30, 0);
    part.select(
        now_ns,
        &input(),
        |codes| super::super::all_inputs(codes, [0; 2]),
        false,
    );
    let read: Vec<_> = out.into_iter().map(|byte| part.exchange(byte)).collect();
    part.deselect(now_ns);
    let word =
        |k: usize| i32::from_be_bytes([read[3 * k], read[3 * k + 1], read[3 * k + 2], 0]) >> 8;
    let sum = u16::from_be_bytes([read[27], read[28]]);
    assert!(!part.listens || sum == crc(read[..27].iter().copied()));
    ((word(0) >> 8) as u16, core::array::from_fn(|k| word(k + 1)))
}

fn pulse(part: &mut Ads131m08, now_ns: u64) {
    part.sync(false, now_ns);
    part.sync(true, now_ns + T_CLKIN_NS);
}

#[test]
fn the_first_conversion_ends_when_table_8_3_says() {
    let table = [(0, 856), (1, 1112), (2, 1624), (3, 2648)];
    for (osr, t_clkin) in table {
        let mut part = running(Variant {
            wait: INITIAL_WAIT,
            ..Variant::default()
        });
        frame(&mut part, T_0 - 1000, 0x6180, 0xff02 | osr << 2);
        pulse(&mut part, T_0);
        assert_eq!(part.next_end_ns() - T_0, t_clkin * T_CLKIN_NS);
    }
}

/// 8.3.7.1: unsettled data are not gated; 8.5.1.5: DRDY.
#[test]
fn after_a_resynchronisation_two_conversions_are_not_settled_and_drdy_falls_with_each() {
    for variant in Variant::all() {
        let mut part = running(variant);
        pulse(&mut part, T_0);
        let codes = [1, 2, 3, 4].map(|n| {
            let ready_ns = T_0 + (variant.wait + variant.delay + 128 * n) * T_MOD_NS;
            assert_eq!(frame(&mut part, ready_ns - 1, 0, 0).0 & 0xff, 0);
            assert!(part.fell_ns(ready_ns - 1) < Some(ready_ns));
            assert_eq!(part.fell_ns(ready_ns), Some(ready_ns));
            frame(&mut part, ready_ns, 0, 0).1[0]
        });
        // The thirds of a sinc3 filter weigh 1/6, 4/6 and 1/6.
        assert!((codes[0] - 10_000).abs() < 300, "{codes:?}");
        assert!((codes[1] - 50_000).abs() < 300, "{codes:?}");
        assert_eq!(codes[2..], [60_000; 2]);
    }
}

/// 8.5.1.5 and figure 8-21.
#[test]
fn drdy_does_not_fall_during_a_frame_but_after_it_if_a_conversion_is_left() {
    for variant in Variant::all() {
        let mut part = running(variant);
        pulse(&mut part, T_0);
        let first_ns = T_0 + (variant.wait + variant.delay + 128) * T_MOD_NS;
        part.select(first_ns + 1, &input(), |_| [0; 8], false);
        let second_ns = first_ns + 128 * T_MOD_NS;
        assert_eq!(part.fell_ns(second_ns + 1), Some(first_ns));
        part.deselect(second_ns + 2);
        assert_eq!(part.fell_ns(second_ns + 3), Some(second_ns + 2));
        frame(&mut part, second_ns + 4, 0, 0);
        assert_eq!(part.fell_ns(second_ns + 5), Some(second_ns + 2));
    }
}
