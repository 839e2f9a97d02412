//! What computes: the processor, or a graphics adapter.

use super::args::{Backend, BackendArguments};
use super::resume::Keeper;
#[cfg(feature = "gpu")]
use crate::gpu::{Choice, Fault, Gpu, may_have_hardware};
use crate::problem::Paused;
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

/// What computes at the moment.
pub(super) enum On {
    /// The processor.
    Cpu,
    /// A graphics adapter.
    #[cfg(feature = "gpu")]
    Gpu(Gpu),
}

/// A fault to simulate, so that what happens then can be tested: see ARCHITECTURE.md.
pub(super) const FAULT: &str = "UNSCATTER_FAULT";

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
            Backend::Gpu => Ok(Self::Gpu { gpu: open(&choice)?, or_cpu: false }),
            Backend::Auto if arguments.adapter.is_none() && !may_have_hardware() => Ok(Self::Cpu),
            Backend::Auto => match open(&choice) {
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

impl Engine {
    /// Lets what computes do some work. When an adapter fails at it and the processor may take its place, it goes on from the
    /// last checkpoint of this run, or from what was resumed, and computes all that follows, too.
    pub(super) fn run<T>(
        &mut self,
        checkpoint: &Keeper,
        resume: bool,
        resumed: Option<Paused>,
        mut work: impl FnMut(On, Option<Paused>) -> Result<T>,
    ) -> Result<T> {
        #[cfg(feature = "gpu")]
        if let Self::Gpu { gpu, or_cpu } = self {
            match work(On::Gpu(gpu.clone()), resumed) {
                Err(error) if *or_cpu && error.is_of_adapter() => {
                    tracing::warn!("{error}");
                    // What the adapter has saved is not lost: its state is as good as the processor's own.
                    let resumed = checkpoint.latest().or_else(|| checkpoint.read().ok().filter(|_| resume));
                    tracing::warn!(
                        "computing on the processor, from {}",
                        if resumed.is_some() { "the last checkpoint" } else { "the start" }
                    );
                    *self = Self::Cpu;
                    return work(On::Cpu, resumed);
                }
                done => return done,
            }
        }
        let _only_after_a_failure = (checkpoint, resume);
        work(On::Cpu, resumed)
    }
}

/// An adapter that Ctrl-C is heard at, should it hang.
#[cfg(feature = "gpu")]
fn open(choice: &Choice) -> Result<Gpu> {
    let gpu = Gpu::open(choice)?;
    gpu.give_up_when(super::progress::interrupted);
    Ok(gpu)
}

/// The processor, for those who ask for it and for no adapter.
fn cpu(arguments: &BackendArguments) -> Result<Engine> {
    match &arguments.adapter {
        None => Ok(Engine::Cpu),
        Some(name) => Err(Error::value("--adapter", name, "left away with --backend cpu")),
    }
}
