//! Animations as they are computed with: the scenes of the keys, and the extinction of the frames between them.

use std::path::Path;

use super::animation::{Animation, Between, Key};
use super::document::VolumeDocument;
use super::field::{Field, FieldSource};
use super::place::{Place, around};
use super::properties::EXTINCTION;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::flaw::{At, Built, Flaw};
use crate::scene::{self, KeyFrame, VolumeMedium, VolumeScene, VoxelGrid, VoxelSet};
use crate::{Error, Result};

/// How far corners of grids that are to be one may lie apart, relative to their size.
const SAME_PLACE: f64 = 1e-5;

/// An animation, and where the extinction of its frames comes from.
#[derive(Debug)]
pub struct AnimatedVolume {
    /// The keys, each a scene of its own.
    pub animation: scene::Animation,
    /// Where frames that are no keys have their extinction from: `blend`, `shapes` or `files`.
    pub between: &'static str,
    /// Where there is extinction in any frame that is no blend of its neighbours.
    pub occupied: VoxelSet,
    frames: Frames,
}

/// What makes the extinction of frames that are no keys.
#[derive(Debug)]
struct Frames {
    grid: VoxelGrid,
    from: Origin,
}

#[derive(Debug)]
enum Origin {
    Blend,
    /// On the way from one key's to the next one's.
    Shapes(Vec<(usize, FieldSource)>),
    Files(Box<Files>),
}

/// Numbered files.
#[derive(Debug)]
struct Files {
    pattern: FieldSource,
    first: usize,
    /// What the names are relative to.
    assets: Assets,
    place: Place,
}

impl AnimatedVolume {
    /// The extinction of a frame, read or made anew; none at keys and where it is that of the neighbouring keys, blended.
    ///
    /// Errors: [`Error::Value`] where a file is no longer what it was when the scene was read.
    pub fn extinction(&self, frame: usize) -> Result<Option<scene::Volume>> {
        if self.animation.keys.iter().any(|key| key.frame == frame) {
            return Ok(None);
        }
        self.frames.extinction(frame).map_err(|flaw| match flaw {
            Flaw::Machine(error) => error,
            Flaw::Document { problem, .. } => {
                Error::value("animation", problem, "what it was when the scene was read")
            }
        })
    }
}

impl Frames {
    /// Of an animation whose keys are on a grid, and whose files of extinction fill `frames` together.
    fn new(
        animation: &Animation,
        document: &VolumeDocument,
        (grid, frames): (VoxelGrid, Option<VoxelGrid>),
        assets: Assets,
    ) -> Built<Self> {
        let source = document.volume.extinction.source();
        if animation.is_of_files(&document.volume) {
            let place = document.volume.place(frames.as_ref(), Some(&grid)).at("volume")?;
            let first = animation.first_file();
            return Ok(Self {
                grid,
                from: Origin::Files(Box::new(Files { pattern: source, first, assets, place })),
            });
        }
        if animation.between == Between::Blend {
            return Ok(Self { grid, from: Origin::Blend });
        }
        let own = |key: &Key| (key.frame, key.extinction.as_ref().map_or(source.clone(), Field::source));
        let keys: Vec<(usize, FieldSource)> = animation.keys.iter().map(own).collect();
        for (index, pair) in keys.windows(2).enumerate() {
            pair[0].1.towards(&pair[1].1, 0.5).at(&format!("animation.keys[{}].extinction", index + 1))?;
        }
        Ok(Self { grid, from: Origin::Shapes(keys) })
    }

    fn name(&self) -> &'static str {
        match self.from {
            Origin::Blend => "blend",
            Origin::Shapes(_) => "shapes",
            Origin::Files(_) => "files",
        }
    }

    fn extinction(&self, frame: usize) -> Built<Option<scene::Volume>> {
        let grid = &self.grid;
        match &self.from {
            Origin::Blend => Ok(None),
            Origin::Shapes(keys) => {
                let frames: Vec<usize> = keys.iter().map(|(frame, _)| *frame).collect();
                let between = scene::KeySpan::of(&frames, frame);
                let [from, to] = between.keys.map(|key| &keys[key].1);
                let source = from.towards(to, between.share)?;
                let assets = Assets::beside(Path::new(""));
                let field = Field::From(source);
                let volume = field.filled(&assets, Some(grid.size()), grid.world_from_cube())?;
                field.kept(volume).map(Some)
            }
            Origin::Files(files) => files.read(frame, grid).map(Some),
        }
    }
}

impl Files {
    fn read(&self, frame: usize, grid: &VoxelGrid) -> Built<scene::Volume> {
        let source = self.pattern.numbered(self.first + frame);
        let name = source.file.clone().unwrap_or_default();
        let field = Field::From(source);
        let stored = field.stored(&self.assets)?.ok_or_else(|| Flaw::new("", "it comes from no file"))?;
        let volume = field.kept(EXTINCTION.of_file(stored, &self.place, grid, &self.assets)?)?;
        same_grid(&volume, grid, &format!("{name} (frame {frame})"), "the first key frame")?;
        Ok(volume)
    }
}

