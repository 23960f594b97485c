//! The 81 parameters of the field model: names, units, order and prior.

use super::temperature::Coefficient;
use runtime::model::Shape;

/// Parameters of one probe.
pub const PER_PROBE: usize = 27;
/// Parameters of the model.
pub const COUNT: usize = 3 * PER_PROBE;
/// The first parameters of a probe belong to Model (31); from this place on they do not.
pub const BEYOND_MODEL_31: usize = CARRY;
/// The monomials of p.
pub const SHAPE: usize = 18;
/// The coefficients of p take u, w and p in this unit, m: their sizes are then about one.
pub(super) const SHAPE_UNIT_M: f64 = 1e-3;

/// Place of the lever arm among the parameters of a probe.
pub const LEVER_ARM: usize = 0;
/// Place of theta.
pub const THETA: usize = 1;
/// Place of eta.
pub const ETA: usize = 2;
/// Place of a, b, c.
pub const SLOPES: usize = 3;
/// Place of E.
pub const CARRY: usize = 6;
/// Place of the coefficients of p.
pub(super) const SHAPES: usize = 9;

/// A parameter of one probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Its name without the probe, for instance `eta` or `uw2`.
    pub name: &'static str,
    /// Its unit: SI for all but the coefficients of p, which take u, w and p in mm.
    pub unit: &'static str,
    /// Standard deviation of the prior about zero; `None` for a flat prior.
    pub prior: Option<f64>,
    /// Powers of u, w and z in the monomial; zeros for what is not a coefficient of p.
    pub powers: [u8; 3],
}

const fn flat(name: &'static str, unit: &'static str) -> Term {
    Term {
        name,
        unit,
        prior: None,
        powers: [0; 3],
    }
}

const fn held(name: &'static str, unit: &'static str, prior: f64, powers: [u8; 3]) -> Term {
    Term {
        name,
        unit,
        prior: Some(prior),
        powers,
    }
}

/// The parameters of one probe in order.
///
/// The priors are twice what a designed magnet of 12.7 x 6.4 x 6.4 mm and a workshop's
/// tolerances give, the same for every stage.
pub const TERMS: [Term; PER_PROBE] = [
    flat("lever_arm", "m"),
    flat("theta", "rad"),
    flat("eta", "1"),
    flat("a", "1/m"),
    flat("b", "1/rad"),
    flat("c", "1/rad"),
    held("e_z", "1", 0.18, [0; 3]),
    held("e_rx", "m/rad", 0.066, [0; 3]),
    held("e_ry", "m/rad", 0.038, [0; 3]),
    held("uw", "1/mm", 0.05, [1, 1, 0]),
    held("uw2", "1/mm2", 0.042, [1, 2, 0]),
    held("uz2", "1", 0.47, [1, 0, 2]),
    held("u3", "1/mm2", 0.0069, [3, 0, 0]),
    held("uwz", "1/mm", 0.025, [1, 1, 1]),
    held("uw2z", "1/mm2", 0.018, [1, 2, 1]),
    held("u3z", "1/mm2", 0.054, [3, 0, 1]),
    held("uz3", "1", 0.92, [1, 0, 3]),
    held("w2", "1/mm", 0.022, [0, 2, 0]),
    held("wz", "1", 0.094, [0, 1, 1]),
    held("z2", "mm", 0.26, [0, 0, 2]),
    held("u2", "1/mm", 0.009, [2, 0, 0]),
    held("w2z", "1/mm", 0.021, [0, 2, 1]),
    held("w3", "1/mm2", 0.0026, [0, 3, 0]),
    held("wz2", "1", 0.11, [0, 1, 2]),
    held("u2z", "1/mm", 0.016, [2, 0, 1]),
    held("u2w", "1/mm2", 0.0014, [2, 1, 0]),
    held("z3", "mm", 0.53, [0, 0, 3]),
];

/// The name of the parameter at `index` (probe A's 27, then B's, then C's), for instance
/// `uw2_b`. `index` is taken modulo [`COUNT`].
pub fn name(index: usize) -> String {
    let probe = ["a", "b", "c"][index / PER_PROBE % 3];
    format!("{}_{probe}", TERMS[index % PER_PROBE].name)
}

/// The names of the rows of a covariance: all parameters, then (k, h) of A, B, C if it has more rows.
pub fn names(rows: usize) -> Vec<String> {
    let temperature = Coefficient::ALL.map(Coefficient::name);
    (0..COUNT).map(name).chain(temperature).take(rows).collect()
}

/// Where the decoder has the coefficient of the monomial with these powers of u, w and z.
fn coefficient(p: &mut Shape<f64>, [u, w, z]: [u8; 3]) -> &mut f64 {
    let z = usize::from(z);
    match (u, w) {
        (1, 2) => &mut p.u_w_w[z],
        (1, 1) => &mut p.u_w[z],
        (1, 0) => &mut p.u_z_z[z - 2],
        (3, _) => &mut p.u_u_u[z],
        (2, 0) => &mut p.u_u[z],
        (2, _) => &mut p.u_u_w,
        (_, 3) => &mut p.w_w_w,
        (_, 2) => &mut p.w_w[z],
        (_, 1) => &mut p.w_z[z - 1],
        _ => &mut p.z_z[z - 2],
    }
}

/// The coefficients of p, in the order of [`TERMS`], where the decoder has them.
pub(super) fn shape(coefficients: [f64; SHAPE]) -> Shape<f64> {
    let mut p = Shape::default();
    for (term, value) in TERMS[SHAPES..].iter().zip(coefficients) {
        *coefficient(&mut p, term.powers) = value;
    }
    p
}

/// The coefficients of p in the order of [`TERMS`]: the inverse of [`shape`].
pub(super) fn shape_list(p: &Shape<f64>) -> [f64; SHAPE] {
    let mut p = *p;
    std::array::from_fn(|k| *coefficient(&mut p, TERMS[SHAPES + k].powers))
}
