//! Cameras of many pictures of one thing: the `transforms.json` of NeRF, instant-ngp and nerfstudio.
//!
//! A camera looks along its -z axis with +y up, as cameras do here. Keys that say nothing about a camera are passed over,
//! as the files of other programs are full of them.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use glam::DAffine3;
use serde::Deserialize;

use super::numbers::affine_of_rows;
use super::{image, input};
use crate::scene::{Camera, FovAxis, Lens, Projection};
use crate::{Error, Result};

/// What such a file is called.
const FORMAT: &str = "transforms";
/// Bytes of a file at most; a frame takes about 500.
const MAX_BYTES: u64 = 64 << 20;
/// Pixels along a side at most.
const MAX_SIDE: f64 = 65536.0;
/// How names of pictures end that are written without their ends, the likeliest first.
const ENDS: [&str; 5] = ["png", "jpg", "jpeg", "exr", "hdr"];

/// One picture and the camera that took it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// The picture. Whether it is there has not been looked at.
    pub file: PathBuf,
    /// Metres of the world from those of the camera, which looks along -z with +y up. It may scale; cameras ignore that.
    pub world_from_camera: DAffine3,
    /// Field of view along the width, in degrees, between 0 and 180; of a fisheye without meaning.
    pub fov_x: f64,
    /// The lens, where it is not that of a pinhole before the middle of square pixels.
    pub lens: Option<Lens>,
    /// Width and height in pixels, where the file says them.
    pub size: Option<[usize; 2]>,
    /// Picture of where the thing is (white) and where not (black).
    pub mask: Option<PathBuf>,
    /// Picture of distances.
    pub depth: Option<PathBuf>,
}

impl Shot {
    /// Its camera, before a picture of `size` pixels, width first.
    ///
    /// Errors: those of [`Camera::new`] and [`Camera::with_lens`].
    pub fn camera(&self, size: [usize; 2]) -> Result<Camera> {
        match self.lens {
            None => Camera::new(self.world_from_camera, self.fov_x, FovAxis::X, size),
            Some(lens) => Camera::with_lens(self.world_from_camera, lens, size),
        }
    }
}

/// Reads the shots in the order of the file.
///
/// Paths in the file begin at its folder. A `file_path` that does not exist is tried with the ends of pictures, which some
/// files leave out. Where `w` and `h` count and are not said, they are those of the picture. What a frame says of its lens goes before what is said for all frames, and a focal length before an angle.
/// Distortion is that of OpenCV, of perspective lenses (k1 to k4, p1, p2) and of fisheyes (k1 to k4).
///
/// Errors: [`Error::File`]; [`Error::TooLarge`] beyond 64 MiB; [`Error::Format`] naming the frame, when it is no such file, has no
/// frames, or a frame has no `file_path`, no usable `transform_matrix`, no field of view, or another kind of lens.
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
    let text = input::text(path, MAX_BYTES, FORMAT)?;
    serde_json::from_str(&text).map_err(|error| wrong(path, error.to_string()))
}

fn wrong(path: &Path, reason: impl Into<String>) -> Error {
    Error::Format { path: path.to_owned(), format: FORMAT, reason: reason.into() }
}

#[derive(Deserialize)]
struct TransformsDocument {
    #[serde(flatten)]
    lens: LensKeys,
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
    lens: LensKeys,
}

