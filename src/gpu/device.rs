use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::Pod;

use super::adapter::{AdapterRecord, Choice, Fault, choose};
use super::fixed_point::Accumulation;
use super::kernel::{Access, Kernel};
use super::recorder::{Binding, Pipeline, Recorder, SLOT, SLOTS};
use super::sums::Waiting;
use crate::{Error, Result};

/// Bytes that are read back at once.
const READ_AT_ONCE: u64 = 64 << 20;
/// What to do about an adapter that has failed.
const WITHOUT: &str = "use --backend cpu; --resume continues from the last checkpoint";

/// A graphics adapter at work, for one thread. Clones are the same one.
///
/// Dispatches are recorded and handed over together when something is read. A failure of the device is kept, what comes
/// after it does nothing, and whatever returns a result says so.
#[derive(Debug, Clone)]
pub struct Gpu(pub(super) Rc<Inner>);

#[derive(Debug)]
pub(super) struct Inner {
    pub(super) device: wgpu::Device,
    queue: wgpu::Queue,
    record: AdapterRecord,
    binding_limit: u64,
    float_atomics: bool,
    sums_near: bool,
    fault: Option<Fault>,
    failure: Arc<Mutex<Option<Error>>>,
    recorder: RefCell<Recorder>,
    parameters: wgpu::Buffer,
    pipelines: RefCell<HashMap<Kernel, Option<Arc<Pipeline>>>>,
    pub(super) waiting: RefCell<Waiting>,
    held: Cell<u64>,
    round_trips: Cell<u64>,
    dispatches: Cell<u64>,
}

/// Memory of the device.
#[derive(Debug)]
pub(super) struct Allocation {
    inner: Rc<Inner>,
    pub(super) buffer: wgpu::Buffer,
}

impl Drop for Allocation {
    fn drop(&mut self) {
        self.inner.held.set(self.inner.held.get() - self.buffer.size());
        self.inner.recorder.borrow_mut().forget(&self.buffer);
    }
}

impl Allocation {
    /// All of it.
    pub(super) fn whole(&self) -> Binding {
        Binding { buffer: self.buffer.clone(), offset: 0, size: self.buffer.size() }
    }

    /// `size` bytes from `offset` on.
    pub(super) fn part(&self, offset: u64, size: u64) -> Binding {
        Binding { buffer: self.buffer.clone(), offset, size }
    }
}

