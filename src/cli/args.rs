use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::io::image::ExrCompression;
use crate::io::scene_file::{MemorySize, Subject, parse_size};
use crate::io::volume::Format;
use crate::problem::DrawingMethod;
use crate::scene::Look;
use crate::{Error, Result};

/// Inverse rendering of light in media: paint what the picture should look like, get the light behind it.
#[derive(Debug, Parser)]
#[command(name = "unscatter", version, arg_required_else_help = true, max_term_width = 110)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Print results as JSON on standard output.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Threads to use; all cores by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Say nothing but results and errors.
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Say more (-v: the numbers of a solve, and what is decided; -vv: what is done).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Paint on the views of a scene, or of a model (.glb, .gltf, .obj), in the browser, and see light shafts or a volume follow.
    #[cfg(feature = "studio")]
    Paint(PaintArguments),
    /// Find the light map behind painted strokes, or the transfer function (--find transfer).
    LightMap(LightMapArguments),
    /// Find the emission, albedo or extinction of a volume behind target pictures, or the light around it.
    Volume(VolumeArguments),
    /// Draw all frames of an animation: of the sun, cameras and looks, or of a volume; what its key frames ask for is found first.
    Animate(AnimateArguments),
    /// Draw the views of a scene, under its plain light or under a light map.
    Render(RenderArguments),
    /// Say what a solve would take, without doing it.
    Plan(SceneArguments),
    /// Check the operator: its adjoint, the explicit matrix in f64, and finite differences.
    Check(CheckArguments),
    /// Measure run time against error: of every traversal, basis, precision and strategy, and of every solver.
    Bench(BenchArguments),
    /// Write the matrix, its right-hand side and its start for SciPy: T.npz, b.npy, x0.npy, rows.npy.
    Matrix(MatrixArguments),
    /// Put the numerics under stress: every law with its bound, and a verdict.
    Stress(StressArguments),
    /// Describe this machine and what unscatter would use of it.
    Doctor,
    /// Print the JSON schema of scene files.
    Schema {
        /// Of which: those for `light-map`, or those for `volume`.
        #[arg(value_enum, default_value_t)]
        of: SchemaOf,
    },
    /// Print completions for a shell.
    Completions {
        /// Which shell.
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Args)]
pub(crate) struct SceneArguments {
    /// The scene file.
    pub(crate) scene: PathBuf,
    /// Replace a value of the scene, such as `views[0].camera.fov=50`; may be repeated.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Memory that may be used, such as 4GiB; three quarters of what is free by default.
    #[arg(long, value_name = "SIZE", value_parser = memory_size)]
    pub(crate) memory: Option<MemorySize>,
}

#[derive(Debug, Args)]
pub(crate) struct BackendArguments {
    /// What to compute on.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: BackendName,
    /// The graphics adapter, by a part of its name or by its bus; `unscatter doctor` lists them. Software adapters are used
    /// only when named.
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,
}

#[cfg(feature = "studio")]
#[derive(Debug, Args)]
pub(crate) struct PaintArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    /// The port of this machine that the page is served on; any free one by default.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(crate) port: u16,
    /// Do not open the browser; the address is printed.
    #[arg(long)]
    pub(crate) no_open: bool,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArguments {
    /// Scene files; two small scenes that the program knows by heart when none is given.
    pub(crate) scenes: Vec<PathBuf>,
    /// Fewer cases and shorter measurements.
    #[arg(long, conflicts_with = "all")]
    pub(crate) quick: bool,
    /// Every solver with every traversal, basis, precision and strategy, which may take hours.
    #[arg(long)]
    pub(crate) all: bool,
    /// Rows that are sampled of each scene at most: few enough for an explicit matrix in f64.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(crate) rows: Option<u32>,
    /// Leave out how cost grows, and what skipping saves.
    #[arg(long)]
    pub(crate) only_cases: bool,
    /// Draw the scattered light of the first view by every method of `render --method`, over sizes of pictures and maps, and leave all
    /// else out.
    #[arg(long, conflicts_with_all = ["all", "counts", "rows", "only_cases"])]
    pub(crate) pictures: bool,
    /// Go on after the last case in `records.jsonl` of the output folder.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Hold counts against those of an earlier run, its `counts.csv`: applications, non-zeros and bytes must not rise.
    #[arg(long, value_name = "FILE")]
    pub(crate) counts: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    /// Folder for the results; `out/bench` by default.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct StressArguments {
    /// Only cases with this in their name, such as `depth` or `solve/condition`.
    #[arg(value_name = "NAME")]
    pub(crate) only: Option<String>,
    /// The short form: fewer values of each sweep, every law.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Folder for stress.json and stress.txt; none are written without.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
}

