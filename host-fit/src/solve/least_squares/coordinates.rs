//! Two ways to write the unknowns of the fit: x = (G, r) itself, and the 18 parameters.
//!
//! In x the problem is nearly linear but has no box and no way to fix one parameter. The
//! parameters have both; the chain rule takes gradient and curvature from x to them.

use super::normal::{Column, Point, Square};
use crate::input::stage::{Range, Stage};
use crate::problem::parameters::{COUNT, ParameterId, Parameters, search_box};
use nalgebra::{Matrix3, RowVector3};
use runtime::ModelKind;
use runtime::geometry::{ProbeGeometry, inverse_rows, matrix};
use runtime::model::Sensitivity;

/// Unknowns of a fit and what they mean.
pub trait Coordinates {
    /// The point (G, r), or `None` where PM is singular or an eta is zero.
    fn point(&self, unknowns: &Column) -> Option<Point>;
    /// Derivative of x = (G, r) with respect to the unknowns.
    fn jacobian(&self, unknowns: &Column, point: &Point) -> Square;
    /// Which unknowns may change.
    fn free(&self) -> [bool; COUNT];
    /// The nearest unknowns within the box, if there is one.
    fn clip(&self, unknowns: Column) -> Column;
}

/// x itself: nine gains and, where the model has them, nine ratios.
#[derive(Clone, Copy, Debug)]
pub struct Gains {
    /// The model.
    pub model: ModelKind,
}

impl Gains {
    /// The unknowns of a point.
    pub fn unknowns(point: &Point) -> Column {
        Column::from_fn(|k, _| {
            if k < 9 {
                point.gain[(k / 3, k % 3)]
            } else {
                point.ratios[(k - 9) / 3][(k - 9) % 3]
            }
        })
    }
}

impl Coordinates for Gains {
    fn point(&self, unknowns: &Column) -> Option<Point> {
        Some(Point {
            gain: Matrix3::from_fn(|i, j| unknowns[3 * i + j]),
            ratios: std::array::from_fn(|i| std::array::from_fn(|k| unknowns[9 + 3 * i + k])),
        })
    }

    fn jacobian(&self, _: &Column, _: &Point) -> Square {
        Square::identity()
    }

    fn free(&self) -> [bool; COUNT] {
        std::array::from_fn(|k| k < 9 || self.model.has_vertical_terms())
    }

    fn clip(&self, unknowns: Column) -> Column {
        unknowns
    }
}

/// The 18 parameters within their search box. In place of a lever arm stands where it lies in its
/// range, 0 to 1: the range moves with the misalignment, so only then is the box a box.
#[derive(Clone, Copy, Debug)]
pub struct Boxed<'a> {
    /// Search ranges.
    pub stage: &'a Stage,
    /// The model.
    pub model: ModelKind,
}

/// Step for the derivative of the ends of a lever arm's range, rad: they are sums of sines.
const RANGE_STEP_RAD: f64 = 1e-5;

impl Boxed<'_> {
    /// The unknowns of parameters.
    pub fn unknowns(&self, parameters: &Parameters) -> Column {
        let ranges = search_box(self.stage, parameters.geometry.misalignment_rad);
        let mut unknowns = Column::from(parameters.to_array());
        for k in 0..3 {
            let width = ranges[k].width();
            let place = (unknowns[k] - ranges[k].low) / width;
            unknowns[k] = if width > 0.0 { place } else { 0.0 };
        }
        unknowns
    }

    /// The parameters of unknowns.
    pub fn parameters(&self, unknowns: &Column) -> Parameters {
        let ranges = search_box(self.stage, [unknowns[3], unknowns[4], unknowns[5]]);
        let mut p: [f64; COUNT] = (*unknowns).into();
        for k in 0..3 {
            p[k] = ranges[k].low + unknowns[k] * ranges[k].width();
        }
        Parameters::from_array(&p)
    }

    /// The nearest parameters within the box.
    pub fn clipped(&self, parameters: &Parameters) -> Parameters {
        let mut p = parameters.to_array();
        let ranges = self.stage.search.of("theta_deg").unwrap_or_default();
        for (theta, range) in p[3..6].iter_mut().zip(ranges) {
            *theta = range.clip(*theta);
        }
        let ranges = search_box(self.stage, [p[3], p[4], p[5]]);
        for (k, (p, range)) in p.iter_mut().zip(ranges).enumerate() {
            if ParameterId::at(k).is_free_in(self.model) {
                *p = range.clip(*p);
            }
        }
        Parameters::from_array(&p)
    }

    /// The free parameters that stand at an end of their range. A range without width fixes its
    /// parameter, as the user asked, and is not one of them.
    pub fn at_limit(&self, parameters: &Parameters) -> Vec<ParameterId> {
        let ranges = search_box(self.stage, parameters.geometry.misalignment_rad);
        let values = parameters.to_array();
        let edges = ranges.iter().zip(values).map(|(range, value)| {
            let edge = 1e-9 * range.width();
            value <= range.low + edge || value >= range.high - edge
        });
        let free = self.free();
        ParameterId::all()
            .zip(edges)
            .zip(free)
            .filter(|((_, at_edge), free)| *at_edge && *free)
            .map(|((id, _), _)| id)
            .collect()
    }
}

