//! Panoramas with depths become a holodeck. They are rendered here, so that the truth is known.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::unwrap_used)]

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use glam::DVec3;
use holo_beamfile::Caching;
use holo_net::Shutdown;
use holo_picture::{Picture, compare, luminance};
use holo_scenes::Bundled;
use holo_server::Holodeck;
use holo_view::{DriverArg, DriverArgs, ViewArgs};
use holodeck::{
    config::HolodeckConfig,
    fill::{FillRequest, fill},
    import::{DepthAlong, ImportList, PanoramaSource, import},
    info::{info, verify},
    render::{RenderRequest, WorkLimit, render},
    session::{PictureRequest, picture},
    splats::{self, SplatRequest},
};

/// Where the panoramas were taken in the bundled box, whose sides are 5.5 long and whose open side
/// is at z = 0.
const EYES: [[f64; 3]; 2] = [[1.6, 2.2, 0.5], [3.9, 2.8, 0.5]];

/// The box's lamp: least and greatest coordinates.
const LAMP: [[f64; 3]; 2] = [[2.13, 5.487, 2.27], [3.43, 5.487, 3.32]];

fn cornell(folder: &Path) -> HolodeckConfig {
    let written = holo_scenes::write(Bundled::Cornell, folder).unwrap();
    HolodeckConfig::read(&written.config).unwrap()
}

fn triple([x, y, z]: [f64; 3]) -> Option<String> {
    Some(format!("{x},{y},{z}"))
}

/// Renders a view and its depths.
async fn rendered(config: &HolodeckConfig, view: ViewArgs, paths: u32) -> (Picture, Picture) {
    let request = RenderRequest {
        config: config.clone(),
        view,
        limit: WorkLimit::Paths(paths),
        caches_reflections: false,
        denoiser: None,
        has_errors: false,
        has_depths: true,
        threads: None,
        quiet: true,
    };
    let rendered = render(request, &Shutdown::new()).await.unwrap();
    (rendered.picture, rendered.depths.unwrap())
}

/// Writes a fisheye of all directions and its depths, and returns their source.
async fn fisheye(config: &HolodeckConfig, eye: [f64; 3], folder: &Path) -> PanoramaSource {
    let all = || Some("360".to_owned());
    let view = ViewArgs {
        vt: Some("a".to_owned()),
        vp: triple(eye),
        vd: triple([0.0, 0.0, 1.0]),
        vu: triple([0.0, 1.0, 0.0]),
        vh: all(),
        vv: all(),
        size: Some((256, 256)),
        ..ViewArgs::default()
    };
    let (colours, depths) = rendered(config, view, 24).await;
    let named = |end: &str| folder.join(format!("eye-{}{end}", eye[0]));
    let source = PanoramaSource {
        colour: named(".exr"),
        depth: named("-depth.pfm"),
        ..PanoramaSource::default()
    };
    colours.write(&source.colour).unwrap();
    depths.write(&source.depth).unwrap();
    source
}

/// The view of a person between the two eyes.
fn between() -> ViewArgs {
    ViewArgs {
        vp: triple([2.7, 2.5, 0.5]),
        vd: triple([0.0, 0.0, 1.0]),
        vu: triple([0.0, 1.0, 0.0]),
        vh: Some("80".to_owned()),
        size: Some((160, 120)),
        ..ViewArgs::default()
    }
}

/// Draws the view between the eyes from a file. Returns its PSNR as displayed, dB.
async fn psnr(file: &Path, driver: DriverArg, truth: &Picture) -> f64 {
    let mut args = DriverArgs { driver, ..DriverArgs::default() };
    if driver == DriverArg::Splats {
        args.splats = Some(splats::beside(file));
    }
    let file = file.to_owned();
    let request = PictureRequest { file, view: between(), driver: args, ..Default::default() };
    let (shown, _) = picture(request, Shutdown::new()).await.unwrap().unwrap();
    compare(&shown, truth).unwrap().psnr_disp
}

