//! Memory of the device, and what goes there and comes back.

use std::sync::atomic::Ordering;
use std::sync::{Arc, mpsc};

use bytemuck::Pod;

use super::failure::note;
use super::gpu::{Gpu, Inner};
use super::patience::GRACE;
use super::recorder::Binding;
use super::submission::Timestamp;
use crate::operator::lock;
use crate::{Error, Result};

/// Bytes that are read back at once.
const READ_AT_ONCE: u64 = 64 << 20;
/// Bytes that are sent at once, through memory of that size which the host sees; a multiple of 4.
const SENT_AT_ONCE: usize = 16 << 20;
/// How often that is done before waiting for it, so that no more than 128 MiB are under way.
const SENDS_UNDER_WAY: usize = 8;
/// Bytes up to which wgpu's own way of sending is taken. It loses the device where there is no room for as many again.
const SMALL: usize = 64 << 10;

/// Memory of the device.
#[derive(Debug)]
pub(in crate::gpu) struct Allocation {
    inner: Arc<Inner>,
    pub(in crate::gpu) buffer: wgpu::Buffer,
}

/// Memory of the device that is kept free for what comes later.
#[derive(Debug)]
pub(in crate::gpu) struct Reserve {
    _taken: Vec<Allocation>,
}

impl Drop for Allocation {
    fn drop(&mut self) {
        self.inner.held.fetch_sub(self.buffer.size(), Ordering::Relaxed);
        lock(&self.inner.recorder).forget(&self.buffer);
    }
}

impl Allocation {
    /// All of it.
    pub(in crate::gpu) fn whole(&self) -> Binding {
        Binding { buffer: self.buffer.clone(), offset: 0, size: self.buffer.size() }
    }

    /// `size` bytes from `offset` on.
    pub(in crate::gpu) fn part(&self, offset: u64, size: u64) -> Binding {
        Binding { buffer: self.buffer.clone(), offset, size }
    }
}

impl Gpu {
    /// Memory of zeros.
    ///
    /// Where there is no room this is noted as a failure, and what is given is of no use.
    pub(in crate::gpu) fn allocate(&self, what: &str, bytes: u64) -> Allocation {
        self.try_allocate(what, bytes).unwrap_or_else(|error| {
            note(&self.0.failure, error);
            self.create(4)
        })
    }

