//! An adapter that is open, and what it can do.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use super::adapter::{AdapterRecord, Choice, SimulatedFault, Tactics, choose};
use super::failure::{SMALLER, WITHOUT, copy_of, note, one_line};
use super::recorder::{Pipeline, Recorder, SLOT, SLOTS};
use super::results::Waiting;
use crate::gpu::kernels::{Accumulation, Program, RAYS};
use crate::operator::lock;
use crate::{Error, Result};

/// A graphics adapter at work. Clones are the same one, and threads may share it.
///
/// Dispatches are recorded and handed over together when something is read. A failure of the device is kept, what comes
/// after it does nothing, and whatever returns a result says so. Threads record into one queue, so each waits for what the others
/// have recorded, too.
#[derive(Debug, Clone)]
pub struct Gpu(pub(in crate::gpu) Arc<Inner>);

/// Whether somebody wants to stop.
pub(in crate::gpu) type GivesUp = Arc<dyn Fn() -> bool + Send + Sync>;

/// A device, and what is under way on it.
///
/// Who takes several of its locks takes them in this order: `waiting`, `recorder`, `failure`. No [`Allocation`](super::Allocation)
/// is dropped while `recorder` is locked, because that locks it.
pub(in crate::gpu) struct Inner {
    pub(in crate::gpu) device: wgpu::Device,
    pub(in crate::gpu) queue: wgpu::Queue,
    pub(in crate::gpu) record: AdapterRecord,
    pub(in crate::gpu) binding_limit: u64,
    /// Workgroups along one axis of a dispatch.
    pub(in crate::gpu) workgroup_limit: u32,
    pub(in crate::gpu) float_atomics: bool,
    pub(in crate::gpu) tactics: Tactics,
    pub(in crate::gpu) fault: Option<SimulatedFault>,
    pub(in crate::gpu) failure: Arc<Mutex<Option<Error>>>,
    pub(in crate::gpu) recorder: Mutex<Recorder>,
    pub(in crate::gpu) parameters: wgpu::Buffer,
    pub(in crate::gpu) pipelines: Mutex<HashMap<Program, Option<Arc<Pipeline>>>>,
    pub(in crate::gpu) waiting: Mutex<Waiting>,
    pub(in crate::gpu) held: AtomicU64,
    pub(in crate::gpu) round_trips: AtomicU64,
    pub(in crate::gpu) dispatches: AtomicU64,
    /// Submissions that the device has ended.
    pub(in crate::gpu) ended: Arc<AtomicU64>,
    pub(in crate::gpu) gives_up: Mutex<Option<GivesUp>>,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("record", &self.record).finish_non_exhaustive()
    }
}

