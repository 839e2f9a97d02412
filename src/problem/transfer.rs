//! Transfer functions: scattered light is multiplied by a colour for the average visibility and the depth of its ray.

use super::diffusion::{Known, diffuse};
use crate::march::{ViewRay, lit_stretches};
use crate::scene::{
    Blend, LayerKind, LightFrame, Ray, Rgb, RgbaImage, Scene, Transfer, TransferLayer, TransferPlace,
    TransferPoint, rgb,
};
use crate::solve::Limits;
use crate::visibility::{Geometry, ShadowMap};
use crate::{Error, Result};

/// How far the diffusion of points is computed: iterations, and the residual relative to that at its start.
const LIMITS: (usize, f64) = (100_000, 1e-8);

/// A transfer function as a table.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// Texels along visibility and along depth.
    size: [usize; 2],
    /// Metres.
    far: f64,
    /// Visibility by visibility, depth after depth.
    texels: Vec<Rgb>,
    /// Where the points of each layer are, on both axes.
    places: Vec<Vec<[f64; 2]>>,
}

impl TransferFunction {
    /// Lays the layers over each other; points that are given by what a view sees are looked up there.
    ///
    /// Errors: those of [`diffuse`]; [`Error::NonFinite`] where colours become too large.
    pub(super) fn new(
        transfer: &Transfer,
        scene: &Scene,
        geometry: &Geometry,
        (frame, shadow_map): (&LightFrame, &ShadowMap),
    ) -> Result<Self> {
        let Transfer { size, far, layers, strength } = transfer;
        let axes_of =
            |ray: &Ray, length: f64| axes(&ViewRay::new(ray, length, frame, &scene.medium), shadow_map, *far);
        let place = |point: &TransferPoint| match point.place {
            TransferPlace::Axes(axes) => axes,
            TransferPlace::Pixel { view, at: [x, y] } => {
                let [width, height] = scene.views[view].camera.size().map(|side| side as f64);
                let ray = scene.views[view].camera.ray(x * width, y * height);
                axes_of(
                    &ray,
                    geometry.first_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.distance),
                )
            }
            TransferPlace::Point { view, point } => {
                let origin = scene.views[view].camera.position();
                let ray = Ray { origin, direction: (point - origin).normalize_or(glam::DVec3::Z) };
                axes_of(&ray, origin.distance(point))
            }
        };
        let mut texels = vec![[1.0; 3]; size[0] * size[1]];
        for TransferLayer { shows, blend, opacity } in layers {
            let shown = layer(shows, *size, &place)?;
            texels.iter_mut().zip(shown).for_each(|(below, [r, g, b, alpha])| {
                *below = laid_over(*below, [r, g, b], alpha * *opacity as f32, *blend);
            });
        }
        let places = layers.iter().map(|layer| match &layer.shows {
            LayerKind::Diffusion(points) => points.iter().map(place).collect(),
            _ => Vec::new(),
        });
        let places = places.collect();
        let strength = *strength as f32;
        texels.iter_mut().for_each(|texel| *texel = texel.map(|value| 1.0 + strength * (value - 1.0)));
        match texels.iter().flatten().position(|value| !value.is_finite()) {
            None => Ok(Self { size: *size, far: *far, texels, places }),
            Some(index) => Err(Error::NonFinite {
                what: "the transfer function".to_owned(),
                place: format!("texel ({}, {})", index / 3 % size[0], index / 3 / size[0]),
            }),
        }
    }

    /// The colour for a visibility and a depth, both from 0 to 1: bilinear between the middles of texels.
    pub fn at(&self, axes: [f64; 2]) -> [f64; 3] {
        let [(left, right, u), (top, bottom, v)] = [0, 1].map(|axis| {
            let last = self.size[axis] - 1;
            let place = (axes[axis] * self.size[axis] as f64 - 0.5).clamp(0.0, last as f64);
            let first = place as usize;
            (first, (first + 1).min(last), place - first as f64)
        });
        let texel = |i: usize, j: usize| self.texels[j * self.size[0] + i].map(f64::from);
        let along = |j: usize| {
            let [a, b] = [texel(left, j), texel(right, j)];
            [0, 1, 2].map(|c| (1.0 - u) * a[c] + u * b[c])
        };
        let [a, b] = [along(top), along(bottom)];
        [0, 1, 2].map(|c| (1.0 - v) * a[c] + v * b[c])
    }

    /// The colour for a ray in the frame of the light.
    pub fn of(&self, ray: &ViewRay, shadow_map: &ShadowMap) -> [f64; 3] {
        self.at(axes(ray, shadow_map, self.far))
    }

    /// Texels along visibility and along depth, and their colours, depth after depth.
    pub fn texels(&self) -> ([usize; 2], &[Rgb]) {
        (self.size, &self.texels)
    }

    /// Where the points of each layer are, on both axes from 0 to 1.
    pub fn places(&self) -> &[Vec<[f64; 2]>] {
        &self.places
    }

    /// The depth at the end of its axis, in metres.
    pub fn far(&self) -> f64 {
        self.far
    }
}

