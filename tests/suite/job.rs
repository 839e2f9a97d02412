//! A job through the library alone, and one that is kept warm.

use unscatter::Error;
use unscatter::job::{
    Iteration, Job, LiveJob, Observer, Options, Preview, Quiet, Scenes, Solution, Step, Stop, Wish,
};
use unscatter::scene::{Scene, Stroke};
use unscatter::solve::{Control, StopReason};

use crate::root;

fn citadel(overrides: &[&str]) -> Job {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    Job::open_with(root().join("strokes/citadel.json"), &overrides).unwrap()
}

/// The citadel with a small light map.
const SMALL: [&str; 2] = ["light_map.size=96", "shadow_map.size=256"];

#[test]
fn everything_may_go_to_another_thread() {
    fn is_send<T: Send>() {}
    is_send::<Job>();
    is_send::<Solution>();
    is_send::<LiveJob>();
    is_send::<Stop>();
}

/// Writes down what it hears, and stops after some iterations.
#[derive(Default)]
struct Listener {
    heard: Vec<String>,
    iterations: usize,
    stops_after: Option<usize>,
}

impl Observer for Listener {
    fn begins(&mut self, step: &Step<'_>) {
        self.heard.push(step.name.to_owned());
    }

    fn iterated(&mut self, at: &Iteration<'_>) -> Wish {
        self.iterations += 1;
        match self.stops_after {
            Some(most) if at.progress.iteration >= most => Wish::Stop,
            _ => Wish::GoOn,
        }
    }
}

#[test]
fn an_observer_hears_every_step_and_what_it_stops_is_kept() {
    let job = citadel(&SMALL);
    let mut whole = Listener::default();
    let found = job.solve(&mut whole).unwrap();
    assert_eq!(whole.heard, ["tracing", "walking", "solving", "assessing", "rendering"]);
    assert!(!found.is_interrupted());
    assert_eq!(whole.iterations as u64, found.report().stop.iteration);
    assert!(found.certificate().value.iter().all(|&gradient| gradient <= 1.5e-3));

    let mut short = Listener { stops_after: Some(3), ..Listener::default() };
    let cut = job.solve(&mut short).unwrap();
    assert!(cut.is_interrupted() && short.iterations == 3);
    let residual = |found: &Solution| found.report().weighted_residual.after;
    assert!(residual(&found) < residual(&cut) && residual(&cut) < found.report().weighted_residual.before);

    // A request from elsewhere is heard as well.
    let options = Options::default();
    options.stop.ask();
    let stopped = citadel(&SMALL).with(options).solve(&mut Quiet);
    assert!(matches!(stopped, Err(Error::Interrupted)), "before a solve has begun there is nothing to keep");
}

#[test]
fn a_solution_has_its_light_map_pictures_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let found = citadel(&SMALL).solve(&mut Quiet).unwrap();
    assert_eq!(found.light_map().unwrap().size(), [96, 96]);
    let court = found.picture("court").unwrap();
    assert!(matches!(found.picture("nowhere"), Err(Error::Value { .. })));
    assert!(matches!(found.volume(), Err(Error::Empty { .. })));
    let written = found.write(folder.path()).unwrap();
    assert!(written.report.timings["total"] > 0.0);
    let read = |name: &str| unscatter::io::image::read_image(&folder.path().join(name)).unwrap();
    assert_eq!(read("light_map.exr").pixels, found.light_map().unwrap().pixels);
    assert_eq!(read("court_after.exr").pixels, court.pixels);
    let asked = Job::open(folder.path().join("scene.resolved.json")).unwrap();
    assert_eq!(
        asked.solve(&mut Quiet).unwrap().light_map().unwrap().pixels,
        found.light_map().unwrap().pixels
    );

    // A scene in memory has no document.
    let job = citadel(&SMALL);
    let Scenes::LightMap(scene) = job.scenes() else { unreachable!() };
    let folder = tempfile::tempdir().unwrap();
    let bare = Options { pictures: false, ..Options::default() };
    Job::new(Scene::clone(scene)).with(bare).solve(&mut Quiet).unwrap().write(folder.path()).unwrap();
    assert!(
        folder.path().join("report.json").is_file() && !folder.path().join("scene.resolved.json").exists()
    );

    // Without pictures there is the same light map, and none of them.
    let bare = Options { pictures: false, ..Options::default() };
    let folder = tempfile::tempdir().unwrap();
    let found = citadel(&SMALL).with(bare).solve(&mut Quiet).unwrap();
    assert_eq!(found.picture("court").unwrap().pixels, court.pixels);
    found.write(folder.path()).unwrap();
    assert!(folder.path().join("report.html").is_file());
    assert!(!folder.path().join("court_after.png").exists());
}

