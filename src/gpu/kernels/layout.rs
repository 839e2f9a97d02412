//! What kernels and host both know: structs as they lie in memory, and constants. A test compares every offset with the WGSL.

use bytemuck::{Pod, Zeroable};

/// Levels of a shadow map's pyramid at most: maps of up to 2¹⁶ texels a side.
pub(in crate::gpu) const LEVELS: usize = 17;

/// Parts that stored depths span half of: a ray is so far away where it is nearer or farther than all of them.
pub(in crate::gpu) const FARTHEST: i32 = 1 << 30;

/// Parts that the length of a ray over the light map is counted in.
pub(in crate::gpu) const TICKS: u32 = 1 << 30;

/// Of a cell, that the place where a ray enters a volume is rounded to, in bits; a grid has fewer than 2¹³ cells a side.
pub(in crate::gpu) const PLACE_BITS: u32 = 19;

/// Lights that a volume is lit by at most: their factors have one word each in a row's track.
pub(in crate::gpu) const LIGHTS: usize = 4;

/// Declares structs that lie in memory as their namesakes in WGSL do, and lists their members for the test.
macro_rules! layouts {
    ($($(#[$doc:meta])* $name:ident { $($member:ident: $type:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
            pub(in crate::gpu) struct $name {
                $(pub(in crate::gpu) $member: $type,)*
            }
        )*

        /// Of each struct its name, its size, and where its members lie.
        #[cfg(test)]
        pub(super) const LAYOUTS: &[(&str, usize, &[(&str, usize)])] = &[$((
            stringify!($name),
            size_of::<$name>(),
            &[$((stringify!($member), std::mem::offset_of!($name, $member))),*],
        )),*];
    };
}

layouts! {
    /// `VectorParams` of kernels/prelude/vector_params.wgsl.
    VectorParams {
        len: u32,
        stride: u32,
        channel: u32,
        other_first: u32,
        other_len: u32,
        other_stride: u32,
        again: u32,
        results: u32,
        first: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
        a: [f32; 4],
        b: [f32; 4],
        c: [f32; 4],
    }

    /// `LightMapUniform` of kernels/prelude/light_map.wgsl.
    LightMapUniform {
        sigma_t: [f32; 4],
        light_size: [i32; 2],
        shadow_size: [i32; 2],
        shadow_top: u32,
        steps: u32,
        pad: [u32; 2],
        levels: [[u32; 4]; LEVELS],
    }

    /// `LightMapRay` of kernels/prelude/light_map.wgsl.
    LightMapRay {
        strength: [f32; 4],
        entry_cell: [i32; 2],
        entry_fraction: [f32; 2],
        first_high: [u32; 2],
        first_low: [u32; 2],
        step_high: [u32; 2],
        step_low: [u32; 2],
        slope: [f32; 2],
        shadow_clip: [u32; 2],
        shadow_cell: [i32; 2],
        shadow_first_high: [u32; 2],
        shadow_first_low: [u32; 2],
        shadow_step_high: [u32; 2],
        shadow_step_low: [u32; 2],
        depth_window: [u32; 2],
        depth: i32,
        depth_step_high: i32,
        depth_step_low: u32,
        depth_slope: f32,
        length: f32,
        before: f32,
        pad: [f32; 2],
    }

    /// `Track` of kernels/prelude/volume_track.wgsl.
    Track {
        first: [u32; 4],
        step_high: [u32; 4],
        step_low: [u32; 4],
        entry: [u32; 4],
    }

    /// `LightUniform` of kernels/prelude/volume_bricks.wgsl.
    LightUniform {
        high: [[f32; 4]; 3],
        low: [[f32; 4]; 3],
        at_high: [f32; 3],
        slots: u32,
        at_low: [f32; 3],
        first: u32,
        size: [u32; 3],
        channels: u32,
    }

    /// `VolumeUniform` of kernels/prelude/volume_bricks.wgsl.
    VolumeUniform {
        metres: [[f32; 4]; 3],
        cells: [u32; 3],
        slots: u32,
        size: [u32; 3],
        elements: u32,
        transmittance_bound: f32,
        channels: u32,
        lights: u32,
        pad: u32,
        light: [LightUniform; LIGHTS],
    }

    /// `WalkParams` of kernels/prelude/pass.wgsl.
    WalkParams {
        rows: u32,
        y_first: u32,
        y_stride: u32,
        channel: u32,
        x_first: u32,
        x_len: u32,
        x_stride: u32,
        pad: u32,
    }

    /// `FixedScaleParams` of kernels/fixed_scale.wgsl.
    FixedScaleParams {
        begin: [u32; 4],
        pieces: [u32; 4],
        row_sums: [f32; 4],
    }

    /// `RowsParams` of kernels/rows.wgsl.
    RowsParams {
        nonzeros: u32,
        channel: u32,
        x_stride: u32,
        y_stride: u32,
        pieces_stride: u32,
        places: u32,
        groups: u32,
        pad: u32,
    }

    /// `RowsGroup` of kernels/rows.wgsl.
    RowsGroup {
        first: u32,
        end: u32,
        sharers: u32,
        pad: u32,
    }

    /// `SweepParams` of kernels/prelude/sweep.wgsl.
    SweepParams {
        items: u32,
        rays: u32,
        samples: u32,
        first_sample: u32,
        channel: u32,
        channels: u32,
        x_stride: u32,
        y_stride: u32,
    }

    /// `SweepItem` of kernels/prelude/sweep.wgsl.
    SweepItem {
        rates: [f32; 3],
        term: u32,
        terms: u32,
        samples: u32,
        first_sample: u32,
        lit: u32,
        first_lit: u32,
        rays: u32,
        first_ray: u32,
        first_coefficient: u32,
        first_node: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }

    /// `SweepRay` of kernels/prelude/sweep.wgsl.
    SweepRay {
        scattering: [f32; 3],
        row: u32,
        whole: u32,
        lit: u32,
        terms: u32,
        first_coefficient: u32,
    }

    /// `SweepSample` of kernels/prelude/sweep.wgsl.
    SweepSample {
        begin: f32,
        width: f32,
        item: u32,
    }

    /// `PrefilterParams` of kernels/prelude/prefilter.wgsl.
    PrefilterParams {
        fans: u32,
        rays: u32,
        first_sample: u32,
        harmonics: u32,
        channel: u32,
        channels: u32,
        x_stride: u32,
        y_stride: u32,
    }

    /// `PrefilterFan` of kernels/prelude/prefilter.wgsl.
    PrefilterFan {
        rates: [f32; 3],
        samples: u32,
        first_sample: u32,
        first_edge: u32,
        pad0: u32,
        pad1: u32,
    }

    /// `PrefilterSample` of kernels/prelude/prefilter.wgsl.
    PrefilterSample {
        begin: f32,
        width: f32,
        place: f32,
    }

    /// `PrefilterRay` of kernels/prelude/prefilter.wgsl.
    PrefilterRay {
        gain: [f32; 3],
        row: u32,
        far: [f32; 3],
        edge: u32,
        place: f32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }

    /// `MarchParams` of kernels/march.wgsl.
    MarchParams {
        sigma_t: [f32; 4],
        shadow_size: [u32; 2],
        light_size: [u32; 2],
        rays: u32,
        first_row: u32,
        steps: u32,
        bilinear: u32,
        channel: u32,
        channels: u32,
        x_stride: u32,
        y_stride: u32,
    }

    /// `MarchRay` of kernels/march.wgsl.
    MarchRay {
        scattering: [f32; 3],
        step: f32,
        shadow_at: [f32; 2],
        shadow_step: [f32; 2],
        light_at: [f32; 2],
        light_step: [f32; 2],
        depth: f32,
        depth_step: f32,
        pad0: u32,
        pad1: u32,
    }

    /// `TilesParams` of kernels/tiles.wgsl.
    TilesParams {
        tiles: u32,
        stride: u32,
        channel: u32,
        parts: u32,
        shorter: [f32; 4],
    }

    /// `BoundsPart` of kernels/tiles.wgsl.
    BoundsPart {
        lower: [f32; 4],
        upper: [f32; 4],
        begin: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}
