use super::{Scene, View, VolumeScene};
use crate::Result;

/// A scene that changes from frame to frame, given at some of them: a volume, or a [`Scene`] of a light map.
#[derive(Debug, Clone)]
pub struct Animation<S = VolumeScene> {
    /// Frames, numbered from 0.
    pub frames: usize,
    /// The key frames, in the order of their frames; at least one.
    pub keys: Vec<KeyFrame<S>>,
}

/// A frame as a scene of its own.
#[derive(Debug, Clone)]
pub struct KeyFrame<S = VolumeScene> {
    /// Its number.
    pub frame: usize,
    /// The scene at that frame before the solve, and what is wanted there.
    pub scene: S,
}

/// A scene of a light map whose sun, cameras and looks change from frame to frame. All else is the same at all keys.
#[derive(Debug, Clone)]
pub struct AnimatedScene {
    /// The keys.
    pub animation: Animation<Scene>,
    /// Which light maps its frames have.
    pub light_maps: LightMaps,
}

/// Which light maps the frames of an animation have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightMaps {
    /// None: light is as it is.
    None,
    /// One for all frames, which stands before the suns of all keys.
    One,
    /// One for each key, blended between them.
    Each,
}

impl LightMaps {
    /// How many are looked for, of so many keys: one for each of the first.
    pub fn count(self, keys: usize) -> usize {
        match self {
            Self::None => 0,
            Self::One => keys.min(1),
            Self::Each => keys,
        }
    }
}

impl AnimatedScene {
    /// The scenes of the keys behind the first, where one light map stands before the suns of all.
    pub fn others(&self) -> Vec<Scene> {
        match self.light_maps {
            LightMaps::One => self.animation.keys.iter().skip(1).map(|key| key.scene.clone()).collect(),
            LightMaps::None | LightMaps::Each => Vec::new(),
        }
    }

    /// The scene at a frame: between two keys on the way from one to the other, and nothing is painted there. The sun turns along the great
    /// circle; cameras move along a straight line while they turn about one axis; radiance, fields of view and looks are blended linearly.
    ///
    /// Errors: [`crate::Error::Value`] where there is no such way, see [`super::DirectionalLight::between`] and [`super::Camera::between`].
    pub fn at(&self, frame: usize) -> Result<Scene> {
        let keys = &self.animation.keys;
        let frames: Vec<usize> = keys.iter().map(|key| key.frame).collect();
        let KeySpan { keys: span, share } = KeySpan::of(&frames, frame);
        let [from, to] = span.map(|key| &keys[key].scene);
        if span[0] == span[1] {
            return Ok(from.clone());
        }
        let views = from.views.iter().zip(&to.views);
        let views = views.map(|(from, to)| {
            let camera = from.camera.between(&to.camera, share)?;
            Ok(View { name: from.name.clone(), camera, strokes: Vec::new(), layers: Vec::new(), keep: 0.0 })
        });
        Ok(Scene {
            light: from.light.between(&to.light, share)?,
            views: views.collect::<Result<_>>()?,
            looks: from.looks.between(&to.looks, share),
            ..from.clone()
        })
    }
}

/// The two keys that a frame lies between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeySpan {
    /// Numbers of the key at or before the frame and of the key after it. At a key, before the first and behind the last they are the
    /// same.
    pub keys: [usize; 2],
    /// The share of the second key, from 0 to 1; the first has the rest.
    pub share: f64,
}

impl KeySpan {
    /// Where a frame lies among the frames of keys, which increase.
    pub fn of(keys: &[usize], frame: usize) -> Self {
        let behind = keys.partition_point(|&key| key <= frame);
        let (before, after) = (behind.saturating_sub(1), behind.min(keys.len().saturating_sub(1)));
        match (keys.get(before), keys.get(after)) {
            (Some(&a), Some(&b)) if a < frame && frame < b => {
                Self { keys: [before, after], share: (frame - a) as f64 / (b - a) as f64 }
            }
            _ => Self { keys: [before; 2], share: 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_between_their_neighbouring_keys() {
        let keys = [2, 6, 7];
        let at = |frame| {
            let KeySpan { keys, share } = KeySpan::of(&keys, frame);
            (keys, share)
        };
        assert_eq!(at(0), ([0, 0], 0.0));
        assert_eq!(at(2), ([0, 0], 0.0));
        assert_eq!(at(3), ([0, 1], 0.25));
        assert_eq!(at(4), ([0, 1], 0.5));
        assert_eq!(at(6), ([1, 1], 0.0));
        assert_eq!(at(7), ([2, 2], 0.0));
        assert_eq!(at(99), ([2, 2], 0.0));
    }
}
