//! What a linear operator is, what a vector is, and how operators are put together.
//!
//! Everything is generic over the vectors, so one solver serves every backend. A vector holds three
//! channels an element, and scalars come as one number a channel: three problems are solved side by side.

mod adjoint;
mod bounds;
mod composed;
mod cpu_vector;
mod lattices;
mod metric;
mod neighbours;
pub(crate) mod parallel;
mod restricted;
mod row_order;
mod row_table;
mod scaled;
mod stacked;
mod sum;
mod tiling;
mod transport;
mod walk_plan;
mod weighted;

pub use adjoint::{AdjointTest, adjoint_test};
pub use bounds::Bounds;
pub use composed::Composed;
pub use cpu_vector::CpuVector;
pub use lattices::Lattices;
pub use metric::{Metric, Scaling};
pub use neighbours::{Gradient, Laplacian, Neighbours};
pub use restricted::Restricted;
pub use row_order::RowOrder;
pub use row_table::{MatrixRows, RowTable};
pub use scaled::{Identity, Scaled};
pub use stacked::{BlockSum, Blocks, Stacked, Under};
pub use sum::Sum;
pub use tiling::{TileBlocks, Tiling};
pub use transport::{FromHost, HostRows, OnHost, Picked, Storage, TransportOperator};
pub(crate) use transport::{brought, fetched};
pub use walk_plan::WalkPlan;
pub use weighted::Weighted;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::Result;

/// One scalar a colour channel.
pub type Scalars = [f64; 3];

/// Elements a side of the tiles that a metric of dense blocks is made of.
pub const TILE_SIDE: usize = 8;

/// A number a channel that may still be under way on a device.
pub trait PendingSum {
    /// Waits for it, and for all that was asked for before it.
    fn value(self) -> Result<Scalars>;
}

impl PendingSum for Scalars {
    fn value(self) -> Result<Scalars> {
        Ok(self)
    }
}

/// A vector with three channels an element. Threads may share it.
///
/// A device does later what it is told; where that fails, the next method that returns a result says so.
pub trait Vector: Sized + Send + Sync {
    /// A sum over the elements that may still be under way. Asking for several together costs one wait.
    type Sum: PendingSum;

    /// The number of elements (each of three channels).
    fn len(&self) -> usize;

    /// Whether it has no element.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A new vector of the same shape, all zero.
    fn zeros_like(&self) -> Self;

    /// Sets every element to one colour.
    fn fill(&mut self, value: Scalars);

    /// self ← other.
    fn copy_from(&mut self, other: &Self);

    /// self ← alpha x + beta self. A channel with beta = 0 forgets what it was, NaN included.
    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars);

    /// self ← factor self.
    fn scale(&mut self, factor: Scalars);

    /// self ← self ∘ x, element by element.
    fn multiply(&mut self, x: &Self);

    /// self ← 1 / self, element by element; 0 where self is 0.
    fn invert(&mut self);

    /// self ← x + factor (x − self): through x and beyond. What stood at x stays there, to the bit.
    fn extrapolate(&mut self, x: &Self, factor: Scalars);

    /// self ← min(max(y + factor (self ∘ x), l), u): a projected step from y against a gradient, in a diagonal metric.
    fn step_within(&mut self, factor: Scalars, x: &Self, y: &Self, bounds: &Bounds);

    /// self ← min(max(self, l), u), element by element.
    fn clamp(&mut self, bounds: &Bounds);

    /// self ← 0 where x is at a bound and going down the gradient would leave the box.
    ///
    /// Of the gradient itself that leaves the projected gradient, which is zero at a solution.
    fn hold(&mut self, x: &Self, gradient: &Self, bounds: &Bounds);

    /// self ← 0 where x is at a bound.
    fn hold_at_bounds(&mut self, x: &Self, bounds: &Bounds);

    /// self ← self ∘ min(x − l, u − x): the nearer the bound, the shorter. Where there is no bound the factor is 1.
    fn shorten(&mut self, x: &Self, bounds: &Bounds);

    /// The largest α a channel with l ≤ x + α self ≤ u, for an x inside; infinite where no bound is met.
    fn largest_step(&self, x: &Self, bounds: &Bounds) -> Result<Scalars>;

    /// ‖projected gradient‖² a channel at x, self the gradient: without what [`Vector::hold`] takes away.
    fn projected_norm_squared_later(&self, x: &Self, bounds: &Bounds) -> Result<Self::Sum>;

    /// ⟨self, other⟩ a channel, more accurate than a sum in the precision of the elements, and always in the same order.
    fn dot_later(&self, other: &Self) -> Result<Self::Sum>;

    /// [`Vector::projected_norm_squared_later`], waited for.
    fn projected_norm_squared(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        self.projected_norm_squared_later(x, bounds)?.value()
    }

    /// [`Vector::dot_later`], waited for.
    fn dot(&self, other: &Self) -> Result<Scalars> {
        self.dot_later(other)?.value()
    }

    /// ‖self‖² a channel.
    fn norm_squared(&self) -> Result<Scalars> {
        self.dot(self)
    }

    /// ‖·‖² of the uppermost block of a stacked vector, of the whole of any other.
    fn upper_norm_squared(&self) -> Result<Scalars> {
        self.norm_squared()
    }

    /// Distance from 1 to the next number that an element can hold.
    fn epsilon(&self) -> f64;

    /// The elements on the host, for checkpoints and results.
    fn to_host(&self) -> Result<Vec<[f64; 3]>>;

    /// Replaces the elements by ones from the host.
    ///
    /// Errors: [`crate::Error::Shape`] for another number of elements.
    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()>;
}

