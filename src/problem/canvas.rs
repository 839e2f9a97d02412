//! Who draws.

#[cfg(feature = "gpu")]
use crate::Error;
#[cfg(feature = "gpu")]
use crate::gpu::Gpu;

/// Where the rays of pictures are walked. First surfaces and their shadows are found by the processor in either case.
#[derive(Debug, Clone, Default)]
pub enum Canvas {
    /// On the processor.
    #[default]
    Processor,
    /// On a graphics adapter; what it has no kernel for is drawn by the processor.
    #[cfg(feature = "gpu")]
    Adapter(Gpu),
}

impl Canvas {
    /// Pixels that are worked on together: on an adapter enough to keep all of it busy.
    pub(super) fn pixels_at_once(&self) -> usize {
        match self {
            Self::Processor => 1 << 15,
            #[cfg(feature = "gpu")]
            Self::Adapter(_) => 1 << 18,
        }
    }
}

/// What an adapter has drawn; none where it has no kernel for that, or cannot see what is asked of it as a whole.
///
/// Errors: all others.
#[cfg(feature = "gpu")]
pub(super) fn where_it_can<T>(drawn: crate::Result<T>) -> crate::Result<Option<T>> {
    match drawn {
        Err(Error::Unsupported { .. } | Error::TooLarge { .. }) => Ok(None),
        drawn => drawn.map(Some),
    }
}
