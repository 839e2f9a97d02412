//! The studio as its page sees it: over HTTP and a socket, with the citadel at a small size.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};
use unscatter::Error;
use unscatter::job::{EngineChoice, Job, Quiet, Stop};
use unscatter::scene::Image;
use unscatter::studio::Studio;

use crate::root;

/// Longer than anything here takes.
const PATIENCE: Duration = Duration::from_secs(60);

/// A studio on a copy of the citadel, whose light map is small.
pub struct Opened {
    folder: TempDir,
    address: String,
    stop: Stop,
    thread: Option<std::thread::JoinHandle<unscatter::Result<()>>>,
}

fn studio(scene: &Path) -> Studio {
    Studio {
        scene: scene.to_owned(),
        overrides: Vec::new(),
        engine: EngineChoice::default(),
        folder: scene.with_file_name("out"),
        port: 0,
    }
}

pub fn open(folder: TempDir) -> Opened {
    open_at(folder, "scene.json")
}

pub fn open_at(folder: TempDir, name: &str) -> Opened {
    let (told, hears) = std::sync::mpsc::channel();
    let (stop, studio) = (Stop::default(), studio(&folder.path().join(name)));
    let asked = stop.clone();
    let thread =
        std::thread::spawn(move || studio.serve(&asked, |address| told.send(address.to_owned()).unwrap()));
    let address = hears.recv_timeout(PATIENCE).expect("it does not open");
    Opened { folder, address, stop, thread: Some(thread) }
}

/// The citadel with small maps and two views, as people write such files.
pub fn citadel() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(root().join("strokes/citadel.json")).unwrap();
    let mut scene: Value = serde_json::from_str(&text).unwrap();
    scene["light_map"] = json!({ "size": 96 });
    scene["shadow_map"]["size"] = json!(256);
    scene["views"].as_array_mut().unwrap().truncate(2);
    std::fs::write(folder.path().join("scene.json"), serde_json::to_string_pretty(&scene).unwrap()).unwrap();
    folder
}

impl Opened {
    pub fn scene(&self) -> PathBuf {
        self.folder.path().join("scene.json")
    }

    fn host(&self) -> &str {
        self.address.strip_prefix("http://").unwrap().split('/').next().unwrap()
    }

    fn token(&self) -> &str {
        self.address.split("token=").nth(1).unwrap()
    }

    /// The answer to a request, headers and all.
    fn get(&self, path: &str, headers: &[(&str, &str)]) -> String {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        write!(stream, "GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn socket_with(&self, token: &str, origin: Option<&str>) -> Result<Page, tungstenite::Error> {
        let url = format!("ws://{}/socket?token={token}", self.host());
        let mut request = url.into_client_request().unwrap();
        origin.map(|origin| request.headers_mut().insert("origin", origin.parse().unwrap()));
        let stream = TcpStream::connect(self.host()).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        let (socket, _) = match tungstenite::client(request, stream) {
            Ok(talking) => talking,
            Err(tungstenite::HandshakeError::Failure(error)) => return Err(error),
            Err(tungstenite::HandshakeError::Interrupted(mut waits)) => loop {
                match waits.handshake() {
                    Ok(talking) => break talking,
                    Err(tungstenite::HandshakeError::Failure(error)) => return Err(error),
                    Err(tungstenite::HandshakeError::Interrupted(still)) => waits = still,
                }
            },
        };
        Ok(Page { socket, told: Vec::new(), pictures: Vec::new() })
    }

    pub fn page(&self) -> Page {
        self.socket_with(self.token(), Some(&format!("http://{}", self.host()))).unwrap()
    }

    /// Closes it in order, and gives its folder back.
    pub fn close(mut self) -> TempDir {
        self.stop.ask();
        self.thread.take().unwrap().join().unwrap().unwrap();
        std::mem::replace(&mut self.folder, tempfile::tempdir().unwrap())
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        self.stop.ask();
        self.thread.take().into_iter().for_each(|thread| drop(thread.join()));
    }
}

/// A picture as a page gets it.
pub struct Shown {
    pub about: Value,
    pub pixels: Vec<u8>,
}

/// What a page has heard so far.
pub struct Page {
    socket: WebSocket<TcpStream>,
    pub told: Vec<Value>,
    pub pictures: Vec<Shown>,
}

impl Page {
    pub fn say(&mut self, what: Value) {
        self.socket.send(Message::text(what.to_string())).unwrap();
    }

