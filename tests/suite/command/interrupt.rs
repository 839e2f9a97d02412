//! Ctrl-C: what was computed is written, and the solve can be continued.
#![cfg(unix)]

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::pictures::exr;
use super::{Desk, PATIENCE, Ran};

const LONG: [&str; 9] =
    ["light-map", "scene.json", "-o", "out", "--iterations", "1000000", "--tolerance", "0", "--json"];

/// Starts a solve that would not end by itself, waits until it iterates, for then this preview is there, and interrupts it.
pub fn interrupted(desk: &Desk, arguments: &[&str], preview: &str) -> Ran {
    let child = Command::new(crate::program())
        .current_dir(desk.path("."))
        .args(arguments)
        .args(["--preview-every", "3"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !desk.path("out/preview").join(preview).is_file() {
        assert!(begun.elapsed() < PATIENCE, "no preview appears");
        sleep(Duration::from_millis(5));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    Ran::of(arguments, &child.wait_with_output().unwrap()).exits_with(130)
}

#[test]
fn ctrl_c_writes_results_and_the_solve_goes_on_from_there() {
    let desk = Desk::new();
    let ran = interrupted(&desk, &LONG, "right_after.png");
    let report = ran.json();
    assert_eq!(report, desk.json("out/report.json"));
    assert_eq!(report["stop"]["reason"], "interrupted");
    let stopped = report["stop"]["iteration"].as_u64().unwrap();
    assert!(stopped > 0);
    exr(&desk.path("out/light_map.exr"));
    assert!(desk.names("out").iter().all(|name| !name.ends_with(".part")), "{:?}", desk.names("out"));

    let goal = (stopped + 5).to_string();
    let resumed =
        ["light-map", "scene.json", "-o", "out", "--resume", "--iterations", &goal, "--tolerance", "0"];
    desk.done(&resumed);
    assert_eq!(desk.json("out/report.json")["history"].as_array().unwrap().len() as u64, stopped + 6);
    // A solve of many iterations stops when rounding is all that is left, and then neither gets to its goal.
    desk.done(&["light-map", "scene.json", "-o", "straight", "--iterations", &goal, "--tolerance", "0"]);
    assert_eq!(desk.read("out/light_map.exr"), desk.read("straight/light_map.exr"));
}
