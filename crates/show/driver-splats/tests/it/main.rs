//! Tests of the driver `splats`: what views of a room made of splats show.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_display::{Driver, Frame, FramePhase, FrameRequest, Interrupt};
use holo_driver_splats::{SplatShape, splats_driver};
use holo_picture::{View, ViewSpec};
use holo_splats::{CHUNK_BYTES, Origin, SplatFile, SplatTree, Surfel};

const SIZE: (u32, u32) = (160, 120);
const SPACING: f32 = 0.03;

/// The light of each wall of the room: -x, +x, -y, +y, floor, ceiling.
const WALLS: [f32; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 0.5];

/// A cube from -1 to 1 that is seen from inside.
fn room() -> Vec<Surfel> {
    let side = (2.0 / SPACING) as i32;
    let mut surfels = Vec::new();
    for (wall, light) in WALLS.iter().enumerate() {
        let axis = wall / 2;
        let sign = if wall % 2 == 0 { 1.0 } else { -1.0 };
        for at in 0..side * side {
            let place = |number: i32| (number as f32 + 0.5) * SPACING - 1.0;
            let mut position = Vec3::ZERO;
            position[axis] = -sign;
            position[(axis + 1) % 3] = place(at % side);
            position[(axis + 2) % 3] = place(at / side);
            let mut normal = Vec3::ZERO;
            normal[axis] = sign;
            surfels.push(Surfel {
                position,
                normal,
                radius: 0.85 * SPACING,
                light: [*light; 3],
                colour: [1.0; 3],
                error: 0.1,
                is_directional: false,
            });
        }
    }
    surfels
}

fn bytes(surfels: Vec<Surfel>) -> Vec<u8> {
    let origin = Origin {
        origin: DVec3::new(100.0, 0.0, 0.0),
        spacing: f64::from(SPACING),
        unit: 1.0,
        up: [0.0, 0.0, 1.0],
        sky: [3.0; 3],
        samples: 1_000_000,
        generation: 0,
        scene: [0; 32],
    };
    SplatTree::new(surfels, SPACING).unwrap().to_bytes(&origin)
}

fn driver(surfels: Vec<Surfel>, shape: SplatShape) -> Driver {
    splats_driver(Some(Arc::new(SplatFile::from_bytes(bytes(surfels)).unwrap())), shape)
}

fn look(options: &str, is_moving: bool) -> FrameRequest {
    let mut spec = ViewSpec::default();
    spec.apply_line(options).unwrap();
    let (view, size) = spec.resolve(SIZE).unwrap();
    FrameRequest { view, size, is_moving }
}

fn draw(driver: &mut Driver, look: &FrameRequest) -> Frame {
    driver.renderer.look(look).unwrap();
    let phase = if look.is_moving { FramePhase::Moving } else { FramePhase::Rest };
    driver.renderer.draw(phase, &Interrupt::default(), &mut |_| {}).unwrap()
}

/// Returns the number of the pixel in the middle.
fn middle(look: &FrameRequest) -> usize {
    (look.size.1 / 2 * look.size.0 + look.size.0 / 2) as usize
}

/// Calls `check` with each pixel's ray, radiance and distance, and the wall that the ray meets.
fn for_pixels(
    frame: &Frame,
    look: &FrameRequest,
    mut check: impl FnMut(usize, f64, [f32; 3], f32),
) {
    for at in 0..frame.depth.len() {
        let (column, row) = (at as u32 % look.size.0, at as u32 / look.size.0);
        let (x, y) = View::pixel_centre(look.size, column, row);
        let Some((origin, direction)) = look.view.try_ray(x, y) else { continue };
        let origin = origin - DVec3::new(100.0, 0.0, 0.0);
        // From inside, the ray leaves by the nearest wall ahead.
        let exits = (0..6).map(|wall| {
            let (axis, side) = (wall / 2, if wall % 2 == 0 { -1.0 } else { 1.0 });
            let distance = (side - origin[axis]) / direction[axis];
            (wall, if distance > 0.0 { distance } else { f64::INFINITY })
        });
        let mut exits: Vec<_> = exits.collect();
        exits.sort_by(|a, b| a.1.total_cmp(&b.1));
        // At edges, discs of both walls show.
        if exits[1].1 - exits[0].1 > 0.12 {
            check(exits[0].0, exits[0].1, frame.picture.pixels[at], frame.depth[at]);
        }
    }
}

