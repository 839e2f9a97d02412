use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::cells::{Cells, numbered};
use super::{Formulation, Part};
use crate::operator::{
    Blocks, Bounds, CpuVector, Gradient, Identity, Indexed, Laplacian, LinearOperator, Metric, NOWHERE,
    Neighbours, Restricted, Scaled, Scaling, Stacked, Tiling, TransportOperator, Under, Vector, Weighted,
    brought, fetched,
};
use crate::scene::{MetricName, RegularizationWeight, Rgb, SolveSettings};
use crate::solve::{LeastSquares, Limits, Rule, Term, choose_weight};
use crate::{Error, Result};

/// λ of the regularizers, as they multiply ½‖·‖²; zero where one is not used.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RegularizationWeights {
    /// Of the squared distance to the start.
    pub tikhonov: f64,
    /// Of the squared sums of the differences around an element.
    pub laplacian: f64,
    /// Of the squared differences between neighbours.
    pub gradient: f64,
}

/// T, and what may stand for it while a method iterates.
#[derive(Debug)]
pub struct Transports<'a, O> {
    /// T, which what is found is certified with.
    pub exact: &'a O,
    /// An operator that is near T and takes less time; none where T itself is iterated with.
    pub near: Option<&'a O>,
}

impl<'a, O> From<&'a O> for Transports<'a, O> {
    fn from(exact: &'a O) -> Self {
        Self { exact, near: None }
    }
}

impl<O> Clone for Transports<'_, O> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<O> Copy for Transports<'_, O> {}

impl<'a, O> Transports<'a, O> {
    /// What is iterated with.
    fn used(self) -> &'a O {
        self.near.unwrap_or(self.exact)
    }
}

/// `[W T E; √λᵢ Rᵢ] x = [W b; √λᵢ Rᵢ x₀]`, with all that a method needs to solve it.
///
/// Rows of T are divided by the norm of a typical column, so that f32 serves media of any density alike and a λ relative
/// to the columns is a λ.
pub struct System<'a, V: Indexed, R = V> {
    operator: Stacked<'a, V, R>,
    /// W T E of T itself, where another operator stands for it above.
    exact: Option<Box<dyn LinearOperator<Domain = V, Range = R> + 'a>>,
    rhs: Blocks<R, V>,
    start: V,
    bounds: Bounds,
    /// The elements that are unknown: those that a row reaches and those that stand for cells, unless nothing is skipped.
    columns: Vec<u32>,
    /// What the rows are divided by.
    norm: f64,
    /// λ of the divided rows.
    weights: RegularizationWeights,
    /// λ of each unknown's pull towards its start, relative to [`RegularizationWeights::tikhonov`].
    pulls: Vec<f64>,
    /// λ of the pull by which what no row reaches fades, relative to that of the gradient; 0 of what a row reaches.
    fades: Vec<f64>,
    /// Cells over what no row reaches, where it is joined to what is found.
    cells: Option<Cells>,
    metric: Option<Box<dyn Metric<V>>>,
    applications: usize,
}

impl<'a, V: Indexed + 'static, R: Vector + 'static> System<'a, V, R> {
    /// The system with the weights that the settings ask for. `coverage` is diag(Tᵀ diag(w) T) of this problem.
    ///
    /// Errors: [`Error::Value`] naming a setting or a row's weight, [`Error::Empty`] when no element is reached,
    /// [`Error::Shape`].
    pub fn new<O>(
        problem: &Formulation,
        transports: impl Into<Transports<'a, O>>,
        coverage: &CpuVector,
        settings: &SolveSettings,
    ) -> Result<Self>
    where
        O: TransportOperator<Domain = V, Range = R> + 'a,
    {
        problem.check()?;
        let transports = transports.into();
        let mut system = Self::without_regularization(problem, transports, coverage, settings)?;
        let regularizers = system.regularizers(problem, coverage, settings)?;
        system.weights = system.choose(settings, &regularizers)?;
        system.metric = system.build_metric(problem, transports.used(), coverage, settings, &regularizers)?;
        system.regularize(regularizers)
    }

