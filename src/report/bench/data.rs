use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// What was measured of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measured {
    /// One product T x.
    Product,
    /// A solve.
    Solve,
}

/// One case and what was measured of it. Seconds are medians of several runs; those of solves of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Its name, the same in every run.
    pub case: String,
    /// The scene.
    pub scene: String,
    /// Product or solve.
    pub measured: Measured,
    /// The method, of a solve.
    pub solver: Option<String>,
    /// The part of its start that the normal residual of a solve had to fall to.
    pub tolerance: Option<f64>,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Steps of the march; none: the exact traversal.
    pub steps: Option<u32>,
    /// What lies between the values of the unknowns.
    pub basis: String,
    /// `f32` or `f64`.
    pub precision: String,
    /// `assembled`, `matrix-free`, or `epipolar` for rows over slices.
    pub strategy: String,
    /// Rows of the sample.
    pub rows: u64,
    /// Elements, reached or not.
    pub elements: u64,
    /// Non-zeros, foreseen.
    pub nonzeros: u64,
    /// Of a product ‖T x − E x‖ / ‖E x‖, E the explicit exact matrix in f64; of a solve ‖x − x*‖ / ‖x₀ − x*‖, x* the solution
    /// in f64.
    pub error: f64,
    /// ‖Tᵀ y − Eᵀ y‖ / ‖Eᵀ y‖, of a product.
    pub adjoint_against_explicit: Option<f64>,
    /// |⟨T x, y⟩ − ⟨x, Tᵀ y⟩| / ‖T x‖ ‖y‖, of a product.
    pub adjoint_error: Option<f64>,
    /// (F(x) − F(x*)) / (F(x₀) − F(x*)), F the objective in f64, of a solve.
    pub excess: Option<f64>,
    /// What the excess may be at most where the solve converged, as its tolerance and λ prove; none without λ.
    pub excess_bound: Option<f64>,
    /// Why the solve ended.
    pub stop: Option<String>,
    /// Applications of T and Tᵀ: of a product 1, of a solve all.
    pub applications: u64,
    /// Walking the sample of rows that foresees the others, and keeping rows.
    pub set_up_seconds: f64,
    /// One product T x, or the solve.
    pub seconds: f64,
    /// One product Tᵀ y.
    pub adjoint_seconds: Option<f64>,
    /// Bytes of the kept rows.
    pub kept_bytes: u64,
    /// The most memory that the process has had until then, where known.
    pub peak_bytes: Option<u64>,
}

impl Record {
    /// Seconds until there is a result when there was nothing: rows that are not kept need no set-up for a product.
    pub fn seconds_in_all(&self) -> f64 {
        match (self.measured, self.strategy.as_str()) {
            (Measured::Product, "matrix-free") => self.seconds,
            _ => self.set_up_seconds + self.seconds,
        }
    }

    /// `exact`, or `march 64`.
    pub fn traversal(&self) -> String {
        self.steps.map_or_else(|| "exact".to_owned(), |steps| format!("march {steps}"))
    }

    /// Error and seconds, as plots and fronts have them.
    pub fn point(&self) -> [f64; 2] {
        [self.seconds_in_all(), self.error]
    }
}

/// How one way to draw the scattered light of a view went. Seconds are the least of several runs, first hits apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PictureRecord {
    /// The scene, of which the first view is drawn.
    pub scene: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels downwards.
    pub height: usize,
    /// Texels along a side of the shadow map and of the light map.
    pub map: usize,
    /// Whether under a light map, and not under the plain light.
    pub light_map: bool,
    /// The method.
    pub method: String,
    /// Its number: steps, samples or coefficients.
    pub number: Option<usize>,
    /// What is done before the light is known.
    pub set_up_seconds: f64,
    /// One picture under a light.
    pub seconds: f64,
    /// Root mean square of the difference from the exact rows, relative to the brightest pixel.
    pub error: f64,
    /// The largest such difference.
    pub largest: f64,
    /// The share of pixels that differ by less than 1/255 of the brightest in each channel.
    pub within: f64,
    /// Bytes of slices.
    pub bytes: u64,
}

