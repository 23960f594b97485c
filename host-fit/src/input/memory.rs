//! How much memory logs may take.

use std::fs;

/// Half of the memory that this machine has, or of what the control group of this program may take,
/// bytes; `None` where the system does not tell.
pub fn half_of_the_machine() -> Option<u64> {
    let told = fs::read_to_string("/proc/meminfo").ok()?;
    let total_kib = told.lines().find_map(|line| {
        let total = line.strip_prefix("MemTotal:")?.trim();
        total.strip_suffix(" kB")?.trim().parse::<u64>().ok()
    })?;
    let total = total_kib.saturating_mul(1024);
    // "max" where there is no limit.
    let group = fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group = group.and_then(|limit| limit.trim().parse().ok());
    Some(group.map_or(total, |limit: u64| limit.min(total)) / 2)
}
