use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::problem::{Nouns, OutOfReach, RegularizationWeights};
use crate::solve::Progress;
use crate::{Error, Result, Warning};

/// Everything that a run has to say about itself; `report.json` is this, field by field.
///
/// Plain data. What is not known is left out of the JSON, never written as `null`; so a new field that may be
/// missing is an `Option` with `skip_serializing_if`. Whoever reads an older report gets the defaults.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// Version of the program.
    pub version: String,
    /// The command that ran, such as `light-map`.
    pub command: String,
    /// Name of the scene.
    pub scene: String,
    /// What a person should know: what was ignored or left out, is at a bound or out of reach.
    pub warnings: Vec<Warning>,
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// On which device, in words.
    pub device: String,
    /// What a graphics adapter was given to do, where one computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gpu: Option<Work>,
    /// What a painted colour meant: `tint` or `radiance`.
    pub target: String,
    /// The method that solved.
    pub solver: String,
    /// Which rows were kept and which were walked again in each application.
    pub strategy: RowStrategy,
    /// What the things of the problem are called.
    pub nouns: Nouns,
    /// How large the problem was.
    pub problem: ProblemSize,
    /// The λ that multiply ½‖·‖².
    pub regularization: RegularizationWeights,
    /// The other settings, by name, in words.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
    /// One entry an iteration; the first is the start.
    pub history: Vec<Progress>,
    /// Why and when it stopped.
    pub stop: StopRecord,
    /// How near the end is to a solution.
    pub certificate: Certificate,
    /// Applications of `T` and `Tᵀ` for the metric and the choice of λ; the history does not count them.
    pub set_up_applications: u64,
    /// √(Σ w ‖L − L*‖² / Σ w ‖L*‖²) over all pixels of which something is wanted: L the radiance, L* the wanted one, w the weight.
    pub weighted_residual: Change,
    /// The same and more, view by view.
    #[serde(rename = "match")]
    pub matched: Vec<ViewMatch>,
    /// Angles between the hues shown and wanted at the end, over all pixels of which a hue is wanted; none where hues are not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hue: Option<HueAngles>,
    /// The light map against its light, where one was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<LightRecord>,
    /// Wishes that nothing within the bounds fulfils, as shares of what is missing.
    pub out_of_reach: WishShares,
    /// Seconds of each stage; `total` is the whole run.
    pub timings: BTreeMap<String, f64>,
    /// Bytes of each part; `peak` is the most at any time, `budget` what was allowed.
    pub memory: BTreeMap<String, u64>,
    /// What was not computed because nothing depends on it. `words.rs` has a sentence for each name; a name without one is shown as
    /// it is.
    pub skipped: BTreeMap<String, Share>,
    /// `|⟨Tx,y⟩ − ⟨x,Tᵀy⟩| / (‖Tx‖‖y‖)` for random x and y.
    pub adjoint_error: f64,
    /// Which elements the rows determine.
    pub coverage: Coverage,
    /// What was found around the light map, where that was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surroundings: Option<SurroundingsRecord>,
    /// The stages, where there are any: what was looked for in turn. The numbers above are then of the last stage.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<StageRecord>,
    /// The frames, where there are several. `stages` and `match` are then of all keys, and the other numbers of the last key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub animation: Option<AnimationRecord>,
}

impl Report {
    /// Whether something was looked for: frames can be drawn without.
    pub fn is_of_solve(&self) -> bool {
        !self.solver.is_empty()
    }
}

/// Angles between the hues shown and wanted, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct HueAngles {
    /// What half of the pixels exceed.
    pub median: f64,
    /// What a tenth of the pixels exceeds.
    pub nine_tenths: f64,
}

/// A light map against the light that shines through it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct LightRecord {
    /// The brightest channel of any texel, as a multiple of the light's.
    pub brightest: f64,
    /// The share of the painted pixels' light that comes from outside the light map.
    pub outside: f64,
    /// By which part of itself the squared misfit would fall, were all upper bounds a tenth higher; to first order.
    pub held_back: f64,
}

/// Shares of what is missing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct WishShares {
    /// Of wishes for more than is possible.
    pub above: f64,
    /// Of wishes for less than is possible.
    pub below: f64,
}

