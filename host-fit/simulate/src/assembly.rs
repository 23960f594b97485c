//! A stage from the workshop: the designed one with drawn tolerances.
//!
//! | quantity | drawn |
//! |---|---|
//! | H1x .. H3y, eta | evenly in the inner 60 % of the search ranges of `stage.toml` |
//! | yaw theta of a sensor, magnet and probe together | 0.3 deg |
//! | probe off the centre line of its magnet, across / along u | 0.25 mm / 0.02 mm |
//! | probe off its tilt-neutral height (a tilt does not change its signal there) | 2.5 mm |
//! | edges of the magnet * | within 50 um |
//! | direction of the magnetisation, two angles * | within 1.5 deg |
//! | seat of the magnet, three angles * | within 0.5 deg |
//! | axis of the probe, two angles * | within 1 deg |
//! | curvature of the element, even and odd * | within 0.3 % at 2 mm |
//!
//! "Within" means evenly between the limits. The other figures are standard deviations of normal
//! numbers. Tolerances with a star are zero for an even seed and drawn for an odd seed
//! ([`Magnets::from_seed`]).
//!
//! Along u a probe is placed at zero flux at rest, as the paper asks, with an error of 0.02 mm. The
//! values come from a fit of this probe model to the service logs of three stages: across -0.6 to 0.1 mm,
//! along up to 0.03 mm, height up to 5.5 mm, yaw up to 0.5 deg; the residuals are the noise. Tolerances
//! are narrower here where H is drawn wider than on these stages, so that Model (31) has the same errors
//! in service.

use super::magnet::Cuboid;
use super::probe::{HallProbe, MAGNET_HALF_M, TILT_LEVER_M, TrimmedProbe, designed_magnet, gap_m};
use super::random::{Purpose, Stream};
use hallstage_input::rotation::rotation;
use hallstage_input::stage::{Range, Stage, paper_signs};
use nalgebra::Vector3;
use std::f64::consts::PI;

const DEG: f64 = PI / 180.0;
/// The share of a search range, about its middle, that is drawn from.
const INNER: f64 = 0.6;
const YAW_RAD: f64 = 0.3 * DEG;
const ACROSS_M: f64 = 0.25e-3;
const ALONG_M: f64 = 0.02e-3;
const HEIGHT_M: f64 = 2.5e-3;
const EDGE_M: f64 = 50e-6;
const MAGNETISATION_RAD: f64 = 1.5 * DEG;
const SEAT_RAD: f64 = 0.5 * DEG;
const AXIS_RAD: f64 = 1.0 * DEG;
const CURVATURE: f64 = 3e-3;
const CURVATURE_AT_M: f64 = 2e-3;

/// The quality of the magnets and Hall elements of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Magnets {
    /// Cuboids as designed, elements without curvature.
    AsDesigned,
    /// With the tolerances of a workshop.
    Imperfect,
}

impl Magnets {
    /// As designed for an even seed, imperfect for an odd one.
    pub const fn from_seed(seed: u64) -> Self {
        if seed.is_multiple_of(2) {
            Self::AsDesigned
        } else {
            Self::Imperfect
        }
    }
}

/// The three probes with their magnets, as assembled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assembly {
    /// A, B, C.
    pub probes: [TrimmedProbe; 3],
}

impl Assembly {
    /// The stage of a seed.
    pub fn draw(stage: &Stage, seed: u64) -> Self {
        let mut random = Stream::new(seed, Purpose::Assembly, 0);
        let imperfect = match Magnets::from_seed(seed) {
            Magnets::AsDesigned => 0.0,
            Magnets::Imperfect => 1.0,
        };
        let h = paper_signs(stage.search.places_m);
        let etas = etas(stage);
        let probes = [0, 1, 2].map(|i| {
            let place = h[i].map(|range| inner(range, &mut random));
            let place = paper_signs([place; 3])[i];
            // From X to the axis u.
            let heading = [PI / 2.0, PI / 2.0, 0.0][i] + stage.probes[i].theta_rad;
            let sensitivity = inner(etas[i], &mut random);
            probe(&mut random, place, sensitivity, heading, imperfect).trimmed()
        });
        Self { probes }
    }
}

/// The search ranges of eta; the designed value where a stage has none.
fn etas(stage: &Stage) -> [Range; 3] {
    stage.search.get("eta").unwrap_or([Range::new(1.0, 1.0); 3])
}

fn inner(range: Range, random: &mut Stream) -> f64 {
    let middle = 0.5 * (range.low + range.high);
    middle + INNER * range.width() * (random.uniform() - 0.5)
}

/// A probe at (x, y). The tolerances of the magnet are drawn, then multiplied by `imperfect`, 0 or 1.
fn probe(
    random: &mut Stream,
    [x_m, y_m]: [f64; 2],
    sensitivity: f64,
    heading_rad: f64,
    imperfect: f64,
) -> HallProbe {
    let position_m = Vector3::new(x_m, y_m, TILT_LEVER_M + random.normal(HEIGHT_M));
    let yaw = heading_rad + random.normal(YAW_RAD);
    let height_m = MAGNET_HALF_M.z + gap_m(sensitivity);
    let along_m = random.normal(ALONG_M);
    let at_rest_m = Vector3::new(0.0, random.normal(ACROSS_M), height_m);
    let mut three = |limit: f64| [(); 3].map(|()| imperfect * random.between(-limit, limit));
    let edges_m = Vector3::from(three(EDGE_M));
    let [_, pitch, turn] = three(MAGNETISATION_RAD);
    let seat = rotation(three(SEAT_RAD));
    let [roll, tip, _] = three(AXIS_RAD);
    let [even, odd, _] = three(CURVATURE);
    let designed = designed_magnet();
    let mut probe = HallProbe {
        position_m,
        axis: rotation([roll, tip, 0.0]) * Vector3::z(),
        at_rest_m,
        mount: rotation([0.0, 0.0, yaw]),
        seat,
        magnet: Cuboid {
            half_m: designed.half_m + edges_m * 0.5,
            remanence: rotation([0.0, pitch, turn]) * designed.remanence,
        },
        curvature: [
            even / CURVATURE_AT_M,
            odd / (CURVATURE_AT_M * CURVATURE_AT_M),
        ],
    };
    probe.centre();
    probe.at_rest_m.x += along_m;
    probe
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::StagePose;
    use hallstage_input::shipped::stage;

    fn slope(probe: &TrimmedProbe, axis: usize) -> f64 {
        let mut pose = StagePose::default();
        pose.planar[axis] = 1e-5;
        probe.signal_m(&pose) / 1e-5
    }

    #[test]
    fn each_seed_gives_another_stage_whose_probes_sense_their_axis_within_the_search_ranges() {
        let stage = stage();
        let assemblies: Vec<_> = (0..40).map(|seed| Assembly::draw(&stage, seed)).collect();
        for (seed, assembly) in assemblies.iter().enumerate() {
            assert!(!assemblies[..seed].contains(assembly), "seed {seed}");
            for (i, probe) in assembly.probes.iter().enumerate() {
                let [sensed, across] = if i == 2 { [0, 1] } else { [1, 0] };
                let eta = slope(probe, sensed);
                assert!(etas(&stage)[i].contains(eta), "seed {seed}: {eta}");
                let theta = (slope(probe, across) / eta).atan();
                let thetas = stage.search.get("theta_deg").expect("a range");
                assert!(thetas[i].contains(theta), "seed {seed}: {theta}");
            }
        }
    }
}
