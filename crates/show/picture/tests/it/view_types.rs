//! Tests views of every type: rays and projections are inverse, agree with Radiance (rpict's manual
//! page, `image.c`), and cover the solid angles of closed forms.

// Clippy allows these only inside test functions, but helpers need them too.
#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use holo_picture::{View, ViewKind, ViewSpec};
use proptest::prelude::*;
use std::f64::consts::PI;

/// Returns a view from the origin along +y, with +z up, so that local (right, up, forward) is (x,
/// z, y).
fn forward(options: &str, size: (u32, u32)) -> (View, (u32, u32)) {
    let spec = View::parse_vf(&format!("-vp 0 0 0 -vd 0 1 0 -vu 0 0 1 {options}")).unwrap();
    spec.resolve(size).unwrap()
}

fn direction() -> impl Strategy<Value = DVec3> {
    let axis = -1.0..1.0f64;
    (axis.clone(), axis.clone(), axis)
        .prop_map(|(x, y, z)| DVec3::new(x, y, z))
        .prop_filter("a direction", |v| v.length() > 0.1)
}

/// Returns views of all types, with shifts and lifts.
fn view() -> impl Strategy<Value = View> {
    let coordinate = -1e3..1e3f64;
    let eye = (coordinate.clone(), coordinate.clone(), coordinate)
        .prop_map(|(x, y, z)| DVec3::new(x, y, z));
    let kind = prop::sample::select(&ViewKind::ALL);
    (
        kind,
        eye,
        direction(),
        direction(),
        (1.0..170.0f64, 1.0..170.0f64),
        (-0.3..0.3f64, -0.3..0.3f64),
    )
        .prop_filter("up is not along the view", |(_, _, vd, vu, ..)| {
            vd.normalize().cross(vu.normalize()).length() > 0.01
        })
        .prop_map(|(kind, vp, vd, vu, (vh, vv), (vs, vl))| {
            let sides = ViewSpec {
                kind: Some(kind),
                vh: Some(vh),
                vv: Some(vv),
                vs: Some(vs),
                vl: Some(vl),
                ..Default::default()
            };
            ViewSpec { vp: Some(vp), vd: Some(vd), vu: Some(vu), ..sides }
                .resolve((4, 3))
                .unwrap()
                .0
        })
}

proptest! {
    #[test]
    fn projection_is_the_inverse_of_a_ray(view in view(), x in 0.0..1.0f64, y in 0.0..1.0f64, t in 0.1..1e4f64) {
        if let Some((origin, direction)) = view.try_ray(x, y) {
            prop_assert!((direction.length() - 1.0).abs() < 1e-14);
            prop_assert_eq!((origin, direction), view.ray(x, y));
            let point = origin + direction * t;
            let (px, py, distance) = view.project(point).unwrap();
            // The point is rounded by |p|·ε. On the plane, an error of directions grows by 1/cos²
            // (tangents), by θ/sin θ (angles) and by 1/cos at the rim (sines). Picture coordinates
            // are in units of the sides.
            let (across, along) = view.extent();
            let moved = if view.kind.has_eye() { t } else { 1.0 };
            let rounding = 64.0 * f64::EPSILON * (1.0 + (origin.length() + t) / moved);
            let forward = direction.dot(view.vd);
            let growth = match view.kind {
                ViewKind::Perspective => forward.powi(-2),
                ViewKind::Cylindrical => {
                    let level = (1.0 - direction.dot(view.up()).powi(2)).sqrt();
                    level.powi(-2)
                }
                ViewKind::Angular => PI / (1.0 - forward * forward).sqrt().max(1e-3),
                ViewKind::Hemispherical => 1.0,
                _ => 1.0,
            };
            let tolerance = rounding * growth.max(1.0) / across.min(along).min(1.0);
            prop_assert!((px - x).abs() < tolerance && (py - y).abs() < tolerance, "({x} {y}) -> ({px} {py})");
            prop_assert!((distance - t).abs() < rounding * t.max(1.0));
            let (from, towards) = view.ray_to(point);
            prop_assert!(from.distance(origin) < rounding * t.max(1.0) && towards.distance(direction) < rounding);
            match view.project_direction(direction * t) {
                Some((dx, dy)) => prop_assert!((dx - x).abs() < tolerance && (dy - y).abs() < tolerance),
                None => prop_assert!(view.kind == ViewKind::Parallel),
            }
        }
    }

    #[test]
    fn written_options_read_back_as_the_same_view(view in view()) {
        let spec = View::parse_vf(&view.to_vf_options()).unwrap();
        prop_assert_eq!(spec.resolve((7, 5)).unwrap().0, view);
    }

    #[test]
    fn the_missing_side_makes_pixels_square(
        kind in prop::sample::select(&ViewKind::ALL), vh in 1.0..100.0f64, width in 64..2000u32, height in 64..2000u32,
    ) {
        let letter = kind.letter();
        let options = format!("-vp 0 0 0 -vd 0 1 0 -vt{letter} -vh {vh}");
        if let Ok((view, size)) = View::parse_vf(&options).unwrap().resolve((width, height)) {
            prop_assert_eq!(size, (width, height));
            let (across, along) = view.extent();
            prop_assert!((across / f64::from(width) / (along / f64::from(height)) - 1.0).abs() < 1e-9);
            // In reverse: the other side alone gives the same view.
            let other = format!("-vp 0 0 0 -vd 0 1 0 -vt{letter} -vv {}", view.vv);
            let (same, _) = View::parse_vf(&other).unwrap().resolve((width, height)).unwrap();
            prop_assert!((same.vh / vh - 1.0).abs() < 1e-9);
        } else {
            prop_assert!(matches!(kind, ViewKind::Angular | ViewKind::Hemispherical) && height > width);
        }
    }
}

