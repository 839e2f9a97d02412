//! A scene while somebody paints: what can be undone, what is saved, and a journal that loses nothing.

use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::drawing::{Change, Drawing, Look, owned};
use super::setting::located;
use crate::io::scene_file::{Extent, Stroke, edit};
use crate::io::write_whole;
use crate::scene::Rgb;
use crate::{Error, Result};

/// The first line of a journal.
#[derive(Serialize, Deserialize, PartialEq)]
struct Beginning {
    version: u32,
    /// CRC-32 of the text of the scene file that the changes are of.
    scene: u32,
}

/// A scene file whose strokes are edited. Nobody else edits it in a studio meanwhile.
pub(super) struct Document {
    path: PathBuf,
    /// The scene file as it was read or written last.
    text: String,
    /// Whether there is no such file yet.
    is_new: bool,
    now: Drawing,
    saved: Drawing,
    undo: Vec<Drawing>,
    redo: Vec<Drawing>,
    /// What was changed last, that a drag may go on with.
    last: Option<Change>,
    /// When the file was changed that is known to hold that text, or that was looked at last.
    modified: Option<SystemTime>,
    journal_path: PathBuf,
    journal: File,
    /// Where the strokes go once another program has painted on the scene.
    beside: Option<PathBuf>,
}

/// What became of a save.
pub(super) enum Saved {
    /// It is in the scene file.
    Whole,
    /// So it is; and so is what another program has changed there meanwhile.
    Merged,
    /// Another program has changed the strokes, too: these are in a file beside it.
    Beside(PathBuf),
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { action, path, source }
}

