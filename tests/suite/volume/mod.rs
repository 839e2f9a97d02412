//! Volumes, from their operators to solved problems.

mod animation;
mod environment;
mod held_out;
mod light;
mod mitsuba;
mod operator;
mod refinement;
mod scene;
mod solving;
mod walked;

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use unscatter::march::{Density, Quantity, Traversal, VolumeTraversal};
use unscatter::scene::{Camera, FovAxis, Interpolation, Ray, Samples, Volume, VoxelGrid};

use crate::scenes::Numbers;
use crate::volumes::*;
