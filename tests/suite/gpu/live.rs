//! A job that is kept warm on an adapter.

use unscatter::job::{Backend, EngineChoice, Job, LiveJob, Options, Preview};

/// A small citadel on an adapter, which may fail as `fault` says.
fn live(backend: Backend, fault: Option<&str>) -> LiveJob {
    let overrides = ["light_map.size=96", "shadow_map.size=256", "solve.tolerance=0"].map(str::to_owned);
    let job = Job::open_with(crate::root().join("strokes/citadel.json"), &overrides).unwrap();
    let adapter = (backend != Backend::Cpu).then(|| super::gpu().record().name.clone());
    let engine = EngineChoice { backend, adapter, fault: fault.map(str::to_owned) };
    job.with(Options { engine, ..Options::default() }).live(Preview::Width(120)).unwrap()
}

/// Solves, changes a stroke, and solves on: the light map.
fn painted(live: &mut LiveJob) -> Vec<[f32; 3]> {
    live.advance(6).unwrap();
    let mut stroke = live.strokes("court").unwrap()[0].clone();
    let scale = live.scale("court").unwrap();
    stroke.points.iter_mut().for_each(|point| *point = point.map(|x| x / scale));
    stroke.radius *= 0.8 / scale;
    live.replace("court", 0, Some(stroke)).unwrap();
    live.advance(6).unwrap();
    live.light_map().unwrap().pixels
}

fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let [miss, all] = pairs.fold([0.0, 0.0], |[miss, all], (a, b)| {
        [miss + f64::from(a - b).powi(2), all + f64::from(*b).powi(2)]
    });
    (miss / all).sqrt()
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_live_job_paints_on_an_adapter_as_on_the_processor() {
    let here = painted(&mut live(Backend::Cpu, None));
    let there = painted(&mut live(Backend::Gpu, None));
    assert!(apart(&there, &here) < 1e-4, "{}", apart(&there, &here));
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_live_job_goes_on_on_the_processor_where_its_adapter_is_lost() {
    let mut live = live(Backend::Auto, Some("loss:4"));
    assert!(live.advance(6).is_ok());
    let whole = painted(&mut live);
    assert!(whole.iter().flatten().all(|value| value.is_finite()));
    assert_eq!(live.advance(1).unwrap().iterations, 7);
}
