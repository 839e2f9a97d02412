//! What the runner for a graphics card (benches/card) promises whatever its programs do.
#![allow(dead_code, reason = "not all of it can be tried without a card")]

#[path = "../../benches/card/adapter.rs"]
mod adapter;
#[path = "../../benches/card/bundle.rs"]
mod bundle;
#[path = "../../benches/card/child.rs"]
mod child;
#[path = "../../benches/card/distance.rs"]
mod distance;
#[path = "../../benches/card/loader.rs"]
mod loader;
#[path = "../../benches/card/record.rs"]
mod record;
#[path = "../../benches/card/steps.rs"]
mod steps;
#[path = "../../benches/card/trials.rs"]
mod trials;

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use bundle::Bundle;
use child::End;
use record::{Outcome, Record, Step};
use serde_json::{Value, json};
use steps::Plan;

const SOON: Duration = Duration::from_millis(300);

fn shell(script: &str) -> Command {
    let mut command = Command::new("bash");
    command.args(["-c", script]);
    command
}

#[test]
fn a_program_that_hangs_is_left_after_its_time_with_what_it_has_said() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.txt");
    // A machine with much to do takes its time to start a shell.
    let mut time = SOON;
    let hanging = loop {
        let hanging = child::run(&mut shell("sleep 600 & echo $!; echo told >&2; wait"), time, &log);
        assert_eq!(hanging.end, End::TimedOut);
        if !hanging.out.trim().is_empty() {
            break hanging;
        }
        time *= 2;
    };
    // What it has started is gone with it; a zombie has no command line.
    let started = Path::new("/proc").join(hanging.out.trim()).join("cmdline");
    let clock = Instant::now();
    while !std::fs::read(&started).unwrap_or_default().is_empty() {
        assert!(clock.elapsed() < Duration::from_secs(60), "it goes on");
        std::thread::sleep(Duration::from_millis(10));
    }
    let log = std::fs::read_to_string(log).unwrap();
    assert!(log.contains("told") && log.contains(hanging.out.trim()) && log.contains("TimedOut"), "{log}");
}

#[test]
fn every_end_of_a_program_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let end = |mut command: Command| {
        child::run(&mut command, Duration::from_secs(60), &folder.path().join("log.txt")).end
    };
    assert_eq!(end(shell("exit 0")), End::Exit(Some(0)));
    assert_eq!(end(shell("exit 3")), End::Exit(Some(3)));
    assert_eq!(end(shell("kill -9 $$")), End::Exit(None));
    assert!(matches!(end(Command::new("/there/is/no/such/program")), End::NotStarted(_)));
}

/// A step of one shell script.
fn plan(work: fn(&Bundle, &mut Step)) -> Plan {
    Plan { name: "a step", seconds: 60, in_dry: true, work }
}

#[test]
fn a_step_that_goes_wrong_does_not_end_the_run() {
    let out = tempfile::tempdir().unwrap();
    let bundle = Bundle::open(out.path(), Instant::now() + Duration::from_secs(60)).unwrap();
    let plans = [
        plan(|bundle, step| drop(bundle.done(step, "it", &mut shell("exit 7")))),
        plan(|_, _| panic!("as it happens")),
        Plan { seconds: 0, ..plan(|bundle, step| drop(bundle.done(step, "it", &mut shell("sleep 60")))) },
        plan(|bundle, step| drop(bundle.done(step, "it", &mut shell("exit 0")))),
    ];
    let steps: Vec<Step> = (1..).zip(&plans).map(|(number, plan)| plan.run(&bundle, number)).collect();
    let outcomes: Vec<Outcome> = steps.iter().map(|step| step.outcome).collect();
    assert_eq!(outcomes, [Outcome::Failed, Outcome::Failed, Outcome::TimedOut, Outcome::Ok]);
    assert!(steps[0].notes[0].contains("exit code 7"), "{:?}", steps[0].notes);

    let mut record = Record {
        date: String::new(),
        version: json!("0"),
        is_dry: true,
        device: json!({ "name": "a | b" }),
        host: Value::Null,
        steps,
    };
    record.write(out.path()).unwrap();
    assert!(!record.is_sound());
    let table = std::fs::read_to_string(out.path().join("card.md")).unwrap();
    assert!(table.contains("exit code 7") && table.contains("timed out"), "{table}");
    record.steps.drain(..3);
    assert!(record.is_sound());
}

#[test]
fn no_step_begins_when_the_time_is_up() {
    let out = tempfile::tempdir().unwrap();
    let bundle = Bundle::open(out.path(), Instant::now()).unwrap();
    let step = plan(|_, step| step.figure("something", 1.0, "")).run(&bundle, 1);
    assert_eq!(step.outcome, Outcome::LeftOut);
    assert!(step.figures.is_empty());
}

#[test]
fn software_is_never_taken_for_a_card() {
    let adapter =
        |name: &str, kind: &str, verdict: Value| json!({ "name": name, "kind": kind, "verdict": verdict });
    let right = json!({ "Ok": null });
    let all = [
        adapter("llvmpipe", "software", right.clone()),
        adapter("Broken", "discrete", json!({ "Err": "computes nonsense" })),
        adapter("Big Card", "discrete", right.clone()),
        adapter("Small Card", "integrated", right),
    ];
    let name = |adapters: &[Value], is_dry, asked| {
        adapter::choose(adapters, is_dry, asked).map(|adapter| adapter["name"].clone())
    };
    assert_eq!(name(&all, false, None), Some(json!("Big Card")));
    assert_eq!(name(&all, false, Some("small")), Some(json!("Small Card")));
    assert_eq!(name(&all, false, Some("llvm")), None);
    assert_eq!(name(&all, true, None), Some(json!("llvmpipe")));
    assert_eq!(name(&all[..2], false, None), None);
    let told = adapter::instead(&all[..2], true, &["/a/driver.json".into()], false, None);
    for words in ["/a/driver.json", "llvmpipe", "software", "computes nonsense", "--dry"] {
        assert!(told.contains(words), "{words} in {told}");
    }
    assert!(adapter::instead(&[], false, &[], false, None).contains("libvulkan.so.1"));
}

#[test]
fn what_the_test_binary_says_is_understood() {
    let told =
        "test gpu::a ... ok\ntest gpu::b ... FAILED\n\ntest result: FAILED. 41 passed; 1 failed; 0 ignored\n";
    assert_eq!(trials::counts(told), [41.0, 1.0]);
    assert_eq!(trials::failing(told), ["gpu::b"]);
    assert_eq!(trials::counts(""), [0.0, 0.0]);
}

#[test]
fn distances_are_relative_and_differing_lengths_are_far_apart() {
    assert_eq!(distance::relative(&[3.0, 4.0], &[3.0, 4.0]), 0.0);
    assert_eq!(distance::relative(&[6.0, 8.0], &[3.0, 4.0]), 1.0);
    assert_eq!(distance::relative(&[0.0], &[0.0]), 0.0);
    assert_eq!(distance::relative(&[1.0], &[1.0, 2.0]), f64::INFINITY);
}
