use std::time::Duration;

use super::Extent;

/// Resolution and place of a light map or shadow map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapSettings {
    /// Texels along u and along v.
    pub size: [usize; 2],
    /// Where it lies in the light's frame; fitted when not set.
    pub extent: Option<Extent>,
}

/// What lies between the values of a light map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Basis {
    /// Constant in each texel.
    Nearest,
    /// Bilinear between texel centres, constant beyond the outermost ones.
    #[default]
    Bilinear,
}

/// How the integral along a view ray is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quadrature {
    /// Cell by cell, in closed form.
    #[default]
    Exact,
    /// The papers' march: this many steps of equal length from the eye to where the ray ends or leaves the light map,
    /// each worth its midpoint.
    March {
        /// Steps a ray.
        steps: u32,
    },
}

/// What a painted colour asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Target {
    /// The painted colour times the radiance that a white light map gives there (Kol 2017, sec. 4.2).
    #[default]
    Tint,
    /// The painted colour is the radiance of the scattered light itself.
    Radiance,
}

/// Whether the non-zeros of the transport are kept or walked again in each application.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Strategy {
    /// As many rows are kept as the memory budget allows, the others are walked again.
    #[default]
    Auto,
    /// All rows are kept; an error when they exceed the budget.
    Assembled,
    /// No row is kept.
    MatrixFree,
}

/// The methods that can solve the least-squares problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SolverName {
    /// Conjugate gradients on the normal equations.
    #[default]
    Cgls,
    /// The papers' method: CGLS with negative values set to zero after every step. It need not converge.
    ClampedCgls,
}

/// Weights λ of the terms ½ λ ‖R (x − x₀)‖², relative to the mean squared column norm of the weighted transport.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Regularization {
    /// Of the distance to the start, R = 1.
    pub tikhonov: f64,
}

impl Default for Regularization {
    /// The papers' 2⁻⁹ (Klehm 2015, sec. 7.4).
    fn default() -> Self {
        Self { tikhonov: f64::powi(2.0, -9) }
    }
}

/// How the problem is discretized and solved.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveSettings {
    /// The method.
    pub solver: SolverName,
    /// Iterations at most.
    pub iterations: usize,
    /// Stop when the normal residual has fallen to this part of its start.
    pub tolerance: f64,
    /// Stop after this long.
    pub time_limit: Option<Duration>,
    /// Pulls towards the start what the strokes do not determine.
    pub regularization: Regularization,
    /// Basis of the light map.
    pub basis: Basis,
    /// How rays are integrated.
    pub quadrature: Quadrature,
    /// Whether the non-zeros are kept.
    pub strategy: Strategy,
    /// Memory that a solve may take, in bytes; none: three quarters of what the machine has free.
    pub memory: Option<u64>,
    /// The rest of a ray is skipped once its transmittance is below this.
    pub transmittance_bound: f64,
}

impl Default for SolveSettings {
    fn default() -> Self {
        Self {
            solver: SolverName::default(),
            iterations: 32,
            tolerance: 1e-3,
            time_limit: None,
            regularization: Regularization::default(),
            basis: Basis::default(),
            quadrature: Quadrature::default(),
            strategy: Strategy::default(),
            memory: None,
            transmittance_bound: f64::powi(2.0, -24),
        }
    }
}
