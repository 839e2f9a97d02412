//! The strokes of a scene while somebody paints: what can be undone, what is saved, and a journal that loses nothing.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::io::scene_file::{Extent, Stroke, edit};
use crate::io::write_whole;
use crate::{Error, Result};

/// A change of the strokes, as a page asks for it and as the journal has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Change {
    /// A stroke on top of the others of a view.
    Paint { view: usize, stroke: Stroke },
    /// Another stroke in the place of one.
    Replace { view: usize, number: usize, stroke: Stroke },
    /// A stroke goes.
    Delete { view: usize, number: usize },
    /// All strokes of a view go.
    Clear { view: usize },
    /// The last change is taken back.
    Undo,
    /// What was taken back last is done again.
    Redo,
    /// A view has these strokes: how the journal has what was taken back or done again, which may be older than the journal is.
    Restore { view: usize, strokes: Vec<Stroke> },
}

/// The strokes of one view.
pub(super) type Strokes = Vec<Arc<Stroke>>;

/// A view and its strokes at another time.
type Moment = (usize, Strokes);

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
    strokes: Vec<Strokes>,
    saved: Vec<Strokes>,
    undo: Vec<Moment>,
    redo: Vec<Moment>,
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

fn shared(strokes: Vec<Vec<Stroke>>) -> Vec<Strokes> {
    strokes.into_iter().map(|strokes| strokes.into_iter().map(Arc::new).collect()).collect()
}

fn owned(strokes: &[Strokes]) -> Vec<Vec<Stroke>> {
    strokes.iter().map(|strokes| strokes.iter().map(|stroke| Stroke::clone(stroke)).collect()).collect()
}

