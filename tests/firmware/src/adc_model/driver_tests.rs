//! The driver on the model, without a controller: whatever the bus, the clocks and interruptions do, a sample has its
//! instant or is refused.

use super::ads131m08::Variant;
use super::{Adc, Input, Row};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use hal_adapters::adc::{AdcError, Ads131m08, Channels, Clock, DataReady, FrameSampler};
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;
use tests::flash_model::Words;

/// What differs from board to board.
#[derive(Clone, Copy, Debug)]
struct Board {
    spi_mhz: f64,
    /// From the end of a frame to the start of the next one, us.
    gap_us: f64,
    /// Length of an interruption, us; one comes in a ms.
    preempted_us: f64,
    /// The converter's clock, MHz.
    clkin_mhz: f64,
    /// The controller's clock runs fast by this part.
    fast: f64,
    /// Edges on the line of DRDY that are none of the converter, on average in a ms.
    glitches_per_ms: u32,
}

const USUAL: Board = Board {
    spi_mhz: 10.0,
    gap_us: 5.0,
    preempted_us: 0.0,
    clkin_mhz: 8.0,
    fast: 0.0,
    glitches_per_ms: 0,
};

/// A converter, and the time that bytes and waits take. Time is the converter's, which takes CLKIN for 8 MHz.
struct Bench {
    adc: Adc,
    now_ns: u64,
    board: Board,
    chance: Words,
    /// The last edge that was asked for.
    seen_ns: Option<u64>,
    glitch_ns: u64,
    next_glitch_ns: u64,
}

impl Bench {
    /// True time, us, as the converter counts it, ns.
    fn converter_ns(&self, us: f64) -> u64 {
        (us * 1000.0 * self.board.clkin_mhz / 8.0).round() as u64
    }

    /// What the controller's clock reads at a time of the converter, us.
    fn clock_us(&self, ns: u64) -> f64 {
        ns as f64 / 1000.0 * 8.0 / self.board.clkin_mhz * (1.0 + self.board.fast)
    }

    fn pass(&mut self, us: f64) {
        self.now_ns += self.converter_ns(us);
        let lasts_us = self.board.preempted_us;
        if lasts_us > 0.0 && self.chance.below((1000.0 / us) as u32) == 0 {
            self.now_ns += self.converter_ns(lasts_us);
        }
    }

    /// The last edge on the line.
    fn fell_ns(&mut self) -> Option<u64> {
        let rate = self.board.glitches_per_ms;
        while rate > 0 && self.next_glitch_ns <= self.now_ns {
            self.glitch_ns = self.next_glitch_ns;
            self.next_glitch_ns += u64::from(self.chance.below(2_000_000 / rate));
        }
        let fell_ns = self.adc.ready_fell_ns(self.now_ns);
        fell_ns.map(|ns| ns.max(self.glitch_ns))
    }
}

type Driver = Ads131m08<Shared, Shared, Shared>;

#[derive(Clone)]
struct Shared(Rc<RefCell<Bench>>);

impl spi::ErrorType for Shared {
    type Error = Infallible;
}

impl SpiDevice for Shared {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bench = &mut *self.0.borrow_mut();
        bench.pass(bench.board.gap_us);
        bench.adc.select(bench.now_ns);
        for operation in operations {
            let Operation::TransferInPlace(bytes) = operation else {
                panic!("the driver transfers in place");
            };
            for byte in bytes.iter_mut() {
                *byte = bench.adc.exchange(*byte);
                bench.pass(8.0 / bench.board.spi_mhz);
            }
        }
        bench.adc.deselect(bench.now_ns);
        Ok(())
    }
}

impl digital::ErrorType for Shared {
    type Error = Infallible;
}

impl OutputPin for Shared {
    fn set_low(&mut self) -> Result<(), Infallible> {
        let bench = &mut *self.0.borrow_mut();
        bench.adc.control(false, bench.now_ns);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        let bench = &mut *self.0.borrow_mut();
        bench.adc.control(true, bench.now_ns);
        Ok(())
    }
}

