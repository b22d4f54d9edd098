//! The look of pictures on a display: exposures, tones, false colours, contours, and how they
//! change from frame to frame.

use holo_picture::{
    Adaptation, Exposure, Image, Look, Picture, Scale, Scaling, Tone, auto_exposure, luminance,
};

const TONES: [Tone; 4] = [Tone::Soft, Tone::Linear, Tone::Camera, Tone::Human];

fn look(tone: Tone) -> Look {
    Look { tone, ..Look::default() }
}

fn picture(width: u32, height: u32, light: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
    let mut picture = Picture::new(width, height);
    for (index, pixel) in (0..).zip(&mut picture.pixels) {
        *pixel = light(index % width, index / width);
    }
    picture
}

fn uniform(level: f32) -> Picture {
    picture(32, 16, |_, _| [level; 3])
}

/// Grey that grows by a constant factor, from left to right.
fn ramp(width: u32, least: f32, most: f32) -> Picture {
    let factor = (most / least).powf(1.0 / (width - 1) as f32);
    picture(width, 64, |column, _| [least * factor.powi(column as i32); 3])
}

fn pixel(image: &Image, column: u32, row: u32) -> [u8; 3] {
    let start = 3 * (row * image.width + column) as usize;
    [image.rgb[start], image.rgb[start + 1], image.rgb[start + 2]]
}

fn row(image: &Image) -> Vec<[u8; 3]> {
    (0..image.width).map(|column| pixel(image, column, image.height / 2)).collect()
}

#[test]
fn a_grey_card_is_shown_at_the_key_whatever_its_brightness() {
    // sRGB of 0.18 by IEC 61966-2-1: 255 * (1.055 * 0.18^(1/2.4) - 0.055) = 117.6.
    for level in [1e-20, 1e-4, 1.0, 3e5, 1e30] {
        for tone in [Tone::Soft, Tone::Linear, Tone::Camera] {
            assert_eq!(
                pixel(&look(tone).show(&uniform(level)), 3, 3),
                [118; 3],
                "{level} {tone:?}"
            );
        }
    }
}

#[test]
fn an_eye_sees_a_bright_room_bright_and_a_dark_one_dark() {
    let shown = [1e-4, 1e-2, 1.0, 100.0]
        .map(|level| pixel(&look(Tone::Human).show(&uniform(level)), 3, 3)[1]);
    assert!(shown.is_sorted() && shown[0] < 40 && shown[3] > 90, "{shown:?}");
}

#[test]
fn stops_double_the_light_and_a_factor_locks_it() {
    for tone in [Tone::Linear, Tone::Camera] {
        let dark = Look { exposure: Exposure::Stops(-2.0), ..look(tone) }.show(&uniform(3.0));
        // sRGB of 0.18 / 4 = 0.045.
        assert_eq!(pixel(&dark, 0, 0), [60; 3], "{tone:?}");
    }
    let locked = Look { exposure: Exposure::Factor(0.06), ..look(Tone::Linear) };
    assert_eq!(pixel(&locked.show(&uniform(3.0)), 0, 0), [118; 3]);
    assert_eq!(locked.show(&uniform(3.0)).exposure, Some(0.06));
    assert_eq!(pixel(&locked.show(&uniform(30.0)), 0, 0), [255; 3]);
    let auto = Look::default().show(&uniform(3.0));
    assert!((auto.exposure.unwrap() - 0.06).abs() < 1e-6);
    assert_eq!(look(Tone::Camera).show(&uniform(3.0)).exposure, None);
}

#[test]
fn a_lamp_and_empty_pixels_hardly_move_the_exposure() {
    let dim = |column: u32| 1e-3 * 1.05_f32.powi(column as i32);
    let plain = auto_exposure(&picture(256, 1, |column, _| [dim(column); 3]));
    let lamp = picture(256, 1, |column, _| [if column == 255 { 1e9 } else { dim(column) }; 3]);
    // A pixel of 256 counts at most as a factor of 100^(1/256) = 1.018; so does the one it
    // replaced.
    let change = (auto_exposure(&lamp) / plain).ln().abs();
    assert!(change < 2.0 * 100_f32.ln() / 256.0, "{change}");
    let half_empty =
        picture(256, 2, |column, row| if row == 0 { [dim(column); 3] } else { [0.0; 3] });
    assert_eq!(auto_exposure(&half_empty), plain);
    assert_eq!(auto_exposure(&Picture::new(4, 4)), 1.0);
}

#[test]
fn more_light_is_never_darker() {
    for tone in [Tone::Soft, Tone::Linear, Tone::Camera] {
        for (least, most) in [(1e-3, 1e4), (1e-7, 1e-2), (1.0, 30.0), (1e-30, 1e30)] {
            let shown = row(&look(tone).show(&ramp(300, least, most)));
            assert!(shown.windows(2).all(|pair| pair[0][1] <= pair[1][1]), "{tone:?} {least}");
        }
    }
}

