use super::dense::IndexBox;
use super::mask::{Mask, place_of, slot_at};
use super::tree::{LEAF, LEAF_LOG2, LOWER, Level, UPPER};
use super::values::Encoder;
use crate::scene::Volume;

/// A volume of `C` channels as a tree with background 0; a voxel is active unless it is 0.
pub(super) struct Sparse<'v, const C: usize> {
    volume: &'v Volume,
    root: Slot<C, Branch<C, Branch<C, Leaf>>>,
}

/// What a slot of a node holds.
enum Slot<const C: usize, T> {
    Empty,
    Tile([f32; C]),
    Child(T),
}

/// A branch, whose slots are all there.
struct Branch<const C: usize, T> {
    level: &'static Level,
    slots: Vec<Slot<C, T>>,
}

/// The first voxel of a leaf.
struct Leaf([usize; 3]);

impl<'v, const C: usize> Sparse<'v, C> {
    /// The sides of a volume are at most those of what one entry of the root holds.
    pub(super) fn new(volume: &'v Volume) -> Self {
        let root = Branch::new(&UPPER, volume, [0; 3], |origin| {
            Branch::new(&LOWER, volume, origin, |origin| leaf(volume, origin))
        });
        Self { volume, root }
    }

    /// Masks and tiles, then voxels: given piece by piece to `put`.
    pub(super) fn write<E>(
        &self,
        encoder: &mut Encoder,
        mut put: impl FnMut(Pending) -> Result<(), E>,
    ) -> Result<(), E> {
        put(Pending::Bytes(self.head()))?;
        let Slot::Child(upper) = &self.root else { return put(Pending::Blocks) };
        put(Pending::Bytes(upper.head(encoder)))?;
        for lower in upper.children() {
            put(Pending::Bytes(lower.head(encoder)))?;
            for &Leaf(origin) in lower.children() {
                put(Pending::Bytes(self.active_of(origin).0.bytes().collect()))?;
            }
        }
        put(Pending::Blocks)?;
        for &Leaf(origin) in upper.children().flat_map(Branch::children) {
            let (mask, values) = self.active_of(origin);
            put(Pending::Bytes(mask.bytes().chain(encoder.node(&values)).collect()))?;
        }
        Ok(())
    }

    /// One value a voxel, the background and what the root holds.
    fn head(&self) -> Vec<u8> {
        let mut bytes = 1_u32.to_le_bytes().to_vec();
        bytes.extend([0; 4].repeat(C));
        let [tiles, children] = match self.root {
            Slot::Empty => [0_u32, 0],
            Slot::Tile(_) => [1, 0],
            Slot::Child(_) => [0, 1],
        };
        bytes.extend([tiles.to_le_bytes(), children.to_le_bytes()].as_flattened());
        if !matches!(self.root, Slot::Empty) {
            bytes.extend([0; 12]);
        }
        if let Slot::Tile(value) = self.root {
            bytes.extend(value.iter().flat_map(|number| number.to_le_bytes()));
            bytes.push(1);
        }
        bytes
    }

    /// The active voxels of a leaf, and their values.
    fn active_of(&self, origin: [usize; 3]) -> (Mask, Vec<[f32; C]>) {
        let mut mask = Mask::none(LEAF);
        let mut values = Vec::new();
        for slot in 0..LEAF {
            let place = place_of(slot, LEAF_LOG2);
            let value = value_at(self.volume, std::array::from_fn(|axis| origin[axis] + place[axis]));
            if value != [0.0; C] {
                mask.set(slot);
                values.push(value);
            }
        }
        (mask, values)
    }
}

/// What is written next.
pub(super) enum Pending {
    Bytes(Vec<u8>),
    /// The mark at which the voxels of the leaves begin; it is no bytes.
    Blocks,
}

impl<const C: usize, T> Branch<C, T> {
    /// Collapsed where all its slots are alike.
    fn new(
        level: &'static Level,
        volume: &Volume,
        origin: [usize; 3],
        child: impl Fn([usize; 3]) -> Slot<C, T>,
    ) -> Slot<C, Self> {
        let mut slots: Vec<Slot<C, T>> = (0..level.slots()).map(|_| Slot::Empty).collect();
        let size = volume.grid().size();
        let used: [usize; 3] = std::array::from_fn(|axis| {
            let left = size[axis].saturating_sub(origin[axis]);
            left.div_ceil(1 << level.voxels_log2).min(1 << level.slots_log2)
        });
        for x in 0..used[0] {
            for y in 0..used[1] {
                for z in 0..used[2] {
                    let place = [x, y, z];
                    let origin =
                        std::array::from_fn(|axis| origin[axis] + (place[axis] << level.voxels_log2));
                    if let Some(slot) = slots.get_mut(slot_at(place, level.slots_log2)) {
                        *slot = child(origin);
                    }
                }
            }
        }
        Self { level, slots }.collapsed()
    }

    fn collapsed(self) -> Slot<C, Self> {
        if self.slots.iter().all(|slot| matches!(slot, Slot::Empty)) {
            return Slot::Empty;
        }
        match self.slots.first() {
            Some(&Slot::Tile(first))
                if self.slots.iter().all(|slot| matches!(slot, Slot::Tile(value) if *value == first)) =>
            {
                Slot::Tile(first)
            }
            _ => Slot::Child(self),
        }
    }

    fn children(&self) -> impl Iterator<Item = &T> {
        self.slots.iter().filter_map(|slot| if let Slot::Child(child) = slot { Some(child) } else { None })
    }

    /// Which slots have children, which hold active tiles, and their values.
    fn head(&self, encoder: &mut Encoder) -> Vec<u8> {
        let [mut children, mut active] = [(); 2].map(|()| Mask::none(self.level.slots()));
        let mut values = Vec::new();
        for (index, slot) in self.slots.iter().enumerate() {
            match slot {
                Slot::Empty => {}
                Slot::Child(_) => children.set(index),
                Slot::Tile(value) => {
                    active.set(index);
                    values.push(*value);
                }
            }
        }
        children.bytes().chain(active.bytes()).chain(encoder.node(&values)).collect()
    }
}

/// Nothing, one value for all voxels, or a leaf.
fn leaf<const C: usize>(volume: &Volume, origin: [usize; 3]) -> Slot<C, Leaf> {
    let first = value_at(volume, origin);
    let alike = (0..LEAF).all(|slot| {
        let place = place_of(slot, LEAF_LOG2);
        value_at(volume, std::array::from_fn(|axis| origin[axis] + place[axis])) == first
    });
    match alike {
        false => Slot::Child(Leaf(origin)),
        true if first == [0.0; C] => Slot::Empty,
        true => Slot::Tile(first),
    }
}

/// Zero outside of the volume.
fn value_at<const C: usize>(volume: &Volume, voxel: [usize; 3]) -> [f32; C] {
    let grid = volume.grid();
    if voxel.iter().zip(grid.size()).any(|(&at, side)| at >= side) {
        return [0.0; C];
    }
    let index = grid.index(voxel);
    std::array::from_fn(|channel| volume.samples().get(C * index + channel))
}

/// The box of active voxels of a volume, and their number.
pub(super) fn active_voxels(volume: &Volume) -> (IndexBox, u64) {
    let (mut bounds, mut count) = (IndexBox::EMPTY, 0);
    for index in 0..volume.grid().len() {
        if volume.color(index) != [0.0; 3] {
            bounds.include(volume.grid().voxel(index).map(|side| side as i64));
            count += 1;
        }
    }
    (bounds, count)
}
