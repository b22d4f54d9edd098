//! Tests views: rays and projections are inverse, angles and sizes are Radiance's, and every
//! notation of a view is understood.

// Clippy allows these only inside test functions, but helpers need them too.
#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use holo_picture::{MAX_SIDE, View, ViewError, ViewKind, ViewSpec};
use proptest::prelude::*;

fn direction() -> impl Strategy<Value = DVec3> {
    let axis = -1.0..1.0f64;
    (axis.clone(), axis.clone(), axis)
        .prop_map(|(x, y, z)| DVec3::new(x, y, z))
        .prop_filter("a direction", |v| v.length() > 0.1)
}

fn view() -> impl Strategy<Value = View> {
    let coordinate = -1e3..1e3f64;
    let eye = (coordinate.clone(), coordinate.clone(), coordinate)
        .prop_map(|(x, y, z)| DVec3::new(x, y, z));
    (eye, direction(), direction(), 1.0..170.0f64, 1.0..170.0f64)
        .prop_filter("up is not along the view", |(_, vd, vu, ..)| {
            vd.normalize().cross(vu.normalize()).length() > 0.01
        })
        .prop_map(|(vp, vd, vu, vh, vv)| View::new(vp, vd, vu, Some(vh), Some(vv), (4, 3)).unwrap())
}

fn forward(
    vh: Option<f64>,
    vv: Option<f64>,
    size: (u32, u32),
) -> Result<(View, (u32, u32)), ViewError> {
    View::resolve(DVec3::ZERO, DVec3::Y, DVec3::Z, vh, vv, size)
}

proptest! {
    #[test]
    fn projection_is_the_inverse_of_a_ray(view in view(), x in -0.2..1.2f64, y in -0.2..1.2f64, t in 0.1..1e4f64) {
        let (origin, direction) = view.ray(x, y);
        prop_assert!((direction.length() - 1.0).abs() < 1e-14);
        let (px, py, distance) = view.project(origin + direction * t).unwrap();
        // The point is rounded by |p|·ε, seen under |p|·ε/t. Picture coordinates stretch that by (1
        // + tan²)/tan(angle/2).
        let (th, tv) = (view.extent().0 / 2.0, view.extent().1 / 2.0);
        let tan_squared = 2.0 * (th * th + tv * tv);
        let rounding = 32.0 * f64::EPSILON * (1.0 + origin.length() / t);
        let tolerance = rounding * (1.0 + tan_squared) / th.min(tv).min(1.0);
        prop_assert!((px - x).abs() < tolerance && (py - y).abs() < tolerance, "({x} {y}) -> ({px} {py})");
        prop_assert!((distance / t - 1.0).abs() < rounding);
        prop_assert!(view.project(origin - direction * t).is_none());
        let (dx, dy) = view.project_direction(direction * t).unwrap();
        prop_assert!((dx - x).abs() < tolerance && (dy - y).abs() < tolerance);
    }

    #[test]
    fn a_pixel_holds_its_own_centre(width in 1..5000u32, height in 1..5000u32, fx in 0.0..1.0f64, fy in 0.0..1.0f64) {
        let column = (fx * f64::from(width)) as u32;
        let row = (fy * f64::from(height)) as u32;
        let (x, y) = View::pixel_centre((width, height), column, row);
        prop_assert_eq!(View::pixel_at((width, height), x, y), Some((column, row)));
    }

    #[test]
    fn written_options_read_back_as_the_same_view(view in view()) {
        let spec = View::parse_vf(&view.to_vf_options()).unwrap();
        let again = spec.resolve((7, 5)).unwrap().0;
        prop_assert_eq!(again, view);
    }

    #[test]
    fn the_fitted_picture_has_square_pixels_and_touches_its_limit(
        vh in 5.0..170.0f64, vv in 5.0..170.0f64, width in 1..3000u32, height in 1..3000u32,
    ) {
        let (view, (w, h)) = forward(Some(vh), Some(vv), (width, height)).unwrap();
        prop_assert!((1..=width).contains(&w) && (1..=height).contains(&h) && (w == width || h == height));
        // Pixels are square within the half pixel of rounding of the shorter side, or within its
        // minimum of one pixel.
        let (across, down) = view.extent();
        let (ideal_w, ideal_h) = (f64::from(h) * across / down, f64::from(w) * down / across);
        let w_fits = (f64::from(w) - ideal_w).abs() <= 0.5 + 1e-9 || w == 1;
        let h_fits = (f64::from(h) - ideal_h).abs() <= 0.5 + 1e-9 || h == 1;
        prop_assert!(w_fits || h_fits, "{w}x{h} for {ideal_w} or {ideal_h}");
    }

    #[test]
    fn any_text_gives_a_view_or_an_error(text in "[-+.0-9vpduhtoasl e,=VIEW\n]{0,80}") {
        let mut spec = ViewSpec::default();
        let _ = spec.apply_line(&text);
        let _ = spec.apply_option("--vp", &text);
        if let Ok(spec) = View::parse_vf(&text) {
            let _ = spec.resolve((640, 480));
        }
    }
}

