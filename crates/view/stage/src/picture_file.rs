//! Writes ordered pictures as files, band by band.

use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::Path,
};

use anyhow::{Context, Result, anyhow, bail};
use holo_picture::{Format, Image, Look, Picture, PngRows, RadianceRows, View};
use tokio::sync::mpsc::Receiver;

use super::picture_order::{BegunPicture, PictureNews, PictureWish};
use crate::screen::on_screen_threads;

/// Most pixels of a picture that is whole in memory before it is written: those of `.pfm`, whose
/// rows begin at the bottom, and those with the tone `human`, which makes each pixel from all.
const WHOLE_PIXELS: u64 = 1 << 24;

/// Why a picture ends before its last row.
const ENDED: &str = "the picture was not drawn to its end";

/// Returns why a picture cannot have a format, or `None` if it can.
pub fn format_refusal(format: Format, look: &Look, size: (u32, u32)) -> Option<String> {
    let reason = match format {
        Format::Png if look.shows_by_bands() => return None,
        Format::Png => "the tone Human makes each pixel from all",
        Format::Pfm => "the rows of a .pfm begin at the bottom",
        _ => return None,
    };
    let pixels = u64::from(size.0) * u64::from(size.1);
    (pixels > WHOLE_PIXELS).then(|| {
        let most = WHOLE_PIXELS / 1_000_000;
        format!(
            "{reason}, so it has at most {most} million pixels: choose another or a smaller one"
        )
    })
}

/// Encodes a picture that has begun, radiance or with a look, as the bytes of a file. Blocks.
///
/// # Errors
/// If the picture is not drawn to its end, cannot have this format, or `out` fails.
pub fn encode_picture(
    mut out: impl Write + 'static,
    format: Format,
    look: &Look,
    begun: BegunPicture,
    news: &mut Receiver<PictureNews>,
) -> Result<()> {
    let BegunPicture { view, size, preview } = begun;
    if let Some(reason) = format_refusal(format, look, size) {
        bail!(reason);
    }
    match format {
        Format::Hdr | Format::Exr => {
            let mut rows = RadianceRows::begin(out, format, size, Some(&view))?;
            for_bands(news, |band| Ok(rows.write(&band)?))?;
            rows.finish().context(ENDED)?.flush()?;
        }
        Format::Png => match look.bands(&preview, size) {
            Some(mut bands) => {
                let mut rows = PngRows::begin(out, bands.size())?;
                let show = |band: Vec<_>| Ok(rows.write(&on_screen_threads(|| bands.show(&band)))?);
                for_bands(news, show)?;
                rows.finish().context(ENDED)?;
            }
            None => {
                let picture = whole(news, view, size)?;
                let image: Image = on_screen_threads(|| look.show(&picture)).with_legend();
                out.write_all(&image.png()?)?;
                out.flush()?;
            }
        },
        format => {
            out.write_all(&whole(news, view, size)?.encode(format)?)?;
            out.flush()?;
        }
    }
    Ok(())
}

/// Writes an ordered picture to a file; the extension determines the format. The file appears whole
/// or not at all. Blocks.
///
/// # Errors
/// The errors of [`encode_picture`], an unknown extension, or a failure of the disk.
pub fn write_picture(
    path: &Path,
    mut news: Receiver<PictureNews>,
    _wish: PictureWish,
) -> Result<()> {
    let format =
        Format::of_path(path).context("the name ends in .png, .hdr, .pic, .exr or .pfm")?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let name = path.file_name().context("the name of a file is missing")?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.tmp", std::process::id()));
    let hidden = folder.unwrap_or(Path::new(".")).join(hidden);
    let file = File::create(&hidden)?;
    let out = BufWriter::new(file.try_clone()?);
    let begun = match news.blocking_recv() {
        Some(PictureNews::Begun(begun)) => Ok(*begun),
        Some(PictureNews::Refused(reason)) => Err(anyhow!(reason)),
        Some(PictureNews::Band(_)) | None => Err(anyhow!(ENDED)),
    };
    let written = begun
        .and_then(|begun| encode_picture(out, format, &Look::default(), begun, &mut news))
        .and_then(|()| Ok(file.sync_all()?))
        .and_then(|()| Ok(fs::rename(&hidden, path)?));
    if written.is_err() {
        // The first error is reported.
        let _ = fs::remove_file(&hidden);
    }
    written
}

/// Takes all bands.
fn for_bands(
    news: &mut Receiver<PictureNews>,
    mut take: impl FnMut(Vec<[f32; 3]>) -> Result<()>,
) -> Result<()> {
    while let Some(next) = news.blocking_recv() {
        match next {
            PictureNews::Band(band) => take(band)?,
            PictureNews::Refused(reason) => bail!(reason),
            PictureNews::Begun(_) => bail!(ENDED),
        }
    }
    Ok(())
}

/// Takes the whole picture.
fn whole(news: &mut Receiver<PictureNews>, view: View, size: (u32, u32)) -> Result<Picture> {
    let mut all = Vec::new();
    for_bands(news, |band| {
        all.extend(band);
        Ok(())
    })?;
    let mut picture = Picture::from_pixels(size.0, size.1, all).context(ENDED)?;
    picture.view = Some(view);
    Ok(picture)
}
