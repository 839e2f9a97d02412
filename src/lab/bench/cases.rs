use crate::scene::{Quadrature, SolverName, Strategy};

/// What is done in a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Task {
    /// T x and Tᵀ y.
    Product,
    /// A solve to a tolerance.
    Solve(SolverName, f64),
}

/// What computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CaseBackend {
    Cpu,
    #[cfg(feature = "gpu")]
    Gpu,
}

/// What lies between the values of the unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum CaseBasis {
    Nearest,
    Linear,
}

/// What weights, rows and unknowns are kept in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Precision {
    F32,
    F64,
}

/// One way to compute something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contender {
    pub(super) task: Task,
    pub(super) place: CaseBackend,
    pub(super) quadrature: Quadrature,
    pub(super) basis: CaseBasis,
    pub(super) precision: Precision,
    pub(super) strategy: Strategy,
}

/// How many of the cases are run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Three marches; solvers with the exact traversal, and one solver with marches.
    Quick,
    /// All products; solvers with all traversals, kept in f32; the exact one also walked, and in f64.
    Usual,
    /// The whole cross product.
    All,
}

/// The strategy of rows over slices, which are near the exact ones.
pub(super) const OVER_SLICES: &str = "epipolar";

/// Steps of the papers' march.
const STEPS: [u32; 9] = [16, 32, 64, 128, 256, 512, 1024, 2048, 4096];
const FEW_STEPS: [u32; 3] = [16, 128, 1024];
/// What a solve of the cross product has to reach, as scenes ask for by default.
const TOLERANCE: f64 = 1e-3;
/// What solvers are also raced to.
const TOLERANCES: [f64; 2] = [1e-2, 1e-4];

impl Contender {
    /// Its name, the same in every run; a case of a scene is `SCENE/` and this.
    pub(super) fn name(&self) -> String {
        let task = match self.task {
            Task::Product => "product".to_owned(),
            Task::Solve(solver, tolerance) => format!("{} {tolerance:e}", solver.name()),
        };
        let traversal = match self.quadrature {
            Quadrature::Exact => "exact".to_owned(),
            Quadrature::March { steps } => format!("march {steps}"),
        };
        let [place, basis, precision, strategy] = self.words();
        format!("{task}/{place}/{traversal}/{basis}/{precision}/{strategy}")
    }

    /// Backend, basis, precision and strategy.
    pub(super) fn words(&self) -> [&'static str; 4] {
        let place = match self.place {
            CaseBackend::Cpu => "cpu",
            #[cfg(feature = "gpu")]
            CaseBackend::Gpu => "gpu",
        };
        let precision = match self.precision {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        };
        let strategy = match self.strategy {
            Strategy::MatrixFree => "matrix-free",
            Strategy::Epipolar => OVER_SLICES,
            _ => "assembled",
        };
        [place, self.basis.name(), precision, strategy]
    }

    /// Whether a level includes it.
    fn is_of(&self, level: Level) -> bool {
        let exact = self.quadrature == Quadrature::Exact;
        let plain = self.precision == Precision::F32 && self.strategy == Strategy::Assembled;
        match (level, self.task) {
            (Level::All, _) | (Level::Usual, Task::Product) => true,
            (Level::Usual, Task::Solve(..)) => exact || plain,
            (Level::Quick, Task::Product) => exact || self.precision == Precision::F32,
            (Level::Quick, Task::Solve(solver, _)) => {
                plain && self.basis == CaseBasis::Linear && (exact || solver == SolverName::default())
            }
        }
    }
}

impl CaseBasis {
    pub(super) const ALL: [Self; 2] = [Self::Nearest, Self::Linear];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Linear => "linear",
        }
    }
}

/// The cases of a level, products first; `marches` where rows can be marched at all, `slices` where they can be put into slices.
pub(super) fn cases(level: Level, places: &[CaseBackend], [marches, slices]: [bool; 2]) -> Vec<Contender> {
    let steps: &[u32] = match (marches, level) {
        (false, _) => &[],
        (_, Level::Quick) => &FEW_STEPS,
        _ => &STEPS,
    };
    let marched = steps.iter().map(|&steps| Quadrature::March { steps });
    let quadratures: Vec<Quadrature> = std::iter::once(Quadrature::Exact).chain(marched).collect();
    let solves = SolverName::ALL.map(|solver| Task::Solve(solver, TOLERANCE));
    let mut cases = Vec::new();
    for task in std::iter::once(Task::Product).chain(solves) {
        for basis in CaseBasis::ALL {
            for &place in places {
                for precision in [Precision::F32, Precision::F64] {
                    for strategy in [Strategy::Assembled, Strategy::MatrixFree] {
                        for &quadrature in &quadratures {
                            cases.push(Contender { task, place, quadrature, basis, precision, strategy });
                        }
                    }
                }
            }
        }
    }
    if slices {
        cases.extend(places.iter().flat_map(|&place| over_slices(place)));
    }
    // Adapters compute in f32.
    cases.retain(|case| {
        case.is_of(level) && (case.place == CaseBackend::Cpu || case.precision == Precision::F32)
    });
    if level != Level::Quick {
        cases.extend(races());
    }
    cases
}

/// Products over slices, and solves by the solver of scenes that such products are corrected in.
fn over_slices(place: CaseBackend) -> impl Iterator<Item = Contender> {
    CaseBasis::ALL.into_iter().flat_map(move |basis| {
        let case = move |task, precision| Contender {
            task,
            place,
            quadrature: Quadrature::Exact,
            basis,
            precision,
            strategy: Strategy::Epipolar,
        };
        let products = [Precision::F32, Precision::F64].map(|precision| case(Task::Product, precision));
        products.into_iter().chain([case(Task::Solve(SolverName::default(), TOLERANCE), Precision::F32)])
    })
}

/// Every solver to tighter and looser tolerances.
fn races() -> impl Iterator<Item = Contender> {
    TOLERANCES.into_iter().flat_map(|tolerance| {
        SolverName::ALL.into_iter().map(move |solver| Contender {
            task: Task::Solve(solver, tolerance),
            place: CaseBackend::Cpu,
            quadrature: Quadrature::Exact,
            basis: CaseBasis::Linear,
            precision: Precision::F32,
            strategy: Strategy::Assembled,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_one_case_each_and_levels_contain_each_other() {
        let names = |level| -> Vec<String> {
            cases(level, &[CaseBackend::Cpu], [true; 2]).iter().map(Contender::name).collect()
        };
        let [quick, usual, all] = [Level::Quick, Level::Usual, Level::All].map(names);
        for names in [&quick, &usual, &all] {
            let mut unique = names.clone();
            unique.sort();
            unique.dedup();
            assert_eq!(unique.len(), names.len());
        }
        assert!(quick.iter().all(|name| usual.contains(name)));
        assert!(usual.iter().all(|name| all.contains(name)));
        // Nine solvers and products, ten traversals, two bases, precisions and strategies; over slices; eighteen races.
        assert_eq!(all.len(), 10 * 10 * 8 + 6 + 18);
        assert!(
            cases(Level::All, &[CaseBackend::Cpu], [false; 2])
                .iter()
                .all(|case| case.quadrature == Quadrature::Exact)
        );
    }
}