/// The citadel as it is painted on: previews of so many pixels, solved to a part of the gradient at x₀.
fn live(width: usize, tolerance: &str) -> LiveJob {
    let overrides = [&format!("solve.tolerance={tolerance}"), "solve.iterations=2000"];
    citadel(&overrides).live(Preview::Width(width)).unwrap()
}

/// The first stroke of the court, in pixels of the full picture.
fn first_stroke(live: &LiveJob) -> Stroke {
    let scale = 1.0 / live.scale("court").unwrap();
    let stroke = live.strokes("court").unwrap()[0].clone();
    let points = stroke.points.iter().map(|point| point.map(|x| x * scale)).collect();
    Stroke { points, radius: stroke.radius * scale, ..stroke }
}

type Change = fn(&mut Stroke);

/// What somebody does to a stroke, and how much farther the objective may be, relative to that at x₀, than the one from there.
const CHANGES: [(&str, Change, f64); 2] = [
    ("another shade", |stroke| stroke.color = stroke.color.map(|c| 0.9 * c + 0.05), 1e-4),
    ("narrower", |stroke| stroke.radius *= 0.8, 1e-4),
];

#[test]
fn solving_on_after_a_stroke_takes_less_than_half_and_ends_at_the_same() {
    let mut live = live(240, "1e-4");
    for (what, change, bound) in CHANGES {
        live.advance(2000).unwrap();
        let mut stroke = first_stroke(&live);
        change(&mut stroke);
        live.replace("court", 0, Some(stroke)).unwrap();
        let on = live.advance(2000).unwrap();
        live.begin_anew();
        let anew = live.advance(2000).unwrap();
        println!("{what}: {on:?}\n  from x₀: {anew:?}");
        assert!(on.gradient.iter().all(|&gradient| gradient <= 1.5e-4), "{what}");
        assert!(
            2 * on.applications < anew.applications,
            "{what}: {} of {}",
            on.applications,
            anew.applications
        );
        for c in 0..3 {
            assert!((on.objective[c] - anew.objective[c]).abs() < bound, "{what}: {on:?} and {anew:?}");
        }
    }
    // To begin from x₀ is not to go on.
    live.begin_anew();
    let anew = live.advance(2000).unwrap();
    assert!(anew.applications > 100);
}

#[test]
fn what_goes_on_without_a_change_is_one_solve_to_the_bit() {
    let (mut whole, mut pieces) = (live(120, "0"), live(120, "0"));
    let all = whole.advance(9).unwrap();
    pieces.advance(4).unwrap();
    let rest = pieces.advance(5).unwrap();
    assert_eq!((all.iterations, all.applications), (rest.iterations, rest.applications));
    assert_eq!(whole.light_map().unwrap().pixels, pieces.light_map().unwrap().pixels);
}

/// Where rows of all pixels are not kept, pictures are drawn over slices, and the light map is the same.
#[test]
fn pictures_of_a_live_job_whose_rows_do_not_fit_are_drawn_over_slices() {
    let after = |strategy: &str| {
        let overrides = ["solve.tolerance=1e-4", "solve.iterations=2000", "solve.metric=sqs", strategy];
        let mut live = citadel(&overrides).live(Preview::Width(240)).unwrap();
        live.advance(20).unwrap();
        let pictures = live.pictures().unwrap();
        (pictures.after(0).pixels.concat(), pictures.light_map().unwrap().pixels.concat())
    };
    let [kept, walked] = ["solve.strategy=assembled", "solve.strategy=matrix-free"].map(after);
    let apart = |a: &[f32], b: &[f32]| {
        let brightest = b.iter().copied().fold(0.0, f32::max);
        let square = a.iter().zip(b).map(|(a, b)| f64::from((a - b) / brightest).powi(2)).sum::<f64>();
        (square / a.len() as f64).sqrt()
    };
    let [pictures, light_maps] = [apart(&walked.0, &kept.0), apart(&walked.1, &kept.1)];
    assert!(pictures > 1e-5 && pictures < 4e-3, "{pictures:e}");
    assert!(light_maps < 1e-4, "{light_maps:e}");
}

