//! Cameras of many pictures of one thing: the `transforms.json` of NeRF, instant-ngp and nerfstudio.
//!
//! A camera looks along its -z axis with +y up, as cameras do here. Keys that say nothing about a camera are passed over,
//! as the files of other programs are full of them; keys that say of a camera what a pinhole cannot do are errors.

#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::DAffine3;
use serde::Deserialize;

use super::numbers::affine_of_rows;
use crate::{Error, Result};

/// Bytes of a file at most; a frame takes about 500.
const MAX_BYTES: u64 = 64 << 20;
/// Pixels along a side at most.
const MAX_SIDE: f64 = 65536.0;

/// One picture and the camera that took it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// The picture. Whether it is there has not been looked at.
    pub file: PathBuf,
    /// Metres of the world from those of the camera, which looks along -z with +y up. It may scale; cameras ignore that.
    pub world_from_camera: DAffine3,
    /// Field of view along the width, in degrees, between 0 and 180.
    pub fov_x: f64,
    /// Width and height in pixels, where the file says them.
    pub size: Option<[usize; 2]>,
    /// Picture of where the thing is (white) and where not (black).
    pub mask: Option<PathBuf>,
    /// Picture of distances.
    pub depth: Option<PathBuf>,
}

/// Reads the shots in the order of the file.
///
/// Paths in the file begin at its folder. A `file_path` that has no extension and does not exist gets `.png`, which the
/// files of the original NeRF leave out. What a frame says of its lens goes before what is said for all frames, and a
/// focal length before an angle.
///
/// Errors: [`Error::File`]; [`Error::Format`] naming the frame, when it is no such file or longer than 64 MiB, has no
/// frames, or a frame has no `file_path`, no usable `transform_matrix`, no field of view, or a lens that no pinhole has:
/// distorted, with its axis more than a pixel off the centre, or with pixels that are not square.
pub fn read(path: &Path) -> Result<Vec<Shot>> {
    let document = parse(path)?;
    if document.frames.is_empty() {
        return Err(wrong(path, "it has no `frames`"));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let shots = document.frames.iter().enumerate().map(|(index, frame)| {
        let shot = frame.shot(folder, &document.lens);
        shot.map_err(|problem| wrong(path, format!("frames[{index}]: {problem}")))
    });
    shots.collect()
}

fn parse(path: &Path) -> Result<TransformsDocument> {
    let refused = |source| Error::File { action: "read", path: path.to_owned(), source };
    let about = std::fs::metadata(path).map_err(refused)?;
    if !about.is_file() {
        return Err(wrong(path, "it is a folder or a device"));
    }
    if about.len() > MAX_BYTES {
        return Err(wrong(path, format!("it has {} bytes, and {MAX_BYTES} are the most", about.len())));
    }
    let mut text = Vec::new();
    File::open(path).and_then(|file| file.take(MAX_BYTES).read_to_end(&mut text)).map_err(refused)?;
    serde_json::from_slice(&text).map_err(|error| wrong(path, error.to_string()))
}

fn wrong(path: &Path, reason: impl Into<String>) -> Error {
    Error::Format { path: path.to_owned(), format: "transforms", reason: reason.into() }
}

#[derive(Deserialize)]
struct TransformsDocument {
    #[serde(flatten)]
    lens: Lens,
    #[serde(default)]
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: Option<String>,
    mask_path: Option<String>,
    depth_file_path: Option<String>,
    transform_matrix: Option<Vec<Vec<f64>>>,
    #[serde(flatten)]
    lens: Lens,
}

impl Frame {
    fn shot(&self, folder: &Path, of_all: &Lens) -> Result<Shot, String> {
        let name = self.file_path.as_ref().filter(|name| !name.is_empty()).ok_or("it has no `file_path`")?;
        let beside = |name: &Option<String>| name.as_ref().map(|name| folder.join(name));
        let lens = self.lens.over(of_all);
        Ok(Shot {
            file: picture(folder, name),
            world_from_camera: self.world_from_camera()?,
            fov_x: lens.fov_x()?,
            size: lens.size()?,
            mask: beside(&self.mask_path),
            depth: beside(&self.depth_file_path),
        })
    }

    fn world_from_camera(&self) -> Result<DAffine3, String> {
        let rows = self.transform_matrix.as_ref().ok_or("it has no `transform_matrix`")?;
        let rows: Option<Vec<[f64; 4]>> = rows.iter().map(|row| row.as_slice().try_into().ok()).collect();
        let rows: [[f64; 4]; 4] = rows
            .and_then(|rows| rows.try_into().ok())
            .ok_or("its `transform_matrix` does not have four rows of four numbers")?;
        affine_of_rows(&rows).map_err(|problem| format!("its `transform_matrix` {problem}"))
    }
}

/// The file of a picture, whose name the original NeRF writes without its extension.
fn picture(folder: &Path, name: &str) -> PathBuf {
    let plain = folder.join(name);
    if plain.extension().is_some() || plain.is_file() {
        return plain;
    }
    let mut longer = plain.into_os_string();
    longer.push(".png");
    longer.into()
}

/// What is said of a lens. Lengths are in pixels, angles in radians.
#[derive(Debug, Clone, Default, Deserialize)]
struct Lens {
    camera_angle_x: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    is_fisheye: Option<bool>,
    camera_model: Option<String>,
}

impl Lens {
    /// What `self` says, and what `base` says where it is silent.
    fn over(&self, base: &Self) -> Self {
        // A focal length or an angle of one picture replaces all that is said of both for the others.
        let says_fov = self.fl_x.is_some() || self.camera_angle_x.is_some();
        let fov = if says_fov { self } else { base };
        Self {
            camera_angle_x: fov.camera_angle_x,
            fl_x: fov.fl_x,
            fl_y: if says_fov { self.fl_y } else { self.fl_y.or(base.fl_y) },
            w: self.w.or(base.w),
            h: self.h.or(base.h),
            cx: self.cx.or(base.cx),
            cy: self.cy.or(base.cy),
            k1: self.k1.or(base.k1),
            k2: self.k2.or(base.k2),
            k3: self.k3.or(base.k3),
            k4: self.k4.or(base.k4),
            p1: self.p1.or(base.p1),
            p2: self.p2.or(base.p2),
            is_fisheye: self.is_fisheye.or(base.is_fisheye),
            camera_model: self.camera_model.clone().or_else(|| base.camera_model.clone()),
        }
    }

    fn size(&self) -> Result<Option<[usize; 2]>, String> {
        let side = |name: &str, side: Option<f64>| match side {
            Some(side) if !(side.fract() == 0.0 && (1.0..=MAX_SIDE).contains(&side)) => {
                Err(format!("`{name}` is {side} instead of a number of pixels from 1 to {MAX_SIDE}"))
            }
            side => Ok(side.map(|side| side as usize)),
        };
        let (width, height) = (side("w", self.w)?, side("h", self.h)?);
        Ok(width.zip(height).map(|(width, height)| [width, height]))
    }

    /// In degrees.
    fn fov_x(&self) -> Result<f64, String> {
        self.check_pinhole()?;
        self.check_centre()?;
        let fov_x = match (self.fl_x, self.w, self.camera_angle_x) {
            (Some(fl_x), Some(width), _) => 2.0 * (0.5 * width / fl_x).atan(),
            (_, _, Some(angle)) => angle,
            _ => return Err("neither `camera_angle_x` nor `fl_x` with `w` says its field of view".to_owned()),
        };
        self.check_square_pixels(fov_x)?;
        let fov_x = fov_x.to_degrees();
        if !(fov_x > 0.0 && fov_x < 180.0) {
            return Err(format!("its field of view is {fov_x}°, which is not between 0 and 180"));
        }
        Ok(fov_x)
    }

    fn check_pinhole(&self) -> Result<(), String> {
        // With coefficients of zero, these are pinholes.
        const PINHOLES: [&str; 6] =
            ["PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "SIMPLE_RADIAL", "RADIAL"];
        let model = self.camera_model.as_deref().unwrap_or(PINHOLES[0]);
        if self.is_fisheye == Some(true) || !PINHOLES.iter().any(|name| name.eq_ignore_ascii_case(model)) {
            return Err(format!("its camera is a fisheye or `{}`, not a pinhole", model.escape_debug()));
        }
        let coefficients = [
            ("k1", self.k1),
            ("k2", self.k2),
            ("k3", self.k3),
            ("k4", self.k4),
            ("p1", self.p1),
            ("p2", self.p2),
        ];
        match coefficients.into_iter().find(|(_, value)| value.unwrap_or(0.0) != 0.0) {
            Some((name, _)) => {
                Err(format!("`{name}` is not 0: undistort the pictures, lens distortion is not supported"))
            }
            None => Ok(()),
        }
    }

    fn check_centre(&self) -> Result<(), String> {
        let sides = [("cx", self.cx, "w", self.w), ("cy", self.cy, "h", self.h)];
        for (name, centre, side_name, side) in sides {
            match (centre, side) {
                (None, _) => {}
                (Some(_), None) => return Err(format!("`{name}` says nothing without `{side_name}`")),
                (Some(centre), Some(side)) if (centre - 0.5 * side).abs() <= 1.0 => {}
                (Some(centre), Some(side)) => {
                    return Err(format!(
                        "`{name}` is {centre}, more than a pixel from the centre {}: shifted principal points are \
                         not supported",
                        0.5 * side
                    ));
                }
            }
        }
        Ok(())
    }

    fn check_square_pixels(&self, fov_x: f64) -> Result<(), String> {
        let of_angle = self.w.map(|width| 0.5 * width / (0.5 * fov_x).tan());
        match (self.fl_x.or(of_angle), self.fl_y) {
            (Some(fl_x), Some(fl_y)) if (fl_x - fl_y).abs() > 1e-3 * fl_x.abs() => Err(format!(
                "its focal lengths {fl_x} and {fl_y} differ: pixels that are not square are not supported"
            )),
            _ => Ok(()),
        }
    }
}