    /// Listens until something is so; whether the socket is still open.
    pub fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !is_so(self) {
            assert!(begun.elapsed() < PATIENCE, "{what} does not come; heard {:?}", self.told.last());
            assert!(self.hears(), "closed while waiting for {what}");
        }
    }

    fn hears(&mut self) -> bool {
        match self.socket.read() {
            Ok(Message::Text(text)) => self.told.push(serde_json::from_str(&text).unwrap()),
            Ok(Message::Binary(bytes)) => {
                let header = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                let about: Value = serde_json::from_slice(&bytes[4..4 + header]).unwrap();
                self.pictures.push(Shown { about, pixels: bytes[4 + header..].to_vec() });
            }
            Ok(Message::Close(_)) => return false,
            Ok(_) => {}
            Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => return false,
        }
        true
    }

    pub fn last(&self, kind: &str) -> Option<&Value> {
        self.told.iter().rfind(|told| told["type"] == kind)
    }

    pub fn picture(&self, kind: &str, view: u64) -> Option<&Shown> {
        self.pictures.iter().rfind(|shown| {
            shown.about["kind"] == kind && (kind == "light_map" || shown.about["view"] == view)
        })
    }

    pub fn strokes(&self, view: usize) -> Vec<Value> {
        self.last("strokes").map_or(Vec::new(), |told| told["views"][view].as_array().unwrap().clone())
    }

    pub fn is_done(&self) -> bool {
        self.last("progress").is_some_and(|told| told["phase"] == "done")
    }

    /// Paints, and forgets what was heard before the studio has taken it.
    pub fn paint(&mut self, view: usize, color: &str) {
        let count = self.strokes(view).len();
        let stroke = json!({ "points": [[200, 150], [330, 190]], "radius": 20, "color": color, "hardness": 0.7, "weight": 1, "opacity": 1, "erase": false });
        self.say(json!({ "type": "paint", "view": view, "stroke": stroke }));
        self.until("the stroke", |page| page.strokes(view).len() == count + 1);
        self.pictures.clear();
    }
}

#[test]
fn the_page_is_for_this_machine_and_its_own_address_alone() {
    let opened = open(citadel());
    let (host, token) = (opened.host().to_owned(), opened.token().to_owned());
    let with_token = format!("/?token={token}");
    let page = opened.get(&with_token, &[("Host", &host)]);
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<!doctype html>"), "{page}");
    assert!(page.contains("content-security-policy: default-src 'none'; script-src 'self'"));
    assert!(opened.get("/studio.js", &[("Host", &host)]).contains("text/javascript"));
    let local = host.replace("127.0.0.1", "localhost");
    assert!(opened.get(&with_token, &[("Host", &local)]).starts_with("HTTP/1.1 200"));
    for (path, headers) in [
        ("/", vec![("Host", &host[..])]),
        ("/?token=0123456789abcdef0123456789abcdef", vec![("Host", &host)]),
        ("/index.html", vec![("Host", &host)]),
        (&with_token, vec![("Host", "attacker.example")]),
        (&with_token, vec![("Host", &host), ("Origin", "http://attacker.example")]),
        (&with_token, vec![("Host", &host), ("Origin", "null")]),
    ] {
        let answer = opened.get(path, &headers);
        assert!(answer.starts_with("HTTP/1.1 403"), "{path} {headers:?}: {answer}");
        assert!(answer.contains("content-security-policy"));
    }
    assert!(opened.get("/../Cargo.toml", &[("Host", &host)]).starts_with("HTTP/1.1 404"));
    let origin = format!("http://{host}");
    for (token, origin) in [
        ("", Some(&origin[..])),
        ("0123456789abcdef0123456789abcdef", Some(&origin)),
        (&token, Some("http://attacker.example")),
        (&token, None),
    ] {
        assert!(opened.socket_with(token, origin).is_err(), "{token} {origin:?}");
    }
    assert!(opened.socket_with(&token, Some(&origin)).is_ok());
}

