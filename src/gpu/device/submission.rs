//! Recording dispatches, handing them over, and timing them.

use std::sync::atomic::Ordering;

use bytemuck::Pod;

use super::gpu::Gpu;
use super::recorder::{Binding, Recorder, SLOT, bind_group};
use crate::Result;
use crate::gpu::kernels::Program;
use crate::operator::lock;

impl Gpu {
    /// Waits until all that was recorded is done.
    pub fn finish(&self) -> Result<()> {
        self.hand_over();
        self.wait()
    }

    /// Hands over what is recorded, without waiting for it.
    pub(in crate::gpu) fn hand_over(&self) {
        self.submit(&mut lock(&self.0.recorder), Timestamp::None, |_| {});
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
        self.submit(&mut lock(&self.0.recorder), Timestamp::Begin(&queries), |_| {});
        work()?;
        self.submit(&mut lock(&self.0.recorder), Timestamp::End(&queries), |encoder| {
            encoder.resolve_query_set(&queries, 0..2, &resolved, 0);
            encoder.copy_buffer_to_buffer(&resolved, 0, &staging, 0, 16);
        });
        let ticks: Vec<u64> = self.map(&staging, 16)?;
        let period = f64::from(self.0.queue.get_timestamp_period());
        Ok(Some(ticks[1].saturating_sub(ticks[0]) as f64 * period * 1e-9))
    }

    /// Records a kernel. `bindings` are those after the parameters, group by group.
    pub(in crate::gpu) fn dispatch(
        &self,
        program: impl Into<Program>,
        parameters: &impl Pod,
        bindings: &[&[Binding]],
        workgroups: [u32; 3],
    ) {
        if self.check().is_err() || workgroups.contains(&0) {
            return;
        }
        let program = program.into();
        let Some(pipeline) = self.pipeline(program) else { return };
        let mut recorder = lock(&self.0.recorder);
        if recorder.is_full() {
            self.submit(&mut recorder, Timestamp::None, |_| {});
        }
        let mut groups = Vec::with_capacity(bindings.len());
        for (index, bound) in (0u32..).zip(bindings) {
            let mut all = Vec::with_capacity(bound.len() + 1);
            if index == 0 {
                all.push(Binding { buffer: self.0.parameters.clone(), offset: 0, size: SLOT as u64 });
            }
            all.extend_from_slice(bound);
            let layout = &pipeline.layouts[index as usize];
            groups.push(recorder.group(program, index, all, |all| bind_group(&self.0.device, layout, all)));
        }
        recorder.record(pipeline, groups, bytemuck::bytes_of(parameters), workgroups);
        self.0.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    /// Hands over what is recorded, and what `more` adds.
    pub(in crate::gpu) fn submit(
        &self,
        recorder: &mut Recorder,
        mark: Timestamp,
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
    pub(in crate::gpu) fn grid(&self, items: usize, each: u32) -> [u32; 3] {
        let groups = (items as u32).div_ceil(each);
        let across = groups.min(self.0.workgroup_limit);
        [across, groups.div_ceil(across.max(1)), 1]
    }
}

/// What a submission writes of the device's clock, after everything else.
pub(in crate::gpu) enum Timestamp<'a> {
    None,
    Begin(&'a wgpu::QuerySet),
    End(&'a wgpu::QuerySet),
}

impl<'a> Timestamp<'a> {
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
