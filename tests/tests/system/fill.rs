//! Filling a file, looking at what is in it, filling it further.

use holo_picture::Picture;
use holo_tests::{CORNELL_SMALL_SECTION, Place, stored};

#[test]
fn a_fill_goes_on_where_the_last_one_ended() {
    let place = Place::new();
    let first = place.fill_small("a.holo", "40k").json();
    let added = first["added"].as_u64().unwrap();
    // The last packet may be more than what was left to do.
    assert!((40_000..40_021).contains(&added), "{added}");
    assert_eq!(first["samples"], first["added"]);
    let before = stored(&place.path("a.holo"));
    assert_eq!(before.count(), added);
    before.assert_no_gaps();

    let second = place.fill_small("a.holo", "40k").json();
    let total = added + second["added"].as_u64().unwrap();
    assert_eq!(second["samples"].as_u64(), Some(total));
    let after = stored(&place.path("a.holo"));
    assert_eq!(after.count(), total);
    after.assert_no_gaps();
    after.assert_contains(&before);
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn info_says_what_the_file_holds() {
    let place = Place::new();
    place.fill_small("a.holo", "30k");
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    let stored = stored(&place.path("a.holo"));
    let section = &info["sections"][0];
    assert_eq!(section["grid"], serde_json::json!([4, 4, 4]));
    assert_eq!(section["beams"], 30 * 4u64.pow(4));
    assert_eq!(section["samples"], stored.count());
    assert_eq!(section["nonempty"], stored.beams.len());
    assert_eq!(section["obstructions"], true);
    assert_eq!(section["origin"], serde_json::json!([0.6, 0.6, -4.0]));
    assert_eq!(info["samples"], stored.count());
    assert_eq!(
        info["bytes"].as_u64(),
        Some(std::fs::metadata(place.path("a.holo")).unwrap().len())
    );
    assert_eq!(
        info["settings"],
        serde_json::json!({"engine": "path", "bounces": null, "paths_per_sample": 1, "seed": 0,
            "virtual_distance": false})
    );
    assert_eq!(info["views"][0][0], "front");
    assert_eq!(info["up"], serde_json::json!([0.0, 1.0, 0.0]));
    assert_eq!(info["damage"], serde_json::json!([]));
    assert!(info["bytes"].as_u64().unwrap() >= 10 * stored.count());
}

#[test]
fn a_file_of_something_else_is_refused_and_left_as_it_is() {
    let place = Place::new();
    place.fill_small("a.holo", "20k");
    let before = std::fs::read(place.path("a.holo")).unwrap();
    let obj = std::fs::read_to_string(place.path("cornell.obj")).unwrap();
    place.write("other.obj", &obj.replace("v 1.3 1.65 0.65", "v 1.3 1.6 0.65"));
    let fill = |words: &[&str]| {
        let always = ["fill", "--config", "{}/cornell.toml", "-o", "{}/a.holo", "--samples", "1k"];
        place.run(&[&always, words].concat())
    };
    let section = ["--section", CORNELL_SMALL_SECTION];
    let with = |words: &[&str]| fill(&[&section, words].concat());
    with(&["--bounces", "0"]).failed(1, &["a.holo", "other settings", "Name another file"]);
    with(&["--paths-per-sample", "2"]).failed(1, &["a.holo", "other settings"]);
    with(&["--virtual-distance"]).failed(
        1,
        &["a.holo", "other settings", "--virtual-distance is off in the file, and on now"],
    );
    with(&["--seed", "5"]).failed(1, &["a.holo", "other settings"]);
    with(&["{}/other.obj"]).failed(1, &["a.holo", "another scene", "triangles have moved"]);
    with(&["--sky", "1,1,0.5"])
        .failed(1, &["a.holo", "the sky is 0,0,0 in the file, and 1,1,0.5 now", "--sky"]);
    fill(&["--section", "0.6,0.6,-4 4.3,0,0 0,4.2,0 0,0,5 4,4,5"])
        .failed(1, &["a.holo", "other sections"]);
    // Not one byte: the file was only looked at.
    assert!(std::fs::read(place.path("a.holo")).unwrap() == before, "the file has changed");
}

/// The section is above the blocks and below the lamp, where nothing stands; the view shows the
/// middle of one wall. Without edges in view, a picture differs from the truth by noise alone.
const PLAIN_SECTION: &str = "0.5,3.5,0.5 4.5,0,0 0,1.7,0 0,0,4.6 3,2,3";
const PLAIN_VIEW: [&str; 8] =
    ["--vp", "2.7,4.3,2.8", "--vd", "-1,0,0", "--vh", "40", "--size", "64x64"];

#[test]
fn a_picture_from_the_file_is_the_rendered_one_except_for_noise() {
    const FILES: usize = 8;
    let place = Place::new();
    let truth = ["render", "--config", "{}/cornell.toml", "--spp", "256", "-o", "{}/truth.pfm"];
    place.run(&[&truth, &PLAIN_VIEW[..]].concat()).ok();
    let truth = Picture::read(place.path("truth.pfm")).unwrap();
    let pictures: Vec<Picture> = (0..FILES)
        .map(|seed| {
            let (seed, file, picture) =
                (seed.to_string(), format!("{{}}/{seed}.holo"), format!("{{}}/{seed}.pfm"));
            let fill = ["fill", "--config", "{}/cornell.toml", "--section", PLAIN_SECTION];
            place
                .run(&[&fill[..], &["--seed", &seed, "-o", &file, "--samples", "150k"]].concat())
                .ok();
            let report = place
                .run(
                    &[
                        &["picture", &file, "--driver", "quadtree", "-o", &picture, "--json"],
                        &PLAIN_VIEW[..],
                    ]
                    .concat(),
                )
                .ok()
                .json();
            assert_eq!(report["uncovered_pixels"], 0);
            assert_eq!(report["traced"], 0);
            Picture::read(place.path(&format!("{seed}.pfm"))).unwrap()
        })
        .collect();

    // Files of different seeds are independent, so the mean square difference of two is twice the
    // noise of one. Without bias, that is twice the difference from the truth, whose own noise (256
    // paths a pixel) is small. If the bias were as large as the noise, both would be equal.
    let difference = |a: &Picture, b: &Picture| {
        let pixels = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
        pixels.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let pairs = (0..FILES).flat_map(|a| (0..a).map(move |b| (a, b)));
    let from_each_other: f64 = pairs.map(|(a, b)| difference(&pictures[a], &pictures[b])).sum();
    let count = (FILES * (FILES - 1) / 2) as f64;
    let from_truth: f64 = pictures.iter().map(|picture| difference(picture, &truth)).sum();
    let ratio = (from_truth / FILES as f64) / (from_each_other / count);
    assert!(
        ratio < 0.75,
        "{ratio} where noise alone gives 0.5 and a bias as large as the noise gives 1"
    );

    // The mean brightness is tested with Student's t with 7 degrees of freedom: 99.9 % of unbiased
    // files pass.
    let brightness =
        |picture: &Picture| picture.pixels.iter().map(|rgb| f64::from(rgb[1])).sum::<f64>();
    let ratios: Vec<f64> =
        pictures.iter().map(|picture| brightness(picture) / brightness(&truth)).collect();
    let mean = ratios.iter().sum::<f64>() / FILES as f64;
    let variance =
        ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / (FILES - 1) as f64;
    let deviation = (variance / FILES as f64).sqrt();
    assert!((mean - 1.0).abs() <= 5.408 * deviation, "brightness {ratios:?}");
    assert!(
        5.408 * deviation < 0.1,
        "the files differ too much for this test to tell anything: {ratios:?}"
    );
}
