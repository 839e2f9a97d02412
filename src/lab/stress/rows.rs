//! Rows to put under stress, and how far two matrices are apart.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::Result;
use crate::march::{
    Density, LightMapTransport, LightMapTraversal, PixelRays, Quantity, Traversal, ViewRay, VolumeTransport,
    VolumeTraversal, VoxelElements, Weight,
};
use crate::scene::{
    Basis, Camera, Extent, FovAxis, Grid, Interpolation, Quadrature, Ray, Samples, Volume, VoxelGrid,
    VoxelSet,
};
use crate::visibility::ShadowMap;

pub(super) const BASES: [Basis; 2] = [Basis::Nearest, Basis::Bilinear];
pub(super) const INTERPOLATIONS: [Interpolation; 2] = [Interpolation::Nearest, Interpolation::Trilinear];
/// No ray is cut off.
pub(super) const NO_CUT: f64 = f64::MIN_POSITIVE;
/// What a weight that is wrong is multiplied by.
pub(super) const FAULT: f64 = 1.001;

/// A traversal of any kind. What is compiled for one of these is compiled once.
pub(super) trait AnyRows: Sync {
    fn rows(&self) -> usize;
    fn elements(&self) -> usize;
    fn visit_grey(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 1]));
    fn visit_colored(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3]));
}

impl<T: Traversal<f64, 1> + Traversal<f64, 3>> AnyRows for T {
    fn rows(&self) -> usize {
        Traversal::<f64, 1>::rows(self)
    }

    fn elements(&self) -> usize {
        Traversal::<f64, 1>::elements(self)
    }

    fn visit_grey(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 1])) {
        Traversal::<f64, 1>::walk_shared(self, row, visit);
    }

    fn visit_colored(&self, row: usize, visit: &mut dyn FnMut(usize, [f64; 3])) {
        Traversal::<f64, 3>::walk_shared(self, row, visit);
    }
}

/// Rows whose first weight is wrong where a fault is asked for.
#[derive(Clone, Copy)]
pub(super) struct Tested<'a> {
    pub(super) rows: &'a dyn AnyRows,
    pub(super) faulty: bool,
}

impl<const C: usize> Traversal<f64, C> for Tested<'_> {
    fn rows(&self) -> usize {
        self.rows.rows()
    }

    fn elements(&self) -> usize {
        self.rows.elements()
    }

    fn walk(&self, row: usize, visit: &mut impl FnMut(usize, Weight<f64, C>)) {
        let mut factor = if self.faulty { FAULT } else { 1.0 };
        let mut pass = |element: usize, weight: &[f64]| {
            visit(element, std::array::from_fn(|c| factor * weight[c]));
            factor = 1.0;
        };
        match C {
            1 => self.rows.visit_grey(row, &mut |element, weight| pass(element, &weight)),
            _ => self.rows.visit_colored(row, &mut |element, weight| pass(element, &weight)),
        }
    }
}

/// The same numbers in every run (SplitMix64).
pub(super) struct RandomNumbers(pub(super) u64);

