//! OpenEXR: R, G and B as 32-bit floats, written with lossless compression. The view is the text
//! attribute `VIEW`.
//!
//! Invariant: sizes and channels of the header are bounded before any pixel is decoded.

use crate::error::PictureError;
use crate::picture::Picture;
use crate::size::MAX_PIXELS;
use crate::view::View;
use exr::compression::Compression;
use exr::meta::MetaData;
use exr::prelude::{
    AttributeValue, Encoding, Image, Layer, LayerAttributes, ReadChannels, ReadLayers,
    SpecificChannels, Text, Vec2, WritableImage,
};
use std::io::Cursor;

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
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(failed)?;
    Ok(bytes)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    check_header(bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size: Vec2<usize>, _: &_| (size.width(), vec![[0.0f32; 3]; size.area()]),
            |(width, pixels): &mut (usize, Vec<[f32; 3]>),
             at: Vec2<usize>,
             (r, g, b): (f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width() as u32, layer.size.height() as u32);
    let mut picture = Picture::from_pixels(width, height, layer.channel_data.pixels.1)?;
    if let Some(AttributeValue::Text(options)) = layer.attributes.other.get(&Text::from(VIEW)) {
        picture.view = view(&options.to_string(), (width, height));
    }
    Ok(picture)
}

/// Checks that every layer is within the limits and has a safe compression.
///
/// The library reads the table of chunks before it decodes pixels, so it rejects files that are far
/// too short.
fn check_header(bytes: &[u8]) -> Result<(), PictureError> {
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
    Ok(())
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
