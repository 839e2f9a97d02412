//! How the document wants to be solved.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{self, Fade, Regularization, Skipping, SolveSettings, SolverName};

use super::channels::Channels;
use super::flaw::{Built, Flaw, checked, within};
use super::size::MemorySize;
use super::weight::Weight;

/// How the problem is discretized and solved. What is not given has the default of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Solve {
    /// The method.
    pub solver: Solver,
    /// Iterations at most, from 1 to 1000000.
    pub iterations: usize,
    /// Stop when the projected gradient (for methods without bounds, the normal residual) has fallen to this part of its
    /// start; from 0 (never) to below 1.
    pub tolerance: f64,
    /// Stop after this many seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Stop when the wanted pixels are met to this part of what is wanted of them, root mean square; from 0 (never) to below 1. Where it is not
    /// given, extinction behind noisy pictures stops where pixels that are kept out of the fit come no nearer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Least radiance of a texel: one number or [r, g, b].
    pub lower: Channels,
    /// Largest radiance of a texel: one number or [r, g, b]; no bound when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<Channels>,
    /// Pull towards the start; 0 for none. When not given it is 2⁻⁹, and for volumes that are painted 25 n / 2¹⁹, n³ being their voxels with
    /// extinction: what paint leaves open then fades over n/5 voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tikhonov: Option<Weight>,
    /// Pull towards equal neighbours; 0 for none. When not given it is (n / 512)³ for light maps, n² being their texels, and (n / 2)³ / 2¹⁶ for
    /// volumes that are painted: so those of any size are equally smooth. For volumes of which there are pictures it is 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<Weight>,
    /// Pull towards the mean of the neighbours; 0 for none.
    pub laplacian: Weight,
    /// How far `gradient` carries what is found into texels that no stroke reaches but some view sees lit: the distance in the plane of the
    /// light, in the unit of the scene, over which it falls to a third (1/e); 0 for nowhere. When not given, 1/32 of the side of a square as large as the
    /// light map. Volumes have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fade: Option<f64>,
    /// What steps are measured with: the nearer to the normal matrix, the fewer iterations.
    pub metric: MetricName,
    /// Whether texels that no painted ray reaches are filled from their neighbours, instead of keeping their start.
    pub fill: bool,
    /// How the integral along a view ray is taken.
    pub quadrature: Quadrature,
    /// Whether the non-zeros of the transport are kept or walked again in each application.
    pub strategy: Strategy,
    /// Memory that a solve may take, such as "4GiB"; three quarters of what is free when not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemorySize>,
    /// The error of a picture that is allowed where the rows of a volume are walked anew on the processor, relative: 1e-6, or 1e-5,
    /// 2e-4 and 2e-3 for fewer nodes along each ray. Rows that are kept are exact.
    pub accuracy: f64,
    /// The rest of a ray is skipped once its transmittance is below this; inside (0, 1).
    pub transmittance_bound: f64,
    /// What else is skipped: all that no result depends on. Switches are there to see what that is worth.
    #[serde(skip_serializing_if = "Skip::is_default")]
    #[schemars(!skip_serializing_if)]
    pub skip: Skip,
}

/// What is skipped because no result depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skip {
    /// Rays through pixels of which nothing is wanted.
    pub pixels: bool,
    /// Unknowns that no row reaches. Weights of `gradient` and `laplacian` need it.
    pub unknowns: bool,
    /// Texels of shadow maps, where a node of their pyramid is lit or shadowed as a whole.
    pub shadows: bool,
    /// Bricks of voxels that hold nothing.
    pub bricks: bool,
    /// Iterations of channels that have converged.
    pub channels: bool,
}

