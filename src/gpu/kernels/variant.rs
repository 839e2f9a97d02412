//! What a kernel is compiled for: variants, with the constants, texts and bindings that each of them adds.

use super::access::Access;
use super::layout::{FARTHEST, LEVELS, LIGHTS, PLACE_BITS, TICKS};
use super::walk::{LightMapWalk, VolumeWalk, Walk};
use super::{RAYS, SHARERS};
use crate::march::{GAUSS_2, GAUSS_4, MOST_PANELS, PANEL, SERIES_0, SERIES_2};
use crate::operator::TILE_SIDE;

/// Texels a side around the entry of a workgroup's rays that are summed up inside the workgroup.
const NEAR: u32 = 16;
/// Unknowns of a tile.
const TILE: u32 = (TILE_SIDE * TILE_SIDE) as u32;
/// Terms of the series for thin media: enough for f32 up to an optical depth of ½ a cell.
const SERIES: usize = 9;

/// A variant of a kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) enum Variant {
    /// Of a kernel that has no variants.
    Plain,
    /// Of rows that are kept.
    Rows {
        colored: bool,
        /// Channels at once: 1 or 3.
        channels: u32,
        squared: bool,
        /// Whether the channels of an element of x lie side by side.
        interleaved: bool,
    },
    /// Of the metric of tiles.
    Tiles {
        colored: bool,
        /// Channels at once: 1 or 3.
        channels: u32,
        operation: TileOperation,
        /// Whether a tile is read once, into the memory of its workgroup; a grey one.
        held: bool,
    },
    /// Of what takes rays or fans lane by lane.
    Lanes,
    /// Of a traversal: how rays are walked, and how deposits are added up where there are any.
    Walk(Walk, Option<Accumulation>),
}

/// What is done with a metric of tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) enum TileOperation {
    Stretch,
    Shrink,
    Descend,
}

/// How sums are made where many rays meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Accumulation {
    /// In f32 by the device's atomics, in any order.
    Float,
    /// In f32 by compare-and-swap, in any order.
    Swap,
    /// In 64-bit fixed point: the same bits in any order.
    Fixed,
}

pub(super) fn plain() -> Vec<Variant> {
    vec![Variant::Plain]
}

pub(super) fn of_lanes() -> Vec<Variant> {
    vec![Variant::Lanes]
}

/// Whether weights are coloured, and channels at once.
fn weights_and_channels() -> impl Iterator<Item = (bool, u32)> {
    [false, true].into_iter().flat_map(|colored| [1, 3].map(|channels| (colored, channels)))
}

pub(super) fn rows() -> Vec<Variant> {
    let of = |(colored, channels)| {
        let kinds = [(false, false), (false, true), (true, false), (true, true)].into_iter();
        kinds
            .filter(move |(_, interleaved)| channels == 3 || !interleaved)
            .map(move |(squared, interleaved)| Variant::Rows { colored, channels, squared, interleaved })
    };
    weights_and_channels().flat_map(of).collect()
}

pub(super) fn tiles() -> Vec<Variant> {
    let operations = [TileOperation::Stretch, TileOperation::Shrink, TileOperation::Descend];
    let of = |(colored, channels)| {
        let kinds = operations.into_iter().flat_map(|operation| [false, true].map(|held| (operation, held)));
        kinds
            .filter(move |&(operation, held)| !(held && (colored || operation == TileOperation::Stretch)))
            .map(move |(operation, held)| Variant::Tiles { colored, channels, operation, held })
    };
    weights_and_channels().flat_map(of).collect()
}

/// Every traversal that gathers.
pub(super) fn gathers() -> Vec<Variant> {
    Walk::all().into_iter().filter(|walk| !walk.sums_near()).map(|walk| Variant::Walk(walk, None)).collect()
}

/// Every traversal that deposits.
pub(super) fn deposits() -> Vec<Variant> {
    let sums = [Accumulation::Float, Accumulation::Swap, Accumulation::Fixed];
    Walk::all().into_iter().flat_map(|walk| sums.map(|sum| Variant::Walk(walk, Some(sum)))).collect()
}

impl Accumulation {
    /// What is bound behind `y`.
    fn binds(self) -> &'static [Access] {
        match self {
            Self::Float | Self::Swap => &[Access::Write],
            Self::Fixed => &[Access::Write, Access::Write, Access::Read],
        }
    }

    /// The texts that add up what a traversal deposits.
    fn texts(self, walk: Walk) -> Vec<&'static str> {
        let scatter = match walk {
            Walk::LightMap(_) => prelude!("light_map_scatter"),
            Walk::Volume(_) => prelude!("volume_scatter"),
        };
        let accumulate = match self {
            Self::Float => prelude!("accumulate_float"),
            Self::Swap => prelude!("accumulate_swap"),
            Self::Fixed => prelude!("accumulate_fixed"),
        };
        vec![prelude!("carried"), prelude!("fixed_point"), scatter, accumulate]
    }
}

