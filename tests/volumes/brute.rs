//! The integrals of a row from their definitions, in f64, by dense quadrature between the planes where an integrand has a
//! kink: no traversal, and σ, v and L looked up anew at each node.

use glam::{DMat3, DVec3};
use unscatter::march::{InScattering, Quantity, VolumeTransport};
use unscatter::scene::{Interpolation, Ray, Volume, VoxelGrid};

/// Gauss and Legendre with eight points on [−1, 1]: nodes and weights of one half.
const GAUSS_8: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_48],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_26],
];

/// Nodes and weights over [a, b].
pub fn nodes(a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    GAUSS_8.into_iter().flat_map(move |[x, w]| [(middle - x * half, w * half), (middle + x * half, w * half)])
}

/// Position in voxels.
fn in_grid(grid: &VoxelGrid, p: DVec3) -> [f64; 3] {
    let world = grid.world_from_grid();
    (DMat3::inverse(&world.matrix3) * (p - world.translation)).to_array()
}

/// The basis functions that are not zero at a point: index and value.
pub fn basis(grid: &VoxelGrid, interpolation: Interpolation, p: DVec3) -> Vec<(usize, f64)> {
    let (q, size) = (in_grid(grid, p), grid.size());
    if (0..3).any(|axis| q[axis] < 0.0 || q[axis] >= size[axis] as f64) {
        return Vec::new();
    }
    match interpolation {
        Interpolation::Nearest => vec![(place(size, q.map(|x| x.floor() as usize)), 1.0)],
        Interpolation::Trilinear => hats(size, q),
    }
}

/// Trilinear between centres, and constant beyond the outermost ones, even outside the grid.
fn hats(size: [usize; 3], q: [f64; 3]) -> Vec<(usize, f64)> {
    let near = |axis: usize| {
        let x = (q[axis] - 0.5).clamp(0.0, size[axis] as f64 - 1.0);
        let low = x.floor() as usize;
        [(low, 1.0 - (x - low as f64)), (low + 1, x - low as f64)]
    };
    let mut found = Vec::new();
    for (k, c) in near(2) {
        for (j, b) in near(1) {
            for (i, a) in near(0) {
                if a * b * c != 0.0 {
                    found.push((place(size, [i, j, k]), a * b * c));
                }
            }
        }
    }
    found
}

fn place(size: [usize; 3], [i, j, k]: [usize; 3]) -> usize {
    i + size[0] * (j + size[1] * k)
}

/// σ_t at a point.
pub fn sigma_t(volume: &Volume, interpolation: Interpolation, p: DVec3) -> [f64; 3] {
    total(volume, &basis(volume.grid(), interpolation, p))
}

fn total(volume: &Volume, parts: &[(usize, f64)]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for &(index, part) in parts {
        (0..3).for_each(|c| sum[c] += part * f64::from(volume.color(index)[c]));
    }
    sum
}

/// What is scattered towards the eye of a ray, per albedo: phase function times what arrives.
fn scattered(light: &InScattering, ray: &Ray, p: DVec3) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for field in light.fields() {
        let grid = field.radiance.grid();
        let value = total(&field.radiance, &hats(grid.size(), in_grid(grid, p)));
        let phase = field.along.map_or(1.0, |(w, g)| {
            // Scattered light goes back along the view ray.
            let cosine = w.dot(-ray.direction);
            (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
        });
        (0..3).for_each(|c| sum[c] += phase * value[c]);
    }
    sum
}

/// Where a ray meets the planes of a lattice, shifted by half a voxel or not.
fn planes(grid: &VoxelGrid, ray: &Ray, halves: bool, cuts: &mut Vec<f64>) {
    let (o, e) = (in_grid(grid, ray.origin), in_grid(grid, ray.origin + ray.direction));
    for axis in 0..3 {
        let slope = e[axis] - o[axis];
        if slope.abs() < 1e-12 {
            continue;
        }
        for index in 0..=2 * grid.size()[axis] {
            // The two faces of the grid count in any case.
            let is_face = index == 0 || index == 2 * grid.size()[axis];
            if is_face || (index % 2 == 1) == halves {
                cuts.push((0.5 * index as f64 - o[axis]) / slope);
            }
        }
    }
}

