//! Every driver shows what lies between a view's clipping surfaces.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::{self, near_samples, quadtree, section};
use glam::DVec3;
use holo_driver_quadtree::QuadtreeParams;
use holo_driver_rendercache::frameless::Frameless;
use holo_driver_rendercache::{
    EmptyPixels, Moment, Place, PointImage, PointImageParams, RayResult, Smoothing,
};
use holo_picture::{View, ViewKind, ViewSpec};
use holo_section::ViewClass;

const SIZE: (u32, u32) = (48, 36);
const EYE: DVec3 = DVec3::new(0.3, -0.2, 0.1);
const FORE: f64 = 3.0;
const AFT: f64 = 11.0;

fn view_of(kind: ViewKind, clips: bool) -> View {
    let vh = match kind {
        ViewKind::Perspective => 70.0,
        ViewKind::Parallel => 5.0,
        ViewKind::Cylindrical => 160.0,
        ViewKind::Angular => 200.0,
        _ => 150.0,
    };
    let spec = ViewSpec { kind: Some(kind), vh: Some(vh), vp: Some(EYE), ..ViewSpec::default() };
    let (vo, va) = if clips { (Some(FORE), Some(AFT)) } else { (None, None) };
    ViewSpec { vd: Some(DVec3::new(1.0, 0.2, -0.1)), vo, va, ..spec }.resolve(SIZE).unwrap().0
}

/// Returns everything that a ray hits, nearest first: a red ball, a green wall of two shades, and
/// blue all around.
fn hits(origin: DVec3, direction: DVec3) -> Vec<([f32; 3], f64)> {
    let ball = |centre: DVec3, radius: f64| {
        let along = (centre - origin).dot(direction);
        let half = radius * radius - ((centre - origin) - direction * along).length_squared();
        if half > 0.0 { [along - half.sqrt(), along + half.sqrt()] } else { [-1.0; 2] }
    };
    let mut found: Vec<_> = ball(DVec3::new(2.0, -0.2, -0.3), 0.6)
        .into_iter()
        .map(|t| ([0.9, 0.05, 0.05], t))
        .collect();
    found.extend(ball(EYE, 20.0).into_iter().map(|t| ([0.1, 0.2, 0.8], t)));
    let wall = (6.0 - origin.x) / direction.x;
    let at = origin + direction * wall;
    if at.y.abs() < 2.5 && at.z.abs() < 1.5 {
        found.push(([0.1, if at.y < 0.3 { 0.7 } else { 0.35 }, 0.1], wall));
    }
    found.retain(|&(_, t)| t > 1e-9);
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found
}

fn first(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    hits(origin, direction).first().copied().unwrap_or(([0.0; 3], f64::INFINITY))
}

/// Returns the depth that is compared with `-vo` and `-va` according to Radiance's manual.
fn depth(kind: ViewKind, view: &View, p: DVec3) -> f64 {
    let d = p - view.vp;
    match kind {
        ViewKind::Perspective | ViewKind::Parallel => d.dot(view.vd),
        ViewKind::Cylindrical => (d - view.up() * d.dot(view.up())).length(),
        _ => d.length(),
    }
}

/// Returns the colour of a ray between the clipping surfaces, and whether something nearer hides it
/// from rays that begin at the eye.
fn shown(view: &View, origin: DVec3, direction: DVec3) -> ([f32; 3], bool) {
    let all = hits(origin, direction);
    let depth_of = |t: f64| depth(view.kind, view, origin + direction * t);
    let is_hidden = all.first().is_some_and(|&(_, t)| depth_of(t) < FORE);
    let seen =
        all.into_iter().find(|&(_, t)| depth_of(t) >= FORE).filter(|&(_, t)| depth_of(t) <= AFT);
    (seen.map_or([0.0; 3], |(colour, _)| colour), is_hidden)
}

/// For each pixel, the mean and the variance of 8×8 rays, and whether anything hides one of them.
struct Truth {
    pixels: Vec<[f32; 3]>,
    variance: f64,
    hidden: Vec<bool>,
}

