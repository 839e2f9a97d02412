//! What is kept of slices: the texels behind their samples, and what rays show beside the samples that they pass as a whole.

use rayon::prelude::*;

use crate::march::{EpipolarTraversal, Fan, FanRay};
use crate::operator::RowTable;

/// Fans of which one task makes rows.
const FANS_AT_ONCE: usize = 64;

/// Which samples of a fan are looked at.
pub(super) type Samples = fn(&Fan) -> Vec<usize>;

/// Those that light any ray, or in which one ends.
pub(super) fn needed(fan: &Fan) -> Vec<usize> {
    fan.needed().iter().copied().map(usize::from).collect()
}

/// All of them.
pub(super) fn all(fan: &Fan) -> Vec<usize> {
    (0..fan.slopes.len()).collect()
}

/// What a ray shows beside the samples that it passes as a whole, a channel.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    /// The needed sample in which it ends, and what that weighs.
    pub(super) tail: Option<(usize, [f32; 3])>,
    /// What the light beside all samples weighs.
    pub(super) beside: [f32; 3],
}

/// The sample in which a ray ends.
pub(super) fn tail(_: &Fan, ray: &FanRay) -> End {
    End { tail: ray.tail(), beside: [0.0; 3] }
}

/// S: the texels of the samples of all fans, fan by fan.
///
/// Light beside the light map is that of one more element behind the texels.
pub(super) fn of_samples(rows: &EpipolarTraversal, outside: u32, samples: Samples) -> RowTable {
    let part = |fans: &[Fan]| {
        let mut table = RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new()] };
        for fan in fans {
            rows.texels_of(fan, samples(fan).into_iter(), &mut |texels| {
                push(&mut table, texels, outside, [1.0; 3]);
                table.offsets.push(table.elements.len());
            });
        }
        table
    };
    let parts: Vec<RowTable> = rows.fans().fans().par_chunks(FANS_AT_ONCE).map(part).collect();
    RowTable::joined(&parts, 1)
}

/// D: what `end` says of the rays of all rows.
pub(super) fn of_ends(
    rows: &EpipolarTraversal,
    is_grey: bool,
    outside: u32,
    end: &(dyn Fn(&Fan, &FanRay) -> End + Sync),
) -> RowTable {
    let channels = if is_grey { 1 } else { 3 };
    let empty = || RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); channels] };
    let part = |fans: &[Fan]| {
        let (mut of_rows, mut table) = (Vec::new(), empty());
        for fan in fans {
            let rays = rows.fans().rays_of(fan);
            let ends: Vec<End> = rays.iter().map(|ray| end(fan, ray)).collect();
            let tails = || ends.iter().filter_map(|end| end.tail);
            let mut texels = Vec::new();
            let samples = tails().map(|(needed, _)| usize::from(fan.needed()[needed]));
            rows.texels_of(fan, samples, &mut |of_sample| texels.push(of_sample.to_vec()));
            let mut texels = texels.iter();
            for (ray, end) in rays.iter().zip(&ends) {
                let scattering = ray.scattering();
                let times = |weight: [f32; 3]| [0, 1, 2].map(|c| scattering[c] * weight[c]);
                if let Some((_, tail)) = end.tail {
                    push(&mut table, texels.next().map_or(&[], |it| &it[..]), outside, times(tail));
                }
                if end.beside != [0.0; 3] {
                    push(&mut table, &[], outside, times(end.beside));
                }
                table.offsets.push(table.elements.len());
                of_rows.push(ray.row);
            }
        }
        (of_rows, table)
    };
    let parts: Vec<(Vec<u32>, RowTable)> = rows.fans().fans().par_chunks(FANS_AT_ONCE).map(part).collect();
    let mut places = vec![None; rows.fans().rows()];
    for (part, (of_rows, _)) in parts.iter().enumerate() {
        of_rows.iter().enumerate().for_each(|(place, row)| places[*row as usize] = Some((part, place)));
    }
    let mut table = empty();
    for place in places {
        match place {
            Some((part, place)) => {
                let part = &parts[part].1;
                table.append(part, part.offsets[place]..part.offsets[place + 1]);
            }
            None => table.offsets.push(table.elements.len()),
        }
    }
    table
}

/// Adds what some texels weigh to the last row, or the light outside where there are none.
fn push(table: &mut RowTable, texels: &[(usize, f64)], outside: u32, times: [f32; 3]) {
    let mut put = |element: u32, weight: f64| {
        table.elements.push(element);
        for (weights, times) in table.weights.iter_mut().zip(times) {
            weights.push((weight * f64::from(times)) as f32);
        }
    };
    if texels.is_empty() {
        put(outside, 1.0);
    }
    texels.iter().filter(|(_, weight)| *weight != 0.0).for_each(|&(texel, weight)| put(texel as u32, weight));
}
