//! Rays and shadow maps as the kernels walk them: in integers, rounded once, in f64.

use bytemuck::Zeroable;
use glam::DVec2;

use crate::gpu::kernels::layout::{FARTHEST, LEVELS, LightMapRay, TICKS};
use crate::gpu::operators::entry::CellEntry;
use crate::march::LightMapTraversal;
use crate::scene::Basis;
use crate::visibility::ShadowMap;

/// Parts that the stored depths span.
const SPAN: f64 = (FARTHEST / 2) as f64;

/// Stored depths in parts of what they span.
#[derive(Debug)]
pub(super) struct Depths {
    nearest: f64,
    farthest: f64,
    /// Parts a metre.
    parts: f64,
}

impl Depths {
    /// Of the depths of a shadow map that are finite.
    pub(super) fn of(map: &ShadowMap) -> Self {
        let [width, height] = map.grid().size;
        let depths = (0..width * height).map(|k| f64::from(map.depth(k % width, k / width)));
        let (nearest, farthest) = depths
            .filter(|z| z.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(near, far), z| (near.min(z), far.max(z)));
        if nearest > farthest {
            return Self { nearest: 0.0, farthest: 0.0, parts: 1.0 };
        }
        // A map of one depth has its own size for a span.
        let span = (farthest - nearest).max(1e-3 * farthest.abs()).max(f64::MIN_POSITIVE);
        Self { nearest, farthest, parts: SPAN / span }
    }

    fn stored(&self, z: f32) -> i32 {
        // Casts saturate: infinities are farther, or nearer, than any ray.
        ((f64::from(z) - self.nearest) * self.parts).round() as i32
    }

    /// The depths, the ranges of the nodes above them, and where each level begins among those and how wide it is.
    pub(super) fn pyramid(&self, map: &ShadowMap) -> (Vec<i32>, Vec<[i32; 2]>, [[u32; 4]; LEVELS]) {
        let [mut width, mut height] = map.grid().size;
        let depths = (0..width * height).map(|k| self.stored(map.depth(k % width, k / width))).collect();
        let (mut ranges, mut levels) = (Vec::new(), [[0; 4]; LEVELS]);
        for (level, entry) in levels.iter_mut().enumerate().take(map.top() + 1).skip(1) {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            *entry = [ranges.len() as u32, width as u32, height as u32, 0];
            let range = |k: usize| map.range(level, k % width, k / width).map(|z| self.stored(z));
            ranges.extend((0..width * height).map(range));
        }
        if ranges.is_empty() {
            ranges.push([0; 2]);
        }
        (depths, ranges, levels)
    }
}

/// A row as the kernel walks it: cut to the light map, and measured from there.
pub(super) fn ray(traversal: &LightMapTraversal, depths: &Depths, row: usize) -> LightMapRay {
    let shared = traversal.transport();
    let Some([enter, leave]) = traversal.over_the_map(row) else { return LightMapRay::zeroed() };
    let view = &traversal.rays()[row];
    let length = leave - enter;
    let (light_map, shadow_map) = (&shared.light_map, &shared.shadow_map);
    let direction = DVec2::new(view.direction.x, view.direction.y);
    let over = |t: f64| DVec2::new(view.origin.x, view.origin.y) + t * direction;

    let slope = direction * light_map.density();
    // Cells of a bilinear basis lie between texel centres, and there is one more of them.
    let (shift, extra) = if shared.basis == Basis::Bilinear { (0.5, 1) } else { (0.0, 0) };
    let place = light_map.grid_from_light(over(enter)) + shift;
    let ticks = f64::from(TICKS) / length;
    let [x, y] =
        [0, 1].map(|i| AxisCrossings::new(place[i], slope[i] / ticks, 0.0, light_map.size[i] + extra));

    let shadow = traversal.over_the_shadow_map(row, enter, leave).unwrap_or([leave; 2]);
    let shadow_slope = direction * shadow_map.grid().density();
    let place = shadow_map.grid().grid_from_light(over(shadow[0]));
    let clip = shadow.map(|t| ((t - enter) * ticks).clamp(0.0, f64::from(TICKS)));
    let [u, v] = [0, 1]
        .map(|i| AxisCrossings::new(place[i], shadow_slope[i] / ticks, clip[0], shadow_map.grid().size[i]));

    let depth = view.origin.z + enter * view.direction.z - shadow_map.depth_origin();
    let window = DepthWindow::new(depths, depth, view.direction.z / ticks);
    let [r, g, b] =
        [0, 1, 2].map(|c: usize| (view.scattering[c] * (-shared.sigma_t[c] * enter).exp()) as f32);
    LightMapRay {
        strength: [r, g, b, 0.0],
        entry_cell: [x.cell, y.cell],
        entry_fraction: [x.fraction, y.fraction],
        first_high: [x.first[0], y.first[0]],
        first_low: [x.first[1], y.first[1]],
        step_high: [x.step[0], y.step[0]],
        step_low: [x.step[1], y.step[1]],
        slope: [slope.x as f32, slope.y as f32],
        shadow_clip: clip.map(|t| t.round() as u32),
        shadow_cell: [u.cell, v.cell],
        shadow_first_high: [u.first[0], v.first[0]],
        shadow_first_low: [u.first[1], v.first[1]],
        shadow_step_high: [u.step[0], v.step[0]],
        shadow_step_low: [u.step[1], v.step[1]],
        depth_window: window.ticks,
        depth: window.depth,
        depth_step_high: window.step[0] as i32,
        depth_step_low: window.step[1],
        depth_slope: (view.direction.z / ticks * depths.parts) as f32,
        length: length as f32,
        before: enter as f32,
        pad: [0.0; 2],
    }
}

