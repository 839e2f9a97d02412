//! Scenes that tests and benches share, built in code.
#![allow(dead_code, reason = "tests and each bench take what they need")]
#![allow(clippy::unwrap_used, reason = "a test or bench that cannot go on should stop")]

pub mod field;
pub mod mist;
pub mod volume;

use std::sync::Arc;

use glam::{DVec2, DVec3};
use unscatter::march::{LightMapTransport, LightMapTraversal, SeenPane, SeenPanes, ViewRay};
use unscatter::scene::{Basis, Extent, Grid, Quadrature};
use unscatter::visibility::{PaneDepth, ShadowMap};

/// The same numbers in every run.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 * f64::powi(2.0, -53)
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array(std::array::from_fn(|_| self.uniform(-1.0, 1.0)));
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

pub fn extent(min: [f64; 2], max: [f64; 2]) -> Extent {
    Extent { min: DVec2::from_array(min), max: DVec2::from_array(max) }
}

/// A light map and a shadow map of different resolution and extent, with walls, floors and open sky in it,
/// and rays that start inside, outside and beside them.
pub fn random(seed: u64, rays: usize, basis: Basis, quadrature: Quadrature) -> LightMapTraversal {
    let mut n = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..8 {
        n.next();
    }
    let shadow_size = [1 + n.next() as usize % 23, 1 + n.next() as usize % 23];
    let shadow_grid = Grid::new(extent([-1.1, -0.9], [1.0, 1.2]), shadow_size).unwrap();
    let depths: Vec<f32> = (0..shadow_grid.len())
        .map(|_| if n.next().is_multiple_of(3) { f32::INFINITY } else { n.uniform(-1.0, 1.5) as f32 })
        .collect();
    let shadow_map = ShadowMap::new(shadow_grid, 0.25, &depths).unwrap();
    let light_size = [1 + n.next() as usize % 19, 1 + n.next() as usize % 19];
    let light_map = Grid::new(extent([-0.8, -1.3], [1.3, 1.0]), light_size).unwrap();
    let sigma = n.uniform(0.05, 1.5);
    let rays = (0..rays)
        .map(|index| ViewRay {
            origin: 1.5 * DVec3::from_array(std::array::from_fn(|_| n.uniform(-1.0, 1.0))),
            direction: match index % 8 {
                0 => DVec3::Z,
                1 => DVec3::X,
                2 => DVec3::NEG_Y,
                _ => n.direction(),
            },
            length: if index % 5 == 0 { f64::INFINITY } else { n.uniform(0.0, 4.0) },
            scattering: [n.uniform(0.01, 0.1); 3],
        })
        .collect::<Vec<_>>();
    let transport = LightMapTransport {
        sigma_t: [sigma; 3],
        shadow_map: Arc::new(shadow_map),
        light_map,
        basis,
        quadrature,
        transmittance_bound: f64::powi(2.0, -24),
        mask: None,
    };
    LightMapTraversal::new(transport, rays.into())
}

/// The rows of a traversal as the processor keeps them.
#[cfg(feature = "gpu")]
pub fn kept_rows<const C: usize>(
    traversal: &(impl unscatter::march::Traversal<f64, C> + Clone),
) -> unscatter::operator::RowTable {
    use unscatter::cpu::Transport;
    use unscatter::operator::{MatrixRows, RowTable, WalkPlan};
    use unscatter::scene::Strategy;

    let plan = WalkPlan::new::<C>(traversal);
    let kept = Transport::<_, f32, C>::new(traversal.clone(), &plan, Strategy::Auto, u64::MAX).unwrap();
    let mut table = RowTable { offsets: vec![0], elements: Vec::new(), weights: vec![Vec::new(); C] };
    for row in 0..MatrixRows::<f32, C>::rows(&kept) {
        kept.visit(row, &mut |element, weight: [f32; C]| {
            table.elements.push(element as u32);
            (0..C).for_each(|c| table.weights[c].push(weight[c]));
        });
        table.offsets.push(table.elements.len());
    }
    table
}

/// The same rays through panes: some before the surfaces of the shadow map, coloured or grey, and some before the eyes.
pub fn through_panes(rows: &LightMapTraversal, seed: u64) -> LightMapTraversal {
    let mut n = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let share = |n: &mut Numbers| if n.next().is_multiple_of(4) { 0.0 } else { n.uniform(0.1, 0.9) };
    let passes = |n: &mut Numbers| [(); 3].map(|()| share(n));
    let shadow_map = (*rows.transport().shadow_map).clone();
    let mut columns = Vec::new();
    for texel in 0..shadow_map.grid().len() {
        let pane = |n: &mut Numbers| PaneDepth {
            depth: n.uniform(-1.5, 1.5) as f32,
            passes: passes(n).map(|share| share as f32),
        };
        let count = n.next() as usize % 4;
        if count > 0 {
            columns.push((texel, (0..count).map(|_| pane(&mut n)).collect()));
        }
    }
    let seen: Vec<Vec<SeenPane>> = (0..rows.rays().len())
        .map(|_| {
            let mut distances: Vec<f64> = (0..n.next() % 3).map(|_| n.uniform(0.0, 2.0)).collect();
            distances.sort_by(f64::total_cmp);
            let mut all = [1.0; 3];
            let pane = |distance| {
                let passes = passes(&mut n);
                all = std::array::from_fn(|c| all[c] * passes[c]);
                SeenPane { distance, passes: all }
            };
            distances.into_iter().map(pane).collect()
        })
        .collect();
    let shadow_map = Arc::new(shadow_map.with_panes(columns).unwrap());
    rows.through(LightMapTransport { shadow_map, ..rows.transport().clone() })
        .through_panes(SeenPanes::new(seen.iter().map(|row| &row[..])))
}