impl PictureRecord {
    /// `epipolar 1024`.
    pub fn words(&self) -> String {
        self.number.map_or_else(|| self.method.clone(), |number| format!("{} {number}", self.method))
    }
}

/// A law that a case must hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Law {
    /// The case.
    pub case: String,
    /// What must hold.
    pub law: &'static str,
    /// What was measured.
    pub error: f64,
    /// What it may be at most.
    pub bound: f64,
    /// What a count was in an earlier run, where it is held against that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<u64>,
    /// Whether the error is within the bound.
    pub holds: bool,
}

impl Law {
    /// Whether a count is less than it was.
    pub fn fell(&self) -> bool {
        self.before.is_some_and(|before| self.error < before as f64)
    }
}

/// How the exact traversal stands against a march of the same scene, basis and strategy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MarchStanding {
    /// The march takes as long or longer, and errs more.
    Dominated,
    /// The march is quicker, and errs more.
    Quicker,
    /// The march errs no more.
    AsExact,
}

impl MarchStanding {
    /// In words, said of the march.
    pub fn words(self) -> &'static str {
        match self {
            Self::Dominated => "slower and worse",
            Self::Quicker => "quicker, worse",
            Self::AsExact => "as exact",
        }
    }
}

/// A march against the exact traversal, to the first product T x.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Against {
    /// The scene.
    pub scene: String,
    /// The basis.
    pub basis: String,
    /// Whether rows are kept.
    pub strategy: String,
    /// Steps of the march.
    pub steps: u32,
    /// Seconds of the march, and of the exact traversal.
    pub seconds: [f64; 2],
    /// Error of the march, and of the exact traversal.
    pub error: [f64; 2],
    /// How the march stands.
    pub standing: MarchStanding,
}

/// Every march on the processor in f32 against the exact traversal.
pub fn compare(records: &[Record]) -> Vec<Against> {
    let products = || {
        let of = |record: &&Record| {
            record.measured == Measured::Product && record.backend == "cpu" && record.precision == "f32"
        };
        records.iter().filter(of)
    };
    let exact = |march: &Record| {
        products().find(|record| {
            let key = |record: &Record| (record.scene.clone(), record.basis.clone(), record.strategy.clone());
            record.steps.is_none() && key(record) == key(march)
        })
    };
    let marches = products().filter_map(|march| Some((march, march.steps?, exact(march)?)));
    marches
        .map(|(march, steps, exact)| {
            let (seconds, error) =
                ([march.seconds_in_all(), exact.seconds_in_all()], [march.error, exact.error]);
            let standing = match (error[0] > error[1], seconds[0] >= seconds[1]) {
                (false, _) => MarchStanding::AsExact,
                (true, true) => MarchStanding::Dominated,
                (true, false) => MarchStanding::Quicker,
            };
            Against {
                scene: march.scene.clone(),
                basis: march.basis.clone(),
                strategy: march.strategy.clone(),
                steps,
                seconds,
                error,
                standing,
            }
        })
        .collect()
}

/// What was measured at one size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SweepPoint {
    /// How many there were of what grows.
    pub size: f64,
    /// Rows that were measured.
    pub rows: u64,
    /// Making the problem: surfaces, shadow map, light, targets; none where it was made once for all points.
    pub problem_seconds: Option<f64>,
    /// Walking and keeping the rows.
    pub set_up_seconds: f64,
    /// T x and Tᵀ y.
    pub seconds: f64,
    /// Bytes of the kept rows, of both maps or of the medium, and of one vector of each kind.
    pub bytes: u64,
}

