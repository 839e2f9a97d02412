use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::Pod;

use super::adapter::{AdapterRecord, Choice, Fault, choose};
use super::compile::bind_group;
use super::fixed_point::Accumulation;
use super::kernel::{Kernel, RAYS};
use super::recorder::{Binding, Pipeline, Recorder, SLOT, SLOTS};
use super::sums::Waiting;
use crate::{Error, Result};

/// What to do about an adapter that has failed.
const WITHOUT: &str = "use --backend cpu; --resume continues from the last checkpoint";

/// The same, where its memory was too small.
const SMALLER: &str =
    "lower the maps' or views' sizes, or use --backend cpu; --resume continues from the last checkpoint";

/// A graphics adapter at work. Clones are the same one, and threads may share it.
///
/// Dispatches are recorded and handed over together when something is read. A failure of the device is kept, what comes
/// after it does nothing, and whatever returns a result says so. Threads record into one queue, so each waits for what the others
/// have recorded, too.
#[derive(Debug, Clone)]
pub struct Gpu(pub(super) Arc<Inner>);

/// Whether somebody wants to stop.
pub(super) type GivesUp = Arc<dyn Fn() -> bool + Send + Sync>;

/// A device, and what is under way on it.
///
/// Who takes several of its locks takes them in this order: `waiting`, `recorder`, `failure`. No [`Allocation`](super::memory::Allocation)
/// is dropped while `recorder` is locked, because that locks it.
pub(super) struct Inner {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) record: AdapterRecord,
    pub(super) binding_limit: u64,
    /// Workgroups along one axis of a dispatch.
    pub(super) workgroup_limit: u32,
    pub(super) float_atomics: bool,
    pub(super) sums_near: bool,
    pub(super) fault: Option<Fault>,
    pub(super) failure: Arc<Mutex<Option<Error>>>,
    pub(super) recorder: Mutex<Recorder>,
    pub(super) parameters: wgpu::Buffer,
    pub(super) pipelines: Mutex<HashMap<Kernel, Option<Arc<Pipeline>>>>,
    pub(super) waiting: Mutex<Waiting>,
    pub(super) held: AtomicU64,
    pub(super) round_trips: AtomicU64,
    pub(super) dispatches: AtomicU64,
    /// Submissions that the device has ended.
    pub(super) ended: Arc<AtomicU64>,
    pub(super) gives_up: Mutex<Option<GivesUp>>,
}

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("record", &self.record).finish_non_exhaustive()
    }
}

