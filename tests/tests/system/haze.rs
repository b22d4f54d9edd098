//! Haze is added to pictures along each pixel's ray. The driver `frameless` is left out: it does
//! not know the distances of all pixels.

use holo_picture::Picture;
use holo_tests::Place;

/// Radiance of the haze, and the distance after which 37 % of the light is left, scene units. A
/// unit is 0.1 m.
const HAZE: ([f32; 3], f32) = ([0.2, 0.3, 0.4], 5.0);
const FOG: [&str; 2] = ["--fog", "0.5,0.2,0.3,0.4"];

/// From before the open side, all of it in the box.
const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "50", "--size", "64x64"];

#[test]
fn pictures_of_all_drivers_but_one_in_haze_agree_with_the_closed_form() {
    let place = Place::new();
    place.fill_small_with("a.holo", "300k", &["--bounces", "0"]);
    let truth = ["render", "--config", "{}/cornell.toml", "--bounces", "0", "--spp", "1", "-q"];
    let files = ["-o", "{}/truth.pfm", "--depth", "{}/depth.pfm"];
    place.run(&[&truth[..], &VIEW, &files].concat()).ok();
    place.run(&["splats", "{}/a.holo", "-q"]).ok();
    let read = |name: &str| Picture::read(place.path(name)).unwrap();
    let depths = read("depth.pfm");
    for driver in ["surfaces", "auto", "quadtree", "mesh", "pointimage", "splats"] {
        // `auto` stands for `cells`.
        let cells: &[&str] = if driver == "auto" { &["--cells", "smooth"] } else { &[] };
        let words = ["picture", "{}/a.holo", "-q", "--driver", driver];
        let words = [&words[..], cells, &VIEW].concat();
        place.run(&[&words[..], &["-o", "{}/clear.pfm"]].concat()).ok();
        place.run(&[&words[..], &["-o", "{}/fog.pfm"], &FOG].concat()).ok();
        let (clear, fog) = (read("clear.pfm"), read("fog.pfm"));
        let hazy = |pixel: usize, channel: usize| {
            let (light, haze) = (clear.pixels[pixel][channel], HAZE.0[channel]);
            let left = (-depths.pixels[pixel][0] / HAZE.1).exp();
            light * left + haze * (1.0 - left)
        };
        if driver == "pointimage" {
            // Its pixels depend on the order of samples, and pixels without any stay black.
            let is_lit = |pixel: &[f32; 3]| *pixel != [0.0; 3];
            let is_known =
                |pixel: &usize| is_lit(&clear.pixels[*pixel]) && is_lit(&fog.pixels[*pixel]);
            for channel in 0..3 {
                let known = || (0..4096).filter(is_known);
                let expected: f32 = known().map(|pixel| hazy(pixel, channel)).sum();
                let shown: f32 = known().map(|pixel| fog.pixels[pixel][channel]).sum();
                println!("{driver}: {} of {}", shown / expected, known().count());
                assert!((shown / expected - 1.0).abs() < 0.02, "{driver}: {shown} {expected}");
            }
            continue;
        }
        let (mut close, mut all) = (0, 0);
        for pixel in (0..4096).filter(|pixel| fog.pixels[*pixel] != [0.0; 3]) {
            all += 1;
            let is_close = (0..3).all(|channel| {
                let expected = hazy(pixel, channel);
                (fog.pixels[pixel][channel] - expected).abs() < 0.02 * expected
            });
            close += u32::from(is_close);
        }
        // Depths at silhouettes differ, and those of samples alone are rounded.
        println!("{driver}: {close} of {all} pixels");
        assert!(all > 2500 && close * 10 > all * 9, "{driver}: {close} of {all}");
    }
    // With infinite distances, the haze is all that is seen of the sky.
    let sky = ["--vp", "2.78,2.73,0.5", "--vd", "0,0,-1", "--vh", "20", "--size", "16x16"];
    let words = ["picture", "{}/a.holo", "-q", "--driver", "quadtree", "-o", "{}/sky.pfm"];
    place.run(&[&words[..], &sky, &FOG].concat()).ok();
    assert!(read("sky.pfm").pixels.iter().all(|pixel| *pixel == HAZE.0));
    place.run(&[&words[..], &["--fog", "0"]].concat()).failed(2, &["--fog", "above 0"]);
    place.run(&[&words[..], &["--fog", "1,2"]].concat()).failed(2, &["METRES,R,G,B"]);
}
