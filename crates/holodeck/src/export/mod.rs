//! Exports a holodeck as static files that draw it: a page, a script, and splats in pieces.
//!
//! Any web server serves the folder; nothing is loaded from elsewhere. The page checks every piece
//! against the manifest in it.

mod manifest;
mod piece;
mod surfaces;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use base64::{Engine, prelude::BASE64_STANDARD};
use holo_server::Holodeck;
use serde::Serialize;

use crate::{
    prepare::SMALL_CACHE,
    splats::{self, SplatReport, SplatRequest},
};
use manifest::Manifest;
use piece::Piece;

const PAGE: &str = include_str!("site/index.html");
const STYLE: &str = include_str!("site/site.css");
const SCRIPT: &str = concat!(
    include_str!("site/surfaces.js"),
    include_str!("site/headset.js"),
    include_str!("site/site.js")
);

/// Length of a piece: four chunks. Four pieces are a whole coarse picture.
const PIECE_BYTES: usize = 1 << 18;

/// Most splats of an export, unless stated: less than 25 MB with the surfaces of a house.
const MOST: u64 = 1_700_000;

/// Samples for each splat of an export that is drawn by splats alone. Its page is mostly seen from
/// closer than splats are far apart, so noise is left to smoothing.
const SAMPLES_PER_SPLAT: u64 = 2;

/// Samples for each splat that lights surfaces. Edges and colours are sharp without splats, so they
/// need only be as fine as their light is known. With 3, pictures of the bundled house are noisier,
/// with 17 more blurred, and both are less like the program's own.
const SAMPLES_PER_LIGHT: u64 = 7;

/// Fewest splats, unless stated, of files that have as many samples.
const LEAST: u64 = 50_000;

/// What to export.
#[derive(Clone, Debug)]
pub struct ExportRequest {
    /// The holodeck.
    pub file: PathBuf,
    /// The folder to make, or the file if `is_single`.
    pub output: PathBuf,
    /// True for one HTML file with everything in it.
    pub is_single: bool,
    /// Most splats.
    pub most: Option<u64>,
}

/// What was exported.
#[derive(Clone, Debug, Serialize)]
pub struct ExportReport {
    /// The folder or file.
    pub export: PathBuf,
    /// Length of everything.
    pub bytes: u64,
    /// Number of files.
    pub files: usize,
    /// The splats in it.
    pub splats: SplatReport,
    /// How it differs from the holodeck.
    pub notes: Vec<String>,
}

/// Exports a holodeck. Calls `progress` with the share of samples that are placed.
///
/// # Errors
/// If the holodeck cannot be read or has no sample on a surface, the folder has files in it, or
/// something cannot be written.
pub fn export(request: &ExportRequest, progress: &mut dyn FnMut(f64)) -> Result<ExportReport> {
    let output = &request.output;
    let is_free = match request.is_single {
        true => !output.is_dir(),
        false => !output.exists() || fs::read_dir(output).is_ok_and(|mut all| all.next().is_none()),
    };
    ensure!(is_free, "{} has something in it: name another place, or empty it", output.display());
    let holodeck = Holodeck::open_read_only(&request.file, SMALL_CACHE)?;
    let samples = holodeck.file.stats().samples;
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let raycaster = splats::raycaster(&holodeck)?;
    let scene = raycaster.as_ref().map(|raycaster| raycaster.scene());
    let obstacle =
        scene.map_or(Some("the file has no scene".to_owned()), |scene| surfaces::obstacle(scene));
    let draws_surfaces = obstacle.is_none();
    let samples_each = if draws_surfaces { SAMPLES_PER_LIGHT } else { SAMPLES_PER_SPLAT };
    let (report, tree) = splats::make_of(
        &SplatRequest {
            file: request.file.clone(),
            output: folder.path().join("export.splats"),
            spacing: None,
            most: Some(
                request
                    .most
                    .unwrap_or_else(|| (samples / samples_each).clamp(LEAST.min(samples), MOST)),
            ),
            ignores_scene: false,
        },
        &holodeck,
        raycaster.as_ref(),
        draws_surfaces,
        progress,
    )?;
    let splats = splats::open(&report.splats, Some(&holodeck))?;
    let bytes = fs::read(&report.splats)?;
    let mut data: Vec<&[u8]> = bytes[splats.header().nodes_at()..].chunks(PIECE_BYTES).collect();
    let mut manifest = Manifest::new(&holodeck, &splats, &report, &data)?;
    let (origin, unit) = (splats.header().origin, splats.header().unit);
    let surfaces = raycaster.as_ref().filter(|_| draws_surfaces);
    let surfaces =
        surfaces.map(|raycaster| surfaces::drawn_surfaces(raycaster, origin, unit, &tree.colours));
    if let Some((_, bytes)) = surfaces.as_ref() {
        data.extend(bytes.iter().map(Vec::as_slice));
    }
    manifest.add_surfaces(surfaces.as_ref().map(|(surfaces, _)| surfaces), obstacle);
    let written = match request.is_single {
        true => write_single(output, &manifest, &data)?,
        false => write_folder(output, &manifest, &data)?,
    };
    Ok(ExportReport {
        export: output.clone(),
        bytes: written.iter().sum(),
        files: written.len(),
        splats: report,
        notes: manifest.notes.clone(),
    })
}

