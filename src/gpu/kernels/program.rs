//! Kernels in their variants, assembled: whole texts, and all their bindings.

use super::access::Access;
use super::table::{KERNELS, Kernel};
use super::variant::{Variant, constant, float};
use super::{LANES, PIECE};
use crate::operator::NOWHERE;

/// The text that draws surfaces.
pub(in crate::gpu) const SURFACES: &str = include_str!("../../../kernels/surfaces.wgsl");

/// A kernel in one of its variants: what is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::gpu) struct Program {
    kernel: Kernel,
    variant: Variant,
}

impl From<Kernel> for Program {
    fn from(kernel: Kernel) -> Self {
        Self::new(kernel, Variant::Plain)
    }
}

impl Program {
    pub(in crate::gpu) fn new(kernel: Kernel, variant: Variant) -> Self {
        Self { kernel, variant }
    }

    /// The file of `kernels/` that it is.
    pub(in crate::gpu) fn name(self) -> &'static str {
        self.kernel.row().name
    }

    /// The whole text, as it is compiled.
    pub(in crate::gpu) fn source(self) -> String {
        // What Rust and WGSL both know, declared in Rust.
        let mut parts = vec![
            constant("LANES", "u32", LANES),
            constant("PIECE", "u32", PIECE),
            constant("NOWHERE", "u32", NOWHERE),
            constant("HUGE", "f32", float(f32::MAX)),
            constant("WORD", "f32", float(2f32.powi(32))),
            constant("WORD_INVERSE", "f32", float(2f32.powi(-32))),
        ];
        parts.extend(self.variant.constants());
        let row = self.kernel.row();
        let texts = self.variant.texts().into_iter().chain(row.prelude.iter().copied()).chain([row.text]);
        parts.extend(texts.map(str::to_owned));
        parts.join("\n")
    }

    /// What it binds, group by group.
    pub(in crate::gpu) fn bindings(self) -> Vec<Vec<Access>> {
        let first = [&[Access::Parameters], self.kernel.row().binds, self.variant.binds()].concat();
        let further = self.variant.groups().iter().map(|group| group.to_vec());
        [first].into_iter().chain(further).collect()
    }

    /// What a solve with kept rows asks for, vectors and rows.
    pub(in crate::gpu) fn of_kept_rows(colored: bool, interleaved: bool) -> Vec<Self> {
        let plain = KERNELS.iter().filter(|kernel| (kernel.row().variants)() == [Variant::Plain]);
        let rows = [false, true].map(|squared| Variant::Rows { colored, channels: 3, squared, interleaved });
        plain.map(|&kernel| kernel.into()).chain(rows.map(|rows| Self::new(Kernel::Rows, rows))).collect()
    }

    /// Every kernel in every variant that some problem can ask for.
    pub(super) fn all() -> Vec<Self> {
        let of = |&kernel: &Kernel| (kernel.row().variants)().into_iter().map(move |v| Self::new(kernel, v));
        KERNELS.iter().flat_map(of).collect()
    }
}

/// A kernel as it is compiled, for those who want to read or check it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KernelText {
    /// The file of `kernels/` that it is.
    pub name: &'static str,
    /// Which variant, in words.
    pub variant: String,
    /// WGSL.
    pub source: String,
    /// Its twin on the processor: the file in `src/` without its ending, and the function there.
    pub twin: [&'static str; 2],
}

/// Every kernel in every variant that some problem can ask for, and what draws surfaces.
pub fn kernel_texts() -> Vec<KernelText> {
    let text = |program: Program| KernelText {
        name: program.name(),
        variant: format!("{:?}", program.variant),
        source: program.source(),
        twin: program.kernel.row().twin,
    };
    // It is no kernel that computes: it draws. Rays find the same triangles by the hierarchy.
    let drawing = KernelText {
        name: "surfaces",
        variant: "Plain".to_owned(),
        source: SURFACES.to_owned(),
        twin: ["visibility/geometry", "first_hit"],
    };
    Program::all().into_iter().map(text).chain([drawing]).collect()
}
