//! Kernels, from text to what runs.

use std::sync::Arc;

use super::Gpu;
use super::adapter::Fault;
use super::device::{lock, note, one_line};
use super::kernel::{Access, Kernel};
use super::recorder::{Binding, Pipeline};
use crate::{Error, Result};

impl Gpu {
    pub(super) fn pipeline(&self, kernel: Kernel) -> Option<Arc<Pipeline>> {
        let mut pipelines = lock(&self.0.pipelines);
        if let Some(known) = pipelines.get(&kernel) {
            return known.clone();
        }
        let source = match self.0.fault {
            Some(Fault::Compilation) => "this is no kernel".to_owned(),
            Some(Fault::Arithmetic) => kernel.source().replace("total += part", "total = part"),
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

pub(super) fn bind_group(
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
