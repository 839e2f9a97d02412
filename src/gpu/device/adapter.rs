//! Which adapters there are, what they can do, and which one is taken.

use crate::gpu::kernels::{LANES, STORAGE_BUFFERS};
use crate::{Error, Result};

/// Percent of the memory budget that the driver reports, beyond which nothing more is allocated: what asks for it is told so, where
/// the driver itself may go on until the device is lost.
const MEMORY_PERCENT: u8 = 95;

/// What an adapter is and can do.
#[derive(Debug, Clone, PartialEq)]
pub struct AdapterRecord {
    /// What it calls itself.
    pub name: String,
    /// Vulkan, Metal or Dx12.
    pub interface: String,
    /// The driver and its version.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// Whether it adds to an f32 atomically; without, a loop of compare-and-swap does.
    pub float_atomics: bool,
    /// Whether it measures its own time.
    pub timestamps: bool,
    /// Bytes that a kernel can see of one buffer; longer vectors are worked on slab by slab.
    pub binding_limit: u64,
    /// Bytes of the largest buffer.
    pub buffer_limit: u64,
    /// Workgroups along one axis of a dispatch.
    pub workgroup_limit: u32,
    /// Where it sits, such as `0000:01:00.0`; empty where it does not say. Twins differ in nothing else.
    pub bus: String,
    /// Which one it is of those that the system lists.
    pub number: usize,
    /// What it lacks of what is needed; empty when it serves.
    pub missing: Vec<String>,
}

impl AdapterRecord {
    /// Whether it is a graphics card, and not a program that acts as one.
    pub fn is_hardware(&self) -> bool {
        self.kind != "software"
    }

    /// How well it suits, from 0: a card of its own before one that shares the memory of the processor, software last. One that speaks
    /// Vulkan or Metal comes before the same one as DX12 shows it.
    fn rank(&self) -> (usize, bool) {
        let kinds = ["discrete", "integrated", "virtual", "other"];
        let kind = kinds.iter().position(|kind| *kind == self.kind);
        (kind.unwrap_or(kinds.len()), self.interface == "Dx12")
    }

    /// Whether a name means it: a part of its own, in any case, or where it sits.
    fn is_called(&self, name: &str) -> bool {
        self.name.to_lowercase().contains(&name.to_lowercase()) || self.bus.eq_ignore_ascii_case(name)
    }

    fn of(number: usize, adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        let mut missing = Vec::new();
        let capabilities = adapter.get_downlevel_capabilities();
        if !capabilities.flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS) {
            missing.push("compute shaders".to_owned());
        }
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            let has = limits.max_storage_buffers_per_shader_stage;
            missing.push(format!("{STORAGE_BUFFERS} storage buffers a kernel (it has {has})"));
        }
        if limits.max_compute_invocations_per_workgroup < LANES {
            missing.push(format!("workgroups of {}", LANES));
        }
        Self {
            name: info.name,
            interface: format!("{:?}", info.backend),
            driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => "discrete",
                wgpu::DeviceType::IntegratedGpu => "integrated",
                wgpu::DeviceType::VirtualGpu => "virtual",
                wgpu::DeviceType::Cpu => "software",
                wgpu::DeviceType::Other => "other",
            },
            float_atomics: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            binding_limit: limits.max_storage_buffer_binding_size,
            buffer_limit: limits.max_buffer_size,
            workgroup_limit: limits.max_compute_workgroups_per_dimension,
            bus: info.device_pci_bus_id,
            number,
            missing,
        }
    }
}

/// Which adapter to take, and how to use it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Choice {
    /// A part of its name, in any case, or its bus; the best one that serves without.
    pub name: Option<String>,
    /// Its [`AdapterRecord::number`]: exactly that one.
    pub number: Option<usize>,
    /// Whether a software adapter may be taken that was not asked for by name. Hardware comes first.
    pub software: bool,
    /// Bytes that a kernel may see of one buffer, where that should be less than the adapter allows.
    pub binding_limit: Option<u64>,
    /// Workgroups along one axis of a dispatch, where that should be fewer than the adapter allows.
    pub workgroup_limit: Option<u32>,
    /// Whether f32 sums are made by compare-and-swap even where the adapter has atomics for them.
    pub without_float_atomics: bool,
    /// How it is used; as adapters of its kind are best used without.
    pub tactics: Option<Tactics>,
    /// A fault to simulate.
    pub fault: Option<SimulatedFault>,
}

/// What is quicker on one kind of adapter than on the other, with the same results but for rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tactics {
    /// Deposits where all rays of a view meet are summed up inside a workgroup first: on hardware many lanes would wait for one texel.
    pub sums_near: bool,
    /// Kept rows look up elements whose channels lie side by side, in a copy that is made for each product: on hardware a product waits for
    /// accesses anywhere, and these are a third of them.
    pub interleaved: bool,
    /// A grey tile is read once, into the memory of its workgroup, where a step reads it four times.
    pub holds_tiles: bool,
    /// Whoever waits asks again and again for a moment before it sleeps: to be woken takes longer than many an iteration.
    pub spins: bool,
    /// The rays of pictures are walked there. What a software adapter walks is walked by the processor in any case, and by more roundabout
    /// means.
    pub draws: bool,
}

