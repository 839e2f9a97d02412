//! Sums that a device has been asked for, and the memory that they arrive in.

use std::sync::{Arc, OnceLock};

use super::recorder::Binding;
use crate::operator::Scalars;

/// Numbers that can be under way at once.
pub(in crate::gpu) const CAPACITY: u32 = 1 << 20;

/// How the pieces of a sum are put together on the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::gpu) enum Fold {
    Add,
    Least,
}

/// Where the pieces of a sum will stand: for some channels so many pieces each.
#[derive(Debug, Clone, Copy)]
pub(in crate::gpu) struct Pieces {
    pub(in crate::gpu) begin: u32,
    pub(in crate::gpu) channel: u32,
    pub(in crate::gpu) channels: u32,
    pub(in crate::gpu) count: u32,
}

/// A sum under way.
#[derive(Debug)]
struct AskedSum {
    pieces: Vec<Pieces>,
    fold: Fold,
    answer: Arc<OnceLock<Scalars>>,
}

/// What is under way, and the memory that it arrives in.
#[derive(Debug)]
pub(in crate::gpu) struct Waiting {
    results: wgpu::Buffer,
    staging: wgpu::Buffer,
    used: u32,
    asked: Vec<AskedSum>,
}

impl Waiting {
    pub(in crate::gpu) fn new(device: &wgpu::Device) -> Self {
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

    /// Whether there is room for so many numbers more.
    pub(in crate::gpu) fn has_room(&self, numbers: u32) -> bool {
        self.used + numbers <= CAPACITY
    }

    /// Takes so much of the room: where it begins, and what to bind for it.
    pub(in crate::gpu) fn take(&mut self, numbers: u32) -> (u32, Binding) {
        let begin = self.used;
        self.used += numbers;
        let size = self.results.size();
        (begin, Binding { buffer: self.results.clone(), offset: 0, size })
    }

    /// A sum whose pieces have been recorded: where its value will be.
    pub(in crate::gpu) fn ask(&mut self, pieces: Vec<Pieces>, fold: Fold) -> Arc<OnceLock<Scalars>> {
        let answer = Arc::new(OnceLock::new());
        self.asked.push(AskedSum { pieces, fold, answer: answer.clone() });
        answer
    }

    /// Where the numbers under way are, where the host reads them, and how many bytes they take.
    pub(in crate::gpu) fn under_way(&self) -> (&wgpu::Buffer, &wgpu::Buffer, u64) {
        (&self.results, &self.staging, u64::from(self.used) * size_of::<f32>() as u64)
    }

    /// Answers everything that is under way by the numbers that have come back.
    pub(in crate::gpu) fn answer(&mut self, numbers: &[f32]) {
        self.used = 0;
        for AskedSum { pieces, fold, answer } in self.asked.drain(..) {
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
    }
}