#[test]
fn painting_changes_the_pictures_and_what_is_saved_is_what_was_shown() {
    let opened = open(citadel());
    let (mut page, mut other) = (opened.page(), opened.page());
    page.until("hello", |page| page.last("hello").is_some() && page.picture("after", 1).is_some());
    let hello = page.last("hello").unwrap().clone();
    let court = &hello["views"][0];
    assert_eq!(
        [&court["name"], &court["size"], &court["preview"]],
        [&json!("court"), &json!([640, 360]), &json!([320, 180])]
    );
    assert_eq!((&court["camera"]["origin"], &hello["is_new"]), (&json!([3.5, 2.2, 12.0]), &json!(false)));
    let all = ["after", "before", "target", "difference", "coverage", "conflict", "light_map"];
    page.say(json!({ "type": "watch", "pictures": all }));
    page.until("all pictures", |page| all.iter().all(|kind| page.picture(kind, 1).is_some()));
    page.until("the full resolution", Page::is_done);
    let before = page.picture("after", 0).unwrap();
    assert_eq!((&before.about["stage"], &before.about["size"]), (&json!("full"), &json!([640, 360])));
    let before = before.pixels.clone();

    page.paint(0, "#20ff40");
    page.until("the first preview", |page| page.picture("after", 0).is_some());
    let preview = page.picture("after", 0).unwrap();
    assert_eq!((&preview.about["stage"], preview.pixels.len()), (&json!("preview"), 4 * 320 * 180));
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    let shown = page.picture("after", 0).unwrap().pixels.clone();
    assert_ne!(shown, before);
    // The other page knows of it.
    other.until("the stroke", |page| page.strokes(0).len() == 8);
    other.say(json!({ "type": "save" }));
    // Who does not listen is not heard: what waits for it comes first.
    other.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);

    let found = Job::open(opened.scene()).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(
        shown,
        screen(&found.picture("court").unwrap(), hello["exposure"].as_f64().unwrap()),
        "the command finds something else"
    );

    // Undone, it is as it was, to the bit.
    page.say(json!({ "type": "undo" }));
    page.until("the undo", |page| page.strokes(0).len() == 7);
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    assert_eq!(page.picture("after", 0).unwrap().pixels, before);
    assert_eq!(page.last("strokes").unwrap()["can_redo"], true);
}

#[test]
fn the_light_map_goes_to_the_paint_when_it_is_told_to_and_the_command_follows() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("the full resolution", Page::is_done);
    // Far to the side, through light that comes from beside the map.
    page.say(json!({ "type": "clear", "view": 0 }));
    page.until("nothing there", |page| page.strokes(0).is_empty());
    page.say(json!({ "type": "clear", "view": 1 }));
    page.until("nothing at all", |page| {
        page.last("progress").is_some_and(|told| told["phase"] == "nothing painted")
    });
    page.paint(0, "#20ff40");
    page.say(json!({ "type": "fit" }));
    page.until("the move", |page| page.last("notice").is_some());
    assert_eq!(page.last("notice").unwrap()["kind"], "done", "{:?}", page.last("notice"));
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    let shown = page.picture("after", 0).unwrap().pixels.clone();
    page.say(json!({ "type": "save" }));
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    let exposure = page.last("hello").unwrap()["exposure"].as_f64().unwrap();
    let found = Job::open(opened.scene()).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(shown, screen(&found.picture("court").unwrap(), exposure));
    // It is where the command would have put it.
    let saved: Value = serde_json::from_str(&std::fs::read_to_string(opened.scene()).unwrap()).unwrap();
    let mut bare = saved.clone();
    bare["light_map"].as_object_mut().unwrap().remove("extent");
    let path = opened.scene().with_file_name("bare.json");
    std::fs::write(&path, bare.to_string()).unwrap();
    let live = Job::open(path).unwrap().live(unscatter::job::Preview::Width(320)).unwrap();
    let least = [0, 1].map(|axis| saved["light_map"]["extent"]["min"][axis].as_f64().unwrap());
    assert_eq!(least, live.extent().min.to_array());
}

