//! `unscatter stress`: its verdicts, and that each of them turns where what it tests is wrong.

use serde_json::Value;

use super::{Desk, Ran};

const NO_ADAPTER: [(&str, &str); 2] = [("VK_DRIVER_FILES", "none"), ("VK_ICD_FILENAMES", "none")];

fn faulty(desk: &Desk, arguments: &[&str]) -> Ran {
    desk.run_in(arguments, &[&NO_ADAPTER[..], &[("UNSCATTER_FAULT", "weight")]].concat())
}

fn verdicts(ran: &Ran) -> Vec<Value> {
    ran.json()["verdicts"].as_array().unwrap().clone()
}

#[test]
fn every_law_holds_and_says_what_it_measured() {
    let desk = Desk::new();
    let ran = desk.run(&["stress", "--quick", "--json", "-q"]).exits_with(0);
    let verdicts = verdicts(&ran);
    let broken = verdicts.iter().filter(|verdict| !verdict["holds"].as_bool().unwrap());
    let broken: Vec<&str> = broken.map(|verdict| verdict["case"].as_str().unwrap()).collect();
    assert!(broken.is_empty(), "{broken:?}");
    assert!(verdicts.len() > 30);
    for verdict in &verdicts {
        assert!(!verdict["law"].as_str().unwrap().is_empty() && !verdict["why"].as_str().unwrap().is_empty());
        assert!(!verdict["samples"].as_array().unwrap().is_empty(), "{verdict}");
        // JSON has no number for what is none.
        assert!(verdict["samples"].as_array().unwrap().iter().all(|sample| sample["measured"].is_number()));
    }
}

/// The sabotage: one weight of every row is wrong by a thousandth, or what should be refused is right.
#[test]
fn every_verdict_turns_where_a_weight_is_wrong() {
    let desk = Desk::new();
    let ran = faulty(&desk, &["stress", "--quick", "--json", "-q"]).exits_with(1);
    let holds: Vec<String> = verdicts(&ran)
        .iter()
        .filter(|verdict| verdict["holds"].as_bool().unwrap())
        .map(|verdict| verdict["case"].to_string())
        .collect();
    assert!(holds.is_empty(), "these do not see it: {holds:?}");
}

#[test]
fn some_cases_make_a_table_and_files() {
    let desk = Desk::new();
    let ran = desk.done(&["stress", "depth/light", "--quick", "-o", "found"]);
    assert!(ran.out.starts_with("holds   depth/light-map"), "{}", ran.out);
    assert!(ran.out.trim_end().ends_with("all laws hold"), "{}", ran.out);
    assert!(ran.out.lines().all(|line| line.chars().count() <= 120), "{}", ran.out);
    assert_eq!(desk.names("found"), ["stress.json", "stress.txt"]);
    assert_eq!(desk.json("found/stress.json")["cases"], 1);
    assert_eq!(String::from_utf8(desk.read("found/stress.txt")).unwrap(), ran.out);
    let broken = faulty(&desk, &["stress", "depth/light", "--quick"]).exits_with(1);
    assert!(broken.out.starts_with("BROKEN  depth/light-map"), "{}", broken.out);
    assert!(broken.out.trim_end().ends_with("1 law is BROKEN"), "{}", broken.out);
}

#[test]
fn a_name_that_no_case_has_is_answered_with_those_there_are() {
    let ran = Desk::new().run(&["stress", "dpeth"]).exits_with(1);
    assert!(ran.out.is_empty());
    ran.tells("no case has `dpeth` in its name");
}
