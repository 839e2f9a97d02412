use std::io::{Read, Seek};
use std::path::Path;

use glam::{DAffine3, DVec3};

use super::byte_reader::ByteReader;
use super::dense::{DenseGrid, IndexBox, MAX_DENSE};
use super::header::{CODED_NODES, Descriptor, Header, Metadata};
use super::packing::Compression;
use super::transform;
use super::tree::{Node, Tree};
use super::values::Decoder;
use crate::scene::{Samples, Volume, VoxelGrid};
use crate::{Error, Result};

/// Reads one grid of a VDB file: the box of its active voxels, in single precision.
///
/// Without a name this is the only grid, or `density` among several. Grids that share a name are `name[0]`,
/// `name[1]`, …, and the name alone is none of them. Inactive voxels inside the box have the value that the file gives them: the background where it
/// stores none. Memory: the box, at most 2²⁹ voxels, and a few bytes for each leaf of the file.
///
/// Errors: [`Error::File`](crate::Error::File) where the file cannot be read; [`Error::Format`](crate::Error::Format)
/// where it is damaged, has no such grid (the names are listed), or the grid has other values than `float` and
/// `Vec3s`, is a level set, shares its voxels with another grid, lies in the frustum of a camera or has no active
/// voxel; [`Error::TooLarge`](crate::Error::TooLarge) for a box of more than 2²⁹ voxels or 4096 a side;
/// [`Error::NonFinite`](crate::Error::NonFinite) naming an index of the grid.
pub fn read(path: &Path, grid: Option<&str>) -> Result<Volume> {
    Ok(read_within(path, grid, &|_| Ok(()))?.volume)
}

/// The box of active voxels of a grid.
pub(in crate::io) struct Boxed {
    pub(in crate::io) volume: Volume,
    /// The index of its first voxel.
    pub(in crate::io) first: [i64; 3],
    /// The value outside: the background.
    pub(in crate::io) outside: [f32; 3],
}

/// [`read`], once `allow` has said that the box may take so many bytes.
pub(in crate::io) fn read_within(
    path: &Path,
    grid: Option<&str>,
    allow: &dyn Fn(u64) -> Result<()>,
) -> Result<Boxed> {
    read_from(ByteReader::open(path)?, grid, Limits { voxels: MAX_DENSE, allow })
}

/// Where the box of active voxels of a grid lies.
///
/// Errors: those of [`read`], but for values.
pub(in crate::io) fn place(path: &Path, grid: Option<&str>) -> Result<VoxelGrid> {
    let source = &mut ByteReader::open(path)?;
    let header = Header::read(source)?;
    let grid = begin(source, &header, grid)?;
    match grid.tree.as_str() {
        SCALARS => Ok(survey::<_, 1>(source, &header, grid, MAX_DENSE)?.voxels),
        _ => Ok(survey::<_, 3>(source, &header, grid, MAX_DENSE)?.voxels),
    }
}

/// The names of the grids in a VDB file, in its order.
///
/// Errors: [`Error::File`](crate::Error::File), or [`Error::Format`](crate::Error::Format) for a file that is damaged.
pub fn names(path: &Path) -> Result<Vec<String>> {
    let header = Header::read(&mut ByteReader::open(path)?)?;
    Ok(header.grids.into_iter().map(|grid| grid.name).collect())
}

/// What a dense box may take.
#[derive(Clone, Copy)]
pub(super) struct Limits<'a> {
    pub(super) voxels: usize,
    /// Whether it may take so many bytes.
    pub(super) allow: &'a dyn Fn(u64) -> Result<()>,
}

const SCALARS: &str = "Tree_float_5_4_3";
const VECTORS: &str = "Tree_vec3s_5_4_3";

/// [`read`] from anything that has bytes.
pub(super) fn read_from<R: Read + Seek>(
    mut source: ByteReader<R>,
    grid: Option<&str>,
    limits: Limits,
) -> Result<Boxed> {
    let source = &mut source;
    let header = Header::read(source)?;
    let grid = begin(source, &header, grid)?;
    match grid.tree.as_str() {
        SCALARS => survey::<R, 1>(source, &header, grid, limits.voxels)?.fill(limits),
        _ => survey::<R, 3>(source, &header, grid, limits.voxels)?.fill(limits),
    }
}

/// Chooses a grid of [`SCALARS`] or [`VECTORS`] and goes to where it begins.
fn begin<'h, R: Read + Seek>(
    source: &mut ByteReader<R>,
    header: &'h Header,
    grid: Option<&str>,
) -> Result<&'h Descriptor> {
    let grid = header.choose(grid).map_err(|reason| source.broken(reason))?;
    source.go_to(grid.start)?;
    source.end_at(grid.end);
    if !grid.instance_of.is_empty() {
        let reason = format!("its grid `{}` shares the voxels of `{}`", grid.name, grid.instance_of);
        return Err(source.broken(format!("{reason}; read that one, or save the file without instances")));
    }
    match grid.tree.as_str() {
        SCALARS | VECTORS => Ok(grid),
        tree => Err(source.broken(format!("its grid `{}` holds {}", grid.name, kind_of(tree)))),
    }
}

