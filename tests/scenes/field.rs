//! A light map of an open field.

use std::sync::Arc;

use glam::DVec3;
use unscatter::march::{LightMapTransport, LightMapTraversal, ViewRay};
use unscatter::scene::{Basis, Camera, FovAxis, Grid, LightFrame, Medium, Quadrature, look_at};
use unscatter::visibility::ShadowMap;

use super::extent;

/// Pillars under a slanted sun, seen by cameras on a ring; what is painted is a block in the middle of each picture.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    pub cameras: usize,
    pub picture: [usize; 2],
    /// Painted pixels of all views together.
    pub painted: usize,
    /// Texels along each axis of the light map and of the shadow map.
    pub map: usize,
    pub basis: Basis,
    pub quadrature: Quadrature,
}

impl Field {
    /// The size of Kol 2017, sec. 5.2: 3 views, 41,240 painted pixels, maps of 512².
    pub const PAPER: Self = Self {
        cameras: 3,
        picture: [640, 360],
        painted: 41_240,
        map: 512,
        basis: Basis::Bilinear,
        quadrature: Quadrature::Exact,
    };
    /// Half of that along each axis.
    pub const SMALL: Self = Self { picture: [320, 180], painted: 10_310, map: 256, ..Self::PAPER };
    /// An eighth of it, for a machine that shall only show that everything runs.
    pub const TINY: Self = Self { picture: [80, 45], painted: 644, map: 64, ..Self::PAPER };
    pub const MEDIUM: Self = Self { cameras: 6, painted: 276_480, map: 1024, ..Self::PAPER };
    /// All of six pictures of 1920 × 1080.
    pub const LARGE: Self =
        Self { cameras: 6, picture: [1920, 1080], painted: 12_441_600, map: 2048, ..Self::PAPER };

    pub fn traversal(&self) -> LightMapTraversal {
        let frame = LightFrame::along(DVec3::new(0.5, -1.0, 0.3).normalize());
        let grid = Grid::new(extent([-20.0; 2], [20.0; 2]), [self.map; 2]).unwrap();
        let depth = |k: usize| {
            let p = grid.centre(k % self.map, k / self.map);
            if (p.x * 1.7).sin() * (p.y * 0.9).cos() > 0.1 { -6.0 } else { f32::INFINITY }
        };
        let depths: Vec<f32> = (0..grid.len()).map(depth).collect();
        let medium = Medium::new([0.05; 3], [0.9; 3], 0.3).unwrap();
        let transport = LightMapTransport {
            sigma_t: medium.sigma_t,
            shadow_map: Arc::new(ShadowMap::new(grid, 0.0, &depths).unwrap()),
            light_map: grid,
            basis: self.basis,
            quadrature: self.quadrature,
            transmittance_bound: f64::powi(2.0, -24),
            mask: None,
        };
        let mut rays = Vec::with_capacity(self.painted);
        for view in 0..self.cameras {
            let camera = self.camera(view);
            let ray = |[x, y]: [usize; 2]| ViewRay::new(&camera.pixel_ray(x, y), 32.0, &frame, &medium);
            rays.extend(self.block(view).map(ray));
        }
        LightMapTraversal::new(transport, rays.into())
    }

    fn camera(&self, view: usize) -> Camera {
        let angle = view as f64 / self.cameras as f64 * std::f64::consts::TAU;
        let eye = DVec3::new(17.0 * angle.cos(), 2.0 + view as f64, 17.0 * angle.sin());
        let world = look_at(eye, DVec3::ZERO, DVec3::Y).unwrap();
        Camera::new(world, 60.0, FovAxis::X, self.picture).unwrap()
    }

    /// The painted pixels of a view, row by row.
    fn block(&self, view: usize) -> impl Iterator<Item = [usize; 2]> + use<> {
        let [width, height] = self.picture;
        let count = self.painted * (view + 1) / self.cameras - self.painted * view / self.cameras;
        let across = ((count * width) as f64 / height as f64).sqrt().ceil() as usize;
        let [left, top] = [(width - across) / 2, (height - count.div_ceil(across)) / 2];
        (0..count).map(move |k| [left + k % across, top + k / across])
    }
}