#[test]
fn light_air_views_and_groups_are_saved_as_they_were_shown() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("the full resolution", Page::is_done);
    let look = page.last("look").unwrap().clone();
    assert!(look["span"].as_f64().unwrap() > 10.0 && look["sigma_t"] == 0.018);
    for step in 0..4 {
        let direction = [0.3 + 0.05 * f64::from(step), -0.5, 0.85];
        page.say(json!({ "type": "sun", "direction": direction, "goes_on": step > 0 }));
    }
    page.say(json!({ "type": "fog", "sigma_t": 0.03, "goes_on": false }));
    page.until("the fog", |page| page.last("look").is_some_and(|look| look["sigma_t"] == 0.03));
    let sun = page.last("look").unwrap()["sun"].clone();
    assert!((sun[0].as_f64().unwrap() / -sun[1].as_f64().unwrap() - 0.9).abs() < 1e-9, "{sun}");

    // From where nobody looks yet; kept, it is a view.
    let mut camera = page.last("hello").unwrap()["views"][1]["camera"].clone();
    camera["origin"][1] = json!(9.0);
    let mut other = opened.page();
    page.say(json!({ "type": "look_from", "view": 1, "camera": camera }));
    let is_free = |page: &Page| page.pictures.iter().any(|shown| shown.about["kind"] == "free");
    page.until("what it sees", is_free);
    page.say(json!({ "type": "add_view", "name": "from above", "camera": camera }));
    page.until("the view", |page| page.last("hello").unwrap()["views"].as_array().unwrap().len() == 3);
    assert_eq!(page.last("hello").unwrap()["views"][2]["name"], "from-above");
    other.until("the view, too", |page| {
        page.last("hello").is_some_and(|hello| hello["views"].as_array().unwrap().len() == 3)
    });
    assert!(!is_free(&other), "another page has a camera of its own");
    drop(other);
    page.say(json!({ "type": "add_view", "name": "../x", "camera": camera }));
    page.until("the refusal", |page| page.last("notice").is_some_and(|told| told["kind"] == "error"));

    page.say(json!({ "type": "groups", "groups": [{ "name": "cold", "hidden": false, "weight": 0.5 }, { "name": "off", "hidden": true, "weight": 1 }] }));
    let stroke = |group: &str, color: &str| json!({ "points": [[200, 150], [330, 190]], "radius": 20, "pressure": [0.3, 1.0], "color": color, "group": group });
    page.say(json!({ "type": "paint", "view": 0, "stroke": stroke("cold", "#2060ff") }));
    page.say(json!({ "type": "paint", "view": 0, "stroke": stroke("off", "#ff2020") }));
    page.until("the strokes", |page| page.strokes(0).len() == 9);
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    let details = page.last("progress").unwrap()["details"].as_array().unwrap().clone();
    assert!(details.iter().any(|line| line[0] == "Certificate"), "{details:?}");
    let shown = page.picture("after", 0).unwrap().pixels.clone();
    page.say(json!({ "type": "save" }));
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    let exposure = page.last("hello").unwrap()["exposure"].as_f64().unwrap();
    let found = Job::open(opened.scene()).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(shown, screen(&found.picture("court").unwrap(), exposure), "the command finds something else");
    assert!(found.picture("from-above").is_ok());
    // As if the hidden stroke were not there.
    let mut saved: Value = serde_json::from_str(&std::fs::read_to_string(opened.scene()).unwrap()).unwrap();
    saved["views"][0]["strokes"].as_array_mut().unwrap().pop();
    let path = opened.scene().with_file_name("without.json");
    std::fs::write(&path, saved.to_string()).unwrap();
    let without = Job::open(path).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(found.picture("court").unwrap(), without.picture("court").unwrap());

    // Undo goes back to where the views became as they are.
    for _ in 0..20 {
        page.say(json!({ "type": "undo" }));
    }
    page.until("all undone", |page| page.last("strokes").unwrap()["can_undo"] == false);
    assert_eq!(page.last("hello").unwrap()["views"].as_array().unwrap().len(), 3);
    assert_eq!(page.strokes(0).len(), 7);
}

