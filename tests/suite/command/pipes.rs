//! Where people point standard output and standard error, and how they end a run that takes too long.
#![cfg(unix)]

use std::process::{Command, Output};

use super::Desk;

/// Runs a line of the shell in which `$U` is the program.
fn shell(desk: &Desk, line: &str) -> Output {
    let mut command = Command::new("bash");
    command.args(["-c", line]).current_dir(desk.path(".")).env("U", crate::program());
    command.env("VK_DRIVER_FILES", "none").env("VK_ICD_FILENAMES", "none").output().unwrap()
}

/// What it said, and its exit code.
fn told(output: &Output) -> (String, String, Option<i32>) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr), output.status.code())
}

const FAILS_EARLY: &str = "$U light-map scene.json -q -o out --set 'views[0].strokes[0].radius=-1'";

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let desk = Desk::new();
    for line in ["plan scene.json", "schema", "completions bash", "light-map scene.json -q --json -o out"] {
        let (_, err, code) = told(&shell(&desk, &format!("$U {line} | head -c 1; exit ${{PIPESTATUS[0]}}")));
        assert_eq!((err.as_str(), code), ("", Some(0)), "{line}");
    }
    assert!(desk.names("out").contains(&"light_map.exr".to_owned()));
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_cannot_be_printed_are_a_failure_of_the_machine() {
    let desk = Desk::new();
    for line in [
        "plan scene.json",
        "schema",
        "completions fish",
        "doctor",
        "render scene.json -o out",
        "light-map scene.json --json -o out",
    ] {
        let (_, err, code) = told(&shell(&desk, &format!("$U -q {line} > /dev/full")));
        assert_eq!(code, Some(3), "{line}: {err}");
        assert!(err.contains("standard output") && !err.contains("panicked"), "{line}: {err}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn standard_error_decides_nothing() {
    let desk = Desk::new();
    let (out, _, _) = told(&shell(&desk, "$U light-map scene.json --json -o out | grep -v seconds | wc -l"));
    let results = desk.names("out");
    for (folder, away) in [("full", "2> /dev/full"), ("closed", "2>&-"), ("gone", "2> >(exit 0)")] {
        let line = format!("$U light-map scene.json -vv --json -o {folder} {away} | grep -v seconds | wc -l");
        let (same, _, _) = told(&shell(&desk, &format!("{line}; exit ${{PIPESTATUS[0]}}")));
        assert_eq!(same, out, "{away}");
        assert_eq!(desk.names(folder), results, "{away}");
        assert_eq!(desk.read(&format!("{folder}/light_map.exr")), desk.read("out/light_map.exr"), "{away}");
        assert_eq!(shell(&desk, &format!("{FAILS_EARLY} {away}")).status.code(), Some(1), "{away}");
    }
    // Nobody at all listens: what is closed at the start is as /dev/null is.
    assert_eq!(shell(&desk, "$U light-map scene.json -o none >&- 2>&- <&-").status.code(), Some(0));
    assert_eq!(desk.read("none/light_map.exr"), desk.read("out/light_map.exr"));
}

/// Longer than any test waits.
const LONG: &str = "$U light-map scene.json -q -o out --iterations 1000000 --tolerance 0 --preview-every 3 \
                    --set light_map.size=512";
/// Until it iterates.
const UNDER_WAY: &str = "until [ -e out/preview/right_after.png ]; do sleep 0.01; done";

#[test]
fn timeout_ends_a_run_with_its_results() {
    let desk = Desk::new();
    // It hands on the signal that it gets itself, as it does when the time is over.
    let line = format!("timeout --preserve-status 600 {LONG} & {UNDER_WAY}; kill -TERM $!; wait $!");
    let (_, err, code) = told(&shell(&desk, &line));
    assert_eq!(code, Some(130), "{err}");
    assert_eq!(desk.json("out/report.json")["stop"]["reason"], "interrupted");
    assert!(!desk.path("out/preview").exists());
}

/// Signals of two kinds are not merged into one on their way.
#[test]
fn a_request_that_comes_twice_at_once_is_one() {
    let desk = Desk::new();
    let line = format!("{LONG} & {UNDER_WAY}; kill -TERM $!; kill -INT $!; wait $!");
    assert_eq!(shell(&desk, &line).status.code(), Some(130));
    assert_eq!(desk.json("out/report.json")["stop"]["reason"], "interrupted");
}

#[test]
fn a_closed_terminal_ends_a_run_unless_it_was_told_to_ignore_that() {
    let desk = Desk::new();
    let line = format!("{LONG} & {UNDER_WAY}; kill -HUP $!; wait $!");
    assert_eq!(shell(&desk, &line).status.code(), Some(130));
    assert_eq!(desk.json("out/report.json")["stop"]["reason"], "interrupted");
    std::fs::remove_dir_all(desk.path("out")).unwrap();
    // It goes on, and hears the next signal.
    let line = format!(
        "nohup {LONG} > log 2>&1 & {UNDER_WAY}; kill -HUP $!; sleep 0.5; kill -0 $! || exit 9; kill -TERM $!; wait $!"
    );
    assert_eq!(shell(&desk, &line).status.code(), Some(130));
}

/// As on a medium that cannot be written. Needs a kernel that gives a test a disk of its own.
#[test]
#[cfg(target_os = "linux")]
#[allow(clippy::print_stderr, reason = "that nothing was tested should be seen")]
fn a_disk_that_cannot_be_written_is_the_machines_fault() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("disk")).unwrap();
    let script = "mount -t tmpfs tmpfs disk 2>/dev/null || exit 99; mkdir disk/out
        mount -o remount,ro disk || exit 99
        code=; for command in light-map render matrix; do $U $command scene.json -q -o disk/out; code=\"$code $?\"; done; echo $code";
    let (out, err, code) =
        told(&shell(&desk, &format!("unshare --user --map-root-user --mount bash -c '{script}'")));
    if code != Some(0) {
        eprintln!("IGNORED: this machine does not let a test mount a disk of its own");
        return;
    }
    assert_eq!(out.trim(), "3 3 3", "{err}");
    assert!(err.contains("Read-only"), "{err}");
}