impl From<OutOfReach> for WishShares {
    fn from(OutOfReach { above, below, .. }: OutOfReach) -> Self {
        Self { above, below }
    }
}

/// Frames that were made of key frames.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct AnimationRecord {
    /// How many frames there are.
    pub frames: u64,
    /// How many of them were drawn.
    pub drawn: u64,
    /// Where frames of a volume that are no keys have their extinction from: `blend`, `shapes` or `files`; empty where there is no volume.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub between: String,
    /// Which light maps the frames have, where there is no volume: `none`, `one` or `each`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_map: Option<String>,
    /// The keys that there are.
    pub keys: Vec<KeyRecord>,
}

/// A key frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct KeyRecord {
    /// Its number.
    pub frame: u64,
    /// How far its pictures were from what was wanted, and how far they are; none where nothing was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighted_residual: Option<Change>,
    /// Voxels that diffusion has filled because no row reaches them, of all properties together.
    pub spread_voxels: u64,
    /// Steps of conjugate gradients that diffusion took.
    pub spread_iterations: u64,
}

/// One thing that was looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StageRecord {
    /// The key frame, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// `emission`, `albedo`, `joint`, `extinction`, `environment` or `light map`.
    pub find: String,
    /// Counted from 1.
    pub round: u64,
    /// Whether what was found was kept: in rounds only where the pictures came no farther away.
    pub is_taken: bool,
    /// How large the problem was.
    pub problem: ProblemSize,
    /// How far the pictures were from what was wanted, and how far they are, under the model of the stage.
    pub weighted_residual: Change,
    /// Why and when it stopped.
    pub stop: StopRecord,
    /// How near the end is to a solution.
    pub certificate: Certificate,
}

impl AnimationRecord {
    /// What lies between the keys, in a few words.
    pub fn in_words(&self) -> String {
        match self.light_map.as_deref() {
            None => format!("extinction between them: {}", self.between),
            Some("each") => "a light map each, blended between them".to_owned(),
            Some("one") => "one light map for all".to_owned(),
            Some(_) => "light as it is".to_owned(),
        }
    }
}

impl StageRecord {
    /// What was looked for, and at which frame.
    pub fn label(&self) -> String {
        self.frame.map_or(self.find.clone(), |frame| format!("frame {frame}, {}", self.find))
    }
}

impl Default for StageRecord {
    fn default() -> Self {
        Self {
            frame: None,
            find: String::new(),
            round: 1,
            is_taken: true,
            problem: ProblemSize::default(),
            weighted_residual: Change::default(),
            stop: StopRecord::default(),
            certificate: Certificate::default(),
        }
    }
}

/// What was found around a light map.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SurroundingsRecord {
    /// Radiance of the sun outside its light map, where that was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun: Option<SunRecord>,
    /// How many lights of the environment reach what is painted, of all that were looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lights: Option<Share>,
}

/// A radiance before and after the solve.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SunRecord {
    /// At the start.
    pub before: [f32; 3],
    /// At the end.
    pub after: [f32; 3],
}

impl SurroundingsRecord {
    /// What was found, in a sentence without its end.
    pub fn in_words(&self) -> String {
        let color = |[r, g, b]: [f32; 3]| format!("({r:.3}, {g:.3}, {b:.3})");
        let sun = self
            .sun
            .map(|sun| format!("the sun's radiance went from {} to {}", color(sun.before), color(sun.after)));
        let lights = self.lights.map(|Share { count, of }| {
            let rest = if count < of { ", for the others reach nothing painted" } else { "" };
            format!("{count} of {of} lights of the environment were looked for{rest}")
        });
        [sun, lights].into_iter().flatten().collect::<Vec<_>>().join("; ")
    }
}

/// What a graphics adapter was given to do.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Work {
    /// How often the processor has waited for the adapter.
    pub round_trips: u64,
    /// Round trips an iteration of the solve; none for a solve of one iteration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub round_trips_an_iteration: Option<f64>,
    /// Kernels that the adapter ran.
    pub dispatches: u64,
    /// Bytes of the adapter's memory that were in use at the end.
    pub bytes: u64,
    /// Whether every run gives the same bits.
    pub deterministic: bool,
}