impl Skip {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for Skip {
    fn default() -> Self {
        Skipping::default().into()
    }
}

/// The methods that can solve the problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Projected accelerated gradient with restart.
    Fista,
    /// Spectral projected gradient.
    Spectral,
    /// Projected L-BFGS.
    Lbfgs,
    /// Active-set conjugate gradients with proportioning.
    Mprgp,
    /// Flexible CGLS that stays inside the bounds.
    FlexibleCgls,
    /// CGLS, moved into the bounds after every step, as in the papers; it need not converge.
    ClampedCgls,
    /// Conjugate gradients on the normal equations, without bounds.
    Cgls,
    /// LSQR, without bounds.
    Lsqr,
    /// LSMR, without bounds.
    Lsmr,
}

/// What steps are measured with. LSQR, LSMR and flexible CGLS do without; `tiles` is for FISTA and CGLS, the others take
/// `sqs` in its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MetricName {
    /// `sqs` for volumes, and for FISTA where `gradient` or `laplacian` are asked for and rows are kept; else `tiles`.
    Auto,
    /// Dense blocks of 8 × 8 texels or 4 × 4 × 4 voxels.
    Tiles,
    /// The product of the matrix and its transpose with ones, the separable quadratic surrogate.
    Sqs,
    /// The diagonal of the normal matrix.
    Jacobi,
    /// Nothing.
    None,
}

/// How the integral along a view ray is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Quadrature {
    /// Cell by cell, in closed form.
    Exact,
    /// The papers' march in steps of equal length.
    March {
        /// Steps a ray, from 1 to 100000.
        steps: u32,
    },
}

/// Whether the non-zeros of the transport are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// As many rows are kept as the memory budget allows.
    Auto,
    /// All rows are kept; an error when they exceed the budget.
    Assembled,
    /// No row is kept.
    MatrixFree,
    /// Rows over slices, whose cost does not grow with the maps, corrected by the exact ones until these agree. For light maps.
    Epipolar,
}

impl Default for Solve {
    fn default() -> Self {
        let settings = SolveSettings::default();
        Self {
            solver: settings.solver.into(),
            iterations: settings.iterations,
            tolerance: settings.tolerance,
            seconds: settings.time_limit.map(|limit| limit.as_secs_f64()),
            noise: settings.noise,
            lower: Channels::Rgb(settings.bounds[0]).simplest(),
            upper: None,
            tikhonov: None,
            gradient: None,
            laplacian: settings.regularization.laplacian.into(),
            fade: None,
            metric: settings.metric.into(),
            fill: settings.fill,
            quadrature: settings.quadrature.into(),
            strategy: settings.strategy.into(),
            memory: settings.memory.map(MemorySize),
            accuracy: settings.accuracy,
            transmittance_bound: settings.transmittance_bound,
            skip: settings.skip.into(),
        }
    }
}

/// Pull to equal neighbours of light maps of so many texels, and the part of the map over which it fades: measured in docs/light_maps.md.
const GRADIENT: f64 = 1.0;
const GRADIENT_AT: f64 = 512.0 * 512.0;
const FADE: f64 = 1.0 / 32.0;
/// Pull to the start of all that is not painted in volumes: the papers' (Klehm 2015, sec. 7.4).
const TIKHONOV: f64 = 1.0 / 512.0;
/// Pull to equal neighbours a voxel of a painted medium, and the part of its width over which what was found fades: measured in docs/volumes.md.
const PAINTED: f64 = 1.0 / 524_288.0;
const FADES: f64 = 5.0;
const ITERATIONS: [usize; 2] = [1, 1_000_000];
const STEPS: [u32; 2] = [1, 100_000];

impl Solve {
    /// The settings of a solve for a light map of so many texels with this basis.
    pub(super) fn build_light_map(&self, texels: usize, basis: scene::Basis) -> Built<SolveSettings> {
        let fade = match self.fade {
            None => Fade::OfMap(FADE),
            Some(0.0) => Fade::Nowhere,
            Some(length) => {
                let is_length = |length: f64| (1e-9..=1e9).contains(&length);
                Fade::Metres(checked(
                    "fade",
                    length,
                    "a distance from 1e-9 to 1e9, or 0 for nowhere",
                    is_length,
                )?)
            }
        };
        Ok(SolveSettings {
            basis,
            fade,
            ..self.build([TIKHONOV.into(), self.gradient_of_light_map(texels)])?
        })
    }