#[test]
fn a_camera_shows_both_a_dark_and_a_bright_room() {
    // Each half spans a factor of 30, and the halves are a factor of 10,000 apart.
    let light = |column: u32, row: u32| {
        let level = 30_f32.powf(row as f32 / 255.0);
        [if column < 160 { 0.01 * level } else { 100.0 * level }; 3]
    };
    let scene = picture(320, 256, light);
    let span = |tone: Tone, column: u32| {
        let image = look(tone).show(&scene);
        pixel(&image, column, 250)[1] - pixel(&image, column, 5)[1]
    };
    assert!(span(Tone::Camera, 50) > 60 && span(Tone::Camera, 300) > 60);
    assert!(span(Tone::Linear, 50) < 30 && span(Tone::Linear, 300) < 30);
}

#[test]
fn every_radiance_has_a_look() {
    let odd = [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-45, 1.0];
    let scene = picture(64, 64, |column, row| {
        [odd[column as usize / 8], odd[row as usize / 8], odd[(column + row) as usize % 8]]
    });
    for tone in TONES {
        let image = look(tone).show(&scene);
        assert_eq!(image.rgb.len(), 64 * 64 * 3);
        assert_eq!(pixel(&look(tone).show(&uniform(f32::NAN)), 1, 1), [0; 3], "{tone:?}");
        assert_eq!(pixel(&look(tone).show(&uniform(0.0)), 1, 1), [0; 3], "{tone:?}");
    }
    for tone in [Tone::Soft, Tone::Linear, Tone::Camera] {
        let bright =
            picture(32, 32, |column, _| [if column < 31 { 1.0 } else { f32::INFINITY }; 3]);
        assert_eq!(pixel(&look(tone).show(&bright), 31, 3), [255; 3], "{tone:?}");
    }
    for size in [(1, 1), (1, 200), (200, 1), (2, 3)] {
        for tone in TONES {
            let scene = picture(size.0, size.1, |column, row| [(1 + column + row) as f32; 3]);
            assert_eq!(look(tone).show(&scene).rgb.len(), (3 * size.0 * size.1) as usize);
        }
    }
}

#[test]
fn an_image_does_not_depend_on_the_threads() {
    let scene = ramp(400, 1e-4, 1e3);
    let with = |threads: usize, look: Look| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| look.show(&scene))
    };
    let false_color = Look { false_color: true, contours: true, ..Look::default() };
    for look in TONES.map(look).into_iter().chain([false_color]) {
        assert_eq!(with(1, look), with(3, look));
    }
}

#[test]
fn dark_places_lose_their_colour_for_an_eye_only() {
    let red = |level: f32| picture(64, 64, move |_, _| [level, 0.2 * level, 0.2 * level]);
    let shown = |tone: Tone, level: f32| pixel(&look(tone).show(&red(level)), 30, 30);
    let [r, g, b] = shown(Tone::Human, 1e-6);
    assert!(r == g && g == b);
    let [r, g, _] = shown(Tone::Human, 10.0);
    assert!(r > g + 40);
    let [r, g, _] = shown(Tone::Camera, 1e-6);
    assert!(r > g + 40);
}

#[test]
fn a_lamp_veils_its_surroundings_for_an_eye_only() {
    let lamp = |level: f32| {
        picture(320, 200, move |column, row| {
            let near = column.abs_diff(160) < 4 && row.abs_diff(100) < 4;
            [if near { level } else { 0.02 * (1 + column / 40 % 2) as f32 }; 3]
        })
    };
    let contrast = |tone: Tone, level: f32| {
        let image = look(tone).show(&lamp(level));
        i32::from(pixel(&image, 220, 100)[1]) - i32::from(pixel(&image, 180, 100)[1])
    };
    assert!(contrast(Tone::Camera, 1e4) > 20);
    assert!(contrast(Tone::Human, 1e4) < contrast(Tone::Human, 0.04) / 2);
}

#[test]
fn false_colours_are_those_of_the_legend() {
    let scale = Scale::new(0.0, 179.0, false).unwrap();
    let false_color = Look { false_color: true, scaling: Scaling::Fixed(scale), ..Look::default() };
    let scene = picture(101, 3, |column, _| [0.01 * column as f32; 3]);
    let image = false_color.show(&scene);
    let legend = image.legend.as_ref().unwrap();
    for column in [0, 17, 50, 100] {
        let place = luminance([0.01 * column as f32; 3]) / 179.0;
        assert_eq!(pixel(&image, column, 1), legend.color(place));
    }
    assert_eq!((legend.unit, legend.scale), ("cd/m²", scale));
    let labels: Vec<&str> = legend.ticks.iter().map(|tick| tick.label.as_str()).collect();
    assert_eq!(labels, ["0", "20", "40", "60", "80", "100", "120", "140", "160"]);
    assert!((legend.ticks[4].place - 80.0 / 179.0).abs() < 1e-6);
    let log = Scale::new(0.0179, 179.0, true).unwrap();
    let image = Look { scaling: Scaling::Fixed(log), ..false_color }.show(&uniform(0.01));
    let place = log.place(luminance([0.01; 3]));
    assert!((place - 0.5).abs() < 1e-5);
    assert_eq!(pixel(&image, 1, 1), image.legend.unwrap().color(place));
    // Without false colours and contours there is nothing to explain.
    assert_eq!(Look::default().show(&scene).legend, None);
}

