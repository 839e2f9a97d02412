//! Extinction of a medium that emits and scatters, by Gauss–Newton: the problem that radiance makes around the medium as it is.

use rayon::prelude::*;

use super::fixed::wanted_pixels;
use super::optics::open_rays;
use super::problem::nothing_to_solve;
use super::searched::Searched;
use super::{Desired, LeftOut, Model, Optics, VolumeProblem, VolumeRenderer, VolumeRows};
use crate::Result;
use crate::march::{LinearizedTraversal, SourceFunction, Traversal, VolumeTraversal, channel};
use crate::scene::{Find, Rgb, VolumeMedium, VolumeScene};

impl VolumeProblem {
    /// `min ½ Σ w (L(x₀) + J (x − x₀) − L*)²`, with J how the radiance changes with extinction at the medium x₀.
    ///
    /// Where one extinction serves all channels, each pixel is three rows, one a channel.
    pub(super) fn linearized(
        scene: &VolumeScene,
        medium: &VolumeMedium,
        optics: &Optics,
        desired: &[Desired],
    ) -> Result<Self> {
        let searched = Searched::new(scene, medium, optics, Find::Refinement)?;
        let (pixels, unwanted) = wanted_pixels(scene, desired);
        let rays = open_rays(scene, &pixels);
        let lengths = optics.lengths(&rays);
        let rays = rays.until(lengths.into());
        let all = VolumeTraversal::new(optics.transport(scene, medium), rays, searched.parts.clone());
        let meeting: Vec<usize> =
            (0..pixels.len()).into_par_iter().filter(|&row| all.has_weights(row)).collect();
        let left_out = LeftOut { unwanted, beside: pixels.len() - meeting.len(), ..LeftOut::default() };
        if meeting.is_empty() {
            return Err(nothing_to_solve(Find::Refinement, &left_out, searched.outside_hull));
        }

        let is_grey = scene.extinction.is_grey && optics.density.is_grey();
        let copies = if is_grey { 3 } else { 1 };
        let kept: Vec<usize> = meeting.iter().flat_map(|&row| std::iter::repeat_n(row, copies)).collect();
        let channels: Vec<u8> =
            if is_grey { (0..kept.len()).map(|row| (row % 3) as u8).collect() } else { Vec::new() };
        let medium_rows = all.along(all.rays().picked(&kept));
        let behind: Vec<Rgb> = (0..kept.len())
            .into_par_iter()
            .map(|row| optics.background(scene, medium_rows.rays(), row))
            .collect();
        let source = SourceFunction::Medium {
            emission: medium.emission.clone(),
            albedo: medium.albedo.clone(),
            light: optics.light.clone(),
        };
        let rows = LinearizedTraversal::new(medium_rows, source, behind, channels.clone());

        let renderer = VolumeRenderer::new(scene, medium, optics, Model::SingleScattering);
        let row = |row: usize| -> [Rgb; 3] {
            let [view, pixel] = rows.rays().pixel(row);
            let [r, g, b, weight] = desired[view as usize].pixels[pixel as usize];
            let wanted = of_row(&channels, row, [r, g, b]);
            let shown = of_row(&channels, row, renderer.radiance(rows.medium(), row));
            let linear = match is_grey {
                true => linear::<1>(&rows, row, &searched.start),
                false => linear::<3>(&rows, row, &searched.start),
            };
            let target =
                std::array::from_fn(|c| (f64::from(wanted[c]) - f64::from(shown[c]) + linear[c]) as f32);
            [target, [weight; 3], wanted]
        };
        let made: Vec<[Rgb; 3]> = (0..kept.len()).into_par_iter().map(row).collect();
        let mut wanted = [0.0; 3];
        for [_, weight, shown] in &made {
            (0..3).for_each(|c| wanted[c] += f64::from(weight[c]) * f64::from(shown[c]).powi(2));
        }
        let [targets, weights] = [0, 1].map(|of| made.iter().map(|row| row[of]).collect());
        Ok(Self::of_rows(
            Find::Refinement,
            VolumeRows::Linearized(rows),
            is_grey,
            (targets, weights, wanted),
            left_out,
            searched,
        ))
    }
}

/// The colour as a row sees it: three times the channel that the row is of, or the colour itself where the row is of all channels.
fn of_row(channels: &[u8], row: usize, color: Rgb) -> Rgb {
    channels.get(row).map_or(color, |&channel| [color[usize::from(channel)]; 3])
}

/// One row of J x in f64.
fn linear<const C: usize>(rows: &LinearizedTraversal, row: usize, x: &[Rgb]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    Traversal::<f64, C>::walk(rows, row, &mut |element, weight| {
        (0..3).for_each(|c| sum[c] += channel(&weight, c) * f64::from(x[element][c]));
    });
    sum
}