    /// λ of the rows as they are.
    pub fn absolute_weights(&self) -> RegularizationWeights {
        let RegularizationWeights { tikhonov, gradient, laplacian } = self.weights;
        let square = self.norm.powi(2);
        RegularizationWeights {
            tikhonov: square * tikhonov,
            gradient: square * gradient,
            laplacian: square * laplacian,
        }
    }

    /// λ relative to the mean squared column norm, as settings give them.
    pub fn relative_weights(&self) -> RegularizationWeights {
        self.weights
    }

    /// [W T E; √λᵢ Rᵢ].
    pub fn operator(&self) -> &Stacked<'a, V, R> {
        &self.operator
    }

    /// x₀ of the unknown elements.
    pub fn start(&self) -> &V {
        &self.start
    }

    /// The elements that are unknown, in increasing order.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Applications of the transport that setting up took.
    pub fn applications(&self) -> usize {
        self.applications
    }

    /// The operator with T itself, where another one stands for it.
    pub fn exact(&self) -> Option<Under<'_, V, R>> {
        self.exact.as_ref().map(|exact| self.operator.under(&**exact))
    }

    /// What a method solves.
    pub fn problem(&self) -> LeastSquares<'_, Stacked<'a, V, R>> {
        let problem = LeastSquares::new(&self.operator, &self.rhs).bounded(self.bounds.clone());
        match &self.metric {
            Some(metric) => problem.measured(&**metric),
            None => problem,
        }
    }

    /// When to stop; the noise is relative to what is wanted.
    pub fn limits(&self, problem: &Formulation, settings: &SolveSettings) -> Limits {
        let discrepancy = settings
            .noise
            .filter(|&noise| noise > 0.0)
            .map(|noise| problem.wanted.iter().sum::<f64>() * (noise / self.norm).powi(2));
        Limits {
            iterations: settings.iterations,
            tolerance: settings.tolerance,
            time: settings.time_limit,
            discrepancy,
            carry_on: !settings.skip.channels,
        }
    }

    /// All elements, given the unknown ones; the others keep the start, moved into the bounds.
    ///
    /// Errors: [`Error::Value`] naming a bound; those of fetching x from where it is.
    pub fn all_elements(&self, problem: &Formulation, x: &V) -> Result<Vec<Rgb>> {
        let mut elements = CpuVector(problem.starts());
        elements.clamp(&problem.bounds()?);
        let x = fetched(x)?;
        self.columns.iter().zip(x).for_each(|(&column, value)| elements.0[column as usize] = value);
        if let Some(cells) = self.cells.clone() {
            let part = &problem.parts[0];
            cells.spread(&mut elements.0[..part.start.len()], part.start.of(0), part.fade);
        }
        Ok(elements.0)
    }

    /// The unknown elements of all.
    pub(super) fn unknown(&self, elements: &[Rgb]) -> Result<V> {
        let picked: Vec<Rgb> = self.columns.iter().map(|&column| elements[column as usize]).collect();
        brought(self.operator.domain(), &picked)
    }

    fn without_regularization(
        problem: &Formulation,
        transports: Transports<'a, impl TransportOperator<Domain = V, Range = R>>,
        coverage: &CpuVector,
        settings: &SolveSettings,
    ) -> Result<Self> {
        let reached = reached(coverage);
        if reached.is_empty() {
            return Err(Error::Empty {
                reason: "the light of the pixels is too weak to be computed with".to_owned(),
                remedy: problem.remedy,
            });
        }
        let elements = problem.elements();
        let (square, scales) = mean_squared_column_norms(problem, coverage);
        let norm = square.sqrt();
        let joins = settings.regularization.gradient != RegularizationWeight::Relative(0.0);
        let cells = if joins { cells_of(problem, &reached) } else { None };
        let spread = if joins { spread(problem) } else { Vec::new() };
        let columns = match (settings.skip.unknowns, &cells) {
            (true, None) if !spread.is_empty() => union(&reached, &spread),
            (true, None) => reached,
            (true, Some(cells)) => {
                let mut columns = reached;
                columns.extend(cells.each().map(|(element, _)| element));
                columns.sort_unstable();
                columns
            }
            (false, _) => (0..elements as u32).collect(),
        };
        let factor = |weight: f32| (f64::from(weight).sqrt() / norm) as f32;
        let factors: Vec<Rgb> = problem.weights.iter().map(|weights| weights.map(factor)).collect();
        let operator = transports.used();
        let brought_factors = || brought(operator.range(), &factors);
        let (mut picked, mut pulls) = (Vec::with_capacity(columns.len()), Vec::with_capacity(columns.len()));
        let before = |end: usize| columns.partition_point(|&column| (column as usize) < end);
        for ((range, part), scale) in problem.ranges().zip(scales) {
            let unknown = before(range.start)..before(range.end);
            pulls.resize(unknown.end, part.pull * scale);
            picked
                .extend(columns[unknown].iter().map(|&column| part.start.of(column as usize - range.start)));
        }
        let mut fades = vec![0.0; columns.len()];
        for (element, count) in cells.iter().flat_map(Cells::each) {
            let unknown = before(element as usize);
            (pulls[unknown], fades[unknown]) = (0.0, problem.parts[0].fade * count as f64);
        }
        let start = brought(operator.domain().zeros(columns.len()), &picked)?;
        // Where every element is unknown, there is nothing to leave out.
        let (operator, targets) = if columns.len() == elements {
            weighted(operator, brought_factors()?, &problem.targets)?
        } else {
            weighted(Restricted::new(operator, columns.clone())?, brought_factors()?, &problem.targets)?
        };
        let exact: Option<Box<dyn LinearOperator<Domain = V, Range = R> + 'a>> = match transports.near {
            None => None,
            Some(_) => {
                let exact = Restricted::new(transports.exact, columns.clone())?;
                Some(Box::new(Weighted::new(exact, brought_factors()?)?))
            }
        };
        let mut bounds = Bounds::NONE;
        if settings.solver.keeps_bounds() {
            for (part, [lower, upper]) in problem.bounds()?.parts(elements) {
                bounds = bounds.then(before(part.start), Bounds::new(lower, upper)?);
            }
        }
        Ok(Self {
            operator,
            exact,
            rhs: Blocks::new(targets, Vec::new()),
            start,
            bounds,
            columns,
            norm,
            weights: RegularizationWeights::default(),
            pulls,
            fades,
            cells,
            metric: None,
            applications: 0,
        })
    }

    fn regularizers(
        &self,
        problem: &Formulation,
        coverage: &CpuVector,
        settings: &SolveSettings,
    ) -> Result<Regularizers<V>> {
        let is_even = self.pulls.iter().all(|&pull| pull == 1.0);
        let asked = settings.regularization;
        // Who lies beside whom takes much memory, and often nobody asks.
        let among_neighbours = [asked.gradient, asked.laplacian] != [RegularizationWeight::Relative(0.0); 2];
        Ok(Regularizers {
            tikhonov: match is_even {
                false => {
                    let roots: Vec<Rgb> = self.pulls.iter().map(|pull| [pull.sqrt() as f32; 3]).collect();
                    let roots = brought(self.operator.domain(), &roots)?;
                    Box::new(Weighted::new(Identity::scaled(&self.start, [1.0; 3]), roots)?)
                }
                true => Box::new(Identity::scaled(&self.start, [1.0; 3])),
            },
            fade: match self.fades.iter().any(|&fade| fade > 0.0) {
                true => {
                    let roots: Vec<Rgb> = self.fades.iter().map(|fade| [fade.sqrt() as f32; 3]).collect();
                    let roots = brought(self.operator.domain(), &roots)?;
                    Some(Weighted::new(Identity::scaled(&self.start, [1.0; 3]), roots)?)
                }
                false => None,
            },
            among_neighbours: if among_neighbours {
                let (neighbours, strengths) = self.neighbours(problem, coverage, settings)?;
                let neighbours = Arc::new(neighbours);
                let gradient = Gradient::new(neighbours.clone(), &self.start)?;
                Some(AmongNeighbours {
                    gradient: match strengths.is_empty() {
                        true => Box::new(gradient),
                        false => {
                            let roots: Vec<Rgb> = strengths.iter().map(|it| [it.sqrt(); 3]).collect();
                            let roots = brought(gradient.range(), &roots)?;
                            Box::new(Weighted::new(gradient, roots)?)
                        }
                    },
                    laplacian: Laplacian::new(neighbours.clone(), &self.start)?,
                    neighbours,
                })
            } else {
                None
            },
        })
    }

    /// Which unknowns lie side by side, and how strongly each pair pulls at each other; nothing where all do alike. What is unknown only because nothing is skipped is nobody's neighbour.
    fn neighbours(
        &self,
        problem: &Formulation,
        coverage: &CpuVector,
        settings: &SolveSettings,
    ) -> Result<(Neighbours, Vec<f32>)> {
        if let Some(cells) = &self.cells {
            let pairs = cells.pairs();
            let strengths = cells.weights(&pairs).collect();
            let pairs = pairs.map(|pairs| numbered(&pairs, &self.columns, problem.elements()));
            return Ok((Neighbours::of_pairs(self.columns.len(), &pairs), strengths));
        }
        if let Some((range, part)) = problem.ranges().find(|(_, part)| !part.pairs.is_empty()) {
            let first = range.start as u32;
            let pairs: Vec<[u32; 2]> =
                part.pairs.iter().map(|pair| pair.map(|number| first + number)).collect();
            let pairs = numbered(&pairs, &self.columns, problem.elements());
            let known: Vec<[u32; 2]> = pairs.into_iter().filter(|pair| !pair.contains(&NOWHERE)).collect();
            return Ok((Neighbours::of_pairs(self.columns.len(), &[known]), Vec::new()));
        }
        let mut places = problem.places(&self.columns);
        if !settings.skip.unknowns {
            let reached = union(&reached(coverage), &spread(problem));
            let alone = places.iter_mut().zip(&self.columns);
            let alone = alone.filter(|(_, column)| reached.binary_search(column).is_err());
            alone.for_each(|(place, _)| *place = NOWHERE);
        }
        Ok((Neighbours::new(problem.lattices(), &places)?, Vec::new()))
    }

    /// The relative weights. One that the settings leave open is chosen by its rule.
    fn choose(
        &mut self,
        settings: &SolveSettings,
        regularizers: &Regularizers<V>,
    ) -> Result<RegularizationWeights> {
        let asked = settings.regularization;
        let asked = [asked.tikhonov, asked.gradient, asked.laplacian];
        let mut rule = None;
        let mut weights = [None; 3];
        for (i, name) in ["tikhonov", "gradient", "laplacian"].into_iter().enumerate() {
            match asked[i] {
                // Not `< 0`: a NaN must not pass.
                RegularizationWeight::Relative(weight) if !(weight >= 0.0 && weight.is_finite()) => {
                    return Err(Error::value(name, weight, "finite and not negative"));
                }
                RegularizationWeight::Relative(weight) => weights[i] = Some(weight),
                RegularizationWeight::Gcv => rule = Some(Rule::Gcv),
                RegularizationWeight::LCurve => rule = Some(Rule::LCurve),
            }
        }
        if let Some(rule) = rule {
            type Operators<'o, V> = Vec<&'o dyn LinearOperator<Domain = V, Range = V>>;
            let mut operators: Operators<V> = vec![&*regularizers.tikhonov];
            if let Some(AmongNeighbours { gradient, laplacian, .. }) = &regularizers.among_neighbours {
                operators.push(&**gradient);
                operators.push(laplacian);
            }
            let terms = operators.into_iter().zip(weights).filter(|(_, weight)| *weight != Some(0.0));
            let terms: Vec<_> = terms.map(|(operator, weight)| Term { operator, weight }).collect();
            let data = LeastSquares::new(&self.operator, &self.rhs);
            let chosen = choose_weight(&data, &self.start, &terms, rule)?;
            self.applications += data.applications();
            weights = weights.map(|weight| Some(weight.unwrap_or(chosen)));
        }
        let [tikhonov, gradient, laplacian] = weights.map(Option::unwrap_or_default);
        Ok(RegularizationWeights { tikhonov, gradient, laplacian })
    }

    /// Puts the regularizers below the data.
    fn regularize(mut self, regularizers: Regularizers<V>) -> Result<Self> {
        let RegularizationWeights { tikhonov, gradient, laplacian } = self.weights;
        let Regularizers { tikhonov: identity, fade, among_neighbours } = regularizers;
        let root = |weight: f64| [weight.sqrt(); 3];
        if tikhonov > 0.0 {
            self.operator = self.operator.over(Scaled::new(identity, root(tikhonov)))?;
        }
        if let Some(fade) = fade.filter(|_| gradient > 0.0) {
            self.operator = self.operator.over(Scaled::new(fade, root(gradient)))?;
        }
        if let Some(AmongNeighbours { gradient: differences, laplacian: sums, .. }) = among_neighbours {
            if gradient > 0.0 {
                self.operator = self.operator.over(Scaled::new(differences, root(gradient)))?;
            }
            if laplacian > 0.0 {
                self.operator = self.operator.over(Scaled::new(sums, root(laplacian)))?;
            }
        }
        self.rhs.lower = self.operator.below(&self.start)?;
        Ok(self)
    }

    /// The metric of data and regularizers that the settings ask for.
    fn build_metric(
        &mut self,
        problem: &Formulation,
        operator: &impl TransportOperator<Domain = V, Range = R>,
        coverage: &CpuVector,
        settings: &SolveSettings,
        regularizers: &Regularizers<V>,
    ) -> Result<Option<Box<dyn Metric<V>>>> {
        let name = settings.metric_in_use();
        let square = self.norm.powi(2);
        let added = regularizers.diagonal([&self.pulls, &self.fades], self.weights, name);
        let diagonal = match name {
            MetricName::None => return Ok(None),
            MetricName::Auto | MetricName::Tiles => {
                let places = problem.places(&self.columns);
                let tiling = Tiling::placed(&problem.lattices(), problem.elements(), &self.columns, &places);
                // One metric for all channels, so it majorizes each.
                let weight = |weights: &Rgb| weights.iter().copied().fold(0.0, f32::max);
                let weights: Vec<f64> =
                    problem.weights.iter().map(|weights| f64::from(weight(weights)) / square).collect();
                return operator.tile_metric(&tiling, &weights, &added).map(Some);
            }
            MetricName::Jacobi => {
                let mut squares = self.unknown(&coverage.0)?;
                squares.scale([1.0 / square; 3]);
                squares
            }
            // The transport has no negative weight, so that |A| is A.
            MetricName::Sqs => {
                let (mut ones, mut sums) = (self.operator.domain(), self.operator.range());
                ones.fill([1.0; 3]);
                self.operator.apply(&ones, &mut sums)?;
                self.operator.apply_adjoint(&sums, &mut ones)?;
                self.applications += 2;
                ones
            }
        };
        let mut diagonal: V = diagonal;
        let mut on_diagonal = self.operator.domain();
        on_diagonal.set_from_host(&added.into_iter().map(|added| [added; 3]).collect::<Vec<_>>())?;
        diagonal.axpby([1.0; 3], &on_diagonal, [1.0; 3]);
        Ok(Some(Box::new(Scaling::new(diagonal, name == MetricName::Sqs))))
    }
}

