//! Panoramas with depths become a holodeck that is shown, and that nothing can be traced for.

use holo_picture::{Picture, luminance};
use holo_tests::Place;

/// A cube of side 1 whose base is at height 0. The up axis is y.
const CUBE: &str = "\
v -0.5 0 -0.5\nv 0.5 0 -0.5\nv 0.5 0 0.5\nv -0.5 0 0.5
v -0.5 1 -0.5\nv 0.5 1 -0.5\nv 0.5 1 0.5\nv -0.5 1 0.5
f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1
";

const VIEW: [&str; 10] =
    ["--vp", "2.7,2.5,0.5", "--vd", "0,0,1", "--vh", "70", "--size", "96x72", "-o", "{}/view.pfm"];

/// Renders two fisheyes of all directions with depths, and imports them.
fn import(place: &Place) {
    for (name, eye) in [("left", "1.6,2.2,0.5"), ("right", "3.9,2.8,0.5")] {
        let (colour, depth) = (format!("{{}}/{name}.exr"), format!("{{}}/{name}-depth.pfm"));
        let view = ["--vt", "a", "--vp", eye, "--vd", "0,0,1", "--vu", "0,1,0", "--vh", "360"];
        let render = ["render", "--config", "{}/cornell.toml", "--vv", "360", "--size", "128x128"];
        let files = ["--spp", "8", "-q", "-o", &colour, "--depth", &depth];
        place.run(&[&render[..], &view, &files].concat()).ok();
    }
    place.write(
        "walk.toml",
        "up = \"y\"\nunit = 0.1\n\
         [[panorama]]\ncolour = \"left.exr\"\ndepth = \"left-depth.pfm\"\n\
         [[panorama]]\ncolour = \"right.exr\"\ndepth = \"right-depth.pfm\"\n",
    );
    let report = place.run(&["import", "{}/walk.toml", "-o", "{}/a.holo", "--json"]).ok().json();
    assert_eq!(report["panoramas"].as_array().unwrap().len(), 2);
    // Two circles of 128 pixels, each pixel once.
    let samples = report["samples"].as_u64().unwrap();
    assert!((25_000..26_500).contains(&samples), "{samples}");
}

/// Returns the mean luminance of a part of the picture, given as columns and rows.
fn mean(place: &Place, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> f32 {
    let picture = Picture::read(place.path("view.pfm")).unwrap();
    let count = (columns.len() * rows.len()) as f32;
    let pixels = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
    pixels.map(|(column, row)| luminance(picture.get(column, row).unwrap())).sum::<f32>() / count
}

#[test]
fn captured_rays_are_shown_without_a_scene_and_light_what_is_carried_in() {
    let place = Place::new();
    import(&place);
    let said = place.run(&["info", "{}/a.holo"]).ok().stdout;
    for words in ["engine: captured", "scene: none", "left.exr", "right.exr", "view left:"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    place.run(&["verify", "{}/a.holo"]).ok();
    for driver in ["auto", "quadtree", "mesh", "pointimage", "frameless"] {
        let words = ["replay", "{}/a.holo", "--headless", "--driver", driver, "-q"];
        place.run(&[&words[..], &VIEW].concat()).ok();
        // The right half of the box is green, and the lamp lights its floor.
        assert!(mean(&place, 10..86, 10..62) > 1.0, "{driver}");
    }
    place.run(&["splats", "{}/a.holo", "-q"]).ok();
    let splats = ["picture", "{}/a.holo", "--driver", "splats", "-q"];
    place.run(&[&splats[..], &VIEW].concat()).ok();
    let without = mean(&place, 40..56, 40..56);
    assert!(without > 1.0, "{without}");

    // A cube in front of the middle of the back wall: its front is lit by what the pictures saw.
    place.write("cube.obj", CUBE);
    let objects = ["picture", "{}/a.holo", "--object", "{}/cube.obj@2.7,2,2.5", "-q"];
    place.run(&[&objects[..], &VIEW].concat()).ok();
    let lit = mean(&place, 44..52, 32..40);
    let (before, _) = (lit, place.run(&[&["picture", "{}/a.holo", "-q"][..], &VIEW].concat()).ok());
    let wall = mean(&place, 44..52, 32..40);
    assert!(lit > 0.2 && (lit - wall).abs() > 0.02 * wall, "cube {before}, wall {wall}");
}

#[test]
fn nothing_is_traced_for_captured_rays_and_every_refusal_says_why() {
    let place = Place::new();
    import(&place);
    let no_scene = ["a.holo", "captured rays", "holodeck replay"];
    place
        .run(&["fill", "--config", "{}/cornell.toml", "-o", "{}/a.holo", "--samples", "1k"])
        .failed(1, &no_scene);
    place.run(&["view", "{}/a.holo", "--headless", "--time", "1"]).failed(1, &no_scene);
    place.run(&["holoserver", "{}/a.holo"]).failed(1, &no_scene);
    place.run(&["bake", "{}/a.holo", "cube"]).failed(1, &no_scene);
    place.run(&["merge", "{}/b.holo", "{}/a.holo"]).failed(1, &["import all pictures"]);
    place
        .run(&[&["picture", "{}/a.holo", "--driver", "surfaces", "-q"][..], &VIEW].concat())
        .failed(1, &["has no scene"]);
    // Its rays can be put in order, and into other sections.
    place.run(&["optimize", "{}/a.holo"]).ok();
    let section = "1,1,-1 3,0,0 0,3,0 0,0,3";
    let copied = ["copy", "{}/a.holo", "--section", section, "-o", "{}/c.holo", "--json"];
    assert!(place.run(&copied).ok().json()["kept"].as_u64().unwrap() > 1000);

    // Each picture is a maker of samples.
    place.run(&["forget", "{}/a.holo", "--worker", "1"]).ok();
    let left = place.run(&["info", "{}/a.holo"]).ok().stdout;
    assert!(!left.contains("left.exr") && left.contains("right.exr"), "{left}");

    let one = ["import", "{}/left.exr", "-o", "{}/d.holo"];
    place.run(&one).failed(2, &["--depth"]);
    place.run(&[&one[..], &["--depth", "{}/nowhere.exr"]].concat()).failed(1, &["nowhere.exr"]);
    let sides = ["--depth", "{}/left-depth.pfm", "--vp", "0,0,0", "--vd", "0,1,0"];
    place.run(&[&one[..], &sides].concat()).failed(1, &["128x128", "twice as wide"]);
    place.run(&["import", "{}/none.toml", "-o", "{}/d.holo"]).failed(1, &["none.toml"]);
    place.run(&["import", "{}/walk.toml", "-o", "{}/a.holo"]).failed(1, &["exists already"]);
    assert!(!place.path("d.holo").exists());
}