impl Frame {
    fn shot(&self, folder: &Path, of_all: &LensKeys) -> Result<Shot, String> {
        let name = self.file_path.as_ref().filter(|name| !name.is_empty()).ok_or("it has no `file_path`")?;
        let file = picture(folder, name)?;
        let beside = |name: &Option<String>| name.as_ref().map(|name| named(folder, name)).transpose();
        let lens = self.lens.over(of_all).sized(&file)?;
        Ok(Shot {
            file,
            world_from_camera: self.world_from_camera()?,
            fov_x: lens.fov_x()?,
            lens: lens.lens()?,
            size: lens.size()?,
            mask: beside(&self.mask_path)?,
            depth: beside(&self.depth_file_path)?,
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

/// The file of a picture, whose name some programs write without its end.
fn picture(folder: &Path, name: &str) -> Result<PathBuf, String> {
    let plain = named(folder, name)?;
    if plain.is_file() {
        return Ok(plain);
    }
    let longer = ENDS.iter().map(|end| named(folder, &format!("{name}.{end}")));
    let found = longer.collect::<Result<Vec<_>, _>>()?.into_iter().find(|path| path.is_file());
    let has_end = plain.extension().is_some_and(|own| ENDS.iter().any(|end| own.eq_ignore_ascii_case(end)));
    Ok(match found {
        Some(found) => found,
        None if has_end => plain,
        None => named(folder, &format!("{name}.{}", ENDS[0]))?,
    })
}

fn named(folder: &Path, name: &str) -> Result<PathBuf, String> {
    input::named(folder, name).map_err(|error| match error {
        Error::Value { value, expected, .. } => format!("it names {value}, which must be {expected}"),
        other => other.to_string(),
    })
}

/// What is said of a lens. Lengths are in pixels, angles in radians.
#[derive(Debug, Clone, Default, Deserialize)]
struct LensKeys {
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
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

impl LensKeys {
    /// What `self` says, and what `base` says where it is silent.
    fn over(&self, base: &Self) -> Self {
        // A focal length or an angle of one picture replaces all that is said of both for the others.
        let says_fov = self.fl_x.is_some() || self.camera_angle_x.is_some();
        let fov = if says_fov { self } else { base };
        Self {
            camera_angle_x: fov.camera_angle_x,
            fl_x: fov.fl_x,
            camera_angle_y: fov.camera_angle_y,
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

    fn is_bent(&self) -> Result<bool, String> {
        let bends = [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2];
        Ok(self.projection()? == Projection::Equidistant || bends.iter().flatten().any(|bend| *bend != 0.0))
    }

    /// Whether it is more than a field of view along the width, so that width and height count.
    fn needs_sides(&self) -> Result<bool, String> {
        let has_more = [self.cx, self.cy, self.fl_y].iter().any(Option::is_some);
        Ok(self.is_bent()? || has_more || self.fl_x.is_none() && self.camera_angle_y.is_some())
    }

    /// With the width and height of its picture, where they count and are not said.
    fn sized(self, picture: &Path) -> Result<Self, String> {
        let needs_both = self.needs_sides()?;
        let needs_width = needs_both || self.fl_x.is_some() && self.camera_angle_x.is_none();
        if (self.w.is_some() || !needs_width) && (self.h.is_some() || !needs_both) {
            return Ok(self);
        }
        let size = image::size_of(picture).map_err(|error| format!("it has no `w` and `h`, and {error}"))?;
        let [width, height] = size.map(|side| side as f64);
        Ok(Self { w: self.w.or(Some(width)), h: self.h.or(Some(height)), ..self })
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
        let fov_x = match (self.fl_x, self.w, self.camera_angle_x) {
            (Some(fl_x), Some(width), _) => 2.0 * (0.5 * width / fl_x).atan(),
            (_, _, Some(angle)) => angle,
            _ => return Err("neither `camera_angle_x` nor `fl_x` with `w` says its field of view".to_owned()),
        };
        let fov_x = fov_x.to_degrees();
        if !(fov_x > 0.0 && fov_x < 180.0) {
            return Err(format!("its field of view is {fov_x}°, which is not between 0 and 180"));
        }
        Ok(fov_x)
    }

    fn projection(&self) -> Result<Projection, String> {
        const PERSPECTIVE: [&str; 6] =
            ["PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "SIMPLE_RADIAL", "RADIAL"];
        const FISHEYE: [&str; 3] = ["OPENCV_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE"];
        let model = self.camera_model.as_deref().unwrap_or(PERSPECTIVE[0]);
        let is_one_of = |models: &[&str]| models.iter().any(|name| name.eq_ignore_ascii_case(model));
        if is_one_of(&FISHEYE) || self.is_fisheye == Some(true) && is_one_of(&PERSPECTIVE) {
            return Ok(Projection::Equidistant);
        }
        if is_one_of(&PERSPECTIVE) {
            return Ok(Projection::Perspective);
        }
        let known = [&PERSPECTIVE[..], &FISHEYE[..]].concat().join(", ");
        Err(format!("its camera is `{}`, which is none of {known}", model.escape_debug()))
    }

    /// The lens; none where it is a pinhole before the middle of square pixels.
    fn lens(&self) -> Result<Option<Lens>, String> {
        let (projection, needs_sides) = (self.projection()?, self.needs_sides()?);
        let radial = [self.k1, self.k2, self.k3, self.k4].map(|k| k.unwrap_or(0.0));
        let tangential = [self.p1, self.p2].map(|p| p.unwrap_or(0.0));
        if projection == Projection::Equidistant && tangential != [0.0; 2] {
            return Err("`p1` and `p2` mean nothing of a fisheye".to_owned());
        }
        let Some((width, height)) = self.w.zip(self.h).filter(|_| needs_sides) else { return Ok(None) };
        let by_angle = |angle: f64, side: f64| 0.5 * side / (0.5 * angle).tan();
        let fl_x = self.fl_x.or(self.camera_angle_x.map(|angle| by_angle(angle, width)));
        let fl_x = fl_x.ok_or("neither `camera_angle_x` nor `fl_x` says its focal length")?;
        let fl_y = match (self.fl_y, self.fl_x, self.camera_angle_y) {
            (Some(fl_y), ..) => fl_y,
            // Without focal lengths the angles say them.
            (None, None, Some(angle)) => by_angle(angle, height),
            _ => fl_x,
        };
        let centre = [self.cx.unwrap_or(0.5 * width), self.cy.unwrap_or(0.5 * height)];
        let is_middle = |centre: f64, side: f64| (centre - 0.5 * side).abs() <= 1e-9 * side;
        let is_centred = is_middle(centre[0], width) && is_middle(centre[1], height);
        // Angles have some rounding.
        let is_square = (fl_x - fl_y).abs() <= 1e-9 * fl_x.abs();
        if !self.is_bent()? && is_centred && is_square {
            return Ok(None);
        }
        Ok(Some(Lens { projection, radial, tangential, ..Lens::new([fl_x, fl_y], centre) }))
    }
}