#[test]
fn a_volume_is_painted_on_and_looked_at_from_between() {
    let folder = tempfile::tempdir().unwrap();
    let camera = |origin: [f64; 3]| json!({ "to_world": { "look_at": { "origin": origin, "target": [0, 0, 0] } }, "fov": 50, "size": [320, 240] });
    let scene = json!({
        "version": 1,
        "volume": { "size": 24, "to_world": { "translate": [-0.5, -0.5, -0.5] }, "extinction": { "made": { "shapes": [{ "sphere": { "center": [0, 0, 0], "radius": 0.7 } }], "inside": 4, "edge": 0.2 } }, "albedo": { "value": 0.8 } },
        "find": "albedo",
        "environment": { "radiance": 0.8 },
        "background": 0,
        "views": [{ "name": "front", "camera": camera([0.0, 0.0, 3.0]) }, { "name": "side", "camera": camera([3.0, 0.0, 0.0]) }]
    });
    std::fs::write(folder.path().join("ball.json"), scene.to_string()).unwrap();
    let opened = open_at(folder, "ball.json");
    let mut page = opened.page();
    page.until("the plain volume", |page| {
        page.picture("after", 1).is_some() && page.last("progress").is_some()
    });
    let hello = page.last("hello").unwrap().clone();
    assert_eq!((&hello["is_volume"], &hello["views"][0]["preview"]), (&json!(true), &json!([160, 120])));
    assert_eq!(page.last("progress").unwrap()["phase"], "nothing painted");
    assert!(page.last("look").unwrap()["sun"].is_null());
    page.say(json!({ "type": "watch", "pictures": ["after", "before", "target", "difference"] }));
    page.until("all pictures", |page| {
        ["before", "target", "difference"].iter().all(|kind| page.picture(kind, 1).is_some())
    });
    let before = page.picture("before", 0).unwrap().pixels.clone();
    let stroke = json!({ "points": [[140, 120], [180, 120]], "radius": 25, "color": "#ff3010" });
    page.say(json!({ "type": "paint", "view": 0, "stroke": stroke }));
    page.until("the stroke", |page| page.strokes(0).len() == 1);
    page.pictures.clear();
    page.until("the preview", |page| {
        page.picture("after", 0).is_some_and(|shown| shown.about["stage"] == "preview")
    });
    let middle = |pixels: &[u8], [width, height]: [usize; 2]| -> [u8; 3] {
        let at = 4 * (height / 2 * width + width / 2);
        [pixels[at], pixels[at + 1], pixels[at + 2]]
    };
    let (painted, plain) =
        (middle(&page.picture("after", 0).unwrap().pixels, [160, 120]), middle(&before, [160, 120]));
    assert!(painted[1] < plain[1] && painted[2] < plain[2], "{painted:?} after {plain:?}");
    page.until("the full resolution", Page::is_done);
    let full = page
        .pictures
        .iter()
        .rfind(|shown| shown.about["kind"] == "after" && shown.about["view"] == 0)
        .unwrap();
    assert_eq!((&full.about["stage"], &full.about["size"]), (&json!("full"), &json!([320, 240])));
    let full = full.pixels.clone();
    assert!(page.last("progress").unwrap()["met"].as_f64().unwrap() > 0.3);

    // From between both views.
    let mut eye = hello["views"][0]["camera"].clone();
    eye["origin"] = json!([2.1, 0.0, 2.1]);
    page.say(json!({ "type": "look_from", "view": 0, "camera": eye }));
    page.until("what it sees", |page| page.pictures.iter().any(|shown| shown.about["kind"] == "free"));
    page.say(json!({ "type": "save" }));
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    let scene = opened.scene().with_file_name("ball.json");
    assert!(!std::fs::read_to_string(&scene).unwrap().contains("light_map"));
    let found = Job::open(scene).unwrap().solve(&mut Quiet).unwrap();
    assert_eq!(full, screen(&found.picture("front").unwrap(), 1.0), "the command finds something else");
    page.say(json!({ "type": "undo" }));
    page.until("nothing painted", |page| {
        page.last("progress").is_some_and(|told| told["phase"] == "nothing painted")
    });
    assert_eq!(page.picture("after", 0).unwrap().pixels, before);
}