impl Document {
    /// Takes a scene file for this studio, or the text of one that there is not yet (`is_new`); and how many changes a studio had left in its journal that was not closed in order, and what
    /// became of those of another text of the scene.
    ///
    /// Errors: [`Error::Machine`] where another studio has the scene; [`Error::File`].
    pub(super) fn open(path: &Path, text: String, is_new: bool) -> Result<(Self, usize, Option<PathBuf>)> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let journal_path = path.with_file_name(format!(".{name}.journal"));
        let opened = File::options().create(true).truncate(false).read(true).append(true).open(&journal_path);
        let mut journal = opened.map_err(failed("create", &journal_path))?;
        if let Err(TryLockError::WouldBlock) = journal.try_lock() {
            return Err(Error::Machine(format!(
                "another studio has {} open; use its page, or close it first",
                path.display()
            )));
        }
        let mut left = String::new();
        journal.read_to_string(&mut left).map_err(failed("read", &journal_path))?;
        let now = Drawing::new(edit::strokes(&text)?, edit::groups(&text)?, edit::looks(&text)?);
        let mut document = Self {
            path: path.to_owned(),
            text,
            is_new,
            saved: now.clone(),
            now,
            undo: Vec::new(),
            redo: Vec::new(),
            last: None,
            modified: None,
            journal_path,
            journal,
            beside: None,
        };
        let mut lines = left.lines();
        let is_of_this = lines
            .next()
            .and_then(|line| serde_json::from_str::<Beginning>(line).ok())
            .is_some_and(|beginning| beginning == document.beginning());
        let mut brought_back = 0;
        let mut set_aside = None;
        if is_of_this {
            // A line that was cut off by a crash ends it.
            for change in lines.map_while(|line| serde_json::from_str::<Change>(line).ok()) {
                if let Some(next) = document.after(&change) {
                    document.take(&change, next);
                    brought_back += 1;
                }
            }
        } else if lines.next().is_some() {
            let beside = unused(path, |number| format!("{name}.lost-journal{number}"));
            std::fs::write(&beside, &left).map_err(failed("write", &beside))?;
            set_aside = Some(beside);
        }
        if !is_of_this {
            document.begin_journal()?;
        }
        Ok((document, brought_back, set_aside))
    }

    fn beginning(&self) -> Beginning {
        Beginning { version: 3, scene: crc32fast::hash(self.text.as_bytes()) }
    }

    fn begin_journal(&mut self) -> Result<()> {
        self.journal.set_len(0).map_err(failed("write", &self.journal_path))?;
        self.journal.seek(SeekFrom::Start(0)).map_err(failed("write", &self.journal_path))?;
        let beginning = self.beginning();
        self.write_line(&beginning)
    }

    fn write_line(&mut self, line: &impl Serialize) -> Result<()> {
        let line = serde_json::to_string(line).map_err(|error| Error::Machine(error.to_string()))? + "\n";
        let written = self.journal.write_all(line.as_bytes()).and_then(|()| self.journal.sync_data());
        written.map_err(failed("write", &self.journal_path))
    }

    /// The scene as it is now.
    pub(super) fn now(&self) -> &Drawing {
        &self.now
    }

    /// Whether there is no scene file yet.
    pub(super) fn is_new(&self) -> bool {
        self.is_new
    }

    pub(super) fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    pub(super) fn can_redo(&self) -> bool {
        !self.redo.is_empty()
    }

    pub(super) fn is_saved(&self) -> bool {
        self.now == self.saved && !self.is_new
    }

    /// The scene after a change; none for a change that cannot be.
    pub(super) fn after(&self, change: &Change) -> Option<Drawing> {
        match change {
            Change::Undo => self.undo.last().cloned(),
            Change::Redo => self.redo.last().cloned(),
            _ => self.now.after(change),
        }
    }

    fn take(&mut self, change: &Change, next: Drawing) {
        let before = std::mem::replace(&mut self.now, next);
        match change {
            Change::Undo => {
                self.undo.pop();
                self.redo.push(before);
            }
            Change::Redo => {
                self.redo.pop();
                self.undo.push(before);
            }
            _ if change.goes_on_with(self.last.as_ref()) => {}
            _ => {
                self.redo.clear();
                self.undo.push(before);
            }
        }
        self.last = Some(change.clone());
    }

    /// Makes a change after which all is as [`Self::after`] has given, and notes it in the journal.
    ///
    /// Errors: [`Error::File`]; the change is made all the same.
    pub(super) fn make(&mut self, change: &Change, next: Drawing) -> Result<()> {
        let restored = match change {
            Change::Undo | Change::Redo => Some(Change::Restore(Box::new(next.from(&self.now)))),
            _ => None,
        };
        self.take(change, next);
        self.write_line(restored.as_ref().unwrap_or(change))
    }

    /// The text of the scene as it is now, with the place of the light map; see [`Self::text_of`].
    ///
    /// Errors: those of [`edit`].
    pub(super) fn text(&self, radiance: Rgb, extent: Option<&Extent>) -> Result<String> {
        located(self.text_of(&self.now, radiance)?, extent)
    }

    /// The text of the scene at some moment. `radiance` is that of the sun, which a sun from a model keeps when it is turned.
    ///
    /// Errors: those of [`edit`].
    pub(super) fn text_of(&self, moment: &Drawing, radiance: Rgb) -> Result<String> {
        edited(&self.text, moment, radiance)
    }

    /// Whether another program has changed the scene file since it was read or written here.
    pub(super) fn is_changed_elsewhere(&mut self) -> bool {
        let modified = modified(&self.path);
        if modified.is_some() && modified == self.modified {
            return false;
        }
        self.modified = modified;
        std::fs::read_to_string(&self.path).is_ok_and(|now| now != self.text)
    }

    /// Writes what was changed into the scene file. What another program has changed there meanwhile stays. Undo then goes back as far as
    /// views, light and air were the same.
    ///
    /// Errors: [`Error::File`].
    pub(super) fn save(&mut self, radiance: Rgb, extent: Option<&Extent>) -> Result<Saved> {
        let now = match std::fs::read_to_string(&self.path) {
            Err(error) if self.is_new && error.kind() == ErrorKind::NotFound => self.text.clone(),
            read => read.map_err(failed("read", &self.path))?,
        };
        let is_changed = now != self.text;
        let whole = |text: &str| located(edited(text, &self.now, radiance)?, extent);
        let have_painted = || {
            let theirs = (edit::strokes(&now).ok(), edit::groups(&now).ok(), edit::looks(&now).ok());
            let ours = self.saved.views[..self.saved.own()].iter().map(owned).collect::<Vec<Vec<Stroke>>>();
            let Drawing { groups, looks, .. } = &self.saved;
            theirs != (Some(ours), Some(groups.to_vec()), Some(Value::clone(looks)))
        };
        if is_changed && have_painted() {
            let name = self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let fresh = || unused(&self.path, |number| format!("{name}.mine{number}.json"));
            let beside = self.beside.clone().unwrap_or_else(fresh);
            write_text(&beside, &whole(&self.text)?)?;
            self.beside = Some(beside.clone());
            return Ok(Saved::Beside(beside));
        }
        let text = whole(&now)?;
        write_text(&self.path, &text)?;
        (self.text, self.is_new) = (text, false);
        self.settle();
        self.begin_journal()?;
        Ok(if is_changed { Saved::Merged } else { Saved::Whole })
    }

    /// What was added is the text's own from now on.
    fn settle(&mut self) {
        let (added, look) = (self.now.added.clone(), self.now.look);
        let settled = |moments: &mut Vec<Drawing>| {
            let others = moments.iter().rposition(|it| it.added != added || it.look != look);
            moments.drain(..others.map_or(0, |last| last + 1));
            moments.iter_mut().for_each(|it| (it.added, it.look) = (Vec::new(), Look::default()));
        };
        settled(&mut self.undo);
        settled(&mut self.redo);
        (self.now.added, self.now.look) = (Vec::new(), Look::default());
        self.saved = self.now.clone();
        self.last = None;
    }
}

