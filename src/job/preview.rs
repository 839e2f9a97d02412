//! Views at the size of previews.

use glam::DAffine3;

use crate::Result;
use crate::scene::{Image, RgbaImage, Stroke, View, VolumeView};

/// How large the pictures of a live job are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preview {
    /// As the scene has them.
    Full,
    /// At most so many pixels wide.
    Width(usize),
}

/// A view whose picture is no wider than the preview.
pub(super) fn seen_at(view: &View, preview: Preview) -> Result<View> {
    let [width, height] = view.camera.size();
    let to = match preview {
        Preview::Width(to) if to < width => to.max(1),
        _ => return Ok(view.clone()),
    };
    let scale = to as f32 / width as f32;
    let size = [to, ((height as f32 * scale).round() as usize).max(1)];
    Ok(View {
        name: view.name.clone(),
        camera: view.camera.moved(DAffine3::IDENTITY, size)?,
        strokes: view.strokes.iter().cloned().map(|stroke| scaled(stroke, scale)).collect(),
        layers: view.layers.iter().map(|layer| shrunk(layer, size)).collect(),
        keep: view.keep,
    })
}

/// A stroke on a picture of another size.
pub(super) fn scaled(stroke: Stroke, scale: f32) -> Stroke {
    Stroke {
        points: stroke.points.iter().map(|point| point.map(|x| x * scale)).collect(),
        radius: stroke.radius * scale,
        ..stroke
    }
}

/// A painted layer of another size: each pixel the mean of those that it covers, colours weighted by their alpha.
fn shrunk(layer: &RgbaImage, [width, height]: [usize; 2]) -> RgbaImage {
    let [full_width, full_height] = layer.size();
    let mut small = RgbaImage::transparent([width, height]);
    for (index, pixel) in small.pixels.iter_mut().enumerate() {
        let (x, y) = (index % width, index / width);
        let span = |at: usize, of: usize, all: usize| {
            let first = at * all / of;
            first..((at + 1) * all / of).max(first + 1)
        };
        let (mut sum, mut count) = ([0.0f64; 4], 0.0);
        for v in span(y, height, full_height) {
            for u in span(x, width, full_width) {
                let [r, g, b, a] = layer.pixels[v * full_width + u].map(f64::from);
                sum = [sum[0] + r * a, sum[1] + g * a, sum[2] + b * a, sum[3] + a];
                count += 1.0;
            }
        }
        let [r, g, b, a] = sum;
        if a > 0.0 {
            *pixel = [r / a, g / a, b / a, a / count].map(|value| value as f32);
        }
    }
    small
}

/// The same of a view of a volume, with its pictures.
pub(super) fn volume_seen_at(view: &VolumeView, preview: Preview) -> Result<VolumeView> {
    let small = seen_at(&view.view, preview)?;
    let (size, full) = (small.camera.size(), view.view.camera.size());
    if size == full {
        return Ok(view.clone());
    }
    let opaque = |image: &Image| {
        let pixels = image.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        RgbaImage::new(full, pixels)
    };
    let background = view.background.as_ref().map(|image| {
        let small = shrunk(&opaque(image)?, size);
        Image::new(size, small.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect())
    });
    // Seen where at least half of it is.
    let mask = view.mask.as_ref().map(|mask| {
        let pixels = mask.iter().map(|&is_seen| [0.0, 0.0, 0.0, if is_seen { 1.0 } else { 0.0 }]).collect();
        RgbaImage::new(full, pixels).map(|mask| shrunk(&mask, size))
    });
    let mask = mask.transpose()?.map(|mask| mask.pixels.iter().map(|pixel| pixel[3] >= 0.5).collect());
    Ok(VolumeView {
        view: small,
        picture: view.picture.as_ref().map(|picture| shrunk(picture, size)),
        mask,
        background: background.transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, FovAxis};

    #[test]
    fn pictures_of_a_volume_shrink_with_their_view() {
        let size = [8, 4];
        let camera = Camera::new(DAffine3::IDENTITY, 40.0, FovAxis::Y, size).unwrap();
        let view = View { name: "a".to_owned(), camera, strokes: Vec::new(), layers: Vec::new(), keep: 0.0 };
        let left = |index: usize| index % 8 < 4;
        let picture = (0..32).map(|k| if left(k) { [1.0, 0.5, 0.0, 1.0] } else { [9.0, 9.0, 9.0, 0.0] });
        let view = VolumeView {
            view,
            picture: Some(RgbaImage::new(size, picture.collect()).unwrap()),
            mask: Some((0..32).map(left).collect()),
            background: Some(Image::new(size, (0..32).map(|k| [(k % 8) as f32; 3]).collect()).unwrap()),
        };
        let small = volume_seen_at(&view, Preview::Width(4)).unwrap();
        assert_eq!(small.view.camera.size(), [4, 2]);
        assert_eq!(small.mask.unwrap(), [true, true, false, false, true, true, false, false]);
        let picture = small.picture.unwrap();
        assert_eq!(picture.pixels[..3], [[1.0, 0.5, 0.0, 1.0], [1.0, 0.5, 0.0, 1.0], [0.0; 4]]);
        let background = small.background.unwrap();
        assert_eq!(background.pixels.iter().map(|p| p[0]).collect::<Vec<_>>()[..4], [0.5, 2.5, 4.5, 6.5]);
        let same = volume_seen_at(&view, Preview::Full).unwrap();
        assert_eq!(same.mask, view.mask);
    }
}
