extern crate std;

use super::*;
use core::convert::Infallible;
use core::future::poll_fn;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_hal_async::delay::DelayNs;
use std::vec::Vec;

/// Notes what is asked of it, in order.
#[derive(Default)]
struct Noting(Vec<&'static str>);

impl FrameSampler for Noting {
    type Bus = Infallible;
    const SPI_MODE: Mode = embedded_hal::spi::MODE_0;
    const SPI_HZ_MAX: u32 = 1;
    const SETTLE_US: u32 = 207;
    const CODE_BITS: u32 = 24;

    fn start(&mut self) -> Result<(), AdcError<Infallible>> {
        Ok(())
    }

    fn trigger(&mut self) -> Result<(), AdcError<Infallible>> {
        self.0.push("trigger");
        Ok(())
    }

    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<Infallible>> {
        self.0.push("sample");
        Ok(RawFrame::new([1; 3], [2; 3], sequence, 0))
    }
}

/// Is over when it is looked at for the second time.
struct Timer;

impl DelayNs for Timer {
    async fn delay_ns(&mut self, ns: u32) {
        assert_eq!(ns, 207_000);
        let mut looks = 0;
        poll_fn(|_| {
            looks += 1;
            match looks {
                1 => Poll::Pending,
                _ => Poll::Ready(()),
            }
        })
        .await;
    }
}

#[test]
fn other_tasks_run_while_the_codes_settle() {
    let (mut sampler, mut timer) = (Noting::default(), Timer);
    let mut context = Context::from_waker(Waker::noop());
    {
        let mut sampled = pin!(sample_async(&mut sampler, &mut timer, 7));
        assert!(sampled.as_mut().poll(&mut context).is_pending());
        let frame = Ok(RawFrame::new([1; 3], [2; 3], 7, 0));
        assert_eq!(sampled.poll(&mut context), Poll::Ready(frame));
    }
    assert_eq!(sampler.0, ["trigger", "sample"]);
}
