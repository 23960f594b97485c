//! Cuts of the power.

use super::world::{World, flashed};
use super::{KEY, NEW, OLD, SERIAL, plan};
use host_fit::bus::update::UpdateError;
use tests::flash_model::Cut;
use tests::node::Node;

#[test]
fn a_cut_of_the_power_in_any_operation_leaves_the_old_or_the_new_and_is_reported() {
    let mut whole = World::new(Some(KEY), &[], 5);
    let in_the_start = whole.node.flash().operations;
    assert!(whole.update(&plan(NEW)).is_ok());
    let operations = whole.node.flash().operations;
    let (mut old, mut new) = (0, 0);
    for (at, cut) in (0..operations).flat_map(|at| Cut::ALL.map(|cut| (at, cut))) {
        // Of odd seeds, what was cut reads anew after each start.
        let seed = at as u64;
        let mut flash = flashed(OLD);
        flash.seed(seed);
        flash.cut_at(at, cut);
        let mut world = World::new(Some(KEY), &[], seed);
        world.node = Node::new(Some(SERIAL), Some(KEY), flash, seed);
        let result = world.update(&plan(NEW));
        let found = match &world.after_cuts[..] {
            [blob] => blob.clone(),
            cuts => panic!("{at} {cut:?}: {} cuts", cuts.len()),
        };
        match result {
            Ok(_) => assert_eq!(world.newest(), NEW, "{at} {cut:?}"),
            Err(error) => {
                // After a restart of the machine the servo may be on: it is not declared off again.
                assert_eq!(
                    error,
                    UpdateError::ServoOn { declared: true },
                    "{at} {cut:?}"
                );
                assert_eq!(
                    (&found[..], &world.newest()[..]),
                    (OLD, OLD),
                    "{at} {cut:?}"
                );
                assert!(world.update(&plan(NEW)).is_ok(), "{at} {cut:?}");
            }
        }
        old += u32::from(found == OLD);
        new += u32::from(found == NEW);
        assert!(found == OLD || found == NEW, "{at} {cut:?}");
    }
    let (cuts, in_the_start) = (old + new, 3 * in_the_start as u32);
    println!("RESULT update_cuts={cuts} in_the_start={in_the_start} old={old} new={new}");
    assert!(old > in_the_start && new > 0);
}
