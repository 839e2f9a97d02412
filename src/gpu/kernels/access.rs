//! What a kernel does with a binding.

/// What a kernel does with a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::gpu) enum Access {
    /// The parameters of a dispatch.
    Parameters,
    /// What many dispatches share.
    Uniform,
    Read,
    Write,
}