impl Coordinates for Boxed<'_> {
    fn point(&self, unknowns: &Column) -> Option<Point> {
        point_of(&self.parameters(unknowns))
    }

    fn jacobian(&self, unknowns: &Column, point: &Point) -> Square {
        let p = self.parameters(unknowns);
        let mut chain = parameter_jacobian(&p, point);
        let theta = p.geometry.misalignment_rad;
        let ranges = search_box(self.stage, theta);
        let before = search_box(self.stage, theta.map(|t| t - RANGE_STEP_RAD));
        let after = search_box(self.stage, theta.map(|t| t + RANGE_STEP_RAD));
        for k in 0..3 {
            let slope =
                |at: fn(&Range) -> f64| (at(&after[k]) - at(&before[k])) / (2.0 * RANGE_STEP_RAD);
            let arm_per_theta = slope(|range| range.low) + unknowns[k] * slope(Range::width);
            for row in 0..COUNT {
                let per_arm = chain[(row, k)];
                chain[(row, 3 + k)] += per_arm * arm_per_theta;
                chain[(row, k)] = per_arm * ranges[k].width();
            }
        }
        chain
    }

    fn free(&self) -> [bool; COUNT] {
        // Away from zero, where both coordinates of a probe count in its lever arm.
        let ranges = search_box(self.stage, [0.1; 3]);
        std::array::from_fn(|k| {
            ParameterId::at(k).is_free_in(self.model) && ranges[k].width() > 0.0
        })
    }

    fn clip(&self, mut unknowns: Column) -> Column {
        let ranges = search_box(self.stage, [0.0; 3]);
        for k in 0..COUNT {
            if k < 3 {
                unknowns[k] = unknowns[k].clamp(0.0, 1.0);
            } else if ParameterId::at(k).is_free_in(self.model) {
                unknowns[k] = ranges[k].clip(unknowns[k]);
            }
        }
        unknowns
    }
}

/// Derivative of x = (G, r) with respect to the 18 parameters, at the point that they mean.
pub fn parameter_jacobian(p: &Parameters, point: &Point) -> Square {
    let eta = p.eta();
    // PM^-1 = G diag(eta).
    let inverse = Matrix3::from_fn(|i, j| point.gain[(i, j)] * eta[j]);
    let mut out = Square::zeros();
    for probe in 0..3 {
        let (sin, cos) = p.geometry.misalignment_rad[probe].sin_cos();
        let turned = if probe < 2 {
            RowVector3::new(-cos, -sin, 0.0)
        } else {
            RowVector3::new(-sin, cos, 0.0)
        };
        let turned = turned * point.gain;
        for i in 0..3 {
            for j in 0..3 {
                let gain = 3 * i + j;
                out[(gain, probe)] = -inverse[(i, probe)] * point.gain[(2, j)];
                out[(gain, 3 + probe)] = -inverse[(i, probe)] * turned[j];
            }
            out[(3 * i + probe, 6 + probe)] = -point.gain[(i, probe)] / eta[probe];
        }
        for k in 0..3 {
            let ratio = 9 + 3 * probe + k;
            out[(ratio, 9 + 3 * k + probe)] = 1.0 / eta[probe];
            out[(ratio, 6 + probe)] = -point.ratios[probe][k] / eta[probe];
        }
    }
    out
}

/// The point (G, r) of a set of parameters, or `None` where PM is singular or an eta is zero.
pub fn point_of(p: &Parameters) -> Option<Point> {
    let inverse = matrix(&inverse_rows(&p.geometry.plane_rows())?);
    let eta = p.eta();
    if eta.iter().any(|eta| !eta.is_normal()) {
        return None;
    }
    let ratio = |s: Sensitivity<f64>| {
        [
            s.per_z_m / s.eta,
            s.per_rx_rad / s.eta,
            s.per_ry_rad / s.eta,
        ]
    };
    Some(Point {
        gain: Matrix3::from_fn(|i, j| inverse[(i, j)] / eta[j]),
        ratios: p.sensitivity.map(ratio),
    })
}

/// The parameters of a point: G^-1 = diag(eta) PM, whose rows give eta, misalignment and lever
/// arm of each probe. `None` where G is singular. Misalignments come out within a quarter turn.
pub fn parameters_of(point: &Point) -> Option<Parameters> {
    let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| point.gain[(i, j)]));
    let m = inverse_rows(&rows)?;
    let mut lever_arm_m = [0.0; 3];
    let mut misalignment_rad = [0.0; 3];
    let mut sensitivity = [Sensitivity::constant(1.0); 3];
    for probe in 0..3 {
        let [x, y, arm] = m[probe];
        // The designed direction of the sensing axis has the sign of eta.
        let (along, across) = if probe < 2 { (y, -x) } else { (x, y) };
        let eta = x.hypot(y).copysign(along);
        lever_arm_m[probe] = arm / eta;
        misalignment_rad[probe] = (across / eta).atan2(along / eta);
        let r = point.ratios[probe];
        sensitivity[probe] = Sensitivity {
            eta,
            per_z_m: r[0] * eta,
            per_rx_rad: r[1] * eta,
            per_ry_rad: r[2] * eta,
        };
    }
    let parameters = Parameters {
        geometry: ProbeGeometry {
            lever_arm_m,
            misalignment_rad,
        },
        sensitivity,
    };
    parameters
        .to_array()
        .iter()
        .all(|p| p.is_finite())
        .then_some(parameters)
}
