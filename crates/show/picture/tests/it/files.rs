//! Tests of files: what is written reads back, files of Radiance are understood, and errors name
//! what is wrong with a damaged file.

// Clippy allows these only inside test functions, but helpers need them too.
#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use holo_picture::{Format, MAX_SIDE, Picture, PictureError, View};
use proptest::prelude::*;
use std::fs;

/// Returns pictures of few colours, so that runs of all lengths occur beside noise.
fn picture(brightest: f32) -> impl Strategy<Value = Picture> {
    let colour = prop::array::uniform3(
        prop_oneof![4 => 0.0..1.0f32, 1 => 0.0..brightest, 1 => Just(0.0f32)],
    );
    (1..=300u32, 1..=5u32, prop::collection::vec(colour, 4), any::<u64>()).prop_map(
        |(width, height, colours, seed)| {
            let mut state = seed | 1;
            let mut step = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                state
            };
            let mut pixels = Vec::new();
            let size = (width * height) as usize;
            while pixels.len() < size {
                let word = step();
                let run = if word & 7 == 0 { 1 + (word >> 8) as usize % 300 } else { 1 };
                let colour = colours[(word >> 4) as usize & 3];
                pixels.extend(std::iter::repeat_n(colour, run.min(size - pixels.len())));
            }
            Picture::from_pixels(width, height, pixels).unwrap()
        },
    )
}

fn with_view(mut picture: Picture) -> Picture {
    let eye = DVec3::new(0.1, -2e7, 3.5);
    let view =
        View::resolve(eye, DVec3::new(1.0, 2.0, 0.3), DVec3::Z, Some(41.5), None, picture.size());
    picture.view = Some(view.unwrap().0);
    picture
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn pfm_and_exr_keep_every_bit(picture in picture(f32::MAX)) {
        let again = Picture::decode(&picture.encode(Format::Pfm).unwrap(), Format::Pfm).unwrap();
        prop_assert_eq!(&again, &picture);
        let picture = with_view(picture);
        let again = Picture::decode(&picture.encode(Format::Exr).unwrap(), Format::Exr).unwrap();
        prop_assert_eq!(&again, &picture);
    }

    #[test]
    fn hdr_keeps_every_channel_within_half_a_step(picture in picture(1e30), exposure in prop_oneof![Just(1.0f32), 1e-3..1e3f32]) {
        let mut picture = with_view(picture);
        picture.exposure = exposure;
        let once = Picture::decode(&picture.encode(Format::Hdr).unwrap(), Format::Hdr).unwrap();
        prop_assert_eq!(once.view, picture.view);
        prop_assert_eq!(once.exposure, exposure);
        for (found, wanted) in once.pixels.iter().zip(&picture.pixels) {
            let largest = wanted[0].max(wanted[1]).max(wanted[2]);
            for c in 0..3 {
                // Mantissas of the largest channel are at least 128, so half a step is at most
                // 1/256 of it, plus f32 rounding.
                let limit = f64::from(largest) * (1.0 / 256.0 + 1e-6);
                prop_assert!((f64::from(found[c]) - f64::from(wanted[c])).abs() <= limit, "{found:?} for {wanted:?}");
            }
        }
        // A picture that came from RGBE is unchanged.
        if exposure == 1.0 {
            let twice = Picture::decode(&once.encode(Format::Hdr).unwrap(), Format::Hdr).unwrap();
            prop_assert_eq!(twice, once);
        }
    }

    #[test]
    fn any_bytes_give_a_picture_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for format in [Format::Hdr, Format::Pfm, Format::Exr] {
            let _ = Picture::decode(&bytes, format);
        }
        let mut rows = b"#?RADIANCE\n\n-Y 7 +X 60\n".to_vec();
        rows.extend_from_slice(&bytes);
        let _ = Picture::decode(&rows, Format::Hdr);
    }

    #[test]
    fn damaged_files_give_a_picture_or_an_error(
        picture in picture(10.0), cut in 0.0..1.0f64, flips in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..6),
    ) {
        for format in [Format::Hdr, Format::Pfm, Format::Exr] {
            let whole = with_view(picture.clone()).encode(format).unwrap();
            let mut bytes = whole.clone();
            for (at, byte) in &flips {
                // Half of them in the header, where damage matters most.
                let reach = if byte & 1 == 0 { bytes.len().min(300) } else { bytes.len() };
                bytes[(at * reach as f64) as usize] = *byte;
            }
            let _ = Picture::decode(&bytes, format);
            // A file of ours has no superfluous byte.
            let short = &whole[..(cut * whole.len() as f64) as usize];
            prop_assert!(Picture::decode(short, format).is_err());
        }
    }
}

