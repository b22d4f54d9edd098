//! Models that a person carries into a scene on a page, and that a replay shows again.

use std::time::Duration;

use holo_picture::{Picture, luminance};
use holo_tests::{CORNELL_SMALL_SECTION, Chromium, Modifier, Place, wait_until};
use serde_json::Value;

const VIEW: [&str; 6] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60"];

/// A cube of side 1 whose base is at height 0. The scene's up axis is y.
const CUBE: &str = "\
v -0.5 0 -0.5\nv 0.5 0 -0.5\nv 0.5 0 0.5\nv -0.5 0 0.5
v -0.5 1 -0.5\nv 0.5 1 -0.5\nv 0.5 1 0.5\nv -0.5 1 0.5
f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1
";

/// Returns where the only object beside a file is, and its turn, once `is_there` holds for them.
fn kept(place: &Place, is_there: impl Fn([f64; 3], f64) -> bool) -> ([f64; 3], f64) {
    wait_until("the object to be kept", || {
        let list = std::fs::read(place.path("a.objects/objects.json")).ok()?;
        let list: Value = serde_json::from_slice(&list).unwrap();
        let at: [f64; 3] = serde_json::from_value(list[0]["at"].clone()).ok()?;
        let turn = list[0]["turn"].as_f64()?;
        is_there(at, turn).then_some((at, turn))
    })
}

