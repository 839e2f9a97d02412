use std::time::Duration;

use super::{Extent, Skipping};

/// Resolution and place of a light map or shadow map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapSettings {
    /// Texels along u and along v.
    pub size: [usize; 2],
    /// Whether texels are square: `size` then says how many they are at most, and the extent how many lie along each side.
    pub square_texels: bool,
    /// Where it lies in the light's frame; fitted when not set.
    pub extent: Option<Extent>,
    /// What the extent of a light map is fitted to.
    pub fit: MapFit,
}

impl MapSettings {
    /// So many texels along u and along v, wherever they are needed.
    pub fn new(size: [usize; 2]) -> Self {
        Self { size, square_texels: false, extent: None, fit: MapFit::default() }
    }
}

/// What the extent of a light map is fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MapFit {
    /// 95 % of the light that painted pixels scatter, in the shade of geometry or in open air.
    #[default]
    Scattered,
    /// What rays through painted pixels pass, but not beyond the geometry, as in Kol 2017: light from elsewhere keeps its radiance.
    Seen,
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

/// What is looked for behind paint on light shafts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sought {
    /// The light map of the sun.
    #[default]
    LightMap,
    /// The transfer function that colours scattered light.
    Transfer,
}

/// What a painted colour asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Target {
    /// The painted colour times what the light itself gives there: white asks for no change.
    #[default]
    Tint,
    /// The painted colour times what a white light as bright would give there (Kol 2017, sec. 4.2).
    WhiteTint,
    /// The painted colour is the radiance of the scattered light itself.
    Radiance,
}

/// What the opacity of paint says: of strokes, of their soft edges, and of layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Opacity {
    /// How far the picture goes from what is there to the painted colour: faint paint is a faint tint. Narrow edges of strokes weigh less, wide
    /// ones are gradients.
    #[default]
    Strength,
    /// How much it weighs that the picture has the painted colour (Kol 2017; Klehm 2015, sec. 7.4).
    Weight,
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
    /// Rows over slices, corrected by the exact ones, of which as many are kept as memory allows.
    Epipolar,
}

/// The methods that can solve the least-squares problem; those of the first group keep the bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SolverName {
    /// Projected accelerated gradient with restart.
    #[default]
    Fista,
    /// Spectral projected gradient.
    Spectral,
    /// Projected L-BFGS.
    Lbfgs,
    /// Active-set conjugate gradients with proportioning.
    Mprgp,
    /// Flexible CGLS that stays inside the bounds.
    FlexibleCgls,
    /// The papers' method: CGLS, moved into the bounds after every step. It need not converge.
    ClampedCgls,
    /// Conjugate gradients on the normal equations, without bounds.
    Cgls,
    /// LSQR, without bounds.
    Lsqr,
    /// LSMR, without bounds.
    Lsmr,
}

impl SolverName {
    /// All of them, the default first.
    pub const ALL: [Self; 9] = [
        Self::Fista,
        Self::Spectral,
        Self::Lbfgs,
        Self::Mprgp,
        Self::FlexibleCgls,
        Self::ClampedCgls,
        Self::Cgls,
        Self::Lsqr,
        Self::Lsmr,
    ];

    /// Its name in scene files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fista => "fista",
            Self::Spectral => "spectral",
            Self::Lbfgs => "lbfgs",
            Self::Mprgp => "mprgp",
            Self::FlexibleCgls => "flexible-cgls",
            Self::ClampedCgls => "clamped-cgls",
            Self::Cgls => "cgls",
            Self::Lsqr => "lsqr",
            Self::Lsmr => "lsmr",
        }
    }

    /// Whether it keeps bounds.
    pub fn keeps_bounds(self) -> bool {
        !matches!(self, Self::Cgls | Self::Lsqr | Self::Lsmr)
    }

    /// Bounds, for a solver that keeps any; for others infinite ones.
    pub fn kept(self, bounds: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        if self.keeps_bounds() { bounds } else { [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]] }
    }
}

/// What steps are measured with: the nearer to Aᵀ A, the fewer iterations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MetricName {
    /// The surrogate for FISTA where smoothness is asked for and rows are kept, and for volumes, whose columns are short; else tiles.
    #[default]
    Auto,
    /// Dense blocks of 8 × 8 texels or 4 × 4 × 4 voxels that majorize Aᵀ A; of the methods that can use only a diagonal,
    /// [`Self::Sqs`].
    Tiles,
    /// The diagonal Aᵀ A 1, the separable quadratic surrogate.
    Sqs,
    /// The diagonal of Aᵀ A.
    Jacobi,
    /// Nothing.
    None,
}

