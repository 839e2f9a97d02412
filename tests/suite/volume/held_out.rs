//! Pixels of noisy pictures that are kept out of the fit.

use unscatter::problem::{Desired, HoldOut, Problem, VolumeProblem};
use unscatter::scene::{Find, Image, Rgb, Strategy, VolumeScene};
use unscatter::solve::StopReason;

use super::scene::{colors, pictures, problem, relative, solved, wanted};
use super::*;
use crate::scenes::volume::Cloud;

/// A mist of a colour of its own in ten views of 80 × 45 before a bright background, looked for from an even one.
fn mist() -> (VolumeScene, Arc<Volume>) {
    let mut scene = Cloud::seen_from_around(true, Interpolation::Nearest).shrunk(8).scene();
    scene.background = Some([1.0, 0.9, 0.8]);
    scene.stages = vec![Find::Extinction];
    scene.solve.tolerance = 1e-5;
    let truth = scene.medium.extinction.clone();
    scene.medium.extinction = Arc::new(Volume::constant(*truth.grid(), [0.5; 3]).unwrap());
    (scene, truth)
}

/// What the views of the truth show, with noise of a standard deviation in every channel.
fn seen(scene: &VolumeScene, truth: &Arc<Volume>, deviation: f64) -> Vec<Desired> {
    let mut medium = scene.medium.clone();
    medium.extinction = truth.clone();
    let mut n = numbers(11);
    let mut noise = || deviation * ((0..12).map(|_| n.uniform(0.0, 1.0)).sum::<f64>() - 6.0);
    let mut noisy = |picture: &Image| {
        let pixels =
            picture.pixels.iter().map(|color| color.map(|value| (f64::from(value) + noise()) as f32));
        Image::new(picture.size(), pixels.collect()).unwrap()
    };
    let pictures: Vec<Image> = pictures(scene, &medium, Find::Extinction).iter().map(&mut noisy).collect();
    wanted(&pictures)
}

fn held_out(scene: &VolumeScene, desired: &[Desired]) -> VolumeProblem {
    let pixels = HoldOut::of(scene, desired).unwrap();
    problem(scene, desired, Find::Extinction).holding_out(&pixels, Strategy::Auto).unwrap()
}

#[test]
fn noise_is_followed_less_and_the_volume_is_nearer() {
    let (scene, truth) = mist();
    for deviation in [0.02, 0.05, 0.1] {
        let desired = seen(&scene, &truth, deviation);
        let error = |problem: &VolumeProblem| {
            let (solved, medium) = solved(&scene, problem);
            (solved.outcome.stop.reason, relative(&colors(&medium.extinction), &colors(&truth)))
        };
        let (reason, error_without) = error(&problem(&scene, &desired, Find::Extinction));
        assert_ne!(reason, StopReason::HeldOut);
        let (reason, error_with) = error(&held_out(&scene, &desired));
        assert_eq!(reason, StopReason::HeldOut, "{deviation}");
        eprintln!("{deviation}: {error_without:.3} and {error_with:.3}");
        assert!(error_with < 0.9 * error_without, "{deviation}: {error_with} and {error_without}");
    }
}

#[test]
fn pixels_that_are_kept_out_are_no_rows_and_all_others_are() {
    let (scene, truth) = mist();
    let desired = seen(&scene, &truth, 0.05);
    let (all, rest) = (problem(&scene, &desired, Find::Extinction), held_out(&scene, &desired));
    let pixels = HoldOut::of(&scene, &desired).unwrap();
    let pixel_of = |problem: &VolumeProblem, row| problem.pixel(row);
    let expected: Vec<[usize; 2]> = (0..all.rows())
        .map(|row| pixel_of(&all, row))
        .filter(|&[view, pixel]| !pixels.contains(view, pixel))
        .collect();
    let rows: Vec<[usize; 2]> = (0..rest.rows()).map(|row| pixel_of(&rest, row)).collect();
    assert_eq!(rows, expected);
    // Of 36,000 pixels 2048, up to four standard deviations.
    let wanted = desired.iter().map(|view| view.pixels.len()).sum::<usize>();
    let out = (0..desired.len()).flat_map(|view| (0..3600).map(move |pixel| (view, pixel)));
    let out = out.filter(|&(view, pixel)| pixels.contains(view, pixel)).count();
    assert_eq!(wanted, 36000);
    assert!(out.abs_diff(2048) < 180, "{out}");
    let skipped = rest.skipped().into_iter().find(|(name, _)| *name == "held_out").unwrap();
    assert_eq!(skipped.1, [all.rows() - rest.rows(), all.rows()]);
}

#[test]
fn what_is_painted_or_clean_or_small_or_of_known_noise_is_fitted_whole() {
    let (mut scene, truth) = mist();
    let (clean, noisy) = (seen(&scene, &truth, 0.0), seen(&scene, &truth, 0.01));
    let applies = |scene: &VolumeScene, desired: &[Desired], find| {
        HoldOut::of(scene, desired).is_some_and(|pixels| pixels.applies_to(find))
    };
    assert!(applies(&scene, &noisy, Find::Extinction) && !applies(&scene, &noisy, Find::Joint));
    assert!(!applies(&scene, &clean, Find::Extinction));
    assert!(!applies(&scene, &noisy, Find::Environment));
    // Steps of a refinement are always confirmed.
    assert!(applies(&scene, &clean, Find::Refinement));
    assert!(HoldOut::of(&scene, &noisy[..0]).is_none());
    let few: Vec<Desired> = noisy
        .iter()
        .map(|view| Desired { pixels: view.pixels.iter().map(|&[r, g, b, _]| [r, g, b, 0.0]).collect() })
        .collect();
    assert!(HoldOut::of(&scene, &few).is_none());
    scene.solve.noise = Some(0.0);
    assert!(HoldOut::of(&scene, &noisy).is_none());
    (scene.solve.noise, scene.is_painted) = (None, true);
    assert!(HoldOut::of(&scene, &noisy).is_none());
}

#[test]
fn pictures_come_nearer_only_by_more_than_noise() {
    let (scene, truth) = mist();
    let desired = seen(&scene, &truth, 0.05);
    let pixels = HoldOut::of(&scene, &desired).unwrap();
    let of = |extinction: Arc<Volume>| {
        let mut medium = scene.medium.clone();
        medium.extinction = extinction;
        pictures(&scene, &medium, Find::Extinction)
    };
    let (start, end) = (of(scene.medium.extinction.clone()), of(truth));
    assert!(pixels.come_nearer(&desired, [&start, &end]));
    assert!(!pixels.come_nearer(&desired, [&end, &start]));
    assert!(!pixels.come_nearer(&desired, [&end, &end]));
    // Towards the noise itself, of the pixels that are fitted.
    let towards = |view: usize, picture: &Image| {
        let pixel = |(pixel, color): (usize, &Rgb)| {
            let wanted = desired[view].pixels[pixel];
            let share = if pixels.contains(view, pixel) { 0.0 } else { 0.2 };
            std::array::from_fn(|c| color[c] + share * (wanted[c] - color[c]))
        };
        Image::new(picture.size(), picture.pixels.iter().enumerate().map(pixel).collect()).unwrap()
    };
    let noisier: Vec<Image> = end.iter().enumerate().map(|(view, picture)| towards(view, picture)).collect();
    assert!(!pixels.come_nearer(&desired, [&end, &noisier]));
}
