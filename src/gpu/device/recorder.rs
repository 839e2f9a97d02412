//! What has been recorded and not yet handed to the device.

use std::collections::HashMap;
use std::sync::Arc;

use crate::gpu::kernels::Program;

/// Bytes between the parameters of two dispatches: what every adapter can begin a binding at.
pub(in crate::gpu) const SLOT: usize = 256;
/// Dispatches that are held at most.
pub(in crate::gpu) const SLOTS: usize = 1024;
/// Bindings that are remembered at most.
const REMEMBERED: usize = 4096;

/// A kernel, ready to run.
#[derive(Debug)]
pub(in crate::gpu) struct Pipeline {
    pub(in crate::gpu) pipeline: wgpu::ComputePipeline,
    pub(in crate::gpu) layouts: Vec<wgpu::BindGroupLayout>,
}

/// A part of a buffer that a kernel sees.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(in crate::gpu) struct Binding {
    pub(in crate::gpu) buffer: wgpu::Buffer,
    pub(in crate::gpu) offset: u64,
    pub(in crate::gpu) size: u64,
}

#[derive(Debug)]
struct Dispatch {
    pipeline: Arc<Pipeline>,
    groups: Vec<wgpu::BindGroup>,
    slot: u32,
    workgroups: [u32; 3],
}

/// The dispatches of the next submission, their parameters, and the bindings of those before.
#[derive(Debug, Default)]
pub(in crate::gpu) struct Recorder {
    dispatches: Vec<Dispatch>,
    parameters: Vec<u8>,
    groups: HashMap<(Program, u32, Vec<Binding>), wgpu::BindGroup>,
}

impl Recorder {
    pub(in crate::gpu) fn is_empty(&self) -> bool {
        self.dispatches.is_empty()
    }

    pub(in crate::gpu) fn is_full(&self) -> bool {
        self.dispatches.len() >= SLOTS
    }

    pub(in crate::gpu) fn parameters(&self) -> &[u8] {
        &self.parameters
    }

    pub(in crate::gpu) fn record(
        &mut self,
        pipeline: Arc<Pipeline>,
        groups: Vec<wgpu::BindGroup>,
        parameters: &[u8],
        workgroups: [u32; 3],
    ) {
        let slot = self.parameters.len() as u32;
        self.parameters.extend_from_slice(parameters);
        self.parameters.resize(slot as usize + SLOT, 0);
        self.dispatches.push(Dispatch { pipeline, groups, slot, workgroups });
    }

    /// Writes all dispatches into a pass, and forgets them.
    pub(in crate::gpu) fn encode(&mut self, pass: &mut wgpu::ComputePass<'_>) {
        for Dispatch { pipeline, groups, slot, workgroups } in self.dispatches.drain(..) {
            pass.set_pipeline(&pipeline.pipeline);
            for (index, group) in (0u32..).zip(&groups) {
                // The parameters stand in the first group.
                let offsets: &[u32] = if index == 0 { &[slot] } else { &[] };
                pass.set_bind_group(index, group, offsets);
            }
            let [x, y, z] = workgroups;
            pass.dispatch_workgroups(x, y, z);
        }
        self.parameters.clear();
    }

    /// The bind group of these bindings; made anew only where it is not remembered.
    pub(in crate::gpu) fn group(
        &mut self,
        program: Program,
        index: u32,
        bindings: Vec<Binding>,
        make: impl FnOnce(&[Binding]) -> wgpu::BindGroup,
    ) -> wgpu::BindGroup {
        if self.groups.len() >= REMEMBERED {
            self.groups.clear();
        }
        let key = (program, index, bindings);
        if let Some(group) = self.groups.get(&key) {
            return group.clone();
        }
        let group = make(&key.2);
        self.groups.insert(key, group.clone());
        group
    }

    /// Forgets the bindings of a buffer, so that its memory is given back.
    pub(in crate::gpu) fn forget(&mut self, buffer: &wgpu::Buffer) {
        self.groups.retain(|(_, _, bindings), _| bindings.iter().all(|binding| binding.buffer != *buffer));
    }
}

/// What a kernel is given: buffers, or parts of them, in the order of its bindings.
pub(in crate::gpu) fn bind_group(
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
