//! The driver on the model, without a controller: the instant of a sample, and that its codes are settled
//! in every variant of the data sheet.

use super::ads131m08::Variant;
use super::{Adc, Input, Row};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use hal_adapters::adc::{Ads131m08, Channels, FrameSampler};
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

type Driver = Ads131m08<Shared, Shared>;

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
                panic!("the driver transfers in place");
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

const FIRST_TICK_NS: u64 = 40_000_000;
const TICK_NS: u64 = 2_000_000;
/// The inputs rise by a code in 1.25 us.
const NS_PER_CODE: f64 = 1250.0;

impl Bench {
    fn new(variant: Variant) -> Self {
        let mut adc = Adc::new(Input::held(vec![]));
        adc.part.variant = variant;
        Self {
            adc,
            now_ns: 1_000_000,
            byte_ns: 762,
            gap_ns: 5000,
            clock_mhz: 8.0,
        }
    }

    /// Codes of Hall probe B in ten ticks, read `settle_us` after the trigger, where there are any.
    fn codes(self, settle_us: u32) -> [Option<i32>; 10] {
        let (first_ns, tick_ns) = (self.clocked(FIRST_TICK_NS), self.clocked(TICK_NS));
        let settle_ns = self.clocked(u64::from(settle_us) * 1000);
        let shared = Shared(Rc::new(RefCell::new(self)));
        let mut delay = shared.clone();
        let mut converter = Driver::new(shared.clone(), shared.clone(), Channels::IN_ORDER);
        assert!(converter.start(&mut delay).is_ok());
        core::array::from_fn(|k| {
            let tick_ns = first_ns + k as u64 * tick_ns;
            shared.0.borrow_mut().now_ns = tick_ns;
            assert!(converter.trigger(&mut delay).is_ok());
            shared.0.borrow_mut().now_ns = tick_ns + settle_ns;
            let frame = converter.sample(k as u32, 100_000).ok()?;
            Some(frame.hall[1])
        })
    }

    /// Time from the trigger to the middle of the three Hall codes of ten ticks, us, while the inputs
    /// rise. The codes are read `late_us` after they should be.
    fn instants_us(mut self, late_us: i32) -> [f64; 10] {
        let rows: Vec<Row> = (0..20).map(|k| [-16_000 + 1600 * k; 6]).collect();
        self.adc.input = Input::moving(rows, self.clocked(TICK_NS) / 1000, 0);
        self.adc.input.start_ns = Some(self.clocked(FIRST_TICK_NS));
        let mut tick_ns = 0.0;
        let settle_us = Driver::SETTLE_US.saturating_add_signed(late_us);
        self.codes(settle_us).map(|code| {
            let moved_ns = f64::from(code.expect("codes") + 16_000) * NS_PER_CODE - tick_ns;
            tick_ns += TICK_NS as f64;
            moved_ns / 1000.0
        })
    }
}

/// The instant that the driver documents, in every variant, at the SPI's fastest clock and a slower one,
/// with the clocks and the gaps between frames that it allows. A code that is not settled would have an
/// instant before the trigger.
#[test]
fn a_sample_has_the_instant_that_the_driver_documents() {
    for variant in Variant::all() {
        for (byte_ns, gap_ns) in [(762, 1000), (762, 4000), (762, 8000), (1000, 5000)] {
            for (late_us, clock_mhz) in [(-3, 8.0), (0, 8.0), (3, 8.0), (0, 8.192)] {
                let bench = Bench {
                    byte_ns,
                    gap_ns,
                    clock_mhz,
                    ..Bench::new(variant)
                };
                let latest = if clock_mhz == 8.0 { 7.0 } else { 10.5 };
                for instant in bench.instants_us(late_us) {
                    let late = instant - f64::from(Driver::SAMPLE_US);
                    assert!(
                        late.abs() <= latest,
                        "{late} us late: {variant:?}, {byte_ns} {gap_ns} {late_us} {clock_mhz}"
                    );
                }
            }
        }
    }
}
