//! Two ways to write the unknowns of the fit: x = (G, r) itself, and the parameters.
//!
//! In x the problem is nearly linear but has no box and no way to fix one parameter. The
//! parameters have both; the chain rule takes gradient and curvature from x to them.

use super::normal::{Column, Point, Square};
use crate::input::stage::{Range, Stage};
use crate::problem::model::{COUNT, Model, ParameterId, SLOPES_MAX};
use crate::problem::parameters::{ETA, Parameters, SLOPES, THETA, search_box};
use nalgebra::{Matrix3, RowVector3};
use runtime::geometry::{ProbeGeometry, SensingAxes, inverse_rows, matrix};

/// Unknowns of a fit and what they mean.
pub trait Coordinates {
    /// The point (G, r), or `None` where PM is singular or an eta is zero.
    fn point(&self, unknowns: &Column) -> Option<Point>;
    /// Derivative of x = (G, r) with respect to the unknowns; `None` where these are x itself.
    fn jacobian(&self, unknowns: &Column, point: &Point) -> Option<Square>;
    /// Which unknowns may change.
    fn free(&self) -> [bool; COUNT];
    /// The places of the unknowns that the model's terms have, fitted or not.
    fn places(&self) -> Vec<usize>;
    /// The nearest unknowns within the box, if there is one.
    fn clip(&self, unknowns: Column) -> Column;
}

/// x itself: nine gains and, where the model fits slopes, their ratios to eta.
#[derive(Clone, Copy, Debug)]
pub struct Gains {
    /// The model.
    pub model: &'static Model,
}

impl Gains {
    /// The unknowns of a point.
    pub fn unknowns(point: &Point) -> Column {
        Column::from_fn(|k, _| {
            if k < 9 {
                point.gain[(k / 3, k % 3)]
            } else {
                point.ratios[(k - 9) / SLOPES_MAX][(k - 9) % SLOPES_MAX]
            }
        })
    }
}

impl Coordinates for Gains {
    fn point(&self, unknowns: &Column) -> Option<Point> {
        Some(Point {
            gain: Matrix3::from_fn(|i, j| unknowns[3 * i + j]),
            ratios: std::array::from_fn(|i| {
                std::array::from_fn(|k| unknowns[9 + SLOPES_MAX * i + k])
            }),
        })
    }

    fn jacobian(&self, _: &Column, _: &Point) -> Option<Square> {
        None
    }

    fn free(&self) -> [bool; COUNT] {
        let slopes = self.model.fitted_slopes();
        std::array::from_fn(|k| k < 9 || (k - 9) % SLOPES_MAX < slopes)
    }

    fn places(&self) -> Vec<usize> {
        let slopes = self.model.slopes().len();
        let held = |k: &usize| *k < 9 || (k - 9) % SLOPES_MAX < slopes;
        (0..COUNT).filter(held).collect()
    }

    fn clip(&self, unknowns: Column) -> Column {
        unknowns
    }
}

/// The parameters within their search box. In place of a lever arm stands where it lies in its
/// range, 0 to 1: the range moves with the misalignment, so only then is the box a box.
#[derive(Clone, Copy, Debug)]
pub struct Boxed<'a> {
    /// Search ranges.
    pub stage: &'a Stage,
    /// The model.
    pub model: &'static Model,
}

/// Step for the derivative of the ends of a lever arm's range, rad: they are sums of sines.
const RANGE_STEP_RAD: f64 = 1e-5;

impl Boxed<'_> {
    fn ranges(&self, misalignment_rad: [f64; 3]) -> [Range; COUNT] {
        search_box(self.stage, self.model, misalignment_rad)
    }

    /// The unknowns of parameters.
    pub fn unknowns(&self, parameters: &Parameters) -> Column {
        let ranges = self.ranges(parameters.geometry().misalignment_rad);
        let mut unknowns = Column::from(parameters.values);
        for k in 0..THETA {
            let width = ranges[k].width();
            let place = (unknowns[k] - ranges[k].low) / width;
            unknowns[k] = if width > 0.0 { place } else { 0.0 };
        }
        unknowns
    }

    /// The parameters of unknowns.
    pub fn parameters(&self, unknowns: &Column) -> Parameters {
        let ranges = self.ranges([0, 1, 2].map(|k| unknowns[THETA + k]));
        let mut values: [f64; COUNT] = (*unknowns).into();
        for k in 0..THETA {
            values[k] = ranges[k].low + unknowns[k] * ranges[k].width();
        }
        Parameters { values }
    }

    /// The nearest parameters within the box.
    pub fn clipped(&self, parameters: &Parameters) -> Parameters {
        let mut values = parameters.values;
        let ranges = self.ranges([0.0; 3]);
        for k in THETA..ETA {
            values[k] = ranges[k].clip(values[k]);
        }
        let ranges = self.ranges([values[3], values[4], values[5]]);
        for id in self.model.free() {
            values[id.index] = ranges[id.index].clip(values[id.index]);
        }
        Parameters { values }
    }

    /// The free parameters that stand at an end of their range. A range without width fixes its
    /// parameter, as the user asked, and is not one of them.
    pub fn at_limit(&self, parameters: &Parameters) -> Vec<ParameterId> {
        let ranges = self.ranges(parameters.geometry().misalignment_rad);
        let free = self.free();
        let at_edge = |id: &ParameterId| {
            let (range, value) = (ranges[id.index], parameters.values[id.index]);
            let edge = 1e-9 * range.width();
            value <= range.low + edge || value >= range.high - edge
        };
        let free = self.model.free().filter(|id| free[id.index]);
        free.filter(at_edge).collect()
    }
}