/// In which cell a ray begins along one axis, and when it crosses the lines of that axis.
struct AxisCrossings {
    cell: i32,
    fraction: f32,
    /// Ticks, and 2⁻³² of a tick.
    first: [u32; 2],
    step: [u32; 2],
}

impl AxisCrossings {
    /// At `place` among so many cells at tick `begin`, with `slope` cells a tick.
    fn new(place: f64, slope: f64, begin: f64, cells: usize) -> Self {
        let CellEntry { cell, fraction, first } = CellEntry::new(place, slope, begin, cells);
        Self {
            cell: cell as i32,
            fraction: fraction as f32,
            first: crossing(first),
            step: crossing(1.0 / slope.abs()),
        }
    }
}

/// A tick in 32.32 fixed point; twice the length of a ray where it never comes to that.
fn crossing(ticks: f64) -> [u32; 2] {
    let never = 2.0 * f64::from(TICKS);
    // Not `min`: an axis along which a ray stands still may have 0 / 0.
    let ticks = if ticks < never { ticks } else { never };
    [ticks.floor() as u32, ((ticks - ticks.floor()) * f64::powi(2.0, 32)) as u32]
}

/// Between which ticks the depth of a ray is among the stored ones, and what it is there.
struct DepthWindow {
    ticks: [u32; 2],
    depth: i32,
    /// Change a tick in 32.32 fixed point; the upper word has a sign.
    step: [u32; 2],
}

impl DepthWindow {
    /// Of a ray at `depth` metres at tick 0, going `slope` metres deeper a tick.
    fn new(depths: &Depths, depth: f64, slope: f64) -> Self {
        let end = f64::from(TICKS);
        let (depth, slope) = ((depth - depths.nearest) * depths.parts, slope * depths.parts);
        let span = (depths.farthest - depths.nearest) * depths.parts;
        // A margin, so that what lies outside is outside for certain.
        let [low, high] = [-1e-3 * SPAN, span + 1e-3 * SPAN];
        let at = |t: f64| depth + slope * t;
        // A ray that stays within half a part has one depth.
        if (slope * end).abs() < 0.5 {
            let depth = at(0.5 * end).clamp(-f64::from(FARTHEST), f64::from(FARTHEST));
            return Self { ticks: [0, TICKS], depth: depth.round() as i32, step: [0; 2] };
        }
        let [a, b] = [(low - depth) / slope, (high - depth) / slope];
        let (enter, leave) = (a.min(b).clamp(0.0, end).ceil(), a.max(b).clamp(0.0, end).floor());
        if enter > leave {
            // Never among them: nearer, or farther, all the way.
            let far = if at(0.5 * end) > 0.5 * span { FARTHEST } else { -FARTHEST };
            return Self { ticks: [0, TICKS], depth: far, step: [0; 2] };
        }
        let high = slope.floor();
        Self {
            ticks: [enter as u32, leave as u32],
            depth: at(enter).round() as i32,
            step: [high as i32 as u32, ((slope - high) * f64::powi(2.0, 32)) as u32],
        }
    }
}
