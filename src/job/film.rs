//! The frames of an animation, drawn and written one after the other.

use std::ops::RangeInclusive;

use super::folder::Folder;
use super::steps::Steps;
use crate::scene::Image;
use crate::{Error, Result};

/// Pictures in the strip of the report at most.
const STRIP: usize = 12;
/// The longer side of a picture in the strip at most.
const LONGEST: usize = 320;

/// What the files of a frame begin with.
pub(crate) fn of_frame(kind: &str, frame: usize) -> String {
    format!("{kind}_{frame:04}_")
}

/// The frames that are to be drawn, of so many.
pub(super) fn asked(frames: Option<RangeInclusive<usize>>, count: usize) -> Result<Vec<usize>> {
    let frames = frames.unwrap_or(0..=count.saturating_sub(1));
    if *frames.end() >= count {
        let given = format!("{}..{}", frames.start(), frames.end());
        return Err(Error::value("frames", given, "within the frames of the animation, which begin with 0"));
    }
    Ok(frames.collect())
}

/// What frames are drawn from.
pub(super) trait Film {
    /// How many frames the animation has.
    fn count(&self) -> usize;

    /// The names of the views.
    fn views(&self) -> Vec<String>;

    /// Stops by which pictures are brightened, the same for all frames.
    fn exposure(&self) -> f64;

    /// The pictures of a frame, one a view; what else there is of it is written. None of a frame between keys after somebody stopped the job.
    fn frame(&mut self, frame: usize, folder: &Folder, steps: &mut Steps<'_>) -> Result<Option<Vec<Image>>>;
}

/// Draws and writes frames, after Ctrl-C only keys, and puts some of them into the strip. Gives back how many were drawn.
pub(super) fn write_frames(
    film: &mut dyn Film,
    frames: &[usize],
    folder: &Folder,
    strip: &mut Vec<(u64, Vec<u8>)>,
    steps: &mut Steps<'_>,
) -> Result<usize> {
    let (views, exposure) = (film.views(), film.exposure());
    let every = frames.len().div_ceil(STRIP).max(1);
    let mut drawn = 0;
    for (index, &frame) in frames.iter().enumerate() {
        steps.within(format!("frame {frame} of {}", film.count()));
        let Some(pictures) = film.frame(frame, folder, steps)? else { continue };
        for (view, picture) in views.iter().zip(&pictures) {
            folder.write_picture(&format!("{}{view}", of_frame("frame", frame)), picture, exposure)?;
        }
        folder.publish()?;
        drawn += 1;
        if index % every == 0
            && let Some(picture) = pictures.first()
        {
            strip.push((frame as u64, small_png(picture, exposure)?));
        }
    }
    steps.within(String::new());
    Ok(drawn)
}

/// A picture as PNG. A large one is shrunk: each pixel is the mean of a block.
fn small_png(picture: &Image, exposure: f64) -> Result<Vec<u8>> {
    let [width, height] = picture.size();
    let side = width.max(height).div_ceil(LONGEST).max(1);
    let size = [width.div_ceil(side), height.div_ceil(side)];
    let mean = |index: usize| {
        let (left, top) = (index % size[0] * side, index / size[0] * side);
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for y in top..(top + side).min(height) {
            for x in left..(left + side).min(width) {
                let pixel = picture.at(x, y);
                (0..3).for_each(|c| sum[c] += pixel[c]);
                count += 1.0;
            }
        }
        sum.map(|value: f32| value / count)
    };
    let small = Image::new(size, (0..size[0] * size[1]).map(mean).collect())?;
    crate::io::image::png_bytes(&small, exposure)
}