impl Coordinates for Boxed<'_> {
    fn point(&self, unknowns: &Column) -> Option<Point> {
        point_of(&self.parameters(unknowns))
    }

    fn jacobian(&self, unknowns: &Column, point: &Point) -> Option<Square> {
        let p = self.parameters(unknowns);
        let mut chain = parameter_jacobian(&p, point);
        let theta = p.geometry().misalignment_rad;
        let ranges = self.ranges(theta);
        let before = self.ranges(theta.map(|t| t - RANGE_STEP_RAD));
        let after = self.ranges(theta.map(|t| t + RANGE_STEP_RAD));
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
        Some(chain)
    }

    fn free(&self) -> [bool; COUNT] {
        // Away from zero, where both coordinates of a probe count in its lever arm.
        let ranges = self.ranges([0.1; 3]);
        std::array::from_fn(|k| k < self.model.free_count() && ranges[k].width() > 0.0)
    }

    fn places(&self) -> Vec<usize> {
        (0..3 * self.model.terms.len()).collect()
    }

    fn clip(&self, mut unknowns: Column) -> Column {
        let ranges = self.ranges([0.0; 3]);
        for k in 0..self.model.free_count() {
            unknowns[k] = if k < THETA {
                unknowns[k].clamp(0.0, 1.0)
            } else {
                ranges[k].clip(unknowns[k])
            };
        }
        unknowns
    }
}

/// Derivative of x = (G, r) with respect to the parameters, at the point that they mean.
pub fn parameter_jacobian(p: &Parameters, point: &Point) -> Square {
    let eta = p.eta();
    // PM^-1 = G diag(eta).
    let inverse = Matrix3::from_fn(|i, j| point.gain[(i, j)] * eta[j]);
    let across = SensingAxes::at(p.geometry().misalignment_rad).across();
    let mut out = Square::zeros();
    for probe in 0..3 {
        let [x, y] = across[probe];
        let turned = RowVector3::new(x, y, 0.0);
        let turned = turned * point.gain;
        for i in 0..3 {
            for j in 0..3 {
                let gain = 3 * i + j;
                out[(gain, probe)] = -inverse[(i, probe)] * point.gain[(2, j)];
                out[(gain, THETA + probe)] = -inverse[(i, probe)] * turned[j];
            }
            out[(3 * i + probe, ETA + probe)] = -point.gain[(i, probe)] / eta[probe];
        }
        for k in 0..SLOPES_MAX {
            let ratio = 9 + SLOPES_MAX * probe + k;
            out[(ratio, SLOPES + 3 * k + probe)] = 1.0 / eta[probe];
            out[(ratio, ETA + probe)] = -point.ratios[probe][k] / eta[probe];
        }
    }
    out
}

/// The point (G, r) of a set of parameters, or `None` where PM is singular or an eta is zero.
pub fn point_of(p: &Parameters) -> Option<Point> {
    let inverse = matrix(&inverse_rows(&p.geometry().plane_rows())?);
    let eta = p.eta();
    if eta.iter().any(|eta| !eta.is_normal()) {
        return None;
    }
    let slopes = p.slopes();
    Some(Point {
        gain: Matrix3::from_fn(|i, j| inverse[(i, j)] / eta[j]),
        ratios: [0, 1, 2].map(|probe| slopes[probe].map(|slope| slope / eta[probe])),
    })
}

/// The parameters of a point: G^-1 = diag(eta) PM, whose rows give eta, misalignment and lever
/// arm of each probe. `None` where G is singular. Misalignments come out within a quarter turn.
pub fn parameters_of(point: &Point) -> Option<Parameters> {
    let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| point.gain[(i, j)]));
    let m = inverse_rows(&rows)?;
    let mut geometry = ProbeGeometry {
        lever_arm_m: [0.0; 3],
        misalignment_rad: [0.0; 3],
    };
    let mut eta = [1.0; 3];
    let designed = SensingAxes::at([0.0; 3]);
    for probe in 0..3 {
        let [x, y, arm] = m[probe];
        let part = |[to_x, to_y]: [f64; 2]| x * to_x + y * to_y;
        // Along the designed direction of the sensing axis, which has the sign of eta.
        let (along, across) = (part(designed.0[probe]), part(designed.across()[probe]));
        eta[probe] = x.hypot(y).copysign(along);
        geometry.lever_arm_m[probe] = arm / eta[probe];
        geometry.misalignment_rad[probe] = (across / eta[probe]).atan2(along / eta[probe]);
    }
    let slopes = [0, 1, 2].map(|probe| point.ratios[probe].map(|ratio| ratio * eta[probe]));
    let parameters = Parameters::new(&geometry, eta, slopes);
    let finite = parameters.values.iter().all(|value| value.is_finite());
    finite.then_some(parameters)
}
