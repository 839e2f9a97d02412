//! What MTL files say of materials.

use std::path::{Path, PathBuf};

use super::statements::{Statements, name, number, split, words};
use crate::io::film::passing;
use crate::io::input;
use crate::scene::{Glass, Rgb, Wrap, rgb};

/// What is said of a material.
#[derive(Debug, Default)]
pub(super) struct Description {
    /// `Kd`, in [0, 1].
    pub(super) albedo: Option<Rgb>,
    dissolve: Option<f32>,
    transparency: Option<f32>,
    /// `Tf`, in [0, 1].
    filter: Option<Rgb>,
    /// Whether `illum` says that it is glass.
    is_glass: bool,
    /// `map_d`.
    pub(super) opacity_map: Option<OpacityMap>,
}

/// A picture of how opaque a surface is.
#[derive(Debug, PartialEq)]
pub(super) struct OpacityMap {
    pub(super) file: PathBuf,
    pub(super) wrap: Wrap,
}

impl Description {
    /// `d`, else 1 − `Tr`; from 0 to 1.
    pub(super) fn opacity(&self) -> f32 {
        // Some programs write as `Tr` what others write as `d`, and then both.
        self.dissolve.or(self.transparency.map(|hidden| 1.0 - hidden)).unwrap_or(1.0).clamp(0.0, 1.0)
    }

    /// What of it lets light through: what `d` leaves, coloured by `Tf`, else as a film of the diffuse colour; and `Tf` itself where it is
    /// glass by its `illum` and opaque by its `d`. Many programs write a white `Tf` for everything.
    pub(super) fn glass(&self) -> Glass {
        let opacity = self.opacity();
        let filter = self.filter.filter(|filter| *filter != [1.0; 3]);
        let transmittance = match filter {
            Some(filter) if opacity < 1.0 => rgb(|c| (1.0 - opacity) * filter[c]),
            Some(filter) if self.is_glass => filter,
            _ => passing(self.albedo.unwrap_or([1.0; 3]), opacity, 0.0),
        };
        Glass { transmittance, picture: None }
    }
}

/// The materials of an MTL file that lies in `folder`, with their names. Statements that are broken or
/// unknown are passed over.
///
/// Errors: why the bytes are no text.
pub(super) fn parse(bytes: &[u8], folder: &Path) -> Result<Vec<(String, Description)>, &'static str> {
    let mut materials: Vec<(String, Description)> = Vec::new();
    for statement in Statements::new(bytes)? {
        let (word, rest) = statement.parts();
        if word == b"newmtl" {
            materials.push((name(rest), Description::default()));
        } else if let Some((_, material)) = materials.last_mut() {
            match word {
                b"Kd" => material.albedo = color(rest),
                // `d -halo 0.5` is less opaque where a surface is seen from the front.
                b"d" => material.dissolve = finite(rest.strip_prefix(b"-halo").unwrap_or(rest)),
                b"Tf" => material.filter = color(rest),
                b"illum" => {
                    material.is_glass = finite(rest).is_some_and(|it| [4.0, 6.0, 7.0, 9.0].contains(&it))
                }
                b"Tr" => material.transparency = finite(rest),
                b"map_d" => material.opacity_map = opacity_map(rest, folder),
                _ => {}
            }
        }
    }
    Ok(materials)
}

fn finite(text: &[u8]) -> Option<f32> {
    words(text).next().and_then(number).map(|number| number as f32).filter(|number| number.is_finite())
}

/// Three numbers, or one for all three.
fn color(text: &[u8]) -> Option<Rgb> {
    let numbers: Option<Vec<f32>> = words(text).take(3).map(finite).collect();
    match numbers?[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
    .map(|color| color.map(|c| c.clamp(0.0, 1.0)))
}

/// Options and a name, which may have blanks in it. Of the options `-clamp` alone matters.
fn opacity_map(text: &[u8], folder: &Path) -> Option<OpacityMap> {
    let (mut rest, mut wrap) = (text, Wrap::Repeat);
    loop {
        let (option, mut after) = split(rest);
        let (least, most) = match option {
            b"-o" | b"-s" | b"-t" => (1, 3),
            b"-mm" => (2, 2),
            b"-blendu" | b"-blendv" | b"-bm" | b"-boost" | b"-cc" | b"-clamp" | b"-imfchan" | b"-texres" => {
                (1, 1)
            }
            _ => break,
        };
        if option == b"-clamp" && split(after).0 == b"on" {
            wrap = Wrap::Clamp;
        }
        for taken in 0..most {
            let (value, further) = split(after);
            if taken >= least && number(value).is_none() {
                break;
            }
            after = further;
        }
        rest = after;
    }
    (!rest.is_empty()).then(|| OpacityMap { file: beside(folder, rest), wrap })
}

/// A file by its name as other programs write it: in quotation marks, or with the separators of another
/// system.
pub(super) fn beside(folder: &Path, text: &[u8]) -> PathBuf {
    let name = name(text);
    let name = name.trim_matches('"');
    // What is in the network is not here, as what is missing.
    input::named(folder, name).unwrap_or_else(|_| folder.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn only(text: &str) -> Description {
        parse(format!("newmtl a\n{text}").as_bytes(), Path::new("dir")).unwrap().pop().unwrap().1
    }

    #[test]
    fn a_material_is_as_opaque_as_d_says_or_tr_leaves() {
        for (text, expected) in [
            ("", 1.0),
            ("d 0.25", 0.25),
            ("Tr 0.25", 0.75),
            ("d 1\nTr 1", 1.0),
            ("Tr 0.5\nd 0", 0.0),
            ("d -halo 0.5 # soft", 0.5),
            ("d nan", 1.0),
            ("d", 1.0),
            ("d 7", 1.0),
            ("Tr 1e99", 1.0),
        ] {
            assert_eq!(only(text).opacity(), expected, "{text}");
        }
    }

    #[test]
    fn colours_are_three_numbers_or_one() {
        for (text, expected) in [
            ("Kd 0.1 0.8 7", Some([0.1, 0.8, 1.0])),
            ("Kd \\\n0.5 # grey", Some([0.5; 3])),
            ("Kd 0.1 0.2", None),
            ("Kd 0.1 nan 0.2", None),
            ("Kd spectral a.rfl", None),
            ("Ns 3", None),
        ] {
            assert_eq!(only(text).albedo, expected, "{text}");
        }
    }

    #[test]
    fn pictures_have_options_and_names_with_blanks() {
        let repeated =
            ["map_d -s 1 1 1 -o 0.5 -mm 0 1 -imfchan m leaf one.png", "map_d \"leaf one.png\" # x"];
        for text in repeated {
            let expected = OpacityMap { file: Path::new("dir").join("leaf one.png"), wrap: Wrap::Repeat };
            assert_eq!(only(text).opacity_map, Some(expected), "{text}");
        }
        // Nothing is there: the name stays as it is written.
        let clamped = OpacityMap { file: Path::new("dir").join("t\\a.png"), wrap: Wrap::Clamp };
        assert_eq!(only("map_d -clamp on t\\a.png").opacity_map, Some(clamped));
        assert_eq!(only("map_d -clamp on").opacity_map, None);
        assert_eq!(only("map_d").opacity_map, None);
    }
}
