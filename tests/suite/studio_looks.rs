//! Looks in the studio: changed over its socket, taken back, refused, and saved as they were shown.

use serde_json::{Value, json};
use unscatter::job::{Job, Quiet};

use crate::studio::{Opened, Page, citadel, open, screen};

/// Says what the looks are to be, and waits for the studio's word.
fn look(page: &mut Page, looks: &Value, goes_on: bool) {
    page.say(json!({ "type": "looks", "looks": looks, "goes_on": goes_on }));
    page.until("the looks", |page| page.last("looks").is_some_and(|told| told["looks"] == *looks));
}

fn full(page: &mut Page) -> Vec<u8> {
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    page.picture("after", 0).unwrap().pixels.clone()
}

fn save(page: &mut Page, opened: &Opened) -> String {
    page.say(json!({ "type": "save" }));
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    std::fs::read_to_string(opened.scene()).unwrap()
}

#[test]
fn looks_are_shown_and_saved_as_the_command_finds_them() {
    let opened = open(citadel());
    let before = std::fs::read_to_string(opened.scene()).unwrap();
    let mut page = opened.page();
    page.until("the looks", |page| page.last("looks").is_some());
    let told = page.last("looks").unwrap().clone();
    assert_eq!((&told["looks"], &told["texels"]), (&json!({}), &json!(256)));
    assert_eq!(told["names"], json!({ "objects": [], "materials": [] }));
    page.until("the full resolution", Page::is_done);
    let plain = page.picture("after", 0).unwrap().pixels.clone();

    // A drag, then a transfer function: as a page sends them, without what has a default.
    let fill = |texels: u32| json!({ "occluders": [{ "fill": { "texels": texels } }] });
    for step in 0..4 {
        page.say(json!({ "type": "looks", "looks": fill(2 + step), "goes_on": step > 0 }));
    }
    page.until("the drag", |page| page.last("looks").unwrap()["looks"] == fill(5));
    let mut looks = fill(5);
    looks["transfer"] = json!({ "far": 60, "layers": [
        { "gradient": { "along": "depth", "from": "#ffe0b0", "to": "#6080ff" } },
        { "diffusion": { "blend": "multiply", "points": [
            { "color": "#ff9040", "at": [0.8, 0.3] },
            { "color": "#40ff60", "view": "court", "pixel": [320, 180] }
        ] } }
    ] });
    page.pictures.clear();
    look(&mut page, &looks, false);
    page.until("the table", |page| page.pictures.iter().any(|shown| shown.about["kind"] == "transfer"));
    let table = page.pictures.iter().rfind(|shown| shown.about["kind"] == "transfer").unwrap();
    assert_eq!((&table.about["size"], table.pixels.len()), (&json!([128, 128]), 4 * 128 * 128));
    let told = page.last("looks").unwrap().clone();
    assert_eq!((&told["places"][0], &told["places"][1][0]), (&json!([]), &json!([0.8, 0.3])));
    // What the court sees in the middle of its picture, and the texel of its colour times that of the gradient.
    let seen = [0, 1].map(|axis| told["places"][1][1][axis].as_f64().unwrap());
    assert!(seen.iter().all(|part| (0.0..=1.0).contains(part)), "{seen:?}");
    let [i, j] = seen.map(|part| ((part * 128.0) as usize).min(127));
    let texel = &table.pixels[4 * (128 * j + i)..][..3];
    assert!(texel[1] > texel[0] && texel[1] > texel[2], "{texel:?}");
    assert_eq!(told["far"], 60.0);

    let shown = full(&mut page);
    assert_ne!(shown, plain);
    let saved = save(&mut page, &opened);
    let exposure = page.last("hello").unwrap()["exposure"].as_f64().unwrap();
    let found = Job::open(opened.scene()).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(shown, screen(&found.picture("court").unwrap(), exposure), "the command finds something else");
    // All else stays byte by byte, but for the place of the light map, which every save says.
    let begin = saved.find(",\n  \"looks\": {").expect("no looks are saved");
    let map = before.rfind("\"light_map\"").unwrap();
    assert_eq!(saved[..map], before[..map]);
    assert!(begin > map && saved.ends_with("\n  }\n}"), "{}", &saved[map..]);
    let written: Value = serde_json::from_str(&saved).unwrap();
    assert_eq!(written["looks"], looks);
    assert!(!saved[begin..].contains("strength"), "defaults are put in");
    // What is not changed is not written.
    assert_eq!(save(&mut page, &opened), saved);

    // Undone: the function, then the whole drag.
    page.say(json!({ "type": "undo" }));
    page.until("the undo", |page| page.last("looks").unwrap()["looks"] == fill(5));
    assert!(page.last("looks").unwrap()["far"].is_null());
    page.say(json!({ "type": "undo" }));
    page.until("the undo of the drag", |page| page.last("looks").unwrap()["looks"] == json!({}));
    assert_eq!(full(&mut page), plain, "it is not as it was");
    assert_eq!(page.last("strokes").unwrap()["can_undo"], false);
    let saved = save(&mut page, &opened);
    assert!(saved.ends_with("\"looks\": {}\n}"), "{}", &saved[map..]);
}

