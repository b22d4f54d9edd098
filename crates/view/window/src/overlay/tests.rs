use std::sync::Arc;

use holo_picture::Look;
use holo_stage::State;

use super::{super::tests::seen, *};

const SIZE: (u32, u32) = (960, 540);

fn model(look: &Look) -> WindowModel {
    let mut model = WindowModel::new(*look, SIZE, 1.0);
    model.set_seen(Arc::new(seen(SIZE, [0.5; 3], look)));
    model.set_state(Arc::new(State {
        phase: StagePhase::Running,
        traces: true,
        workers: Some(1),
        ..State::default()
    }));
    model
}

/// Returns the window's pixels.
fn drawn(model: &WindowModel) -> Vec<u32> {
    let mut pixels = vec![0; (SIZE.0 * SIZE.1) as usize];
    draw(&mut Canvas::new(&mut pixels, SIZE).unwrap(), model, Instant::now());
    pixels
}

/// Returns the share of pixels that differ.
fn change(before: &[u32], after: &[u32]) -> f64 {
    let differ = before.iter().zip(after).filter(|(a, b)| a != b).count();
    differ as f64 / before.len() as f64
}

#[test]
fn bare_shows_the_picture_and_nothing_else() {
    let mut model = model(&Look::default());
    let rgb = &model.seen.as_ref().unwrap().image.rgb;
    let picture: Vec<u32> =
        rgb.chunks(3).map(|rgb| u32::from_be_bytes([0, rgb[0], rgb[1], rgb[2]])).collect();
    assert!(change(&picture, &drawn(&model)) > 0.0, "the status line and a welcome");
    model.modes.is_bare = true;
    assert_eq!(change(&picture, &drawn(&model)), 0.0);
    // The panel is hidden too. Notices are still shown.
    model.modes.has_panel = true;
    assert_eq!(change(&picture, &drawn(&model)), 0.0);
    model.tell("Saved", Instant::now());
    assert!(change(&picture, &drawn(&model)) > 0.0);
}

#[test]
fn everything_that_can_be_shown_is_seen() {
    let plain = drawn(&model(&Look::default()));
    let mut help = model(&Look::default());
    help.modes.has_help = true;
    assert!(change(&plain, &drawn(&help)) > 0.9, "the picture is dimmed behind the keys");
    let mut panel = model(&Look::default());
    panel.modes.has_panel = true;
    assert!(change(&plain, &drawn(&panel)) > 0.1);
    let mut acted = model(&Look::default());
    acted.has_acted = true;
    assert!(change(&plain, &drawn(&acted)) > 0.0, "the welcome has gone");
    let mut light = model(&Look::default());
    light.modes.is_light = true;
    assert!(change(&plain, &drawn(&light)) > 0.0);
    let trouble = State { trouble: Some("no".into()), ..State::clone(&acted.state) };
    let before = drawn(&acted);
    acted.set_state(Arc::new(trouble));
    assert!(change(&before, &drawn(&acted)) > 0.0);
}

#[test]
fn a_legend_has_the_colours_from_its_high_end_down() {
    let look = Look { false_color: true, ..Look::default() };
    let model = model(&look);
    let legend = model.seen.as_ref().unwrap().image.legend.clone().unwrap();
    let pixels = drawn(&model);
    let packed = |[red, green, blue]: Color| u32::from_be_bytes([0, red, green, blue]);
    let column = |color: Color| {
        let at = pixels.iter().position(|&pixel| pixel == packed(color)).unwrap();
        (at / SIZE.0 as usize, at % SIZE.0 as usize)
    };
    let (top, left) = column(legend.color(0.998));
    let (bottom, same) = column(legend.color(0.002));
    assert!(top < bottom && left == same && left < 100, "{top} {bottom} {left} {same}");
}

#[test]
fn it_draws_in_windows_of_any_size() {
    let mut model = model(&Look { contours: true, ..Look::default() });
    (model.modes.has_panel, model.modes.has_help) = (true, true);
    let state = State { is_uncovered: true, trouble: Some("far ".repeat(50)), ..State::default() };
    model.set_state(Arc::new(state));
    model.modes.grids = Grids::Always;
    for (width, height) in [(1, 1), (3, 900), (900, 3), (200, 100), (1921, 1081)] {
        for scale in [0.5, 1.0, 3.7] {
            (model.size, model.scale) = ((width, height), scale);
            let mut pixels = vec![0; (width * height) as usize];
            let mut canvas = Canvas::new(&mut pixels, (width, height)).unwrap();
            draw(&mut canvas, &model, Instant::now());
        }
    }
}
