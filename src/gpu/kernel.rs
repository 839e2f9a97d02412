//! The catalogue of kernels: which texts of `kernels/` each is assembled from, and what it binds.

use std::fmt::Write as _;

use crate::march::{GAUSS_2, GAUSS_4, MOST_PANELS, PANEL, SERIES_0, SERIES_2};
use crate::operator::{NOWHERE, TILE_SIDE};

use super::fixed_point::Accumulation;
use super::layout::{FARTHEST, LEVELS, LIGHTS, PLACE_BITS, TICKS};
use super::walk::{Consumer, VolumeWalk, Walk};

/// Lanes of a workgroup that works on vectors and kept rows.
pub(super) const LANES: u32 = 256;
/// Elements that one workgroup of a reduction takes: sixteen a lane.
pub(super) const PIECE: u32 = 16 * LANES;
/// Rays of a workgroup.
pub(super) const RAYS: u32 = 64;
/// Texels a side around the entry of a workgroup's rays that are summed up inside the workgroup.
const NEAR: u32 = 16;
/// Terms of the series for thin media: enough for f32 up to an optical depth of ½ a cell.
const SERIES: usize = 9;

macro_rules! text {
    ($name:literal) => {
        include_str!(concat!("../../kernels/", $name, ".wgsl"))
    };
}

/// One kernel in one of its variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Kernel {
    Fill,
    Axpby,
    Scale,
    Multiply,
    Invert,
    Clamp,
    Hold,
    HoldAtBounds,
    Shorten,
    Pick,
    Place,
    Difference,
    Divergence,
    Dot,
    ProjectedNormSquared,
    LargestStep,
    LargestBits,
    FixedScale,
    FixedFinish,
    /// The traversal of the light map, compiled into a consumer.
    LightMap(Consumer, Walk),
    /// The traversal of one quantity of a volume, compiled into a consumer.
    Volume(Consumer, VolumeWalk),
    Rows {
        colored: bool,
        /// Channels at once: 1 or 3.
        channels: u32,
        squared: bool,
        /// Lanes a row; a power of two.
        sharers: u32,
    },
    Tiles {
        colored: bool,
        channels: u32,
        operation: TileOperation,
    },
}