#[test]
fn rays_agree_with_radiance() {
    let close = |options: &str, (x, y): (f64, f64), wanted: DVec3| {
        let (view, _) = forward(options, (100, 100));
        let found = view.ray(x, y).1;
        assert!(found.distance(wanted.normalize()) < 1e-15, "{options} ({x} {y}): {found}");
    };
    let degrees = f64::to_radians;
    // A cylinder around the up vector: a quarter of a width of 360° is a right angle; half its
    // height is a tangent.
    let panorama = "-vtc -vh 360 -vv 90";
    close(panorama, (0.5, 0.5), DVec3::Y);
    close(panorama, (0.75, 0.5), DVec3::X);
    close(panorama, (0.25, 1.0), DVec3::new(-1.0, 0.0, 1.0));
    close(panorama, (0.0, 0.0), DVec3::new(0.0, -1.0, -1.0));
    // An angular fisheye: the angle grows evenly from the centre, also beyond the horizon.
    close("-vta -vh 180 -vv 180", (0.5, 0.5), DVec3::Y);
    close("-vta -vh 180 -vv 180", (0.75, 0.5), DVec3::new(1.0, 1.0, 0.0));
    close("-vta -vh 180 -vv 180", (0.5, 0.0), -DVec3::Z);
    close(
        "-vta -vh 360 -vv 360",
        (0.5, 0.875),
        DVec3::new(0.0, degrees(135.0).cos(), degrees(135.0).sin()),
    );
    // A hemisphere seen from far away: sines.
    close("-vth -vh 180 -vv 180", (0.75, 0.5), DVec3::new(0.5, 0.75_f64.sqrt(), 0.0));
    close("-vth -vh 180 -vv 180", (0.5, 0.1), DVec3::new(0.0, 0.6, -0.8));
    close(
        "-vth -vh 60 -vv 60",
        (1.0, 0.5),
        DVec3::new(degrees(30.0).sin(), degrees(30.0).cos(), 0.0),
    );
    // Corners of fisheyes show nothing.
    let (fisheye, _) = forward("-vth -vh 180 -vv 180", (10, 10));
    assert_eq!(
        (fisheye.try_ray(0.1, 0.1), fisheye.ray(0.1, 0.1)),
        (None, (DVec3::ZERO, DVec3::ZERO))
    );
    let (all, _) = forward("-vta -vh 360 -vv 360", (10, 10));
    assert!(all.try_ray(0.1, 0.1).is_none() && all.try_ray(0.16, 0.16).is_some());
    // A half fisheye shows what is beside the eye in its corners, because Radiance cuts only at
    // 180° from the centre.
    let (half, _) = forward("-vta -vh 180 -vv 180", (10, 10));
    assert!(half.ray(1.0, 1.0).1.y < 0.0);
    // A parallel view: sizes are lengths, and rays begin side by side.
    let (parallel, size) = forward("-vtl -vh 8 -vv 4", (100, 100));
    assert_eq!(size, (100, 50));
    assert_eq!(parallel.ray(0.75, 0.25), (DVec3::new(2.0, 0.0, -1.0), DVec3::Y));
    assert_eq!(parallel.project(DVec3::new(2.0, 3.0, -1.0)), Some((0.75, 0.25, 3.0)));
    assert_eq!(parallel.project(DVec3::new(2.0, -3.0, -1.0)), None);
    assert_eq!(parallel.pixel_footprint(size, 7.0), 0.08);
}