impl Variant {
    /// What the first group binds behind what the kernel's own row says.
    pub(super) fn binds(self) -> &'static [Access] {
        match self {
            Self::Walk(_, Some(accumulation)) => accumulation.binds(),
            _ => &[],
        }
    }

    /// Further groups of bindings: what rays pass through, and the rays.
    pub(super) fn groups(self) -> &'static [&'static [Access]] {
        use Access::{Read, Uniform};
        match self {
            Self::Walk(Walk::LightMap(_), _) => &[&[Read, Read, Uniform], &[Read]],
            Self::Walk(Walk::Volume(_), _) => &[&[Read, Read, Read, Uniform], &[Read]],
            _ => &[],
        }
    }

    /// Texts of `kernels/prelude/` before those of the kernel's own row.
    pub(super) fn texts(self) -> Vec<&'static str> {
        let (walk, accumulation) = match self {
            Self::Walk(walk, accumulation) => (walk, accumulation),
            Self::Rows { interleaved: true, .. } => return vec![prelude!("interleaved")],
            Self::Rows { .. } => return vec![prelude!("planes")],
            Self::Lanes => return vec![prelude!("lanes")],
            _ => return Vec::new(),
        };
        let mut texts = match walk {
            Walk::LightMap(walk) => vec![
                if walk.colored { prelude!("colored") } else { prelude!("grey") },
                prelude!("extinguished"),
                prelude!("exponential"),
                if walk.bilinear { prelude!("bilinear") } else { prelude!("nearest") },
                prelude!("visibility"),
                prelude!("walk_params"),
                prelude!("light_map"),
            ],
            Walk::Volume(walk) => vec![
                if walk.colored { prelude!("colored") } else { prelude!("grey") },
                prelude!("extinguished"),
                prelude!("exponential"),
                prelude!("volume_track"),
                prelude!("volume_bricks"),
                if walk.trilinear { prelude!("volume_trilinear") } else { prelude!("volume_nearest") },
                prelude!("walk_params"),
                prelude!("volume"),
            ],
        };
        texts.extend(accumulation.into_iter().flat_map(|accumulation| accumulation.texts(walk)));
        texts
    }

    /// What Rust and WGSL both know of it, declared in Rust.
    pub(super) fn constants(self) -> Vec<String> {
        match self {
            Self::Plain => Vec::new(),
            Self::Lanes => {
                vec![constant("RAYS", "u32", RAYS), series("series_0", &SERIES_0[..SERIES])]
            }
            Self::Rows { colored, channels, squared, .. } => vec![
                constant("COLORED", "bool", colored),
                constant("CHANNELS", "u32", channels),
                constant("SQUARED", "bool", squared),
                constant("SHARERS", "u32", SHARERS),
            ],
            Self::Tiles { colored, channels, operation, held } => vec![
                constant("COLORED", "bool", colored),
                constant("CHANNELS", "u32", channels),
                constant("OPERATION", "u32", operation as u32),
                constant("TILE", "u32", TILE),
                constant("HELD", "bool", held),
                constant("HELD_NUMBERS", "u32", if held { TILE * (TILE + 1) / 2 } else { 1 }),
            ],
            Self::Walk(Walk::LightMap(walk), _) => of_light_map(walk),
            Self::Walk(Walk::Volume(walk), _) => of_volume(walk),
        }
    }
}

/// Constants of every traversal.
fn of_walk(channels: u32) -> Vec<String> {
    vec![
        constant("RAYS", "u32", RAYS),
        constant("TICKS", "u32", TICKS),
        constant("CHANNELS", "u32", channels),
        series("series_0", &SERIES_0[..SERIES]),
        series("series_2", &SERIES_2[..SERIES]),
    ]
}

fn of_light_map(walk: LightMapWalk) -> Vec<String> {
    let near = if walk.near { NEAR } else { 0 };
    let mut constants = of_walk(walk.channels);
    constants.extend([
        constant("LEVELS", "u32", LEVELS),
        constant("FARTHEST", "i32", FARTHEST),
        constant("RAYS_EXPONENT", "i32", RAYS.ilog2()),
        constant("NEAR", "i32", near),
        constant("NEAR_NUMBERS", "u32", (near * near * walk.channels).max(1)),
        constant("MARCH", "bool", walk.march),
    ]);
    constants
}

fn of_volume(walk: VolumeWalk) -> Vec<String> {
    let mut constants = of_walk(walk.channels);
    constants.extend([
        constant("LIGHTS", "u32", LIGHTS),
        constant("PLACE_BITS", "u32", PLACE_BITS),
        constant("COLORED", "bool", walk.colored),
        constant("EXTINCTION", "bool", walk.extinction),
        constant("LIT", "bool", walk.lit),
        constant("NESTED", "bool", walk.nested),
        constant("PANEL", "f32", float(PANEL)),
        constant("MOST_PANELS", "f32", float(MOST_PANELS)),
    ]);
    for (k, [node, weight]) in GAUSS_4.iter().enumerate() {
        constants.push(constant(&format!("NODE_{k}"), "f32", float(node)));
        constants.push(constant(&format!("NODE_WEIGHT_{k}"), "f32", float(weight)));
    }
    let halves = GAUSS_2.iter().enumerate();
    constants.extend(halves.map(|(k, [node, _])| constant(&format!("HALF_NODE_{k}"), "f32", float(node))));
    constants
}

/// A constant of WGSL.
pub(super) fn constant(name: &str, kind: &str, value: impl std::fmt::Display) -> String {
    let suffix = if kind == "u32" { "u" } else { "" };
    format!("const {name}: {kind} = {value}{suffix};")
}

/// A number as WGSL writes it.
pub(super) fn float(value: impl std::fmt::LowerExp) -> String {
    format!("{value:e}f")
}

/// `Σₙ (−1)ⁿ aₙ sⁿ⁺¹` by Horner's rule as a function of WGSL, without a loop: some drivers count the rounds of all loops
/// of an invocation, and end them after so many.
fn series(name: &str, terms: &[f64]) -> String {
    let term = |term: &f64| float(*term as f32);
    let (last, others) =
        terms.split_last().map_or(("0.0f".to_owned(), &[][..]), |(last, rest)| (term(last), rest));
    let sum = others.iter().rev().fold(last, |sum, a| format!("({} - s * {sum})", term(a)));
    format!("fn {name}(s: f32) -> f32 {{\n    return s * {sum};\n}}")
}