/// The regularizers, without their weights.
struct Regularizers<V: Indexed> {
    tikhonov: Box<dyn LinearOperator<Domain = V, Range = V> + Send + Sync>,
    /// Of what no row reaches, relative to the gradient; none where a row reaches all.
    fade: Option<Weighted<Identity<V>>>,
    /// None where nothing asks for them.
    among_neighbours: Option<AmongNeighbours<V>>,
}

/// The regularizers that look at neighbours.
struct AmongNeighbours<V: Indexed> {
    gradient: Box<dyn LinearOperator<Domain = V, Range = V> + Send + Sync>,
    laplacian: Laplacian<V>,
    neighbours: Arc<Neighbours>,
}

impl<V: Indexed> Regularizers<V> {
    /// Σ λ |R|ᵀ |R| 1, which majorizes them; for Jacobi the diagonal of Σ λ Rᵀ R.
    fn diagonal(
        &self,
        [pulls, fades]: [&[f64]; 2],
        weights: RegularizationWeights,
        metric: MetricName,
    ) -> Vec<f64> {
        let pulls = pulls.iter().zip(fades);
        let mut sums: Vec<f64> =
            pulls.map(|(pull, fade)| weights.tikhonov * pull + weights.gradient * fade).collect();
        if let Some(AmongNeighbours { neighbours, .. }) = &self.among_neighbours {
            let (of_gradient, of_laplacian) = match metric {
                MetricName::Jacobi => {
                    let degrees: Vec<f64> = neighbours.degrees().into_iter().map(f64::from).collect();
                    let squares = degrees.iter().map(|degree| degree * (degree + 1.0)).collect();
                    (degrees, squares)
                }
                _ => (neighbours.gradient_majorizer(), neighbours.laplacian_majorizer()),
            };
            for ((sum, gradient), laplacian) in sums.iter_mut().zip(of_gradient).zip(of_laplacian) {
                *sum += weights.gradient * gradient + weights.laplacian * laplacian;
            }
        }
        sums
    }
}