impl Gpu {
    /// Opens the adapter of a choice.
    ///
    /// Errors: [`Error::Adapter`] when there is none, or it cannot be opened.
    pub fn open(choice: &Choice) -> Result<Self> {
        let (adapter, mut record) = choose(choice)?;
        if choice.fault == Some(SimulatedFault::Memory) {
            record.buffer_limit = 64 << 10;
        }
        let wanted = wgpu::Features::SHADER_FLOAT32_ATOMIC | wgpu::Features::TIMESTAMP_QUERY;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("unscatter"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| Error::Adapter {
            adapter: record.name.clone(),
            problem: format!("cannot be opened: {}", one_line(&error.to_string())),
            remedy: "compute on the processor, or update its driver",
        })?;
        let failure = Arc::new(Mutex::new(None));
        let (name, first) = (record.name.clone(), failure.clone());
        device.set_device_lost_callback(move |_, message| {
            let (problem, remedy) = match &one_line(&message)[..] {
                "" => ("was lost in the middle of the work".to_owned(), WITHOUT),
                said if said.to_lowercase().contains("memory") => {
                    (format!("was lost because it ran out of memory ({said})"), SMALLER)
                }
                said => (format!("was lost in the middle of the work ({said})"), WITHOUT),
            };
            note(&first, Error::Adapter { adapter: name.clone(), problem, remedy });
        });
        let (name, first) = (record.name.clone(), failure.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let problem = format!("has failed: {}", one_line(&error.to_string()));
            note(&first, Error::Adapter { adapter: name.clone(), problem, remedy: WITHOUT });
        }));
        let parameters = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("parameters"),
            size: (SLOT * SLOTS) as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let waiting = Mutex::new(Waiting::new(&device));
        let limit = record.binding_limit;
        let gpu = Self(Arc::new(Inner {
            binding_limit: choice.binding_limit.map_or(limit, |lower| lower.min(limit)),
            workgroup_limit: choice.workgroup_limit.unwrap_or(u32::MAX).min(record.workgroup_limit),
            float_atomics: record.float_atomics && !choice.without_float_atomics,
            tactics: choice.tactics.unwrap_or(match record.is_hardware() {
                true => Tactics::HARDWARE,
                false => Tactics::SOFTWARE,
            }),
            fault: choice.fault,
            device,
            queue,
            record,
            failure,
            recorder: Mutex::default(),
            parameters,
            pipelines: Mutex::default(),
            waiting,
            held: AtomicU64::new(0),
            round_trips: AtomicU64::new(0),
            dispatches: AtomicU64::new(0),
            ended: Arc::default(),
            gives_up: Mutex::default(),
        }));
        gpu.check()?;
        Ok(gpu)
    }

    /// What it is.
    pub fn record(&self) -> &AdapterRecord {
        &self.0.record
    }

    /// How often the host has waited for it.
    pub fn round_trips(&self) -> u64 {
        self.0.round_trips.load(Ordering::Relaxed)
    }

    /// How many kernels it was given to run.
    pub fn dispatches(&self) -> u64 {
        self.0.dispatches.load(Ordering::Relaxed)
    }

    /// Bytes of it that are in use.
    pub fn held(&self) -> u64 {
        self.0.held.load(Ordering::Relaxed)
    }

    /// Gives the device up, as a driver that is restarted does; everything after this fails. For tests of what happens then.
    pub fn destroy(&self) {
        self.0.device.destroy();
    }

    /// Errors: what has gone wrong on the device so far.
    pub fn check(&self) -> Result<()> {
        lock(&self.0.failure).as_ref().map_or(Ok(()), |error| Err(copy_of(error)))
    }

    /// Bytes that a kernel may see of one buffer.
    pub(in crate::gpu) fn binding_limit(&self) -> u64 {
        self.0.binding_limit
    }

    /// Workgroups along one axis of a dispatch.
    pub(in crate::gpu) fn workgroup_limit(&self) -> u32 {
        self.0.workgroup_limit
    }

    /// Whether a kernel sees so many bytes as a whole.
    ///
    /// Errors: [`Error::TooLarge`].
    pub(in crate::gpu) fn expect_visible(
        &self,
        what: impl Into<String>,
        bytes: u64,
        remedy: &'static str,
    ) -> Result<()> {
        if bytes <= self.0.binding_limit {
            return Ok(());
        }
        Err(Error::TooLarge {
            what: what.into(),
            needed: format!("{bytes} bytes"),
            limit: format!("{} bytes", self.0.binding_limit),
            remedy,
        })
    }

    /// Whether pictures are drawn there quicker than on the processor.
    pub fn draws(&self) -> bool {
        self.0.tactics.draws
    }

    /// How it is used.
    pub(in crate::gpu) fn tactics(&self) -> Tactics {
        self.0.tactics
    }

    /// Rays that one dispatch walks at most, of so many bytes each; slabs of y begin where bindings may.
    pub(in crate::gpu) fn rays_at_once(&self, bytes: usize) -> usize {
        let seen = self.0.binding_limit as usize / bytes;
        let walked = self.0.workgroup_limit.saturating_mul(RAYS) as usize;
        (seen.min(walked) / 64 * 64).max(64)
    }

    /// How sums are made where many rays meet.
    pub(in crate::gpu) fn accumulation(&self, deterministic: bool) -> Accumulation {
        match (deterministic, self.0.float_atomics) {
            (true, _) => Accumulation::Fixed,
            (false, true) => Accumulation::Float,
            (false, false) => Accumulation::Swap,
        }
    }

    /// The device, for what is no kernel.
    pub(in crate::gpu) fn device(&self) -> &wgpu::Device {
        &self.0.device
    }

    pub(in crate::gpu) fn failed(&self, problem: &str) -> Error {
        self.check().err().unwrap_or_else(|| Error::Adapter {
            adapter: self.0.record.name.clone(),
            problem: problem.to_owned(),
            remedy: WITHOUT,
        })
    }
}