/// The row of a straight ray over a part's grid: ∫ T σ v dt, ∫ T σ L v dt or ∫ v dt, three channels.
pub fn row(
    transport: &VolumeTransport,
    ray: &Ray,
    length: f64,
    quantity: &Quantity,
    grid: &VoxelGrid,
) -> Vec<[f64; 3]> {
    let (volume, between) = (transport.density.volume(), transport.density.interpolation());
    let mut cuts = vec![0.0];
    planes(volume.grid(), ray, between == Interpolation::Trilinear, &mut cuts);
    planes(grid, ray, transport.basis == Interpolation::Trilinear, &mut cuts);
    if let Quantity::Albedo(light) = quantity {
        light.fields().iter().for_each(|field| planes(field.radiance.grid(), ray, true, &mut cuts));
    }
    let last = cuts.iter().copied().fold(0.0, f64::max);
    cuts.push(length.min(last));
    cuts.retain(|t| (0.0..=length.min(last)).contains(t));
    cuts.sort_by(f64::total_cmp);
    let sigma = |t: f64| sigma_t(volume, between, ray.at(t));
    let mut tau = [0.0; 3];
    let mut sums = vec![[0.0; 3]; grid.len()];
    for pair in cuts.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        if to - from < 1e-13 {
            continue;
        }
        // σ is cubic here, so that eight points give its integral exactly.
        let depth = |a: f64, b: f64| {
            let mut sum = [0.0; 3];
            nodes(a, b).for_each(|(t, w)| (0..3).for_each(|c| sum[c] += w * sigma(t)[c]));
            sum
        };
        let thickest = depth(from, to).into_iter().fold(0.0, f64::max);
        let panels = (4.0 * thickest).ceil().clamp(1.0, 1e5) as usize;
        for panel in 0..panels {
            let at = |k: usize| from + (to - from) * k as f64 / panels as f64;
            let (a, b) = (at(panel), at(panel + 1));
            for (t, w) in nodes(a, b) {
                let p = ray.at(t);
                let (s, before) = (sigma(t), depth(a, t));
                let attenuated = |c: usize| (-tau[c] - before[c]).exp() * s[c];
                let density: [f64; 3] = match quantity {
                    Quantity::Extinction => [1.0; 3],
                    Quantity::Emission => std::array::from_fn(attenuated),
                    Quantity::Albedo(light) => {
                        let light = scattered(light, ray, p);
                        std::array::from_fn(|c| attenuated(c) * light[c])
                    }
                    Quantity::InScattered(_) => unreachable!("it is compared with albedo"),
                };
                for (index, part) in basis(grid, transport.basis, p) {
                    (0..3).for_each(|c| sums[index][c] += w * density[c] * part);
                }
            }
            let piece = depth(a, b);
            (0..3).for_each(|c| tau[c] += piece[c]);
            if !matches!(quantity, Quantity::Extinction) && tau.iter().all(|&tau| tau > 60.0) {
                return sums;
            }
        }
    }
    sums
}

/// Optical depth over a ray.
pub fn optical_depth(volume: &Volume, interpolation: Interpolation, ray: &Ray, length: f64) -> [f64; 3] {
    let mut cuts = vec![0.0];
    planes(volume.grid(), ray, interpolation == Interpolation::Trilinear, &mut cuts);
    let end = length.min(cuts.iter().copied().fold(0.0, f64::max));
    cuts.push(end);
    cuts.retain(|t| (0.0..=end).contains(t));
    cuts.sort_by(f64::total_cmp);
    let mut tau = [0.0; 3];
    for pair in cuts.windows(2) {
        for (t, w) in nodes(pair[0], pair[1]) {
            let sigma = sigma_t(volume, interpolation, ray.at(t));
            (0..3).for_each(|c| tau[c] += w * sigma[c]);
        }
    }
    tau
}

/// How much of a ray lies inside a grid, by the slabs between its faces.
pub fn length_inside(grid: &VoxelGrid, ray: &Ray, length: f64) -> f64 {
    let (o, e) = (in_grid(grid, ray.origin), in_grid(grid, ray.origin + ray.direction));
    let (mut enter, mut leave) = (0.0f64, length);
    for axis in 0..3 {
        let (slope, side) = (e[axis] - o[axis], grid.size()[axis] as f64);
        if slope.abs() < 1e-12 {
            if o[axis] < 0.0 || o[axis] >= side {
                return 0.0;
            }
            continue;
        }
        let (a, b) = (-o[axis] / slope, (side - o[axis]) / slope);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (leave - enter).max(0.0)
}
