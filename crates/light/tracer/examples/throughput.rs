//! Measures paths per second of the path engine on a view of a scene, with one thread and with two.
//! Also prints paths per second of processor time where the system reports it (Linux), because
//! other programs take a share of the elapsed time.
//!
//! `cargo run --release -p holo-tracer --example throughput -- SCENE.obj VP VD VH` (vectors as
//! `x,y,z`), for example `... cornell.obj 2.78,2.73,-2 0,0,1 60`.

use std::error::Error;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::DVec3;
use holo_tracer::{Settings, Tracer};

const SIDE: u64 = 256;
const TIME: Duration = Duration::from_secs(3);

fn vector(text: &str) -> Result<DVec3, Box<dyn Error>> {
    let parts = text.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    Ok(DVec3::from_array(parts.try_into().map_err(|_| "three numbers, as x,y,z")?))
}

/// Returns the processor time of this thread in seconds.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-9)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [path, eye, towards, angle] = args.as_slice() else {
        return Err("usage: throughput SCENE.obj VP VD VH".into());
    };
    let (eye, forward) = (vector(eye)?, vector(towards)?.normalize());
    let half = (angle.parse::<f64>()?.to_radians() / 2.0).tan();
    let up = if forward.z.abs() < 0.9 { DVec3::Z } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    let up = right.cross(forward);
    let loaded = holo_scene::load(path.as_ref(), &Default::default())?;
    let tracer = Tracer::new(loaded.scene.into(), Settings::default())?;
    for threads in [1, 2] {
        let next = AtomicU64::new(0);
        let start = Instant::now();
        let (sum, busy) = std::thread::scope(|scope| {
            let work = || {
                let mut sum = 0.0;
                while start.elapsed() < TIME {
                    for _ in 0..1000 {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        let at = |k: u64| 2.0 * (k % SIDE) as f64 / SIDE as f64 - 1.0;
                        let direction = forward + (right * at(i) + up * at(i / SIDE)) * half;
                        sum += f64::from(tracer.trace(eye, direction.normalize(), i).radiance[1]);
                    }
                }
                (sum, processor_seconds().unwrap_or(f64::NAN))
            };
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            workers
                .into_iter()
                .filter_map(|w| w.join().ok())
                .fold((0.0, 0.0), |(s, b), (sum, busy)| (s + sum, b + busy))
        });
        let paths = next.load(Ordering::Relaxed) as f64;
        let rate = paths / start.elapsed().as_secs_f64() / 1e6;
        println!(
            "{threads} threads: {rate:.3} M paths/s, {:.3} M per second of processor time, mean green {:.4}",
            paths / busy / 1e6,
            sum / paths
        );
    }
    println!("{} paths were not finite", tracer.nonfinite_paths());
    Ok(())
}