/// The rows of the data and their targets, each times the root of its weight.
fn weighted<'a, V: Indexed + 'static, R: Vector + 'static>(
    operator: impl LinearOperator<Domain = V, Range = R> + Send + Sync + 'a,
    factors: R,
    targets: &[Rgb],
) -> Result<(Stacked<'a, V, R>, R)> {
    let weighted = Weighted::new(operator, factors)?;
    let mut targets = brought(weighted.range(), targets)?;
    weighted.weigh(&mut targets);
    Ok((Stacked::new(weighted), targets))
}

/// The elements that are joined to what is found, of lattices of more than two axes and where pairs say who lies beside whom. Nothing is
/// skipped by making cells of them: one that no row reaches is the exception.
fn spread(problem: &Formulation) -> Vec<u32> {
    let is_solid =
        |part: &Part| !part.pairs.is_empty() || part.lattice.is_some_and(|lattice| lattice.size.len() > 2);
    problem
        .ranges()
        .filter(|(_, part)| is_solid(part))
        .flat_map(|(range, part)| part.joined.iter().map(move |&element| element + range.start as u32))
        .collect()
}

/// All of two lists in increasing order, in increasing order.
fn union(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut all = [a, b].concat();
    all.sort_unstable();
    all.dedup();
    all
}