#[derive(Debug, Args)]
pub(crate) struct SolveArguments {
    /// The method, instead of the scene's: fista, spectral, lbfgs, mprgp, flexible-cgls or clamped-cgls within bounds;
    /// cgls, lsqr or lsmr without.
    #[arg(long, value_name = "NAME")]
    pub(crate) solver: Option<String>,
    /// Iterations at most, instead of the scene's.
    #[arg(long, value_name = "N")]
    pub(crate) iterations: Option<u32>,
    /// Stop when the projected gradient (for solvers without bounds, the normal residual) has fallen to this part of its
    /// start, instead of the scene's.
    #[arg(long, value_name = "X")]
    pub(crate) tolerance: Option<f64>,
    /// Bit-identical results in every run; the processor always gives them, graphics adapters at a price.
    #[arg(long)]
    pub(crate) deterministic: bool,
    /// Continue from the checkpoint in the output folder.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Seconds between checkpoints.
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    pub(crate) checkpoint_every: f64,
    /// Neither draw the pictures of the views nor write them, as for sweeps over settings.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    #[command(flatten)]
    pub(crate) pictures: PictureArguments,
    /// Write what there is so far, as pictures, every N iterations: to `preview` in the folder for the results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) preview_every: Option<u32>,
}

#[derive(Debug, Args)]
pub(crate) struct PictureArguments {
    /// How EXR files are packed: `none` and `rle` are quick, `zip` takes a tenth less room and six times as long, `piz` a quarter less.
    #[arg(long, value_name = "PACKING", default_value = "rle", hide_possible_values = true)]
    pub(crate) exr: ExrPacking,
}

/// How EXR files are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExrPacking {
    /// As they are.
    None,
    /// Run lengths.
    Rle,
    /// Deflate.
    Zip,
    /// Wavelets and Huffman's code.
    Piz,
}

impl From<ExrPacking> for ExrCompression {
    fn from(packing: ExrPacking) -> Self {
        match packing {
            ExrPacking::None => Self::None,
            ExrPacking::Rle => Self::Rle,
            ExrPacking::Zip => Self::Zip,
            ExrPacking::Piz => Self::Piz,
        }
    }
}

