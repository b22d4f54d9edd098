//! Reads the examples' input from a file, and the processor's clock.

use holo_beamfile::{BeamFile, BeamSamples};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::{BeamKey, Section, SectionSpec};
use rustix::time::{ClockId, clock_gettime};
use std::sync::Arc;

/// Columns and rows of a picture without a given size.
const SIZE: (u32, u32) = (1280, 720);

#[derive(serde::Deserialize)]
struct About {
    sections: Vec<SectionSpec>,
    views: Vec<(String, String)>,
}

/// A file's scene, sections, samples and one of its views.
pub struct Stored {
    pub raycaster: Arc<Raycaster>,
    pub sections: Arc<[Section]>,
    pub beams: Vec<(BeamKey, Arc<BeamSamples>)>,
    pub view: View,
    pub size: (u32, u32),
}

impl Stored {
    /// Reads everything from the file at `path`. `view` is the name of one of the file's views, or
    /// Radiance's options. A size may follow, as in `living@320x240`.
    pub fn read(path: &str, view: &str) -> Stored {
        let file = BeamFile::open_read_only(path, 1 << 30).unwrap();
        let about: About =
            serde_json::from_slice(&file.blob("holodeck").unwrap().unwrap()).unwrap();
        let scene = Arc::new(Scene::unpack(&file.blob("scene").unwrap().unwrap()).unwrap());
        let mut keys: Vec<BeamKey> = Vec::new();
        file.for_each_beam(&mut |key, _| keys.push(key));
        let (view, size) = match view.split_once('@') {
            Some((view, size)) => {
                let (width, height) = size.split_once('x').unwrap();
                (view, (width.parse().unwrap(), height.parse().unwrap()))
            }
            None => (view, SIZE),
        };
        let named = about.views.iter().find(|(name, _)| name == view);
        let spec = named.map_or(view, |(_, spec)| spec);
        let (view, size) = View::parse_vf(spec).unwrap().resolve(size).unwrap();
        Stored {
            raycaster: Arc::new(Raycaster::build(scene).unwrap()),
            sections: about.sections.into_iter().map(|spec| Section::new(spec).unwrap()).collect(),
            beams: keys.iter().map(|&key| (key, file.read(key).unwrap())).collect(),
            view,
            size,
        }
    }
}

/// Returns the processor time so far in seconds, all threads together.
pub fn seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
