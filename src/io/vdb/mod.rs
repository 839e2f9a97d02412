//! OpenVDB files: sparse grids of voxels, as simulations and renderers exchange them.
//!
//! What is read are grids of `float` and `Vec3s` in the usual tree (5, 4, 3) of the file versions 220 to 225, as they
//! are, packed with zlib or with Blosc and LZ4, in single or half precision, under any linear transform. A grid
//! becomes the dense box of its active voxels.
//!
//! The index of a VDB voxel names its centre, where a [`VoxelGrid`](crate::scene::VoxelGrid) has corners at whole
//! numbers: the two differ by half a voxel.
//!
//! Source  the reader and writer of OpenVDB 10 to 13 (io/Archive.cc, io/Compression.h, tree/*.h), for the layout

mod blosc;
mod byte_reader;
mod byte_writer;
mod dense;
mod header;
mod mask;
mod packing;
mod read;
mod sparse;
#[cfg(test)]
mod tests;
mod transform;
mod tree;
mod values;
mod write;

pub use packing::Compression;
pub(super) use read::{Boxed, place, read_within};
pub use read::{names, read};
pub use write::{WriteOptions, write};