#[test]
fn an_object_is_carried_moved_and_turned_on_a_page_and_a_replay_shows_it() {
    let place = Place::new();
    place.write("cube.obj", CUBE);
    place.write("empty.obj", "# nothing\n");
    let words = ["view", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
    let options = ["--keep", "{}/a.holo", "--threads", "1", "--bounces", "0", "--no-open"];
    let mut session = place.start(&[&words[..], &options, &VIEW].concat());
    let address = format!("http:{}", session.wait_for_line("http:"));
    let browser = &mut Chromium::open(&address);
    browser.wait("state && state.view_samples > 20000");

    let cube = place.text("cube.obj");
    session.write_line(&format!("object add {cube} at 2.78 1.7 1 as the cube"));
    let (at, turn) = kept(&place, |_, _| true);
    assert_eq!((at, turn), ([2.78, 1.7, 1.0], 0.0));
    // Further passes of the object are drawn.
    let frame = browser.value("Number(document.body.dataset.frame)").as_f64().unwrap();
    browser.wait(&format!("Number(document.body.dataset.frame) > {}", frame + 2.0));

    // It follows the pointer along the plane of its base: the point below the pointer is 5.8 away,
    // where 100 pixels are 0.52 wide. Right is -x.
    browser.drag_with(Modifier::Shift, (640, 556), (740, 556));
    let (at, _) = kept(&place, |at, _| at[0] < 2.7);
    assert!((at[0] - 2.26).abs() < 0.05, "{at:?}");
    assert!((at[1] - 1.7).abs() < 1e-9 && (at[2] - 1.0).abs() < 1e-6, "{at:?}");
    browser.wheel_with_shift((740, 556), 100);
    kept(&place, |now, turn| now == at && turn == 15.0);

    // A view that is kept has its name on the plan, where the eye is.
    browser.value("command('keep by the box')");
    browser.wait(
        "document.querySelector('#places .place:last-child text')?.textContent === 'by the box'",
    );
    let place_of = |browser: &mut Chromium, node: &str| {
        let place = format!("['cx', 'cy'].map(k => Number({node}.getAttribute(k)))");
        serde_json::from_value::<[f64; 2]>(browser.value(&place)).unwrap()
    };
    let named = place_of(browser, "document.querySelector('#places .place:last-child circle')");
    let eye = place_of(browser, "document.getElementById('eye')");
    assert!((named[0] - eye[0]).hypot(named[1] - eye[1]) < 1e-3, "{named:?} {eye:?}");

    // What cannot be carried is named, and changes nothing.
    let empty = place.text("empty.obj");
    for (line, reason) in [
        (format!("add {empty} at 1 1 1"), "empty.obj: no triangle"),
        ("move the cube to 1e9 0 0".into(), "outside every section"),
        ("move the chair by 1 0 0".into(), "objects: the cube"),
    ] {
        // A reason is shown for seconds, so on a busy machine the browser may miss it.
        wait_until(reason, || {
            session.write_line(&format!("object {line}"));
            std::thread::sleep(Duration::from_millis(300));
            let is_said = format!("(state.trouble || '').includes('{reason}')");
            (browser.value(&is_said) == true).then_some(())
        });
    }
    kept(&place, |now, turn| now == at && turn == 15.0);
    // A page may name files of the viewer's own folder alone.
    wait_until("the refusal of a file by its path", || {
        browser.value(&format!("command('object add {cube} at 1 1 1')"));
        std::thread::sleep(Duration::from_millis(300));
        let is_said = "document.getElementById('notice').textContent.includes('name the file')";
        (browser.value(is_said) == true).then_some(())
    });
    // A model that is dropped on the picture of the short box stands on it.
    let text = serde_json::to_string(CUBE).unwrap();
    browser.wait("drives");
    browser.value(&format!(
        "(() => {{
            const dataTransfer = new DataTransfer();
            dataTransfer.items.add(new File([{text}], 'dropped.obj'));
            const at = {{ clientX: 700, clientY: 660 }};
            dispatchEvent(new DragEvent('drop', {{ dataTransfer, cancelable: true, ...at }}));
        }})()"
    ));
    let objects = || {
        let list = std::fs::read(place.path("a.objects/objects.json")).ok()?;
        serde_json::from_slice::<Vec<Value>>(&list).ok()
    };
    let dropped = wait_until("the dropped model", || {
        objects()?.into_iter().find(|object| object["name"] == "dropped")
    });
    let at: [f64; 3] = serde_json::from_value(dropped["at"].clone()).unwrap();
    assert!((at[1] - 1.65).abs() < 1e-3, "the height of the box: {at:?}");
    assert!((2.4..2.7).contains(&at[0]) && (0.65..2.72).contains(&at[2]), "{at:?}");
    session.write_line("object remove dropped");
    wait_until("the cube alone", || (objects()?.len() == 1).then_some(()));
    browser.value("command('quit')");
    session.wait().ok();

    // Its pixels change. Far from it, walls lose a little of the light from all sides.
    let picture = |name: &str| {
        let output = format!("{{}}/{name}.pfm");
        let words = ["picture", "{}/a.holo", "--size", "160x90", "--denoise", "off", "-o", &output];
        place.run(&[&words[..], &VIEW].concat()).ok();
        Picture::read(place.path(&format!("{name}.pfm"))).unwrap()
    };
    let with = picture("with");
    std::fs::remove_dir_all(place.path("a.objects")).unwrap();
    let without = picture("without");
    let change = |column: usize, row: usize| {
        let [with, without] = [&with, &without].map(|p| luminance(p.pixels[row * 160 + column]));
        (with / without - 1.0).abs()
    };
    assert!(change(92, 70) > 0.1, "the object: {}", change(92, 70));
    assert!(change(5, 5) < 0.01, "far from it: {}", change(5, 5));
}