fn truth(view: &View) -> Truth {
    const SIDE: u32 = 8;
    let (mut pixels, mut hidden, mut variance) = (Vec::new(), Vec::new(), 0.0);
    for (column, row) in (0..SIZE.1).flat_map(|row| (0..SIZE.0).map(move |column| (column, row))) {
        let (mut sum, mut squares, mut is_hidden) = ([0.0_f64; 3], 0.0, false);
        for (i, j) in (0..SIDE * SIDE).map(|part| (part % SIDE, part / SIDE)) {
            let x =
                (f64::from(column) + (f64::from(i) + 0.5) / f64::from(SIDE)) / f64::from(SIZE.0);
            let y =
                1.0 - (f64::from(row) + (f64::from(j) + 0.5) / f64::from(SIDE)) / f64::from(SIZE.1);
            let Some((origin, direction)) = view.try_ray(x, y) else { continue };
            // Rays begin on the plane through the eye, wherever the view's own rays begin.
            let back = if view.kind == ViewKind::Parallel { view.vo } else { 0.0 };
            let (colour, hides) = shown(view, origin - direction * back, direction);
            is_hidden |= hides;
            (0..3).for_each(|i| sum[i] += f64::from(colour[i]));
            squares += colour.iter().map(|&channel| f64::from(channel).powi(2)).sum::<f64>();
        }
        let n = f64::from(SIDE * SIDE);
        variance += squares / n - sum.iter().map(|sum| (sum / n).powi(2)).sum::<f64>();
        pixels.push(sum.map(|sum| (sum / n) as f32));
        hidden.push(is_hidden);
    }
    Truth { variance: variance / pixels.len() as f64, pixels, hidden }
}

/// Returns the mean squared error over the pixels for which `counts` is true.
fn error(found: &[[f32; 3]], truth: &[[f32; 3]], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (pixel, (found, truth)) in
        found.iter().zip(truth).enumerate().filter(|(pixel, _)| counts(*pixel))
    {
        sum += (0..3).map(|i| f64::from(found[i] - truth[i]).powi(2)).sum::<f64>();
        count += 1.0;
        assert!(found.iter().all(|channel| channel.is_finite()), "{pixel}");
    }
    sum / count
}

#[test]
fn the_scene_has_something_before_between_and_beyond() {
    for kind in ViewKind::ALL {
        let (clipped, plain) = (truth(&view_of(kind, true)), truth(&view_of(kind, false)));
        let share = |is: &dyn Fn(&[f32; 3]) -> bool| {
            clipped.pixels.iter().filter(|pixel| is(pixel)).count()
        };
        let wall = share(&|pixel| pixel[1] > 0.3 && pixel[2] < 0.2);
        let black = share(&|pixel| *pixel == [0.0; 3]);
        let hidden = clipped.hidden.iter().filter(|&&hidden| hidden).count();
        assert!(wall > 30 && black > 30 && hidden > 8, "{kind:?}: {wall} {black} {hidden}");
        assert_eq!(plain.pixels.len(), clipped.pixels.len());
    }
}

#[test]
fn the_quadtree_omits_what_is_before_the_fore_surface_and_shows_black_beyond_the_aft_one() {
    let section = section([0.0, -2.5, -1.8], [0.6, 5.0, 3.6], [16; 3], ViewClass::Interior, false);
    for kind in ViewKind::ALL {
        let view = view_of(kind, true);
        let truth = truth(&view);
        let stored =
            near_samples(first, &section, &view, 60 * (SIZE.0 * SIZE.1) as usize, 3, common::clean);
        let frame = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
        // Stored rays end on objects before the fore surface, so nothing is known behind those.
        // Their leaves are filled from others.
        let covered: Vec<bool> = frame.depth.iter().map(|&depth| depth != 0.0).collect();
        let counts = |pixel: usize| !truth.hidden[pixel] && covered[pixel];
        assert!((0..covered.len()).filter(|&pixel| counts(pixel)).count() > 20, "{kind:?}");
        let (error, power) = (
            error(&frame.picture.pixels, &truth.pixels, counts),
            error(&vec![[0.0; 3]; truth.pixels.len()], &truth.pixels, counts),
        );
        println!("{kind:?}: {:.1} dB", -10.0 * (error / power.max(1e-9)).log10());
        // The tests of view types reach 25 dB without clipping.
        assert!(error < 0.003 * power.max(0.01), "{kind:?}: {error} of {power}");
        let is_of_wall = |pixel: &[f32; 3]| pixel[0] <= 0.11 && pixel[2] <= 0.11;
        assert!(frame.picture.pixels.iter().all(is_of_wall), "{kind:?}: no red, no blue");
    }
}

