//! Whole pictures, drawn by the adapter and by the processor beside it: by the clock, first surfaces and all that is handed over included.

use std::cell::LazyCell;

use unscatter::gpu::Gpu;
use unscatter::problem::{
    Canvas, Drawing, DrawingMethod, LightMapProblem, Model, Renderer, VolumeRenderer, VolumeState,
};
use unscatter::scene::{Environment, Interpolation, Rgb};

use crate::rates::{Rates, Work, by_the_clock};
use crate::scenes::mist::{Case, SHAFTS, scaled};
use crate::scenes::volume::{Cloud, optics};

/// A picture of shafts in mist that is 1280 × 896, and one of a cloud of 128³ voxels that is 640 × 360; for `shrunk` less of both.
pub fn bench(rates: &mut Rates, gpu: &Gpu, shrunk: usize) {
    let ways = [("adapter", Canvas::Adapter(gpu.clone())), ("processor", Canvas::Processor)];
    // Other methods than the exact one know no panes.
    let [shafts, open] = [SHAFTS.panes, ""].map(|panes| {
        LazyCell::new(move || {
            let scene = scaled(&Case { panes, ..SHAFTS }, 32 / shrunk);
            let problem = LightMapProblem::new(&scene).unwrap();
            let light: Vec<Rgb> =
                problem.starts().iter().map(|start| start.map(|value| 0.5 * value)).collect();
            (scene, problem, light)
        })
    });
    for (by, canvas) in &ways {
        rates.bench("pictures", &format!("light map: {by}"), || {
            let (scene, problem, light) = &*shafts;
            let renderer = Renderer::new(scene, &problem.maps, Some(light)).unwrap();
            let [width, height] = scene.views[0].camera.size();
            let work = Work { rays: (width * height) as u64, ..Work::default() };
            (work, by_the_clock(move || renderer.picture(0, canvas).unwrap()))
        });
    }
    for (name, method) in [
        ("march", DrawingMethod::March { steps: 64 }),
        ("prefilter_sums and prefilter_shown", DrawingMethod::Prefiltered { coefficients: 32 }),
        ("sweep_gather and sweep_shown", DrawingMethod::Epipolar { samples: 1024 }),
    ] {
        for (by, canvas) in &ways {
            rates.bench("pictures", &format!("{name}: {by}"), || {
                let (scene, problem, light) = &*open;
                let renderer = Renderer::new(scene, &problem.maps, Some(light)).unwrap();
                let renderer = renderer.drawing(Drawing { method, reduced: 1 });
                let [width, height] = scene.views[0].camera.size();
                let work = Work { rays: (width * height) as u64, ..Work::default() };
                (work, by_the_clock(move || renderer.picture(0, canvas).unwrap()))
            });
        }
    }
    for (name, basis) in [("nearest", Interpolation::Nearest), ("trilinear", Interpolation::Trilinear)] {
        let cloud = LazyCell::new(|| {
            let mut scene = Cloud::seen_from_around(false, basis).shrunk(shrunk).scene();
            scene.environment = Environment::constant([1.0, 0.8, 0.6], 8).unwrap();
            let optics = optics(&scene, &VolumeState::of(&scene).unwrap());
            (scene, optics)
        });
        for (by, canvas) in &ways {
            rates.bench("pictures", &format!("volume, {name}: {by}"), || {
                let (scene, optics) = &*cloud;
                let renderer = VolumeRenderer::new(scene, &scene.medium, optics, Model::SingleScattering);
                let [width, height] = scene.views[0].view.camera.size();
                let work = Work { rays: (width * height) as u64, ..Work::default() };
                (work, by_the_clock(move || renderer.picture(0, canvas).unwrap()))
            });
        }
    }
}
