use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::io::scene_file::Subject;

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
    /// Say more (-v: what is decided, -vv: what is done).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Find the light map behind painted strokes.
    LightMap(LightMapArguments),
    /// Draw the views of a scene, under its plain light or under a light map.
    Render(RenderArguments),
    /// Say what a solve would take, without doing it.
    Plan(SceneArguments),
    /// Check the operator: its adjoint, the explicit matrix in f64, and finite differences.
    Check(CheckArguments),
    /// Write the matrix, its right-hand side and its start for SciPy: T.npz, b.npy, x0.npy, rows.npy.
    Matrix(MatrixArguments),
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
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct BackendArguments {
    /// What to compute on.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: Backend,
    /// The graphics adapter, by a part of its name; `unscatter doctor` lists them. Software adapters are used only when
    /// named.
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
}

#[derive(Debug, Args)]
pub(crate) struct LightMapArguments {
    #[command(flatten)]
    pub(crate) scene: SceneArguments,
    #[command(flatten)]
    pub(crate) backend: BackendArguments,
    #[command(flatten)]
    pub(crate) output: OutputArguments,
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
    /// Fill texels that no painted ray reaches from their neighbours, for hand-off.
    #[arg(long)]
    pub(crate) fill: bool,
    /// Bit-identical results in every run; the processor always gives them, graphics adapters at a price.
    #[arg(long)]
    pub(crate) deterministic: bool,
    /// Find shadows, and the depth behind painted pixels, by a depth pass on the graphics adapter instead of by rays.
    #[arg(long)]
    pub(crate) rasterize: bool,
    /// Continue from the checkpoint in the output folder.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Write the light map and the pictures every N iterations.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) preview_every: Option<u32>,
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
pub(crate) enum Backend {
    /// A graphics card where there is one that serves, else the processor.
    #[default]
    Auto,
    /// The processor, on all its cores.
    Cpu,
    /// A graphics card, and nothing else.
    Gpu,
}