/// How cost grows with one thing, all else as it was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The scene.
    pub scene: String,
    /// What grows.
    pub over: String,
    /// What does not grow, in words.
    pub held: String,
    /// From small to large.
    pub points: Vec<SweepPoint>,
    /// e in cost ~ sizeᵉ, of problem, set-up, products and bytes; none where that cannot be fitted.
    pub exponents: [Option<f64>; 4],
}

impl Sweep {
    /// With exponents fitted.
    pub fn new(scene: &str, over: &str, held: &str, points: Vec<SweepPoint>) -> Self {
        let fit = |value: fn(&SweepPoint) -> Option<f64>| {
            let values = points.iter().map(|point| Some([point.size, value(point)?]));
            exponent(&values.collect::<Option<Vec<_>>>()?)
        };
        let exponents = [
            fit(|point| point.problem_seconds),
            fit(|point| Some(point.set_up_seconds)),
            fit(|point| Some(point.seconds)),
            fit(|point| Some(point.bytes as f64)),
        ];
        Self { scene: scene.to_owned(), over: over.to_owned(), held: held.to_owned(), points, exponents }
    }
}

/// The slope of the line through (log x, log y) with the least squares. None for fewer than two different x, or where a number is not
/// positive.
pub fn exponent(points: &[[f64; 2]]) -> Option<f64> {
    if points.iter().flatten().any(|&value| !(value > 0.0 && value.is_finite())) {
        return None;
    }
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let mean = |axis: usize| logs.iter().map(|p| p[axis]).sum::<f64>() / logs.len() as f64;
    let [x, y] = [mean(0), mean(1)];
    let (covariance, variance) =
        logs.iter().fold((0.0, 0.0), |(c, v), p| (c + (p[0] - x) * (p[1] - y), v + (p[0] - x).powi(2)));
    (variance > 0.0).then(|| covariance / variance)
}

/// A number with what is skipped, and without skipping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// As it is.
    pub with: f64,
    /// With the switch turned off.
    pub without: f64,
}

/// What skipping something saves, and what it changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Skipped {
    /// The scene.
    pub scene: String,
    /// What is skipped.
    pub what: String,
    /// The setting that turns skipping off.
    pub switch: String,
    /// What the work is counted in.
    pub unit: String,
    /// How much work there is to do.
    pub work: Pair,
    /// Seconds of T x and Tᵀ y together, or of a solve.
    pub seconds: Pair,
    /// How far Tᵀ W T 1 or T 1 differs, relative to itself; of two solutions, how far what they show differs, relative to
    /// √(F(x₀) − F(x*)).
    pub difference: f64,
    /// What the difference may be at most.
    pub bound: f64,
}

/// The laws of a benchmark, in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Held {
    /// How many hold.
    pub hold: usize,
    /// Of how many.
    pub of: usize,
}

/// All that a benchmark found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Of the program.
    pub version: String,
    /// What was run.
    pub command: String,
    /// The processor.
    pub machine: String,
    /// Threads of the processor.
    pub threads: usize,
    /// The graphics adapter, if one was measured.
    pub adapter: Option<String>,
    /// Rows that were sampled at most.
    pub most_rows: usize,
    /// Whether all cases were run; not when interrupted.
    pub complete: bool,
    /// The laws in numbers.
    pub held: Held,
    /// Every law that was checked.
    pub laws: Vec<Law>,
    /// Every case.
    pub records: Vec<Record>,
    /// Every march against the exact traversal.
    pub against: Vec<Against>,
    /// How cost grows.
    pub scaling: Vec<Sweep>,
    /// Pictures of scattered light.
    pub pictures: Vec<PictureRecord>,
    /// What skipping saves.
    pub skipping: Vec<Skipped>,
}

impl Bench {
    /// As JSON.
    ///
    /// Errors: [`Error::Machine`] when it cannot be written as JSON.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|error| Error::Machine(format!("cannot write JSON: {error}")))
    }

    /// The scenes, in the order of their records.
    pub fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = Vec::new();
        for record in &self.records {
            if !scenes.contains(&record.scene.as_str()) {
                scenes.push(&record.scene);
            }
        }
        scenes
    }
}

