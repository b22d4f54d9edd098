use holo_display::DriverPart;
use holo_picture::Exposure;
use holo_section::{SectionSpec, ViewClass};
use holo_stage::{Named, ObjectOrder, commands};

use super::{
    super::tests::{seen, view},
    *,
};
use crate::hand::{Drag, PointerTarget};

const SIZE: (u32, u32) = (1280, 720);

fn model() -> WindowModel {
    let mut model = WindowModel::new(Look::default(), SIZE, 1.0);
    model.set_seen(Arc::new(seen((640, 360), [0.5; 3], &Look::default())));
    model.take_stale();
    model
}

/// A model that knows a section and a named view.
fn furnished() -> WindowModel {
    let mut model = model();
    let axes = [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    let (grid, class) = ([2; 3], ViewClass::Interior);
    let section = SectionSpec { origin: [-2.0, -2.0, -2.0], axes, grid, class, obstructions: true };
    let views = vec![("door".to_owned(), "-vp 1 2 3 -vd 0 1 0".to_owned())];
    let state = State {
        sections: Arc::new(vec![section]),
        views: Arc::new(views),
        up: [0.0, 0.0, 1.0],
        ..State::default()
    };
    model.set_state(Arc::new(state));
    model
}

fn press(model: &mut WindowModel, name: &str, sign: &str) -> Vec<Effect> {
    model.press(name, sign, false, Instant::now())
}

#[test]
fn held_keys_move_until_they_are_up_or_the_keyboard_is_lost() {
    let mut model = model();
    let ahead = Controls { ahead: 1.0, ..Controls::default() };
    assert_eq!(press(&mut model, "KeyW", "w"), [Effect::Send(Input::Hold(ahead))]);
    // A key that repeats counts as held.
    assert_eq!(model.press("KeyW", "w", true, Instant::now()), []);
    let still = [Effect::Send(Input::Hold(Controls::default()))];
    assert_eq!(model.release("KeyW"), still);
    press(&mut model, "KeyW", "w");
    assert_eq!(model.lose_focus(), still);
    assert_eq!(model.lose_focus(), []);
}

#[test]
fn a_key_that_repeats_acts_once_except_for_brightness() {
    let mut model = model();
    let now = Instant::now();
    assert_eq!(model.press("KeyH", "h", true, now), []);
    assert_eq!(press(&mut model, "KeyH", "h"), [Effect::Send(Input::Home)]);
    let brighter = model.press("BracketRight", "+", true, now);
    let Exposure::Stops(stops) = model.display.look().exposure else { panic!("{brighter:?}") };
    assert_eq!((brighter.len(), stops), (1, 0.5));
}

#[test]
fn nothing_is_drawn_again_without_a_reason() {
    let mut model = model();
    assert!(!model.take_stale());
    model.move_to((3.0, 4.0));
    model.set_state(Arc::default());
    model.set_seen(model.seen.clone().unwrap());
    assert!(!model.take_stale(), "a moving cursor, and news that are none");
    press(&mut model, "KeyV", "v");
    assert!(model.take_stale() && !model.take_stale());
    model.move_to((5.0, 4.0));
    assert!(model.take_stale(), "the panel says what is under the cursor");
    let now = Instant::now();
    model.presented(now);
    assert_eq!(model.next_change(), None, "a frame at rest needs no other one");
}

#[test]
fn a_new_size_is_asked_for_once_it_has_stayed_for_a_while() {
    let mut model = model();
    let now = Instant::now();
    for step in 1..=10 {
        let at = now + step * Duration::from_millis(20);
        model.resize((1280 + step, 720), 1.0, at);
        assert_eq!(model.wake(at), []);
    }
    let end = model.next_change().unwrap();
    assert_eq!(end, now + Duration::from_millis(200) + RESIZING);
    assert_eq!(model.wake(end), [Effect::Send(Input::Size(1290, 720))]);
    assert_eq!(model.next_change(), None);
    // A very fine screen gets fewer pixels in the same proportions.
    model.resize((7680, 4320), 3.0, now);
    let Input::Size(width, height) = model.wanted_size() else { panic!("no size") };
    assert!(f64::from(width * height) < 1.01 * MOST_PIXELS);
    assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 1e-2);
}

