//! Panes that colour light on its way to painted pixels.

use std::sync::Arc;

use rayon::prelude::*;

use super::Constraint;
use crate::march::{LightMapTraversal, SeenPane};
use crate::scene::Scene;
use crate::visibility::Geometry;

/// Which rows have a weight a channel, and not one for all channels.
#[derive(Debug, Clone)]
pub(super) enum Colors {
    /// None.
    Grey,
    /// Those whose light passes a pane, in increasing order.
    Some(Arc<[usize]>),
    /// All.
    All,
}

impl Colors {
    pub(super) fn of(traversal: &LightMapTraversal, geometry: &Geometry, is_grey_medium: bool) -> Self {
        if !is_grey_medium || traversal.further_weights().is_some_and(|shown| !shown.is_grey()) {
            return Self::All;
        }
        if !geometry.has_panes() || geometry.is_grey() {
            return Self::Grey;
        }
        let rows = (0..traversal.rays().len()).into_par_iter();
        let colored: Vec<usize> = rows.filter(|&row| traversal.is_colored(row)).collect();
        if colored.is_empty() { Self::Grey } else { Self::Some(colored.into()) }
    }

    pub(super) fn picked(&self, rows: &[usize]) -> Self {
        let Self::Some(colored) = self else { return self.clone() };
        let is_colored = |&new: &usize| colored.binary_search(&rows[new]).is_ok();
        let picked: Vec<usize> = (0..rows.len()).filter(is_colored).collect();
        if picked.is_empty() { Self::Grey } else { Self::Some(picked.into()) }
    }

    /// Whether one weight serves all channels in every row.
    pub(super) fn are_grey(&self) -> bool {
        matches!(self, Self::Grey)
    }
}

/// The panes before each painted pixel, whose rays have these lengths in metres.
pub(super) fn panes_before(
    scene: &Scene,
    geometry: &Geometry,
    constraints: &[Constraint],
    lengths: &[f64],
) -> Vec<Vec<SeenPane>> {
    if !geometry.has_panes() {
        return vec![Vec::new(); constraints.len()];
    }
    let panes = |(pixel, &length): (&Constraint, &f64)| {
        let ray = scene.views[pixel.view].camera.pixel_ray(pixel.x, pixel.y);
        SeenPane::through(&geometry.panes(&ray, length))
    };
    constraints.par_iter().zip(lengths).map(panes).collect()
}