#[test]
fn radiance_header_lines_are_understood_and_the_exposure_divided_out() {
    let mut bytes =
        b"#?RADIANCE\nrpict -vtv -vp 1 2 3 -vd 0 1 0 -vu 0 0 1 -vh 40 -vv 20 -av .1 .1 .1\n\
        \tEXPOSURE=100\n\tVIEW= -vp 9 9 9\nEXPOSURE=4\nEXPOSURE= 5.000000e-01\nCOLORCORR= 1 0.5 2\n\
        FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"
            .to_vec();
    bytes.extend_from_slice(&[128, 64, 0, 129, 9, 9, 9, 0]);
    let picture = Picture::decode(&bytes, Format::Hdr).unwrap();
    // (128 + ½)/128 of exponent 129, divided by 4·½ and by channel 1, ½, 2.
    assert_eq!(picture.pixels, [[128.5 / 128.0 / 2.0, 64.5 / 128.0, 0.5 / 128.0 / 4.0], [0.0; 3]]);
    assert_eq!(picture.exposure, 2.0);
    let view = picture.view.unwrap();
    assert_eq!((view.vp, view.vh, view.vv), (DVec3::new(1.0, 2.0, 3.0), 40.0, 20.0));
    // A fisheye picture without directions can be read, but has no view.
    let fisheye = b"#?RADIANCE\nVIEW= -vta -vp 1 2 3\n\n-Y 1 +X 1\n\x80\x80\x80\x81";
    assert_eq!(Picture::decode(fisheye, Format::Hdr).unwrap().view, None);
}

#[test]
fn all_encodings_of_a_row_decode_alike() {
    let (a, b) = ([128, 50, 20, 120], [90, 200, 7, 130]);
    let file = |resolution: &str, data: &[u8]| {
        let mut bytes =
            format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n").into_bytes();
        bytes.extend_from_slice(data);
        Picture::decode(&bytes, Format::Hdr)
    };
    // One row of 300: a, then 259 more of it, then 40 of b.
    let flat: Vec<u8> = [a; 260].iter().chain(&[b; 40]).flatten().copied().collect();
    let flat = file("-Y 1 +X 300", &flat).unwrap();
    // Old runs: 3 more, then 1·256 more (consecutive runs count 1 + 256·…), and b.
    let old: Vec<u8> = [a, [1, 1, 1, 3], [1, 1, 1, 1], b, [1, 1, 1, 39]].concat();
    assert_eq!(file("-Y 1 +X 300", &old).unwrap(), flat);
    let mut new = vec![2, 2, 1, 44];
    for c in 0..4 {
        // Two runs of 127, a literal of 6, a run of 40.
        new.extend_from_slice(&[
            255, a[c], 255, a[c], 6, a[c], a[c], a[c], a[c], a[c], a[c], 168, b[c],
        ]);
    }
    assert_eq!(file("-Y 1 +X 300", &new).unwrap(), flat);
    let reason = |resolution: &str, data: &[u8]| file(resolution, data).unwrap_err().to_string();
    assert_eq!(reason("-Y 1 +X 301", &new), "row 0: its length is not the picture's width");
    assert_eq!(
        reason("-Y 2 +X 300", &new),
        "the file ends within its pixels: row 1 of 2 is incomplete"
    );
    assert_eq!(reason("-Y 1 +X 9", &[2, 2, 0, 9, 138, 7]), "row 0: a run goes past its end");
    assert_eq!(reason("-Y 1 +X 9", &[1, 1, 1, 9]), "row 0: it begins with a run");
    let long: Vec<u8> = [a, [1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 1]].concat();
    assert_eq!(reason("-Y 1 +X 9", &long), "row 0: a run is longer than any row");
}

