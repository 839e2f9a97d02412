use serde::Serialize;

use super::{Done, Manners};
use crate::Result;
use crate::io::to_json;
use crate::job::{self, mebibytes};

#[derive(Serialize)]
struct Machine {
    version: &'static str,
    system: String,
    processor: String,
    threads: usize,
    free_memory: Option<u64>,
    memory_budget: u64,
    /// What `--backend auto` takes.
    backend: &'static str,
    adapters: Vec<Adapter>,
}

/// A graphics adapter, and whether it computes what it should.
#[derive(Serialize)]
struct Adapter {
    name: String,
    interface: String,
    driver: String,
    kind: &'static str,
    /// Where it sits: what `--adapter` tells twins apart by.
    bus: String,
    float_atomics: bool,
    timestamps: bool,
    binding_limit: u64,
    buffer_limit: u64,
    missing: Vec<String>,
    /// Whether known answers came out; what went wrong where they did not.
    verdict: Result<(), String>,
}

/// `unscatter doctor`: what this machine is, and what would be used of it.
pub(super) fn run(manners: &Manners) -> Result<Done> {
    let adapters = adapters();
    let serves = |adapter: &Adapter| adapter.kind != "software" && adapter.verdict.is_ok();
    let machine = Machine {
        version: env!("CARGO_PKG_VERSION"),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        processor: job::processor(),
        threads: rayon::current_num_threads(),
        free_memory: job::free_memory(),
        memory_budget: job::default_budget(),
        backend: if adapters.iter().any(serves) { "gpu" } else { "cpu" },
        adapters,
    };
    manners.print(&to_json(&machine)?, &words(&machine))?;
    Ok(Done::Completely)
}

fn words(machine: &Machine) -> String {
    let free = machine.free_memory.map_or("unknown".to_owned(), mebibytes);
    let mut words = format!(
        "unscatter {}\nsystem      {}\nprocessor   {}\nthreads     {}\nfree memory {free}\nbudget      {} a solve, unless --memory says otherwise\nbackend     {} with --backend auto",
        machine.version,
        machine.system,
        machine.processor,
        machine.threads,
        mebibytes(machine.memory_budget),
        machine.backend,
    );
    if machine.adapters.is_empty() {
        words.push_str("\nadapters    none; a Vulkan driver makes one (Debian: mesa-vulkan-drivers for a software adapter)");
    }
    for adapter in &machine.adapters {
        let yes = |yes| if yes { "yes" } else { "no" };
        words.push_str(&format!(
            "\nadapter     {} ({}, {}{})\n  driver    {}\n  atomics   f32 {}; timestamps {}\n  limits    {} a binding, {} a buffer\n  answers   {}",
            adapter.name,
            adapter.kind,
            adapter.interface,
            if adapter.bus.is_empty() { String::new() } else { format!(", {}", adapter.bus) },
            adapter.driver,
            yes(adapter.float_atomics),
            yes(adapter.timestamps),
            mebibytes(adapter.binding_limit),
            mebibytes(adapter.buffer_limit),
            match &adapter.verdict {
                Ok(()) if adapter.kind == "software" => "right; used only when named with --adapter",
                Ok(()) => "right",
                Err(problem) => problem,
            },
        ));
    }
    words
}

#[cfg(not(feature = "gpu"))]
fn adapters() -> Vec<Adapter> {
    Vec::new()
}

#[cfg(feature = "gpu")]
fn adapters() -> Vec<Adapter> {
    use crate::gpu;
    let found = gpu::adapters().into_iter();
    found
        .map(|record| Adapter {
            verdict: match record.missing.is_empty() {
                true => gpu::known_answers(&record).map_err(|error| error.to_string()),
                false => Err(format!("it lacks {}", record.missing.join(" and "))),
            },
            name: record.name,
            interface: record.interface,
            driver: record.driver,
            kind: record.kind,
            bus: record.bus,
            float_atomics: record.float_atomics,
            timestamps: record.timestamps,
            binding_limit: record.binding_limit,
            buffer_limit: record.buffer_limit,
            missing: record.missing,
        })
        .collect()
}