/// Cells over the elements of the first part that are joined to what is found; none where none are. Only a plane lattice has some.
fn cells_of(problem: &Formulation, reached: &[u32]) -> Option<Cells> {
    let part = problem.parts.first().filter(|part| !part.joined.is_empty() && part.pairs.is_empty())?;
    let &[width, height] = part.lattice?.size else { return None };
    let mut is_reached = vec![false; width * height];
    let of_part = reached.iter().take_while(|&&element| (element as usize) < width * height);
    of_part.for_each(|&element| is_reached[element as usize] = true);
    Some(Cells::new([width, height], is_reached.into(), part.joined))
}

/// The elements that some row reaches. None where even the largest square is so small that smaller ones have no digits in f32.
fn reached(coverage: &CpuVector) -> Vec<u32> {
    let most = coverage.0.iter().flatten().copied().fold(0.0, f32::max);
    if most < f32::MIN_POSITIVE / f32::EPSILON {
        return Vec::new();
    }
    let is_reached = |&(_, squares): &(usize, &Rgb)| squares.iter().any(|&value| value > 0.0);
    coverage.0.iter().enumerate().filter(is_reached).map(|(index, _)| index as u32).collect()
}

/// Mean squared column norms ‖W T eᵢ‖² over reached elements and channels, scale by scale. Gives that of the first scale of which an
/// element is reached; and for each part that of its own scale, relative to the first.
fn mean_squared_column_norms(problem: &Formulation, coverage: &CpuVector) -> (f64, Vec<f64>) {
    let mean = |scale: usize| {
        let (mut sum, mut count) = (0.0, 0);
        for (range, _) in problem.ranges().filter(|(_, part)| part.scale == scale) {
            let squares = &coverage.0[range];
            squares.iter().flatten().for_each(|&value| sum += f64::from(value));
            count += squares.iter().filter(|squares| squares.iter().any(|&value| value > 0.0)).count();
        }
        (count > 0).then(|| sum / (3 * count) as f64)
    };
    let means: Vec<Option<f64>> = problem.parts.iter().map(|part| mean(part.scale)).collect();
    let first = means.iter().flatten().next().copied().unwrap_or_default();
    (first, means.into_iter().map(|mean| mean.map_or(1.0, |mean| mean / first)).collect())
}