/// An index that stands for no element.
pub const NOWHERE: u32 = u32::MAX;

/// Vectors whose elements can be picked out and put back by index.
pub trait Indexed: Vector {
    /// Indices where the vector lives.
    type Index: std::fmt::Debug + Send + Sync;

    /// Brings indices to where the vector lives.
    fn index(&self, index: &Arc<[u32]>) -> Result<Self::Index>;

    /// `self[k] ← other[index[k]]`, 0 where the index is [`NOWHERE`].
    fn pick(&mut self, other: &Self, index: &Self::Index);

    /// `self ← 0`, but `self[index[k]] ← other[k]`; no index comes twice.
    fn place(&mut self, other: &Self, index: &Self::Index);

    /// `self[k] ← x[heads[k]] − x[tails[k]]`.
    fn difference(&mut self, x: &Self, heads: &Self::Index, tails: &Self::Index);

    /// `self[k] ← self[k] + y[into[k]] − y[out_of[k]]`, with 0 for what is [`NOWHERE`].
    fn divergence(&mut self, y: &Self, into: &Self::Index, out_of: &Self::Index);

    /// A new vector of `len` elements, all zero, where this one lives.
    fn zeros(&self, len: usize) -> Self;
}

/// A linear map with its adjoint, channel by channel.
pub trait LinearOperator {
    /// What it is applied to.
    type Domain: Vector;
    /// What it gives.
    type Range: Vector;

    /// A new vector of the domain, all zero.
    fn domain(&self) -> Self::Domain;

    /// A new vector of the range, all zero.
    fn range(&self) -> Self::Range;

    /// y ← T x.
    ///
    /// Errors: [`crate::Error::Shape`] when a vector does not fit.
    fn apply(&self, x: &Self::Domain, y: &mut Self::Range) -> Result<()>;

    /// x ← Tᵀ y.
    ///
    /// Law     ⟨T x, y⟩ = ⟨x, Tᵀ y⟩, held by [`adjoint_test`]
    /// Errors: [`crate::Error::Shape`] when a vector does not fit.
    fn apply_adjoint(&self, y: &Self::Range, x: &mut Self::Domain) -> Result<()>;
}

/// Whoever points to an operator is one.
macro_rules! operators {
    ($($pointer:ty),*) => {$(
        impl<T: LinearOperator + ?Sized> LinearOperator for $pointer {
            type Domain = T::Domain;
            type Range = T::Range;

            fn domain(&self) -> Self::Domain {
                (**self).domain()
            }

            fn range(&self) -> Self::Range {
                (**self).range()
            }

            fn apply(&self, x: &Self::Domain, y: &mut Self::Range) -> Result<()> {
                (**self).apply(x, y)
            }

            fn apply_adjoint(&self, y: &Self::Range, x: &mut Self::Domain) -> Result<()> {
                (**self).apply_adjoint(y, x)
            }
        }
    )*};
}

operators!(&T, Box<T>, Arc<T>);

/// Room that an operator keeps for what lies between two of its steps. Threads take turns.
///
/// A panic of another thread leaves numbers that are overwritten before they are read.
pub(crate) fn lock<T>(room: &Mutex<T>) -> MutexGuard<'_, T> {
    room.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a vector fits.
pub(crate) fn expect_len(what: &'static str, vector: &impl Vector, expected: usize) -> Result<()> {
    if vector.len() == expected {
        Ok(())
    } else {
        Err(crate::Error::Shape { what, expected, got: vector.len() })
    }
}