/// A text with all that a studio changes.
fn edited(text: &str, moment: &Drawing, radiance: Rgb) -> Result<String> {
    let own: Vec<Vec<Stroke>> = moment.views[..moment.own()].iter().map(owned).collect();
    let text = edit::with_groups(&edit::with_strokes(text, &own)?, &moment.groups)?;
    let mut text = edit::with_looks(&text, &moment.looks)?;
    if let Some(direction) = moment.look.sun {
        text = edit::with_sun(&text, direction, radiance)?;
    }
    if let Some(sigma_t) = moment.look.sigma_t {
        text = edit::with_extinction(&text, sigma_t)?;
    }
    match moment.added.is_empty() {
        true => Ok(text),
        false => edit::with_views(&text, &moment.added()),
    }
}

impl Drop for Document {
    fn drop(&mut self) {
        // What is not saved stays in the journal.
        if self.is_saved() {
            _ = std::fs::remove_file(&self.journal_path);
        }
    }
}

fn modified(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|about| about.modified()).ok()
}

/// A name beside a file that nothing has: with nothing for a number, else with 2, 3, and so on.
fn unused(path: &Path, name: impl Fn(&str) -> String) -> PathBuf {
    let numbers = std::iter::once(String::new()).chain((2..).map(|number: u64| number.to_string()));
    let mut names = numbers.map(|number| path.with_file_name(name(&number)));
    names.find(|name| !name.exists()).unwrap_or_default()
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    write_whole(path, |file| file.write_all(text.as_bytes()).map_err(failed("write", path)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::scene_file::{Camera, Paint, Transform, View};
    use crate::studio::drawing::{Difference, Regrouped};

    const TEXT: &str =
        "{ \"views\": [{ \"name\": \"a\", \"strokes\": [] }, { \"name\": \"b\" }],\n  \"light_map\": {} }\n";
    const EXTENT: Extent = Extent { min: [0.0; 2], max: [1.0; 2] };

    fn paint(view: usize, x: f64) -> Change {
        let stroke = Stroke::new(vec![[x, 0.5], [x + 0.25, 1.0]], 2.0, Paint::Hex([255, 0, 0]));
        Change::Paint { view, stroke }
    }

    fn make(document: &mut Document, change: Change) -> bool {
        let after = document.after(&change);
        after.is_some_and(|after| document.make(&change, after).is_ok())
    }

    fn scene(text: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.json");
        std::fs::write(&path, text).unwrap();
        (folder, path)
    }

    fn open(path: &Path) -> (Document, usize, Option<PathBuf>) {
        Document::open(path, std::fs::read_to_string(path).unwrap(), false).unwrap()
    }

    #[test]
    fn everything_can_be_undone_and_done_again() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        let mut all = vec![document.now.views.clone()];
        let changes = [
            paint(0, 1.0),
            paint(1, 2.0),
            paint(1, 3.0),
            Change::Delete { view: 1, number: 0 },
            Change::Clear { view: 1 },
        ];
        for change in changes {
            assert!(make(&mut document, change));
            all.push(document.now.views.clone());
        }
        for before in all.iter().rev().skip(1) {
            assert!(make(&mut document, Change::Undo));
            assert_eq!(&document.now.views, before);
        }
        assert!(!make(&mut document, Change::Undo) && document.is_saved());
        for after in &all[1..] {
            assert!(make(&mut document, Change::Redo));
            assert_eq!(&document.now.views, after);
        }
        assert!(!make(&mut document, Change::Redo));
        // A new change forgets what was taken back; what there is not cannot be changed.
        assert!(make(&mut document, Change::Undo) && make(&mut document, paint(0, 7.0)));
        assert!(!document.can_redo());
        for never in [
            paint(2, 1.0),
            Change::Delete { view: 0, number: 9 },
            Change::Replace {
                view: 1,
                number: 7,
                stroke: match paint(0, 1.0) {
                    Change::Paint { stroke, .. } => stroke,
                    _ => unreachable!(),
                },
            },
        ] {
            assert!(!make(&mut document, never));
        }
    }

    #[test]
    fn a_crash_loses_nothing_and_a_second_studio_is_refused() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        for change in [paint(0, 1.0), paint(1, 2.0), Change::Undo, paint(0, 3.0)] {
            assert!(make(&mut document, change));
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(matches!(Document::open(&path, text, false), Err(Error::Machine(_))));
        let (strokes, journal) = (document.now.views.clone(), std::fs::read(&document.journal_path).unwrap());
        let journal_path = document.journal_path.clone();
        drop(document);
        // Cut off in the middle of a line.
        std::fs::write(&journal_path, [&journal[..], b"{\"type\":\"paint\",\"vi"].concat()).unwrap();
        let (document, brought_back, set_aside) = open(&path);
        assert_eq!((brought_back, set_aside), (4, None));
        assert!(document.now.views == strokes && document.can_undo() && !document.is_saved());
        drop(document);
        // Of another text of the scene they are not made, and are not lost.
        std::fs::write(&path, TEXT.replace("{}", "{ }")).unwrap();
        let (document, brought_back, set_aside) = open(&path);
        assert!(brought_back == 0 && document.is_saved());
        let set_aside = set_aside.unwrap();
        assert!(std::fs::read_to_string(&set_aside).unwrap().lines().count() >= 5);
        assert_ne!(unused(&path, |number| format!("scene.json.lost-journal{number}")), set_aside);
    }

    #[test]
    fn what_is_saved_is_in_the_scene_and_the_journal_begins_anew() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        assert!(make(&mut document, paint(1, 2.0)));
        assert!(matches!(document.save([1.0; 3], Some(&EXTENT)).unwrap(), Saved::Whole));
        assert!(document.is_saved() && document.can_undo());
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(edit::strokes(&text).unwrap()[1].len(), 1);
        assert!(text.contains("\"extent\""));
        let journal = document.journal_path.clone();
        assert_eq!(std::fs::read_to_string(&journal).unwrap().lines().count(), 1);
        drop(document);
        assert!(!journal.exists());
    }

    #[test]
    fn what_was_taken_back_after_a_save_is_taken_back_after_a_crash() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        assert!(make(&mut document, paint(0, 1.0)) && make(&mut document, paint(0, 2.0)));
        assert!(matches!(document.save([1.0; 3], Some(&EXTENT)).unwrap(), Saved::Whole));
        for change in [Change::Undo, Change::Undo, Change::Redo, paint(1, 4.0)] {
            assert!(make(&mut document, change));
        }
        let strokes = document.now.views.clone();
        assert_eq!([strokes[0].len(), strokes[1].len()], [1, 1]);
        drop(document);
        let (document, brought_back, _) = open(&path);
        assert_eq!(brought_back, 4);
        assert_eq!(document.now.views, strokes);
    }

    #[test]
    fn changes_of_another_program_are_kept_beside_ours() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        assert!(make(&mut document, paint(0, 2.0)) && !document.is_changed_elsewhere());
        // It has changed something else: both are in the file.
        std::fs::write(&path, TEXT.replace("{}", "{ \"size\": 64 }")).unwrap();
        assert!(document.is_changed_elsewhere());
        assert!(matches!(document.save([1.0; 3], Some(&EXTENT)).unwrap(), Saved::Merged));
        let both = std::fs::read_to_string(&path).unwrap();
        assert!(both.contains("\"size\": 64") && edit::strokes(&both).unwrap()[0].len() == 1);
        // It has painted, too: ours are beside.
        let theirs = TEXT.replace(
            "\"strokes\": []",
            "\"strokes\": [{ \"points\": [[1, 1]], \"radius\": 2, \"color\": \"#00f\" }]",
        );
        std::fs::write(&path, &theirs).unwrap();
        assert!(make(&mut document, paint(1, 5.0)));
        let Saved::Beside(beside) = document.save([1.0; 3], Some(&EXTENT)).unwrap() else {
            panic!("theirs are lost")
        };
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
        let ours = edit::strokes(&std::fs::read_to_string(beside).unwrap()).unwrap();
        assert_eq!([ours[0].len(), ours[1].len()], [1, 1]);
        assert!(!document.is_saved());
    }

    fn eye() -> Camera {
        Camera::new(Transform::default(), 40.0, [8, 6])
    }

    #[test]
    fn views_sun_and_fog_are_undone_survive_a_crash_and_are_saved() {
        let text = "{ \"light\": { \"direction\": [0, -1, 0] }, \"medium\": { \"sigma_t\": 0.5 },\n  \"views\": [{ \"name\": \"a\" }] }\n";
        let (_folder, path) = scene(text);
        let (mut document, ..) = open(&path);
        let sun = |x: f64, goes_on| Change::Sun { direction: [x, -1.0, 0.0], goes_on };
        let group = Regrouped::new("warm", None);
        let painted = Change::Paint {
            view: 1,
            stroke: Stroke {
                group: Some("warm".to_owned()),
                ..Stroke::new(vec![[1.0, 1.0]], 2.0, Paint::Hex([1, 2, 3]))
            },
        };
        for change in [
            sun(0.1, false),
            sun(0.2, true),
            sun(0.3, true),
            Change::Fog { sigma_t: 0.25, goes_on: false },
            Change::Add { view: Box::new(View::new("b".to_owned(), eye())) },
            Change::Groups { groups: vec![group] },
            painted,
        ] {
            assert!(make(&mut document, change));
        }
        assert!(!make(&mut document, Change::Fog { sigma_t: -1.0, goes_on: false }));
        assert!(!make(&mut document, sun(f64::NAN, false)));
        // A drag is one change.
        assert_eq!(document.undo.len(), 5);
        let all = document.now.clone();
        for _ in 0..3 {
            assert!(make(&mut document, Change::Undo));
        }
        assert!(document.now.views.len() == 1 && document.now.look.sigma_t == Some(0.25));
        for _ in 0..3 {
            assert!(make(&mut document, Change::Redo));
        }
        assert_eq!(document.now, all);
        assert_eq!(all.difference(&document.undo[1]), Difference::Rows);
        assert_eq!(all.difference(document.undo.last().unwrap()), Difference::Paint(vec![1]));
        drop(document);
        let (mut document, brought_back, _) = open(&path);
        assert!(brought_back > 10 && document.now == all);
        // A group by another name, and one that is gone.
        assert!(make(&mut document, Change::Groups { groups: vec![Regrouped::new("hot", Some("warm"))] }));
        assert_eq!(document.now.views[1][0].group.as_deref(), Some("hot"));
        assert!(make(&mut document, Change::Groups { groups: Vec::new() }));
        assert!(document.now.views[1][0].group.is_none() && make(&mut document, Change::Undo));

        assert!(matches!(document.save([1.0; 3], Some(&EXTENT)).unwrap(), Saved::Whole));
        let saved = std::fs::read_to_string(&path).unwrap();
        assert!(saved.contains("[0.3, -1, 0]") && saved.contains("\"sigma_t\": 0.25"), "{saved}");
        assert!(edit::strokes(&saved).unwrap()[1].len() == 1 && edit::groups(&saved).unwrap().len() == 1);
        // Undo goes on where views and light were the same; and what it leaves is saved as well.
        assert!(document.is_saved() && document.can_undo() && make(&mut document, Change::Undo));
        while make(&mut document, Change::Undo) {}
        assert_eq!(document.now.views.len(), 2);
        assert!(document.now.views[1].is_empty());
        document.save([1.0; 3], Some(&EXTENT)).unwrap();
        assert!(edit::strokes(&std::fs::read_to_string(&path).unwrap()).unwrap()[1].is_empty());
    }

    #[test]
    fn looks_are_undone_survive_a_crash_and_are_saved_beside_what_stays() {
        let text = TEXT.replace("\"light_map\"", "\"looks\": {  },  \"light_map\"");
        let (_folder, path) = scene(&text);
        let (mut document, ..) = open(&path);
        let fill = |texels: f64, goes_on| Change::Looks {
            looks: serde_json::json!({ "occluders": [{ "fill": { "texels": texels } }] }),
            goes_on,
        };
        for change in [fill(2.0, false), fill(3.0, true), fill(4.5, true), paint(0, 1.0), fill(7.0, true)] {
            assert!(make(&mut document, change));
        }
        // A drag is one change, and ends where something else was done.
        assert_eq!(document.undo.len(), 3);
        // The beginning of a drag that is overtaken is none of the drag before.
        let [begins, later] = [fill(1.0, false), fill(2.0, true)];
        assert!(begins.is_overtaken_by(&later) && begins.overtaken_by(later) == fill(2.0, false));
        assert!(make(&mut document, Change::Undo));
        let all = document.now.clone();
        assert_eq!(all.looks["occluders"][0]["fill"]["texels"], 4.5);
        assert_eq!(all.difference(&document.undo[0]), Difference::Rows);
        assert_eq!(all.difference(&document.undo[1]), Difference::Paint(vec![0]));
        drop(document);
        let (mut document, brought_back, _) = open(&path);
        assert!(brought_back == 6 && document.now == all);
        assert!(matches!(document.save([1.0; 3], None).unwrap(), Saved::Whole));
        let saved = std::fs::read_to_string(&path).unwrap();
        assert_eq!(
            edit::with_looks(&text, &all.looks).unwrap(),
            edit::with_strokes(&saved, &[vec![], vec![]]).unwrap()
        );
        // After a save they go back as far as before; where nothing is left of them the text says so.
        while make(&mut document, Change::Undo) {}
        assert_eq!(*document.now.looks, serde_json::json!({}));
        document.save([1.0; 3], None).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("\"looks\": {}"));
        // Another program has changed them: ours are beside.
        assert!(make(&mut document, paint(1, 1.0)));
        let theirs = std::fs::read_to_string(&path).unwrap().replace("{},", "{ \"occluders\": [] },");
        std::fs::write(&path, &theirs).unwrap();
        assert!(matches!(document.save([1.0; 3], None).unwrap(), Saved::Beside(_)));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
    }

    #[test]
    fn a_scene_that_there_is_not_yet_is_made_when_it_is_saved() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new.json");
        let (mut document, ..) = Document::open(&path, TEXT.to_owned(), true).unwrap();
        assert!(document.is_new() && !document.is_saved() && !document.is_changed_elsewhere());
        assert!(matches!(document.save([1.0; 3], Some(&EXTENT)).unwrap(), Saved::Whole));
        assert!(path.exists() && document.is_saved());
    }
}
