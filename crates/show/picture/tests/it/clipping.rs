//! Tests that fore and aft clipping work as in Radiance.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use glam::DVec3;
use holo_picture::{Clip, View, ViewKind};

const SIZE: (u32, u32) = (80, 60);

fn view(words: &str) -> View {
    View::parse_vf(&format!("-vp 1 2 3 -vd 1 2 .5 {words}")).unwrap().resolve(SIZE).unwrap().0
}

fn with_sides(kind: ViewKind) -> String {
    let vh = match kind {
        ViewKind::Parallel => 4.0,
        ViewKind::Cylindrical | ViewKind::Angular => 200.0,
        _ => 100.0,
    };
    format!("-vt{} -vh {vh} -vs .1 -vl -.05", kind.letter())
}

/// Returns what Radiance's `viewray` (image.c) does: origin and direction of a ray, and its length.
fn radiance_ray(view: &View, x: f64, y: f64) -> Option<(DVec3, DVec3, f64)> {
    let (across, along) = (x - 0.5 + view.vs, y - 0.5 + view.vl);
    let (right, up) = (view.right(), view.up());
    let (vh, vv) = (view.vh.to_radians(), view.vv.to_radians());
    let direction = match view.kind {
        ViewKind::Perspective => {
            view.vd
                + right * (across * 2.0 * (vh / 2.0).tan())
                + up * (along * 2.0 * (vv / 2.0).tan())
        }
        ViewKind::Parallel => {
            let start =
                view.vp + view.vd * view.vo + right * (across * view.vh) + up * (along * view.vv);
            return Some((start, view.vd, if view.va > 0.0 { view.va - view.vo } else { 0.0 }));
        }
        ViewKind::Cylindrical => {
            let around = across * vh;
            view.vd * around.cos() + right * around.sin() + up * (along * 2.0 * (vv / 2.0).tan())
        }
        ViewKind::Angular => {
            let (x, y) = (across * vh, along * vv);
            let angle = x.hypot(y);
            view.vd * angle.cos() + (right * x + up * y) * (angle.sin() / angle)
        }
        _ => {
            let (x, y) = (across * 2.0 * (vh / 2.0).sin(), along * 2.0 * (vv / 2.0).sin());
            let z = 1.0 - x * x - y * y;
            if z < 0.0 {
                return None;
            }
            view.vd * z.sqrt() + right * x + up * y
        }
    };
    let start = view.vp + direction * view.vo;
    Some((
        start,
        direction.normalize(),
        if view.va > 0.0 { (view.va - view.vo) * direction.length() } else { 0.0 },
    ))
}

#[test]
fn rays_begin_and_end_as_in_radiance() {
    for kind in ViewKind::ALL {
        for clips in ["-vo 0 -va 0", "-vo 1.5", "-va 7", "-vo 2.5 -va 2.75"] {
            let view = view(&format!("{} {clips}", with_sides(kind)));
            let mut compared = 0;
            for (x, y) in (0..121).map(|i| (f64::from(i % 11) / 10.0, f64::from(i / 11) / 10.0)) {
                let expected = radiance_ray(&view, x, y);
                let found = view.clipped_ray(x, y);
                let Some((start, direction, reach)) = expected else {
                    assert!(found.is_none(), "{kind:?} {x} {y}");
                    continue;
                };
                let found = found.unwrap();
                assert!(
                    found.0.distance(start) < 1e-12 && found.1.distance(direction) < 1e-12,
                    "{kind:?} {clips}"
                );
                // 0 means none in Radiance.
                let is_same = if reach == 0.0 {
                    found.2 == f64::INFINITY
                } else {
                    (found.2 - reach).abs() < 1e-12
                };
                assert!(is_same, "{kind:?} {clips}: {} for {reach}", found.2);
                // Points on the ray between the surfaces are visible.
                let at = |distance: f64| view.clip(start + direction * distance);
                assert_eq!(at(1e-9), Clip::Shown);
                assert!(view.vo == 0.0 || !kind.has_eye() || at(-1e-9) == Clip::Before);
                if reach > 0.0 {
                    assert_eq!((at(reach - 1e-9), at(reach + 1e-9)), (Clip::Shown, Clip::Beyond));
                } else {
                    assert_eq!(at(1e9), Clip::Shown);
                }
                compared += 1;
            }
            assert!(compared > 60, "{kind:?} {compared}");
        }
    }
}

#[test]
fn a_parallel_view_may_begin_behind_its_point() {
    let view = view("-vtl -vh 4 -vo -3 -va 2");
    let behind = view.vp - view.vd * 2.0;
    let (x, y, distance) = view.project(behind).unwrap();
    assert!((x - 0.5).abs() < 1e-12 && (y - 0.5).abs() < 1e-12 && (distance - 1.0).abs() < 1e-12);
    assert!(view.project(view.vp - view.vd * 3.5).is_none());
    assert_eq!(view.clip(view.vp + view.vd * 1.9), Clip::Shown);
    assert_eq!(view.clip(view.vp + view.vd * 2.1), Clip::Beyond);
    assert!(view.ray_to(behind).0.distance(view.eye()) < 1e-12);
}

#[test]
fn clipping_is_written_and_read() {
    let view = view("-vtv -vh 50 -vo .25 -va 12.5");
    assert!(view.to_vf_options().contains("-vo 0.25 -va 12.5"));
    assert_eq!(View::parse_vf(&view.to_vf_options()).unwrap().resolve(SIZE).unwrap().0, view);
    // Moving a view keeps them.
    let moved = view.moved(DVec3::ZERO, DVec3::X).unwrap();
    assert_eq!((moved.vo, moved.va), (0.25, 12.5));
}
