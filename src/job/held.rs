//! What a folder of results holds: which command has put what there, of which scene.
//!
//! It lies beside the results, and with results that are made and not yet moved out: then it says that they are whole, so that
//! whoever has the folder next can finish what a killed run began.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Error, Result, io};

/// The file's name.
pub(super) const HELD: &str = ".unscatter-results";

/// Files in a folder.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Held {
    /// The scene's name.
    scene: String,
    /// The names of the files that a command has written.
    results: BTreeMap<String, BTreeSet<String>>,
    /// Files that are to go when those that were made have come.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub(super) obsolete: BTreeSet<String>,
}

/// Whose results are written.
#[derive(Debug, Clone)]
pub(super) struct Owner {
    pub(super) command: &'static str,
    pub(super) scene: String,
}

impl Held {
    /// What is said in a folder; nothing where nothing is said that can be read.
    pub(super) fn of(folder: &Path) -> Option<Self> {
        let text = std::fs::read(folder.join(HELD)).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// All files.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.results.values().flatten().map(String::as_str)
    }

    /// What an owner has written so far.
    pub(super) fn of_owner(&self, owner: &Owner) -> BTreeSet<String> {
        let of_scene = if self.scene == owner.scene { self.results.get(owner.command) } else { None };
        of_scene.cloned().unwrap_or_default()
    }

    /// With further files of an owner.
    pub(super) fn with(mut self, owner: &Owner, made: &BTreeSet<String>) -> Self {
        self.obsolete.clear();
        self.results.entry(owner.command.to_owned()).or_default().extend(made.iter().cloned());
        self
    }

    /// Where nothing else is to come from an owner but what it has written in all: the files of other scenes go, and those
    /// that it wrote before and has not written again.
    pub(super) fn only(mut self, owner: &Owner, written: &BTreeSet<String>) -> Self {
        let before: BTreeSet<String> = match self.scene == owner.scene {
            true => self.results.remove(owner.command).unwrap_or_default(),
            false => std::mem::take(&mut self.results).into_values().flatten().collect(),
        };
        self.scene.clone_from(&owner.scene);
        self.results.insert(owner.command.to_owned(), written.clone());
        // Several commands may write the same file.
        let still: BTreeSet<&String> = self.results.values().flatten().collect();
        self.obsolete = before.into_iter().filter(|name| !still.contains(name)).collect();
        self
    }

    /// Says so in a folder. Errors: [`Error::File`].
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_vec(self).map_err(|error| Error::Machine(error.to_string()))?;
        let path = folder.join(HELD);
        io::write_whole(&path, |file| {
            file.write_all(&text).map_err(|source| Error::File {
                action: "write",
                path: path.clone(),
                source,
            })
        })
    }
}