#[test]
fn exposures_multiply_and_one_of_nothing_is_named() {
    let read = |header: &str| {
        let mut bytes = format!("#?RADIANCE\n{header}\n\n-Y 1 +X 1\n").into_bytes();
        bytes.extend([128, 128, 128, 129]);
        Picture::decode(&bytes, Format::Hdr)
    };
    let plain = read("SOFTWARE=Radiance").unwrap();
    assert_eq!(read("EXPOSURE=2\nEXPOSURE=0.5").unwrap(), plain);
    let error = read("EXPOSURE=2\nEXPOSURE=0").unwrap_err().to_string();
    assert!(error.contains("EXPOSURE=0 must be a positive number"), "{error}");
    // Without a line, and with our own, colours stay as they are. Greys stay in any primaries.
    let ours = "PRIMARIES= 0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329";
    let radiance = "PRIMARIES= .640 .330 .290 .600 .150 .060 .333 .333";
    assert_eq!(read(ours).unwrap(), plain);
    let grey = read(radiance).unwrap().pixels[0];
    for (channel, wanted) in grey.into_iter().zip(plain.pixels[0]) {
        assert!((channel / wanted - 1.0).abs() < 1e-5, "{grey:?}");
    }
    for bad in ["PRIMARIES= 1 2 3", "PRIMARIES= .3 .3 .3 .3 .3 .3 .3 .3", "PRIMARIES= a"] {
        assert!(read(bad).unwrap_err().to_string().contains("PRIMARIES="), "{bad}");
    }
}

#[test]
fn pictures_in_other_primaries_are_converted_in_hdr_and_exr_alike() {
    // Pure green of a wide gamut has more green than Rec. 709 has, and no red.
    let wide = [0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329];
    let numbers = wide.map(|number: f64| number.to_string()).join(" ");
    let mut bytes = format!("#?RADIANCE\nPRIMARIES= {numbers}\n\n-Y 1 +X 2\n").into_bytes();
    bytes.extend([0, 128, 0, 129, 128, 0, 0, 129]);
    let hdr = Picture::decode(&bytes, Format::Hdr).unwrap();
    let exr = {
        use exr::prelude::*;
        let colour =
            |at: Vec2<usize>| if at.x() == 0 { (0.0f32, 1.0f32, 0.0f32) } else { (1.0, 0.0, 0.0) };
        let mut image = Image::from_channels((2, 1), SpecificChannels::rgb(colour));
        let pair = |at: usize| Vec2(wide[at] as f32, wide[at + 1] as f32);
        image.attributes.chromaticities = Some(attribute::Chromaticities {
            red: pair(0),
            green: pair(2),
            blue: pair(4),
            white: pair(6),
        });
        let mut bytes = Vec::new();
        image.write().non_parallel().to_buffered(std::io::Cursor::new(&mut bytes)).unwrap();
        Picture::decode(&bytes, Format::Exr).unwrap()
    };
    for picture in [hdr, exr] {
        let [green, red] = [picture.pixels[0], picture.pixels[1]];
        assert!(green[0] < 0.01 && (green[1] - 1.0).abs() < 0.01, "{green:?}");
        assert!((red[0] - 1.398).abs() < 0.01 && red[1] < 0.01, "{red:?}");
    }
}