#[test]
fn notices_go_by_themselves_and_escape_closes_what_is_open_first() {
    let mut model = model();
    let now = Instant::now();
    model.tell("Saved", now);
    assert_eq!(model.notice(now), Some("Saved"));
    assert_eq!(model.next_change(), Some(now + NOTICE));
    model.wake(now + NOTICE);
    assert_eq!(model.notice(now + NOTICE), None);
    press(&mut model, "KeyZ", "z");
    press(&mut model, "Minus", "?");
    assert!(model.modes.has_help);
    assert_eq!(press(&mut model, "Escape", ""), []);
    assert!(!model.modes.has_help && model.modes.is_full);
    assert_eq!(press(&mut model, "Escape", ""), [Effect::FullScreen(false)]);
    assert_eq!(press(&mut model, "Escape", ""), [Effect::Send(Input::Cancel)]);
}

#[test]
fn a_session_that_fails_says_why_until_the_window_is_closed() {
    let mut model = model();
    assert_eq!(model.end(Some("lost the server.".to_owned())), []);
    let later = Instant::now() + Duration::from_secs(1000);
    assert!(model.notice(later).unwrap().starts_with("lost the server."));
    assert_eq!(press(&mut model, "Escape", ""), [Effect::Leave]);
    assert_eq!(WindowModel::new(Look::default(), SIZE, 1.0).end(None), [Effect::Leave]);
}

#[test]
fn the_panel_takes_clicks_on_the_plan_and_on_views() {
    let mut model = furnished();
    let layout = model.panel();
    let middle = |rect: &Rect| rect.at((0.5, 0.5));
    model.move_to(middle(&layout.plan));
    assert_eq!(model.button(Drag::Turn), [], "without a panel it is a drag");
    model.button_up(Drag::Turn);
    press(&mut model, "KeyV", "v");
    let effects = model.button(Drag::Turn);
    let [Effect::Send(Input::GoTo(eye))] = effects[..] else { panic!("{effects:?}") };
    assert!(eye.length() < 0.1, "the plan's middle is the section's: {eye}");
    assert!(!model.is_dragging());
    model.move_to(middle(&layout.views[0]));
    let effects = model.button(Drag::Turn);
    assert_eq!(effects, [Effect::Send(Input::Recall(Named::Number(1)))]);
    // Keys go to the same views.
    assert_eq!(press(&mut model, "Digit1", "1"), effects);
    // Parts of the driver's method are switched off and on again.
    let mut clicks = |is_on| {
        let part = DriverPart { name: "dither", meaning: "worst pixels ask first", is_on };
        let parts = Arc::new(vec![part]);
        model.state = Arc::new(State { parts, ..(*model.state).clone() });
        model.move_to(middle(&model.panel().parts[0]));
        model.button(Drag::Turn)
    };
    for is_on in [true, false] {
        let switch = Input::Switch(vec!["dither".to_owned()], !is_on);
        assert_eq!(clicks(is_on), [Effect::Send(switch)]);
    }
}

#[test]
fn looking_without_a_button_moves_the_eye_wherever_the_cursor_is() {
    let mut model = model();
    assert_eq!(model.move_by(10.0, 0.0), []);
    assert_eq!(press(&mut model, "KeyM", "m"), [Effect::Grab(true)]);
    assert_eq!(model.move_to((3.0, 4.0)), []);
    let moved = model.move_by(10.0, 0.0);
    assert!(matches!(moved[..], [Effect::Send(Input::Turn(right, _))] if right > 0.0));
    assert_eq!(press(&mut model, "Escape", ""), [Effect::Grab(false)]);
    press(&mut model, "KeyM", "m");
    assert_eq!(model.lose_focus(), [Effect::Grab(false)]);
}

