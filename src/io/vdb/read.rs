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
use crate::Result;
use crate::scene::{Samples, Volume, VoxelGrid};

/// Reads one grid of a VDB file: the box of its active voxels, in single precision.
///
/// Without a name this is the only grid, or `density` among several. Grids that share a name are `name[0]`,
/// `name[1]`, … Inactive voxels inside the box have the value that the file gives them: the background where it
/// stores none. Memory: the box, at most 2²⁹ voxels, and a few bytes for each leaf of the file.
///
/// Errors: [`Error::File`](crate::Error::File) where the file cannot be read; [`Error::Format`](crate::Error::Format)
/// where it is damaged, has no such grid (the names are listed), or the grid has other values than `float` and
/// `Vec3s`, shares its voxels with another grid, lies in the frustum of a camera or has no active voxel;
/// [`Error::TooLarge`](crate::Error::TooLarge) for a box of more than 2²⁹ voxels or 4096 a side;
/// [`Error::NonFinite`](crate::Error::NonFinite) naming a voxel.
pub fn read(path: &Path, grid: Option<&str>) -> Result<Volume> {
    read_from(ByteReader::open(path)?, grid, MAX_DENSE)
}

/// The names of the grids in a VDB file, in its order.
///
/// Errors: [`Error::File`](crate::Error::File), or [`Error::Format`](crate::Error::Format) for a file that is damaged.
pub fn names(path: &Path) -> Result<Vec<String>> {
    let header = Header::read(&mut ByteReader::open(path)?)?;
    Ok(header.grids.into_iter().map(|grid| grid.name).collect())
}

/// [`read`] from anything that has bytes, and at most so many voxels.
pub(super) fn read_from<R: Read + Seek>(
    mut source: ByteReader<R>,
    grid: Option<&str>,
    max_voxels: usize,
) -> Result<Volume> {
    let header = Header::read(&mut source)?;
    let grid = header.choose(grid).map_err(|reason| source.broken(reason))?;
    source.go_to(grid.start)?;
    source.end_at(grid.end);
    if !grid.instance_of.is_empty() {
        let reason = format!("its grid `{}` shares the voxels of `{}`", grid.name, grid.instance_of);
        return Err(source.broken(format!("{reason}; read that one, or save the file without instances")));
    }
    match grid.tree.as_str() {
        "Tree_float_5_4_3" => volume::<R, 1>(&mut source, &header, grid, max_voxels),
        "Tree_vec3s_5_4_3" => volume::<R, 3>(&mut source, &header, grid, max_voxels),
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

/// Two passes over the tree, as the box is known only after the first: so nothing but the box itself is kept dense.
fn volume<R: Read + Seek, const C: usize>(
    source: &mut ByteReader<R>,
    header: &Header,
    grid: &Descriptor,
    max_voxels: usize,
) -> Result<Volume> {
    let (compression, active_only) = packing(source, header)?;
    let metadata = Metadata::read(source)?;
    let world_from_index = transform::read(source)?;
    let decoder = Decoder::new(compression, active_only, metadata.half.unwrap_or(grid.half));
    let start = source.at();
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
    let size = bounds.size(&grid.name, max_voxels)?;
    let world_from_grid = placed(world_from_index, bounds.min);
    let voxels = VoxelGrid::new(size, world_from_grid)
        .map_err(|error| tree.source.broken(format!("the transform of its grid `{}`: {error}", grid.name)))?;

    let mut dense = DenseGrid::new(bounds.min, size, tree.decoder.background)?;
    tree.source.go_to(start)?;
    tree.topology(&mut |part| {
        if let Node::Tile { origin, side, value, .. } = part {
            dense.fill(origin, side, value);
        }
    })?;
    tree.leaves(leaves, |origin, values| dense.place(origin, values))?;
    Volume::new(voxels, C, Samples::F32(dense.values.into_flattened()))
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
