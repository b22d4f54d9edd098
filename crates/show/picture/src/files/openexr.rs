//! OpenEXR: R, G and B as 32-bit floats, written with lossless compression. The view is the text
//! attribute `VIEW`. A file with the channel `Y` alone is grey, and so is one with a single channel
//! of any name, such as a depth. Primaries other than ours are converted.
//!
//! Invariant: sizes and channels of the header are bounded before any pixel is decoded.

use super::conversion::converted;
use crate::error::PictureError;
use crate::picture::Picture;
use crate::size::MAX_PIXELS;
use crate::view::View;
use exr::compression::Compression;
use exr::meta::MetaData;
use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AttributeValue, Encoding, Image, Layer, LayerAttributes, ReadChannels, ReadLayers,
    ReadSpecificChannel, SpecificChannels, Text, Vec2, WritableImage,
};
use glam::DMat3;
use holo_color::Primaries;
use std::io::Cursor;

/// Width and pixels.
type Pixels = (usize, Vec<[f32; 3]>);

/// Name of the attribute that holds the view as Radiance's options.
const VIEW: &str = "VIEW";

/// Compressions that are safe for damaged files: a million damaged files of these gave pictures or
/// errors. Others are not. exr 1.74.2 trusts the lengths inside a DWA chunk (a flipped byte
/// requested 4 TB and ended the process). Its B44 decoder overflows on damaged blocks. Newer
/// compressions are untested.
const SAFE: [Compression; 6] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
    Compression::PXR24,
];

/// Most bytes of a layer's pixels, all channels together. A chunk, which is decompressed at once,
/// may be a whole layer.
const MAX_LAYER_BYTES: u64 = MAX_PIXELS * 32;

pub(super) fn encode(picture: &Picture) -> Result<Vec<u8>, PictureError> {
    let width = picture.width as usize;
    let software_name = Some(Text::from("Holodeck"));
    let mut attributes = LayerAttributes { software_name, ..LayerAttributes::default() };
    if let Some(view) = &picture.view {
        let options = AttributeValue::Text(Text::from(view.to_vf_options().as_str()));
        attributes.other.insert(Text::from(VIEW), options);
    }
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = picture.pixels[at.y() * width + at.x()];
        (r, g, b)
    });
    let layer = Layer::new(
        (width, picture.height as usize),
        attributes,
        Encoding::SMALL_LOSSLESS,
        channels,
    );
    let mut bytes = Vec::new();
    let mut image = Image::from_layer(layer);
    let [red, green, blue] = Primaries::REC709.channels.map(chromaticity);
    let white = chromaticity(Primaries::REC709.white);
    image.attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
    image.write().non_parallel().to_buffered(Cursor::new(&mut bytes)).map_err(failed)?;
    Ok(bytes)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let grey = check_header(bytes)?;
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level();
    let blank = |size: Vec2<usize>| (size.width(), vec![[0.0f32; 3]; size.area()]);
    let set = |(width, pixels): &mut Pixels, at: Vec2<usize>, rgb: [f32; 3]| {
        pixels[at.y() * *width + at.x()] = rgb;
    };
    let (size, pixels, attributes, other) = if let Some(grey) = grey {
        let image = reader
            .specific_channels()
            .required(grey)
            .collect_pixels(
                move |size: Vec2<usize>, _: &_| blank(size),
                move |pixels: &mut Pixels, at: Vec2<usize>, (y,): (f32,)| set(pixels, at, [y; 3]),
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(failed)?;
        let layer = image.layer_data;
        (layer.size, layer.channel_data.pixels.1, image.attributes, layer.attributes.other)
    } else {
        let image = reader
            .rgb_channels(
                move |size: Vec2<usize>, _: &_| blank(size),
                move |pixels: &mut Pixels, at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
                    set(pixels, at, [r, g, b]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(failed)?;
        let layer = image.layer_data;
        (layer.size, layer.channel_data.pixels.1, image.attributes, layer.attributes.other)
    };
    let (width, height) = (size.width() as u32, size.height() as u32);
    let mut picture = Picture::from_pixels(width, height, pixels)?;
    if let Some(conversion) = attributes.chromaticities.and_then(conversion) {
        picture.pixels.iter_mut().for_each(|rgb| *rgb = converted(conversion, *rgb));
    }
    if let Some(AttributeValue::Text(options)) = other.get(&Text::from(VIEW)) {
        picture.view = view(&options.to_string(), (width, height));
    }
    Ok(picture)
}

fn chromaticity([x, y]: [f64; 2]) -> Vec2<f32> {
    Vec2(x as f32, y as f32)
}

/// Returns the conversion of a file's primaries to ours. `None` if they are ours, or make no sense,
/// which leaves the pixels usable.
fn conversion(stated: Chromaticities) -> Option<DMat3> {
    let Chromaticities { red, green, blue, white } = stated;
    let [r, g, b, w] = [red, green, blue, white].map(|Vec2(x, y)| [f64::from(x), f64::from(y)]);
    let numbers = [r[0], r[1], g[0], g[1], b[0], b[1], w[0], w[1]];
    Primaries::new(numbers)?.to_rec709()
}

/// Checks that every layer is within the limits and has a safe compression. Returns the channel of
/// a grey picture: `Y` if no layer has colours, or the only channel of the file.
///
/// The library reads the table of chunks before it decodes pixels, so it rejects files that are far
/// too short.
fn check_header(bytes: &[u8]) -> Result<Option<Text>, PictureError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.width(), header.layer_size.height());
        let size = PictureError::Size { width: width as u64, height: height as u64 };
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(size);
        };
        Picture::check_size(width, height)?;
        if !SAFE.contains(&header.compression) {
            let compression = header.compression;
            return Err(PictureError::Exr(format!(
                "{compression} cannot be read: save it as ZIP or PIZ"
            )));
        }
        let layer_bytes =
            u64::from(width) * u64::from(height) * header.channels.bytes_per_pixel as u64;
        if layer_bytes > MAX_LAYER_BYTES {
            return Err(PictureError::Exr(format!(
                "a layer of {layer_bytes} bytes is more than {MAX_LAYER_BYTES}"
            )));
        }
    }
    let channels = || meta.headers.iter().flat_map(|header| &header.channels.list);
    let has = |name: &str| channels().any(|channel| channel.name.eq(name));
    if has("Y") {
        let is_grey = !["R", "G", "B", "RY", "BY"].into_iter().any(has);
        return Ok(is_grey.then(|| Text::from("Y")));
    }
    let only = channels().next().filter(|_| channels().count() == 1);
    Ok(only.map(|channel| channel.name.clone()))
}

/// Returns the view; `None` if it cannot be understood, which leaves the pixels usable.
fn view(options: &str, size: (u32, u32)) -> Option<View> {
    Some(View::parse_vf(options).ok()?.resolve(size).ok()?.0)
}

fn failed(error: exr::error::Error) -> PictureError {
    match error {
        exr::error::Error::Io(error) => PictureError::Io(error),
        other => PictureError::Exr(other.to_string()),
    }
}