#[test]
fn rays_agree_with_radiance() {
    let (view, _) = forward(Some(90.0), Some(60.0), (100, 100)).unwrap();
    let half_high = 30f64.to_radians().tan();
    for ((x, y), wanted) in [
        ((0.5, 0.5), DVec3::Y),
        ((1.0, 0.5), DVec3::new(1.0, 1.0, 0.0)),
        ((0.0, 0.5), DVec3::new(-1.0, 1.0, 0.0)),
        ((0.5, 1.0), DVec3::new(0.0, 1.0, half_high)),
        ((0.5, 0.0), DVec3::new(0.0, 1.0, -half_high)),
    ] {
        assert!(view.ray(x, y).1.distance(wanted.normalize()) < 1e-15, "({x} {y})");
    }
    // Row 0 is at the top: its rays go up.
    let (x, y) = View::pixel_centre((4, 4), 3, 0);
    let up_right = view.ray(x, y).1;
    assert!(up_right.x > 0.0 && up_right.z > 0.0);
    assert_eq!(View::pixel_at((4, 4), 0.99, 0.01), Some((3, 3)));
    assert_eq!(View::pixel_at((4, 4), 1.0, 0.5), None);
    assert_eq!(View::pixel_at((4, 4), f64::NAN, 0.5), None);
    // A picture 90 degrees wide is 2 wide at distance 1.
    assert!((view.pixel_footprint((100, 75), 3.0) - 0.06).abs() < 1e-15);
}

#[test]
fn the_shape_of_the_picture_and_the_angles_follow_from_each_other() {
    // As in the reference pictures: vh 60 with 320×240 gives vv 46.826.
    let (view, size) = forward(Some(60.0), None, (320, 240)).unwrap();
    assert_eq!(size, (320, 240));
    assert!((view.vv - 46.826).abs() < 5e-4);
    let (view, size) = forward(None, Some(view.vv), (320, 240)).unwrap();
    assert!(size == (320, 240) && (view.vh - 60.0).abs() < 1e-12);
    let (view, _) = forward(None, None, (100, 100)).unwrap();
    assert!(view.vh == 60.0 && (view.vv - 60.0).abs() < 1e-12);
    // Both given: rpict -x 640 -y 480 -vh 60 -vv 60 makes 480×480; -vv 46.826 uses all of it; a
    // tall picture loses width.
    assert_eq!(forward(Some(60.0), Some(60.0), (640, 480)).unwrap().1, (480, 480));
    assert_eq!(forward(Some(60.0), Some(46.826), (640, 480)).unwrap().1, (640, 480));
    assert_eq!(forward(Some(60.0), Some(20.0), (640, 480)).unwrap().1, (640, 195));
    let (view, _) = forward(Some(60.0), Some(60.0), (640, 480)).unwrap();
    assert!(view.vh == 60.0 && view.vv == 60.0);
}