impl Consumer {
    /// The texts that add up what it deposits, if it does.
    fn deposits(self, scatter: &'static str) -> Vec<&'static str> {
        let (Self::Scatter(accumulation) | Self::Squares(accumulation)) = self else { return Vec::new() };
        let accumulate = match accumulation {
            Accumulation::Float => text!("prelude/accumulate_float"),
            Accumulation::Swap => text!("prelude/accumulate_swap"),
            Accumulation::Fixed => text!("prelude/accumulate_fixed"),
        };
        vec![text!("prelude/carried"), text!("prelude/fixed_point"), scatter, accumulate]
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum TileOperation {
    Stretch,
    Shrink,
    Descend,
}

/// What a kernel does with a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Access {
    /// The parameters of a dispatch.
    Parameters,
    /// What many dispatches share.
    Uniform,
    Read,
    Write,
}

impl Kernel {
    /// The file of `kernels/` that it is.
    pub(super) fn name(self) -> &'static str {
        self.body().0
    }

    fn body(self) -> (&'static str, &'static str) {
        macro_rules! file {
            ($name:literal) => {
                ($name, text!($name))
            };
        }
        match self {
            Self::Fill => file!("fill"),
            Self::Axpby => file!("axpby"),
            Self::Scale => file!("scale"),
            Self::Multiply => file!("multiply"),
            Self::Invert => file!("invert"),
            Self::Clamp => file!("clamp"),
            Self::Hold => file!("hold"),
            Self::HoldAtBounds => file!("hold_at_bounds"),
            Self::Shorten => file!("shorten"),
            Self::Pick => file!("pick"),
            Self::Place => file!("place"),
            Self::Difference => file!("difference"),
            Self::Divergence => file!("divergence"),
            Self::Dot => file!("dot"),
            Self::ProjectedNormSquared => file!("projected_norm_squared"),
            Self::LargestStep => file!("largest_step"),
            Self::LargestBits => file!("largest_bits"),
            Self::FixedScale => file!("fixed_scale"),
            Self::FixedFinish => file!("fixed_finish"),
            Self::LightMap(consumer, _) | Self::Volume(consumer, _) => match consumer {
                Consumer::Gather => file!("gather"),
                Consumer::Scatter(_) => file!("scatter"),
                Consumer::Squares(_) => file!("squares"),
            },
            Self::Rows { .. } => file!("rows"),
            Self::Tiles { .. } => file!("tiles"),
        }
    }

    /// The texts before its own.
    fn prelude(self) -> Vec<&'static str> {
        match self {
            Self::Dot | Self::LargestStep | Self::LargestBits => {
                vec![text!("prelude/vector_params"), text!("prelude/reduction")]
            }
            Self::ProjectedNormSquared => {
                vec![text!("prelude/bounds"), text!("prelude/vector_params"), text!("prelude/reduction")]
            }
            Self::Hold => {
                vec![text!("prelude/bounds"), text!("prelude/vector_params"), text!("prelude/vector")]
            }
            Self::Pick | Self::Difference | Self::Divergence => {
                vec![text!("prelude/vector_params"), text!("prelude/vector"), text!("prelude/indexed")]
            }
            Self::FixedFinish => {
                vec![text!("prelude/vector_params"), text!("prelude/vector"), text!("prelude/fixed_point")]
            }
            Self::FixedScale | Self::Rows { .. } | Self::Tiles { .. } => Vec::new(),
            Self::LightMap(consumer, walk) => {
                let mut texts = vec![
                    if walk.colored { text!("prelude/colored") } else { text!("prelude/grey") },
                    text!("prelude/exponential"),
                    if walk.bilinear { text!("prelude/bilinear") } else { text!("prelude/nearest") },
                    text!("prelude/visibility"),
                    text!("prelude/pass"),
                    text!("prelude/light_map"),
                ];
                texts.extend(consumer.deposits(text!("prelude/light_map_scatter")));
                texts
            }
            Self::Volume(consumer, walk) => {
                let mut texts = vec![
                    if walk.colored { text!("prelude/colored") } else { text!("prelude/grey") },
                    text!("prelude/exponential"),
                    text!("prelude/volume_track"),
                    text!("prelude/volume_bricks"),
                    if walk.trilinear {
                        text!("prelude/volume_trilinear")
                    } else {
                        text!("prelude/volume_nearest")
                    },
                    text!("prelude/pass"),
                    text!("prelude/volume"),
                ];
                texts.extend(consumer.deposits(text!("prelude/volume_scatter")));
                texts
            }
            _ => vec![text!("prelude/vector_params"), text!("prelude/vector")],
        }
    }

    /// The whole text, as it is compiled.
    pub(super) fn source(self) -> String {
        let mut source = self.constants();
        for text in self.prelude().into_iter().chain([self.body().1]) {
            source.push('\n');
            source.push_str(text);
        }
        source
    }

