//! Animations as they are computed with: the scenes of the keys, and the extinction of the frames between them.

use std::path::Path;

use glam::DAffine3;

use super::animation::{Animation, Between, Key};
use super::document::VolumeDocument;
use super::field::{Field, FieldSource};
use super::properties::not_negative;
use crate::io::scene_file::assets::Assets;
use crate::io::scene_file::flaw::{At, Built, Flaw};
use crate::io::scene_file::transform::Transform;
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
    /// Where the volume is put, if not where the files say.
    place: Option<DAffine3>,
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
    /// Of an animation whose keys are on a grid.
    fn new(animation: &Animation, document: &VolumeDocument, grid: VoxelGrid, assets: Assets) -> Built<Self> {
        let source = document.volume.extinction.source();
        if animation.is_of_files(&document.volume) {
            let place = document.volume.to_world.as_ref().map(Transform::build).transpose();
            let (first, place) = (animation.first_file(), place.at("volume.to_world")?);
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
                Field::From(source).build(&assets, Some(grid.size()), Some(grid.world_from_cube())).map(Some)
            }
            Origin::Files(files) => files.read(frame, grid).map(Some),
        }
    }
}

impl Files {
    fn read(&self, frame: usize, grid: &VoxelGrid) -> Built<scene::Volume> {
        let source = self.pattern.numbered(self.first + frame);
        let name = source.file.clone().unwrap_or_default();
        let volume = Field::From(source).build(&self.assets, None, self.place)?;
        not_negative(&volume)?;
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
        animation.check(&self.volume, &stages).at("animation")?;
        let mut assets = Assets::beside(file).within(self.solve.memory);
        let first = &animation.keys[0];
        let medium = (&self.volume, &stages[..]);
        let base = self.scene(file, &mut assets, |assets| first.medium(0, medium, animation, assets))?;
        let grid = *base.medium.extinction.grid();
        let mut keys = Vec::with_capacity(animation.keys.len());
        for (index, key) in animation.keys.iter().enumerate() {
            let medium = match index {
                0 => base.medium.clone(),
                _ => key.medium(index, medium, animation, &assets)?,
            };
            let place = format!("animation.keys[{index}]");
            same_grids(&medium, &base.medium).at(&place)?;
            let mut scene = VolumeScene { medium, ..base.clone() };
            key.want(&mut scene, &mut assets).at(&place)?;
            keys.push(KeyFrame { frame: key.frame, scene });
        }
        let frames = Frames::new(animation, self, grid, assets)?;
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
