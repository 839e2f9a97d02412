//! Sums that the device has been asked for: they come back together, with one round trip.

use std::sync::{Arc, MutexGuard, OnceLock};

use super::Gpu;
use super::device::lock;
use super::recorder::Binding;
use crate::operator::{PendingSum, Scalars};
use crate::{Error, Result};

/// Numbers that can be under way at once.
const CAPACITY: u32 = 1 << 20;

/// How the pieces of a sum are put together on the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fold {
    Add,
    Least,
}

/// Where the pieces of a sum will stand: for some channels so many pieces each.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pieces {
    pub(super) begin: u32,
    pub(super) channel: u32,
    pub(super) channels: u32,
    pub(super) count: u32,
}

/// A sum under way.
#[derive(Debug)]
struct Asked {
    pieces: Vec<Pieces>,
    fold: Fold,
    answer: Arc<OnceLock<Scalars>>,
}

/// What is under way, and the memory that it arrives in.
#[derive(Debug)]
pub(super) struct Waiting {
    results: wgpu::Buffer,
    staging: wgpu::Buffer,
    used: u32,
    asked: Vec<Asked>,
}

impl Waiting {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let buffer = |usage| {
            let size = u64::from(CAPACITY) * size_of::<f32>() as u64;
            let label = Some("results");
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
        };
        Self {
            results: buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC),
            staging: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            used: 0,
            asked: Vec::new(),
        }
    }

    /// So much of the room that [`Gpu::room_for_pieces`] has found: where it begins, and what to bind for it.
    pub(super) fn take(&mut self, numbers: u32) -> (u32, Binding) {
        let begin = self.used;
        self.used += numbers;
        let size = self.results.size();
        (begin, Binding { buffer: self.results.clone(), offset: 0, size })
    }

    /// A sum whose pieces have been recorded.
    pub(super) fn ask(&mut self, gpu: &Gpu, pieces: Vec<Pieces>, fold: Fold) -> DeviceSum {
        let answer = Arc::new(OnceLock::new());
        self.asked.push(Asked { pieces, fold, answer: answer.clone() });
        DeviceSum { gpu: gpu.clone(), answer }
    }
}

/// A number a channel that may still be on the device.
#[derive(Debug, Clone)]
pub struct DeviceSum {
    gpu: Gpu,
    answer: Arc<OnceLock<Scalars>>,
}

impl PendingSum for DeviceSum {
    fn value(self) -> Result<Scalars> {
        let mut waiting = lock(&self.gpu.0.waiting);
        if self.answer.get().is_none() {
            self.gpu.fetch(&mut waiting)?;
        }
        self.answer.get().copied().ok_or_else(|| {
            self.gpu.check().err().unwrap_or_else(|| Error::Machine("a sum is lost".to_owned()))
        })
    }
}

impl Gpu {
    /// What is under way, with room for so many pieces more.
    ///
    /// Errors: [`Error::TooLarge`] for vectors of 1.4 billion elements and more.
    pub(super) fn room_for_pieces(&self, numbers: u32) -> Result<MutexGuard<'_, Waiting>> {
        if numbers > CAPACITY {
            return Err(Error::TooLarge {
                what: "a sum on an adapter".to_owned(),
                needed: format!("{numbers} pieces"),
                limit: CAPACITY.to_string(),
                remedy: "lower the sizes, or use --backend cpu",
            });
        }
        let mut waiting = lock(&self.0.waiting);
        if waiting.used + numbers > CAPACITY {
            self.fetch(&mut waiting)?;
        }
        Ok(waiting)
    }

    /// Everything that is under way.
    fn fetch(&self, waiting: &mut Waiting) -> Result<()> {
        self.check()?;
        let bytes = u64::from(waiting.used) * size_of::<f32>() as u64;
        // Sums over nothing have no pieces.
        let numbers = match bytes {
            0 => Vec::new(),
            _ => self.copy_and_read(&waiting.results, &waiting.staging, bytes)?,
        };
        waiting.used = 0;
        for Asked { pieces, fold, answer } in waiting.asked.drain(..) {
            let mut sum = match fold {
                Fold::Add => [0.0; 3],
                Fold::Least => [f64::INFINITY; 3],
            };
            for Pieces { begin, channel, channels, count } in pieces {
                for c in 0..channels {
                    let first = (begin + c * count) as usize;
                    for &piece in &numbers[first..first + count as usize] {
                        let sum = &mut sum[(channel + c) as usize];
                        match fold {
                            Fold::Add => *sum += f64::from(piece),
                            // The kernel has no infinity; its largest number stands for one.
                            Fold::Least if piece < f32::MAX => *sum = sum.min(f64::from(piece)),
                            Fold::Least => {}
                        }
                    }
                }
            }
            let _is_first = answer.set(sum);
        }
        Ok(())
    }
}