impl SolveArguments {
    /// The flags that stand for values of the scene.
    pub(crate) fn overrides(&self) -> Vec<String> {
        let flag = |name: &str, value: Option<String>| value.map(|value| format!("solve.{name}={value}"));
        [
            flag("solver", self.solver.clone()),
            flag("iterations", self.iterations.map(|n| n.to_string())),
            flag("tolerance", self.tolerance.map(|x| x.to_string())),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

#[derive(Debug, Args)]
pub(crate) struct LightMapArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
    #[command(flatten)]
    pub(crate) solve: SolveArguments,
    /// What to look for, instead of what the scene says: light-map, or transfer, which is the function of `looks` that colours scattered
    /// light.
    #[arg(long, value_name = "NAME")]
    pub(crate) find: Option<String>,
    /// Fill texels that no painted ray reaches from their neighbours, for hand-off.
    #[arg(long)]
    pub(crate) fill: bool,
    /// Find shadows, and the depth behind painted pixels, by a depth pass on the graphics adapter instead of by rays.
    #[arg(long)]
    pub(crate) rasterize: bool,
}

#[derive(Debug, Args)]
pub(crate) struct VolumeArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
    #[command(flatten)]
    pub(crate) solve: SolveArguments,
    /// What to look for, instead of what the scene says: emission, albedo, joint, extinction, refinement, environment, or in turn, such as
    /// extinction-then-joint or environment-then-albedo.
    #[arg(long, value_name = "NAME")]
    pub(crate) find: Option<String>,
    /// Files to write what was found to: vdb, npy, npz, vol, raw, or all; may be repeated. npy and vdb by default.
    #[arg(long = "format", value_name = "FORMAT")]
    pub(crate) formats: Vec<String>,
    /// Pictures from all around, for the report.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=720))]
    pub(crate) turntable: u32,
}

impl VolumeArguments {
    /// The flags that stand for values of the scene.
    pub(crate) fn overrides(&self) -> Vec<String> {
        let find = self.find.iter().map(|find| format!("find={find}"));
        find.chain(self.solve.overrides()).collect()
    }

    /// The formats that results are written in.
    pub(crate) fn formats(&self) -> Result<Vec<Format>> {
        formats(&self.formats)
    }
}

/// The formats of some names; npy and vdb where there are none.
///
/// Errors: [`Error::Value`] for a name that is none.
fn formats(names: &[String]) -> Result<Vec<Format>> {
    if names.is_empty() {
        return Ok(vec![Format::Npy, Format::Vdb]);
    }
    // A raw volume's file is called after the header beside it.
    let word = |format: Format| if format == Format::Raw { "raw" } else { format.extension() };
    let mut formats = Vec::new();
    for name in names {
        match Format::ALL.into_iter().find(|&format| word(format).eq_ignore_ascii_case(name)) {
            Some(format) => formats.push(format),
            None if name == "all" => formats.extend(Format::ALL),
            None => return Err(Error::value("--format", name, "vdb, npy, npz, vol, raw or all")),
        }
    }
    Ok(formats)
}

#[derive(Debug, Args)]
pub(crate) struct AnimateArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
    #[command(flatten)]
    pub(crate) solve: SolveArguments,
    /// What to look for at every key of a volume, instead of what the scene says: as of `volume`.
    #[arg(long, value_name = "NAME")]
    pub(crate) find: Option<String>,
    /// Draw only these frames, both ends included; all keys are solved in any case.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(crate) frames: Option<RangeInclusive<usize>>,
    /// Write the volumes of every frame, too, and not of the keys alone.
    #[arg(long)]
    pub(crate) volumes: bool,
    /// Files to write volumes to: vdb, npy, npz, vol, raw, or all; may be repeated. npy and vdb by default.
    #[arg(long = "format", value_name = "FORMAT")]
    pub(crate) formats: Vec<String>,
}

impl AnimateArguments {
    /// A flag that was given and is about volumes alone.
    pub(crate) fn flag_of_volumes(&self) -> Option<&'static str> {
        let given = [
            ("--find", self.find.is_some()),
            ("--volumes", self.volumes),
            ("--format", !self.formats.is_empty()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(flag, _)| flag)
    }

    /// The flags that stand for values of the scene.
    pub(crate) fn overrides(&self) -> Vec<String> {
        let find = self.find.iter().map(|find| format!("find={find}"));
        find.chain(self.solve.overrides()).collect()
    }

    /// The formats that volumes are written in.
    pub(crate) fn formats(&self) -> Result<Vec<Format>> {
        formats(&self.formats)
    }
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| (0.0..=1e6).contains(seconds));
    seconds.ok_or_else(|| "a number of seconds from 0 to 1000000 is needed".to_owned())
}

fn memory_size(text: &str) -> Result<MemorySize, &'static str> {
    parse_size(text).map(MemorySize).map_err(|_| "a size such as 4GiB, 512MiB or 1000000 bytes")
}

