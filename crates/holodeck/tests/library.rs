//! The library does what the commands do, and returns values.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use holo_net::Shutdown;
use holo_picture::luminance;
use holo_scenes::Bundled;
use holo_view::ViewArgs;
use holodeck::{
    compare::{ComparedPictures, compare},
    config::HolodeckConfig,
    files::{forget, merge},
    fill::{FillRequest, fill},
    info::{info, verify},
    opening::{OpeningRequest, open},
    render::{RenderRequest, WorkLimit, render},
    session::{PictureRequest, picture},
};

const SIZE: (u32, u32) = (40, 30);

/// Writes the bundled box to a folder, and returns its configuration.
fn cornell(folder: &Path) -> HolodeckConfig {
    let written = holo_scenes::write(Bundled::Cornell, folder).unwrap();
    HolodeckConfig::read(&written.config).unwrap()
}

/// Traces this many samples into a file.
async fn fill_with(config: HolodeckConfig, file: PathBuf, samples: u64) -> holo_server::Summary {
    let program = env!("CARGO_BIN_EXE_holodeck").into();
    let mut request = FillRequest::new(program, file, config);
    (request.samples, request.threads) = (Some(samples), Some(1));
    let filled = fill(&request, &Shutdown::new(), |_| {}).await.unwrap();
    filled.expect("nobody has ended it")
}

fn view() -> ViewArgs {
    ViewArgs { size: Some(SIZE), ..ViewArgs::default() }
}

#[test]
fn a_scene_opens_with_sections_and_views() {
    let folder = tempfile::tempdir().unwrap();
    let config = cornell(folder.path());
    let opened = open(&config, OpeningRequest::Sections, true).unwrap();
    assert_eq!(opened.sections.len(), config.section.len());
    assert_eq!(opened.views[0].0, "front");
    assert!(!opened.scene.triangles().is_empty());
    let nothing = open(&HolodeckConfig::default(), OpeningRequest::View, true);
    assert!(nothing.is_err_and(|error| error.to_string().contains("no scene")));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_is_filled_shown_merged_and_emptied() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.holo");
    let summary = fill_with(cornell(folder.path()), file.clone(), 60_000).await;
    // The last packet may be more than what was left to do.
    assert!((60_000..60_021).contains(&summary.added), "{summary:?}");
    let held = info(&file).unwrap();
    assert_eq!(held.samples, summary.samples);
    assert_eq!(held.workers.iter().map(|worker| worker.samples).sum::<u64>(), summary.samples);
    assert_eq!(verify(&file).unwrap(), [""; 0]);

    let request = PictureRequest { file: file.clone(), view: view(), ..Default::default() };
    let (shown, report) = picture(request, Shutdown::new()).await.unwrap().unwrap();
    assert_eq!((shown.width, shown.height), SIZE);
    assert!(report.stored > 0 && report.traced == 0, "{report}");
    let mean = shown.pixels.iter().map(|&pixel| luminance(pixel)).sum::<f32>();
    assert!(mean > 0.0, "the box has a lamp");

    let other = folder.path().join("b.holo");
    let mut parts = Vec::new();
    let each = |part: holodeck::files::MergedPart| parts.push(part.path.to_owned());
    let merged = merge(&other, std::slice::from_ref(&file), each).unwrap();
    assert_eq!((merged.added, parts), (summary.samples, vec![file]));
    let workers: Vec<u16> = held.workers.iter().map(|worker| worker.made_by.id).collect();
    let forgotten = forget(&other, &workers, &[]).unwrap();
    assert_eq!((forgotten.samples, forgotten.left), (summary.samples, 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rendered_picture_is_equal_to_itself_and_has_as_many_paths_as_were_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let request = RenderRequest {
        config: cornell(folder.path()),
        view: view(),
        limit: WorkLimit::Paths(3),
        caches_reflections: false,
        denoiser: None,
        has_depths: false,
        has_errors: true,
        threads: Some(1),
        quiet: true,
    };
    let rendered = render(request, &Shutdown::new()).await.unwrap();
    assert_eq!((rendered.spp, rendered.untraced), ((3, 3), 0));
    assert_eq!(rendered.paths, 3 * u64::from(SIZE.0 * SIZE.1));
    let found = compare(&ComparedPictures {
        picture: &rendered.picture,
        reference: &rendered.picture,
        standard_errors: rendered.errors.as_ref(),
        reference_errors: None,
        before: None,
    });
    let found = found.unwrap();
    assert_eq!(found.worst_block_shown, 0.0);
    assert!(found.bias_99.is_some_and(|width| width > 0.0));
}
