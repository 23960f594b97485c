//! Cuts of the power before, inside and after operations of the flash: in an update, and in the start
//! that settles what a cut has left. Afterwards the old or the new blob runs, and another update is
//! possible.

use super::update::{large, plan, running, update, updated};
use crate::bench::Bench;
use crate::flash_model::PowerCut;
use crate::machine::Machine;
use tests::flash_model::Cut;

/// Something that writes flash.
struct Scene<'b> {
    bench: &'b Bench,
    /// A controller just before it.
    before: fn(&Bench) -> Machine,
    /// It happens, until it is over or the power is cut.
    happens: fn(&Bench, &mut Machine),
}

/// How often each blob ran after cuts.
#[derive(Clone, Copy, Default)]
struct Counts {
    old: u32,
    new: u32,
}

impl Scene<'_> {
    /// Operations of the flash that it takes.
    fn operations(&self) -> usize {
        let mut machine = (self.before)(self.bench);
        let before = machine.chip.flash.sectors.operations;
        (self.happens)(self.bench, &mut machine);
        machine.chip.flash.sectors.operations - before
    }

    /// It happens, and the power is cut. Gives the operations of the last start.
    fn cut(&self, cuts: &[PowerCut], counts: &mut Counts) -> usize {
        let mut machine = (self.before)(self.bench);
        machine.chip.flash.cut_at(cuts);
        (self.happens)(self.bench, &mut machine);
        machine.run_ticks(20);
        assert_eq!(machine.power_cuts as usize, cuts.len(), "{cuts:?}");
        let settling = machine.chip.flash.sectors.operations;
        let found = running(&mut machine);
        counts.old += u32::from(found == self.bench.blob);
        counts.new += u32::from(found == self.bench.later);
        assert!(
            found == self.bench.blob || found == self.bench.later,
            "another blob after {cuts:?}"
        );
        // What was cut inside is the hardest to write beside.
        if cuts.iter().all(|cut| cut.place == Cut::Inside) {
            let updated = updated(&mut machine, &plan(&large()));
            assert!(updated.is_stored, "no update after {cuts:?}");
        }
        settling
    }

    /// Cuts at these operations, and, for each that is cut inside, at every operation of the start
    /// that follows.
    fn cut_at(&self, places: impl Iterator<Item = usize>) -> [Counts; 2] {
        let [mut first, mut second] = [Counts::default(); 2];
        for (seed, at) in (1..).zip(places) {
            for place in Cut::ALL {
                let cut = PowerCut { at, place, seed };
                let settling = self.cut(&[cut], &mut first);
                let again = (0..settling).filter(|_| place == Cut::Inside);
                for (at, place) in again.flat_map(|at| Cut::ALL.map(|place| (at, place))) {
                    self.cut(&[cut, PowerCut { at, place, seed }], &mut second);
                }
            }
        }
        [first, second]
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

/// In an update beside one blob, and beside two: the new blob runs for certain once the update was
/// answered.
pub fn in_an_update(bench: &Bench) {
    let scene = Scene {
        bench,
        before: |bench| bench.running(20),
        happens: |bench, machine| {
            let _cut_or_done = update(machine, &plan(&bench.later));
        },
    };
    let whole = scene.operations();
    assert!(whole > 90, "{whole} operations");
    // The drop of the old slot, its erase, the first words, some between, and the last ones: check,
    // commit word, seal.
    let places = (0..4).chain((1..6).map(|k| k * whole / 6));
    let counts = scene.cut_at(places.chain(whole - 4..whole));
    print("update", counts);
    let [first, second] = counts;
    assert!(
        first.old > 0 && first.new > 0 && second.old > 0,
        "all cuts ended alike"
    );
    let mut last = Counts::default();
    let (at, place, seed) = (whole - 1, Cut::After, 1);
    scene.cut(&[PowerCut { at, place, seed }], &mut last);
    assert!(last.new == 1, "the new one is lost");
    // The older one of two is the field model's, and the newest must stay.
    let beside_two = Scene {
        before: |bench| {
            let mut machine = bench.machine([&large(), &[]]);
            machine.run_ticks(20);
            updated(&mut machine, &plan(&bench.blob));
            machine.power_cycle();
            machine.run_ticks(20);
            machine
        },
        ..scene
    };
    let counts = beside_two.cut_at((0..3).chain(whole - 2..whole));
    print("second_update", counts);
}
