use crate::Result;
use crate::scene::{Environment, Find, VolumeMedium, VolumeScene};

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
    /// that comes nearest to it.
    ///
    /// Errors: [`crate::Error::Value`] naming a light whose radiance is not finite.
    pub fn of(scene: &VolumeScene) -> Result<Self> {
        let environment = if scene.stages.contains(&Find::Environment) {
            let lights = scene.environment.coefficients(&scene.light_basis);
            Environment::lights(scene.light_basis.clone(), lights)?
        } else {
            scene.environment.clone()
        };
        Ok(Self { medium: scene.medium.clone(), environment })
    }
}
