//! Solvers, bounds, regularizers and reasons to stop, as a person asks for them.

use serde_json::Value;

use super::pictures::exr;
use super::{Desk, scene_with};

const SOLVE: [&str; 5] = ["light-map", "scene.json", "-o", "out", "--json"];

/// A solve to the default's limits, where `more` does not say otherwise.
fn solved(desk: &Desk, more: &[&str]) -> (Value, Vec<[f32; 3]>) {
    let limits = ["--set", "solve.iterations=2000", "--set", "solve.tolerance=1e-3"];
    let report = desk.done(&[&SOLVE[..], &limits, more].concat()).json();
    (report, exr(&desk.path("out/light_map.exr")).1)
}

fn set(values: &[&str]) -> Vec<String> {
    values.iter().flat_map(|value| ["--set".to_owned(), (*value).to_owned()]).collect()
}

fn solved_with(desk: &Desk, values: &[&str]) -> (Value, Vec<[f32; 3]>) {
    let arguments = set(values);
    solved(desk, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

fn worst(report: &Value) -> f64 {
    let values = report["certificate"]["value"].as_array().unwrap();
    values.iter().map(|value| value.as_f64().unwrap()).fold(0.0, f64::max)
}

#[test]
fn every_solver_by_its_name_ends_where_the_others_do() {
    let desk = Desk::new();
    let mut objectives = Vec::new();
    for (solver, keeps_bounds) in [
        ("fista", true),
        ("spectral", true),
        ("lbfgs", true),
        ("mprgp", true),
        ("cgls", false),
        ("lsqr", false),
        ("lsmr", false),
    ] {
        let well_posed = ["--set", "solve.tikhonov=0.05", "--tolerance", "1e-5", "--iterations", "8000"];
        let (report, light_map) = solved(&desk, &[&["--solver", solver][..], &well_posed].concat());
        assert_eq!((&report["solver"], &report["stop"]["reason"]), (&solver.into(), &"tolerance".into()));
        assert!(worst(&report) < 1.5e-5, "{solver}: {}", report["certificate"]);
        let kind = if keeps_bounds { "projected-gradient" } else { "normal-residual" };
        assert_eq!(report["certificate"]["kind"], kind);
        let negative = light_map.iter().flatten().any(|&value| value < 0.0);
        assert_eq!(negative, !keeps_bounds, "{solver}");
        objectives.push((keeps_bounds, report["weighted_residual"]["after"].as_f64().unwrap()));
    }
    let same = |kept: bool| {
        let found: Vec<f64> =
            objectives.iter().filter(|(keeps, _)| *keeps == kept).map(|(_, r)| *r).collect();
        found.iter().all(|r| (r / found[0] - 1.0).abs() < 1e-2)
    };
    assert!(same(true) && same(false), "{objectives:?}");
    let metric = |solver: &str| solved(&desk, &["--solver", solver]).0["settings"]["metric"].clone();
    assert_eq!([metric("fista"), metric("lbfgs"), metric("lsmr")], ["tiles", "sqs", "none"]);
    for solver in ["flexible-cgls", "clamped-cgls"] {
        let (report, light_map) = solved(&desk, &["--solver", solver, "--iterations", "20"]);
        assert_eq!(report["stop"]["reason"], "iterations");
        assert!(light_map.iter().flatten().all(|&value| value >= 0.0), "{solver}");
    }
}

#[test]
fn bounds_are_kept_by_every_texel() {
    let desk = Desk::new();
    let (free, _) = solved_with(&desk, &[]);
    let (report, light_map) = solved_with(&desk, &["solve.lower=0.5", "solve.upper=[8, 5, 5]"]);
    assert_eq!(report["stop"]["reason"], "tolerance");
    for texel in &light_map {
        assert!((0..3).all(|c| texel[c] >= 0.5 && texel[c] <= [8.0, 5.0, 5.0][c]), "{texel:?}");
    }
    assert!(report["certificate"]["at_bounds"].as_u64() > free["certificate"]["at_bounds"].as_u64());
    let residual = |report: &Value| report["weighted_residual"]["after"].as_f64().unwrap();
    assert!(residual(&report) > residual(&free), "tighter bounds cost something");
}

#[test]
fn regularizers_smooth_and_may_choose_their_weight() {
    let desk = Desk::new();
    let width = 32;
    let roughness = |light_map: &[[f32; 3]]| -> f64 {
        light_map
            .windows(2)
            .enumerate()
            .filter(|(k, _)| k % width != width - 1)
            .map(|(_, pair)| f64::from(pair[1][0] - pair[0][0]).powi(2))
            .sum()
    };
    let (_, plain) = solved_with(&desk, &[]);
    for name in ["gradient", "laplacian"] {
        let (report, smooth) = solved_with(&desk, &[&format!("solve.{name}=0.5")]);
        assert!(report["regularization"][name].as_f64().unwrap() > 0.0);
        assert!(roughness(&smooth) < 0.7 * roughness(&plain), "{name}");
        assert_eq!(report["stop"]["reason"], "tolerance", "{name}");
    }
    for rule in ["gcv", "l-curve"] {
        for name in ["tikhonov", "gradient"] {
            let (report, _) = solved_with(&desk, &[&format!("solve.{name}={rule}")]);
            assert!(report["regularization"][name].as_f64().unwrap() > 0.0, "{rule} {name}");
            assert!(report["set_up_applications"].as_u64().unwrap() > 20, "{rule} {name}");
        }
    }
}

#[test]
fn metrics_change_the_way_and_not_the_end() {
    let desk = Desk::new();
    let tight = ["solve.tolerance=1e-5", "solve.iterations=5000"];
    let (reference, _) = solved_with(&desk, &tight);
    for metric in ["sqs", "jacobi", "none"] {
        let (report, _) = solved_with(&desk, &[&tight[..], &[&format!("solve.metric={metric}")]].concat());
        assert_eq!(report["settings"]["metric"], metric);
        let residual = |report: &Value| report["weighted_residual"]["after"].as_f64().unwrap();
        assert!((residual(&report) / residual(&reference) - 1.0).abs() < 1e-3, "{metric}");
        assert!(report["stop"]["iteration"].as_u64() > reference["stop"]["iteration"].as_u64(), "{metric}");
    }
}

#[test]
fn a_noise_level_ends_a_solve_early() {
    let desk = Desk::new();
    let (all, _) = solved_with(&desk, &["solve.tolerance=1e-5", "solve.iterations=2000"]);
    let best = all["weighted_residual"]["after"].as_f64().unwrap();
    let (report, _) = solved_with(&desk, &["solve.tolerance=1e-5", "solve.noise=0.6"]);
    assert_eq!(report["stop"]["reason"], "discrepancy");
    let after = report["weighted_residual"]["after"].as_f64().unwrap();
    assert!(best < after && after <= 0.6, "{best} {after}");
    assert!(String::from_utf8(desk.read("out/report.html")).unwrap().contains("as its noise allows"));
}

#[test]
fn texels_that_no_stroke_reaches_are_filled_when_asked() {
    let desk = Desk::with(&scene_with("/light_map/size", serde_json::json!([32, 32])));
    let (report, plain) = solved(&desk, &[]);
    let unreached = report["coverage"]["unreached"].as_u64().unwrap();
    assert!(unreached > 0 && report["coverage"].get("filled").is_none());
    let (report, filled) = solved(&desk, &["--fill"]);
    assert_eq!(report["coverage"]["filled"], unreached);
    let start = plain.iter().filter(|texel| *texel == &plain_start(&plain)).count() as u64;
    assert!(start >= unreached);
    let changed: Vec<usize> = (0..plain.len()).filter(|&k| plain[k] != filled[k]).collect();
    assert!(changed.len() as u64 > unreached / 2 && changed.len() as u64 <= unreached);
    // A mean of neighbours is never beyond them.
    let largest = |texels: &[[f32; 3]]| texels.iter().flatten().copied().fold(0.0, f32::max);
    assert!(filled.iter().flatten().all(|&value| value >= 0.0) && largest(&filled) <= largest(&plain));
    assert_eq!(report["weighted_residual"]["after"], solved(&desk, &[]).0["weighted_residual"]["after"]);
}

/// The value that most texels have: the start.
fn plain_start(texels: &[[f32; 3]]) -> [f32; 3] {
    let count = |value: &[f32; 3]| texels.iter().filter(|texel| *texel == value).count();
    *texels.iter().max_by_key(|texel| count(texel)).unwrap()
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let desk = Desk::new();
    for (value, words) in [
        ("solve.tolerance=-1", "solve.tolerance"),
        ("solve.upper=-0.5", "not below `lower`"),
        ("solve.tikhonov=-1", "solve.tikhonov"),
        ("solve.tikhonov=gvc", "gcv"),
        ("solve.gradient=\"l-curv\"", "l-curve"),
        ("solve.laplacian=-0.001", "solve.laplacian"),
        ("solve.noise=2", "solve.noise"),
        ("solve.solver=mprg", "mprgp"),
        ("solve.metric=tile", "tiles"),
        ("solve.lower=[0, 1]", "solve.lower"),
        ("solve.coarse=true", "unknown field"),
    ] {
        desk.run(&[&SOLVE[..], &["--set", value]].concat()).exits_with(1).tells(words);
    }
    let chosen = ["--set", "solve.tikhonov=gcv", "--set", "solve.gradient=gcv"];
    desk.run(&[&SOLVE[..], &chosen].concat()).exits_with(1).tells("only one weight");
    let unbounded = ["--solver", "lsmr", "--set", "solve.upper=1"];
    desk.run(&[&SOLVE[..], &unbounded].concat()).exits_with(1).tells("keeps no bounds");
}

#[test]
fn the_library_names_them_as_well() {
    use unscatter::operator::TransportOperator;
    use unscatter::problem::{LightMapProblem, Problem, solve};
    use unscatter::scene::RegularizationWeight;
    use unscatter::solve::Control;
    let desk = Desk::new();
    let refused = |spoil: &dyn Fn(&mut unscatter::scene::Scene, &mut LightMapProblem)| {
        let mut scene = unscatter::io::scene_file::load(&desk.path("scene.json"), &[]).unwrap();
        let mut problem = LightMapProblem::new(&scene).unwrap();
        let operator = problem.on_cpu(scene.solve.strategy, u64::MAX).unwrap();
        let coverage = operator.squares(&problem.weights()).unwrap();
        spoil(&mut scene, &mut problem);
        let result = solve(&problem, &operator, &coverage, &scene.solve, None, |_, _| Ok(Control::Continue));
        result.unwrap_err().to_string()
    };
    assert!(
        refused(&|scene, _| scene.solve.regularization.tikhonov = RegularizationWeight::Relative(f64::NAN))
            .contains("tikhonov")
    );
    assert!(
        refused(&|scene, _| scene.solve.regularization.laplacian = RegularizationWeight::Relative(-1.0))
            .contains("laplacian")
    );
    assert!(refused(&|scene, _| scene.solve.bounds = [[1.0; 3], [0.5; 3]]).contains("upper"));
    assert!(refused(&|scene, _| scene.solve.tolerance = f64::NAN).contains("tolerance"));
    assert!(refused(&|_, problem| problem.constraints[7].weight = f32::NAN).contains("weights[7]"));
    assert!(refused(&|_, problem| problem.constraints[3].weight = -0.5).contains("weights[3]"));
}