    /// Memory of zeros.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(in crate::gpu) fn try_allocate(&self, what: &str, bytes: u64) -> Result<Allocation> {
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
            remedy: "lower light_map.size or the views' sizes, choose the strategy `matrix-free`, or compute on the processor",
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
        self.0.held.fetch_add(bytes, Ordering::Relaxed);
        Allocation { inner: self.0.clone(), buffer }
    }

    /// Memory with these values.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(in crate::gpu) fn upload<T: Pod>(&self, what: &str, values: &[T]) -> Result<Allocation> {
        let allocation = self.try_allocate(what, size_of_val(values) as u64)?;
        self.send(&allocation.buffer, 0, bytemuck::cast_slice(values))?;
        Ok(allocation)
    }

    /// Overwrites memory from byte `offset` on, after all that was recorded before. A failure is noted.
    pub(in crate::gpu) fn write<T: Pod>(&self, allocation: &Allocation, offset: u64, values: &[T]) {
        if let Err(error) = self.send(&allocation.buffer, offset, bytemuck::cast_slice(values)) {
            note(&self.0.failure, error);
        }
    }

    /// Errors: [`Error::AdapterMemory`] where there is no room for what is under way.
    fn send(&self, to: &wgpu::Buffer, offset: u64, bytes: &[u8]) -> Result<()> {
        self.check()?;
        if bytes.is_empty() {
            return Ok(());
        }
        self.hand_over();
        if bytes.len() <= SMALL {
            self.0.queue.write_buffer(to, offset, bytes);
            return self.check();
        }
        for (count, part) in (1..).zip(bytes.chunks(SENT_AT_ONCE)) {
            let len = part.len() as u64;
            let staging = self.guarded("what is sent to it", len, || {
                self.0.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("sending"),
                    size: len,
                    usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::MAP_WRITE,
                    mapped_at_creation: true,
                })
            })?;
            match staging.get_mapped_range_mut(..) {
                Ok(mut view) => view.copy_from_slice(part),
                Err(_) => return Err(self.failed("does not take what is sent to it")),
            }
            staging.unmap();
            let offset = offset + ((count - 1) * SENT_AT_ONCE) as u64;
            self.submit(&mut lock(&self.0.recorder), Timestamp::None, |encoder| {
                encoder.copy_buffer_to_buffer(&staging, 0, to, offset, len);
            });
            if count % SENDS_UNDER_WAY == 0 {
                self.wait()?;
            }
        }
        self.check()
    }

    /// Takes so many bytes for as long as what is given is kept, so that others leave them free.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(in crate::gpu) fn reserve(&self, bytes: u64) -> Result<Reserve> {
        let limit = self.0.record.buffer_limit.max(4);
        let parts = (0..bytes.div_ceil(limit)).map(|part| (bytes - part * limit).min(limit));
        let taken =
            parts.map(|part| self.try_allocate("the vectors of a solve", part)).collect::<Result<_>>()?;
        Ok(Reserve { _taken: taken })
    }

    /// Memory that the host reads.
    ///
    /// Errors: [`Error::AdapterMemory`].
    fn memory_to_read(&self, what: &str, bytes: u64) -> Result<wgpu::Buffer> {
        self.guarded(what, bytes, || {
            self.0.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("reading"),
                size: bytes,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        })
    }

    /// Reads memory back: a round trip.
    pub(in crate::gpu) fn read<T: Pod>(
        &self,
        allocation: &Allocation,
        offset: u64,
        count: usize,
    ) -> Result<Vec<T>> {
        self.check()?;
        let (mut values, bytes) = (Vec::with_capacity(count), (count * size_of::<T>()) as u64);
        let mut done = 0;
        while done < bytes {
            let part = (bytes - done).min(READ_AT_ONCE);
            let staging = self.memory_to_read("what it gives back", part)?;
            self.submit(&mut lock(&self.0.recorder), Timestamp::None, |encoder| {
                encoder.copy_buffer_to_buffer(&allocation.buffer, offset + done, &staging, 0, part);
            });
            values.extend_from_slice(&self.map::<T>(&staging, part)?);
            done += part;
        }
        Ok(values)
    }

    /// Corners of triangles to draw.
    ///
    /// Errors: [`Error::AdapterMemory`].
    pub(in crate::gpu) fn upload_corners<T: Pod>(&self, what: &str, corners: &[T]) -> Result<wgpu::Buffer> {
        let bytes = size_of_val(corners) as u64;
        self.guarded(what, bytes, || {
            self.0.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: bytes,
                usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
        .and_then(|buffer| {
            self.send(&buffer, 0, bytemuck::cast_slice(corners))?;
            Ok(buffer)
        })
    }

    /// Draws, and reads the `bytes` that drawing has left: a round trip.
    pub(in crate::gpu) fn draw_and_read<T: Pod>(
        &self,
        bytes: u64,
        draw: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Result<Vec<T>> {
        let staging = self.memory_to_read("a picture", bytes)?;
        self.submit(&mut lock(&self.0.recorder), Timestamp::None, |encoder| draw(encoder, &staging));
        self.map(&staging, bytes)
    }

    /// Hands over what is recorded and copies `bytes` of a buffer into one that is then read: a round trip.
    pub(in crate::gpu) fn copy_and_read(
        &self,
        from: &wgpu::Buffer,
        staging: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Vec<f32>> {
        self.check()?;
        self.submit(&mut lock(&self.0.recorder), Timestamp::None, |encoder| {
            encoder.copy_buffer_to_buffer(from, 0, staging, 0, bytes);
        });
        self.map(staging, bytes)
    }

    pub(in crate::gpu) fn map<T: Pod>(&self, staging: &wgpu::Buffer, bytes: u64) -> Result<Vec<T>> {
        let slice = staging.slice(0..bytes);
        let (told, mapped) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            let _nobody_waits = told.send(result.is_ok());
        });
        self.wait()?;
        // Another thread that waits for the device may have seen the end first, and be about to tell.
        if mapped.recv_timeout(GRACE) != Ok(true) {
            return Err(self.failed("did not give its results back"));
        }
        let values = match slice.get_mapped_range() {
            Ok(view) => bytemuck::pod_collect_to_vec(&view),
            Err(_) => return Err(self.failed("did not give its results back")),
        };
        staging.unmap();
        Ok(values)
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