/// A filled Cornell box, and a cube to carry into it.
fn filled() -> Place {
    let place = Place::new();
    place.write("cube.obj", CUBE);
    let fill = ["fill", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
    let options = ["-o", "{}/a.holo", "--bounces", "0", "--samples", "400k", "--quiet"];
    place.run(&[&fill[..], &options].concat()).ok();
    place
}

/// Returns the pictures of a replay's script, one after each line.
fn pictures(place: &Place, driver: &str, lines: &[&str]) -> Vec<Picture> {
    let name = |number: usize| format!("{number}.pfm");
    let script: String = (0..lines.len())
        .map(|at| format!("{}\n{} picture {}\n", lines[at], 2 * at + 2, place.text(&name(at))))
        .collect();
    place.write("script.txt", &script);
    let words = ["replay", "{}/a.holo", "--headless", "--driver", driver, "--json"];
    let options = ["--size", "160x90", "--script", "{}/script.txt"];
    place.run(&[&words[..], &options, &VIEW].concat()).ok();
    (0..lines.len()).map(|number| Picture::read(place.path(&name(number))).unwrap()).collect()
}

/// Returns the line that carries the cube to this x.
fn add(place: &Place, x: f64) -> String {
    format!("object add {} at {x} 1.7 1 as the cube", place.text("cube.obj"))
}

/// Returns which pixels of two pictures differ.
fn changes(a: &Picture, b: &Picture) -> Vec<bool> {
    let pairs = a.pixels.iter().zip(&b.pixels);
    pairs.map(|(a, b)| (luminance(*a) / luminance(*b) - 1.0).abs() > 0.1).collect()
}

fn count(is_in: &[bool]) -> usize {
    is_in.iter().filter(|is_in| **is_in).count()
}

/// Returns the mean difference of luminance in some pixels, as a share of the light there.
fn difference(a: &Picture, b: &Picture, is_in: &[bool]) -> f64 {
    let pixels = a.pixels.iter().zip(&b.pixels).zip(is_in).filter(|(_, is_in)| **is_in);
    let (mut sum, mut light) = (0.0, 0.0);
    for ((a, b), _) in pixels {
        let (a, b) = (f64::from(luminance(*a)), f64::from(luminance(*b)));
        (sum, light) = (sum + (a - b).abs(), light + b);
    }
    sum / light
}

#[test]
fn every_driver_shows_an_object_in_a_script_s_pictures_and_none_after_it_is_removed() {
    let place = filled();
    let add = add(&place, 2.78);
    for driver in ["surfaces", "quadtree", "mesh", "pointimage", "frameless"] {
        let lines = ["object list", &add, "object remove the cube"];
        let [empty, with, without] = &pictures(&place, driver, &lines)[..] else { unreachable!() };
        // Drivers without a store know more of the room after light was looked for. Black pixels
        // have no sample.
        let seen = changes(with, without);
        let light = |picture: &Picture| -> f64 {
            let all = [empty, with, without];
            let is_known = |at: &usize| all.iter().all(|p| luminance(p.pixels[*at]) > 0.0);
            let pixels = (0..seen.len()).filter(|at| seen[*at] && is_known(at));
            pixels.map(|at| f64::from(luminance(picture.pixels[at]))).sum()
        };
        let (object, room) = (light(with) / light(empty), light(without) / light(empty));
        println!("{driver}: {} pixels, light {object:.3}, then {room:.3}", count(&seen));
        // The cube covers a sixth of the picture, and is darker than the room.
        assert!(count(&seen) > 1500, "{driver}: {} pixels show it", count(&seen));
        assert!(object < 0.95, "{driver}: its light is {object} of the room's");
        assert!((room - 1.0).abs() < 0.1, "{driver}: {room} of the room's light where it was");
    }
}

#[test]
fn a_line_of_a_script_moves_an_object_and_the_render_cache_shows_nothing_where_it_was() {
    let place = filled();
    let (add, there) = (add(&place, 3.6), "object move the cube to 1.9 1.7 1");
    let back = "object move the cube to 3.6 1.7 1";
    let lines = [&add, there, back, there, "object remove the cube"];
    let pictures = pictures(&place, "pointimage", &lines);
    // The first two bring samples around the object into the cache.
    let [_, _, back, there, empty] = &pictures[..] else { unreachable!() };
    let (before, after) = (changes(back, empty), changes(there, empty));
    assert!(count(&before) > 1000 && count(&after) > 1000, "{} {}", count(&before), count(&after));
    let only_before: Vec<bool> = before.iter().zip(&after).map(|(b, a)| *b && !a).collect();
    let only_after: Vec<bool> = after.iter().zip(&before).map(|(a, b)| *a && !b).collect();
    assert!(difference(there, empty, &only_after) > 0.3, "it is where it went");
    let left = difference(there, empty, &only_before);
    assert!(left < 0.03, "{left} is left where it was");
}
