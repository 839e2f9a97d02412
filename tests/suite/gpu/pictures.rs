//! Pictures that an adapter draws against those of the processor.

use std::sync::Arc;

use unscatter::gpu::{Choice, SimulatedFault};
use unscatter::problem::{
    Canvas, DrawnLight, LightMapProblem, Model, Renderer, Rendering, VolumeRenderer, VolumeState,
};
use unscatter::scene::{
    Blend, Environment, Image, Interpolation, Kernel, LayerKind, OccluderEdit, OccluderEditKind, Quadrature,
    Radius, Rgb, Scene, Transfer, TransferAxis, TransferLayer, TransferRole, Volume, VolumeScene,
};

use super::{gpu, narrow, open};
use crate::scenes::Numbers;
use crate::scenes::mist::{CASES, SHAFTS, scene_of};
use crate::scenes::volume::{Cloud, optics};
use crate::tolerances::AGAINST_EXPLICIT;

/// ‖a − b‖ / ‖b‖, and no pixel is off by more than a hundred times that.
fn expect_same(what: &str, [drawn, expected]: [&Image; 2]) {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let channels = |image: &Image| image.pixels.iter().flatten().map(|&v| f64::from(v)).collect::<Vec<_>>();
    let (drawn, expected) = (channels(drawn), channels(expected));
    let whole = norm(&mut expected.iter().copied());
    assert!(whole > 0.0, "{what} is black");
    let off = norm(&mut drawn.iter().zip(&expected).map(|(a, b)| a - b)) / whole;
    assert!(off <= AGAINST_EXPLICIT, "{what} is off by {off:.1e}");
    let most = expected.iter().copied().fold(0.0, f64::max);
    let largest = drawn.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / most;
    assert!(largest <= 100.0 * AGAINST_EXPLICIT, "a pixel of {what} is off by {largest:.1e}");
}

/// Elements of a scene, most of which are as they start.
fn some_light(problem: &LightMapProblem) -> Vec<Rgb> {
    let mut n = Numbers(5);
    let mut light = problem.starts();
    for color in &mut light {
        if n.next().is_multiple_of(3) {
            *color = std::array::from_fn(|_| n.uniform(0.1, 4.0) as f32);
        }
    }
    light
}

