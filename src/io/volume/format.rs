use std::path::Path;

use crate::{Error, Result};

/// The formats of volumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// A NumPy array of the shape (z, y, x) or (z, y, x, channel). It has no place in the world.
    Npy,
    /// NumPy arrays in a zip archive, beside the matrix `world_from_grid`.
    Npz,
    /// A grid volume of Mitsuba, version 3. Its place is a box along the axes.
    Vol,
    /// A JSON header, and beside it a file of nothing but numbers.
    Raw,
    /// OpenVDB.
    Vdb,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Npy, Self::Npz, Self::Vol, Self::Raw, Self::Vdb];

    /// How the names of such files end, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Vol => "vol",
            Self::Raw => "json",
            Self::Vdb => "vdb",
        }
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npy => "NumPy",
            Self::Npz => "NPZ",
            Self::Vol => "Mitsuba volume",
            Self::Raw => "raw volume",
            Self::Vdb => "OpenVDB",
        }
    }

    /// The format that the extension of a file stands for, in capitals or not.
    ///
    /// Errors: [`Error::Format`] naming the extensions there are.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default();
        let is_named = |format: &Self| extension.eq_ignore_ascii_case(format.extension());
        Self::ALL.into_iter().find(is_named).ok_or_else(|| Error::Format {
            path: path.to_owned(),
            format: "volume",
            reason: "its name must end in .npy, .npz, .vol, .json (the header of a raw file) or .vdb"
                .to_owned(),
        })
    }
}
