//! A run that fails leaves what was there as it was.

use std::process::Command;

use super::{Desk, Ran};

#[test]
fn a_run_that_fails_leaves_earlier_results_as_they_were() {
    let desk = Desk::new();
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    desk.done(&["render", "scene.json", "-o", "out"]);
    desk.done(&["matrix", "scene.json", "-o", "out"]);
    let before = desk.files("out");
    for command in ["light-map", "render", "matrix"] {
        for set in [
            "views[0].strokes[0].radius=-1",
            "views[0].layers=[\"missing.png\"]",
            "no_such_field=1",
            "light.direction=[0, 0, 0]",
            "occluders=[{\"obj\": {\"file\": \"missing.obj\"}}]",
        ] {
            desk.run(&[command, "scene.json", "-o", "out", "--set", set]).exits_with(1);
        }
        desk.run(&[command, "missing.json", "-o", "out"]).exits_with(1);
    }
    desk.run(&["render", "scene.json", "-o", "out", "--light-map", "out/report.json"]).exits_with(1);
    desk.run(&["light-map", "scene.json", "-o", "out", "--memory", "1MiB"]).exits_with(1);
    assert!(desk.files("out") == before);
}

#[test]
fn an_output_folder_that_cannot_be_made_is_named() {
    let desk = Desk::new();
    desk.put("in_the_way", "a file");
    for command in ["light-map", "render", "matrix"] {
        for folder in ["in_the_way", "in_the_way/below"] {
            desk.run(&[command, "scene.json", "-o", folder]).exits_with(1).tells(folder);
        }
    }
    assert_eq!(desk.read("in_the_way"), b"a file");
    assert_eq!(desk.names("."), ["in_the_way", "scene.json"]);
}

/// A result whose name is taken by a folder cannot be replaced; the folder and what is in it stay.
#[test]
fn a_folder_in_the_place_of_a_result_is_named() {
    let desk = Desk::new();
    std::fs::create_dir_all(desk.path("out/left.exr")).unwrap();
    desk.put("out/left.exr/inside", "x");
    desk.run(&["render", "scene.json", "-o", "out"]).exits_with(1).tells("left.exr");
    assert_eq!(desk.read("out/left.exr/inside"), b"x");
    assert!(desk.names("out").is_empty(), "no temporary file is left");
}

/// Runs the program where a file may have so many kilobytes, as on a disk that is nearly full.
#[cfg(unix)]
fn run_with_files_up_to(desk: &Desk, kilobytes: u32, arguments: &[&str]) -> Ran {
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", 2 * kilobytes);
    let output = Command::new("sh")
        .current_dir(desk.path("."))
        .args(["-c", &script, "sh"])
        .arg(crate::program())
        .args(arguments)
        .output()
        .unwrap();
    Ran::of(arguments, &output)
}

#[cfg(unix)]
#[test]
fn a_write_that_fails_leaves_earlier_results_and_no_pieces() {
    let desk = Desk::new();
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    desk.done(&["matrix", "scene.json", "-o", "out"]);
    let before = desk.files("out");
    for (arguments, file) in [
        (["light-map", "scene.json", "-o", "out", "--set", "light.radiance=3"], "checkpoint"),
        (["matrix", "scene.json", "-o", "out", "--set", "light.radiance=3"], "T.npz"),
        (["render", "scene.json", "-o", "out", "--set", "light.radiance=3"], "left.exr"),
    ] {
        let ran = run_with_files_up_to(&desk, 4, &arguments);
        assert!(matches!(ran.code, Some(1 | 3)), "{ran:?}");
        assert!(!ran.err.contains("ZipWriter"), "{}", ran.err);
        ran.tells(file);
        assert!(desk.files("out") == before, "{arguments:?}");
    }
}

/// The disk fills up when some results are written and others are not: the folder must not hold a mixture.
#[cfg(unix)]
#[test]
fn results_are_replaced_together_or_not_at_all() {
    let mut scene = super::scene_with("/light_map/size", serde_json::json!(8));
    for view in 0..2 {
        scene["views"][view]["camera"]["size"] = serde_json::json!([320, 180]);
        scene["views"][view]["strokes"] =
            serde_json::json!([{ "points": [[160, 60]], "radius": 3, "color": "#ff4020" }]);
    }
    let desk = Desk::with(&scene);
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    let before = desk.files("out");
    let ran =
        run_with_files_up_to(&desk, 64, &["light-map", "scene.json", "-o", "out", "--set", "medium.g=0.5"]);
    assert!(matches!(ran.code, Some(1 | 3)), "{ran:?}");
    let after = desk.files("out");
    let changed: Vec<&String> =
        before.iter().zip(&after).filter(|(a, b)| a != b).map(|((name, _), _)| name).collect();
    assert!(changed.is_empty() && before.len() == after.len(), "{changed:?} were replaced");
}

/// On a disk that is full: exit 3, and everything as it was. Needs a kernel that gives a test a disk of its own.
#[cfg(target_os = "linux")]
#[test]
#[allow(clippy::print_stderr, reason = "that nothing was tested should be seen")]
fn a_full_disk_is_the_machines_fault() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("disk")).unwrap();
    let script = r#"
        mount -t tmpfs -o size=512k tmpfs disk 2>/dev/null || exit 99
        "$0" light-map scene.json -o disk/out --quiet >/dev/null || exit 98
        cksum disk/out/* > before
        head -c 1000000 /dev/zero > disk/fill 2>/dev/null
        code=0
        for command in light-map render matrix; do
            "$0" $command scene.json -o disk/out --set light.radiance=3 2>> told
            code="$code $?"
        done
        cksum disk/out/* > after
        echo $code
    "#;
    let output = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
        .arg(crate::program())
        .current_dir(desk.path("."))
        .output();
    let Ok(output) = output.as_ref().map(|output| String::from_utf8_lossy(&output.stdout)) else { return };
    if output.trim().is_empty() {
        eprintln!("IGNORED: this machine does not let a test mount a disk of its own");
        return;
    }
    assert_eq!(output.trim(), "0 3 3 3", "{}", String::from_utf8_lossy(&desk.read("told")));
    assert_eq!(desk.read("before"), desk.read("after"));
    let told = String::from_utf8(desk.read("told")).unwrap();
    assert!(told.contains("this machine") && told.contains("No space"), "{told}");
    assert!(!told.contains("panicked") && !told.contains("ZipWriter"), "{told}");
}
