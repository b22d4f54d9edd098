//! Every driver shows views of every type. Samples land where the view sees their surface, and
//! pictures are what the view's rays see.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::*;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{FrameRequest, SelectOptions, select_beams, viewpoint};
use holo_driver_quadtree::{LeafSize, Quadtree, QuadtreeParams};
use holo_driver_rendercache::{Moment, Place, PointImage, PointImageParams, RayResult, Stages};
use holo_driver_surfaces::surfaces_driver;
use holo_picture::{View, ViewKind, ViewSpec};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene as Geometry};
use holo_section::{BeamKey, Sample, Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 72);

/// Returns a view from inside the room's section, not parallel to an axis, shifted and lifted a
/// little.
fn view_of(kind: ViewKind) -> View {
    let vh = match kind {
        ViewKind::Perspective => 70.0,
        ViewKind::Parallel => 2.5,
        ViewKind::Cylindrical => 320.0,
        ViewKind::Angular => 300.0,
        _ => 170.0,
    };
    let spec = ViewSpec {
        kind: Some(kind),
        vh: Some(vh),
        vs: Some(0.05),
        vl: Some(-0.03),
        ..ViewSpec::default()
    };
    let towards = DVec3::new(0.9, 0.35, -0.1);
    let spec = ViewSpec { vp: Some(DVec3::new(3.3, 4.1, 3.0)), vd: Some(towards), ..spec };
    spec.resolve(SIZE).unwrap().0
}

/// Returns the number of each pixel with the place of its centre in the picture.
fn pixels() -> impl Iterator<Item = (usize, f64, f64)> {
    (0..SIZE.0 * SIZE.1).map(|pixel| {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        (pixel as usize, x, y)
    })
}

#[test]
fn a_sample_lands_where_the_view_sees_its_surface() {
    let section = section([2.0, 2.5, 1.5], [4.0, 3.0, 3.0], [8; 3], ViewClass::Interior, true);
    for kind in ViewKind::ALL {
        let seen = view_of(kind);
        let mut random = Random(9);
        let (mut shown, mut behind) = (0, 0);
        for _ in 0..250 {
            let Some((origin, direction)) = seen.try_ray(random.unit(), random.unit()) else {
                continue;
            };
            let near = origin + DVec3::new(random.unit(), random.unit(), random.unit()) * 0.2;
            let Some(hit) = section.line(near, direction) else { continue };
            let ray = section.ray(hit.pair, hit.coords);
            let sample = Sample::encode(
                hit.coords,
                [0.25, 0.5, 1.0],
                0.5 + 9.0 * random.unit(),
                section.diagonal(),
                0,
            );
            let surface = ray.origin + ray.direction * sample.distance(section.diagonal());
            let place = seen.project(surface);
            let pixel = place
                .and_then(|(x, y, distance)| Some((View::pixel_at(SIZE, x, y)?, x, y, distance)));
            let params = QuadtreeParams { leaf: LeafSize::Fixed(0), ..QuadtreeParams::default() };
            let mut tree = Quadtree::new(Arc::from([section.clone()]), seen, SIZE, params);
            tree.insert(key(0, section.beam(hit.pair)), 1, &[sample]);
            let frame = tree.draw();
            let Some(((column, row), x, y, distance)) = pixel else {
                assert_eq!(frame.samples_used, 0, "{kind:?}");
                behind += 1;
                continue;
            };
            // Within 1/1000 of a pixel's border, the sample may land in the neighbour.
            let inside = |along: f64| (0.001..0.999).contains(&along.fract());
            if !(inside(x * f64::from(SIZE.0)) && inside(y * f64::from(SIZE.1))) {
                continue;
            }
            let (at_x, at_y) = View::pixel_centre(SIZE, column, row);
            if seen.try_ray(at_x, at_y).is_none() {
                // The pixel is on a fisheye's rim.
                continue;
            }
            // If a ray comes towards the eye, the surface that it hits faces away from the eye.
            let sight = surface - seen.vp;
            let is_along = sight.cross(ray.direction).length() <= 0.1 * sight.length();
            if kind.has_eye() && is_along && sight.dot(ray.direction) < 0.0 {
                assert_eq!(frame.samples_used, 0, "{kind:?}");
                continue;
            }
            assert_eq!(frame.samples_used, 1, "{kind:?}");
            assert_eq!(frame.picture.get(column, row), Some([0.25, 0.5, 1.0]), "{kind:?}");
            let depth = f64::from(frame.depth[(row * SIZE.0 + column) as usize]);
            assert!((depth / distance - 1.0).abs() < 0.02, "{kind:?} {depth} {distance}");
            // The render cache puts the sample there too.
            let stages =
                Stages { prefilter: false, interpolation: false, depth_cull: false, ..Stages::ALL };
            let params = PointImageParams { stages, ..PointImageParams::default() };
            let mut cache = PointImage::new(SIZE, params).unwrap();
            let points = [RayResult::new(Place::At(surface), [0.25, 0.5, 1.0])];
            let made =
                cache.frame(&Moment { view: seen, predicted: None, samples: &points, wanted: 0 });
            let has_point: Vec<usize> = (0..)
                .zip(made.depth())
                .filter(|(_, depth)| *depth > 0.0)
                .map(|(at, _)| at)
                .collect();
            assert_eq!(has_point, [(row * SIZE.0 + column) as usize], "{kind:?}");
            if kind != ViewKind::Perspective {
                let depth = f64::from(made.depth().find(|&depth| depth > 0.0).unwrap());
                assert!((depth / distance - 1.0).abs() < 1e-5, "{kind:?} {depth} {distance}");
            }
            shown += 1;
        }
        assert!(shown > 100, "{kind:?} {shown}");
        // Panoramas look back, other views do not.
        println!("{kind:?}: {shown} seen, {behind} not");
    }
}