    /// The settings of a solve for a volume; of one that is painted with its voxels with extinction.
    pub(super) fn build_volume(&self, painted: Option<usize>) -> Built<SolveSettings> {
        if let Some(fade) = self.fade {
            return Err(Flaw::value("fade", fade, "left away: it is for light maps"));
        }
        let [tikhonov, gradient] = painted.map_or([TIKHONOV, 0.0], |voxels| {
            let gradient = voxels as f64 * PAINTED;
            // Differences over so many voxels weigh as much as the distance to the start.
            [gradient * (FADES / (voxels.max(1) as f64).cbrt()).powi(2), gradient]
        });
        let settings = self.build([tikhonov.into(), self.gradient.unwrap_or_else(|| gradient.into())])?;
        Ok(SolveSettings { basis: scene::Basis::Nearest, ..settings })
    }

    /// The squares of a column of the transport fall with the third power of a map's side.
    fn gradient_of_light_map(&self, texels: usize) -> Weight {
        self.gradient.unwrap_or_else(|| (GRADIENT * (texels as f64 / GRADIENT_AT).powf(1.5)).into())
    }

    /// Puts in the settings that are not given, for a light map of so many texels.
    pub(super) fn settle_light_map(&mut self, texels: usize) {
        self.gradient = Some(self.gradient_of_light_map(texels));
        self.tikhonov.get_or_insert_with(|| TIKHONOV.into());
    }

    /// Puts in the settings that are not given, for a volume that is not painted. They follow from the medium of one that is.
    pub(super) fn settle_volume(&mut self) {
        self.gradient.get_or_insert_with(|| 0.0.into());
        self.tikhonov.get_or_insert_with(|| TIKHONOV.into());
    }

    /// With these pulls to the start, where none is given, and to equal neighbours.
    fn build(&self, [tikhonov, gradient]: [Weight; 2]) -> Built<SolveSettings> {
        let tikhonov = self.tikhonov.unwrap_or(tikhonov);
        let regularization = Regularization {
            tikhonov: tikhonov.build("tikhonov")?,
            gradient: gradient.build("gradient")?,
            laplacian: self.laplacian.build("laplacian")?,
        };
        let open = [("tikhonov", tikhonov), ("gradient", gradient), ("laplacian", self.laplacian)];
        if let Some((name, _)) = open.iter().filter(|(_, weight)| weight.is_open()).nth(1) {
            return Err(Flaw::new(
                *name,
                "only one weight can be chosen by a rule; give the others as numbers",
            ));
        }
        Ok(SolveSettings {
            solver: self.solver.into(),
            iterations: within("iterations", self.iterations, ITERATIONS)?,
            tolerance: checked("tolerance", self.tolerance, "from 0 to below 1", |t| {
                (0.0..1.0).contains(&t)
            })?,
            time_limit: self.seconds.map(time_limit).transpose()?,
            noise: self
                .noise
                .map(|noise| checked("noise", noise, "from 0 to below 1", |n| (0.0..1.0).contains(&n)))
                .transpose()?,
            bounds: self.bounds()?,
            metric: self.metric.into(),
            fill: self.fill,
            regularization,
            fade: Fade::Nowhere,
            basis: scene::Basis::default(),
            quadrature: self.quadrature.build()?,
            strategy: self.strategy.into(),
            memory: self.memory.map(|size| size.0),
            accuracy: checked("accuracy", self.accuracy, "above 0 and below 1", |accuracy| {
                accuracy > 0.0 && accuracy < 1.0
            })?,
            transmittance_bound: checked(
                "transmittance_bound",
                self.transmittance_bound,
                "above 0 and below 1",
                |bound| bound > 0.0 && bound < 1.0,
            )?,
            skip: self.skip.into(),
        })
    }
}