/// The two ways of applying a row of the transport, counted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RowStrategy {
    /// `assembled`, `matrix-free`, `mixed`, `epipolar` or `light volumes`.
    pub name: String,
    /// Rows whose non-zeros were kept in memory.
    pub kept_rows: u64,
    /// Rows that were walked again in each application.
    pub walked_rows: u64,
}

/// How large the problem was.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ProblemSize {
    /// Pixels of which something is wanted.
    pub rows: u64,
    /// What could be found, reached or not.
    pub unknowns: u64,
    /// What those are, such as `texels`.
    pub elements: String,
    /// Those that were solved for: those that a row reaches, and one for each cell of those that smoothness reaches.
    pub active_unknowns: u64,
    /// Pairs (row, unknown) with a weight.
    pub nonzeros: u64,
    /// Views that have such pixels.
    pub views: u64,
    /// Width and height of what is found, then its depth if it has one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub size: Vec<u64>,
}

/// Why and when a solve stopped.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct StopRecord {
    /// `tolerance`, `iterations`, `time`, `interrupted`, …
    pub reason: String,
    /// After which iteration.
    pub iteration: u64,
}

/// How near the end is to a solution, computed from the true residual and not by recursion.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Certificate {
    /// `projected-gradient` where bounds were kept: the KKT residual; else `normal-residual`.
    pub kind: String,
    /// The norm of that gradient relative to the start, a channel: zero at a solution and nowhere else.
    pub value: [f64; 3],
    /// `‖b − A x‖` relative to the start, a channel.
    pub residual: [f64; 3],
    /// Reached elements with a channel at a bound.
    pub at_bounds: u64,
    /// How often the method began again, because the residual that it carries along had parted from the true one.
    pub restarts: u64,
}

/// A number before and after the solve.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Change {
    /// At the start.
    pub before: f64,
    /// At the end.
    pub after: f64,
}

/// How well one view came to match what was wanted of it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewMatch {
    /// Name of the view.
    pub view: String,
    /// Pixels of which something is wanted.
    pub painted_pixels: u64,
    /// [`Report::weighted_residual`] over them alone.
    pub weighted_residual: Change,
    /// Angles between the hues shown and wanted at the end; none where hues are not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hue: Option<HueAngles>,
    /// Their mean error of hue in degrees; none where hues are not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hue_error: Option<Change>,
    /// The same error of those pixels that no other view contradicts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncontested_hue_error: Option<Change>,
    /// How many pixels no other view contradicts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncontested_pixels: Option<u64>,
}

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Share {
    /// How many.
    pub count: u64,
    /// Of how many.
    pub of: u64,
}

/// Which elements the rows determine; of those that lie side by side.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Coverage {
    /// What the elements are, such as `texels`.
    pub elements: String,
    /// Elements that a row reaches.
    pub reached: u64,
    /// All elements.
    pub total: u64,
    /// Elements that no row reaches: they keep their start value, are joined to what is found, or are filled.
    pub unreached: u64,
    /// How many of the unreached smoothness joins to the reached, so that what was found fades in them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joined: Option<u64>,
    /// How many of the unreached were filled by diffusion from their neighbours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filled: Option<u64>,
    /// How many of the reached weigh so little that the regularization decides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weak: Option<u64>,
}

impl Change {
    /// The part of what was missing at the start that is there at the end, from 0 to 1; none where nothing was missing.
    pub fn met(&self) -> Option<f64> {
        (self.before > 0.0).then(|| (1.0 - self.after / self.before).max(0.0))
    }
}

impl Report {
    /// The text of `report.json`: indented, its fields in the order in which they are declared.
    ///
    /// Errors: [`Error::NonFinite`] with the path of the first number that is a NaN or an infinity, such as
    /// `history[3].residual[0]`.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(&self.finite()?).map_err(unwritable)
    }

    /// The report as JSON, once it is known that all its numbers are finite.
    pub(super) fn finite(&self) -> Result<Value> {
        let value = serde_json::to_value(self).map_err(unwritable)?;
        match null_in(&value) {
            Some(path) => Err(Error::NonFinite { what: path, place: "report.json".into() }),
            None => Ok(value),
        }
    }
}