#[test]
fn the_view_s_own_samples_make_the_picture_of_its_rays() {
    let section = room_section(16);
    for kind in ViewKind::ALL {
        let seen = view_of(kind);
        let stored = near_samples(room, &section, &seen, 40 * (SIZE.0 * SIZE.1) as usize, 3, clean);
        let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
        let mut expected = truth(
            |eye, along| if along == DVec3::ZERO { ([0.0; 3], 0.0) } else { room(eye, along) },
            &seen,
            SIZE,
            8,
        );
        let mut corners = 0;
        for (pixel, x, y) in pixels() {
            if seen.try_ray(x, y).is_none() {
                assert_eq!((frame.picture.pixels[pixel], frame.depth[pixel]), ([0.0; 3], 0.0));
                expected[pixel] = [0.0; 3];
                corners += 1;
            }
        }
        assert_eq!(corners > 0, matches!(kind, ViewKind::Angular | ViewKind::Hemispherical));
        let quality = -10.0 * relative_error(&frame, &expected).log10();
        println!("{kind:?}: {quality:.1} dB, {corners} pixels without rays");
        assert!(quality > 25.0, "{kind:?}: {quality}");
    }
}

#[test]
fn rays_that_hit_nothing_show_the_sky_in_every_view() {
    fn sky(_: DVec3, direction: DVec3) -> ([f32; 3], f64) {
        ([0.5 + 0.4 * direction.y as f32, 0.5, 0.5 + 0.4 * direction.z as f32], f64::INFINITY)
    }
    let section = room_section(24);
    for kind in ViewKind::ALL {
        let seen = view_of(kind);
        let stored = batch_samples(sky, &section, &seen, SIZE, 100_000, 1, clean);
        let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
        for (pixel, x, y) in pixels() {
            let Some((_, along)) = seen.try_ray(x, y) else { continue };
            assert!(frame.depth[pixel].is_infinite(), "{kind:?}");
            let (wanted, _) = sky(DVec3::ZERO, along);
            let off = (0..3)
                .map(|i| (frame.picture.pixels[pixel][i] - wanted[i]).abs())
                .fold(0.0, f32::max);
            // A pixel of the widest view is 7° wide at its rim. Cells of a 24³ grid spread a
            // parallel view's rays as far.
            assert!(off < 0.4 * 0.14, "{kind:?}: {off}");
        }
    }
}

