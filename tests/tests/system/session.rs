//! A session, and the same again from the file.

use holo_picture::{Picture, compare};
use holo_tests::{CORNELL_SMALL_SECTION, Place, stored};

const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60", "--size", "96x72"];

#[test]
fn a_replay_without_tracing_gives_the_sessions_last_picture_bit_by_bit() {
    let place = Place::new();
    let scene =
        ["--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION, "--threads", "1"];
    let live = [
        "view",
        "--headless",
        "--keep",
        "{}/s.holo",
        "--time",
        "1.2",
        "-o",
        "{}/live.pfm",
        "--json",
    ];
    let report = place.run(&[&live[..], &scene, &VIEW].concat()).ok().json();
    // Samples that are traced while the display changes its request reach it from the file.
    let [traced, recalled] = ["traced", "stored"].map(|key| report[key].as_u64().unwrap());
    assert!(traced > 1000, "{report}");
    let replay = ["replay", "{}/s.holo", "--headless", "-o", "{}/replay.pfm", "--json"];
    let again = place.run(&[&replay[..], &VIEW].concat()).ok().json();
    assert_eq!(again["traced"], 0);
    assert_eq!(again["stored"], traced + recalled);
    assert_eq!(again["samples"], report["samples"]);
    place.run(&[&["picture", "{}/s.holo", "-o", "{}/picture.pfm"], &VIEW[..]].concat()).ok();
    let read = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(read("live.pfm") == read("replay.pfm"), "the replay differs");
    assert!(read("live.pfm") == read("picture.pfm"), "the picture differs");
    stored(&place.path("s.holo")).assert_no_gaps();

    // A session that continues with the file has all of it from the start, and more samples arrive.
    let more = [
        "view",
        "{}/s.holo",
        "--headless",
        "--time",
        "2",
        "-o",
        "{}/more.pfm",
        "--json",
        "--threads",
        "1",
    ];
    let more = place.run(&[&more[..], &VIEW].concat()).ok().json();
    assert_eq!(more["stored"], report["traced"]);
    assert!(more["traced"].as_u64().unwrap() > 100, "{more}");
    stored(&place.path("s.holo")).assert_no_gaps();
}

#[test]
fn the_quadtree_shows_what_it_has_while_one_turns_and_comes_to_rest_at_the_view_s_own_picture() {
    let place = Place::new();
    place.fill_small_with("a.holo", "400k", &["--bounces", "0"]);
    let (before, turned) =
        ("-vp 2.78 2.73 -2 -vd 0 0 1 -vh 60", "-vp 2.78 2.73 -2 -vd .1 0 1 -vh 60");
    let follow = |name: &str, script: String| {
        let script = place.write(&format!("{name}.txt"), &script);
        let words = [
            "replay",
            "{}/a.holo",
            "--headless",
            "--script",
            &script,
            "--size",
            "64x64",
            "--driver",
            "quadtree",
        ];
        place.run(&words).ok();
    };
    let [moved, rested, fresh, alone] =
        ["moved", "rested", "fresh", "alone"].map(|name| place.text(&format!("{name}.pfm")));
    follow(
        "walk",
        format!(
            "0 view {before}\n3 picture {}\nview {turned}\npicture {moved}\n3 picture {rested}\nquit\n",
            place.text("x.pfm")
        ),
    );
    follow("stay", format!("0 view {turned}\npicture {fresh}\n3 picture {alone}\nquit\n"));
    let read = |path: &str| Picture::read(path).unwrap();
    assert!(
        read(&rested).pixels == read(&alone).pixels,
        "at rest it depends on where one came from"
    );
    let psnr = |path: &str| compare(&read(path), &read(&alone)).unwrap().psnr_disp;
    println!("at once {:.1} dB after a turn, {:.1} dB from nothing", psnr(&moved), psnr(&fresh));
    assert!(psnr(&moved) > psnr(&fresh) + 5.0, "{} {}", psnr(&moved), psnr(&fresh));
}

#[test]
fn views_in_quick_succession_end_with_the_picture_of_a_view_at_rest() {
    let place = Place::new();
    place.fill_small_with("a.holo", "100k", &["--bounces", "0"]);
    let (before, turned) =
        ("-vp 2.78 2.73 -2 -vd 0 0 1 -vh 60", "-vp 2.78 2.73 -2 -vd .1 0 1 -vh 60");
    let follow = |name: &str, views: &[&str]| {
        let picture = place.text(&format!("{name}.pfm"));
        let views: String = views.iter().map(|view| format!("view {view}\n")).collect();
        let script =
            place.write(&format!("{name}.txt"), &format!("{views}2 picture {picture}\nquit\n"));
        let words = [
            "replay",
            "{}/a.holo",
            "--headless",
            "--script",
            &script,
            "--size",
            "96x72",
            "--driver",
            "quadtree",
        ];
        let report = place.run(&[&words[..], &["--json"]].concat()).ok().json();
        (Picture::read(&picture).unwrap().pixels, report["samples"].clone())
    };
    // Views two and three follow so fast that the eye moves, and fewer surfaces than pixels are
    // evaluated. Then nothing moves any more.
    let (moved, alone) =
        (follow("moved", &[before, turned, before, turned]), follow("alone", &[turned]));
    assert_eq!(moved.1, alone.1);
    assert!(moved.0 == alone.0, "at rest it depends on how one came there");
}
