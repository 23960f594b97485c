//! Cuts of the power before, inside and after operations of the flash: in an update, in the erase at
//! a start, in the record that passes over parameters that crash, and in the start that settles
//! what a cut has left. Afterwards the old or the new blob runs, and another update is possible.

use super::passed_over::{about_to_crash, crash};
use super::update::{large, plan, running, talk, update};
use super::{Failure, Outcome, expect};
use crate::adc_model::Part;
use crate::bench::Bench;
use crate::flash_model::PowerCut;
use crate::machine::Machine;
use firmware::store::flash_model::Cut;
use host_fit::bus::update::Updater;

const PART: Part = Part::Ads131m08;

/// Something that writes flash.
struct Scene<'b> {
    bench: &'b Bench,
    /// A controller just before it.
    before: fn(&Bench) -> Result<Machine, Failure>,
    /// It happens, until it is over or the power is cut.
    happens: fn(&Bench, &mut Machine) -> Outcome,
}

/// How often each blob ran after cuts.
#[derive(Clone, Copy, Default)]
struct Counts {
    old: u32,
    new: u32,
}

impl Scene<'_> {
    /// Operations of the flash that it takes.
    fn operations(&self) -> Result<u64, Failure> {
        let mut machine = (self.before)(self.bench)?;
        let before = machine.chip.flash.operations;
        (self.happens)(self.bench, &mut machine)?;
        Ok(machine.chip.flash.operations - before)
    }

    /// It happens, and the power is cut. Gives the operations of the last start.
    fn cut(&self, cuts: &[PowerCut], counts: &mut Counts) -> Result<u64, Failure> {
        let mut machine = (self.before)(self.bench)?;
        let before = machine.chip.flash.operations;
        machine.chip.flash.cut_at(cuts);
        (self.happens)(self.bench, &mut machine)?;
        machine.run_ticks(20)?;
        expect(machine.power_cuts as usize == cuts.len(), || {
            format!("{} cuts, not {cuts:?}", machine.power_cuts)
        })?;
        let until_the_last: u64 = cuts.iter().map(|cut| cut.at + 1).sum();
        let settling = machine.chip.flash.operations - before - until_the_last;
        let found = running(&mut machine)?;
        counts.old += u32::from(found == self.bench.blob);
        counts.new += u32::from(found == self.bench.later);
        expect(
            found == self.bench.blob || found == self.bench.later,
            || format!("another blob after {cuts:?}"),
        )?;
        // What was cut inside is the hardest to write beside.
        if cuts.iter().all(|cut| cut.place == Cut::Inside) {
            let (updated, _) = update(&mut machine, plan(&large()?, 7))?;
            expect(updated?.sequence.is_some(), || {
                format!("no update after {cuts:?}")
            })?;
        }
        Ok(settling)
    }

    /// Cuts at these operations, and, for each that is cut inside, at every operation of the start
    /// that follows.
    fn cut_at(&self, places: impl Iterator<Item = u64>) -> Result<[Counts; 2], Failure> {
        let [mut first, mut second] = [Counts::default(); 2];
        for (seed, at) in (1u32..).zip(places) {
            let seed = seed.wrapping_mul(0x9e37_79b9);
            for place in Cut::ALL {
                let cut = PowerCut { at, place, seed };
                let settling = self.cut(&[cut], &mut first)?;
                let again = (0..settling).filter(|_| place == Cut::Inside);
                for (at, place) in again.flat_map(|at| Cut::ALL.map(|place| (at, place))) {
                    self.cut(&[cut, PowerCut { at, place, seed }], &mut second)?;
                }
            }
        }
        Ok([first, second])
    }
}

fn print(name: &str, [first, second]: [Counts; 2]) {
    for (name, counts) in [
        (name.to_owned(), first),
        (format!("{name}_recovery"), second),
    ] {
        let Counts { old, new } = counts;
        println!(
            "RESULT firmware_{name}_cuts={} old={old} new={new} lost=0",
            old + new
        );
    }
}

/// In an update: the new blob runs for certain once the update was answered.
pub fn in_an_update(bench: &Bench) -> Outcome {
    let scene = Scene {
        bench,
        before: |bench| {
            let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
            machine.run_ticks(20)?;
            Ok(machine)
        },
        happens: |bench, machine| {
            let token = 1;
            talk(machine, Updater::new(plan(&bench.later, token)), token)?;
            Ok(())
        },
    };
    let whole = scene.operations()?;
    expect(whole > 100, || format!("{whole} operations"))?;
    // The first words, some between, and the last ones: check, commit word, seal.
    let places = (0..6).map(|k| k * k * whole / 40).chain(whole - 6..whole);
    let counts = scene.cut_at(places)?;
    print("update", counts);
    let [first, second] = counts;
    expect(first.old > 0 && first.new > 0 && second.old > 0, || {
        "all cuts ended alike".to_owned()
    })?;
    let mut last = Counts::default();
    let (at, place, seed) = (whole - 1, Cut::After, 1);
    scene.cut(&[PowerCut { at, place, seed }], &mut last)?;
    expect(last.new == 1, || "the new one is lost".to_owned())
}

/// In the erase that makes room at the start beside a plain blob.
pub fn in_an_erase(bench: &Bench) -> Outcome {
    let scene = Scene {
        bench,
        before: |bench| bench.machine(PART, [&bench.blob, &[0x5a; 4096]]),
        happens: |_, machine| Ok(machine.run_ticks(20)?),
    };
    let whole = scene.operations()?;
    let counts = scene.cut_at(0..whole)?;
    print("erase", counts);
    let [first, second] = counts;
    expect(first.new + second.new == 0, || "a new blob".to_owned())?;
    expect(first.old >= 9 && second.old >= 9, || "few cuts".to_owned())
}

/// In the record that passes over parameters that made the program fault twice.
pub fn in_a_pass_over(bench: &Bench) -> Outcome {
    let scene = Scene {
        bench,
        before: |bench| {
            let mut machine = about_to_crash(bench)?;
            crash(&mut machine)?;
            Ok(machine)
        },
        happens: |_, machine| crash(machine),
    };
    let whole = scene.operations()?;
    expect(whole > 100, || format!("{whole} operations"))?;
    let counts = scene.cut_at([0, 1, whole / 2].into_iter().chain(whole - 3..whole))?;
    print("pass_over", counts);
    let [first, second] = counts;
    expect(first.old > 0 && first.new > 0 && second.new > 0, || {
        "all cuts ended alike".to_owned()
    })
}