fn expect_same_light_maps(what: &str, scene: &Scene, canvas: &Canvas) {
    let problem = LightMapProblem::new(scene).unwrap();
    let light = some_light(&problem);
    for (map, light) in
        [(None, DrawnLight::All), (Some(&light[..]), DrawnLight::All), (Some(&light), DrawnLight::Scattered)]
    {
        let renderer = Renderer::new(scene, &problem.maps, map).unwrap().showing(light);
        for view in 0..scene.views.len() {
            let [drawn, expected]: [Rendering; 2] =
                [canvas, &Canvas::Processor].map(|canvas| renderer.picture(view, canvas).unwrap());
            let what = format!("{what}, view {view}, {light:?}");
            expect_same(&format!("{what}, before"), [&drawn.before, &expected.before]);
            expect_same(&format!("{what}, after"), [&drawn.after, &expected.after]);
            assert_eq!(expected.before != expected.after, map.is_some(), "{what}");
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn an_adapter_draws_looks_as_the_processor_does() {
    let mut scene = scene_of(&SHAFTS);
    let kind = OccluderEditKind::Fill(Kernel::Disc, Radius::Texels(2.0));
    scene.looks.occluders.push(OccluderEdit { kind, strength: 1.0 });
    let shows = LayerKind::Gradient { axis: 0, ends: [[1.0, 0.4, 0.1], [0.2, 0.6, 1.5]] };
    let layers = vec![TransferLayer { shows, blend: Blend::Alpha, opacity: 1.0 }];
    let (axes, far) = ([TransferAxis::Visibility, TransferAxis::Depth], Some(20.0));
    for role in [TransferRole::Factor, TransferRole::Color] {
        let layers = layers.clone();
        scene.looks.transfer =
            vec![(1.0, Transfer { role, axes, size: [16, 4], far, layers, strength: 0.9 })];
        expect_same_light_maps(&format!("looks, {role:?}"), &scene, &Canvas::Adapter(gpu()));
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn an_adapter_draws_light_maps_as_the_processor_does() {
    let canvas = Canvas::Adapter(gpu());
    for (number, case) in CASES.iter().chain([&SHAFTS]).enumerate() {
        let mut scene = scene_of(case);
        expect_same_light_maps(&format!("case {number}"), &scene, &canvas);
        scene.medium.sigma_t = [0.05, 0.08, 0.12];
        expect_same_light_maps(&format!("case {number} in coloured mist"), &scene, &canvas);
    }
    let mut scene = scene_of(&CASES[0]);
    scene.solve.quadrature = Quadrature::March { steps: 50 };
    expect_same_light_maps("a march", &scene, &canvas);
    // Rays to where nothing is, and a shadow map that a view leaves.
    scene.solve.quadrature = Quadrature::Exact;
    scene.mesh = Arc::default();
    expect_same_light_maps("nothing but mist", &scene, &canvas);
}

/// A cloud that is lit from all around and glows, before a picture.
fn cloud(basis: Interpolation, is_colored: bool) -> VolumeScene {
    let mut scene = Cloud::seen_from_around(false, basis).shrunk(8).scene();
    scene.views.truncate(2);
    let grid = *scene.medium.extinction.grid();
    let color = |index: usize| [(index % 7) as f32 * 0.1, (index % 5) as f32 * 0.2, (index % 3) as f32 * 0.3];
    let colors: Vec<Rgb> = (0..grid.len()).map(color).collect();
    let volume = |colors: &[Rgb]| Arc::new(Volume::of_colors(grid, colors).unwrap());
    scene.medium.emission = volume(&colors);
    if is_colored {
        let dense = |index: usize| scene.medium.extinction.color(index);
        let tinted: Vec<Rgb> =
            (0..grid.len()).map(|i| [dense(i)[0], 0.7 * dense(i)[1], 0.4 * dense(i)[2]]).collect();
        scene.medium.extinction = volume(&tinted);
    }
    scene.environment = Environment::constant([1.0, 0.8, 0.6], 16).unwrap();
    scene
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn an_adapter_draws_volumes_as_the_processor_does() {
    let canvas = Canvas::Adapter(gpu());
    for basis in [Interpolation::Nearest, Interpolation::Trilinear] {
        for (is_colored, model) in [
            (false, Model::SingleScattering),
            (true, Model::SingleScattering),
            (false, Model::Constant([0.5, 2.0, 1.0])),
        ] {
            let scene = cloud(basis, is_colored);
            let optics = optics(&scene, &VolumeState::of(&scene).unwrap());
            let renderer = VolumeRenderer::new(&scene, &scene.medium, &optics, model);
            for view in 0..2 {
                let [drawn, expected] =
                    [&canvas, &Canvas::Processor].map(|canvas| renderer.picture(view, canvas).unwrap());
                let what = format!("{basis:?}, {model:?}, coloured: {is_colored}, view {view}");
                expect_same(&what, [&drawn, &expected]);
            }
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn what_an_adapter_cannot_draw_the_processor_draws() {
    // No kernel marches through volumes, and this shadow map is more than such a kernel sees.
    let mut scene = cloud(Interpolation::Nearest, false);
    scene.solve.quadrature = Quadrature::March { steps: 64 };
    let optics = optics(&scene, &VolumeState::of(&scene).unwrap());
    let renderer = VolumeRenderer::new(&scene, &scene.medium, &optics, Model::SingleScattering);
    let [drawn, expected] =
        [&Canvas::Adapter(gpu()), &Canvas::Processor].map(|canvas| renderer.picture(0, canvas).unwrap());
    assert_eq!(drawn, expected);

    let scene = scene_of(&SHAFTS);
    let problem = LightMapProblem::new(&scene).unwrap();
    let renderer = Renderer::new(&scene, &problem.maps, None).unwrap();
    let [drawn, expected] = [&Canvas::Adapter(narrow(1 << 16)), &Canvas::Processor]
        .map(|canvas| renderer.picture(0, canvas).unwrap());
    assert_eq!(drawn, expected);

    // One that is lost is an error, which a job may answer.
    let light = some_light(&problem);
    let renderer = Renderer::new(&scene, &problem.maps, Some(&light)).unwrap();
    let lost = open(Choice { fault: Some(SimulatedFault::Loss(1)), ..Choice::default() });
    assert!(renderer.picture(0, &Canvas::Adapter(lost)).is_err_and(|error| error.is_of_adapter()));
}
