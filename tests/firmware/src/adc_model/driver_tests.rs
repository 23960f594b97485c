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
}

#[derive(Clone)]
struct Shared(Rc<RefCell<Bench>>);

impl spi::ErrorType for Shared {
    type Error = Infallible;
}

impl SpiDevice for Shared {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bench = &mut *self.0.borrow_mut();
        bench.now_ns += 300;
        bench.adc.select(bench.now_ns);
        for operation in operations {
            let Operation::TransferInPlace(bytes) = operation else {
                panic!("the drivers transfer in place");
            };
            for byte in bytes.iter_mut() {
                *byte = bench.adc.exchange(*byte);
                bench.now_ns += bench.byte_ns;
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
        self.0.borrow_mut().now_ns += u64::from(ns);
    }
}

/// First tick, after power-up and what an ADS8688 waits for.
const FIRST_TICK_NS: u64 = 40_000_000;
const TICK_NS: u64 = 2_000_000;
/// The inputs rise by a code in 1.25 us.
const NS_PER_CODE: f64 = 1250.0;

/// Ages of the middle of the three Hall codes in ten ticks, us after the trigger.
fn instants_us<C: FrameSampler>(
    part: Part,
    variant: Variant,
    byte_ns: u64,
    driver: impl Fn(Shared, Shared) -> C,
) -> Vec<f64> {
    let rows: Vec<Row> = (0..20).map(|k| [-16_000 + 1600 * k; 6]).collect();
    let mut input = Input::moving(rows, 2000, 0);
    input.start_ns = Some(FIRST_TICK_NS);
    let mut adc = Adc::new(part, input);
    adc.set_variant(variant);
    let now_ns = 1_000_000;
    let shared = Shared(Rc::new(RefCell::new(Bench {
        adc,
        now_ns,
        byte_ns,
    })));
    let mut delay = shared.clone();
    let mut converter = driver(shared.clone(), shared.clone());
    assert!(converter.start(&mut delay).is_ok());
    if part == Part::Ads8688 {
        assert!(converter.sample(0, 0).is_err());
    }
    let mut instants = Vec::new();
    for k in 0..10 {
        let tick_ns = FIRST_TICK_NS + k * TICK_NS;
        shared.0.borrow_mut().now_ns = tick_ns;
        assert!(converter.trigger(&mut delay).is_ok());
        shared.0.borrow_mut().now_ns = tick_ns + u64::from(C::SETTLE_US) * 1000;
        let Ok(frame) = converter.sample(k as u32, 100_000) else {
            panic!("no codes: {variant:?}, {byte_ns} ns a byte");
        };
        let [_, hall_b, _] = frame.hall;
        let moved = f64::from(hall_b + 16_000) * NS_PER_CODE - (k * TICK_NS) as f64;
        instants.push(moved / 1000.0);
    }
    instants
}

const AN_ADS131M08: fn(Shared, Shared) -> Ads131m08<Shared, Shared> =
    |spi, pin| Ads131m08::new(spi, pin, Channels::IN_ORDER);

/// What the driver's page says of the age, in every variant and from the SPI's fastest to 1.8 us a
/// byte. A code that is not settled would be of an instant before the trigger.
#[test]
fn an_ads131m08_is_sampled_where_its_driver_says() {
    let nominal = f64::from(Ads131m08::<Shared, Shared>::SAMPLE_US);
    for variant in Variant::all() {
        for byte_ns in [762, 850, 1000, 1200, 1800] {
            for instant in instants_us(Part::Ads131m08, variant, byte_ns, AN_ADS131M08) {
                let late = instant - nominal;
                let place = format!("{variant:?}, {byte_ns} ns a byte: {late} us late");
                let plain = !(variant.late_pop || variant.gated && variant.wait == 300);
                let latest = match byte_ns {
                    ..=1200 if plain => 6.0,
                    ..=1200 => 38.0,
                    _ => 91.0,
                };
                assert!((-7.0..=latest).contains(&late), "{place}");
            }
        }
    }
}

#[test]
fn an_ads8688_is_sampled_where_its_driver_says() {
    let nominal = f64::from(Ads8688::<Shared, Shared>::SAMPLE_US);
    let instants = instants_us(Part::Ads8688, Variant::PLAIN, 912, |spi, pin| {
        Ads8688::new(spi, pin, Channels::IN_ORDER)
    });
    for instant in instants {
        assert!((instant - nominal).abs() < 2.0, "{instant}");
    }
}

/// The sweep of the bring-up page: a constant input of 10,000 codes, read from 40 to 200 us after the
/// trigger. From 120 us on every variant gives the code; before, some give 17 or 84 % of it.
#[test]
fn a_constant_input_shows_from_when_on_codes_are_settled() {
    const CODE: i32 = 10_000;
    for delay_us in (40..=200).step_by(10) {
        let mut seen = Vec::new();
        for variant in Variant::all() {
            let mut adc = Adc::new(Part::Ads131m08, Input::held(vec![[CODE; 6]]));
            adc.set_variant(variant);
            let (now_ns, byte_ns) = (1_000_000, 912);
            let bench = Bench {
                adc,
                now_ns,
                byte_ns,
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
        assert!(delay_us < 120 || seen == [CODE], "{delay_us} us: {seen:?}");
    }
}
