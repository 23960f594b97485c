//! A second stage on the bus, with a servo period of its own.

use super::{Failure, Outcome, equal, expect};
use crate::adc_model::{Input, Part};
use crate::bench::{Bench, NEIGHBOUR, NEIGHBOUR_PERIOD_US, Seen, command};
use crate::machine::Machine;
use hal_adapters::can::NodeNumber;
use hal_adapters::can::command::{Outcome as Ended, Request};

const MS: u64 = 1_000_000;

/// Its frames have its own identifiers and checks, and come in its own period with the poses that the
/// host decodes; it obeys what is sent to its number, and nothing else.
pub fn has_identifiers_and_a_period_of_its_own(bench: &Bench) -> Outcome {
    let (part, slots) = (Part::Ads8688, [&bench.blob[..], &[]]);
    let rows = bench.rows.clone();
    let mut machine = Machine::new(&bench.library, &bench.neighbour, part, rows, slots)?;
    let own = NodeNumber::new(NEIGHBOUR).ok_or("no number")?;
    machine.chip.can.node = own;
    machine.chip.adc.input = Input::held(bench.rows.clone()).every(NEIGHBOUR_PERIOD_US);
    machine.run_ns(100 * MS)?;
    Seen::since_last(&mut machine);
    machine.run_ns(1_000 * MS)?;
    let seen = Seen::since_last(&mut machine);
    equal("damaged frames", seen.damaged, 0)?;
    let x = seen.axes.iter().filter(|axis| axis.axis == 0);
    let x: Vec<u32> = x.map(|axis| axis.word).collect();
    let ticks = 1_000_000 / NEIGHBOUR_PERIOD_US as usize;
    expect(x.len().abs_diff(ticks) <= 1, || {
        format!("{} poses in a second", x.len())
    })?;
    let host: Vec<u32> = bench.poses.iter().map(|pose| pose.words[0]).collect();
    let mut starts = host.windows(x.len()).take(2 * ticks);
    expect(starts.any(|poses| poses == x), || {
        "the poses are not those of successive rows".to_owned()
    })?;
    let times: Vec<u32> = seen.times.iter().map(|(_, us)| *us).collect();
    let apart = times.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]));
    let slow = 16 * NEIGHBOUR_PERIOD_US as u32;
    expect(apart.clone().all(|us| us.abs_diff(slow) < 50), || {
        format!("times {:?} us apart", apart.collect::<Vec<_>>())
    })?;
    for (number, answers) in [(NEIGHBOUR, 1), (NEIGHBOUR ^ 1, 0), (0, 0)] {
        let to = NodeNumber::new(number).ok_or("no number")?;
        let answered = identified(&mut machine, own, to)?;
        equal(
            &format!("answers to a request to node {number}"),
            answered,
            answers,
        )?;
    }
    Ok(())
}

/// How often a request to a node is answered as done.
fn identified(machine: &mut Machine, own: NodeNumber, to: NodeNumber) -> Result<usize, Failure> {
    let token = to.number() as u8;
    let (id, bytes) = command(Request::Identify { seconds: 0 }, token, token);
    machine.chip.can.node = to;
    machine.chip.can.receive(id, bytes);
    machine.chip.can.node = own;
    machine.run_ns(20 * MS)?;
    let answers = Seen::since_last(machine).answers;
    let done = answers
        .iter()
        .filter(|(_, answer)| answer.outcome == Some(Ended::Done));
    Ok(done.count())
}