/// The share of a ray up to the first surface that is lit, through panes or not, exact; and its length relative to `far`. Where there is no
/// surface it ends there.
fn axes(ray: &ViewRay, shadow_map: &ShadowMap, far: f64) -> [f64; 2] {
    let end = if ray.length.is_finite() { ray.length } else { far };
    let lit: f64 = lit_stretches(ray, shadow_map, end).iter().map(|[from, to]| to - from).sum();
    [if end > 0.0 { (lit / end).clamp(0.0, 1.0) } else { 1.0 }, (end / far).min(1.0)]
}

/// What a layer shows at each texel: straight colour and alpha.
fn layer(
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
fn diffused(
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

fn laid_over(below: Rgb, above: Rgb, alpha: f32, blend: Blend) -> Rgb {
    rgb(|c| match blend {
        Blend::Alpha => (1.0 - alpha) * below[c] + alpha * above[c],
        Blend::Multiply => below[c] * (1.0 + alpha * (above[c] - 1.0)),
        Blend::Add => below[c] + alpha * above[c],
    })
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::scene::{Extent, Grid};

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
    fn average_visibility_is_that_of_a_million_midpoints() {
        let extent = Extent { min: DVec2::splat(-5.0), max: DVec2::splat(5.0) };
        let grid = Grid::new(extent, [64, 64]).unwrap();
        let depth = |k: usize| if k * 7919 % 5 < 2 { f32::INFINITY } else { (k * 31 % 17) as f32 * 0.4 };
        let map = ShadowMap::new(grid, 0.0, &(0..64 * 64).map(depth).collect::<Vec<_>>()).unwrap();
        let rays = [
            (DVec3::new(-6.0, -3.1, 1.0), DVec3::new(1.0, 0.47, 0.3), 14.0),
            (DVec3::new(0.3, 0.2, 5.0), DVec3::new(0.2, -0.5, -0.4), f64::INFINITY),
            (DVec3::new(1.0, 1.0, -2.0), DVec3::Z, 9.0),
        ];
        let far = 12.0;
        for (origin, direction, length) in rays {
            let direction = direction.normalize();
            let ray = ViewRay { origin, direction, length, scattering: [1.0; 3] };
            let [visibility, depth] = axes(&ray, &map, far);
            let end = f64::min(length, if length.is_finite() { length } else { far });
            let count = 1_000_000;
            let middle = |k: i32| origin + direction * (end * (f64::from(k) + 0.5) / f64::from(count));
            let lit = (0..count).filter(|&k| map.is_lit(middle(k))).count() as f64 / f64::from(count);
            assert!(lit > 0.05, "{lit}");
            // A midpoint is wrong next to each of a hundred edges at most.
            assert!((visibility - lit).abs() < 1e-4, "{visibility}, not {lit}");
            assert_eq!(depth, (end / far).min(1.0));
        }
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
        let texels = vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]];
        let function = TransferFunction { size: [2, 2], far: 1.0, texels, places: Vec::new() };
        for (axes, expected) in
            [([0.0, 0.0], 0.0), ([0.25, 0.25], 0.0), ([0.5, 0.25], 0.5), ([0.5, 0.5], 1.5), ([1.0, 1.0], 3.0)]
        {
            assert_eq!(function.at(axes), [expected; 3]);
        }
    }
}
