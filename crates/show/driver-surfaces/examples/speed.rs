//! Times the driver: samples inserted, views at rest, and views while the eye moves.
//!
//! `speed FILE.holo VIEW OUT` draws a named view of the file at 1280 × 720. Then it moves the eye
//! by 2 cm per frame at half resolution, returns to the view, and stops. It writes the first
//! picture after the stop, OUT-stopped.pfm, and the refined one, OUT-refined.pfm. It prints
//! processor time of all threads, and elapsed time.

#![allow(clippy::unwrap_used, clippy::panic)]

mod stored;
#[path = "../../display/tests/common/viewer.rs"]
mod viewer;

use holo_display::FrameRequest;
use holo_driver_surfaces::surfaces_driver;
use std::time::Instant;
use stored::{Stored, seconds};
use viewer::TestViewer;

/// Frames drawn while the eye moves.
const FRAMES: u32 = 20;

/// Prints the time of some work, divided by `parts`.
fn timed(name: &str, parts: u32, unit: f64, work: impl FnOnce()) {
    let (start, before) = (Instant::now(), seconds());
    work();
    let each = |time: f64| time * unit / f64::from(parts);
    let passed = each(start.elapsed().as_secs_f64());
    println!("{name}: {passed:.1} passed, {:.1} of the processor", each(seconds() - before));
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, file, name, out] = &args[..] else { panic!("see the source") };
    let Stored { raycaster, sections, beams, view, size } = Stored::read(file, name);
    let mut driver = TestViewer::new(surfaces_driver(sections, raycaster, None));
    let count: usize = beams.iter().map(|(_, read)| read.samples.len()).sum();

    timed("insertion, ns a sample", u32::try_from(count).unwrap(), 1e9, || {
        beams.iter().for_each(|(key, read)| driver.insert(*key, 1, &read.samples));
    });
    let sketch = FrameRequest { view, size: (size.0 / 2, size.1 / 2), is_moving: false };
    timed("sketch, nothing known: look, ms", 1, 1e3, || driver.look(&sketch).unwrap());
    timed("sketch, nothing known: draw, ms", 1, 1e3, || drop(driver.draw()));
    let full = FrameRequest { view, size, is_moving: false };
    let finish = |driver: &mut TestViewer| while driver.prepare() {};
    timed("full: look, ms", 1, 1e3, || driver.look(&full).unwrap());
    timed("full: first draw, ms", 1, 1e3, || drop(driver.draw()));
    timed("full: look into edges, ms", 1, 1e3, || finish(&mut driver));
    timed("full: draw again, ms", 1, 1e3, || drop(driver.draw()));
    let steps: Vec<FrameRequest> = (0..FRAMES)
        .rev()
        .map(|step| {
            let eye = view.vp + view.right() * 0.02 * f64::from(step);
            let size = (size.0 / 2, size.1 / 2);
            FrameRequest { view: view.moved(eye, view.vd).unwrap(), size, is_moving: true }
        })
        .collect();
    timed("moving: look, ms", FRAMES, 1e3, || {
        steps.iter().for_each(|step| driver.look(step).unwrap());
    });
    timed("moving: draw, ms", FRAMES, 1e3, || {
        for _ in 0..FRAMES {
            drop(driver.draw());
        }
    });
    timed("stopped: look, ms", 1, 1e3, || driver.look(&full).unwrap());
    let mut stopped = None;
    timed("stopped: draw, ms", 1, 1e3, || stopped = Some(driver.draw()));
    stopped.unwrap().picture.write(format!("{out}-stopped.pfm")).unwrap();
    driver.settle();
    finish(&mut driver);
    driver.draw().picture.write(format!("{out}-refined.pfm")).unwrap();
}