impl Solve {
    fn bounds(&self) -> Built<[[f64; 3]; 2]> {
        // f32 is what texels are.
        let fits = |bound: Channels| bound.wide().iter().all(|bound| bound.abs() <= f64::from(f32::MAX));
        for (name, bound) in [("lower", Some(self.lower)), ("upper", self.upper)] {
            if let Some(bound) = bound.filter(|bound| !fits(*bound)) {
                return Err(Flaw::value(name, bound, "a number that a texel can hold"));
            }
        }
        let lower = self.lower.wide();
        let Some(bound) = self.upper else { return Ok([lower, [f64::INFINITY; 3]]) };
        let upper = bound.wide();
        if (0..3).any(|c| lower[c] > upper[c]) {
            return Err(Flaw::value("upper", bound, "not below `lower` in any channel"));
        }
        if !SolverName::from(self.solver).keeps_bounds() {
            return Err(Flaw::new(
                "upper",
                "this solver keeps no bounds; choose another or leave `upper` away",
            ));
        }
        Ok([lower, upper])
    }
}

fn time_limit(seconds: f64) -> Built<Duration> {
    let limit = Duration::try_from_secs_f64(seconds).ok().filter(|limit| !limit.is_zero());
    limit.ok_or_else(|| Flaw::value("seconds", seconds, "a number of seconds above 0"))
}

impl Quadrature {
    pub(super) fn build(self) -> Built<scene::Quadrature> {
        Ok(match self {
            Self::Exact => scene::Quadrature::Exact,
            Self::March { steps } => {
                scene::Quadrature::March { steps: within("quadrature.march.steps", steps, STEPS)? }
            }
        })
    }
}

impl From<scene::Quadrature> for Quadrature {
    fn from(quadrature: scene::Quadrature) -> Self {
        match quadrature {
            scene::Quadrature::Exact => Self::Exact,
            scene::Quadrature::March { steps } => Self::March { steps },
        }
    }
}

/// The same names here and in the scene, so that neither can gain one without the other.
macro_rules! same_names {
    ($document:ident, $scene:ident: $($name:ident),+) => {
        impl From<$document> for scene::$scene {
            fn from(name: $document) -> Self {
                match name { $($document::$name => Self::$name),+ }
            }
        }

        impl From<scene::$scene> for $document {
            fn from(name: scene::$scene) -> Self {
                match name { $(scene::$scene::$name => Self::$name),+ }
            }
        }
    };
}

impl From<Skip> for Skipping {
    fn from(Skip { pixels, unknowns, shadows, bricks, channels }: Skip) -> Self {
        Self { pixels, unknowns, shadows, bricks, channels }
    }
}

impl From<Skipping> for Skip {
    fn from(Skipping { pixels, unknowns, shadows, bricks, channels }: Skipping) -> Self {
        Self { pixels, unknowns, shadows, bricks, channels }
    }
}