/// Returns the page with its parts in their places.
fn page(manifest: &Manifest, style: &str, data: &str, script: &str) -> Result<String> {
    // A name with `</script>` in it must not end the element.
    let json = serde_json::to_string(manifest)?.replace('<', "\\u003c");
    let page = PAGE.replace("<!--style-->", style).replace("<!--script-->", script);
    Ok(page.replace("<!--data-->", data).replace("<!--manifest-->", &json))
}

/// Writes a folder. Returns the length of each file.
fn write_folder(folder: &Path, manifest: &Manifest, data: &[&[u8]]) -> Result<Vec<u64>> {
    let style = "<link rel=\"stylesheet\" href=\"site.css\">";
    let page = page(manifest, style, "", "<script src=\"site.js\"></script>")?;
    let pieces = manifest.all_pieces().zip(data);
    // The page goes last: a folder with one is complete.
    let files = pieces.map(|(piece, bytes)| (piece.file.as_str(), *bytes)).chain([
        ("site.css", STYLE.as_bytes()),
        ("site.js", SCRIPT.as_bytes()),
        ("index.html", page.as_bytes()),
    ]);
    fs::create_dir_all(folder.join(Piece::FOLDER))
        .with_context(|| format!("making {}", folder.display()))?;
    let write = |(name, bytes): (&str, &[u8])| {
        let path = folder.join(name);
        fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
        Ok(bytes.len() as u64)
    };
    files.map(write).collect()
}

/// Writes one file. Returns its length.
fn write_single(path: &Path, manifest: &Manifest, data: &[&[u8]]) -> Result<Vec<u64>> {
    let piece = |(piece, bytes): (&Piece, &&[u8])| {
        let text = BASE64_STANDARD.encode(bytes);
        format!("<script type=\"text/plain\" id=\"{}\">{text}</script>\n", piece.file)
    };
    let data: String = manifest.all_pieces().zip(data).map(piece).collect();
    let (style, script) =
        (format!("<style>\n{STYLE}</style>"), format!("<script>\n{SCRIPT}</script>"));
    let page = page(manifest, &style, &data, &script)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let draft = tempfile::Builder::new()
        .prefix(".export-")
        .tempfile_in(folder.unwrap_or(Path::new(".")))
        .and_then(|draft| fs::write(draft.path(), &page).map(|()| draft))
        .with_context(|| format!("writing {}", path.display()))?;
    draft.persist(path).with_context(|| format!("writing {}", path.display()))?;
    Ok(vec![page.len() as u64])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_site_is_small_and_loads_nothing_from_elsewhere() {
        for part in [PAGE, STYLE, SCRIPT] {
            assert!(part.len() < 100_000);
            assert!(!part.contains("http:") && !part.contains("https:"));
        }
        for place in ["<!--style-->", "<!--script-->", "<!--data-->", "<!--manifest-->"] {
            assert_eq!(PAGE.matches(place).count(), 1, "{place}");
        }
    }
}
