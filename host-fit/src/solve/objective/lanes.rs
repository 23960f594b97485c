//! Eight individuals side by side: one number of each in one SIMD register.
//!
//! The operators are the core ones, lane by lane and in the written order, so an individual's
//! cost has the same bits whatever its neighbours, its lane and the instruction set. The
//! compiler turns them into AVX-512, AVX2 or SSE2 where a [`LaneCost`] is evaluated, whichever
//! is the widest that the machine has.

use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::model::SLOPES_MAX;
use crate::solve::search::cost::CostFunction;
use runtime::real::Number;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Individuals in one [`Lanes`].
pub const LANES: usize = 8;

/// One number of each of eight individuals.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

macro_rules! operator {
    ($trait:ident, $name:ident, $operator:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self::lane_by_lane(|k| self.0[k] $operator other.0[k])
            }
        }
        impl $trait<f64> for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                Self::lane_by_lane(|k| self.0[k] $operator other)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Lanes {
    /// Zero for every individual.
    pub const ZERO: Self = Self::splat(0.0);

    /// The same number for every individual.
    #[inline(always)]
    pub const fn splat(x: f64) -> Self {
        Self([x; LANES])
    }

    /// `f` of each lane, written out: `array::map` and `from_fn` are not always inlined, and
    /// then the lanes go through memory.
    #[inline(always)]
    fn lane_by_lane(f: impl Fn(usize) -> f64) -> Self {
        Self([f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)])
    }

    /// `f` of each individual's number.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self::lane_by_lane(|k| f(self.0[k]))
    }

    /// The magnitude of each number.
    #[inline(always)]
    pub fn abs(self) -> Self {
        self.map(f64::abs)
    }

    /// Each number moved into `low..=high`; NaN stays NaN.
    #[inline(always)]
    pub fn clip(self, low: f64, high: f64) -> Self {
        let not_low = self.map(|x| if x < low { low } else { x });
        not_low.map(|x| if x > high { high } else { x })
    }

    /// The smaller of each two numbers; the first where either is NaN.
    #[inline(always)]
    pub fn smaller(self, other: Self) -> Self {
        Self::lane_by_lane(|k| {
            if other.0[k] < self.0[k] {
                other.0[k]
            } else {
                self.0[k]
            }
        })
    }

    /// `values` where this is above `limit`, else NaN.
    #[inline(always)]
    pub fn select_above(self, limit: f64, values: Self) -> Self {
        Self::lane_by_lane(|k| {
            if self.0[k] > limit {
                values.0[k]
            } else {
                f64::NAN
            }
        })
    }
}

/// The equations of the runtime's geometry run on eight individuals at once.
impl Number for Lanes {
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::splat(1.0);

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::splat(value)
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let mut both = (Self::ZERO, Self::ZERO);
        for k in 0..LANES {
            (both.0.0[k], both.1.0[k]) = libm::sincos(self.0[k]);
        }
        both
    }
}

/// `f` of each of three probes or axes, written out as in the lanes.
#[inline(always)]
pub fn each<T>(f: impl Fn(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// The numbers of up to eight individuals: number j of all of them at once.
#[derive(Clone, Copy, Debug)]
pub struct Individuals<'a> {
    numbers: &'a [f64],
    dimensions: usize,
    starts: [usize; LANES],
}

impl<'a> Individuals<'a> {
    /// The individuals that follow each other in `numbers`; the last fills the lanes left over.
    #[inline(always)]
    pub fn new(numbers: &'a [f64], dimensions: usize) -> Self {
        let count = (numbers.len() / dimensions.max(1)).max(1);
        Self {
            numbers,
            dimensions,
            starts: std::array::from_fn(|k| k.min(count - 1) * dimensions),
        }
    }

    /// Number `index` of each individual.
    #[inline(always)]
    pub fn number(&self, index: usize) -> Lanes {
        debug_assert!(index < self.dimensions);
        Lanes::lane_by_lane(|k| self.numbers[self.starts[k] + index])
    }

    /// Numbers `index`, `index + 1` and `index + 2` of each individual.
    #[inline(always)]
    pub fn three(&self, index: usize) -> [Lanes; 3] {
        each(|k| self.number(index + k))
    }
}

/// A cost that is computed for eight individuals at once; every such cost is a
/// [`CostFunction`].
pub trait LaneCost: Sync {
    /// The problem whose fitness it is.
    fn problem(&self) -> &Problem<'_>;
    /// The box, one interval for each number of an individual.
    fn box_of_eight(&self) -> &[Range];
    /// The costs of eight individuals of a model with at most `K` fitted slopes: a constant, so
    /// that the slopes stay in registers. To be inlined, so that it is compiled for the
    /// instruction set at hand.
    fn cost_of_eight<const K: usize>(&self, individuals: &Individuals<'_>) -> Lanes;
}

impl<C: LaneCost> CostFunction for C {
    fn bounds(&self) -> &[Range] {
        self.box_of_eight()
    }

    fn cost(&self, individual: &[f64]) -> f64 {
        let mut cost = [f64::NAN];
        self.costs(individual, &mut cost);
        cost[0]
    }

    /// Eight at a time, with the machine's widest registers.
    fn costs(&self, individuals: &[f64], costs: &mut [f64]) {
        let arch = pulp::Arch::new();
        if self.problem().model.fitted_slopes() <= 3 {
            arch.dispatch(ForEachEight::<C, 3> {
                cost: self,
                individuals,
                costs,
            });
        } else {
            arch.dispatch(ForEachEight::<C, SLOPES_MAX> {
                cost: self,
                individuals,
                costs,
            });
        }
    }

    fn evaluation_ns(&self) -> f64 {
        self.problem().rows.len() as f64
    }
}

/// The loop over individuals: a type and not a closure, since closures are not always inlined
/// into the function that is compiled for the instruction set.
struct ForEachEight<'a, C, const K: usize> {
    cost: &'a C,
    individuals: &'a [f64],
    costs: &'a mut [f64],
}

impl<C: LaneCost, const K: usize> pulp::WithSimd for ForEachEight<'_, C, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let dimensions = self.cost.box_of_eight().len();
        let each = self.individuals.chunks(LANES * dimensions.max(1));
        for (numbers, costs) in each.zip(self.costs.chunks_mut(LANES)) {
            let eight = self
                .cost
                .cost_of_eight::<K>(&Individuals::new(numbers, dimensions));
            costs.copy_from_slice(&eight.0[..costs.len()]);
        }
    }
}
