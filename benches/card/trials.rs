//! Steps that try the command as a person uses it, and run the tests.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::Value;

use super::bundle::{Bundle, in_words};
use super::child::End;
use super::distance;
use super::record::{Outcome, Step};

/// A scene, the command that solves it, and what shortens that.
struct Demo {
    name: &'static str,
    command: &'static str,
    options: &'static [&'static str],
}

const fn demo(name: &'static str, command: &'static str, options: &'static [&'static str]) -> Demo {
    Demo { name, command, options }
}

/// What takes long comes last.
const DEMOS: &[Demo] = &[
    demo("citadel", "light-map", &[]),
    demo("forest", "light-map", &[]),
    demo("nave", "light-map", &[]),
    demo("glass", "volume", &["--turntable", "0"]),
    demo("hand", "volume", &["--turntable", "0"]),
    demo("smoke", "animate", &["--frames", "0..0"]),
    demo("cloud", "volume", &["--turntable", "0"]),
];
/// Scenes that take no time, for a dry run.
const TINY: &[Demo] =
    &[demo("tiny light map", "light-map", &[]), demo("tiny volume", "volume", &["--turntable", "0"])];
const TINY_SCENES: [&str; 2] = [include_str!("tiny_light_map.json"), include_str!("tiny_volume.json")];

/// How far a light map of an adapter may be from that of the processor (tests/tolerances.rs).
const LIGHT_MAP: f64 = 1e-3;

/// A fault that `UNSCATTER_FAULT` brings about, and the seconds within which both backends must be done with it.
struct Fault {
    name: &'static str,
    patience: u64,
}

const FAULTS: &[Fault] = &[
    Fault { name: "compilation", patience: 20 },
    Fault { name: "arithmetic", patience: 20 },
    Fault { name: "memory", patience: 20 },
    Fault { name: "loss:3", patience: 20 },
    Fault { name: "loss:9", patience: 20 },
    Fault { name: "crash:9", patience: 20 },
    Fault { name: "hang:9", patience: 20 },
];

/// The scenes of this run.
fn demos(bundle: &Bundle) -> &'static [Demo] {
    if bundle.is_dry { TINY } else { DEMOS }
}

/// The file of a scene.
fn scene(bundle: &Bundle, demo: &Demo) -> String {
    let Some(index) = TINY.iter().position(|tiny| tiny.name == demo.name) else {
        return bundle.scene(demo.name);
    };
    let path = bundle.scratch(&format!("{}.json", demo.name));
    let _ = std::fs::write(&path, TINY_SCENES[index]);
    path.to_string_lossy().into_owned()
}

/// What the machine is, in words, and the laws of the first scene.
pub fn doctor(bundle: &Bundle, step: &mut Step) {
    bundle.done(step, "doctor", &mut bundle.unscatter(&["doctor"]));
    check(bundle, step, &demos(bundle)[0]);
}

/// The laws of all scenes.
pub fn checks(bundle: &Bundle, step: &mut Step) {
    demos(bundle).iter().for_each(|demo| check(bundle, step, demo));
}

fn check(bundle: &Bundle, step: &mut Step, demo: &Demo) {
    let scene = scene(bundle, demo);
    let mut command = bundle.on_adapter(&["check", &scene, "--json"]);
    let checked = bundle.run(&mut command);
    let verdicts: Vec<Value> = serde_json::from_str(&checked.out).unwrap_or_default();
    if verdicts.is_empty() {
        let outcome = if checked.end == End::TimedOut { Outcome::TimedOut } else { Outcome::Failed };
        return step.went_wrong(outcome, format!("check of {}: {}", demo.name, in_words(&checked.end)));
    }
    let broken: Vec<&Value> = verdicts.iter().filter(|verdict| verdict["holds"] != true).collect();
    if let Some(first) = broken.first() {
        let [law, backend] = ["law", "backend"].map(|key| first[key].as_str().unwrap_or_default());
        step.went_wrong(Outcome::Failed, format!("{}: {law} ({backend}) is broken", demo.name));
    }
    let on_adapter = verdicts.iter().filter(|verdict| {
        let backend = verdict["backend"].as_str().unwrap_or_default();
        backend.starts_with("gpu") && !verdict["law"].as_str().unwrap_or_default().contains("adjoint")
    });
    let largest = on_adapter.filter_map(|verdict| verdict["error"].as_f64()).fold(0.0, f64::max);
    step.figure_against(
        format!("{}: laws that are broken", demo.name),
        broken.len() as f64,
        "",
        format!("of {}", verdicts.len()),
    );
    step.figure(format!("{}: largest error of a product", demo.name), largest, "relative");
}

