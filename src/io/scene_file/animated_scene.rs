//! Animations of light-map scenes as they are computed with: a scene for each key.

use std::path::Path;

use super::assets::Assets;
use super::document::{Document, Sought};
use super::flaw::{At, Built, Flaw};
use super::key_frames::views_of_key;
use super::light_animation::{LightAnimation, LightKey};
use crate::scene::{AnimatedScene, Animation, KeyFrame, LightMaps, Scene};

impl Document {
    /// The scenes of the key frames.
    pub(super) fn animate(&self, file: &Path) -> Built<AnimatedScene> {
        let Some(animation) = &self.animation else {
            return Err(Flaw::new("", "the scene has no `animation`; add one with `frames` and `keys`"));
        };
        animation.check().at("animation")?;
        if self.find == Sought::Transfer {
            let problem = "transfer functions are looked for in scenes that stay as they are; set `find` to `light-map`, or leave `animation` away";
            return Err(Flaw::new("find", problem));
        }
        let light_maps = LightMaps::from(animation.light_maps(&self.views));
        if light_maps != LightMaps::None && self.surroundings.is_some() {
            let problem = "an animation looks for light maps alone; leave it away, or set `animation.light_map` to `none`";
            return Err(Flaw::new("surroundings", problem));
        }
        let mut assets = self.assets(file)?;
        let base = self.scene(file, &mut assets)?;
        let mut keys = Vec::with_capacity(animation.keys.len());
        for (index, key) in animation.keys.iter().enumerate() {
            let place = format!("animation.keys[{index}]");
            let mut scene = self.at_key(key, &base, &mut assets).at(&place)?;
            let has_paint =
                scene.views.iter().any(|view| !view.strokes.is_empty() || !view.layers.is_empty());
            match light_maps {
                LightMaps::None => scene.views.iter_mut().for_each(|view| {
                    (view.strokes, view.layers, view.keep) = (Vec::new(), Vec::new(), 0.0);
                }),
                LightMaps::Each if !has_paint => {
                    let problem = "nothing is painted at this key; give `views` with strokes, or set `animation.light_map` to `one` or `none`";
                    return Err(Flaw::new("", problem)).at(&place);
                }
                LightMaps::One if !has_paint && index == 0 => {
                    let problem = "nothing is painted at this key, whose light map is that of all frames";
                    return Err(Flaw::new("", problem)).at(&place);
                }
                LightMaps::One | LightMaps::Each => {}
            }
            keys.push(KeyFrame { frame: key.frame, scene });
        }
        check_ways(&keys, animation)?;
        Ok(AnimatedScene { animation: Animation { frames: animation.frames, keys }, light_maps })
    }

    /// The scene at a key; `base` is that of the document without its animation.
    fn at_key(&self, key: &LightKey, base: &Scene, assets: &mut Assets) -> Built<Scene> {
        let mut scene = base.clone();
        if let Some(light) = &key.light {
            scene.light = light.build(assets).at("light")?;
            scene.solve.bounds = self.bounds(base.solve.bounds, &scene.light);
        }
        let names: Vec<&str> = self.views.iter().map(|view| view.name.as_str()).collect();
        let numbers = views_of_key(key.views.iter().map(|view| view.name.as_str()), &names)?;
        for (index, (view, number)) in key.views.iter().zip(numbers).enumerate() {
            let place = format!("views[{index}]");
            let own = view.of(&self.views[number]).at(&place)?;
            scene.views[number] = own.build(assets).at(&place)?;
        }
        // Those of the scene, too, are about the views, which may have moved.
        let looks = key.looks.as_ref().unwrap_or(&self.looks);
        scene.looks = looks.build(&scene.views, &scene.mesh, assets).at("looks")?;
        Ok(scene)
    }
}

/// Whether there is a way from each key to the next.
fn check_ways(keys: &[KeyFrame<Scene>], animation: &LightAnimation) -> Built<()> {
    for (index, pair) in keys.windows(2).enumerate() {
        let [from, to] = [&pair[0].scene, &pair[1].scene];
        let place = format!("animation.keys[{}]", index + 1);
        from.light.between(&to.light, 0.5).at("light").at(&place)?;
        for (a, b) in from.views.iter().zip(&to.views) {
            let own = animation.keys[index + 1].views.iter().position(|view| view.name == b.name);
            let camera = own.map_or_else(|| "views".to_owned(), |own| format!("views[{own}].camera"));
            a.camera.between(&b.camera, 0.5).at(&camera).at(&place)?;
        }
    }
    Ok(())
}