/// A lock that a panic elsewhere does not close.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Gpu {
    /// Opens the adapter of a choice.
    ///
    /// Errors: [`Error::Adapter`] when there is none, or it cannot be opened.
    pub fn open(choice: &Choice) -> Result<Self> {
        let (adapter, mut record) = choose(choice)?;
        if choice.fault == Some(Fault::Memory) {
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
            remedy: "use --backend cpu, or update its driver",
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
            sums_near: choice.sums_near.unwrap_or(record.is_hardware()),
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

    /// Waits until all that was recorded is done.
    pub fn finish(&self) -> Result<()> {
        self.hand_over();
        self.wait()
    }

    /// Hands over what is recorded, without waiting for it.
    pub(super) fn hand_over(&self) {
        self.submit(&mut lock(&self.0.recorder), Mark::None, |_| {});
    }

    /// Seconds on the device's own clock from before to after what `work` records; none where it has no clock.
    pub fn seconds(&self, work: impl FnOnce() -> Result<()>) -> Result<Option<f64>> {
        self.finish()?;
        if !self.0.record.timestamps {
            work()?;
            return Ok(None);
        }
        let device = &self.0.device;
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("time"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("time"),
                size: 16,
                usage,
                mapped_at_creation: false,
            })
        };
        let resolved = buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC);
        let staging = buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        // Two marks, each in a pass of its own: what lies between may be nothing, or many submissions.
        self.submit(&mut lock(&self.0.recorder), Mark::Begin(&queries), |_| {});
        work()?;
        self.submit(&mut lock(&self.0.recorder), Mark::End(&queries), |encoder| {
            encoder.resolve_query_set(&queries, 0..2, &resolved, 0);
            encoder.copy_buffer_to_buffer(&resolved, 0, &staging, 0, 16);
        });
        let ticks: Vec<u64> = self.map(&staging, 16)?;
        let period = f64::from(self.0.queue.get_timestamp_period());
        Ok(Some(ticks[1].saturating_sub(ticks[0]) as f64 * period * 1e-9))
    }

    /// Bytes that a kernel may see of one buffer.
    pub(super) fn binding_limit(&self) -> u64 {
        self.0.binding_limit
    }

    /// Whether deposits near an eye are summed up inside a workgroup first.
    pub(super) fn sums_near(&self) -> bool {
        self.0.sums_near
    }

    /// Rays that one dispatch walks at most, of so many bytes each; slabs of y begin where bindings may.
    pub(super) fn rays_at_once(&self, bytes: usize) -> usize {
        let seen = self.0.binding_limit as usize / bytes;
        let walked = self.0.workgroup_limit.saturating_mul(RAYS) as usize;
        (seen.min(walked) / 64 * 64).max(64)
    }

    /// How sums are made where many rays meet.
    pub(super) fn accumulation(&self, deterministic: bool) -> Accumulation {
        match (deterministic, self.0.float_atomics) {
            (true, _) => Accumulation::Fixed,
            (false, true) => Accumulation::Float,
            (false, false) => Accumulation::Swap,
        }
    }

    /// Records a kernel. `bindings` are those after the parameters, group by group.
    pub(super) fn dispatch(
        &self,
        kernel: Kernel,
        parameters: &impl Pod,
        bindings: &[&[Binding]],
        workgroups: [u32; 3],
    ) {
        if self.check().is_err() || workgroups.contains(&0) {
            return;
        }
        let Some(pipeline) = self.pipeline(kernel) else { return };
        let mut recorder = lock(&self.0.recorder);
        if recorder.is_full() {
            self.submit(&mut recorder, Mark::None, |_| {});
        }
        let mut groups = Vec::with_capacity(bindings.len());
        for (index, bound) in (0u32..).zip(bindings) {
            let mut all = Vec::with_capacity(bound.len() + 1);
            if index == 0 {
                all.push(Binding { buffer: self.0.parameters.clone(), offset: 0, size: SLOT as u64 });
            }
            all.extend_from_slice(bound);
            let layout = &pipeline.layouts[index as usize];
            groups.push(recorder.group(kernel, index, all, |all| bind_group(&self.0.device, layout, all)));
        }
        recorder.record(pipeline, groups, bytemuck::bytes_of(parameters), workgroups);
        self.0.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    /// The device, for what is no kernel.
    pub(super) fn device(&self) -> &wgpu::Device {
        &self.0.device
    }

    pub(super) fn failed(&self, problem: &str) -> Error {
        self.check().err().unwrap_or_else(|| Error::Adapter {
            adapter: self.0.record.name.clone(),
            problem: problem.to_owned(),
            remedy: WITHOUT,
        })
    }

    /// Hands over what is recorded, and what `more` adds.
    pub(super) fn submit(
        &self,
        recorder: &mut Recorder,
        mark: Mark,
        more: impl FnOnce(&mut wgpu::CommandEncoder),
    ) {
        if self.check().is_err() {
            return;
        }
        let mut encoder = self.0.device.create_command_encoder(&Default::default());
        if !recorder.is_empty() {
            self.0.queue.write_buffer(&self.0.parameters, 0, recorder.parameters());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            recorder.encode(&mut pass);
        }
        if let Some(times) = mark.writes() {
            let descriptor =
                wgpu::ComputePassDescriptor { label: Some("time"), timestamp_writes: Some(times) };
            drop(encoder.begin_compute_pass(&descriptor));
        }
        more(&mut encoder);
        self.0.queue.submit([encoder.finish()]);
        let ended = self.0.ended.clone();
        self.0.queue.on_submitted_work_done(move || {
            ended.fetch_add(1, Ordering::Relaxed);
        });
    }

    /// Workgroups along two axes, for so many items.
    pub(super) fn grid(&self, items: usize, each: u32) -> [u32; 3] {
        let groups = (items as u32).div_ceil(each);
        let across = groups.min(self.0.workgroup_limit);
        [across, groups.div_ceil(across.max(1)), 1]
    }
}

/// What a submission writes of the device's clock, after everything else.
pub(super) enum Mark<'a> {
    None,
    Begin(&'a wgpu::QuerySet),
    End(&'a wgpu::QuerySet),
}

impl<'a> Mark<'a> {
    fn writes(&self) -> Option<wgpu::ComputePassTimestampWrites<'a>> {
        let (query_set, index) = match self {
            Self::None => return None,
            Self::Begin(set) => (*set, 0),
            Self::End(set) => (*set, 1),
        };
        Some(wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: None,
            end_of_pass_write_index: Some(index),
        })
    }
}

/// Keeps the first failure: those that follow are its consequences.
pub(super) fn note(failure: &Mutex<Option<Error>>, error: Error) {
    tracing::debug!("{error}");
    lock(failure).get_or_insert(error);
}

/// The same error again; only those of an adapter are ever kept.
fn copy_of(error: &Error) -> Error {
    match error {
        Error::Adapter { adapter, problem, remedy } => {
            Error::Adapter { adapter: adapter.clone(), problem: problem.clone(), remedy }
        }
        Error::AdapterMemory { adapter, what, needed, held, remedy } => Error::AdapterMemory {
            adapter: adapter.clone(),
            what: what.clone(),
            needed: needed.clone(),
            held: held.clone(),
            remedy,
        },
        other => Error::Machine(other.to_string()),
    }
}

/// What a driver says, without its line breaks and frames.
pub(super) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