/// Returns the walls of a room around the section, each in its own colour.
fn walls() -> (Arc<Raycaster>, Vec<[f32; 3]>) {
    let colours: Vec<[f32; 3]> =
        (1..=6).map(|i| [0.1 * i as f32, 0.9 - 0.1 * i as f32, 0.3]).collect();
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    for side in 0..6_u32 {
        let axis = side as usize / 2;
        let first = positions.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let mut at = DVec3::ZERO;
            at[axis] = f64::from(side % 2);
            at[(axis + 1) % 3] = u;
            at[(axis + 2) % 3] = v;
            positions.push(at * ROOM);
        }
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        ids.extend([side; 2]);
    }
    let material =
        |&kd: &[f32; 3]| Material { bsdf: Bsdf::Diffuse { kd }, ..Material::grey("wall") };
    let materials = colours.iter().map(material).collect();
    let (scene, _) =
        Geometry::from_world(&positions, &triangles, &ids, materials, [7.0; 3]).unwrap();
    (Arc::new(Raycaster::build(Arc::new(scene)).unwrap()), colours)
}

/// Returns a driver that keeps light on surfaces and shows this view.
fn surfaces(section: &Section, raycaster: &Arc<Raycaster>, view: View) -> TestViewer {
    let sections = Arc::from([section.clone()]);
    let mut driver = TestViewer::new(surfaces_driver(sections, Arc::clone(raycaster), None));
    driver.look(&FrameRequest { view, size: SIZE, is_moving: false }).unwrap();
    driver
}