/// A page paints in the air as a person does: on a plane, stroke by stroke.
#[test]
fn painted_air_is_saved_and_comes_back_as_the_same_picture() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("the full resolution", Page::is_done);
    page.say(json!({ "type": "watch", "pictures": ["after", "depth"] }));
    page.until("the depths", |page| page.picture("depth", 0).is_some());
    // The sky has none, the wall some metres.
    let depths = page.picture("depth", 0).unwrap().pixels.clone();
    let code = |pixel: &[u8]| u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]);
    let depth = |code: u32| (f64::from(code) / f64::from((1 << 24) - 2) * 128.0 - 64.0).exp2();
    let codes: Vec<u32> = depths.chunks(4).map(code).collect();
    assert!(codes.contains(&((1 << 24) - 1)));
    assert!(codes.iter().filter(|&&code| (2.0..80.0).contains(&depth(code))).count() > codes.len() / 2);
    let mut strokes = Vec::new();
    let mut shown = Vec::new();
    for (value, distance) in [(json!(3), 12), (json!(0.2), 18)] {
        strokes.push(json!({ "value": value, "view": "court", "distance": distance,
            "pixels": [[150, 200], [260, 190]], "radius": 2.5, "opacity": 0.9, "hardness": 0.4 }));
        look(&mut page, &json!({ "heterogeneity": { "intensity": { "strokes": strokes } } }), false);
        shown.push(full(&mut page));
        let told = page.last("looks").unwrap();
        assert!(told["air_size"].as_f64().unwrap() > 1.0 && told["air_voxel"].as_f64().unwrap() > 0.1);
    }
    assert_ne!(shown[0], shown[1]);
    let exposure = page.last("hello").unwrap()["exposure"].as_f64().unwrap();
    let saved: Value = serde_json::from_str(&save(&mut page, &opened)).unwrap();
    assert_eq!(saved["looks"]["heterogeneity"]["intensity"]["strokes"], json!(strokes));
    let found = Job::open(opened.scene()).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(
        shown[1],
        screen(&found.picture("court").unwrap(), exposure),
        "the saved scene is another picture"
    );
    // A stroke in the air beside all that is seen is refused, and the picture stays.
    let away = json!({ "heterogeneity": { "intensity": { "strokes": [{ "value": 1, "view": "court", "distance": 5000, "pixels": [[9, 9]], "radius": 1 }] } } });
    page.say(json!({ "type": "looks", "looks": away, "goes_on": false }));
    page.until("the refusal", |page| {
        page.last("notice").is_some_and(|it| it["text"].as_str().unwrap().contains("strokes[0]"))
    });
}

#[test]
fn what_cannot_be_a_look_is_told_and_changes_nothing() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("the full resolution", Page::is_done);
    let good = json!({ "occluders": [{ "pierce": { "size": 2, "occluders": [3] } }] });
    look(&mut page, &good, false);
    let shown = full(&mut page);
    let transfer = |layers: Value| json!({ "transfer": { "far": 60, "layers": layers } });
    for (wrong, said) in [
        (json!({ "occluders": [{ "fill": { "texels": -1 } }] }), "looks.occluders[0].fill.texels"),
        (json!({ "occluders": [{ "fill": { "texels": 4000 } }] }), "within the shadow map"),
        (json!({ "occluders": [{ "extrude": { "view": "cuort", "texels": 3 } }] }), "did you mean `court`?"),
        (json!({ "occluders": [{ "pierce": { "size": 1, "objects": ["Leaves"] } }] }), "no object is called"),
        (json!({ "occluders": [{ "melt": {} }] }), "melt"),
        (transfer(json!([])), "looks.transfer.layers"),
        (transfer(json!([{ "image": { "file": "nowhere.png" } }])), "nowhere.png"),
        (transfer(json!([{ "solid": { "color": "#ff" } }])), "color"),
        (json!([1, 2]), "looks"),
        (Value::Null, "looks"),
    ] {
        page.told.clear();
        page.say(json!({ "type": "looks", "looks": wrong, "goes_on": false }));
        page.until("a refusal", |page| page.last("notice").is_some() && page.last("looks").is_some());
        let text = page.last("notice").unwrap()["text"].as_str().unwrap().to_owned();
        assert!(text.starts_with("that look cannot be: ") && text.contains(said), "{wrong}: {text}");
        assert!(!text.contains("scene.json") && !text.contains('\n'), "{text}");
        assert_eq!(page.last("looks").unwrap()["looks"], good);
    }
    assert_eq!(full(&mut page), shown);
    // What is pierced can be asked for.
    page.say(json!({ "type": "what", "view": 0, "x": 20, "y": 350 }));
    page.until("what is there", |page| page.last("seen").is_some());
    let seen = page.last("seen").unwrap();
    assert!(seen["object"].is_null() && seen["occluder"].as_u64().is_some(), "{seen}");
    page.say(json!({ "type": "what", "view": 99, "x": 20, "y": 350 }));
    page.say(json!({ "type": "what", "view": 0, "x": -1e300, "y": 1e300 }));
    page.told.clear();
    page.until("an answer", |page| page.last("seen").is_some());
}