#[test]
fn the_render_cache_converges_to_what_lies_between_the_surfaces() {
    for kind in ViewKind::ALL {
        let (view, plain) = (view_of(kind, true), view_of(kind, false));
        let truth = truth(&view);
        let mut cache = PointImage::new(SIZE, PointImageParams::default()).unwrap();
        let pixels = (SIZE.0 * SIZE.1) as usize;
        let mut samples = Vec::new();
        // The first frames are not clipped, so red and blue points enter.
        for frame in 0..100 {
            let view = if frame < 20 { plain } else { view };
            let moment = Moment { view, predicted: None, samples: &samples, wanted: pixels / 2 };
            let shown = cache.frame(&moment);
            let is_ray = |(_, _, direction): &(_, DVec3, DVec3)| *direction != DVec3::ZERO;
            samples = shown
                .requests()
                .filter(is_ray)
                .map(|(tag, origin, direction)| {
                    let (radiance, distance) = first(origin, direction);
                    RayResult {
                        tag,
                        ..RayResult::new(Place::At(origin + direction * distance), radiance)
                    }
                })
                .collect();
        }
        let found =
            cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: 0 }).picture();
        // Half of the pixels are renewed per frame, one in eight of them through points: about 35
        // rays each.
        let (error, alone) = (error(&found.pixels, &truth.pixels, |_| true), truth.variance / 35.0);
        println!("{kind:?}: {error:.2e} where independent rays would leave {alone:.2e}");
        // The constant allows for the truth's 64 rays and packed colours, which may be off by 1/256
        // of the light.
        assert!(error < 1.5 * alone + 2e-5, "{kind:?}: {error}");
    }
}

#[test]
fn points_that_are_there_are_clipped_at_once_and_come_back() {
    for kind in ViewKind::ALL {
        let (view, plain) = (view_of(kind, true), view_of(kind, false));
        let params = PointImageParams {
            empty: EmptyPixels::Black,
            smoothing: Smoothing::Gaps,
            ..Default::default()
        };
        let mut cache = PointImage::new(SIZE, params).unwrap();
        let samples: Vec<_> = (0..SIZE.0 * SIZE.1)
            .filter_map(|pixel| {
                let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
                let (origin, direction) = plain.try_ray(x, y)?;
                let (radiance, distance) = first(origin, direction);
                Some(RayResult::new(Place::At(origin + direction * distance), radiance))
            })
            .collect();
        let mut frame = |view: View, samples: &[RayResult]| {
            cache.frame(&Moment { view, predicted: None, samples, wanted: 0 }).picture().pixels
        };
        let before = frame(plain, &samples);
        let reds = |pixels: &[[f32; 3]]| pixels.iter().filter(|pixel| pixel[0] > 0.11).count();
        let blues = |pixels: &[[f32; 3]]| pixels.iter().filter(|pixel| pixel[2] > 0.11).count();
        assert!(reds(&before) > 4 && blues(&before) > 30, "{kind:?}");
        let clipped = frame(view, &[]);
        assert_eq!((reds(&clipped), blues(&clipped)), (0, 0), "{kind:?}");
        assert!(
            clipped.iter().filter(|pixel| pixel[1] > 0.3).count() > 20,
            "{kind:?}: the wall is there"
        );
        assert!(frame(plain, &[]) == before, "{kind:?}");
    }
}

#[test]
fn frameless_rays_begin_on_the_fore_surface() {
    for kind in ViewKind::ALL {
        let view = view_of(kind, true);
        let mut frameless = Frameless::new(SIZE, view, 1).unwrap();
        let mut rays = 0;
        for (_, origin, direction) in
            frameless.requests(500).filter(|(_, _, direction)| *direction != DVec3::ZERO)
        {
            assert!((depth(kind, &view, origin) - FORE).abs() < 1e-9, "{kind:?}");
            assert!((direction.length() - 1.0).abs() < 1e-9);
            rays += 1;
        }
        assert!(rays > 300, "{kind:?}");
    }
}
