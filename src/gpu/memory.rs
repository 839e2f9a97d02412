//! Memory of the device, and what goes there and comes back.

use std::rc::Rc;
use std::sync::{Arc, Mutex};

use bytemuck::Pod;

use super::Gpu;
use super::device::{Inner, lock, note};
use super::recorder::Binding;
use crate::{Error, Result};

/// Bytes that are read back at once.
const READ_AT_ONCE: u64 = 64 << 20;

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

impl Gpu {
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

    pub(super) fn map<T: Pod>(&self, staging: &wgpu::Buffer, bytes: u64) -> Result<Vec<T>> {
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
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
