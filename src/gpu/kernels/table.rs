//! The table of kernels. A kernel is one row here, and one file of `kernels/` with its operation.

use super::access::Access;
use super::variant::{Variant, deposits, gathers, of_lanes, plain, rows, tiles};

/// A kernel as the table has it.
pub(super) struct KernelRow {
    /// Its file in `kernels/`.
    pub(super) name: &'static str,
    /// Its text.
    pub(super) text: &'static str,
    /// What its first group binds behind the parameters.
    pub(super) binds: &'static [Access],
    /// Texts of `kernels/prelude/` before its own.
    pub(super) prelude: &'static [&'static str],
    /// The variants in which problems ask for it; each has more constants, texts and bindings.
    pub(super) variants: fn() -> Vec<Variant>,
    /// Its twin on the processor: the file in `src/`, and the function there.
    pub(super) twin: [&'static str; 2],
}

macro_rules! kernels {
    ($($kernel:ident: $name:literal, [$($access:ident)*], [$($prelude:literal)*], $variants:ident, $file:literal $function:literal;)*) => {
        /// A kernel: a row of the table.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub(in crate::gpu) enum Kernel {
            $($kernel),*
        }

        /// Every kernel.
        pub(super) const KERNELS: &[Kernel] = &[$(Kernel::$kernel),*];

        const TABLE: &[KernelRow] = &[$(KernelRow {
            name: $name,
            text: include_str!(concat!("../../../kernels/", $name, ".wgsl")),
            binds: &[$(Access::$access),*],
            prelude: &[$(prelude!($prelude)),*],
            variants: $variants,
            twin: [$file, $function],
        }),*];
    };
}

// kernel, file of `kernels/`; what it binds behind its parameters; texts before its own; variants; its twin on the processor.
#[rustfmt::skip]
kernels! {
    Fill: "fill", [Write], ["vector_params" "vector"], plain, "operator/cpu_vector" "fill";
    Axpby: "axpby", [Write Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "axpby";
    Scale: "scale", [Write], ["vector_params" "vector"], plain, "operator/cpu_vector" "scale";
    Multiply: "multiply", [Write Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "multiply";
    Invert: "invert", [Write], ["vector_params" "vector"], plain, "operator/cpu_vector" "invert";
    Clamp: "clamp", [Write], ["vector_params" "vector"], plain, "operator/cpu_vector" "clamp";
    Extrapolate: "extrapolate", [Write Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "extrapolate";
    StepWithin: "step_within", [Write Read Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "step_within";
    Hold: "hold", [Write Read Read], ["bounds" "vector_params" "vector"], plain, "operator/cpu_vector" "hold";
    HoldAtBounds: "hold_at_bounds", [Write Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "hold_at_bounds";
    Shorten: "shorten", [Write Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "shorten";
    Pick: "pick", [Write Read Read], ["vector_params" "vector" "indexed"], plain, "operator/cpu_vector" "pick";
    Place: "place", [Write Read Read], ["vector_params" "vector"], plain, "operator/cpu_vector" "place";
    Difference: "difference", [Write Read Read Read], ["vector_params" "vector" "indexed"], plain, "operator/cpu_vector" "difference";
    Divergence: "divergence", [Write Read Read Read], ["vector_params" "vector" "indexed"], plain, "operator/cpu_vector" "divergence";
    Dot: "dot", [Write Read Read], ["vector_params" "reduction"], plain, "operator/cpu_vector" "dot_later";
    ProjectedNormSquared: "projected_norm_squared", [Write Read Read], ["bounds" "vector_params" "reduction"], plain, "operator/cpu_vector" "projected_norm_squared_later";
    LargestStep: "largest_step", [Write Read Read], ["vector_params" "reduction"], plain, "operator/cpu_vector" "largest_step";
    // Sums on the processor need no fixed point: they are made in order, in f64.
    LargestBits: "largest_bits", [Write Read], ["vector_params" "reduction"], plain, "cpu/products" "scatter";
    FixedScale: "fixed_scale", [Write Read], [], plain, "cpu/products" "scatter";
    FixedFinish: "fixed_finish", [Write Read Read Read], ["vector_params" "vector" "fixed_point"], plain, "cpu/products" "scatter";
    // To lie side by side is what the processor's vectors do anyway.
    Interleave: "interleave", [Write Read], ["vector_params"], plain, "operator/cpu_vector" "to_host";
    Rows: "rows", [Write Read Write Read Read Read Read], [], rows, "cpu/products" "gather";
    Tiles: "tiles", [Write Read Read Read Read Read], [], tiles, "cpu/tiles" "sweep";
    SweepGather: "sweep_gather", [Write Write Read Read Read Read Read], ["extinguished" "sweep"], of_lanes, "march/epipolar/fan" "gather_terms";
    SweepShown: "sweep_shown", [Write Read Read Read], ["extinguished" "sweep"], of_lanes, "march/epipolar/fan" "gather_terms";
    SweepScatter: "sweep_scatter", [Write Write Read Read Read Read Read], ["extinguished" "sweep"], of_lanes, "march/epipolar/fan" "scatter_terms";
    SweepSpread: "sweep_spread", [Write Read Read Read], ["extinguished" "sweep"], of_lanes, "march/epipolar/fan" "scatter_terms";
    PrefilterSums: "prefilter_sums", [Write Read Read Read], ["extinguished" "prefilter"], of_lanes, "march/epipolar/prefiltered" "sum";
    PrefilterShown: "prefilter_shown", [Write Read Read], ["extinguished" "prefilter"], of_lanes, "march/epipolar/prefiltered" "visible";
    March: "march", [Write Read Read Read], ["extinguished"], of_lanes, "problem/drawing/marched" "of_ray";
    // The traversals, compiled into what consumes them. A variant is a traversal, and adds its rays and what they pass through.
    Gather: "gather", [Write Read], [], gathers, "march/mod" "gathered";
    Scatter: "scatter", [Read], [], deposits, "cpu/transport" "apply_adjoint";
    Squares: "squares", [Read], [], deposits, "cpu/transport" "squares";
}

impl Kernel {
    pub(super) fn row(self) -> &'static KernelRow {
        &TABLE[self as usize]
    }
}