#[tokio::test(flavor = "multi_thread")]
async fn a_view_between_two_panoramas_is_better_than_a_fill_of_as_many_samples() {
    let folder = tempfile::tempdir().unwrap();
    let config = cornell(folder.path());
    let mut list = ImportList { up: Some("y".parse().unwrap()), ..ImportList::default() };
    for eye in EYES {
        list.panorama.push(fisheye(&config, eye, folder.path()).await);
    }
    let captured = folder.path().join("captured.holo");
    let report = import(&list, &captured, &mut |_| {}).unwrap();
    assert_eq!(report.panoramas.len(), 2);
    for panorama in &report.panoramas {
        // A circle in a square; the box is open in front, where its sky is black.
        let (used, share) = (panorama.pixels.used, std::f64::consts::PI / 4.0);
        assert!((used as f64 / 65536.0 - share).abs() < 0.01, "{panorama:?}");
        assert!(panorama.pixels.sky > 1000 && panorama.rays.outside == 0, "{panorama:?}");
        // Pixels in the corners show nothing, and lack nothing.
        assert_eq!((panorama.pixels.without_depth, panorama.pixels.without_colour), (0, 0));
    }
    let held = info(&captured).unwrap();
    assert_eq!((held.samples, held.settings.engine.name()), (report.samples, "captured"));
    assert_eq!(held.scene.bytes, 0);
    let by_picture: Vec<u64> = held.workers.iter().map(|worker| worker.samples).collect();
    let stored: Vec<u64> = report.panoramas.iter().map(|panorama| panorama.rays.stored).collect();
    assert_eq!(by_picture, stored, "each picture is a maker");
    assert_eq!(verify(&captured).unwrap(), [""; 0]);

    let filled = folder.path().join("filled.holo");
    let program = env!("CARGO_BIN_EXE_holodeck").into();
    let mut request = FillRequest::new(program, filled.clone(), config.clone());
    request.samples = Some(report.samples);
    fill(&request, &Shutdown::new(), |_| {}).await.unwrap();
    let (truth, _) = rendered(&config, between(), 200).await;
    let splats_of = SplatRequest {
        file: captured.clone(),
        output: splats::beside(&captured),
        spacing: None,
        most: None,
        ignores_scene: false,
    };
    splats::make(&splats_of, &mut |_| {}).unwrap();
    let of_captured = |driver| psnr(&captured, driver, &truth);
    let auto = of_captured(DriverArg::Auto).await;
    let quadtree = of_captured(DriverArg::Quadtree).await;
    let mesh = of_captured(DriverArg::Mesh).await;
    let cache = of_captured(DriverArg::Pointimage).await;
    let of_splats = of_captured(DriverArg::Splats).await;
    let filled = psnr(&filled, DriverArg::Quadtree, &truth).await;
    println!(
        "{} samples: auto {auto:.1}, quadtree {quadtree:.1}, mesh {mesh:.1}, pointimage \
         {cache:.1}, splats {of_splats:.1}, a fill with quadtree {filled:.1} dB",
        report.samples
    );
    assert!(auto > 20.0 && auto > filled, "{auto} {filled}");
    assert!(quadtree > 20.0 && mesh > 20.0 && cache > 15.0 && of_splats > 18.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn rays_of_a_cube_pass_its_eye_and_end_on_the_surfaces_and_the_lamp_is_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let config = cornell(folder.path());
    // A cube that faces an edge of the box and leans: nothing suits the axes.
    let (eye, vd, vu) =
        (DVec3::from_array(EYES[0]), DVec3::new(0.6, 0.2, 1.0), DVec3::new(0.1, 1.0, 0.0));
    let front = holo_picture::View::new(eye, vd, vu, Some(90.0), None, (1, 1)).unwrap();
    let (front, right, up) = (front.vd, front.right(), front.up());
    for (name, axis, up) in [
        ("right", right, up),
        ("left", -right, up),
        ("up", up, -front),
        ("down", -up, front),
        ("front", front, up),
        ("back", -front, up),
    ] {
        let view = ViewArgs {
            vp: triple(eye.to_array()),
            vd: triple(axis.to_array()),
            vu: triple(up.to_array()),
            vh: Some("90".to_owned()),
            size: Some((64, 64)),
            ..ViewArgs::default()
        };
        let (colours, mut depths) = rendered(&config, view, 8).await;
        let view = depths.view.unwrap();
        for row in 0..64 {
            for column in 0..64 {
                let (x, y) = holo_picture::View::pixel_centre((64, 64), column, row);
                let cosine = view.ray(x, y).1.dot(view.vd) as f32;
                // Millimetres along the face's axis.
                depths.pixels[(row * 64 + column) as usize] =
                    depths.pixels[(row * 64 + column) as usize].map(|d| d * cosine * 1000.0);
            }
        }
        colours.write(folder.path().join(format!("c-{name}.exr"))).unwrap();
        depths.write(folder.path().join(format!("d-{name}.exr"))).unwrap();
    }
    let named = |name: &str| folder.path().join(name);
    let list = ImportList {
        panorama: vec![PanoramaSource {
            colour: named("c-{face}.exr"),
            depth: named("d-{face}.exr"),
            vp: Some(eye.to_array()),
            vd: Some(vd.to_array()),
            vu: Some(vu.to_array()),
            projection: None,
        }],
        up: Some("y".parse().unwrap()),
        depth_along: Some(DepthAlong::Axis),
        depth_scale: Some(0.001),
        ..ImportList::default()
    };
    let file = named("cube.holo");
    let report = import(&list, &file, &mut |_| {}).unwrap();
    assert_eq!(report.samples, 6 * 64 * 64);

    let holodeck = Holodeck::open_read_only(&file, 1 << 20).unwrap();
    let section = &holodeck.sections[0];
    let spec = section.spec();
    let step = (0..3).map(|axis| spec.axes[axis][axis] / f64::from(spec.grid[axis]) / 256.0);
    let step = step.fold(0.0, f64::max);
    let mut keys = Vec::new();
    holodeck.file.for_each_beam(&mut |key, _| keys.push(key));
    let (mut lamp, mut on_box, mut hits) = (0, 0, 0);
    let read = |key: holo_section::BeamKey, beam: std::sync::Arc<holo_beamfile::BeamSamples>| {
        for sample in &beam.samples {
            let ray = section.ray(section.cells(key.beam).unwrap(), sample.coords);
            assert!(holo_section::ray_eye_distance(&ray, eye) < step, "rays pass the eye");
            let distance = sample.distance(section.diagonal());
            if distance.is_infinite() {
                assert!(ray.direction.z < 0.0, "the box is open in front");
                continue;
            }
            let end = ray.origin + ray.direction * distance;
            (hits, on_box) = (hits + 1, on_box + u64::from(is_on_box(end, 4.0 * step)));
            // Only the lamp is so bright.
            if luminance(sample.rgb()) > 1000.0 {
                lamp += 1;
                let [low, high] = LAMP.map(DVec3::from_array);
                // A pixel is 2/64 of its distance wide.
                let near = 0.15;
                let is_there =
                    (end - low).min_element() > -near && (high - end).min_element() > -near;
                assert!(is_there, "the lamp at {end}");
            }
        }
        ControlFlow::Continue(())
    };
    let mut read = read;
    holodeck.file.read_many(&keys, Caching::Bypass, &mut read).unwrap();
    assert!(lamp > 20, "{lamp} rays see the lamp");
    // The others end on the two blocks.
    assert!(hits > 10_000 && on_box * 4 > hits * 3, "{on_box} of {hits} rays end on the walls");
}

/// Returns whether a point lies on a wall of the bundled box.
fn is_on_box(point: DVec3, tolerance: f64) -> bool {
    let near = |at: f64, wall: f64| (at - wall).abs() < tolerance;
    // The walls at x = 5.5 lean by 6 cm.
    near(point.x, 0.0)
        || (5.49..5.57).contains(&point.x)
        || near(point.y, 0.0)
        || near(point.y, 5.488)
        || near(point.z, 5.592)
}

#[test]
fn a_file_is_made_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str| folder.path().join(name);
    let white = |size: (u32, u32), value: f32, name: &str| {
        let pixels = vec![[value; 3]; (size.0 * size.1) as usize];
        Picture { pixels, ..Picture::new(size.0, size.1) }.write(named(name)).unwrap();
    };
    white((16, 8), 1.0, "a.exr");
    white((16, 8), 2.0, "a-depth.exr");
    let good = PanoramaSource {
        colour: named("a.exr"),
        depth: named("a-depth.exr"),
        vp: Some([0.0; 3]),
        vd: Some([0.0, 1.0, 0.0]),
        ..PanoramaSource::default()
    };
    let file = named("a.holo");
    let try_import = |panorama: Vec<PanoramaSource>, section: Vec<&str>| {
        let section = section.into_iter().map(section_of).collect();
        let list = ImportList { panorama, section, ..ImportList::default() };
        import(&list, &file, &mut |_| {}).map_err(|error| format!("{error:#}"))
    };
    // The second picture is damaged.
    std::fs::copy(named("a.exr"), named("b.exr")).unwrap();
    let bytes = std::fs::read(named("a-depth.exr")).unwrap();
    std::fs::write(named("b-depth.exr"), &bytes[..bytes.len() / 2]).unwrap();
    let damaged =
        PanoramaSource { colour: named("b.exr"), depth: named("b-depth.exr"), ..good.clone() };
    let said = try_import(vec![good.clone(), damaged], vec![]).unwrap_err();
    assert!(said.contains("b-depth.exr"), "{said}");
    white((16, 8), 0.0, "c-depth.exr");
    let dark = PanoramaSource { depth: named("c-depth.exr"), ..good.clone() };
    let said = try_import(vec![dark], vec![]).unwrap_err();
    assert!(said.contains("no pixel") && said.contains("a.exr"), "{said}");
    let said = try_import(vec![good.clone()], vec!["9,9,9 1,0,0 0,1,0 0,0,1"]).unwrap_err();
    assert!(said.contains("no section stores any ray"), "{said}");
    let said = try_import(vec![good.clone(); 1025], vec![]).unwrap_err();
    assert!(said.contains("1024"), "{said}");
    let left: Vec<PathBuf> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(left.iter().all(|path| !path.to_string_lossy().contains(".holo")), "{left:?}");

    let report = try_import(vec![good.clone()], vec!["-3,-3,-3 6,0,0 0,6,0 0,0,6 6,6,6"]).unwrap();
    assert_eq!(report.samples, 128);
    let held = info(&file).unwrap();
    assert_eq!(held.sections[0].grid, [6, 6, 6]);
    assert_eq!(held.views[0].0, "a");
    let said = try_import(vec![good], vec![]).unwrap_err();
    assert!(said.contains("exists already"), "{said}");
}

/// Parses a section of a box with sides along the axes.
fn section_of(text: &str) -> holodeck::config::SectionTable {
    let numbers: Vec<f64> = text.split([' ', ',']).map(|number| number.parse().unwrap()).collect();
    let at = |from: usize| [numbers[from], numbers[from + 1], numbers[from + 2]];
    let grid = (numbers.len() > 12).then(|| at(12).map(|count| count as u32));
    holodeck::config::SectionTable {
        name: None,
        origin: at(0),
        axes: [at(3), at(6), at(9)],
        grid,
        exterior: false,
        geometry: None,
        portals: None,
    }
}