/// A lock that a panic elsewhere does not close.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
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
            let problem = format!("was lost in the middle of the work ({})", one_line(&message));
            note(&first, Error::Adapter { adapter: name.clone(), problem, remedy: WITHOUT });
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
        let waiting = RefCell::new(Waiting::new(&device));
        let limit = record.binding_limit;
        let gpu = Self(Rc::new(Inner {
            binding_limit: choice.binding_limit.map_or(limit, |lower| lower.min(limit)),
            float_atomics: record.float_atomics && !choice.without_float_atomics,
            sums_near: choice.sums_near.unwrap_or(record.is_hardware()),
            fault: choice.fault,
            device,
            queue,
            record,
            failure,
            recorder: RefCell::default(),
            parameters,
            pipelines: RefCell::default(),
            waiting,
            held: Cell::new(0),
            round_trips: Cell::new(0),
            dispatches: Cell::new(0),
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
        self.0.round_trips.get()
    }

    /// How many kernels it was given to run.
    pub fn dispatches(&self) -> u64 {
        self.0.dispatches.get()
    }

    /// Bytes of it that are in use.
    pub fn held(&self) -> u64 {
        self.0.held.get()
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
        self.submit(&mut self.0.recorder.borrow_mut(), None, |_| {});
        self.wait()
    }

    /// Seconds that the device itself takes for what `work` records; none where it cannot tell.
    ///
    /// `work` must fit one submission: no more than a thousand dispatches, and nothing read.
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
        work()?;
        self.submit(&mut self.0.recorder.borrow_mut(), Some(&queries), |encoder| {
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

    /// How sums are made where many rays meet.
    pub(super) fn accumulation(&self, deterministic: bool) -> Accumulation {
        match (deterministic, self.0.float_atomics) {
            (true, _) => Accumulation::Fixed,
            (false, true) => Accumulation::Float,
            (false, false) => Accumulation::Swap,
        }
    }

    /// Memory of zeros.
    ///
    /// Where there is no room this is noted as a failure, and what is given is of no use.
    pub(super) fn allocate(&self, what: &str, bytes: u64) -> Allocation {
        self.try_allocate(what, bytes).unwrap_or_else(|error| {
            note(&self.0.failure, error);
            self.create(4)
        })
    }

    /// Memory of zeros.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(super) fn try_allocate(&self, what: &str, bytes: u64) -> Result<Allocation> {
        let bytes = bytes.next_multiple_of(4).max(4);
        self.guarded(what, bytes, || self.create(bytes))
    }

    /// Something that takes memory, if there is enough.
    ///
    /// Errors: [`Error::AdapterMemory`].
    fn guarded<T>(&self, what: &str, bytes: u64, make: impl FnOnce() -> T) -> Result<T> {
        self.check()?;
        let refused = || Error::AdapterMemory {
            adapter: self.0.record.name.clone(),
            what: what.to_owned(),
            needed: mebibytes(bytes),
            held: mebibytes(self.held()),
            remedy: "lower light_map.size or the views' sizes, choose the strategy `matrix-free`, or use --backend cpu",
        };
        if bytes > self.0.record.buffer_limit {
            return Err(refused());
        }
        let scope = self.0.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        match pollster::block_on(scope.pop()) {
            None => Ok(made),
            Some(_) => Err(refused()),
        }
    }

    fn create(&self, bytes: u64) -> Allocation {
        use wgpu::BufferUsages as Usages;
        let buffer = self.0.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes,
            usage: Usages::STORAGE | Usages::UNIFORM | Usages::COPY_SRC | Usages::COPY_DST,
            mapped_at_creation: false,
        });
        self.0.held.set(self.0.held.get() + bytes);
        Allocation { inner: self.0.clone(), buffer }
    }

    /// Memory with these values.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(super) fn upload<T: Pod>(&self, what: &str, values: &[T]) -> Result<Allocation> {
        let allocation = self.try_allocate(what, size_of_val(values) as u64)?;
        self.write(&allocation, 0, values);
        Ok(allocation)
    }

    /// Overwrites memory from byte `offset` on, after all that was recorded before.
    pub(super) fn write<T: Pod>(&self, allocation: &Allocation, offset: u64, values: &[T]) {
        let mut recorder = self.0.recorder.borrow_mut();
        if self.check().is_err() || values.is_empty() {
            return;
        }
        self.submit(&mut recorder, None, |_| {});
        self.0.queue.write_buffer(&allocation.buffer, offset, bytemuck::cast_slice(values));
    }

    /// Records a kernel. `bindings` are those after the parameters, group by group.
    pub(super) fn dispatch(
        &self,
        kernel: Kernel,
        parameters: &impl Pod,
        bindings: &[&[Binding]],
        workgroups: [u32; 2],
    ) {
        if self.check().is_err() || workgroups.contains(&0) {
            return;
        }
        let Some(pipeline) = self.pipeline(kernel) else { return };
        let mut recorder = self.0.recorder.borrow_mut();
        if recorder.is_full() {
            self.submit(&mut recorder, None, |_| {});
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
        self.0.dispatches.set(self.0.dispatches.get() + 1);
    }

    /// Reads memory back: a round trip.
    pub(super) fn read<T: Pod>(&self, allocation: &Allocation, offset: u64, count: usize) -> Result<Vec<T>> {
        self.check()?;
        let (mut values, bytes) = (Vec::with_capacity(count), (count * size_of::<T>()) as u64);
        let mut done = 0;
        while done < bytes {
            let part = (bytes - done).min(READ_AT_ONCE);
            let staging = self.0.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("reading"),
                size: part,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            self.submit(&mut self.0.recorder.borrow_mut(), None, |encoder| {
                encoder.copy_buffer_to_buffer(&allocation.buffer, offset + done, &staging, 0, part);
            });
            values.extend_from_slice(&self.map::<T>(&staging, part)?);
            done += part;
        }
        Ok(values)
    }

    /// The device, for what is no kernel.
    pub(super) fn device(&self) -> &wgpu::Device {
        &self.0.device
    }

    /// Corners of triangles to draw.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(super) fn upload_corners<T: Pod>(&self, what: &str, corners: &[T]) -> Result<wgpu::Buffer> {
        let bytes = size_of_val(corners) as u64;
        self.guarded(what, bytes, || {
            self.0.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: bytes,
                usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
        .inspect(|buffer| self.0.queue.write_buffer(buffer, 0, bytemuck::cast_slice(corners)))
    }

    /// Draws, and reads the `bytes` that drawing has left: a round trip.
    pub(super) fn draw_and_read<T: Pod>(
        &self,
        bytes: u64,
        draw: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Result<Vec<T>> {
        let staging = self.guarded("a picture", bytes, || {
            self.0.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("reading"),
                size: bytes,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        })?;
        self.submit(&mut self.0.recorder.borrow_mut(), None, |encoder| draw(encoder, &staging));
        self.map(&staging, bytes)
    }

    /// A pipeline that draws.
    ///
    /// Errors: [`Error::Adapter`] with what the compiler says.
    pub(super) fn compile_drawing(
        &self,
        name: &'static str,
        source: &str,
        make: impl FnOnce(&wgpu::Device, &wgpu::ShaderModule) -> wgpu::RenderPipeline,
    ) -> Result<wgpu::RenderPipeline> {
        self.check()?;
        self.compiled(name, || {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let device = &self.0.device;
            let module =
                device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
            make(device, &module)
        })
    }

    /// Hands over what is recorded and copies `bytes` of a buffer into one that is then read: a round trip.
    pub(super) fn copy_and_read(
        &self,
        from: &wgpu::Buffer,
        staging: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Vec<f32>> {
        self.check()?;
        self.submit(&mut self.0.recorder.borrow_mut(), None, |encoder| {
            encoder.copy_buffer_to_buffer(from, 0, staging, 0, bytes);
        });
        self.map(staging, bytes)
    }

    fn map<T: Pod>(&self, staging: &wgpu::Buffer, bytes: u64) -> Result<Vec<T>> {
        let slice = staging.slice(0..bytes);
        let mapped = Arc::new(Mutex::new(false));
        let told = mapped.clone();
        slice.map_async(wgpu::MapMode::Read, move |result| *lock(&told) = result.is_ok());
        self.wait()?;
        if !*lock(&mapped) {
            return Err(self.failed("did not give its results back"));
        }
        let values = match slice.get_mapped_range() {
            Ok(view) => bytemuck::pod_collect_to_vec(&view),
            Err(_) => return Err(self.failed("did not give its results back")),
        };
        staging.unmap();
        Ok(values)
    }

    fn wait(&self) -> Result<()> {
        self.0.round_trips.set(self.0.round_trips.get() + 1);
        if self.0.fault == Some(Fault::Loss(self.0.round_trips.get())) {
            self.destroy();
        }
        let waited = self.0.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|_| self.failed("does not answer"))
    }

    fn failed(&self, problem: &str) -> Error {
        self.check().err().unwrap_or_else(|| Error::Adapter {
            adapter: self.0.record.name.clone(),
            problem: problem.to_owned(),
            remedy: WITHOUT,
        })
    }

    /// Hands over what is recorded, and what `more` adds.
    fn submit(
        &self,
        recorder: &mut Recorder,
        timed: Option<&wgpu::QuerySet>,
        more: impl FnOnce(&mut wgpu::CommandEncoder),
    ) {
        if self.check().is_err() {
            return;
        }
        let mut encoder = self.0.device.create_command_encoder(&Default::default());
        if !recorder.is_empty() {
            self.0.queue.write_buffer(&self.0.parameters, 0, recorder.parameters());
            let times = timed.map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            });
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes: times });
            recorder.encode(&mut pass);
        }
        more(&mut encoder);
        self.0.queue.submit([encoder.finish()]);
    }

    fn pipeline(&self, kernel: Kernel) -> Option<Arc<Pipeline>> {
        let mut pipelines = self.0.pipelines.borrow_mut();
        if let Some(known) = pipelines.get(&kernel) {
            return known.clone();
        }
        let source = match self.0.fault {
            Some(Fault::Compilation) => "this is no kernel".to_owned(),
            _ => kernel.source(),
        };
        let made = self.compile(kernel, &source).map_err(|error| note(&self.0.failure, error)).ok();
        pipelines.insert(kernel, made.clone());
        made
    }

    /// Errors: [`Error::Adapter`] with what the compiler says.
    fn compile(&self, kernel: Kernel, source: &str) -> Result<Arc<Pipeline>> {
        self.compiled(kernel.name(), || Arc::new(pipeline(&self.0.device, kernel, source)))
    }

    /// Something that is compiled, if the adapter can.
    ///
    /// Errors: [`Error::Adapter`] with what the compiler says.
    fn compiled<T>(&self, name: &str, make: impl FnOnce() -> T) -> Result<T> {
        let scope = self.0.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        match pollster::block_on(scope.pop()) {
            None => Ok(made),
            Some(error) => Err(Error::Adapter {
                adapter: self.0.record.name.clone(),
                problem: format!("cannot compile the kernel `{name}`: {}", one_line(&error.to_string())),
                remedy: "use --backend cpu, or update its driver",
            }),
        }
    }
}