impl Tactics {
    /// For hardware.
    pub const HARDWARE: Self =
        Self { sums_near: true, interleaved: true, holds_tiles: true, spins: true, draws: true };
    /// For software adapters: few lanes run at once, all memory is the processor's, and who waits takes its time.
    pub const SOFTWARE: Self =
        Self { sums_near: false, interleaved: false, holds_tiles: false, spins: false, draws: false };
}

/// What can go wrong with an adapter, so that it can be brought about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatedFault {
    /// Kernels do not compile.
    Compilation,
    /// Kernels lose a part of every long sum, as a driver with a mistake in it may.
    Arithmetic,
    /// There is room for buffers of 64 KiB and no more.
    Memory,
    /// The device is given up after so many round trips.
    Loss(u64),
    /// The driver says so while it is waited for, from so many round trips on; wgpu panics then.
    Crash(u64),
    /// The device does not end what it was given, from so many round trips on.
    Hang(u64),
}

impl SimulatedFault {
    /// `compilation`, `arithmetic`, `memory`, `loss:N`, `crash:N`, or `hang:N`.
    pub fn parse(text: &str) -> Option<Self> {
        match text.split_once(':') {
            None if text == "compilation" => Some(Self::Compilation),
            None if text == "arithmetic" => Some(Self::Arithmetic),
            None if text == "memory" => Some(Self::Memory),
            Some(("loss", count)) => count.parse().ok().map(Self::Loss),
            Some(("crash", count)) => count.parse().ok().map(Self::Crash),
            Some(("hang", count)) => count.parse().ok().map(Self::Hang),
            _ => None,
        }
    }
}

/// Whether the system has a device that could be a graphics card. It costs nothing to ask, where looking for adapters loads
/// every driver: some take a tenth of a second, or complain on standard error where there is no desktop.
pub fn may_have_hardware() -> bool {
    let devices = ["/dev/dri", "/dev/nvidiactl", "/dev/kfd", "/dev/dxg"];
    !cfg!(target_os = "linux") || devices.iter().any(|device| std::path::Path::new(device).exists())
}

/// All adapters of this machine.
pub fn adapters() -> Vec<AdapterRecord> {
    found().iter().map(|(_, record)| record.clone()).collect()
}

fn found() -> Vec<(wgpu::Adapter, AdapterRecord)> {
    let mut instance = wgpu::InstanceDescriptor::new_without_display_handle();
    instance.memory_budget_thresholds.for_resource_creation = Some(MEMORY_PERCENT);
    instance.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let instance = wgpu::Instance::new(instance);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let numbered = adapters.into_iter().enumerate().map(|(number, adapter)| {
        let record = AdapterRecord::of(number, &adapter);
        (adapter, record)
    });
    numbered.collect()
}

/// The adapter of a choice.
///
/// Errors: [`Error::Adapter`] when there is none, saying which there are.
pub(super) fn choose(choice: &Choice) -> Result<(wgpu::Adapter, AdapterRecord)> {
    let mut found = found();
    // A stable sort: twins stay in the order in which the system lists them.
    found.sort_by_key(|(_, record)| record.rank());
    let names: Vec<String> = found.iter().map(|(_, record)| format!("`{}`", record.name)).collect();
    let list = if names.is_empty() { "no adapter at all".to_owned() } else { names.join(", ") };
    let is_meant = |record: &AdapterRecord| match (&choice.name, choice.number) {
        (_, Some(number)) => record.number == number,
        (Some(name), None) => record.is_called(name),
        (None, None) => choice.software || record.is_hardware(),
    };
    let meant: Vec<_> = found.into_iter().filter(|(_, record)| is_meant(record)).collect();
    let Some(first) = meant.first().map(|(_, record)| record.clone()) else {
        return Err(match &choice.name {
            Some(name) => Error::Adapter {
                adapter: name.clone(),
                problem: format!("is not there: this machine has {list}"),
                remedy: "name one of those, or compute on the processor",
            },
            None => Error::Adapter {
                adapter: "any hardware".to_owned(),
                problem: format!("is not there: this machine has {list}"),
                remedy: if names.is_empty() {
                    "compute on the processor, or install a Vulkan driver"
                } else {
                    "compute on the processor, name a software adapter, or install the driver of a graphics card"
                },
            },
        });
    };
    meant.into_iter().find(|(_, record)| record.missing.is_empty()).ok_or_else(|| Error::Adapter {
        adapter: first.name,
        problem: format!("lacks {}", first.missing.join(" and ")),
        remedy: "compute on the processor, or update its driver",
    })
}