    /// What Rust and WGSL both know, declared in Rust.
    fn constants(self) -> String {
        let mut text = String::new();
        let mut put = |line: String| {
            let _infallible = writeln!(text, "{line}");
        };
        put(format!("const LANES: u32 = {LANES}u;\nconst PIECE: u32 = {PIECE}u;"));
        put(format!("const NOWHERE: u32 = {NOWHERE}u;\nconst HUGE: f32 = {:e}f;", f32::MAX));
        put(format!(
            "const WORD: f32 = {:e}f;\nconst WORD_INVERSE: f32 = {:e}f;",
            2f32.powi(32),
            2f32.powi(-32)
        ));
        match self {
            Self::LightMap(_, walk) => {
                put(format!("const RAYS: u32 = {RAYS}u;\nconst LEVELS: u32 = {LEVELS}u;"));
                put(format!("const TICKS: u32 = {TICKS}u;\nconst FARTHEST: i32 = {FARTHEST};"));
                put(format!("const RAYS_EXPONENT: i32 = {};", RAYS.ilog2()));
                let near = if walk.near { NEAR } else { 0 };
                put(format!("const NEAR: i32 = {near};"));
                put(format!("const NEAR_NUMBERS: u32 = {}u;", (near * near * walk.channels).max(1)));
                put(format!(
                    "const CHANNELS: u32 = {}u;\nconst MARCH: bool = {};",
                    walk.channels, walk.march
                ));
                put(series("series_0", &SERIES_0[..SERIES]));
                put(series("series_2", &SERIES_2[..SERIES]));
            }
            Self::Volume(_, walk) => {
                put(format!("const RAYS: u32 = {RAYS}u;\nconst LIGHTS: u32 = {LIGHTS}u;"));
                put(format!("const TICKS: u32 = {TICKS}u;\nconst PLACE_BITS: u32 = {PLACE_BITS}u;"));
                put(format!(
                    "const CHANNELS: u32 = {}u;\nconst COLORED: bool = {};",
                    walk.channels, walk.colored
                ));
                put(format!("const EXTINCTION: bool = {};", walk.extinction));
                put(format!("const LIT: bool = {};\nconst NESTED: bool = {};", walk.lit, walk.nested));
                put(format!("const PANEL: f32 = {PANEL:e}f;\nconst MOST_PANELS: f32 = {MOST_PANELS:e}f;"));
                for (k, [node, weight]) in GAUSS_4.iter().enumerate() {
                    put(format!(
                        "const NODE_{k}: f32 = {node:e}f;\nconst NODE_WEIGHT_{k}: f32 = {weight:e}f;"
                    ));
                }
                for (k, [node, _]) in GAUSS_2.iter().enumerate() {
                    put(format!("const HALF_NODE_{k}: f32 = {node:e}f;"));
                }
                put(series("series_0", &SERIES_0[..SERIES]));
                put(series("series_2", &SERIES_2[..SERIES]));
            }
            Self::Rows { colored, channels, squared, sharers } => {
                put(format!("const COLORED: bool = {colored};\nconst CHANNELS: u32 = {channels}u;"));
                put(format!("const SQUARED: bool = {squared};\nconst SHARERS: u32 = {sharers}u;"));
            }
            Self::Tiles { colored, channels, operation } => {
                put(format!("const COLORED: bool = {colored};\nconst CHANNELS: u32 = {channels}u;"));
                put(format!(
                    "const OPERATION: u32 = {}u;\nconst TILE: u32 = {}u;",
                    operation as u32,
                    TILE_SIDE * TILE_SIDE
                ));
            }
            _ => {}
        }
        text
    }

    /// What it binds, group by group.
    pub(super) fn bindings(self) -> Vec<Vec<Access>> {
        use Access::{Parameters, Read, Uniform, Write};
        let first = match self {
            Self::Fill | Self::Scale | Self::Invert | Self::Clamp => vec![Parameters, Write],
            Self::Axpby | Self::Multiply | Self::HoldAtBounds | Self::Shorten | Self::FixedScale => {
                vec![Parameters, Write, Read]
            }
            Self::LargestBits => vec![Parameters, Write, Read],
            Self::Hold
            | Self::Pick
            | Self::Place
            | Self::Dot
            | Self::ProjectedNormSquared
            | Self::LargestStep => {
                vec![Parameters, Write, Read, Read]
            }
            Self::Difference | Self::Divergence | Self::FixedFinish => {
                vec![Parameters, Write, Read, Read, Read]
            }
            Self::LightMap(Consumer::Gather, _) | Self::Volume(Consumer::Gather, _) => {
                vec![Parameters, Write, Read]
            }
            Self::LightMap(Consumer::Scatter(sums) | Consumer::Squares(sums), _)
            | Self::Volume(Consumer::Scatter(sums) | Consumer::Squares(sums), _) => match sums {
                Accumulation::Fixed => vec![Parameters, Read, Write, Write, Read],
                Accumulation::Float | Accumulation::Swap => vec![Parameters, Read, Write],
            },
            Self::Rows { .. } => vec![Parameters, Write, Read, Read, Read, Read],
            Self::Tiles { .. } => vec![Parameters, Write, Read, Read, Read, Read, Read],
        };
        match self {
            Self::LightMap(..) => vec![first, vec![Read, Read, Uniform], vec![Read]],
            Self::Volume(..) => vec![first, vec![Read, Read, Read, Uniform], vec![Read]],
            _ => vec![first],
        }
    }