impl RandomNumbers {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 * f64::powi(2.0, -53)
    }

    pub(super) fn point(&mut self, reach: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.uniform(-reach, reach)))
    }

    pub(super) fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.point(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// Where everything is: a place in the world, and the metres of a unit of length there.
#[derive(Debug, Clone, Copy)]
pub(super) struct WorldPlace {
    pub(super) scale: f64,
    pub(super) offset: DVec3,
}

impl WorldPlace {
    pub(super) const PLAIN: Self = Self { scale: 1.0, offset: DVec3::ZERO };

    pub(super) fn scaled(scale: f64) -> Self {
        Self { scale, ..Self::PLAIN }
    }

    pub(super) fn at(&self, point: DVec3) -> DVec3 {
        point * self.scale + self.offset
    }
}

/// A rectangle of texels in the light's plane.
pub(super) fn texels(min: [f64; 2], max: [f64; 2], size: [usize; 2], place: &WorldPlace) -> Result<Grid> {
    let at = |corner: [f64; 2]| {
        let corner = place.at(DVec2::from_array(corner).extend(0.0));
        DVec2::new(corner.x, corner.y)
    };
    Grid::new(Extent { min: at(min), max: at(max) }, size)
}

/// A view ray from one point of the light's frame to another, or on without end.
pub(super) fn view_ray(origin: DVec3, direction: DVec3, length: f64) -> ViewRay {
    ViewRay { origin, direction: direction.normalize(), length, scattering: [1.0; 3] }
}

/// Rows over a light map whose shadow map is given.
pub(super) fn light_map_rows(
    light_map: Grid,
    shadow_map: ShadowMap,
    sigma_t: [f64; 3],
    basis: Basis,
    rays: Vec<ViewRay>,
) -> LightMapTraversal {
    let transport = LightMapTransport {
        sigma_t,
        shadow_map: Arc::new(shadow_map),
        light_map,
        basis,
        quadrature: Quadrature::Exact,
        transmittance_bound: NO_CUT,
        mask: None,
    };
    LightMapTraversal::new(transport, rays.into())
}

/// The square of 4 × 4 metres around the origin in 64 × 64 texels, without shadows: texel borders are at multiples of 1/16.
pub(super) fn open_rows(sigma_t: [f64; 3], basis: Basis, rays: Vec<ViewRay>) -> Result<LightMapTraversal> {
    let grid = texels([-2.0; 2], [2.0; 2], [64; 2], &WorldPlace::PLAIN)?;
    Ok(light_map_rows(grid, ShadowMap::open(grid), sigma_t, basis, rays))
}

/// A light map and a shadow map with walls, floors and open sky in it, and rays from everywhere, wherever it is placed. `depth`
/// is the optical depth of a unit of length.
pub(super) fn random_light_map(
    seed: u64,
    count: usize,
    basis: Basis,
    depth: f64,
    place: &WorldPlace,
) -> Result<LightMapTraversal> {
    let mut n = RandomNumbers(seed);
    let shadow_grid = texels([-1.1, -0.9], [1.0, 1.2], [23, 19], place)?;
    let scale = place.scale;
    let depths: Vec<f32> = (0..shadow_grid.len())
        .map(|_| match n.next().is_multiple_of(3) {
            true => f32::INFINITY,
            false => (scale * n.uniform(-1.0, 1.5)) as f32,
        })
        .collect();
    let shadow_map = ShadowMap::new(shadow_grid, 0.25 * scale + place.offset.z, &depths)?;
    let light_map = texels([-0.8, -1.3], [1.3, 1.0], [17, 15], place)?;
    let rays = (0..count).map(|index| {
        let origin = place.at(n.point(1.5));
        let direction = match index % 8 {
            0 => DVec3::Z,
            1 => DVec3::X,
            2 => DVec3::NEG_Y,
            _ => n.direction(),
        };
        let length = if index.is_multiple_of(5) { f64::INFINITY } else { scale * n.uniform(0.5, 4.0) };
        view_ray(origin, direction, length)
    });
    let rays = rays.collect();
    Ok(light_map_rows(light_map, shadow_map, [depth / scale; 3], basis, rays))
}

/// A camera of one pixel that looks along a direction; exactly, where that is along an axis.
fn camera(ray: &Ray) -> Result<Camera> {
    let forward = ray.direction.normalize();
    let up = if forward.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    let matrix3 = DMat3::from_cols(right, right.cross(forward), -forward);
    Camera::new(DAffine3 { matrix3, translation: ray.origin }, 40.0, FovAxis::Y, [1, 1])
}

/// Rays of one's own as rows; each ends after its length.
fn rows_along(rays: &[(Ray, f64)]) -> Result<PixelRays> {
    let cameras: Vec<Camera> = rays.iter().map(|(ray, _)| camera(ray)).collect::<Result<_>>()?;
    let pixels: Vec<[u32; 2]> = (0..rays.len() as u32).map(|view| [view, 0]).collect();
    Ok(PixelRays::new(cameras.into(), pixels, rays.iter().map(|&(_, length)| length).collect()))
}

/// Rays into the cube of two units around the origin: from outside and inside, some along the axes, some that end on the way.
pub(super) fn random_rays(n: &mut RandomNumbers, count: usize, place: &WorldPlace) -> Vec<(Ray, f64)> {
    let ray = |index: usize| {
        let origin = n.point(if index.is_multiple_of(3) { 0.6 } else { 3.0 });
        let direction = match index % 9 {
            0 => DVec3::X,
            1 => DVec3::NEG_Y,
            2 => DVec3::Z,
            _ => (n.point(0.8) - origin).normalize(),
        };
        let length = if index.is_multiple_of(4) { place.scale * n.uniform(0.5, 4.0) } else { f64::INFINITY };
        (Ray { origin: place.at(origin), direction }, length)
    };
    (0..count).map(ray).collect()
}

/// A volume over the cube of two units around the origin.
pub(super) fn cube(size: [usize; 3], place: &WorldPlace) -> Result<VoxelGrid> {
    let corner = place.at(DVec3::NEG_ONE);
    let matrix3 = DMat3::from_diagonal(DVec3::splat(2.0 * place.scale));
    VoxelGrid::over_cube(size, DAffine3 { matrix3, translation: corner })
}

/// Rows of a quantity over all voxels of a medium.
pub(super) fn volume_rows(
    density: Volume,
    quantity: Quantity,
    basis: Interpolation,
    rays: &[(Ray, f64)],
) -> Result<VolumeTraversal> {
    let grid = *density.grid();
    let transport = VolumeTransport {
        density: Arc::new(Density::new(Arc::new(density), basis)),
        basis,
        quadrature: Quadrature::Exact,
        accuracy: 1e-6,
        transmittance_bound: NO_CUT,
        refraction: None,
    };
    let part = VoxelElements::new(quantity, grid, Arc::new(VoxelSet::all(grid.size())), basis);
    Ok(VolumeTraversal::new(transport, rows_along(rays)?, vec![part]))
}

/// Extinction with holes, wherever it is placed; `depth` is the largest optical depth of a unit of length.
pub(super) fn random_density(seed: u64, depth: f64, place: &WorldPlace) -> Result<Volume> {
    let (mut n, grid) = (RandomNumbers(seed), cube([18, 11, 9], place)?);
    let sample = |_| match n.next().is_multiple_of(3) {
        true => 0.0,
        false => (n.uniform(0.1, 1.0) * depth / place.scale) as f32,
    };
    Volume::new(grid, 1, Samples::F32((0..grid.len()).map(sample).collect()))
}

/// The distances at which a ray enters and leaves a grid, by the definition of a box.
pub(super) fn inside(ray: &Ray, length: f64, grid: &VoxelGrid) -> f64 {
    let corners = grid.corners();
    let (low, high) = (corners[0].min(corners[7]), corners[0].max(corners[7]));
    let (mut enter, mut leave) = (0.0_f64, length);
    for axis in 0..3 {
        let (origin, slope) = (ray.origin[axis], ray.direction[axis]);
        if slope == 0.0 {
            if origin < low[axis] || origin > high[axis] {
                return 0.0;
            }
            continue;
        }
        let ends = [(low[axis] - origin) / slope, (high[axis] - origin) / slope];
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    (leave - enter).max(0.0)
}

/// A row as a dense vector; NaN where a walk breaks its own law: an element twice, a weight that is negative or no number.
pub(super) fn dense<const C: usize>(rows: &Tested, row: usize) -> Vec<[f64; C]> {
    let mut dense = vec![[0.0; C]; rows.rows.elements()];
    rows.walk(row, &mut |element, weight| {
        let sound = weight.iter().all(|w| w.is_finite() && *w >= 0.0) && dense[element] == [0.0; C];
        dense[element] = if sound { weight } else { [f64::NAN; C] };
    });
    dense
}

/// The sum of a row, a channel.
pub(super) fn row_sum<const C: usize>(rows: &Tested, row: usize) -> [f64; C] {
    let mut sum = [0.0; C];
    dense::<C>(rows, row).iter().for_each(|weight| (0..C).for_each(|c| sum[c] += weight[c]));
    sum
}

/// Σ |a − b| / Σ |a| over all weights of two matrices.
pub(super) fn apart(a: &dyn AnyRows, b: &Tested) -> f64 {
    let a = &Tested { rows: a, faulty: false };
    let (mut difference, mut sum) = (0.0, 0.0);
    for row in 0..a.rows.rows() {
        for ([a], [b]) in dense::<1>(a, row).into_iter().zip(dense::<1>(b, row)) {
            difference += (a - b).abs();
            sum += a.abs();
        }
    }
    difference / sum
}

/// |a − b| / |b|; 0 where both are 0.
pub(super) fn relative(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / b.abs() }
}

/// The larger of two numbers, NaN above all.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}