/// What a tree that is not read holds, for people.
fn kind_of(tree: &str) -> String {
    const KINDS: [(&str, &str); 10] = [
        ("Tree_float", "numbers in an unusual tree"),
        ("Tree_vec3s", "vectors in an unusual tree"),
        ("Tree_double", "numbers in double precision"),
        ("Tree_vec3d", "vectors in double precision"),
        ("Tree_vec3i", "vectors of whole numbers"),
        ("Tree_half", "numbers in a tree of halves"),
        ("Tree_bool", "truth values"),
        ("Tree_mask", "a mask"),
        ("Tree_int", "whole numbers"),
        ("Tree_pt", "points"),
    ];
    let kind =
        KINDS.iter().find(|(prefix, _)| tree.starts_with(prefix)).map_or("unknown values", |kind| kind.1);
    format!("{kind} (`{tree}`); only `float` and `Vec3s` in the tree 5, 4, 3 are read")
}

/// A tree whose box is known.
struct Survey<'s, 'p, R, const C: usize> {
    tree: Tree<'s, 'p, R, C>,
    /// Where the tree begins.
    start: u64,
    /// The grid, in words.
    what: String,
    bounds: IndexBox,
    voxels: VoxelGrid,
    leaves: Vec<[i64; 3]>,
}

/// The first of two passes over a tree, as its box is known only after that: so nothing but the box is kept dense.
fn survey<'s, 'p, R: Read + Seek, const C: usize>(
    source: &'s mut ByteReader<'p, R>,
    header: &Header,
    grid: &Descriptor,
    max_voxels: usize,
) -> Result<Survey<'s, 'p, R, C>> {
    let (compression, active_only) = packing(source, header)?;
    let metadata = Metadata::read(source)?;
    if metadata.is_level_set {
        return Err(source.broken(format!(
            "its grid `{}` is a level set, which holds distances to a surface; save it as a fog volume \
             (sdfToFogVolume of OpenVDB, `Convert VDB` from SDF to fog in Houdini)",
            grid.name
        )));
    }
    let world_from_index = transform::read(source)?;
    let decoder = Decoder::new(compression, active_only, metadata.half.unwrap_or(grid.half));
    let start = source.at();
    let what = format!("the grid `{}` of {}", grid.name, source.path().display());
    let mut tree = Tree::<R, C> { source, decoder, version: header.version };

    let mut bounds = IndexBox::EMPTY;
    let mut leaves = Vec::new();
    tree.topology(&mut |part| {
        bounds.include_active(&part);
        if let Node::Leaf { origin, .. } = part {
            leaves.push(origin);
        }
    })?;
    if bounds.is_empty() {
        return Err(tree.source.broken(format!("its grid `{}` has no active voxel", grid.name)));
    }
    let size = bounds.size(format!("the box of active voxels of {what}"), max_voxels)?;
    let world_from_grid = placed(world_from_index, bounds.min);
    let voxels = VoxelGrid::new(size, world_from_grid)
        .map_err(|error| tree.source.broken(format!("the transform of its grid `{}`: {error}", grid.name)))?;
    Ok(Survey { tree, start, what, bounds, voxels, leaves })
}

impl<R: Read + Seek, const C: usize> Survey<'_, '_, R, C> {
    /// The second pass: the values of the box.
    fn fill(self, limits: Limits) -> Result<Boxed> {
        let Self { mut tree, start, what, bounds, voxels, leaves } = self;
        (limits.allow)((voxels.len() * size_of::<[f32; C]>()) as u64)?;
        let background = tree.decoder.background;
        let mut dense = DenseGrid::new(bounds.min, voxels.size(), background)?;
        tree.source.go_to(start)?;
        tree.topology(&mut |part| {
            if let Node::Tile { origin, side, value, .. } = part {
                dense.fill(origin, side, value);
            }
        })?;
        tree.leaves(leaves, |origin, values| dense.place(origin, values))?;
        let is_finite = |value: &[f32; C]| value.iter().all(|number| number.is_finite());
        if let Some(index) = dense.values.iter().position(|value| !is_finite(value)) {
            let voxel = voxels.voxel(index);
            let [i, j, k] = std::array::from_fn(|axis| bounds.min[axis] + voxel[axis] as i64);
            return Err(Error::NonFinite { what, place: format!("index ({i}, {j}, {k})") });
        }
        let volume = Volume::new(voxels, C, Samples::F32(dense.values.into_flattened()))?;
        // Grey is the same in all channels.
        let outside = std::array::from_fn(|channel| background[channel.min(C - 1)]);
        Ok(Boxed { volume, first: bounds.min, outside })
    }
}

/// How a grid is packed, and whether only its active values are stored.
fn packing<R: Read + Seek>(source: &mut ByteReader<R>, header: &Header) -> Result<(Compression, bool)> {
    if header.version < CODED_NODES {
        return Ok((header.compression, false));
    }
    let flags = source.u32()?;
    let unknown = || source.broken(format!("it is packed in an unknown way ({flags:#x})"));
    Compression::of_flags(flags).ok_or_else(unknown)
}

/// The world from a box whose first voxel has its centre at `min`.
fn placed(world_from_index: DAffine3, min: [i64; 3]) -> DAffine3 {
    let corner = DVec3::from_array(min.map(|side| side as f64 - 0.5));
    world_from_index * DAffine3::from_translation(corner)
}