#[test]
fn every_file_that_is_written_states_its_primaries() {
    let picture = Picture::from_pixels(1, 1, vec![[1.0, 2.0, 3.0]]).unwrap();
    let header = String::from_utf8_lossy(&picture.encode(Format::Hdr).unwrap()).into_owned();
    assert!(header.contains("\nPRIMARIES= 0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\n"), "{header}");
    let bytes = picture.encode(Format::Exr).unwrap();
    let meta =
        exr::meta::MetaData::read_from_buffered(std::io::Cursor::new(&bytes), false).unwrap();
    let stated = meta.headers[0].shared_attributes.chromaticities.unwrap();
    assert_eq!((stated.red.x(), stated.green.y(), stated.white.x()), (0.64, 0.6, 0.3127));
    assert_eq!(Picture::decode(&bytes, Format::Exr).unwrap().pixels, picture.pixels);
}

#[test]
fn exr_files_show_the_same_picture_whatever_their_order_of_lines_and_channels() {
    use exr::prelude::*;
    let encode = |order: LineOrder, names: &[&str]| {
        // Rows are 1 2 over 3 4. Channels A, B, G, R are 0.25, 3, 2 and 1 times that.
        let value = |name: &str| match name {
            "A" => 0.25f32,
            "B" => 3.0,
            "G" => 2.0,
            _ => 1.0,
        };
        let channel = |name: &&str| {
            let samples = [1.0, 2.0, 3.0, 4.0].map(|pixel| value(name) * pixel).to_vec();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort(names.iter().map(channel).collect());
        let encoding = Encoding {
            compression: Compression::Uncompressed,
            blocks: Blocks::ScanLines,
            line_order: order,
        };
        let layer = Layer::new((2, 2), LayerAttributes::default(), encoding, channels);
        let mut bytes = Vec::new();
        Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(std::io::Cursor::new(&mut bytes))
            .unwrap();
        Picture::decode(&bytes, Format::Exr).unwrap().pixels
    };
    let wanted: Vec<[f32; 3]> = [1.0, 2.0, 3.0, 4.0].map(|v| [v, 2.0 * v, 3.0 * v]).to_vec();
    for order in [LineOrder::Increasing, LineOrder::Decreasing] {
        for names in [&["R", "G", "B"][..], &["A", "B", "G", "R"]] {
            assert_eq!(encode(order, names), wanted, "{order:?} {names:?}");
        }
        let grey: Vec<[f32; 3]> = [1.0, 2.0, 3.0, 4.0].map(|v| [v; 3]).to_vec();
        // The only channel of a file is grey whatever its name, such as a depth.
        for name in ["Y", "depth.V"] {
            assert_eq!(encode(order, &[name]), grey, "{order:?} {name}");
        }
    }
}

#[test]
fn all_eight_orientations_show_the_same_picture() {
    // Pixels are identified by their exponents: 1 2 3 over 4 5 6.
    let wanted = file_of("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]);
    assert_eq!((wanted.width, wanted.height), (3, 2));
    assert!(wanted.pixels.is_sorted_by(|a, b| a[0] < b[0]));
    for (resolution, order) in [
        ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
        ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
        ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
        ("+X 3 -Y 2", [1, 4, 2, 5, 3, 6]),
        ("+X 3 +Y 2", [4, 1, 5, 2, 6, 3]),
        ("-X 3 -Y 2", [3, 6, 2, 5, 1, 4]),
        ("-X 3 +Y 2", [6, 3, 5, 2, 4, 1]),
    ] {
        assert_eq!(file_of(resolution, order), wanted, "{resolution}");
    }
}

fn file_of(resolution: &str, exponents: [u8; 6]) -> Picture {
    let mut bytes = format!("#?RADIANCE\n\n{resolution}\n").into_bytes();
    bytes.extend(exponents.iter().flat_map(|e| [128, 128, 128, 120 + e]));
    Picture::decode(&bytes, Format::Hdr).unwrap()
}

#[test]
fn a_written_hdr_has_the_bytes_that_radiance_expects() {
    // By Radiance's setcolr, 1 is 128 with exponent 129, and 0.75 0.3 0.1 is 192 76 25 with 128. A
    // run of 5, then a literal of 3.
    let mut pixels = vec![[1.0, 0.5, 0.25]; 5];
    pixels.extend([[0.75, 0.3, 0.1], [0.0; 3], [3.0, 0.0, 1.5]]);
    let mut picture = Picture::from_pixels(8, 1, pixels).unwrap();
    let view =
        View::new(DVec3::new(1.0, 2.0, 3.0), DVec3::Y, DVec3::Z, Some(60.0), Some(45.0), (8, 1))
            .unwrap();
    picture.view = Some(view);
    let header = "#?RADIANCE\nSOFTWARE=Holodeck\nPRIMARIES= 0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\nVIEW= -vtv -vp 1 2 3 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 45 -vo 0 -va 0 -vs 0 \
                  -vl 0\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n";
    let mut wanted = header.as_bytes().to_vec();
    wanted.extend_from_slice(&[2, 2, 0, 8]);
    wanted.extend_from_slice(&[133, 128, 3, 192, 0, 192]);
    wanted.extend_from_slice(&[133, 64, 3, 76, 0, 0]);
    wanted.extend_from_slice(&[133, 32, 3, 25, 0, 96]);
    wanted.extend_from_slice(&[133, 129, 3, 128, 0, 130]);
    assert_eq!(picture.encode(Format::Hdr).unwrap(), wanted);
}

#[test]
fn pfm_rows_run_from_the_bottom_in_either_byte_order_and_scaled() {
    let values = [1.0f32, 2.0, 3.0, 4.0];
    let file = |header: &str, bytes: [[u8; 4]; 4]| {
        let bytes: Vec<u8> = header.bytes().chain(bytes.into_iter().flatten()).collect();
        Picture::decode(&bytes, Format::Pfm)
    };
    let wanted: Vec<[f32; 3]> = [3.0, 4.0, 1.0, 2.0].map(|v| [v; 3]).to_vec();
    let little = file("Pf\n2 2\n-1.0\n", values.map(f32::to_le_bytes)).unwrap();
    assert_eq!(little.pixels, wanted);
    assert_eq!(file("Pf\n2 2\n1\n", values.map(f32::to_be_bytes)).unwrap(), little);
    assert_eq!(file("Pf 2\n2 -0.5\n", values.map(|v| (2.0 * v).to_le_bytes())).unwrap(), little);
    let reason = |header: &str| file(header, [[0; 4]; 4]).unwrap_err().to_string();
    assert_eq!(
        reason("PF\n2 2\n-1\n"),
        "the file ends within its pixels: row 0 of 2 is incomplete"
    );
    assert_eq!(reason("Pf\n2 2\n0\n"), "header: scale 0 must be finite and not 0");
    assert_eq!(reason("Pf\n2 two\n-1\n"), "header: height `two` is not a number");
    assert!(reason("Pf\n0 2\n-1\n").starts_with("0x2 pixels: each side must be"));
    assert!(reason("P6\n2 2\n255\n").starts_with("header: `P6`"));
}

#[test]
fn exr_files_of_other_programs_are_read_unless_their_compression_is_unsafe() {
    use exr::prelude::*;
    let colour = |at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.5f32);
    let file = |compression: Compression, blocks: Blocks| {
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let channels = SpecificChannels::rgb(colour);
        let mut bytes = Vec::new();
        let layer = Layer::new((37, 21), LayerAttributes::default(), encoding, channels);
        Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(std::io::Cursor::new(&mut bytes))
            .unwrap();
        Picture::decode(&bytes, Format::Exr)
    };
    let tiles = Blocks::Tiles(Vec2(16, 8));
    for compression in
        [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::PIZ]
    {
        for blocks in [Blocks::ScanLines, tiles] {
            let picture = file(compression, blocks).unwrap();
            assert_eq!((picture.size(), picture.get(36, 20)), ((37, 21), Some([36.0, 20.0, 0.5])));
        }
    }
    for compression in [Compression::B44, Compression::DWAA(None)] {
        let message = file(compression, Blocks::ScanLines).unwrap_err().to_string();
        assert!(message.ends_with("cannot be read: save it as ZIP or PIZ"), "{message}");
    }
}

#[test]
fn files_are_written_whole_and_errors_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut picture = with_view(Picture::new(9, 7));
    picture.pixels[10] = [0.5, 1.0, 2.0];
    for name in ["a.hdr", "a.pic", "a.pfm", "a.exr", "a.EXR"] {
        picture.write(path(name)).unwrap();
        let again = Picture::read(path(name)).unwrap();
        assert!(again.pixels[10][2] > again.pixels[10][1] && again.pixels[9] == [0.0; 3], "{name}");
        assert_eq!(again.view.is_some(), name != "a.pfm", "{name}");
    }
    picture.write(path("a.png")).unwrap();
    assert!(matches!(file_error(Picture::read(path("a.png"))), PictureError::PngIsNotRadiance));
    // The first bytes decide, not the name.
    fs::rename(path("a.exr"), path("b.hdr")).unwrap();
    assert_eq!(Picture::read(path("b.hdr")).unwrap(), picture);

    let before = fs::read(path("a.pfm")).unwrap();
    let mut broken = picture.clone();
    broken.pixels.pop();
    assert!(matches!(file_error(broken.write(path("a.pfm"))), PictureError::PixelCount { .. }));
    assert_eq!(fs::read(path("a.pfm")).unwrap(), before);
    // A folder has the name: renaming fails, and no file is left behind.
    fs::create_dir(path("taken.pfm")).unwrap();
    assert!(matches!(file_error(picture.write(path("taken.pfm"))), PictureError::Io(_)));
    assert!(
        !fs::read_dir(folder.path()).unwrap().any(|e| e
            .unwrap()
            .file_name()
            .to_string_lossy()
            .ends_with(".tmp"))
    );

    assert!(matches!(file_error(picture.write(path("a.jpg"))), PictureError::UnknownExtension(_)));
    assert!(matches!(file_error(picture.write(path("none/a.pfm"))), PictureError::Io(_)));
    fs::write(path("text.pfm"), "hello").unwrap();
    assert!(matches!(file_error(Picture::read(path("text.pfm"))), PictureError::UnknownFormat));
    let message = Picture::read(path("missing.hdr")).unwrap_err().to_string();
    assert!(message.contains("missing.hdr: "), "{message}");
}

