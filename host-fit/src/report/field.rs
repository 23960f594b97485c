//! What a fit of the field model says of itself: noise, uncertainty of the pose, correlations.

use crate::solve::field::fit::FieldFit;
use crate::solve::field::posterior::{Direction, PoseUncertainty};
use serde::Serialize;
use std::fmt::Write;

/// Pairs and directions that are reported.
const PAIRS: usize = 10;
const DIRECTIONS: usize = 3;
/// Parameters named of a direction.
const PARTS: usize = 4;

/// One number for each planar axis.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ByAxis {
    /// X, um.
    pub x_um: f64,
    /// Y, um.
    pub y_um: f64,
    /// Rz, urad.
    pub rz_urad: f64,
}

impl ByAxis {
    /// Of X, Y, Rz in SI.
    pub(super) fn of_si(axes: [f64; 3]) -> Self {
        let [x_um, y_um, rz_urad] = axes.map(|x| x * 1e6);
        Self {
            x_um,
            y_um,
            rz_urad,
        }
    }

    fn words(&self) -> String {
        format!(
            "{:>10.3}{:>10.3}{:>11.3}",
            self.x_um, self.y_um, self.rz_urad
        )
    }
}

/// Standard deviations predicted for a pose.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PosePrediction {
    /// Where.
    pub place: &'static str,
    /// By the parameters: the same at every visit.
    pub systematic: ByAxis,
    /// By the noise of the probes: new in every servo period.
    pub noise: ByAxis,
}

/// Two parameters that stand in for each other.
#[derive(Clone, Debug, Serialize)]
pub struct Correlation {
    /// Their names.
    pub parameters: [String; 2],
    /// From -1 to 1.
    pub correlation: f64,
}

/// A combination of parameters that the log tells apart badly.
#[derive(Clone, Debug, Serialize)]
pub struct WeakDirection {
    /// Variance along it over that of independent parameters.
    pub inflation: f64,
    /// The parameters with the largest shares, in terms of their standard errors.
    pub shares: Vec<(String, f64)>,
}

/// What a fit of the field model says of itself.
#[derive(Clone, Debug, Serialize)]
pub struct FieldReport {
    /// White noise of the probes A, B, C, um.
    pub hall_noise_um: [f64; 3],
    /// Random walk of the reference: after 1 s, growing with the root of time.
    pub reference_drift_after_1_s: ByAxis,
    /// Uncertainty of the pose at rest, as a mean over the range of the log, and at the worst corner
    /// of it.
    pub pose_uncertainty: Vec<PosePrediction>,
    /// The strongest correlations, the strongest first.
    pub strongest_correlations: Vec<Correlation>,
    /// The directions that the log determines worst, the worst first.
    pub weakest_directions: Vec<WeakDirection>,
}

impl FieldReport {
    /// Of a fit.
    pub fn new(fit: &FieldFit) -> Self {
        let pair = |(a, b, correlation)| Correlation {
            parameters: [a, b],
            correlation,
        };
        let direction = |Direction { inflation, parts }| WeakDirection {
            inflation,
            shares: parts,
        };
        let posterior = &fit.posterior;
        Self {
            hall_noise_um: fit.noise.white_mm.map(|mm| mm * 1e3),
            reference_drift_after_1_s: ByAxis::of_si(fit.noise.drift_mm.map(|mm| mm * 1e-3)),
            pose_uncertainty: predictions(fit),
            strongest_correlations: posterior
                .strongest_correlations(PAIRS)
                .into_iter()
                .map(pair)
                .collect(),
            weakest_directions: posterior
                .weakest_directions(DIRECTIONS, PARTS)
                .into_iter()
                .map(direction)
                .collect(),
        }
    }

    /// The same for a terminal.
    pub fn as_text(&self) -> String {
        let [a, b, c] = self.hall_noise_um;
        let ByAxis {
            x_um,
            y_um,
            rz_urad,
        } = self.reference_drift_after_1_s;
        let mut out = format!(
            "\n  noise of the probes {a:.3} / {b:.3} / {c:.3} um; walk of the reference after 1 s \
             {x_um:.3} um, {y_um:.3} um, {rz_urad:.3} urad\n\n  {:<49}{:>10}{:>10}{:>11}\n",
            "predicted standard deviations of a pose", "X (um)", "Y (um)", "Rz (urad)"
        );
        for PosePrediction {
            place,
            systematic,
            noise,
        } in &self.pose_uncertainty
        {
            let _ = writeln!(
                out,
                "  {:<49}{}",
                format!("{place}, by the parameters"),
                systematic.words()
            );
            let _ = writeln!(
                out,
                "  {:<49}{}",
                format!("{place}, by noise"),
                noise.words()
            );
        }
        out.push_str("\n  strongest correlations: ");
        let pairs = self.strongest_correlations.iter().take(PARTS);
        let pairs = pairs.map(|c| {
            format!(
                "{} {} {:.3}",
                c.parameters[0], c.parameters[1], c.correlation
            )
        });
        out.push_str(&pairs.collect::<Vec<_>>().join(", "));
        for WeakDirection { inflation, shares } in self.weakest_directions.iter().take(1) {
            let shares = shares
                .iter()
                .map(|(name, share)| format!("{share:+.2} {name}"));
            let shares = shares.collect::<Vec<_>>().join(" ");
            let _ = write!(
                out,
                "\n  weakest direction: {shares}, its variance {inflation:.1} times that of independent parameters"
            );
        }
        out.push('\n');
        out
    }
}

fn predictions(fit: &FieldFit) -> Vec<PosePrediction> {
    let of = |place, systematic: [f64; 3], noise: [f64; 3]| PosePrediction {
        place,
        systematic: ByAxis::of_si(systematic.map(f64::sqrt)),
        noise: ByAxis::of_si(noise.map(f64::sqrt)),
    };
    let diagonal = |at: &PoseUncertainty| {
        let of = |m: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|k| m[(k, k)]);
        (of(&at.systematic), of(&at.noise))
    };
    let rest = fit
        .posterior
        .at_pose([0.0; 3], [0.0; 3])
        .map(|at| diagonal(&at));
    let corners = (0..64).filter_map(|corner: u32| {
        let side = |axis: usize| if corner >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let planar = [0, 1, 2].map(|k| side(k) * fit.planar_range[k]);
        let vertical = [0, 1, 2].map(|k| side(3 + k) * fit.vertical_range[k]);
        Some(diagonal(&fit.posterior.at_pose(planar, vertical)?))
    });
    // Axis by axis: the worst corner of X need not be that of Y.
    let worst = corners.reduce(|(a, b), (c, d)| {
        let larger = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k].max(b[k]));
        (larger(a, c), larger(b, d))
    });
    let service = &fit.verdict.service;
    let mut all = Vec::new();
    all.extend(rest.map(|(systematic, noise)| of("at rest", systematic, noise)));
    all.push(of(
        "mean over the range of the log",
        service.systematic,
        service.noise,
    ));
    all.extend(worst.map(|(systematic, noise)| of("worst corner of the range", systematic, noise)));
    all
}