/// Returns the wall that a ray from inside the room hits, and the distance.
fn wall_seen(origin: DVec3, along: DVec3) -> (usize, f64) {
    let walls = (0..3).filter(|&axis| along[axis] != 0.0).map(|axis| {
        let ahead = along[axis] > 0.0;
        let at = if ahead { ROOM[axis] } else { 0.0 };
        (2 * axis + usize::from(ahead), (at - origin[axis]) / along[axis])
    });
    walls.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

#[test]
fn surfaces_shows_every_type_with_true_edges() {
    let (raycaster, colours) = walls();
    let section = room_section(8);
    for kind in ViewKind::ALL {
        let seen = view_of(kind);
        let mut driver = surfaces(&section, &raycaster, seen);
        // Light is 1 everywhere, so the picture shows the albedo. Few samples, from anywhere in the
        // section.
        let mut random = Random(4);
        for _ in 0..3000 {
            let beam = holo_section::BeamId(random.bits() % section.beam_count());
            let coords = holo_section::RayCoords((random.bits() as u32).to_le_bytes());
            let ray = section.ray(section.cells(beam).unwrap(), coords);
            let (wall, distance) = wall_seen(ray.origin, ray.direction);
            driver.insert(
                BeamKey { section: 0, beam },
                1,
                &[Sample::encode(coords, colours[wall], distance, section.diagonal(), 0)],
            );
        }
        let drawn = driver.draw();
        let mut compared = 0;
        for (pixel, x, y) in pixels() {
            let (colour, depth) = (drawn.picture.pixels[pixel], drawn.depth[pixel]);
            let Some((origin, along)) = seen.try_ray(x, y) else {
                assert_eq!((colour, depth), ([0.0; 3], 0.0), "{kind:?}");
                continue;
            };
            let (wall, distance) = wall_seen(origin, along);
            assert!(
                (f64::from(depth) / distance - 1.0).abs() < 1e-4,
                "{kind:?}: {depth} for {distance}"
            );
            // Pixels at edges are means, and are skipped.
            let (right, down) = (1.5 / f64::from(SIZE.0), 1.5 / f64::from(SIZE.1));
            let around = [
                (-right, -down),
                (right, -down),
                (-right, down),
                (right, down),
                (0.0, down),
                (right, 0.0),
            ];
            let is_inner = around.iter().all(|(dx, dy)| {
                seen.try_ray(x + dx, y + dy)
                    .is_some_and(|(origin, along)| wall_seen(origin, along).0 == wall)
            });
            if is_inner {
                // RGBE's error is at most 0.4 % of the largest channel.
                let off = (0..3).map(|i| (colour[i] - colours[wall][i]).abs()).fold(0.0, f32::max);
                assert!(off < 0.012, "{kind:?}: {colour:?} for {:?}", colours[wall]);
                compared += 1;
            }
        }
        assert!(compared > SIZE.0 * SIZE.1 / 3, "{kind:?}: {compared}");
    }
}

#[test]
fn a_view_of_any_type_wants_the_beams_of_its_rays() {
    let section = room_section(12);
    for kind in ViewKind::ALL {
        let seen = view_of(kind);
        // Enough pixels that each beam of a panorama covers some.
        let size = (4 * SIZE.0, 4 * SIZE.1);
        let selection =
            select_beams(std::slice::from_ref(&section), &seen, size, &SelectOptions::default());
        let (mut rays, mut found, mut seeing) = (0, 0, 0);
        for (_, x, y) in pixels() {
            let Some((origin, along)) = seen.try_ray(x, y) else { continue };
            seeing += 1;
            let Some(hit) = section.line(origin, along) else { continue };
            rays += 1;
            found += usize::from(
                selection.beams.iter().any(|wanted| wanted.key.beam == section.beam(hit.pair)),
            );
        }
        // The selection's rays miss only few cells, those that the picture just touches.
        assert!(f64::from(found as u32) >= 0.95 * f64::from(rays), "{kind:?}: {found} of {rays}");
        // Coverage counts a fisheye's corners as not covered, and uses jittered rays instead of
        // pixel centres.
        let middles = f64::from(rays) / f64::from(SIZE.0 * SIZE.1);
        assert!((selection.covered.fraction() - middles).abs() < 0.03, "{kind:?} {seeing}");
    }
}

#[test]
fn rays_asked_for_go_along_with_a_parallel_view() {
    // A sheared section with different cells along every axis.
    let section = Section::new(holo_section::SectionSpec {
        origin: [100.0, -3.0, 5.0],
        axes: [[4.0, 0.5, 0.0], [-0.3, 3.0, 0.2], [0.1, 0.0, 2.0]],
        grid: [6, 5, 7],
        class: ViewClass::Interior,
        obstructions: true,
    })
    .unwrap();
    let spec = ViewSpec { kind: Some(ViewKind::Parallel), vh: Some(2.0), ..ViewSpec::default() };
    let middle = section.local_to_world(DVec3::splat(0.5));
    let spec = ViewSpec { vp: Some(middle), vd: Some(DVec3::new(0.8, 0.5, 0.2)), ..spec };
    let seen = spec.resolve(SIZE).unwrap().0;
    let corners = (0..8).map(|corner| {
        DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2))
    });
    let reach = corners.map(|at| section.local_to_world(at).distance(middle)).fold(0.0, f64::max);
    let sections = [section];
    let selection = select_beams(&sections, &seen, SIZE, &SelectOptions::default());
    for radius in [0.001, 0.2] {
        let eye = viewpoint(&sections, &seen, radius);
        let (mut limited, mut all, mut worst) = (0, 0, 0.0_f64);
        for wanted in &selection.beams {
            let sampler = sections[0].beam_sampler(0, wanted.key.beam, Some(&eye)).unwrap();
            all += 1;
            limited += usize::from(sampler.is_limited());
            for number in (0..21).filter(|_| sampler.is_limited()) {
                let ray = sampler.ray(sampler.coords(number));
                // Each end of a ray is rounded by half a step in both directions. The ray is at
                // most as long as the shortest side.
                let step = 4.1 / 6.0 / 256.0;
                let rounding = 2.0_f64.sqrt() * step / ray.length.min(2.0);
                let apart = ray.direction.cross(seen.vd).length();
                worst = worst.max(apart / (radius / reach).max(rounding));
                assert!(ray.direction.dot(seen.vd) > 0.0);
            }
        }
        println!("{limited} of {all} beams limited, at most {worst:.2} of what is allowed");
        assert!(limited * 20 >= all * 19, "{limited} of {all}");
        assert!(worst <= 1.0 + 1e-5, "{worst}");
    }
}