#[test]
fn the_cursor_is_where_it_is_in_the_picture() {
    let mut model = model();
    model.resize((1480, 720), 1.0, Instant::now());
    assert_eq!(model.picture(), Rect { x: 100, y: 0, width: 1280, height: 720 });
    model.move_to((740.0, 180.0));
    assert_eq!(model.cursor(), Some((0.5, 0.25)));
    model.move_to((50.0, 180.0));
    assert_eq!(model.cursor(), None);
    let angles = PointerTarget::new(model.picture(), Some(&view((16, 9)))).angles;
    assert!((angles.0 - 60_f64.to_radians()).abs() < 1e-9, "{angles:?}");
}

#[test]
fn keys_and_the_table_of_actions_agree() {
    let mut model = furnished();
    for action in commands::ACTIONS {
        for key in action.keys {
            let mut own = furnished();
            let effects = press(&mut own, key, key);
            let acts = !effects.is_empty() || own.take_stale();
            // Esc has nothing to close, so it goes to the stage.
            assert!(acts, "{key} does nothing");
        }
    }
    model.set_modifiers(Modifiers { other: true, ..Modifiers::default() });
    assert_eq!(press(&mut model, "KeyH", "h"), [], "that belongs to the desktop");
    model.set_modifiers(Modifiers { ctrl: true, ..Modifiers::default() });
    assert_eq!(press(&mut model, "KeyH", "h"), []);
    assert_eq!(press(&mut model, "KeyQ", "q"), [Effect::Leave]);
}

#[test]
fn ending_is_asked_twice() {
    let mut model = model();
    assert_eq!(press(&mut model, "End", ""), []);
    assert!(model.notice(Instant::now()).unwrap().contains("End the session?"));
    assert_eq!(press(&mut model, "Escape", ""), []);
    assert_eq!(model.notice(Instant::now()), None);
    assert_eq!(press(&mut model, "End", ""), []);
    assert_eq!(press(&mut model, "End", ""), [Effect::Leave]);
}

#[test]
fn a_model_is_dropped_under_the_cursor_or_else_in_the_middle() {
    let mut model = model();
    let dropped = |at| [Effect::Send(Input::Drop("chair.glb".into(), at))];
    model.leave();
    assert_eq!(model.drop_model("chair.glb".into()), dropped([0.5, 0.5]));
    model.move_to((320.0, 180.0));
    assert_eq!(model.drop_model("chair.glb".into()), dropped([0.25, 0.25]));
}

#[test]
fn an_object_is_moved_and_turned_with_shift() {
    let object = |order| [Effect::Send(Input::Object(order))];
    let mut model = model();
    model.move_to((320.0, 180.0));
    model.set_modifiers(Modifiers { shift: true, ..Modifiers::default() });
    assert_eq!(model.button(Drag::Turn), object(ObjectOrder::Grab([0.25, 0.25])));
    assert_eq!(model.move_to((640.0, 360.0)), object(ObjectOrder::DragTo([0.5, 0.5])));
    assert_eq!(model.button_up(Drag::Turn), []);
    assert_eq!(model.wheel(-1.0), object(ObjectOrder::Spin([0.5, 0.5], 15.0)));
    model.set_modifiers(Modifiers::default());
    assert_ne!(model.move_to((320.0, 180.0)), object(ObjectOrder::DragTo([0.25, 0.25])));
}

#[test]
fn a_rectangle_that_is_dragged_out_with_ctrl_is_traced_first() {
    let mut model = model();
    model.move_to((320.0, 180.0));
    model.set_modifiers(Modifiers { ctrl: true, ..Modifiers::default() });
    assert_eq!(model.button(Drag::Turn), []);
    model.take_stale();
    assert_eq!(model.move_to((640.0, 360.0)), []);
    assert_eq!(model.focus(), Some([0.25, 0.25, 0.5, 0.5]));
    assert!(model.take_stale());
    let focus = [Effect::Send(Input::Focus(Some([0.25, 0.25, 0.5, 0.5])))];
    assert_eq!(model.button_up(Drag::Turn), focus);
    assert_eq!(model.focus(), None);
    let part = Some([0.1, 0.2, 0.3, 0.4]);
    model.set_state(Arc::new(State { focus: part, ..State::default() }));
    assert_eq!(model.focus(), part, "the stage traces it first");
}
