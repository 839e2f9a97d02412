use serde::Serialize;

use super::{Done, Manners, machine, to_json};
use crate::Result;

#[derive(Serialize)]
struct Machine {
    version: &'static str,
    system: String,
    processor: String,
    threads: usize,
    free_memory: Option<u64>,
    memory_budget: u64,
    backend: &'static str,
}

/// `unscatter doctor`: what this machine is, and what would be used of it.
pub(super) fn run(manners: &Manners) -> Result<Done> {
    let machine = Machine {
        version: env!("CARGO_PKG_VERSION"),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        processor: machine::processor(),
        threads: rayon::current_num_threads(),
        free_memory: machine::free_memory(),
        memory_budget: machine::default_budget(),
        backend: "cpu",
    };
    let free = machine.free_memory.map_or("unknown".to_owned(), super::job::mebibytes);
    let words = format!(
        "unscatter {}\nsystem      {}\nprocessor   {}\nthreads     {}\nfree memory {free}\nbudget      {} a solve, unless --memory says otherwise\nbackend     {}",
        machine.version,
        machine.system,
        machine.processor,
        machine.threads,
        super::job::mebibytes(machine.memory_budget),
        machine.backend,
    );
    manners.print(&to_json(&machine)?, &words);
    Ok(Done::Completely)
}