#[test]
fn every_shape_and_type_of_view_shows_each_wall_at_its_distance() {
    let views = [
        "-vtv -vp 100.2 -0.3 0.1 -vd 0.7 0.6 -0.3 -vu 0 0 1 -vh 70",
        "-vtv -vp 100 0 0 -vd -1 -0.9 0.2 -vu 0 0 1 -vh 110 -vv 90",
        "-vtl -vp 100 0 0 -vd 1 0 0 -vu 0 0 1 -vh 1.5 -vv 1.2",
        "-vth -vp 100 0.2 0 -vd 0 1 0 -vu 0 0 1 -vh 170 -vv 170",
        "-vta -vp 100 0.2 0 -vd 0 1 0 -vu 0 0 1 -vh 200 -vv 200",
        "-vtc -vp 100 0.2 0 -vd 0 1 0 -vu 0 0 1 -vh 300 -vv 80",
    ];
    for shape in [SplatShape::Square, SplatShape::Circle, SplatShape::Ellipse, SplatShape::Fuzzy] {
        let mut driver = driver(room(), shape);
        // Squares and circles face the eye, and stand out of surfaces that do not.
        let (tolerance, least) = match shape {
            SplatShape::Square | SplatShape::Circle => (0.06, 90),
            SplatShape::Ellipse | SplatShape::Fuzzy => (0.02, 98),
        };
        for options in views {
            let look = look(options, false);
            let frame = draw(&mut driver, &look);
            let (mut count, mut good) = (0, 0);
            for_pixels(&frame, &look, |wall, distance, pixel, depth| {
                let is_light = (pixel[0] / WALLS[wall] - 1.0).abs() < 0.01;
                let is_near = (f64::from(depth) - distance).abs() < tolerance * distance;
                count += 1;
                good += usize::from(is_light && is_near);
            });
            assert!(count > 5000, "{options}");
            assert!(good * 100 >= count * least, "{shape:?} {options}: {good} of {count}");
            let middle = middle(&look);
            let error = frame.certainty[middle].error / frame.picture.pixels[middle][0];
            assert!((error - 0.1).abs() < 0.02, "{error}");
        }
    }
}

#[test]
fn motion_stays_within_a_budget_and_rest_has_none() {
    let mut driver = driver(room(), SplatShape::Fuzzy);
    let options = "-vtv -vp 100.9 0.9 0.9 -vd -1 -1 -1 -vu 0 0 1 -vh 100 -vv 90";
    let (moving, rest) = (look(options, true), look(options, false));
    let budget = u64::from(SIZE.0 * SIZE.1) / 4;
    let splats: Vec<u64> = (0..12).map(|_| draw(&mut driver, &moving).samples_used).collect();
    assert!(splats[11] <= budget, "{splats:?}");
    let at_rest = draw(&mut driver, &rest).samples_used;
    assert!(at_rest > 2 * budget, "{at_rest} at rest");
    // What moved before does not change a frame at rest.
    let options = SplatShape::Fuzzy;
    let fresh = draw(&mut self::driver(room(), options), &rest);
    assert!(draw(&mut driver, &rest).picture.pixels == fresh.picture.pixels);
}

#[test]
fn what_faces_away_or_is_clipped_is_not_drawn() {
    let mut driver = driver(room(), SplatShape::Ellipse);
    // From outside, the near wall faces away: the far one is seen through it.
    let outside = look("-vtv -vp 96 0 0 -vd 1 0 0 -vu 0 0 1 -vh 40 -vv 30", false);
    let frame = draw(&mut driver, &outside);
    let middle = middle(&outside);
    assert!((frame.picture.pixels[middle][0] / WALLS[1] - 1.0).abs() < 0.01);
    assert!((frame.depth[middle] - 5.0).abs() < 0.01, "{}", frame.depth[middle]);
    // Beside the cube there is sky.
    assert_eq!((frame.picture.pixels[0], frame.depth[0]), ([3.0; 3], f32::INFINITY));
    let clipped = look("-vtv -vp 96 0 0 -vd 1 0 0 -vu 0 0 1 -vh 40 -vv 30 -va 4.5", false);
    let frame = draw(&mut driver, &clipped);
    assert_eq!(frame.picture.pixels[middle], [0.0; 3]);
}

#[test]
fn without_a_file_and_with_a_damaged_one_views_are_refused_with_the_reason() {
    let rest = look("-vtv -vp 100 0 0 -vd 1 0 0 -vu 0 0 1 -vh 90", false);
    let mut none = splats_driver(None, SplatShape::Fuzzy);
    let error = none.renderer.look(&rest).unwrap_err().to_string();
    assert!(error.contains("holodeck splats"), "{error}");
    let mut damaged = bytes(room());
    let at = damaged.len() - CHUNK_BYTES / 2;
    damaged[at] ^= 1;
    let file = Arc::new(SplatFile::from_bytes(damaged).unwrap());
    let mut driver = splats_driver(Some(file), SplatShape::Fuzzy);
    // What is whole is drawn: spheres above the damaged ones.
    let frame =
        draw(&mut driver, &look("-vth -vp 100 0 0 -vd 1 0 0 -vu 0 0 1 -vh 180 -vv 180", false));
    assert!(frame.picture.pixels.iter().any(|pixel| pixel[0] > 0.0));
    let error = driver.renderer.look(&rest).unwrap_err().to_string();
    assert!(error.contains("damaged"), "{error}");
}