#[test]
fn who_watches_a_live_job_sees_the_light_map_between_iterations() {
    let (mut watched, mut whole) = (live(120, "0"), live(120, "0"));
    watched.prepare().unwrap();
    let mut seen = Vec::new();
    let paused = watched.watched(9, &mut |moment| {
        let pictures = moment.pictures()?;
        seen.push((moment.standing.clone(), pictures.light_map()?, pictures.after(0)));
        Ok(if seen.len() == 4 { Control::Pause } else { Control::Continue })
    });
    let paused = paused.unwrap();
    assert_eq!((paused.stop, paused.iterations, seen.len()), (StopReason::Interrupted, 4, 4));
    // FISTA computes what it says; the certificate differs by rounding.
    let cut = whole.advance(4).unwrap();
    for c in 0..3 {
        assert!((paused.gradient[c] / cut.gradient[c] - 1.0).abs() < 1e-3, "{paused:?} and {cut:?}");
    }
    let (standing, light_map, after) = &seen[3];
    assert_eq!((standing.iterations, standing.gradient), (paused.iterations, paused.gradient));
    assert_eq!(light_map.pixels, whole.light_map().unwrap().pixels);
    assert_eq!(after.pixels, whole.pictures().unwrap().after(0).pixels);
    assert_ne!(light_map.pixels, seen[0].1.pixels);
    assert_eq!(watched.advance(5).unwrap(), whole.advance(5).unwrap());
}

#[test]
fn who_stops_a_live_job_is_heard_at_once_and_only_once() {
    let (mut stopped, mut whole) = (live(120, "0"), live(120, "0"));
    stopped.stop().ask();
    let cut = stopped.advance(9).unwrap();
    assert_eq!((cut.stop, cut.iterations), (StopReason::Interrupted, 1));
    let rest = stopped.advance(8).unwrap();
    assert_eq!((rest.stop, rest.iterations), (StopReason::Iterations, 9));
    whole.advance(9).unwrap();
    assert_eq!(stopped.light_map().unwrap().pixels, whole.light_map().unwrap().pixels);
}

#[test]
fn strokes_come_and_go_and_nothing_changes_where_one_is_refused() {
    let mut live = live(120, "1e-3");
    let before = live.painting("court").unwrap();
    let dab = Stroke {
        points: vec![[300.0, 200.0]],
        radius: 30.0,
        hardness: 1.0,
        opacity: 1.0,
        weight: 1.0,
        pressure: Vec::new(),
        erases: false,
        color: [1.0, 0.0, 0.0],
    };
    live.paint("court", dab.clone()).unwrap();
    assert_ne!(live.painting("court").unwrap(), before);
    let last = live.strokes("court").unwrap().len() - 1;
    live.replace("court", last, None).unwrap();
    assert_eq!(live.painting("court").unwrap(), before);
    let beside = Stroke { points: vec![[-900.0, 0.0]], ..dab.clone() };
    assert!(live.paint("court", beside).is_err());
    assert!(live.paint("nowhere", dab.clone()).is_err());
    assert!(live.replace("court", 99, Some(dab)).is_err());
    assert_eq!(live.painting("court").unwrap(), before);
    // Nothing painted anywhere: there is nothing to solve.
    for view in live.views().map(str::to_owned).collect::<Vec<_>>() {
        while !live.strokes(&view).unwrap().is_empty() {
            live.replace(&view, 0, None).unwrap();
        }
    }
    assert!(matches!(live.advance(1), Err(Error::Empty { .. })));
    live.stop().ask();
    assert!(live.picture("court").is_ok());
}