    /// Every kernel in every variant that some problem can ask for.
    fn all() -> Vec<Self> {
        let mut all = vec![
            Self::Fill,
            Self::Axpby,
            Self::Scale,
            Self::Multiply,
            Self::Invert,
            Self::Clamp,
            Self::Hold,
            Self::HoldAtBounds,
            Self::Shorten,
            Self::Pick,
            Self::Place,
            Self::Difference,
            Self::Divergence,
            Self::Dot,
            Self::ProjectedNormSquared,
            Self::LargestStep,
            Self::LargestBits,
            Self::FixedScale,
            Self::FixedFinish,
        ];
        let sums = [Accumulation::Float, Accumulation::Swap, Accumulation::Fixed];
        for walk in VolumeWalk::all() {
            all.push(Self::Volume(Consumer::Gather, walk));
            all.extend(sums.map(|sums| Self::Volume(Consumer::Scatter(sums), walk)));
            all.extend(sums.map(|sums| Self::Volume(Consumer::Squares(sums), walk)));
        }
        for colored in [false, true] {
            for channels in [1, 3] {
                for [bilinear, march] in [[false, false], [false, true], [true, false], [true, true]] {
                    let walk = Walk { bilinear, march, colored, channels, near: false };
                    all.push(Self::LightMap(Consumer::Gather, walk));
                    for walk in [walk, Walk { near: true, ..walk }] {
                        all.extend(sums.map(|sums| Self::LightMap(Consumer::Scatter(sums), walk)));
                        all.extend(sums.map(|sums| Self::LightMap(Consumer::Squares(sums), walk)));
                    }
                }
                for squared in [false, true] {
                    all.extend([1, 8, 32].map(|sharers| Self::Rows { colored, channels, squared, sharers }));
                }
                let operations = [TileOperation::Stretch, TileOperation::Shrink, TileOperation::Descend];
                all.extend(operations.map(|operation| Self::Tiles { colored, channels, operation }));
            }
        }
        all
    }
}

/// `Σₙ (−1)ⁿ aₙ sⁿ⁺¹` by Horner's rule as a function of WGSL, without a loop: some drivers count the rounds of all loops
/// of an invocation, and end them after so many.
fn series(name: &str, terms: &[f64]) -> String {
    let term = |term: &f64| format!("{:e}f", *term as f32);
    let (last, others) =
        terms.split_last().map_or(("0.0f".to_owned(), &[][..]), |(last, rest)| (term(last), rest));
    let sum = others.iter().rev().fold(last, |sum, a| format!("({} - s * {sum})", term(a)));
    format!("fn {name}(s: f32) -> f32 {{\n    return s * {sum};\n}}")
}

/// A kernel as it is compiled, for those who want to read or check it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KernelText {
    /// The file of `kernels/` that it is.
    pub name: &'static str,
    /// Which variant, in words.
    pub variant: String,
    /// WGSL.
    pub source: String,
}

/// Every kernel in every variant that some problem can ask for.
pub fn kernel_texts() -> Vec<KernelText> {
    let text = |kernel: Kernel| KernelText {
        name: kernel.name(),
        variant: format!("{kernel:?}"),
        source: kernel.source(),
    };
    let drawing = KernelText {
        name: "surfaces",
        variant: "surfaces".to_owned(),
        source: super::surfaces::SURFACES.to_owned(),
    };
    Kernel::all().into_iter().map(text).chain([drawing]).collect()
}

#[cfg(test)]
mod tests;