#[test]
fn surfaces_ignores_what_is_before_the_fore_surface_and_beyond_the_aft_surface() {
    let (raycaster, _) = walls();
    let section = room_section(8);
    let (fore, aft) = (5.0, 7.4);
    for kind in ViewKind::ALL {
        let plain = view_of(kind);
        let words =
            |clips: &str| View::parse_vf(&format!("{} {clips}", plain.to_vf_options())).unwrap();
        let seen_by = |clips: &str| words(clips).resolve(SIZE).unwrap().0;
        let (clipped, near_only) = (seen_by("-vo 5 -va 7.4"), seen_by("-vo 5"));
        let drawn = |view: View| surfaces(&section, &raycaster, view).draw();
        let (frame, open) = (drawn(clipped), drawn(near_only));
        let mut count = [0; 3];
        for (pixel, x, y) in pixels() {
            let Some((origin, along)) = plain.try_ray(x, y) else { continue };
            let (_, distance) = wall_seen(origin, along);
            let to = along * distance;
            let depth = match kind {
                ViewKind::Perspective | ViewKind::Parallel => to.dot(plain.vd),
                ViewKind::Cylindrical => (to - plain.up() * to.dot(plain.up())).length(),
                _ => distance,
            };
            let from_plane = if kind == ViewKind::Parallel { fore } else { 0.0 };
            let (shown, far) = (f64::from(frame.depth[pixel]), f64::from(open.depth[pixel]));
            // There is nothing behind the room's walls.
            if depth < fore {
                assert!(shown == f64::INFINITY && far == f64::INFINITY, "{kind:?}");
                count[0] += 1;
            } else {
                assert!(
                    (far / (distance - from_plane) - 1.0).abs() < 1e-4,
                    "{kind:?}: {far} for {distance}"
                );
                if depth > aft {
                    assert_eq!(shown, f64::INFINITY, "{kind:?}");
                    count[2] += 1;
                } else {
                    assert_eq!(shown, far, "{kind:?}");
                    count[1] += 1;
                }
            }
            // Pixels at edges are means, and are skipped.
            let (width, at) = (SIZE.0 as usize, |pixel: usize| f64::from(frame.depth[pixel]));
            let is_in = pixel % width > 0
                && pixel % width + 1 < width
                && pixel > width
                && pixel + width + 1 < frame.depth.len();
            let around = [0, width, 2 * width].into_iter().flat_map(|row| row..row + 3);
            if is_in
                && around.into_iter().all(|offset| at(pixel + offset - width - 1) == f64::INFINITY)
            {
                assert_eq!(frame.picture.pixels[pixel], [0.0; 3], "{kind:?}");
                if far == f64::INFINITY && depth < fore {
                    assert!(
                        open.picture.pixels[pixel].iter().all(|&channel| channel > 0.0),
                        "{kind:?}: the sky"
                    );
                }
            }
        }
        println!("{kind:?}: {count:?} before, between and beyond");
        assert!(count[0] + count[1] + count[2] > 3000 && count[1] > 100, "{kind:?} {count:?}");
        assert!(kind == ViewKind::Parallel || count[0] > 50 && count[2] > 50, "{kind:?} {count:?}");
    }
}