impl Document {
    /// Takes a scene file for this studio; and how many changes a studio had left in its journal that was not closed in order, and what
    /// became of those of another text of the scene.
    ///
    /// Errors: [`Error::Machine`] where another studio has the scene; [`Error::File`].
    pub(super) fn open(path: &Path, text: String) -> Result<(Self, usize, Option<PathBuf>)> {
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
        let strokes = shared(edit::strokes(&text)?);
        let mut document = Self {
            path: path.to_owned(),
            text,
            saved: strokes.clone(),
            strokes,
            undo: Vec::new(),
            redo: Vec::new(),
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
                if let Some((view, strokes)) = document.after(&change) {
                    document.take(&change, view, strokes);
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
        Beginning { version: 1, scene: crc32fast::hash(self.text.as_bytes()) }
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

    /// The strokes, view by view.
    pub(super) fn strokes(&self) -> &[Strokes] {
        &self.strokes
    }

    pub(super) fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    pub(super) fn can_redo(&self) -> bool {
        !self.redo.is_empty()
    }

    pub(super) fn is_saved(&self) -> bool {
        self.strokes == self.saved
    }

    /// The view that a change is of and its strokes afterwards; none for a change that cannot be.
    pub(super) fn after(&self, change: &Change) -> Option<Moment> {
        let of = |view: usize| self.strokes.get(view).cloned();
        Some(match change {
            Change::Paint { view, stroke } => {
                let mut strokes = of(*view)?;
                strokes.push(Arc::new(stroke.clone()));
                (*view, strokes)
            }
            Change::Replace { view, number, stroke } => {
                let mut strokes = of(*view)?;
                *strokes.get_mut(*number)? = Arc::new(stroke.clone());
                (*view, strokes)
            }
            Change::Delete { view, number } => {
                let mut strokes = of(*view)?;
                if *number >= strokes.len() {
                    return None;
                }
                strokes.remove(*number);
                (*view, strokes)
            }
            Change::Clear { view } => {
                of(*view).filter(|strokes| !strokes.is_empty())?;
                (*view, Vec::new())
            }
            Change::Undo => self.undo.last()?.clone(),
            Change::Redo => self.redo.last()?.clone(),
            Change::Restore { view, strokes } => {
                of(*view)?;
                (*view, strokes.iter().cloned().map(Arc::new).collect())
            }
        })
    }

    fn take(&mut self, change: &Change, view: usize, strokes: Strokes) {
        let before = std::mem::replace(&mut self.strokes[view], strokes);
        match change {
            Change::Undo => {
                self.undo.pop();
                self.redo.push((view, before));
            }
            Change::Redo => {
                self.redo.pop();
                self.undo.push((view, before));
            }
            _ => {
                self.redo.clear();
                self.undo.push((view, before));
            }
        }
    }

    /// Makes a change whose strokes [`Self::after`] has given, and notes it in the journal.
    ///
    /// Errors: [`Error::File`]; the change is made all the same.
    pub(super) fn make(&mut self, change: &Change, (view, strokes): Moment) -> Result<()> {
        let restored = match change {
            Change::Undo | Change::Redo => Some(strokes.iter().map(|stroke| Stroke::clone(stroke)).collect()),
            _ => None,
        };
        self.take(change, view, strokes);
        match restored {
            Some(strokes) => self.write_line(&Change::Restore { view, strokes }),
            None => self.write_line(change),
        }
    }

    /// The text of the scene with its strokes, and with the place of the light map where it did not say.
    ///
    /// Errors: those of [`edit`].
    pub(super) fn text(&self, extent: &Extent) -> Result<String> {
        self.edited(&self.text, extent)
    }

    fn edited(&self, text: &str, extent: &Extent) -> Result<String> {
        edit::with_light_map_at(&edit::with_strokes(text, &owned(&self.strokes))?, extent)
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

    /// Writes the strokes into the scene file. What another program has changed there meanwhile stays.
    ///
    /// Errors: [`Error::File`].
    pub(super) fn save(&mut self, extent: &Extent) -> Result<Saved> {
        let now = std::fs::read_to_string(&self.path).map_err(failed("read", &self.path))?;
        let is_changed = now != self.text;
        let theirs = if is_changed { edit::strokes(&now).ok() } else { None };
        if is_changed && theirs.as_ref() != Some(&owned(&self.saved)) {
            let name = self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let fresh = || unused(&self.path, |number| format!("{name}.mine{number}.json"));
            let beside = self.beside.clone().unwrap_or_else(fresh);
            write_text(&beside, &self.edited(&self.text, extent)?)?;
            self.beside = Some(beside.clone());
            return Ok(Saved::Beside(beside));
        }
        let text = self.edited(&now, extent)?;
        write_text(&self.path, &text)?;
        self.text = text;
        self.saved = self.strokes.clone();
        self.begin_journal()?;
        Ok(if is_changed { Saved::Merged } else { Saved::Whole })
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
    use crate::io::scene_file::Paint;

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
        Document::open(path, std::fs::read_to_string(path).unwrap()).unwrap()
    }

    #[test]
    fn everything_can_be_undone_and_done_again() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        let mut all = vec![document.strokes.clone()];
        let changes = [
            paint(0, 1.0),
            paint(1, 2.0),
            paint(1, 3.0),
            Change::Delete { view: 1, number: 0 },
            Change::Clear { view: 1 },
        ];
        for change in changes {
            assert!(make(&mut document, change));
            all.push(document.strokes.clone());
        }
        for before in all.iter().rev().skip(1) {
            assert!(make(&mut document, Change::Undo));
            assert_eq!(&document.strokes, before);
        }
        assert!(!make(&mut document, Change::Undo) && document.is_saved());
        for after in &all[1..] {
            assert!(make(&mut document, Change::Redo));
            assert_eq!(&document.strokes, after);
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
        assert!(matches!(Document::open(&path, text), Err(Error::Machine(_))));
        let (strokes, journal) = (document.strokes.clone(), std::fs::read(&document.journal_path).unwrap());
        let journal_path = document.journal_path.clone();
        drop(document);
        // Cut off in the middle of a line.
        std::fs::write(&journal_path, [&journal[..], b"{\"type\":\"paint\",\"vi"].concat()).unwrap();
        let (document, brought_back, set_aside) = open(&path);
        assert_eq!((brought_back, set_aside), (4, None));
        assert!(document.strokes == strokes && document.can_undo() && !document.is_saved());
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
        assert!(matches!(document.save(&EXTENT).unwrap(), Saved::Whole));
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
        assert!(matches!(document.save(&EXTENT).unwrap(), Saved::Whole));
        for change in [Change::Undo, Change::Undo, Change::Redo, paint(1, 4.0)] {
            assert!(make(&mut document, change));
        }
        let strokes = document.strokes.clone();
        assert_eq!([strokes[0].len(), strokes[1].len()], [1, 1]);
        drop(document);
        let (document, brought_back, _) = open(&path);
        assert_eq!(brought_back, 4);
        assert_eq!(document.strokes, strokes);
    }

    #[test]
    fn changes_of_another_program_are_kept_beside_ours() {
        let (_folder, path) = scene(TEXT);
        let (mut document, ..) = open(&path);
        assert!(make(&mut document, paint(0, 2.0)) && !document.is_changed_elsewhere());
        // It has changed something else: both are in the file.
        std::fs::write(&path, TEXT.replace("{}", "{ \"size\": 64 }")).unwrap();
        assert!(document.is_changed_elsewhere());
        assert!(matches!(document.save(&EXTENT).unwrap(), Saved::Merged));
        let both = std::fs::read_to_string(&path).unwrap();
        assert!(both.contains("\"size\": 64") && edit::strokes(&both).unwrap()[0].len() == 1);
        // It has painted, too: ours are beside.
        let theirs = TEXT.replace(
            "\"strokes\": []",
            "\"strokes\": [{ \"points\": [[1, 1]], \"radius\": 2, \"color\": \"#00f\" }]",
        );
        std::fs::write(&path, &theirs).unwrap();
        assert!(make(&mut document, paint(1, 5.0)));
        let Saved::Beside(beside) = document.save(&EXTENT).unwrap() else { panic!("theirs are lost") };
        assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
        let ours = edit::strokes(&std::fs::read_to_string(beside).unwrap()).unwrap();
        assert_eq!([ours[0].len(), ours[1].len()], [1, 1]);
        assert!(!document.is_saved());
    }
}