/// Serializing plain data with string keys cannot fail; should it, it is no fault of the input.
fn unwritable(error: serde_json::Error) -> Error {
    Error::Machine(format!("cannot write the report as JSON: {error}"))
}

/// The path of the first `null`. Nothing else than a NaN or an infinity becomes one, because absent values
/// are left out.
fn null_in(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(index, item)| null_in(item).map(|rest| join(&format!("[{index}]"), &rest))),
        Value::Object(fields) => {
            fields.iter().find_map(|(name, field)| null_in(field).map(|rest| join(name, &rest)))
        }
        _ => None,
    }
}

fn join(name: &str, rest: &str) -> String {
    let dot = if rest.is_empty() || rest.starts_with('[') { "" } else { "." };
    format!("{name}{dot}{rest}")
}

#[cfg(test)]
mod tests {
    use super::super::example;
    use super::*;

    #[test]
    fn every_field_of_the_contract_is_written() {
        for report in [example(), Report { history: vec![Progress::default()], ..Report::default() }] {
            let json: Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
            for pointer in [
                "/version",
                "/command",
                "/backend",
                "/device",
                "/problem/rows",
                "/problem/unknowns",
                "/problem/active_unknowns",
                "/problem/nonzeros",
                "/problem/views",
                "/regularization/tikhonov",
                "/regularization/laplacian",
                "/regularization/gradient",
                "/history/0/iteration",
                "/history/0/seconds",
                "/history/0/operator_applications",
                "/history/0/residual/2",
                "/history/0/normal_residual/2",
                "/stop/reason",
                "/stop/iteration",
                "/certificate/kind",
                "/certificate/value/2",
                "/set_up_applications",
                "/timings",
                "/memory",
                "/skipped",
                "/adjoint_error",
                "/coverage/reached",
                "/coverage/total",
                "/coverage/unreached",
                "/scene",
                "/target",
                "/solver",
                "/strategy/kept_rows",
                "/strategy/walked_rows",
                "/match",
                "/weighted_residual/before",
                "/weighted_residual/after",
            ] {
                assert!(json.pointer(pointer).is_some(), "{pointer} is missing");
            }
            assert!(json.pointer("/no_such_field").is_none());
        }
    }

    #[test]
    fn what_was_written_is_read_back() {
        // Numbers of sixteen digits may come back with another last one; those of the example are shorter,
        // but for its history.
        let report = Report { history: vec![Progress { iteration: 1, ..Progress::default() }], ..example() };
        let text = report.to_json().unwrap();
        assert_eq!(serde_json::from_str::<Report>(&text).unwrap(), report);
        let other = text.replacen("\"iteration\": 1,", "\"iteration\": 99,", 1);
        assert_ne!(serde_json::from_str::<Report>(&other).unwrap(), report);
    }

    #[test]
    fn a_report_of_another_version_can_still_be_read() {
        let report: Report = serde_json::from_str(r#"{"version": "0.0.1", "kkt_residual": 0.5}"#).unwrap();
        assert_eq!(report.version, "0.0.1");
    }

    /// The path in the error when `spoil` puts a number into the report that is not finite.
    fn refused_at(spoil: impl Fn(&mut Report, f64)) -> Vec<String> {
        let paths = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|bad| {
            let mut report = example();
            spoil(&mut report, bad);
            match report.to_json() {
                Err(Error::NonFinite { what, .. }) => what,
                other => panic!("{bad} was written: {other:?}"),
            }
        });
        paths.to_vec()
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_with_their_path() {
        let all = |path: &str| vec![path.to_string(); 3];
        assert_eq!(refused_at(|r, bad| r.history[3].residual[1] = bad), all("history[3].residual[1]"));
        assert_eq!(refused_at(|r, bad| r.adjoint_error = bad), all("adjoint_error"));
        let timing = |r: &mut Report, bad| r.timings.extend([("solve".to_string(), bad)]);
        assert_eq!(refused_at(timing), all("timings.solve"));
        let hue = |r: &mut Report, bad| r.matched[1].hue_error = Some(Change { before: 1.0, after: bad });
        assert_eq!(refused_at(hue), all("match[1].hue_error.after"));
        assert!(example().to_json().is_ok());
    }
}