/// A floor and two slabs above it.
const MODEL: &str = "v -6 0 -6\nv 6 0 -6\nv 6 0 6\nv -6 0 6\nf 1 2 3 4\n\
    v -6 4 -6\nv -1 4 -6\nv -1 4 6\nv -6 4 6\nf 5 6 7 8\nv 1 4 -6\nv 6 4 -6\nv 6 4 6\nv 1 4 6\nf 9 10 11 12\n";

#[test]
fn a_model_is_a_scene_once_it_is_saved() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("slabs.obj");
    std::fs::write(&model, MODEL).unwrap();
    let opened = open_at(folder, "slabs.obj");
    let mut page = opened.page();
    page.until("hello", |page| page.last("hello").is_some() && page.last("strokes").is_some());
    let (hello, scene) = (page.last("hello").unwrap().clone(), model.with_extension("json"));
    assert!(hello["is_new"] == true && hello["path"].as_str().unwrap().ends_with("slabs.json"));
    assert!(page.last("strokes").unwrap()["is_saved"] == false && !scene.exists());
    page.say(json!({ "type": "fog", "sigma_t": 0.1, "goes_on": false }));
    page.until("the fog", |page| page.last("look").is_some_and(|look| look["sigma_t"] == 0.1));
    // What is hidden is as if it were not there.
    page.say(json!({ "type": "groups", "groups": [{ "name": "tries", "hidden": true, "weight": 1 }] }));
    let hidden = json!({ "points": [[640, 300]], "radius": 60, "color": "#ff8020", "group": "tries" });
    page.say(json!({ "type": "paint", "view": 0, "stroke": hidden }));
    page.until("the hidden stroke", |page| page.strokes(0).len() == 1);
    page.told.retain(|told| told["type"] != "progress");
    page.until("nothing to do", |page| page.last("progress").is_some());
    assert_eq!(page.last("progress").unwrap()["phase"], "nothing painted");
    assert!(page.last("notice").is_none(), "{:?}", page.last("notice"));
    page.say(json!({ "type": "undo" }));
    page.until("the undo", |page| page.strokes(0).is_empty());
    let stroke = json!({ "points": [[640, 300], [640, 420]], "radius": 60, "color": "#ff8020" });
    page.say(json!({ "type": "paint", "view": 0, "stroke": stroke }));
    page.until("the stroke", |page| page.strokes(0).len() == 1);
    // The light map lies where the command would put it for that paint.
    page.told.retain(|told| told["type"] != "progress");
    page.until("the full resolution", Page::is_done);
    let met = page.last("progress").unwrap()["met"].as_f64().unwrap();
    page.say(json!({ "type": "save" }));
    page.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    let mut bare: Value = serde_json::from_str(&std::fs::read_to_string(&scene).unwrap()).unwrap();
    bare.as_object_mut().unwrap().remove("light_map");
    let path = scene.with_file_name("bare.json");
    std::fs::write(&path, bare.to_string()).unwrap();
    let found = Job::open(path).unwrap().solve(&mut Quiet).unwrap();
    let expected = found.report().weighted_residual.met().unwrap();
    assert!((met - expected).abs() < 0.02, "{met} is met, and the command meets {expected}");
    page.until("word of it", |page| page.last("hello").unwrap()["is_new"] == false);
    let saved = std::fs::read_to_string(&scene).unwrap();
    assert!(saved.contains("\"sigma_t\":0.1") && saved.contains("#ff8020"), "{saved}");
    assert!(Job::open(&scene).is_ok());
    drop(page);
    let folder = opened.close();
    // Where there is a scene, that is what to paint on.
    let again = studio(&folder.path().join("slabs.obj")).serve(&Stop::default(), |_| {});
    assert!(matches!(again, Err(Error::Machine(words)) if words.contains("slabs.json")));
}

/// What a screen shows of a picture: sRGB (IEC 61966-2-1) in 8 bits.
pub fn screen(picture: &Image, exposure: f64) -> Vec<u8> {
    let code = |linear: f32| {
        let linear = (f64::from(linear) * exposure).clamp(0.0, 1.0) as f32;
        let encoded = match linear {
            ..=0.003_130_8 => 12.92 * linear,
            _ => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
        };
        (255.0 * encoded).round() as u8
    };
    picture.pixels.iter().flat_map(|&[r, g, b]| [code(r), code(g), code(b), 255]).collect()
}