#[test]
fn a_shift_moves_the_picture_and_a_panorama_wraps_around() {
    for kind in ['v', 'l', 'c', 'a', 'h'] {
        let (plain, _) = forward(&format!("-vt{kind} -vh 40 -vv 40"), (100, 100));
        let (shifted, _) =
            forward(&format!("-vt{kind} -vh 40 -vv 40 -vs 0.25 -vl -0.5"), (100, 100));
        let ((from, along), (same_from, same)) = (plain.ray(0.7, 0.3), shifted.ray(0.45, 0.8));
        assert!(along.distance(same) < 1e-15 && from.distance(same_from) < 1e-14, "{kind}");
    }
    let (panorama, _) = forward("-vtc -vh 360 -vv 90 -vs 0.4", (100, 100));
    for x in [0.01, 0.3, 0.7, 0.99] {
        let (_, along) = panorama.ray(x, 0.5);
        assert!((panorama.project_direction(along).unwrap().0 - x).abs() < 1e-12, "{x}");
    }
}

#[test]
fn a_change_of_type_drops_the_sizes() {
    let spec = |text: &str| View::parse_vf(text).unwrap();
    let base = spec("-vp 0 0 0 -vd 0 1 0 -vh 60 -vv 40");
    assert_eq!(base.overridden_by(&spec("-vta -vh 170")).resolve((64, 64)).unwrap().0.vv, 170.0);
    assert_eq!(base.overridden_by(&spec("-vtv -vh 50")).resolve((64, 64)).unwrap().0.vv, 40.0);
    assert_eq!(base.overridden_by(&spec("-vtc")).resolve((64, 32)).unwrap().0.vh, 360.0);
    assert!(base.overridden_by(&spec("-vtl")).resolve((64, 64)).is_err());
}

/// Returns the solid angle of a triangle of directions (Van Oosterom & Strackee 1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Returns the sum of the solid angles of the pixels whose centre is at most `most` degrees off the
/// axis, and the largest of them. Solid angles are measured by the rays of the pixels' corners.
fn sum(view: &View, side: u32, most: f64) -> (f64, f64) {
    let least = most.to_radians().cos();
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for (row, column) in (0..side * side).map(|pixel| (pixel / side, pixel % side)) {
        let corner = |right: u32, up: u32| {
            let at = |i: u32| f64::from(i) / f64::from(side);
            view.try_ray(at(column + right), at(row + up)).map(|ray| ray.1)
        };
        let (x, y) = View::pixel_centre((side, side), column, side - 1 - row);
        let Some((_, middle)) = view.try_ray(x, y) else { continue };
        let corners = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
        let (Some(a), Some(b), Some(c), Some(d)) = corners else { continue };
        if middle.dot(view.vd) >= least {
            let pixel = solid_angle([a, b, c]) + solid_angle([a, c, d]);
            sum += pixel;
            largest = largest.max(pixel);
        }
    }
    (sum, largest)
}

#[test]
fn solid_angles_of_pixels_sum_to_that_of_the_view() {
    const SIDE: u32 = 256;
    // Whole rectangles. Each pixel is two triangles of great circles, which is exact for a
    // perspective view. Two sides of a panorama's pixel are not great circles, which adds an error
    // of the square of their angle.
    let (perspective, _) = forward("-vtv -vh 80 -vv 50", (SIDE, SIDE));
    let (a, b) = (40f64.to_radians().sin(), 25f64.to_radians().sin());
    assert!((sum(&perspective, SIDE, 180.0).0 - 4.0 * (a * b).asin()).abs() < 1e-10);
    let (panorama, _) = forward("-vtc -vh 300 -vv 100", (SIDE, SIDE));
    let zone = 300f64.to_radians() * 2.0 * 50f64.to_radians().sin();
    assert!(
        (sum(&panorama, SIDE, 180.0).0 / zone - 1.0).abs()
            < (300f64.to_radians() / f64::from(SIDE)).powi(2)
    );
    // Cones of fisheyes: at most 4·SIDE pixels lie on the border, where each counts or does not.
    for (options, cone) in [
        ("-vta -vh 360 -vv 360", 130.0),
        ("-vta -vh 150 -vv 150", 75.0),
        ("-vth -vh 180 -vv 180", 60.0),
        ("-vth -vh 90 -vv 90", 45.0),
    ] {
        let (view, _) = forward(options, (SIDE, SIDE));
        let (found, largest) = sum(&view, SIDE, cone);
        let exact = 2.0 * PI * (1.0 - f64::to_radians(cone).cos());
        let border = 4.0 * f64::from(SIDE) * largest;
        assert!(
            (found - exact).abs() < border && border < 0.1 * exact,
            "{options}: {found} for {exact}"
        );
    }
    // The whole sphere: pixels with a corner outside belong to the border.
    let (all, _) = forward("-vta -vh 360 -vv 360", (SIDE, SIDE));
    let (found, largest) = sum(&all, SIDE, 180.0);
    assert!((4.0 * PI - found).abs() < 4.0 * f64::from(SIDE) * largest, "{found}");
}
