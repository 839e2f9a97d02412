//! What the machine has.

use std::fs;

/// Memory to assume where the system does not say what is free.
const ASSUMED: u64 = 4 << 30;

/// Bytes that are free, as the system says; the limits of a container and of the process (`ulimit -v`) count.
pub fn free_memory() -> Option<u64> {
    let free = kibibytes_after("/proc/meminfo", "MemAvailable:")?.min(left_to_process().unwrap_or(u64::MAX));
    let limit =
        fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    let used =
        fs::read_to_string("/sys/fs/cgroup/memory.current").ok().and_then(|text| text.trim().parse().ok());
    Some(match (limit, used) {
        (Some(limit), Some(used)) => free.min(u64::saturating_sub(limit, used)),
        _ => free,
    })
}

/// Bytes of addresses that this process may still take, where they are limited.
fn left_to_process() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let limit = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = limit.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kibibytes_after("/proc/self/status", "VmSize:")?))
}

/// The memory that a solve may take when nothing is said about it.
pub fn default_budget() -> u64 {
    free_memory().map_or(ASSUMED, |free| free / 4 * 3)
}

/// The most memory that this process has had at once, in bytes.
pub fn peak_memory() -> Option<u64> {
    kibibytes_after("/proc/self/status", "VmHWM:")
}

/// What the processor calls itself.
pub fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

fn kibibytes_after(file: &str, label: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(label))?;
    rest.split_whitespace().next()?.parse::<u64>().ok().map(|kibibytes| kibibytes * 1024)
}
