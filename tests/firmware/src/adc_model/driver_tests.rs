//! The drivers on the models, without a controller: which instant a sample is of, and that it is
//! settled whatever the data sheet leaves open.

use super::ads131m08::Variant;
use super::{Adc, Input, Part, Row};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use hal_adapters::adc::{Ads131m08, Ads8688, Channels, FrameSampler};
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

/// A converter, and the time that bytes and waits take.
struct Bench {
    adc: Adc,
    now_ns: u64,
    byte_ns: u64,
    /// From the end of a frame to the start of the next one.
    gap_ns: u64,
    /// The converter's clock, MHz: at 8.192 in place of 8, everything else is slower for it.
    clock_mhz: f64,
}

impl Bench {
    fn pass(&mut self, ns: u64) {
        self.now_ns += self.clocked(ns);
    }

    fn clocked(&self, ns: u64) -> u64 {
        (ns as f64 * self.clock_mhz / 8.0).round() as u64
    }
}

#[derive(Clone)]
struct Shared(Rc<RefCell<Bench>>);

impl spi::ErrorType for Shared {
    type Error = Infallible;
}

impl SpiDevice for Shared {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bench = &mut *self.0.borrow_mut();
        bench.pass(bench.gap_ns);
        bench.adc.select(bench.now_ns);
        for operation in operations {
            let Operation::TransferInPlace(bytes) = operation else {
                panic!("the drivers transfer in place");
            };
            for byte in bytes.iter_mut() {
                *byte = bench.adc.exchange(*byte);
                bench.pass(bench.byte_ns);
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

impl DelayNs for Shared {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().pass(ns.into());
    }
}

/// First tick, after power-up and what an ADS8688 waits for.
const FIRST_TICK_NS: u64 = 40_000_000;
const TICK_NS: u64 = 2_000_000;
/// The inputs rise by a code in 1.25 us.
const NS_PER_CODE: f64 = 1250.0;

/// What surrounds a converter in a test: bytes and gaps, how late the codes are read, and its clock.
#[derive(Clone, Copy, Debug)]
struct Around {
    byte_ns: u64,
    gap_ns: u64,
    late_us: i32,
    clock_mhz: f64,
}

/// Ages of the middle of the three Hall codes in ten ticks, us after the trigger.
fn instants_us<C: FrameSampler>(
    part: Part,
    variant: Variant,
    around: Around,
    driver: impl Fn(Shared, Shared) -> C,
) -> Vec<f64> {
    let Around {
        byte_ns,
        gap_ns,
        late_us,
        clock_mhz,
    } = around;
    let rows: Vec<Row> = (0..20).map(|k| [-16_000 + 1600 * k; 6]).collect();
    let mut bench = Bench {
        adc: Adc::new(part, Input::held(vec![])),
        now_ns: 1_000_000,
        byte_ns,
        gap_ns,
        clock_mhz,
    };
    let first_ns = bench.clocked(FIRST_TICK_NS);
    bench.adc.input = Input::moving(rows, bench.clocked(TICK_NS) / 1000, 0);
    bench.adc.input.start_ns = Some(first_ns);
    bench.adc.set_variant(variant);
    let clocked = |ns: u64| (ns as f64 * clock_mhz / 8.0) as u64;
    let shared = Shared(Rc::new(RefCell::new(bench)));
    let mut delay = shared.clone();
    let mut converter = driver(shared.clone(), shared.clone());
    assert!(converter.start(&mut delay).is_ok());
    if part == Part::Ads8688 {
        assert!(converter.sample(0, 0).is_err());
    }
    let mut instants = Vec::new();
    for k in 0..10 {
        let tick_ns = first_ns + k * clocked(TICK_NS);
        shared.0.borrow_mut().now_ns = tick_ns;
        assert!(converter.trigger(&mut delay).is_ok());
        let settled_us = C::SETTLE_US.saturating_add_signed(late_us);
        shared.0.borrow_mut().now_ns = tick_ns + clocked(u64::from(settled_us) * 1000);
        let Ok(frame) = converter.sample(k as u32, 100_000) else {
            panic!("no codes: {variant:?}, {around:?}, tick {k}");
        };
        let [_, hall_b, _] = frame.hall;
        let moved = f64::from(hall_b + 16_000) * NS_PER_CODE - (k * TICK_NS) as f64;
        instants.push(moved / 1000.0);
    }
    instants
}

const AN_ADS131M08: fn(Shared, Shared) -> Ads131m08<Shared, Shared> =
    |spi, pin| Ads131m08::new(spi, pin, Channels::IN_ORDER);

/// What the driver's page says of the age, in every variant, from the SPI's fastest on, with the clocks
/// and the frames that it allows. A code that is not settled would be of an instant before the trigger.
#[test]
fn an_ads131m08_is_sampled_where_its_driver_says() {
    let nominal = f64::from(Ads131m08::<Shared, Shared>::SAMPLE_US);
    for variant in Variant::all() {
        for (byte_ns, gap_ns) in [(762, 1000), (762, 4000), (762, 8000), (1000, 5000)] {
            for (late_us, clock_mhz) in [(-3, 8.0), (0, 8.0), (3, 8.0), (0, 8.192)] {
                let around = Around {
                    byte_ns,
                    gap_ns,
                    late_us,
                    clock_mhz,
                };
                let all = instants_us(Part::Ads131m08, variant, around, AN_ADS131M08);
                for instant in all {
                    let late = instant - nominal;
                    let latest = if clock_mhz == 8.0 { 7.0 } else { 10.5 };
                    assert!(
                        late.abs() <= latest,
                        "{variant:?}, {around:?}: {late} us late"
                    );
                }
            }
        }
    }
}

#[test]
fn an_ads8688_is_sampled_where_its_driver_says() {
    let nominal = f64::from(Ads8688::<Shared, Shared>::SAMPLE_US);
    let around = Around {
        byte_ns: 762,
        gap_ns: 1500,
        late_us: 0,
        clock_mhz: 8.0,
    };
    let instants = instants_us(Part::Ads8688, Variant::PLAIN, around, |spi, pin| {
        Ads8688::new(spi, pin, Channels::IN_ORDER)
    });
    for instant in instants {
        assert!((instant - nominal).abs() < 2.0, "{instant}");
    }
}

/// The sweep of the bring-up page: a constant input of 10,000 codes, read from 40 to 240 us after the
/// trigger. From 190 to 215 us every variant gives the code; before, some give 17 or 84 % of it, and
/// before and after some give none.
#[test]
fn a_constant_input_shows_from_when_on_codes_are_settled() {
    const CODE: i32 = 10_000;
    for delay_us in (40..=240).step_by(5) {
        let mut seen = Vec::new();
        for variant in Variant::all() {
            let mut adc = Adc::new(Part::Ads131m08, Input::held(vec![[CODE; 6]]));
            adc.set_variant(variant);
            let bench = Bench {
                adc,
                now_ns: 1_000_000,
                byte_ns: 762,
                gap_ns: 5000,
                clock_mhz: 8.0,
            };
            let shared = Shared(Rc::new(RefCell::new(bench)));
            let mut delay = shared.clone();
            let mut converter = AN_ADS131M08(shared.clone(), shared.clone());
            assert!(converter.start(&mut delay).is_ok());
            for k in 0..5 {
                let tick_ns = FIRST_TICK_NS + k * TICK_NS;
                shared.0.borrow_mut().now_ns = tick_ns;
                assert!(converter.trigger(&mut delay).is_ok());
                shared.0.borrow_mut().now_ns = tick_ns + delay_us * 1000;
                let code = converter
                    .sample(k as u32, 0)
                    .map_or(i32::MIN, |frame| frame.hall[0]);
                seen.push(code);
            }
        }
        seen.sort_unstable();
        seen.dedup();
        println!("{delay_us} us: {seen:?}");
        assert!(
            !(190..=215).contains(&delay_us) || seen == [CODE],
            "{delay_us} us: {seen:?}"
        );
    }
}
