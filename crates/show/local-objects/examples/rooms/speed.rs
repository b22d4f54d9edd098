//! Times of frames of a moving object: processor time of all threads.

use std::sync::Arc;

use holo_display::{Frame, Interrupt};
use holo_local_objects::{LIGHTS, LayerDetail, LitObject, ObjectLayer, ObjectLighting, Room};
use holo_raycast::Raycaster;
use rustix::time::{ClockId, clock_gettime};

use crate::scenes::cases;
use crate::{frame, object, probe, tracer, view};

/// Size of the frames.
const SIZE: (u32, u32) = (1280, 720);

/// Frames that are drawn.
const FRAMES: usize = 20;

pub fn measure(args: &[String]) {
    let folder = std::path::Path::new(args.first().map_or(".", String::as_str));
    let name = args.get(1).map_or("closed", String::as_str);
    let step = args.get(2).map_or(2, |step| step.parse().unwrap());
    let case = cases().into_iter().find(|case| case.name == name).unwrap();
    let view = view(&case, SIZE);
    let room = Room::new(Arc::new(Raycaster::build(Arc::new(case.room(false))).unwrap()));
    let object = object(&case);
    let probe = probe(folder, &case, &tracer(case.room(false)), &room, object.centre());
    let lighting = Arc::new(ObjectLighting::new(probe, LIGHTS, Some(&room)));
    let mut base = Frame::black(SIZE);
    base.picture.pixels.fill([0.5; 3]);
    base = frame(base.picture, &view, &room);
    let mut times: [Vec<f64>; 4] = Default::default();
    let mut composed = base.clone();
    for _ in 0..FRAMES {
        let mut last = seconds();
        let mut note = |stage: usize| {
            times[stage].push((seconds() - last) * 1e3);
            last = seconds();
        };
        let objects = [LitObject::new(object.clone(), Arc::clone(&lighting))];
        note(0);
        let mut layer =
            ObjectLayer::new(&base, &view, &objects, Some(&room), LayerDetail::Quick(step));
        note(1);
        layer.draw(&base, &objects, Some(&room), 1, &Interrupt::default());
        note(2);
        composed.clone_from(&base);
        layer.compose(&mut composed);
        note(3);
    }
    composed.picture.write(folder.join(format!("{name}-quick.png"))).ok();
    let moving = LitObject::new(object, lighting);
    for passes in [4, 16] {
        let begin = seconds();
        let at_rest = moving.at_rest(Some(&room), passes, &Interrupt::default());
        assert!(at_rest.is_some());
        println!("light at rest, {passes} passes: {:.0} ms", (seconds() - begin) * 1e3);
    }
    for (stage, times) in ["light", "layer", "draw", "compose"].into_iter().zip(&mut times) {
        times.sort_by(f64::total_cmp);
        println!("{stage:8} median {:.1} ms, least {:.1} ms", times[FRAMES / 2], times[0]);
    }
}

/// Returns the processor time so far, seconds.
fn seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
