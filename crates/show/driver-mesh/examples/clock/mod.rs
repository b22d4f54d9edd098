//! Processor time, so that other programs do not count.

/// Returns the processor time of all threads of this program so far, ms.
#[cfg(target_os = "linux")]
pub fn now() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ProcessCPUTime);
    1e3 * time.tv_sec as f64 + 1e-6 * time.tv_nsec as f64
}

/// Returns the time that has passed since the first call, ms.
#[cfg(not(target_os = "linux"))]
pub fn now() -> f64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    1e3 * START.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
}