impl Clock for Shared {
    fn now_us(&mut self) -> u32 {
        let bench = &mut *self.0.borrow_mut();
        bench.pass(0.2);
        bench.clock_us(bench.now_ns) as u32
    }
}

impl DataReady for Shared {
    fn fell_us(&mut self) -> Option<u32> {
        let bench = &mut *self.0.borrow_mut();
        bench.pass(0.2);
        let fell_ns = bench.fell_ns();
        let is_new = fell_ns != std::mem::replace(&mut bench.seen_ns, fell_ns);
        fell_ns
            .filter(|_| is_new)
            .map(|ns| bench.clock_us(ns) as u32)
    }
}

const FIRST_TICK_US: f64 = 40_000.0;
const TICK_US: f64 = 2000.0;
const TICKS: u32 = 100;
/// The inputs rise by a code in this time, from this code on.
const US_PER_CODE: f64 = 0.125;
const LOWEST: i32 = -200_000;

/// A converter on a board, and its driver.
fn converter(variant: Variant, board: Board, seed: u64) -> (Driver, Shared) {
    let mut bench = Bench {
        adc: Adc::new(Input::held(vec![])),
        now_ns: 1_000_000,
        board,
        chance: Words(seed),
        seen_ns: None,
        glitch_ns: 0,
        next_glitch_ns: 0,
    };
    bench.adc.part.variant = variant;
    let shared = Shared(Rc::new(RefCell::new(bench)));
    let [spi, sync, ready] = [(); 3].map(|()| shared.clone());
    (Driver::new(spi, sync, ready, Channels::IN_ORDER), shared)
}

/// The errors of the times of samples, us, and how many were refused. A code that is not settled would be early by far.
fn errors_us(variant: Variant, board: Board, seed: u64) -> (Vec<f64>, usize) {
    let (mut converter, shared) = converter(variant, board, seed);
    let mut borrowed = shared.0.borrow_mut();
    let bench = &mut *borrowed;
    let row = |k: i32| [LOWEST + 16_000 * k; 6];
    bench.adc.input = Input::moving((0..110).map(row).collect::<Vec<Row>>(), 2000, 0);
    let (first_ns, tick_ns) = (
        bench.converter_ns(FIRST_TICK_US),
        bench.converter_ns(TICK_US),
    );
    bench.adc.input.start_ns = Some(first_ns);
    drop(borrowed);
    let at = |ns: u64| {
        let bench = &mut *shared.0.borrow_mut();
        bench.now_ns = bench.now_ns.max(ns);
    };
    // An interruption may spoil the measurement of the edges.
    let _ = (0..10).find(|_| converter.start().is_ok());
    let (mut errors, mut refused, mut in_a_row) = (Vec::new(), 0, 0);
    for k in 0..TICKS {
        let tick_ns = first_ns + u64::from(k) * tick_ns;
        at(tick_ns);
        let _ = converter.trigger();
        let settle_us = f64::from(Driver::SETTLE_US) / (1.0 + board.fast);
        let settle_ns = shared.0.borrow().converter_ns(settle_us);
        at(tick_ns + settle_ns);
        let sampled = converter.sample(k);
        match sampled {
            Ok(frame) => {
                in_a_row = 0;
                let rose_us = f64::from(frame.hall[1] - LOWEST) * US_PER_CODE;
                let true_ns = first_ns + (rose_us * 1000.0) as u64;
                errors.push(f64::from(frame.time_us) - shared.0.borrow().clock_us(true_ns));
            }
            Err(error) => {
                (refused, in_a_row) = (refused + 1, in_a_row + 1);
                // As the firmware does it.
                if error != AdcError::UnknownInstant || in_a_row % 16 == 0 {
                    let _ = converter.start();
                }
            }
        }
    }
    (errors, refused)
}

