//! What computes: the processor, or a graphics adapter.

use super::args::{Backend, BackendArguments};
#[cfg(feature = "gpu")]
use crate::gpu::{Choice, Fault, Gpu, may_have_hardware};
use crate::{Error, Result};

/// What computes.
#[derive(Debug)]
pub(super) enum Engine {
    /// The processor.
    Cpu,
    /// A graphics adapter; `or_cpu` where the processor may take its place when it fails.
    #[cfg(feature = "gpu")]
    Gpu { gpu: Gpu, or_cpu: bool },
}

/// A fault to simulate, so that what happens then can be tested: see ARCHITECTURE.md.
#[cfg(feature = "gpu")]
const FAULT: &str = "UNSCATTER_FAULT";

impl Engine {
    /// What the arguments ask for. `auto` takes hardware, or an adapter that is named, where that can be opened.
    ///
    /// Errors: [`Error::Adapter`], and [`Error::Value`] for an adapter that is named and not to be used.
    #[cfg(feature = "gpu")]
    pub(super) fn choose(arguments: &BackendArguments) -> Result<Self> {
        let choice = Choice {
            name: arguments.adapter.clone(),
            fault: std::env::var(FAULT).ok().and_then(|fault| Fault::parse(&fault)),
            ..Choice::default()
        };
        match arguments.backend {
            Backend::Cpu => cpu(arguments),
            Backend::Gpu => Ok(Self::Gpu { gpu: Gpu::open(&choice)?, or_cpu: false }),
            Backend::Auto if arguments.adapter.is_none() && !may_have_hardware() => Ok(Self::Cpu),
            Backend::Auto => match Gpu::open(&choice) {
                Ok(gpu) => Ok(Self::Gpu { gpu, or_cpu: true }),
                Err(error) => {
                    // To have no adapter is usual; to ask for one that is not there is not.
                    match arguments.adapter {
                        Some(_) => tracing::warn!("{error}; computing on the processor"),
                        None => tracing::info!("{error}; computing on the processor"),
                    }
                    Ok(Self::Cpu)
                }
            },
        }
    }

    /// The processor: this build knows no other.
    #[cfg(not(feature = "gpu"))]
    pub(super) fn choose(arguments: &BackendArguments) -> Result<Self> {
        match (arguments.backend, &arguments.adapter) {
            (Backend::Cpu, _) => cpu(arguments),
            (Backend::Gpu, _) | (_, Some(_)) => Err(Error::Adapter {
                adapter: arguments.adapter.clone().unwrap_or_else(|| "any".to_owned()),
                problem: "cannot be used: this build has no GPU backend".to_owned(),
                remedy: "build it with the feature `gpu`, or use --backend cpu",
            }),
            _ => Ok(Self::Cpu),
        }
    }
}

/// The processor, for those who ask for it and for no adapter.
fn cpu(arguments: &BackendArguments) -> Result<Engine> {
    match &arguments.adapter {
        None => Ok(Engine::Cpu),
        Some(name) => Err(Error::value("--adapter", name, "left away with --backend cpu")),
    }
}
