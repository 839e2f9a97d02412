//! `unscatter bench`: files, resumption, and the exit code of a broken law.

use serde_json::{Value, json};

use super::{Desk, scene_with, volume};

const QUICK: [&str; 7] = ["bench", "scene.json", "--quick", "--rows", "40", "--backend", "cpu"];

/// A light-map scene that takes no time, and a few marks of what was measured.
fn desk() -> Desk {
    Desk::with(&scene_with("/light_map", json!({ "size": 12 })))
}

fn lines(desk: &Desk) -> Vec<Value> {
    let text = String::from_utf8(desk.read("out/bench/records.jsonl")).unwrap();
    text.lines().filter(|line| !line.is_empty()).map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn put_lines(desk: &Desk, lines: &[Value]) {
    let text: Vec<String> = lines.iter().map(Value::to_string).collect();
    desk.put("out/bench/records.jsonl", text.join("\n") + "\n");
}

#[test]
fn every_case_is_in_the_files_and_every_law_holds() {
    let desk = desk();
    let told = desk.done(&QUICK).out;
    assert_eq!(
        desk.names("out/bench"),
        ["bench.csv", "bench.html", "bench.json", "counts.csv", "records.jsonl"]
    );
    let bench = desk.json("out/bench/bench.json");
    let records = bench["records"].as_array().unwrap();
    // Products: two bases, two strategies, the exact one in two precisions and three marches; over slices in two
    // precisions. Nine solvers, and one with marches.
    assert_eq!(records.len(), 2 * 2 * (2 + 3) + 2 * 2 + 9 + 3);
    assert_eq!(bench["held"]["hold"], bench["held"]["of"]);
    assert_eq!(bench["against"].as_array().unwrap().len(), 2 * 2 * 3);
    for record in records {
        let case = record["case"].as_str().unwrap();
        assert!(case.starts_with("scene/") && record["seconds"].as_f64().unwrap() >= 0.0);
        assert!(record["error"].as_f64().unwrap() < 2.0, "{case}");
    }
    let over: Vec<&str> =
        bench["scaling"].as_array().unwrap().iter().map(|sweep| sweep["over"].as_str().unwrap()).collect();
    for sweep in ["painted pixels", "views", "light-map texels", "shadow-map texels"] {
        assert!(over.contains(&sweep), "{sweep} in {over:?}");
    }
    let skipping = bench["skipping"].as_array().unwrap();
    // Kept rows, unpainted pixels, shadows, far ends, unreached unknowns, converged channels.
    assert_eq!(skipping.len(), 6);
    for skip in skipping {
        assert!(
            skip["work"]["with"].as_f64().unwrap() <= skip["work"]["without"].as_f64().unwrap(),
            "{skip}"
        );
    }
    for sweep in bench["scaling"].as_array().unwrap() {
        // Rows are those that the size asks for, and nobody else's.
        let of_size = ["painted pixels", "views"].contains(&sweep["over"].as_str().unwrap());
        let rows_a_size = |point: &Value| {
            let size = if of_size { point["size"].as_f64().unwrap() } else { 1.0 };
            point["rows"].as_f64().unwrap() / size
        };
        let points = sweep["points"].as_array().unwrap();
        assert!(points.iter().all(|point| rows_a_size(point) == rows_a_size(&points[0])), "{sweep}");
        assert_eq!(sweep["exponents"][0].is_null(), sweep["over"] == "painted pixels", "{sweep}");
    }
    let csv = String::from_utf8(desk.read("out/bench/bench.csv")).unwrap();
    assert_eq!(csv.lines().count(), records.len() + 1);
    let page = String::from_utf8(desk.read("out/bench/bench.html")).unwrap();
    assert!(page.contains("class=\"front\"") && !page.contains("://"));
    assert!(told.lines().all(|line| line.chars().count() <= 100), "{told}");
    assert!(told.contains("laws hold"));
}

#[test]
fn marches_err_more_the_fewer_their_steps() {
    let desk = desk();
    desk.done(&[&QUICK[..], &["--only-cases"]].concat());
    let bench = desk.json("out/bench/bench.json");
    let errors: Vec<f64> = bench["against"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|march| march["basis"] == "linear" && march["strategy"] == "assembled")
        .map(|march| march["error"][0].as_f64().unwrap())
        .collect();
    assert!(errors.len() == 3 && errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    assert!(bench["scaling"].as_array().unwrap().is_empty());
}

#[test]
fn a_run_that_is_resumed_measures_nothing_twice() {
    let desk = desk();
    let quick = [&QUICK[..], &["--only-cases"]].concat();
    desk.done(&quick);
    let whole = desk.json("out/bench/bench.json");
    let (all, kept) = (lines(&desk), 10);
    put_lines(&desk, &all[..kept]);
    // A line that a crash has cut off.
    let mut text = desk.read("out/bench/records.jsonl");
    text.extend_from_slice(b"{\"case\":\"scene/prod");
    desk.put("out/bench/records.jsonl", text);
    let resumed = [&quick[..], &["--resume"]].concat();
    let told = desk.done(&resumed).out;
    assert!(told.contains(&format!("{} results of an earlier run", kept - 1)), "{told}");
    let again = desk.json("out/bench/bench.json");
    let names = |bench: &Value| -> Vec<Value> {
        bench["records"].as_array().unwrap().iter().map(|record| record["case"].clone()).collect()
    };
    assert_eq!(names(&again), names(&whole));
    // Seconds are never the same twice, so these are the old ones.
    assert_eq!(again["records"][0], whole["records"][0]);
    assert!(desk.done(&resumed).out.contains(&format!("{} results of an earlier run", all.len() - 1)));
}

/// The same table of counts with one number changed: line, column, and what is made of the number.
fn with(table: &str, start: &str, column: usize, change: fn(u64) -> u64) -> String {
    let changed = |line: &str| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        fields[column] = change(fields[column].parse().unwrap()).to_string();
        fields.join(",")
    };
    let line = |line: &str| if line.starts_with(start) { changed(line) } else { line.to_owned() } + "\n";
    table.lines().map(line).collect()
}

#[test]
fn counts_may_not_rise_and_what_fell_is_said() {
    let desk = desk();
    let quick = [&QUICK[..], &["--only-cases"]].concat();
    desk.done(&quick);
    let table = String::from_utf8(desk.read("out/bench/counts.csv")).unwrap();
    let held = [&quick[..], &["--resume", "--counts", "counts.csv"]].concat();
    let assembled = "scene/product/cpu/exact/linear/f32/assembled";
    let solved = "scene/fista 1e-3/cpu/exact/linear";

    desk.put("counts.csv", &table);
    let laws = desk.json("out/bench/bench.json")["laws"].as_array().unwrap().len();
    let told = desk.done(&held).out;
    assert!(!told.contains("fell") && !told.contains("cp "), "{told}");
    assert!(desk.json("out/bench/bench.json")["laws"].as_array().unwrap().len() > laws);

    // Fewer than before are no fault, and neither are a few more steps: another machine rounds otherwise.
    desk.put(
        "counts.csv",
        with(&with(&table, assembled, 2, |nonzeros| nonzeros + 1), solved, 1, |steps| steps - 2),
    );
    let told = desk.done(&held).out;
    assert!(told.contains(assembled) && told.contains("fell") && told.contains("non-zeros from"), "{told}");
    assert!(!told.contains(solved) && told.contains("cp out/bench/counts.csv counts.csv"), "{told}");

    let is_told = |lowered: String, case: &str, words: &str| {
        desk.put("counts.csv", lowered);
        let told = desk.run(&held).exits_with(1).out;
        for part in ["BROKEN", case, words, "cp out/bench/counts.csv counts.csv"] {
            assert!(told.contains(part), "{part} in {told}");
        }
    };
    is_told(with(&table, assembled, 2, |nonzeros| nonzeros - 1), assembled, "non-zeros rose from");
    is_told(with(&table, assembled, 3, |bytes| bytes - 1), assembled, "bytes of kept rows rose from");
    is_told(with(&table, solved, 1, |steps| steps / 2), solved, "operator applications rose from");
    is_told(format!("{table}scene/gone,1,2,3\n"), "scene/gone", "left out, but counted before");

    // A case that is new is held against nothing.
    let old: Vec<&str> = table.lines().filter(|line| !line.starts_with(assembled)).collect();
    desk.put("counts.csv", old.join("\n"));
    desk.done(&held);
}

#[test]
fn counts_that_cannot_be_read_are_said_before_anything_is_measured() {
    let desk = desk();
    let held = [&QUICK[..], &["--only-cases", "--counts", "counts.csv"]].concat();
    desk.run(&held).exits_with(1).tells("counts.csv");
    desk.put("counts.csv", "case,applications,nonzeros,bytes\nscene/a,1,2\n");
    desk.run(&held).exits_with(1).tells("counts.csv is not a usable counts file").tells("line 2");
    assert!(!desk.path("out").exists());
}

#[test]
fn a_broken_law_is_told_and_exits_with_1() {
    let desk = desk();
    let quick = [&QUICK[..], &["--only-cases"]].concat();
    desk.done(&quick);
    let sound = lines(&desk);
    let resumed = [&quick[..], &["--resume"]].concat();
    for (pointer, law) in [
        ("/value/error", "T x against the explicit matrix"),
        ("/value/adjoint_error", "adjoint"),
        ("/value/adjoint_against_explicit", "Tᵀ y against the explicit matrix"),
    ] {
        let mut lines = sound.clone();
        let exact = lines.iter().position(|line| {
            line["case"].as_str().is_some_and(|case| case.starts_with("scene/product/cpu/exact/linear"))
        });
        *lines[exact.unwrap()].pointer_mut(pointer).unwrap() = json!(0.5);
        put_lines(&desk, &lines);
        let ran = desk.run(&resumed).exits_with(1);
        assert!(ran.out.contains("BROKEN") && ran.out.contains(law), "{}", ran.out);
    }
    let mut lines = sound;
    let solved = lines.iter_mut().find(|line| line["value"]["stop"] == "tolerance").unwrap();
    solved["value"]["excess"] = json!(0.5);
    put_lines(&desk, &lines);
    assert!(desk.run(&resumed).exits_with(1).out.contains("objective against the solution's"));
}

#[test]
fn what_cannot_be_resumed_is_said() {
    let desk = desk();
    let resumed = [&QUICK[..], &["--only-cases", "--resume"]].concat();
    desk.run(&resumed).exits_with(1).tells("records.jsonl");
    desk.done(&[&QUICK[..], &["--only-cases"]].concat());
    desk.put("scene.json", scene_with("/light_map", json!({ "size": 13 })).to_string());
    desk.run(&resumed).exits_with(1).tells("--resume").tells("of another run");
    desk.run(&["bench", "nowhere.json"]).exits_with(1).tells("nowhere.json");
    desk.run(&["bench", "--quick", "--all"]).exits_with(2);
}

#[test]
fn volumes_are_measured_too() {
    let desk = Desk::with(&volume::scene_with("/find", json!("emission")));
    desk.done(&QUICK);
    let bench = desk.json("out/bench/bench.json");
    let over: Vec<&Value> = bench["scaling"].as_array().unwrap().iter().map(|sweep| &sweep["over"]).collect();
    assert!(over.contains(&&json!("voxels")), "{over:?}");
    // No unknown of a painted volume is skipped.
    assert_eq!(bench["skipping"].as_array().unwrap().len(), 4);
    assert_eq!(bench["against"].as_array().unwrap().len(), 2 * 2 * 3);
}

#[test]
fn lights_cannot_be_marched_and_are_measured_without() {
    let desk = Desk::with(&volume::scene_with("/find", json!("environment")));
    desk.done(&QUICK);
    let bench = desk.json("out/bench/bench.json");
    assert_eq!(bench["records"].as_array().unwrap().len(), 2 * 2 * 2 + 9);
    assert!(bench["scaling"].as_array().unwrap().iter().any(|sweep| sweep["over"] == "lights"));
}

#[test]
fn pictures_are_drawn_in_every_way_on_one_page() {
    let desk = Desk::new();
    let ran = desk.run(&["bench", "scene.json", "--pictures", "--quick", "-q"]).exits_with(0);
    assert!(ran.out.contains("epipolar 1024"), "{}", ran.out);
    let bench = desk.json("out/bench/bench.json");
    let pictures = bench["pictures"].as_array().unwrap();
    for method in ["exact", "march", "min-max", "prefiltered", "epipolar", "bilateral"] {
        assert!(pictures.iter().any(|it| it["method"] == method), "{method}");
    }
    let error = |samples: u64| {
        let of =
            |it: &&Value| it["method"] == "epipolar" && it["number"] == samples && it["light_map"] == true;
        pictures.iter().find(of).unwrap()["error"].as_f64().unwrap()
    };
    assert!(error(2048) < 5e-3 && error(256) >= 0.9 * error(2048), "{} and {}", error(256), error(2048));
    let page = String::from_utf8(desk.read("out/bench/bench.html")).unwrap();
    assert!(page.contains("Pictures of scattered light") && page.contains("prefiltered"));
    desk.run(&["bench", "--pictures", "--all"]).exits_with(2);
}
