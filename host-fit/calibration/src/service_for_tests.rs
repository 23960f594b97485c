//! True errors in service of a simulated stage, for tests.

use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_solver::estimator::parameters::FieldConstants;
use runtime::VerticalPose;

/// The rms error in service, the noise of the probes included, over that noise alone (`floor`, m, m, rad): of the worst
/// axis. The constants decode signals in m.
pub fn worst_ratio(
    constants: &FieldConstants,
    stage: &Assembly,
    seed: u64,
    floor: [f64; 3],
) -> f64 {
    let service = Protocol::Service.run(0.002, seed);
    let (mut squares, mut count) = ([0.0; 3], 0.0);
    for pose in service.movements.iter().flatten().step_by(50) {
        let signal_m = stage.probes.map(|probe| probe.signal_m(pose));
        let vertical = VerticalPose::from_array(pose.vertical);
        let decoded = constants.decode(signal_m, &vertical).to_array();
        for axis in 0..3 {
            squares[axis] += (decoded[axis] - pose.planar[axis]).powi(2);
        }
        count += 1.0;
    }
    let ratio = |k: usize| (1.0 + squares[k] / count / floor[k].powi(2)).sqrt();
    ratio(0).max(ratio(1)).max(ratio(2))
}