#[test]
fn degenerate_views_are_refused() {
    let at = |vp, vd, vu, vh| View::resolve(vp, vd, vu, Some(vh), None, (64, 64)).map(|_| ());
    let (o, x, z) = (DVec3::ZERO, DVec3::X, DVec3::Z);
    assert_eq!(at(o, x, z, 60.0), Ok(()));
    assert_eq!(at(DVec3::NAN, x, z, 60.0), Err(ViewError::NotFinite { option: "-vp" }));
    assert_eq!(at(o, o, z, 60.0), Err(ViewError::ZeroDirection { option: "-vd" }));
    assert_eq!(at(o, x, x * f64::INFINITY, 60.0), Err(ViewError::NotFinite { option: "-vu" }));
    assert_eq!(at(o, z, -z, 60.0), Err(ViewError::UpIsAlongView));
    for degrees in [0.0, -10.0, 180.0, 200.0, 540.0] {
        assert_eq!(at(o, x, z, degrees), Err(ViewError::Angle { option: "-vh", degrees }));
    }
    assert!(matches!(at(o, x, z, f64::NAN), Err(ViewError::Angle { .. })));
    for (width, height) in [(0, 10), (10, 0), (MAX_SIDE + 1, 1), (MAX_SIDE, MAX_SIDE)] {
        assert_eq!(forward(None, None, (width, height)), Err(ViewError::Size { width, height }));
    }
    // Lengths of directions do not matter, however extreme.
    let short = View::resolve(o, x * 1e-200, z * 1e200, Some(60.0), None, (64, 64)).unwrap().0;
    assert_eq!(short.vd, x);
}

#[test]
fn all_notations_of_a_view_mean_the_same() {
    let file =
        "rview -vtv -vp 12.5 .5 5 -vd .7 .7 0 -vu 0 0 1 -vh 60 -vv 40 -vo 0 -va 0 -vs 0 -vl 0\n";
    let wanted = View::parse_vf(file).unwrap();
    assert_eq!(wanted.kind, Some(ViewKind::Perspective));
    assert_eq!(wanted.vp, Some(DVec3::new(12.5, 0.5, 5.0)));
    assert_eq!((wanted.vh, wanted.vv, wanted.vl), (Some(60.0), Some(40.0), Some(0.0)));
    for text in [
        "VIEW= -vtv -vp 12.5 .5 5 -vd .7 .7 0 -vu 0 0 1 -vh 60 -vv 40 -vo 0 -va 0 -vs 0 -vl 0",
        "-vtv -vp 12.5 .5 5 -vd .7 .7 0 -vu 0 0 1\n-vh 60 -vv 40 -vo 0 -va 0 -vs 0 -vl 0",
        // A picture's header: other options and lines are ignored, later ones override, indented
        // ones do not count.
        "#?RADIANCE\n/usr/bin/rpict -x 64 -av 0 -1 .5 -vtv -vp 1 1 1 -vd .7 .7 0 -vu 0 0 1 -vh 60 -vv 40 scene.oct\n\
         CAPDATE= 2024:01:01\nVIEW= -vp 12.5 .5 5 -vo 0 -va 0 -vs 0 -vl 0\npfilt -1\n",
    ] {
        assert_eq!(View::parse_vf(text).unwrap(), wanted, "{text}");
    }
    let mut typed = ViewSpec::default();
    for (option, value) in [
        ("--vp", "12.5,0.5,5"),
        ("--vd", ".7, .7, 0"),
        ("vu", "0 0 1"),
        ("-vh", "60"),
        ("--vv", "40"),
    ] {
        typed.apply_option(option, value).unwrap();
    }
    let zeros = ViewSpec {
        vo: Some(0.0),
        va: Some(0.0),
        vs: Some(0.0),
        vl: Some(0.0),
        ..ViewSpec::default()
    };
    let both = ViewSpec { kind: Some(ViewKind::Perspective), ..typed }.overridden_by(&zeros);
    assert_eq!(both, wanted);
    // A letter apart from its option, at the end of a line and before another option.
    for text in ["-vh 90 -vt c", "-vt c -vh 90"] {
        let mut spaced = ViewSpec::default();
        spaced.apply_line(text).unwrap();
        let kind = Some(ViewKind::Cylindrical);
        assert_eq!(spaced, ViewSpec { kind, vh: Some(90.0), ..ViewSpec::default() });
    }
    // A script's `view` line moves the eye and keeps the rest.
    let mut moved = wanted;
    moved.apply_line("-vp -1 -2.5 -3e-1").unwrap();
    assert_eq!(moved, ViewSpec { vp: Some(DVec3::new(-1.0, -2.5, -0.3)), ..wanted });
    let diagonal = DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0);
    assert!(moved.resolve((60, 60)).unwrap().0.vd.distance(diagonal) < 1e-15);
}