#[test]
fn a_studio_that_ends_loses_nothing_and_a_second_one_is_refused() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("hello", |page| page.last("strokes").is_some());
    page.paint(1, "#2040ff");
    page.say(json!({ "type": "delete", "view": 0, "number": 2 }));
    page.until("the deletion", |page| page.strokes(0).len() == 6);
    let second = studio(&opened.scene()).serve(&Stop::default(), |_| ());
    assert!(matches!(second, Err(Error::Machine(told)) if told.contains("another studio")));

    let opened = open(opened.close());
    let mut again = opened.page();
    again.until("the strokes", |page| page.last("strokes").is_some() && page.last("notice").is_some());
    assert_eq!([again.strokes(0), again.strokes(1)], [page.strokes(0), page.strokes(1)]);
    assert!(again.last("notice").unwrap()["text"].as_str().unwrap().starts_with("2 changes"));
    assert_eq!(again.last("strokes").unwrap()["is_saved"], false);
    again.say(json!({ "type": "save" }));
    again.until("the save", |page| page.last("strokes").unwrap()["is_saved"] == true);
    let names = |folder: &Path| std::fs::read_dir(folder).unwrap().count();
    let folder = opened.close();
    assert_eq!(names(folder.path()), 1, "a journal is left of what was saved");
}

#[test]
fn a_broken_scene_is_told_with_its_place_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, "{ \"version\": 1,\n  \"views\": [ }").unwrap();
    let refused = studio(&path).serve(&Stop::default(), |_| ());
    assert!(matches!(refused, Err(Error::Scene { line: 2, .. })), "{refused:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn what_no_page_would_say_is_answered_or_ends_the_page_and_harms_no_other() {
    let opened = open(citadel());
    let mut page = opened.page();
    page.until("hello", |page| page.last("strokes").is_some());
    for nonsense in
        ["{", "[]", "{\"type\":\"fly\"}", "{\"type\":\"paint\",\"view\":0}", "{\"type\":\"undo\",\"view\":1}"]
    {
        let heard = page.told.iter().filter(|told| told["type"] == "notice").count();
        page.socket.send(Message::text(nonsense)).unwrap();
        if !nonsense.contains("undo") {
            page.until("a complaint", |page| {
                page.told.iter().filter(|told| told["type"] == "notice").count() > heard
            });
        }
    }
    let strokes = page.strokes(0);
    let stroke = |points: Value, radius: f64| json!({ "points": points, "radius": radius, "color": "#fff" });
    for wrong in [stroke(json!([]), 3.0), stroke(json!([[1, 2]]), -1.0), stroke(json!([[-900, -900]]), 3.0)] {
        page.told.clear();
        page.say(json!({ "type": "paint", "view": 0, "stroke": wrong }));
        page.until("a refusal", |page| page.last("notice").is_some() && page.last("strokes").is_some());
        assert!(page.last("notice").unwrap()["text"].as_str().unwrap().starts_with("that stroke cannot be"));
        assert_eq!(page.strokes(0), strokes);
    }
    page.say(json!({ "type": "paint", "view": 99, "stroke": stroke(json!([[1, 2]]), 3.0) }));
    page.say(json!({ "type": "reach", "view": 99, "x": 1e9, "y": -4.0 }));
    page.say(json!({ "type": "reach", "view": 0, "x": 1e9, "y": -4.0 }));
    page.until("what is seen", |page| page.last("reached").is_some());

    // A flood, and a message that is too long.
    let mut flood = opened.page();
    (0..1000).for_each(|_| drop(flood.socket.send(Message::text("{\"type\":\"redo\"}"))));
    let begun = Instant::now();
    while flood.hears() {
        assert!(begun.elapsed() < PATIENCE, "a flood is not stopped");
    }
    let mut long = opened.page();
    _ = long.socket.send(Message::text(" ".repeat(2 << 20)));
    let begun = Instant::now();
    while long.hears() {
        assert!(begun.elapsed() < PATIENCE, "a message of 2 MiB is not refused");
    }
    page.told.clear();
    page.say(json!({ "type": "reach", "view": 1, "x": 20, "y": 20 }));
    page.until("an answer", |page| page.last("reached").is_some());
}