fn file_error<T: std::fmt::Debug>(result: Result<T, PictureError>) -> PictureError {
    match result.unwrap_err() {
        PictureError::File { error, .. } => *error,
        other => panic!("{other} names no file"),
    }
}

#[test]
fn a_png_shows_rows_from_the_top_in_srgb() {
    let mut picture = Picture::new(2, 2);
    picture.pixels = vec![[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3], [1.0; 3]];
    let bytes = picture.encode(Format::Png).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height, info.color_type), (2, 2, png::ColorType::Rgb));
    assert!(pixels[0] > 100 && pixels[1..9].iter().all(|byte| *byte == 0));
    assert!(pixels[9] == pixels[0] && pixels[10] == pixels[0] && pixels[11] == pixels[0]);
}

#[test]
fn sizes_are_bounded() {
    assert!(Picture::check_size(640, 480).is_ok());
    for (width, height) in [(0, 1), (1, 0), (MAX_SIDE + 1, 1), (MAX_SIDE, MAX_SIDE)] {
        assert!(matches!(Picture::check_size(width, height), Err(PictureError::Size { .. })));
    }
    let header = format!("#?RADIANCE\n\n-Y {MAX_SIDE} +X {MAX_SIDE}\n");
    assert!(matches!(
        Picture::decode(header.as_bytes(), Format::Hdr),
        Err(PictureError::Size { .. })
    ));
    assert!(matches!(
        Picture::decode(b"PF 60000 60000 -1 ", Format::Pfm),
        Err(PictureError::Size { .. })
    ));
}