/// A table with commas, as RFC 4180 has it, with the names of fields for its head.
///
/// Errors: [`Error::Machine`] when what is given is no table row.
pub fn csv(rows: &[impl Serialize]) -> Result<String> {
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        let value = serde_json::to_value(row)
            .map_err(|error| Error::Machine(format!("cannot write CSV: {error}")))?;
        let fields = value.as_object().into_iter().flatten();
        let (names, cells): (Vec<String>, Vec<String>) =
            fields.map(|(name, value)| (name.clone(), cell(value))).unzip();
        if index == 0 {
            text.push_str(&names.join(","));
            text.push_str("\r\n");
        }
        text.push_str(&cells.join(","));
        text.push_str("\r\n");
    }
    Ok(text)
}

fn cell(value: &serde_json::Value) -> String {
    let text = match value {
        serde_json::Value::Null => String::new(),
        // To a spreadsheet this would be a formula.
        serde_json::Value::String(text) if text.starts_with(['=', '+', '-', '@']) => format!("'{text}"),
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(steps: Option<u32>, seconds: f64, error: f64) -> Record {
        Record {
            case: "a, \"b\"".into(),
            scene: "s".into(),
            measured: Measured::Product,
            solver: None,
            tolerance: None,
            backend: "cpu".into(),
            steps,
            basis: "linear".into(),
            precision: "f32".into(),
            strategy: "matrix-free".into(),
            rows: 1,
            elements: 1,
            nonzeros: 1,
            error,
            adjoint_against_explicit: None,
            adjoint_error: None,
            excess: None,
            excess_bound: None,
            stop: None,
            applications: 1,
            set_up_seconds: 5.0,
            seconds,
            adjoint_seconds: None,
            kept_bytes: 0,
            peak_bytes: None,
        }
    }

    #[test]
    fn a_cell_is_no_formula_to_a_spreadsheet() {
        let cells = ["=1+1", "@x", "-a", "plain", "a,=b"].map(|text| cell(&text.into()));
        assert_eq!(cells, ["'=1+1", "'@x", "'-a", "plain", "\"a,=b\""]);
        assert_eq!(cell(&serde_json::json!(-1.5)), "-1.5");
    }

    #[test]
    fn a_power_is_found_and_what_is_none_is_not() {
        let power = |e: f64| [1.0, 3.0, 20.0].map(|x: f64| [x, 7.0 * x.powf(e)]);
        for e in [-1.0, 0.0, 0.5, 2.0] {
            assert!((exponent(&power(e)).unwrap() - e).abs() < 1e-12);
        }
        // The line with the least squares lies between the points that it misses.
        let bent = exponent(&[[1.0, 1.0], [10.0, 10.0], [100.0, 1000.0]]).unwrap();
        assert!((bent - 1.5).abs() < 1e-12);
        for bad in [&[][..], &[[1.0, 1.0]], &[[2.0, 1.0], [2.0, 3.0]], &[[1.0, 0.0], [2.0, 1.0]]] {
            assert_eq!(exponent(bad), None);
        }
    }

    #[test]
    fn marches_are_told_apart_by_time_and_error() {
        let records = [
            record(None, 1.0, 1e-8),
            record(Some(16), 0.1, 0.5),
            record(Some(64), 1.0, 0.1),
            record(Some(4096), 9.0, 1e-8),
        ];
        let standings: Vec<MarchStanding> = compare(&records).iter().map(|march| march.standing).collect();
        assert_eq!(standings, [MarchStanding::Quicker, MarchStanding::Dominated, MarchStanding::AsExact]);
    }

    #[test]
    fn cells_with_commas_and_quotes_are_quoted() {
        let text = csv(&[record(None, 1.0, 0.0)]).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("case,scene,measured,"));
        assert!(lines[1].starts_with("\"a, \"\"b\"\"\",s,product,,,cpu,,linear,"));
    }
}