fn pipeline(device: &wgpu::Device, kernel: Kernel, source: &str) -> Pipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(kernel.name()),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let layouts: Vec<_> = kernel.bindings().iter().map(|group| group_layout(device, group)).collect();
    let all: Vec<_> = layouts.iter().map(Some).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(kernel.name()),
        bind_group_layouts: &all,
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name()),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    Pipeline { pipeline, layouts }
}

fn group_layout(device: &wgpu::Device, accesses: &[Access]) -> wgpu::BindGroupLayout {
    let entry = |(binding, access): (u32, &Access)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match access {
                Access::Parameters | Access::Uniform => wgpu::BufferBindingType::Uniform,
                Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
                Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
            },
            has_dynamic_offset: *access == Access::Parameters,
            min_binding_size: None,
        },
        count: None,
    };
    let entries: Vec<_> = (0u32..).zip(accesses).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}

fn bind_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    bindings: &[Binding],
) -> wgpu::BindGroup {
    let mut entries = Vec::with_capacity(bindings.len());
    for (binding, Binding { buffer, offset, size }) in (0u32..).zip(bindings) {
        let size = std::num::NonZeroU64::new(*size);
        let part = wgpu::BufferBinding { buffer, offset: *offset, size };
        entries.push(wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::Buffer(part) });
    }
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// Keeps the first failure: those that follow are its consequences.
fn note(failure: &Mutex<Option<Error>>, error: Error) {
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
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
