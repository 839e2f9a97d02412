//! What computes: the processor, or a graphics adapter.

use super::checkpoint::Keeper;
use super::observer::Stop;
#[cfg(feature = "gpu")]
use crate::Warning;
#[cfg(feature = "gpu")]
use crate::gpu::{Choice, Gpu, SimulatedFault, may_have_hardware};
use crate::problem::{Canvas, Paused};
use crate::{Error, Result};

/// What is to compute.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Backend {
    /// A graphics card where there is one that serves, else the processor.
    #[default]
    Auto,
    /// The processor, on all its cores.
    Cpu,
    /// A graphics card, and nothing else.
    Gpu,
}

/// Which engine a job asks for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct EngineChoice {
    /// What is to compute.
    pub backend: Backend,
    /// A graphics adapter, by a part of its name or its bus. Software adapters are used only when named.
    pub adapter: Option<String>,
    /// A fault of the adapter to simulate, such as `loss:3`: see ARCHITECTURE.md.
    pub fault: Option<String>,
}

/// What computes.
#[derive(Debug, Clone)]
pub(crate) enum Engine {
    /// The processor.
    Cpu,
    /// A graphics adapter; `or_cpu` where the processor may take its place when it fails.
    #[cfg(feature = "gpu")]
    Gpu { gpu: Gpu, or_cpu: bool },
}

/// What computes at the moment.
#[derive(Clone)]
pub(crate) enum On {
    /// The processor.
    Cpu,
    /// A graphics adapter.
    #[cfg(feature = "gpu")]
    Gpu(Gpu),
}

impl Engine {
    /// What is asked for. `auto` takes hardware, or an adapter that is named, where that can be opened. An adapter that hangs is given up
    /// when `stop` is asked for.
    ///
    /// Errors: [`Error::Adapter`], and [`Error::Value`] for an adapter that is named and not to be used.
    #[cfg(feature = "gpu")]
    pub(crate) fn open(asked: &EngineChoice, stop: &Stop) -> Result<Self> {
        let choice = Choice {
            name: asked.adapter.clone(),
            fault: asked.fault.as_deref().and_then(SimulatedFault::parse),
            ..Choice::default()
        };
        let open = || -> Result<Gpu> {
            let (gpu, stop) = (Gpu::open(&choice)?, stop.clone());
            gpu.give_up_when(move || stop.is_asked());
            Ok(gpu)
        };
        match asked.backend {
            Backend::Cpu => cpu(asked),
            Backend::Gpu => Ok(Self::Gpu { gpu: open()?, or_cpu: false }),
            Backend::Auto if asked.adapter.is_none() && !may_have_hardware() => Ok(Self::Cpu),
            Backend::Auto => match open() {
                Ok(gpu) => Ok(Self::Gpu { gpu, or_cpu: true }),
                Err(error) => {
                    // To have no adapter is usual; to ask for one that is not there is not.
                    match asked.adapter {
                        Some(_) => {
                            Warning::new("adapter", format!("{error}; computing on the processor"), "").tell()
                        }
                        None => tracing::info!("{error}; computing on the processor"),
                    }
                    Ok(Self::Cpu)
                }
            },
        }
    }

    /// The processor: this build knows no other.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn open(asked: &EngineChoice, _stop: &Stop) -> Result<Self> {
        match (asked.backend, &asked.adapter) {
            (Backend::Cpu, _) => cpu(asked),
            (Backend::Gpu, _) | (_, Some(_)) => Err(Error::Adapter {
                adapter: asked.adapter.clone().unwrap_or_else(|| "any".to_owned()),
                problem: "cannot be used: this build has no GPU backend".to_owned(),
                remedy: "build it with the feature `gpu`, or compute on the processor",
            }),
            _ => Ok(Self::Cpu),
        }
    }

    /// The adapter, if one computes.
    #[cfg(feature = "gpu")]
    pub(crate) fn gpu(&self) -> Option<&Gpu> {
        match self {
            Self::Gpu { gpu, .. } => Some(gpu),
            Self::Cpu => None,
        }
    }
}

impl Engine {
    /// Lets what computes do some work. When an adapter fails at it and the processor may take its place, it goes on from the
    /// last checkpoint of this run, or from what was resumed, and computes all that follows, too.
    pub(super) fn run<T>(
        &mut self,
        checkpoint: Option<&Keeper>,
        resume: bool,
        resumed: Option<Paused>,
        mut work: impl FnMut(On, Option<Paused>) -> Result<T>,
    ) -> Result<T> {
        #[cfg(feature = "gpu")]
        if let Self::Gpu { gpu, or_cpu } = self {
            match work(On::Gpu(gpu.clone()), resumed) {
                Err(error) if *or_cpu && error.is_of_adapter() => {
                    Warning::new("adapter", error.to_string(), "").tell();
                    // What the adapter has saved is not lost: its state is as good as the processor's own.
                    let resumed = checkpoint
                        .and_then(|kept| kept.latest().or_else(|| kept.read().ok().filter(|_| resume)));
                    let from = if resumed.is_some() { "the last checkpoint" } else { "the start" };
                    Warning::new("adapter", format!("computing on the processor, from {from}"), "").tell();
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

impl Engine {
    /// Lets what computes draw. When an adapter fails at it and the processor may take its place, that draws, and computes all that follows.
    pub(super) fn draw<T>(&mut self, mut draw: impl FnMut(&Canvas) -> Result<T>) -> Result<T> {
        #[cfg(feature = "gpu")]
        if let Self::Gpu { gpu, or_cpu } = self
            && gpu.draws()
        {
            match draw(&Canvas::Adapter(gpu.clone())) {
                Err(error) if *or_cpu && error.is_of_adapter() => {
                    Warning::new("adapter", format!("{error}; drawing on the processor"), "").tell();
                    *self = Self::Cpu;
                }
                drawn => return drawn,
            }
        }
        draw(&Canvas::Processor)
    }
}

/// The processor, for those who ask for it and for no adapter.
fn cpu(asked: &EngineChoice) -> Result<Engine> {
    match &asked.adapter {
        None => Ok(Engine::Cpu),
        Some(name) => Err(Error::value("adapter", name, "left away where the processor computes")),
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::gpu::Tactics;

    #[test]
    #[ignore = "needs a graphics adapter; ./test.sh brings one"]
    fn what_a_lost_adapter_should_have_drawn_the_processor_draws() {
        let draw = |canvas: &Canvas| match canvas {
            Canvas::Processor => Ok(()),
            Canvas::Adapter(_) => {
                Err(Error::Adapter { adapter: "one".to_owned(), problem: "is gone".to_owned(), remedy: "" })
            }
        };
        let choice = Choice { software: true, tactics: Some(Tactics::HARDWARE), ..Choice::default() };
        let gpu = Gpu::open(&choice).unwrap();
        let mut strict = Engine::Gpu { gpu: gpu.clone(), or_cpu: false };
        assert!(strict.draw(draw).is_err());
        let mut lenient = Engine::Gpu { gpu, or_cpu: true };
        let (drawn, told) = crate::warning::collected(|| lenient.draw(draw));
        assert!(drawn.is_ok() && told.len() == 1);
        assert!(matches!(lenient, Engine::Cpu));
    }
}
