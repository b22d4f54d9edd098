//! Tests of walls.

use super::*;
use holo_stereo::{Wall, WallScreen, wall_driver};

/// A room without a back: screens on three sides, seen from a place that is not its middle.
const SCREENS: [&str; 3] = ["-1.5,0.5,-1,1.5,1,-90", "-1,1.2,-1,1.5,0.5", "-0.5,1.5,-1,1.5,1.2,90"];

fn wall(screens: &[&str]) -> Wall {
    Wall::new(screens.iter().map(|text| WallScreen::parse(text).unwrap()).collect()).unwrap()
}

fn wide(view: &View, width: u32) -> FrameRequest {
    FrameRequest { size: (width, 40), ..request(view) }
}

#[test]
fn a_screen_shows_each_point_where_the_leader_s_ray_to_it_meets_the_screen() {
    let view = room_view(SIZE);
    // Frames of 90, 91 and 92 columns: the edges of screens are at columns, and between two.
    for width in [90, 91, 92] {
        let requests = wall(&SCREENS).requests(&wide(&view, width)).unwrap();
        let mut first = 0;
        for (at, (request, text)) in requests.iter().zip(SCREENS).enumerate() {
            let WallScreen { edges: [left, right, bottom, top], distance, turn, .. } =
                WallScreen::parse(text).unwrap();
            let (sine, cosine) = turn.to_radians().sin_cos();
            for (x, y) in [(0.2, 0.1), (0.5, 0.5), (0.8, 0.9)] {
                // A point of the screen, then one three times as far away along the ray.
                let across = left + (right - left) * x;
                let up = bottom + (top - bottom) * y;
                let ahead = distance * cosine - across * sine;
                let aside = distance * sine + across * cosine;
                let on_screen = view.vd * ahead + view.right() * aside + view.up() * up;
                let (px, py, _) = request.view.project(view.vp + on_screen * 3.0).unwrap();
                let column = f64::from(first) + px * f64::from(request.size.0);
                let wanted = f64::from(width) * (at as f64 + x) / 3.0;
                assert!((column - wanted).abs() < 1e-6, "{text} {x} {y}: {column} {wanted}");
                assert!((py - y).abs() < 1e-9, "{text} {x} {y}: {py}");
            }
            first += request.size.0;
        }
        assert_eq!(first, width);
    }
}

#[test]
fn a_tilted_screen_is_above_the_eye() {
    let view = room_view(SIZE);
    let look = wide(&view, 40);
    let above = &wall(&["-1,1,-1,1,1,0,90"]).requests(&look).unwrap()[0].view;
    assert!((above.vd - view.up()).length() < 1e-9);
    // Its lower edge is the upper edge of a screen ahead.
    let (x, y, _) = above.project(view.vp + view.vd + view.up()).unwrap();
    assert!((x - 0.5).abs() < 1e-9 && y.abs() < 1e-9, "{x} {y}");
}

#[test]
fn each_screen_s_pixels_are_those_of_its_own_view() {
    let (section, view) = (room_section(8), room_view(SIZE));
    let sections: Arc<[Section]> = Arc::from([section.clone()]);
    let stored = near_samples(room, &section, &view, 20_000, 1, clean);
    let driver = || quadtree_driver(Arc::clone(&sections), [0.0; 3]);
    let look = wide(&view, 91);
    let frame = drawn(wall_driver(driver(), wall(&SCREENS), Arc::clone(&sections)), &look, &stored);
    assert_eq!(frame.picture.size(), look.size);
    assert!(frame.is_stereo, "its pixels are not those of one view");
    let mut first = 0;
    for request in wall(&SCREENS).requests(&look).unwrap() {
        let own = drawn(driver(), &request, &stored);
        for row in 0..40 {
            for column in 0..request.size.0 {
                let of_frame = (row * 91 + first + column) as usize;
                let of_own = (row * request.size.0 + column) as usize;
                assert_eq!(frame.picture.pixels[of_frame], own.picture.pixels[of_own]);
                assert_eq!(frame.depth[of_frame], own.depth[of_own]);
            }
        }
        first += request.size.0;
    }
}

#[test]
fn a_frame_with_fewer_columns_than_screens_is_refused() {
    let error = wall(&SCREENS).requests(&wide(&room_view(SIZE), 1)).unwrap_err();
    assert!(error.to_string().contains("too few"), "{error}");
    assert!(Wall::new(Vec::new()).unwrap_err().contains("1 to 8"));
    let nine = vec![WallScreen::parse(SCREENS[0]).unwrap(); 9];
    assert!(Wall::new(nine).unwrap_err().contains("not 9"));
}