#[test]
fn contours_lie_where_luminance_crosses_a_label() {
    let scale = Scale::new(0.0, 500.0, false).unwrap();
    let plain = Look { scaling: Scaling::Fixed(scale), ..Look::default() };
    let scene = picture(250, 8, |column, _| [(column as f32 + 0.5) * 2.0 / 179.0; 3]);
    let (without, with) = (plain.show(&scene), Look { contours: true, ..plain }.show(&scene));
    let lines: Vec<u32> =
        (0..250).filter(|&column| pixel(&with, column, 4) != pixel(&without, column, 4)).collect();
    // 100, 200, 300 and 400 cd/m² lie between columns 49 and 50, and so on. A line is 2 wide.
    assert_eq!(lines, [49, 50, 99, 100, 149, 150, 199, 200]);
    let legend = with.legend.as_ref().unwrap();
    assert_eq!(pixel(&with, 100, 4), legend.color(0.4));
    let over = Look { contours: true, false_color: true, ..plain }.show(&scene);
    assert_eq!((pixel(&over, 50, 4), pixel(&over, 199, 4)), ([255; 3], [0; 3]));
}

#[test]
fn automatic_values_change_slowly_from_frame_to_frame() {
    let room = |lamp: bool| {
        picture(320, 200, move |column, row| {
            let level = if lamp && column < 160 { 500.0 } else { 0.05 };
            [level * (1.0 + 0.1 * (column + row) as f32); 3]
        })
    };
    for tone in TONES {
        let mut state = Adaptation::default();
        let look = look(tone);
        let first = look.follow(&room(false), &mut state, 0.016);
        assert_eq!(first, look.show(&room(false)), "{tone:?}");
        assert_eq!(look.follow(&room(false), &mut state, 0.016), first);
        // Somebody opens a door to a bright room. The half beyond the lamp dims in small steps.
        let mut dim = vec![];
        for _ in 0..400 {
            dim.push(i32::from(pixel(&look.follow(&room(true), &mut state, 0.016), 300, 150)[1]));
        }
        let settled = i32::from(pixel(&look.show(&room(true)), 300, 150)[1]);
        let before = i32::from(pixel(&first, 300, 150)[1]);
        let steps = dim.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        // 4 % of a change in each frame. The veil of an eye has no delay.
        let at_once = if tone == Tone::Human { 255 } else { (before - settled).abs() / 8 + 2 };
        assert!((dim[0] - before).abs() <= at_once, "{tone:?} {before} {dim:?}");
        assert!(steps.max().unwrap() <= (before - settled).abs() / 8 + 2, "{tone:?} {dim:?}");
        assert!((dim[399] - settled).abs() <= 1, "{tone:?} {settled} {}", dim[399]);
        // 0 seconds lock the adaptation.
        let locked = look.follow(&room(false), &mut state, 0.0);
        assert_eq!(look.follow(&room(false), &mut state, 0.0), locked);
        assert_ne!(locked, first, "{tone:?}");
    }
}

#[test]
fn a_scale_of_colours_stays_while_one_walks() {
    let colors = Look { false_color: true, ..Look::default() };
    let mut state = Adaptation::default();
    let mut most = |level: f32, seconds: f32| {
        let image = colors.follow(&uniform(level / 179.0), &mut state, seconds);
        image.legend.unwrap().scale.most()
    };
    assert_eq!(most(90.0, 0.1), 100.0);
    assert_eq!([most(95.0, 0.1), most(45.0, 0.1), most(60.0, 0.1)], [100.0; 3]);
    assert_eq!(most(300.0, 0.0), 100.0);
    assert_eq!(most(300.0, 0.1), 500.0);
}

#[test]
fn a_png_of_a_look_can_be_written_and_others_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colours.png");
    let image = Look { false_color: true, ..Look::default() }.show(&ramp(100, 0.1, 10.0));
    image.clone().with_legend().write(&path).unwrap();
    let mut reader =
        png::Decoder::new(std::io::Cursor::new(std::fs::read(&path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert!(info.width > 100 && info.height == 64);
    assert_eq!(bytes[..300], image.rgb[..300]);
    let nowhere = image.write(folder.path().join("none/a.png")).unwrap_err().to_string();
    assert!(nowhere.contains("a.png"), "{nowhere}");
}