/// A weight λ of a term ½ λ ‖R (x − x₀)‖².
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegularizationWeight {
    /// So much, relative to the mean squared column norm of the weighted transport.
    Relative(f64),
    /// Chosen by generalized cross-validation.
    Gcv,
    /// Chosen at the corner of the L-curve.
    LCurve,
}

/// Weights of the regularizers; at most one of them may be left to be chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Regularization {
    /// Of the distance to the start, R = 1.
    pub tikhonov: RegularizationWeight,
    /// Of the first differences between neighbours.
    pub gradient: RegularizationWeight,
    /// Of the sums of first differences around an element.
    pub laplacian: RegularizationWeight,
}

impl Default for Regularization {
    /// The papers' 2⁻⁹ (Klehm 2015, sec. 7.4) on the distance to the start.
    fn default() -> Self {
        Self {
            tikhonov: RegularizationWeight::Relative(f64::powi(2.0, -9)),
            gradient: RegularizationWeight::Relative(0.0),
            laplacian: RegularizationWeight::Relative(0.0),
        }
    }
}

/// How far smoothness carries what is found into elements that no row reaches, but that are seen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Fade {
    /// Such elements keep their start.
    #[default]
    Nowhere,
    /// What is found falls to a part of 1/e over this part of the side of a square as large as the map.
    OfMap(f64),
    /// It does so over this distance, in metres.
    Metres(f64),
}

/// How the problem is discretized and solved.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveSettings {
    /// The method.
    pub solver: SolverName,
    /// Iterations at most.
    pub iterations: usize,
    /// Stop when the normal residual (with bounds, the projected gradient) has fallen to this part of its start.
    pub tolerance: f64,
    /// Stop after this long.
    pub time_limit: Option<Duration>,
    /// Stop when the wanted pixels are met to this part of what is wanted of them, root mean square; 0: never.
    pub noise: Option<f64>,
    /// The least and the largest value of each channel, in the unit of what is looked for; infinite where there is no bound.
    pub bounds: [[f64; 3]; 2],
    /// What steps are measured with, where the method can use it.
    pub metric: MetricName,
    /// Whether elements that no row reaches are filled by diffusion from their neighbours, instead of keeping their start.
    pub fill: bool,
    /// Pulls towards the start what the strokes do not determine.
    pub regularization: Regularization,
    /// How far `regularization.gradient` carries what is found beyond what rows reach.
    pub fade: Fade,
    /// Basis of the light map.
    pub basis: Basis,
    /// How rays are integrated.
    pub quadrature: Quadrature,
    /// Whether the non-zeros are kept.
    pub strategy: Strategy,
    /// Memory that a solve may take, in bytes; none: three quarters of what the machine has free.
    pub memory: Option<u64>,
    /// The error of a product that is allowed where rows are walked anew, relative; inside (0, 1).
    pub accuracy: f64,
    /// Transmittance, inside (0, 1), below which the rest of a ray is skipped.
    pub transmittance_bound: f64,
    /// What else is skipped.
    pub skip: Skipping,
}

impl SolveSettings {
    /// The metric that the method can use of the one that is asked for.
    pub fn metric_in_use(&self) -> MetricName {
        match self.solver {
            SolverName::FlexibleCgls | SolverName::Lsqr | SolverName::Lsmr => MetricName::None,
            // Tiles would be made of rows, one by one, which is what slices save.
            _ if self.strategy == Strategy::Epipolar && self.metric == MetricName::Auto => MetricName::Sqs,
            SolverName::Fista | SolverName::Cgls if self.metric == MetricName::Auto => MetricName::Tiles,
            SolverName::Fista | SolverName::Cgls => self.metric,
            _ if matches!(self.metric, MetricName::Auto | MetricName::Tiles) => MetricName::Sqs,
            _ => self.metric,
        }
    }
}

impl Default for SolveSettings {
    fn default() -> Self {
        Self {
            solver: SolverName::default(),
            iterations: 200,
            tolerance: 1e-3,
            time_limit: None,
            noise: None,
            bounds: [[0.0; 3], [f64::INFINITY; 3]],
            metric: MetricName::default(),
            fill: false,
            regularization: Regularization::default(),
            fade: Fade::default(),
            basis: Basis::default(),
            quadrature: Quadrature::default(),
            strategy: Strategy::default(),
            memory: None,
            accuracy: 1e-6,
            transmittance_bound: f64::powi(2.0, -24),
            skip: Skipping::default(),
        }
    }
}
