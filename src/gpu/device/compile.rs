//! Kernels, from text to what runs.

use std::sync::Arc;

use rayon::prelude::*;

use super::adapter::SimulatedFault;
use super::failure::{note, one_line};
use super::gpu::Gpu;
use super::recorder::Pipeline;
use crate::gpu::kernels::{Access, Program};
use crate::operator::lock;
use crate::{Error, Result};

impl Gpu {
    pub(in crate::gpu) fn pipeline(&self, program: Program) -> Option<Arc<Pipeline>> {
        if let Some(known) = lock(&self.0.pipelines).get(&program) {
            return known.clone();
        }
        let source = match self.0.fault {
            Some(SimulatedFault::Compilation) => "this is no kernel".to_owned(),
            Some(SimulatedFault::Arithmetic) => program.source().replace("total += w", "total = w"),
            _ => program.source(),
        };
        let made = self.compile(program, &source).map_err(|error| note(&self.0.failure, error)).ok();
        lock(&self.0.pipelines).entry(program).or_insert(made).clone()
    }

    /// Compiles kernels that will be asked for, side by side, where a driver would else do so one by one at their first use.
    pub(in crate::gpu) fn prepare(&self, programs: &[Program]) {
        programs.par_iter().for_each(|&program| drop(self.pipeline(program)));
    }

    /// Errors: [`Error::Adapter`] with what the compiler says.
    fn compile(&self, program: Program, source: &str) -> Result<Arc<Pipeline>> {
        self.compiled(program.name(), || Arc::new(pipeline(&self.0.device, program, source)))
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
                remedy: "compute on the processor, or update its driver",
            }),
        }
    }

    /// A pipeline that draws.
    ///
    /// Errors: [`Error::Adapter`] with what the compiler says.
    pub(in crate::gpu) fn compile_drawing(
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

fn pipeline(device: &wgpu::Device, program: Program, source: &str) -> Pipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(program.name()),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let layouts: Vec<_> = program.bindings().iter().map(|group| group_layout(device, group)).collect();
    let all: Vec<_> = layouts.iter().map(Some).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(program.name()),
        bind_group_layouts: &all,
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(program.name()),
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
