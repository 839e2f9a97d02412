//! Layers of transfer functions, as texels.

use crate::Result;
use crate::problem::diffusion::{Known, diffuse};
use crate::scene::{Blend, LayerKind, Rgb, RgbaImage, TransferPoint, rgb};
use crate::solve::Limits;

/// How far the diffusion of points is computed: iterations, and the residual relative to that at its start.
const LIMITS: (usize, f64) = (100_000, 1e-8);

/// What a layer shows at each texel: straight colour and alpha.
pub(super) fn layer(
    shows: &LayerKind,
    size: [usize; 2],
    place: &dyn Fn(&TransferPoint) -> [f64; 2],
) -> Result<Vec<[f32; 4]>> {
    let opaque = |[r, g, b]: Rgb| [r, g, b, 1.0];
    let texels = || (0..size[0] * size[1]).map(|texel| [texel % size[0], texel / size[0]]);
    let middle = |texel: [usize; 2], axis: usize| (texel[axis] as f64 + 0.5) / size[axis] as f64;
    Ok(match shows {
        LayerKind::Solid(color) => vec![opaque(*color); size[0] * size[1]],
        LayerKind::Gradient { axis, ends: [from, to] } => texels()
            .map(|texel| {
                let part = middle(texel, *axis) as f32;
                opaque(rgb(|c| from[c] + part * (to[c] - from[c])))
            })
            .collect(),
        LayerKind::Picture(picture) => {
            texels().map(|texel| looked_up(picture, [0, 1].map(|axis| middle(texel, axis)))).collect()
        }
        LayerKind::Diffusion(points) => diffused(points, size, place)?,
    })
}

/// The nearest pixel.
fn looked_up(picture: &RgbaImage, at: [f64; 2]) -> [f32; 4] {
    let [width, height] = picture.size();
    let pixel = |axis: usize, side: usize| ((at[axis] * side as f64) as usize).min(side - 1);
    picture.pixels[pixel(1, height) * width + pixel(0, width)]
}

/// What spreads from points: the Laplace equation with their texels as they are. Of several in one texel the last one counts.
pub(super) fn diffused(
    points: &[TransferPoint],
    size: [usize; 2],
    place: &dyn Fn(&TransferPoint) -> [f64; 2],
) -> Result<Vec<[f32; 4]>> {
    let mut known: std::collections::BTreeMap<u32, [f32; 4]> = std::collections::BTreeMap::new();
    for point in points {
        let at = place(point);
        let [i, j] = [0, 1].map(|axis| ((at[axis] * size[axis] as f64) as usize).min(size[axis] - 1));
        let [r, g, b] = point.color;
        known.insert((j * size[0] + i) as u32, [r, g, b, point.alpha as f32]);
    }
    let places: Vec<u32> = known.keys().copied().collect();
    let empty: Vec<u32> =
        (0..(size[0] * size[1]) as u32).filter(|texel| !known.contains_key(texel)).collect();
    let spread = |of: &dyn Fn(&[f32; 4]) -> Rgb| -> Result<Vec<Rgb>> {
        let colors: Vec<Rgb> = known.values().map(of).collect();
        let limits = Limits::new(LIMITS.0, LIMITS.1);
        let found = diffuse::<f64>(&size, &Known { places: &places, colors: &colors }, &empty, &limits)?;
        let mut all = vec![[0.0; 3]; size[0] * size[1]];
        places.iter().zip(colors).for_each(|(&texel, color)| all[texel as usize] = color);
        empty.iter().zip(found.colors).for_each(|(&texel, color)| all[texel as usize] = color);
        Ok(all)
    };
    let colors = spread(&|&[r, g, b, _]| [r, g, b])?;
    let alphas = spread(&|&[.., alpha]| [alpha; 3])?;
    Ok(colors.into_iter().zip(alphas).map(|([r, g, b], [alpha, ..])| [r, g, b, alpha]).collect())
}

pub(super) fn laid_over(below: Rgb, above: Rgb, alpha: f32, blend: Blend) -> Rgb {
    rgb(|c| match blend {
        Blend::Alpha => (1.0 - alpha) * below[c] + alpha * above[c],
        Blend::Multiply => below[c] * (1.0 + alpha * (above[c] - 1.0)),
        Blend::Add => below[c] + alpha * above[c],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::TransferPlace;

    fn nowhere(point: &TransferPoint) -> [f64; 2] {
        match point.place {
            TransferPlace::Axes(axes) => axes,
            _ => [f64::NAN; 2],
        }
    }

    fn point(axes: [f64; 2], color: Rgb, alpha: f64) -> TransferPoint {
        TransferPoint { place: TransferPlace::Axes(axes), color, alpha }
    }

    #[test]
    fn what_spreads_is_the_mean_of_its_neighbours_and_keeps_its_points() {
        let size = [24, 17];
        let points = [
            point([0.1, 0.2], [1.0, 0.0, 0.5], 1.0),
            point([0.9, 0.6], [0.0, 2.0, 0.5], 0.25),
            point([0.5, 1.0], [0.3, 0.3, 0.5], 0.5),
        ];
        let found = diffused(&points, size, &nowhere).unwrap();
        let known = [(2, 3), (21, 10), (12, 16)];
        for (point, &(i, j)) in points.iter().zip(&known) {
            let [r, g, b] = point.color;
            assert_eq!(found[j * 24 + i], [r, g, b, point.alpha as f32]);
        }
        for j in 0..17_usize {
            for i in (0..24_usize).filter(|&i| !known.contains(&(i, j))) {
                let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().filter_map(|(x, y)| {
                    let at = (i.checked_add_signed(x)?, j.checked_add_signed(y)?);
                    (at.0 < 24 && at.1 < 17).then(|| found[at.1 * 24 + at.0])
                });
                let beside: Vec<[f32; 4]> = beside.collect();
                for c in 0..4 {
                    let mean =
                        beside.iter().map(|color| f64::from(color[c])).sum::<f64>() / beside.len() as f64;
                    assert!((f64::from(found[j * 24 + i][c]) - mean).abs() < 3e-7, "({i}, {j}), {c}");
                }
            }
        }
        let one = diffused(&points[..1], size, &nowhere).unwrap();
        assert!(one.iter().all(|&color| color == [1.0, 0.0, 0.5, 1.0]));
    }

    #[test]
    fn layers_lie_over_each_other_as_they_say() {
        let below = [0.5, 1.0, 0.2];
        let above = [0.8, 0.0, 0.4];
        assert_eq!(laid_over(below, above, 1.0, Blend::Alpha), above);
        let product = laid_over(below, above, 1.0, Blend::Multiply);
        assert!((0..3).all(|c| (product[c] - below[c] * above[c]).abs() < 1e-7));
        assert_eq!(laid_over(below, above, 1.0, Blend::Add), rgb(|c| below[c] + above[c]));
        for blend in [Blend::Alpha, Blend::Multiply, Blend::Add] {
            assert_eq!(laid_over(below, above, 0.0, blend), below);
        }
        let gradient = layer(&LayerKind::Gradient { axis: 1, ends: [[0.0; 3], [1.0; 3]] }, [3, 4], &nowhere);
        let gradient = gradient.unwrap();
        assert_eq!([gradient[0], gradient[4], gradient[11]].map(|color| color[0]), [0.125, 0.375, 0.875]);
    }
}