#[test]
fn errors_name_what_is_wrong_with_a_view() {
    let line = |text: &str| ViewSpec::default().apply_line(text).unwrap_err().to_string();
    assert!(line("-vts").contains("-vta (angular fisheye)"));
    assert!(
        line("-vtx")
            .starts_with("view type -vtx is not supported; the types are v (perspective), l")
    );
    assert!(line("-vt").starts_with("view type -vt is not supported"));
    assert!(line("-vt -vp 1 2 3").starts_with("view type -vt is not supported"));
    assert!(line("-vt x").starts_with("view type -vtx is not supported"));
    assert_eq!(line("-vp 1 2 -vh 60"), "-vp takes 3 number(s), found 2");
    assert_eq!(line("-vp 1 2 x"), "-vp: `x` is not a finite number");
    assert_eq!(line("-vh inf"), "-vh: `inf` is not a finite number");
    assert!(line("-vq 1").starts_with("`-vq` is not a view option"));
    assert!(line("-vh 60 70").starts_with("`70` is not a view option"));
    let option = |name: &str, value: &str| {
        ViewSpec::default().apply_option(name, value).unwrap_err().to_string()
    };
    assert_eq!(option("--vp", "1,2"), "--vp takes 3 number(s), found 2");
    assert_eq!(option("--vh", "wide"), "--vh: `wide` is not a finite number");
    assert!(option("--size", "640x480").starts_with("`--size` is not a view option"));
    assert_eq!(View::parse_vf("rpict -ab 2 scene.oct\n# nothing"), Err(ViewError::NoView));
    let in_file = View::parse_vf("\nrview -vtv -vh sixty").unwrap_err().to_string();
    assert_eq!(in_file, "line 2: -vh: `sixty` is not a finite number");
    let unresolved =
        |text: &str| View::parse_vf(text).unwrap().resolve((64, 64)).unwrap_err().to_string();
    assert_eq!(unresolved("-vd 0 1 0"), "the view lacks -vp");
    assert_eq!(unresolved("-vp 0 0 0"), "the view lacks -vd");
    let from_here = |text: &str| unresolved(&format!("-vp 0 0 0 -vd 0 1 0 {text}"));
    assert_eq!(
        from_here("-vo -.5"),
        "-vo -0.5 is behind the eye: it must be at least 0 except in parallel views"
    );
    assert_eq!(from_here("-vo 2 -va 2"), "-va 2 must be larger than -vo 2, or 0 for none");
    assert_eq!(
        from_here("-vtl -vh 4 -vo -3 -va -2"),
        "-va -2 must be larger than -vo -3, or 0 for none"
    );
    assert_eq!(from_here("-vtl"), "the view lacks -vh: how wide it is, in scene units");
    assert_eq!(from_here("-vtl -vh -2"), "-vh -2 must be a length above 0, in scene units");
    assert_eq!(from_here("-vta -vh 361"), "-vh 361 must be above 0 and at most 360 degrees");
    assert_eq!(from_here("-vth -vh 90 -vv 181"), "-vv 181 must be above 0 and at most 180 degrees");
    assert_eq!(
        from_here("-vtc -vh 90 -vv 180"),
        "-vv 180 must lie between 0 and 180 degrees, both excluded"
    );
    let tall = View::parse_vf("-vp 0 0 0 -vd 0 1 0 -vth -vh 180")
        .unwrap()
        .resolve((64, 65))
        .unwrap_err()
        .to_string();
    assert_eq!(
        tall,
        "with -vh 180 this picture has no -vv that makes its pixels square: give both"
    );
}