same_names!(
    Solver, SolverName: Fista, Spectral, Lbfgs, Mprgp, FlexibleCgls, ClampedCgls, Cgls, Lsqr, Lsmr
);
same_names!(MetricName, MetricName: Auto, Tiles, Sqs, Jacobi, None);
same_names!(Strategy, Strategy: Auto, Assembled, MatrixFree, Epipolar);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_object_is_the_default_of_the_library() {
        let solve: Solve = serde_json::from_str("{}").unwrap();
        assert_eq!(
            solve.build_volume(None).unwrap(),
            SolveSettings { basis: scene::Basis::Nearest, ..SolveSettings::default() }
        );
        // 64³ painted voxels: ½, and the distance to the start as differences over 64/5 voxels.
        let painted = solve.build_volume(Some(64 * 64 * 64)).unwrap().regularization;
        assert_eq!(painted.gradient, scene::RegularizationWeight::Relative(0.5));
        let scene::RegularizationWeight::Relative(tikhonov) = painted.tikhonov else { unreachable!() };
        assert!((tikhonov - 0.5 * (5.0 / 64.0_f64).powi(2)).abs() < 1e-12, "{tikhonov}");
        let regularization = Regularization {
            gradient: scene::RegularizationWeight::Relative(GRADIENT),
            ..Regularization::default()
        };
        let smooth = SolveSettings { regularization, fade: Fade::OfMap(FADE), ..SolveSettings::default() };
        assert_eq!(solve.build_light_map(512 * 512, scene::Basis::default()).unwrap(), smooth);
    }

    #[test]
    fn every_field_reaches_the_settings() {
        let text = r#"{"solver": "clamped-cgls", "iterations": 7, "tolerance": 0.5, "seconds": 1.5, "tikhonov": 2,
            "gradient": "gcv", "laplacian": 0.5, "fade": 2.5, "noise": 0.1, "lower": -1.5, "upper": [1, 2, 3], "metric": "jacobi",
             "fill": true, "quadrature": {"march": {"steps": 9}}, "strategy": "matrix-free", "memory": "3KiB",
            "accuracy": 0.125, "transmittance_bound": 0.25, "skip": {"shadows": false, "channels": false}}"#;
        let solve: Solve = serde_json::from_str(text).unwrap();
        let expected = SolveSettings {
            solver: SolverName::ClampedCgls,
            iterations: 7,
            tolerance: 0.5,
            time_limit: Some(Duration::from_millis(1500)),
            noise: Some(0.1),
            bounds: [[-1.5; 3], [1.0, 2.0, 3.0]],
            metric: scene::MetricName::Jacobi,
            fill: true,
            regularization: Regularization {
                tikhonov: scene::RegularizationWeight::Relative(2.0),
                gradient: scene::RegularizationWeight::Gcv,
                laplacian: scene::RegularizationWeight::Relative(0.5),
            },
            fade: Fade::Metres(2.5),
            basis: scene::Basis::Nearest,
            quadrature: scene::Quadrature::March { steps: 9 },
            strategy: scene::Strategy::MatrixFree,
            memory: Some(3072),
            accuracy: 0.125,
            transmittance_bound: 0.25,
            skip: Skipping { shadows: false, channels: false, ..Skipping::default() },
        };
        assert_eq!(solve.build_light_map(64, scene::Basis::Nearest).unwrap(), expected);
    }

    #[test]
    fn settings_out_of_range_are_refused_at_their_fault() {
        let table = [
            (r#"{"iterations": 0}"#, "iterations"),
            (r#"{"tolerance": 1}"#, "tolerance"),
            (r#"{"tolerance": -1e-9}"#, "tolerance"),
            (r#"{"seconds": 0}"#, "seconds"),
            (r#"{"seconds": 1e300}"#, "seconds"),
            (r#"{"tikhonov": -1}"#, "tikhonov"),
            (r#"{"gradient": -1e-9}"#, "gradient"),
            (r#"{"fade": -1}"#, "fade"),
            (r#"{"fade": 1e308}"#, "fade"),
            (r#"{"tikhonov": "gcv", "laplacian": "l-curve"}"#, "laplacian"),
            (r#"{"noise": -0.1}"#, "noise"),
            (r#"{"noise": 1}"#, "noise"),
            (r#"{"lower": 2, "upper": [3, 3, 1]}"#, "upper"),
            (r#"{"lower": 1e300}"#, "lower"),
            (r#"{"solver": "lsqr", "upper": 1}"#, "upper"),
            (r#"{"quadrature": {"march": {"steps": 0}}}"#, "quadrature.march.steps"),
            (r#"{"transmittance_bound": 0}"#, "transmittance_bound"),
            (r#"{"accuracy": 0}"#, "accuracy"),
            (r#"{"accuracy": 1}"#, "accuracy"),
        ];
        for (text, expected) in table {
            let solve: Solve = serde_json::from_str(text).unwrap();
            let Err(Flaw::Document { path, .. }) = solve.build_light_map(64, scene::Basis::Nearest) else {
                unreachable!("{text} was accepted")
            };
            assert_eq!(path, expected);
        }
    }
}