/// Every scene on the processor and on the adapter.
pub fn solves(bundle: &Bundle, step: &mut Step) {
    for demo in demos(bundle) {
        let of_light_map = demo.command == "light-map";
        let Some([here, there]) = both(bundle, step, demo) else { continue };
        match distance::of_results(&there, &here) {
            Ok([found, pictures]) => {
                if of_light_map && !found.is_some_and(|found| found <= LIGHT_MAP) {
                    step.went_wrong(
                        Outcome::Failed,
                        format!("{}: the light maps are too far apart", demo.name),
                    );
                }
                let law = if of_light_map { "at most 1e-3" } else { "" };
                for (what, distance, law) in
                    [("what was found", found, law), ("pictures after", pictures, "")]
                {
                    let Some(distance) = distance else { continue };
                    let what = format!("{}: distance of {what}", demo.name);
                    step.figure_against(what, distance, "relative", law);
                }
            }
            Err(error) => step.went_wrong(Outcome::Failed, format!("{}: {error}", demo.name)),
        }
        for folder in [here, there] {
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}

/// The folders of results of the processor and of the adapter.
fn both(bundle: &Bundle, step: &mut Step, demo: &Demo) -> Option<[PathBuf; 2]> {
    let scene = scene(bundle, demo);
    let mut folders = Vec::new();
    for backend in ["cpu", "gpu"] {
        let name = format!("{}-{backend}", demo.name.replace(' ', "-"));
        let folder = bundle.scratch(&name);
        let out = folder.to_string_lossy().into_owned();
        let arguments = [&[demo.command, &scene, "-q", "-o", &out], demo.options].concat();
        let mut command = match backend {
            "gpu" => bundle.on_adapter(&arguments),
            _ => bundle.unscatter(&[&arguments[..], &["--backend", "cpu"]].concat()),
        };
        bundle.done(step, &name, &mut command)?;
        let _ = std::fs::create_dir_all(bundle.result("reports"));
        let _ = std::fs::copy(folder.join("report.json"), bundle.result(&format!("reports/{name}.json")));
        times(step, &folder, &format!("{}, {backend}", demo.name));
        folders.push(folder);
    }
    folders.try_into().ok()
}

/// What a report says of its time and its iterations.
fn times(step: &mut Step, folder: &Path, name: &str) {
    let text = std::fs::read_to_string(folder.join("report.json")).unwrap_or_default();
    let report: Value = serde_json::from_str(&text).unwrap_or_default();
    let times = &report["timings"];
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let iterations = number(&report["stop"]["iteration"]);
    let mut against = format!("{iterations} iterations; {:.2} s in all", number(&times["total"]));
    if let Some(work) = report["gpu"].as_object() {
        let of = |key: &str| work.get(key).map_or(f64::NAN, number);
        against += &format!("; {} dispatches, {} round trips", of("dispatches"), of("round_trips"));
    }
    step.figure_against(format!("{name}: solving"), number(&times["solving"]), "s", against);
}

/// The same solve ten times (three in a dry run) with sums that do not depend on an order.
pub fn deterministic(bundle: &Bundle, step: &mut Step) {
    let scene = scene(bundle, &demos(bundle)[0]);
    let mut hashes = Vec::new();
    let runs = if bundle.is_dry { 3 } else { 10 };
    for number in 0..runs {
        let folder = bundle.scratch("deterministic");
        let out = folder.to_string_lossy().into_owned();
        let free = ["--deterministic", "--set", "solve.strategy=matrix-free"];
        let arguments = [&["light-map", &scene, "-q", "-o", &out], &free[..]].concat();
        if bundle.done(step, &format!("run {number}"), &mut bundle.on_adapter(&arguments)).is_none() {
            continue;
        }
        match std::fs::read(folder.join("light_map.exr")) {
            Ok(bytes) => hashes.push(hash(&bytes)),
            Err(error) => step.went_wrong(Outcome::Failed, format!("run {number}: {error}")),
        }
        let _ = std::fs::remove_dir_all(&folder);
    }
    let mut others = hashes.clone();
    others.sort_unstable();
    others.dedup();
    if others.len() > 1 {
        step.went_wrong(Outcome::Failed, "the light maps are not all the same".to_owned());
    }
    let words: Vec<String> = others.iter().map(|hash| format!("{hash:016x}")).collect();
    step.figure_against("runs", hashes.len() as f64, "", runs.to_string());
    step.figure_against("different light maps", others.len() as f64, "", format!("1; {}", words.join(", ")));
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// With each fault `gpu` must exit with 3, and `auto` must go on on the processor.
pub fn faults(bundle: &Bundle, step: &mut Step) {
    // The faults are about the device, so the smallest scene will do.
    let scene = scene(bundle, &TINY[0]);
    for fault in FAULTS {
        for (backend, expected) in [("gpu", 3), ("auto", 0)] {
            let out = bundle.scratch("fault").to_string_lossy().into_owned();
            let mut command = bundle.unscatter(&["light-map", &scene, "-q", "-o", &out]);
            command.args(["--backend", backend, "--adapter", &bundle.adapter]);
            command.env("UNSCATTER_FAULT", fault.name);
            let ended = bundle.run_within(&mut command, Duration::from_secs(fault.patience));
            let what = format!("{}, --backend {backend}", fault.name);
            if ended.end != End::Exit(Some(expected)) {
                let outcome = if ended.end == End::TimedOut { Outcome::TimedOut } else { Outcome::Failed };
                step.went_wrong(outcome, format!("{what}: {}", in_words(&ended.end)));
            }
            step.figure_against(what, ended.seconds, "s", format!("exit code {expected}"));
            let _ = std::fs::remove_dir_all(&out);
        }
    }
}

/// Every test that needs an adapter, with other random numbers each time, as long as there is time.
pub fn tests(bundle: &Bundle, step: &mut Step) {
    let seeds: &[&str] = if bundle.is_dry { &["2015"] } else { &["2015", "1", "2", "3", "4", "5", "6", "7"] };
    for (number, seed) in seeds.iter().enumerate() {
        // The first seed is what it is for; the others are as many as there is time for.
        if number > 0 && !bundle.has_time() {
            break;
        }
        let mut command = bundle.program("suite");
        command.args(["--ignored", "--skip", "vdb_peer"]);
        if bundle.is_dry {
            command.arg("gpu::vectors");
        }
        command.env("PROPTEST_RNG_SEED", seed);
        command.env("UNSCATTER_SEED", if number == 0 { "0" } else { seed });
        let ended = bundle.run(&mut command);
        if number > 0 && ended.end == End::TimedOut {
            step.notes.push(format!("seed {seed}: cut short"));
            break;
        }
        let [passed, failed] = counts(&ended.out);
        if ended.end != End::Exit(Some(0)) || passed == 0.0 {
            let outcome = if ended.end == End::TimedOut { Outcome::TimedOut } else { Outcome::Failed };
            let failing = failing(&ended.out).join(", ");
            step.went_wrong(outcome, format!("seed {seed}: {} {failing}", in_words(&ended.end)));
        }
        step.figure_against(format!("seed {seed}: tests that pass"), passed, "", format!("{failed} fail"));
    }
}

/// How many tests have passed and failed, as the test binary says it.
pub fn counts(told: &str) -> [f64; 2] {
    let line = told.lines().rev().find(|line| line.starts_with("test result:")).unwrap_or_default();
    ["passed", "failed"].map(|what| {
        let mut before = 0.0;
        for word in line.split([' ', ';']).filter(|word| !word.is_empty()) {
            if word == what {
                return before;
            }
            before = word.parse().unwrap_or(0.0);
        }
        0.0
    })
}

/// The tests that have failed, or were still under way.
pub fn failing(told: &str) -> Vec<&str> {
    let failed = |line: &&str| line.starts_with("test ") && line.ends_with("FAILED");
    told.lines().filter(failed).filter_map(|line| line.split(' ').nth(1)).collect()
}

/// The first solve with a driver that has compiled nothing yet, and the second.
pub fn first_solve(bundle: &Bundle, step: &mut Step) {
    let scene = scene(bundle, &demos(bundle)[0]);
    let caches = bundle.scratch("caches");
    let _ = std::fs::create_dir_all(&caches);
    for name in ["first solve, nothing compiled", "second solve"] {
        let out = bundle.scratch("first").to_string_lossy().into_owned();
        let mut command = bundle.on_adapter(&["light-map", &scene, "-q", "-o", &out]);
        for variable in ["XDG_CACHE_HOME", "__GL_SHADER_DISK_CACHE_PATH", "MESA_SHADER_CACHE_DIR"] {
            command.env(variable, &caches);
        }
        if let Some(ended) = bundle.done(step, name, &mut command) {
            step.figure(name, ended.seconds, "s");
        }
        let _ = std::fs::remove_dir_all(&out);
    }
}