/// `A..B`, or `A` for one frame.
fn frames(text: &str) -> std::result::Result<RangeInclusive<usize>, String> {
    let (from, to) = text.split_once("..").unwrap_or((text, text));
    match (from.parse(), to.parse()) {
        (Ok(from), Ok(to)) if from <= to => Ok(from..=to),
        _ => Err("two frame numbers A..B with A not above B".to_owned()),
    }
}

#[derive(Debug, Args)]
pub(crate) struct RenderArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
    /// The light map to render with: an EXR, PNG or HDR file of any size. It lies where its `.placement.json`
    /// says, as `light-map` writes it, else where the scene's light map does.
    #[arg(long, value_name = "FILE")]
    pub(crate) light_map: Option<PathBuf>,
    /// Draws one part of the light alone: `scattering` is what the fog scatters of the sun, which paint is about.
    #[arg(long, value_name = "PART")]
    pub(crate) only: Option<OnlyLight>,
    /// How what the fog scatters of the sun is drawn: exact, march[:steps], min-max[:samples], prefiltered[:coefficients],
    /// epipolar[:samples] or bilateral[:steps].
    #[arg(long, value_name = "METHOD[:N]", default_value_t = DrawingMethod::Exact)]
    pub(crate) method: DrawingMethod,
    /// Draws that with one ray for every N × N pixels; the others are between those that are as deep.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) reduced: u32,
    /// Leaves looks of the scene out, to compare: fill, extrude, pierce, transfer, heterogeneity, surfaces, or all; separated by commas.
    #[arg(long, value_name = "LOOKS", value_delimiter = ',')]
    pub(crate) without: Vec<LookName>,
    /// Pictures of a volume from all around, beside its views.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=720))]
    pub(crate) turntable: u32,
    #[command(flatten)]
    pub(crate) pictures: PictureArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
}

/// A part of the light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnlyLight {
    /// What the medium scatters of the sun.
    Scattering,
}

/// A kind of look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LookName {
    /// Filled holes.
    Fill,
    /// Extruded silhouettes.
    Extrude,
    /// Holes that are made.
    #[value(alias = "holes")]
    Pierce,
    /// The transfer function.
    Transfer,
    /// Irregular air.
    Heterogeneity,
    /// Light from everywhere on surfaces.
    Surfaces,
    /// All of them.
    All,
}

impl LookName {
    /// The kinds that it stands for.
    pub(crate) fn kinds(self) -> &'static [Look] {
        match self {
            Self::Fill => &[Look::Fill],
            Self::Extrude => &[Look::Extrude],
            Self::Pierce => &[Look::Pierce],
            Self::Transfer => &[Look::Transfer],
            Self::Heterogeneity => &[Look::Heterogeneity],
            Self::Surfaces => &[Look::Surfaces],
            Self::All => &[
                Look::Fill,
                Look::Extrude,
                Look::Pierce,
                Look::Transfer,
                Look::Heterogeneity,
                Look::Surfaces,
            ],
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct MatrixArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
}

#[derive(Debug, Args)]
pub(crate) struct OutputArguments {
    /// Folder for the results; `out/` and the scene's file name by default.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

/// A kind of scene file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaOf {
    /// Scenes with a light in a homogeneous medium.
    #[default]
    LightMap,
    /// Scenes with a volume.
    Volume,
}

impl From<SchemaOf> for Subject {
    fn from(of: SchemaOf) -> Self {
        match of {
            SchemaOf::LightMap => Self::LightMap,
            SchemaOf::Volume => Self::Volume,
        }
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// A graphics card where there is one that serves, else the processor.
    #[default]
    Auto,
    /// The processor, on all its cores.
    Cpu,
    /// A graphics card, and nothing else.
    Gpu,
}

impl From<BackendName> for crate::job::Backend {
    fn from(of: BackendName) -> Self {
        match of {
            BackendName::Auto => Self::Auto,
            BackendName::Cpu => Self::Cpu,
            BackendName::Gpu => Self::Gpu,
        }
    }
}