/// The largest error of any variant, us, and how many of 100 samples are refused.
fn worst(board: Board, seed: u64) -> (f64, f64) {
    let (mut worst, mut refused) = (0.0f64, 0);
    for variant in Variant::all() {
        let (errors, no) = errors_us(variant, board, seed);
        worst = errors.iter().fold(worst, |worst, us| worst.max(us.abs()));
        refused += no;
    }
    assert!(worst <= 10.0, "{worst} us: {board:?}");
    (
        worst,
        100.0 * refused as f64 / f64::from(TICKS) / Variant::all().count() as f64,
    )
}

/// The table of the driver's documentation: the largest error of a sample that is not refused, and how many are.
#[test]
fn every_sample_has_its_instant_to_10_us_or_is_refused() {
    for spi_mhz in [1.0, 4.0, 5.25, 10.0] {
        for gap_us in [1.0, 5.0, 20.0, 50.0] {
            let keeps_up = match spi_mhz {
                5.25 => gap_us <= 5.0,
                _ => spi_mhz > 5.25 && gap_us <= 20.0,
            };
            let row = [0.0, 10.0, 30.0, 100.0].map(|preempted_us| {
                let board = Board {
                    spi_mhz,
                    gap_us,
                    preempted_us,
                    ..USUAL
                };
                let (worst, refused) = worst(board, 7);
                match keeps_up {
                    true if preempted_us == 0.0 => assert_eq!(refused, 0.0, "{board:?}"),
                    true => assert!(refused < 20.0, "{refused} %: {board:?}"),
                    false => assert_eq!(refused, 100.0, "{board:?}"),
                }
                assert!(worst < 6.5, "{worst} us: {board:?}");
                format!("{worst:.1} us, {refused:.0} %")
            });
            println!("| {spi_mhz} MHz, {gap_us} us | {} |", row.join(" | "));
        }
    }
}

/// The controller's own oscillator is 4 % off; the converter has another crystal. Beyond, no sample is taken.
#[test]
fn either_clock_may_be_off() {
    for (fast, clkin_mhz) in [(0.04, 8.0), (-0.04, 8.0), (0.0, 8.192), (0.03, 8.192)] {
        let board = Board {
            fast,
            clkin_mhz,
            ..USUAL
        };
        let (worst, refused) = worst(board, 7);
        println!("{fast} {clkin_mhz} MHz: {worst:.1} us");
        assert_eq!(refused, 0.0, "{board:?}");
    }
    for clkin_mhz in [4.0, 7.0, 7.4, 9.0] {
        let board = Board { clkin_mhz, ..USUAL };
        let mut converter = converter(Variant::default(), board, 7).0;
        assert_eq!(converter.start(), Err(AdcError::UnknownInstant));
        assert_eq!(worst(board, 7), (0.0, 100.0), "{board:?}");
    }
}

/// A disturbed line of DRDY.
#[test]
fn an_edge_out_of_its_turn_gives_no_wrong_instant() {
    for (seed, glitches_per_ms) in [1, 2, 2, 4, 4].into_iter().enumerate() {
        let board = Board {
            glitches_per_ms,
            ..USUAL
        };
        let (worst, refused) = worst(board, seed as u64 + 1);
        println!("{glitches_per_ms} edges in a ms: {worst:.1} us, {refused:.0} % refused");
        assert!(refused > 0.0 && refused < 60.0, "{refused}");
    }
}

#[test]
fn no_drawn_timing_gives_a_wrong_instant() {
    let mut chance = Words(1);
    for seed in 0..60 {
        let mut between =
            |from: f64, to: f64| from + (to - from) * f64::from(chance.below(1000)) / 1000.0;
        let board = Board {
            spi_mhz: between(3.0, 20.0),
            gap_us: between(0.0, 15.0),
            preempted_us: between(-100.0, 300.0).max(0.0),
            clkin_mhz: between(7.2, 8.8),
            fast: between(-0.06, 0.06),
            ..USUAL
        };
        worst(board, seed);
    }
}
