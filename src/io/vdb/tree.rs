//! The tree of a grid: a root that names boxes of 4096³ voxels, branches of 32³ slots, branches of 16³ slots, and
//! leaves of 8³ voxels. A slot holds the next level or a tile, one value for all its voxels. The masks and tiles of
//! the whole tree come first, depth first, then the voxels of its leaves in the same order.

use std::collections::HashSet;
use std::io::{Read, Seek};

use super::byte_reader::ByteReader;
use super::header::CODED_NODES;
use super::mask::{Mask, place_of};
use super::values::Decoder;
use crate::Result;

/// A branch: 2ˡ slots a side, each of 2ᵐ voxels a side.
pub(super) struct Level {
    pub(super) slots_log2: u32,
    pub(super) voxels_log2: u32,
    below: Option<&'static Level>,
}

/// Under the root.
pub(super) static UPPER: Level = Level { slots_log2: 5, voxels_log2: 7, below: Some(&LOWER) };
/// Above the leaves.
pub(super) static LOWER: Level = Level { slots_log2: 4, voxels_log2: 3, below: None };
/// Voxels a side of a leaf, as a power of 2.
pub(super) const LEAF_LOG2: u32 = 3;
/// Voxels of a leaf.
pub(super) const LEAF: usize = 1 << (3 * LEAF_LOG2);
/// Voxels a side of what the root names.
pub(super) const ROOT_SIDE: i64 = 1 << (5 + 4 + LEAF_LOG2);

impl Level {
    pub(super) fn slots(&self) -> usize {
        1 << (3 * self.slots_log2)
    }

    /// The first voxel of a slot.
    fn corner(&self, origin: [i64; 3], slot: usize) -> [i64; 3] {
        let place = place_of(slot, self.slots_log2);
        std::array::from_fn(|axis| origin[axis] + ((place[axis] as i64) << self.voxels_log2))
    }
}

/// What a tree consists of. No two parts share a voxel.
pub(super) enum Node<'m, const C: usize> {
    Tile { origin: [i64; 3], side: i64, value: [f32; C], active: bool },
    Leaf { origin: [i64; 3], active: &'m Mask },
}

/// Reads the tree of one grid of a file.
pub(super) struct Tree<'s, 'p, R, const C: usize> {
    pub(super) source: &'s mut ByteReader<'p, R>,
    pub(super) decoder: Decoder<C>,
    pub(super) version: u32,
}

impl<R: Read + Seek, const C: usize> Tree<'_, '_, R, C> {
    /// Shows `see` every tile and every leaf, and learns the background.
    ///
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn topology(&mut self, see: &mut dyn FnMut(Node<C>)) -> Result<()> {
        let buffers = self.source.u32()?;
        if buffers != 1 {
            return Err(self.source.broken(format!("its leaves have {buffers} values a voxel, not one")));
        }
        self.decoder.background = self.source.f32s()?;
        let [tiles, children] = [self.source.u32()?, self.source.u32()?];
        let mut seen = HashSet::new();
        for _ in 0..tiles {
            let origin = self.root_entry(&mut seen)?;
            let value = self.source.f32s()?;
            see(Node::Tile { origin, side: ROOT_SIDE, value, active: self.source.u8()? != 0 });
        }
        for _ in 0..children {
            let origin = self.root_entry(&mut seen)?;
            self.branch(&UPPER, origin, see)?;
        }
        Ok(())
    }

    /// Entries that overlap would let a small file fill the same voxels without end.
    fn root_entry(&mut self, seen: &mut HashSet<[i64; 3]>) -> Result<[i64; 3]> {
        let origin = self.source.index()?;
        if origin.iter().any(|side| side % ROOT_SIDE != 0) || !seen.insert(origin) {
            return Err(self
                .source
                .broken(format!("the root of its tree has no place for a node at {origin:?}")));
        }
        Ok(origin)
    }

    /// As deep as there are levels.
    fn branch(
        &mut self,
        level: &'static Level,
        origin: [i64; 3],
        see: &mut dyn FnMut(Node<C>),
    ) -> Result<()> {
        let children = Mask::read(self.source, level.slots())?;
        let active = Mask::read(self.source, level.slots())?;
        let mut values = if self.version < CODED_NODES {
            self.decoder.plain(self.source, level.slots() - children.count())?
        } else {
            let values = self.decoder.node(self.source, &active)?.into_iter().enumerate();
            values.filter_map(|(slot, value)| (!children.has(slot)).then_some(value)).collect()
        }
        .into_iter();
        for slot in (0..level.slots()).filter(|&slot| !children.has(slot)) {
            let (origin, side) = (level.corner(origin, slot), 1 << level.voxels_log2);
            let value = values.next().unwrap_or(self.decoder.background);
            see(Node::Tile { origin, side, value, active: active.has(slot) });
        }
        for slot in children.slots() {
            let origin = level.corner(origin, slot);
            match level.below {
                Some(below) => self.branch(below, origin, see)?,
                None => see(Node::Leaf { origin, active: &Mask::read(self.source, LEAF)? }),
            }
        }
        Ok(())
    }

    /// Shows `see` the voxels of leaves, in the order in which OpenVDB keeps them.
    ///
    /// Errors: [`Error::Format`](crate::Error::Format).
    pub(super) fn leaves(
        &mut self,
        mut leaves: Vec<[i64; 3]>,
        mut see: impl FnMut([i64; 3], &[[f32; C]]),
    ) -> Result<()> {
        leaves.sort_by_key(|origin| origin.map(|side| side.div_euclid(ROOT_SIDE)));
        for origin in leaves {
            let active = Mask::read(self.source, LEAF)?;
            if self.version < CODED_NODES {
                // The place, once more.
                self.source.skip(12)?;
                let buffers = self.source.u8()?;
                if buffers != 1 {
                    return Err(self
                        .source
                        .broken(format!("its leaves have {buffers} values a voxel, not one")));
                }
                see(origin, &self.decoder.plain(self.source, LEAF)?);
            } else {
                see(origin, &self.decoder.node(self.source, &active)?);
            }
        }
        Ok(())
    }
}