impl VolumeDocument {
    /// The scenes of the key frames, and what lies between them.
    pub(in crate::io::scene_file) fn animate(&self, file: &Path) -> Built<AnimatedVolume> {
        let Some(animation) = &self.animation else {
            return Err(Flaw::new("", "the scene has no `animation`; add one with `frames` and `keys`"));
        };
        let stages = self.find.stages();
        let volume = self.settled_volume();
        animation.check(&volume, &stages).at("animation")?;
        let mut assets = Assets::beside(file).within(self.solve.memory).grouped(&self.groups)?;
        let first = &animation.keys[0];
        let medium = (&volume, &stages[..]);
        let mut frames = None;
        let base = self.scene(file, &mut assets, |assets| {
            frames = box_of_frames(animation.extinctions(&self.volume), assets)?;
            first.medium(0, medium, animation, frames.as_ref(), assets)
        })?;
        let grid = *base.medium.extinction.grid();
        let mut keys = Vec::with_capacity(animation.keys.len());
        for (index, key) in animation.keys.iter().enumerate() {
            let medium = match index {
                0 => base.medium.clone(),
                _ => key.medium(index, medium, animation, frames.as_ref(), &assets)?,
            };
            let place = format!("animation.keys[{index}]");
            same_grids(&medium, &base.medium).at(&place)?;
            let mut scene = VolumeScene { medium, ..base.clone() };
            key.want(&mut scene, &mut assets).at(&place)?;
            keys.push(KeyFrame { frame: key.frame, scene });
        }
        let frames = Frames::new(animation, self, (grid, frames), assets)?;
        let mut is_occupied = vec![false; grid.len()];
        for frame in (0..animation.frames).filter(|frame| keys.iter().all(|key| key.frame != *frame)) {
            let place =
                if animation.is_of_files(&self.volume) { "volume.extinction" } else { "animation.between" };
            let Some(extinction) = frames.extinction(frame).at(place)? else { break };
            for (index, is_occupied) in is_occupied.iter_mut().enumerate() {
                *is_occupied |= extinction.color(index).iter().any(|&sigma_t| sigma_t > 0.0);
            }
        }
        Ok(AnimatedVolume {
            animation: scene::Animation { frames: animation.frames, keys },
            between: frames.name(),
            occupied: grid.set(|index| is_occupied[index]),
            frames,
        })
    }
}

/// What the files of extinction of all frames fill together, where they say where they lie.
fn box_of_frames(extinctions: Vec<(String, FieldSource)>, assets: &Assets) -> Built<Option<VoxelGrid>> {
    let mut all: Option<VoxelGrid> = None;
    for (path, source) in extinctions {
        let Some(file) = &source.file else { continue };
        let place = assets.volume_place(file, source.member.as_deref()).at("file").at(&path)?;
        let Some(grid) = place else { continue };
        let around = all.map_or(Ok(grid), |all| around(&all, &grid)).at(&path)?;
        let bytes = (around.len() * size_of::<f32>()) as u64;
        assets.allow("the box around the extinction of all frames", bytes).at(&path)?;
        all = Some(around);
    }
    Ok(all)
}

/// Whether the properties of two keys can be blended.
fn same_grids(medium: &VolumeMedium, first: &VolumeMedium) -> Built<()> {
    let properties = [
        ("extinction", &medium.extinction, &first.extinction),
        ("albedo", &medium.albedo, &first.albedo),
        ("emission", &medium.emission, &first.emission),
    ];
    properties.into_iter().try_for_each(|(name, volume, first)| {
        same_grid(volume, first.grid(), "the volume", "that of the first key frame").at(name)
    })
}

fn same_grid(volume: &scene::Volume, grid: &VoxelGrid, what: &str, other: &str) -> Built<()> {
    let [size, expected] = [volume.grid().size(), grid.size()];
    if size != expected {
        let sides = |[x, y, z]: [usize; 3]| format!("{x} x {y} x {z}");
        let problem = format!(
            "{what} has {} voxels and {other} {}; all frames must have the same",
            sides(size),
            sides(expected)
        );
        return Err(Flaw::new("", problem));
    }
    let (corners, others) = (volume.grid().corners(), grid.corners());
    let diagonal = others[0].distance(others[7]);
    if corners.iter().zip(&others).any(|(a, b)| a.distance(*b) > SAME_PLACE * diagonal) {
        let problem = format!("{what} lies elsewhere than {other}; set `volume.to_world`");
        return Err(Flaw::new("", problem));
    }
    Ok(())
}
