use std::sync::Arc;

use super::hull::visual_hull;
use crate::Result;
use crate::scene::{Environment, Find, Rgb, Volume, VolumeMedium, VolumeScene};

/// What solves change: a medium, and the light around it.
#[derive(Debug, Clone)]
pub struct VolumeState {
    /// The medium.
    pub medium: VolumeMedium,
    /// Light from everywhere but the suns.
    pub environment: Environment,
}

impl VolumeState {
    /// A scene as it is before any solve. Where its environment is looked for, it starts as the combination of the basis lights
    /// that comes nearest to it. Where its extinction is looked for, there is none outside the visual hull of its masks.
    ///
    /// Errors: [`crate::Error::Value`] naming a light whose radiance is not finite; [`crate::Error::Empty`] for an empty hull.
    pub fn of(scene: &VolumeScene) -> Result<Self> {
        let environment = if scene.stages.contains(&Find::Environment) {
            let lights = scene.environment.coefficients(&scene.light_basis);
            Environment::lights(scene.light_basis.clone(), lights)?
        } else {
            scene.environment.clone()
        };
        let mut medium = scene.medium.clone();
        if scene.stages.iter().any(|find| matches!(find, Find::Extinction | Find::Refinement)) {
            medium.extinction = carved(scene)?;
        }
        Ok(Self { medium, environment })
    }
}

/// The extinction of a scene inside the visual hull of its masks.
fn carved(scene: &VolumeScene) -> Result<Arc<Volume>> {
    let extinction = &scene.medium.extinction;
    let grid = *extinction.grid();
    let Some(hull) = visual_hull(scene, &grid)? else { return Ok(extinction.clone()) };
    let mut colors = vec![[0.0; 3]; grid.len()];
    hull.indices().iter().for_each(|&index| colors[index as usize] = extinction.color(index as usize));
    let is_grey = colors.iter().all(|color: &Rgb| *color == [color[0]; 3]);
    Ok(Arc::new(match is_grey {
        true => {
            Volume::new(grid, 1, crate::scene::Samples::F32(colors.iter().map(|color| color[0]).collect()))?
        }
        false => Volume::of_colors(grid, &colors)?,
    }))
}
