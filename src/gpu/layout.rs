//! What kernels and host both know: structs as they lie in memory, and constants. A test compares every offset with the WGSL.

use bytemuck::{Pod, Zeroable};

/// Levels of a shadow map's pyramid at most: maps of up to 2¹⁶ texels a side.
pub(super) const LEVELS: usize = 17;

/// Parts that stored depths span half of: a ray is so far away where it is nearer or farther than all of them.
pub(super) const FARTHEST: i32 = 1 << 30;

/// Parts that the length of a ray over the light map is counted in.
pub(super) const TICKS: u32 = 1 << 30;

/// Of a cell, that the place where a ray enters a volume is rounded to, in bits; a grid has fewer than 2¹³ cells a side.
pub(super) const PLACE_BITS: u32 = 19;

/// Lights that a volume is lit by at most: their factors have one word each in a row's track.
pub(super) const LIGHTS: usize = 4;

/// `VectorParams` of kernels/prelude/vector.wgsl and reduction.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct VectorParams {
    pub(super) len: u32,
    pub(super) stride: u32,
    pub(super) channel: u32,
    pub(super) other_first: u32,
    pub(super) other_len: u32,
    pub(super) other_stride: u32,
    pub(super) again: u32,
    pub(super) results: u32,
    pub(super) first: u32,
    pub(super) pad0: u32,
    pub(super) pad1: u32,
    pub(super) pad2: u32,
    pub(super) a: [f32; 4],
    pub(super) b: [f32; 4],
}

/// `Transport` of kernels/prelude/light_map.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct Transport {
    pub(super) sigma_t: [f32; 4],
    pub(super) light_size: [i32; 2],
    pub(super) shadow_size: [i32; 2],
    pub(super) shadow_top: u32,
    pub(super) steps: u32,
    pub(super) pad: [u32; 2],
    pub(super) levels: [[u32; 4]; LEVELS],
}

/// `Ray` of kernels/prelude/light_map.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Ray {
    pub(super) strength: [f32; 4],
    pub(super) entry_cell: [i32; 2],
    pub(super) entry_fraction: [f32; 2],
    pub(super) first_high: [u32; 2],
    pub(super) first_low: [u32; 2],
    pub(super) step_high: [u32; 2],
    pub(super) step_low: [u32; 2],
    pub(super) slope: [f32; 2],
    pub(super) shadow_clip: [u32; 2],
    pub(super) shadow_cell: [i32; 2],
    pub(super) shadow_first_high: [u32; 2],
    pub(super) shadow_first_low: [u32; 2],
    pub(super) shadow_step_high: [u32; 2],
    pub(super) shadow_step_low: [u32; 2],
    pub(super) depth_window: [u32; 2],
    pub(super) depth: i32,
    pub(super) depth_step_high: i32,
    pub(super) depth_step_low: u32,
    pub(super) depth_slope: f32,
    pub(super) length: f32,
    pub(super) before: f32,
    pub(super) pad: [f32; 2],
}

/// `Track` of kernels/prelude/volume_track.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Track {
    pub(super) first: [u32; 4],
    pub(super) step_high: [u32; 4],
    pub(super) step_low: [u32; 4],
    pub(super) entry: [u32; 4],
}

/// `Light` of kernels/prelude/volume_bricks.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Light {
    pub(super) high: [[f32; 4]; 3],
    pub(super) low: [[f32; 4]; 3],
    pub(super) at_high: [f32; 3],
    pub(super) slots: u32,
    pub(super) at_low: [f32; 3],
    pub(super) first: u32,
    pub(super) size: [u32; 3],
    pub(super) channels: u32,
}

/// `Volume` of kernels/prelude/volume_bricks.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Volume {
    pub(super) metres: [[f32; 4]; 3],
    pub(super) cells: [u32; 3],
    pub(super) slots: u32,
    pub(super) size: [u32; 3],
    pub(super) elements: u32,
    pub(super) transmittance_bound: f32,
    pub(super) channels: u32,
    pub(super) lights: u32,
    pub(super) pad: u32,
    pub(super) light: [Light; LIGHTS],
}

/// `Pass` of kernels/prelude/pass.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Pass {
    pub(super) rows: u32,
    pub(super) y_first: u32,
    pub(super) y_stride: u32,
    pub(super) channel: u32,
    pub(super) x_first: u32,
    pub(super) x_len: u32,
    pub(super) x_stride: u32,
    pub(super) pad: u32,
}

/// `Scale` of kernels/fixed_scale.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Scale {
    pub(super) begin: [u32; 4],
    pub(super) pieces: [u32; 4],
    pub(super) row_sums: [f32; 4],
}

/// `Rows` of kernels/rows.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Rows {
    pub(super) rows: u32,
    pub(super) y_first: u32,
    pub(super) y_stride: u32,
    pub(super) channel: u32,
    pub(super) x_stride: u32,
    pub(super) nonzeros: u32,
    pub(super) pad0: u32,
    pub(super) pad1: u32,
}

/// `Tiles` of kernels/tiles.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Tiles {
    pub(super) tiles: u32,
    pub(super) stride: u32,
    pub(super) channel: u32,
    pub(super) parts: u32,
    pub(super) shorter: [f32; 4],
}

/// `Part` of kernels/tiles.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Part {
    pub(super) lower: [f32; 4],
    pub(super) upper: [f32; 4],
    pub(super) begin: u32,
    pub(super) pad0: u32,
    pub(super) pad1: u32,
    pub(super) pad2: u32,
}
