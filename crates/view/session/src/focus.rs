//! Concentrates tracing on a part of the picture that a person has chosen.

use holo_display::{FrameRequest, SelectOptions, select_beams};
use holo_picture::{View, ViewKind, ViewSpec};
use holo_proto::bulk::RequestedBeam;
use holo_section::{BeamKey, Section};
use rustc_hash::FxHashSet;

/// Factor on the weight of beams outside the part.
const OUTSIDE: f32 = 0.02;

/// Lowers the weights of beams that do not cross a part of the picture. `part` is its left, top,
/// right and bottom in shares of the picture.
pub fn concentrate(
    sections: &[Section],
    look: &FrameRequest,
    part: [f64; 4],
    beams: &mut [RequestedBeam],
) {
    let Some((view, size)) = cropped(&look.view, look.size, part) else { return };
    let selected = select_beams(sections, &view, size, &SelectOptions::default()).beams;
    let inside: FxHashSet<BeamKey> = selected.into_iter().map(|beam| beam.key).collect();
    for beam in beams.iter_mut().filter(|beam| !inside.contains(&beam.key)) {
        beam.weight *= OUTSIDE;
    }
}

/// Returns the view of a part of a perspective picture, and the part's size in pixels. `None` for
/// other types of view.
fn cropped(view: &View, size: (u32, u32), part: [f64; 4]) -> Option<(View, (u32, u32))> {
    if view.kind != ViewKind::Perspective {
        return None;
    }
    let [left, top, right, bottom] = part;
    let (across, along) = (right - left, bottom - top);
    let (width, height) = view.extent();
    let angle = |side: f64| 2.0 * (0.5 * side).atan().to_degrees();
    let spec = ViewSpec {
        vp: Some(view.vp),
        vd: Some(view.vd),
        vu: Some(view.vu),
        vh: Some(angle(width * across)),
        vv: Some(angle(height * along)),
        // Shifts are in multiples of the part's size.
        vs: Some((left + 0.5 * across - 0.5 + view.vs) / across),
        vl: Some((0.5 - top - 0.5 * along + view.vl) / along),
        ..ViewSpec::default()
    };
    let pixels = |side: u32, share: f64| ((f64::from(side) * share).round() as u32).max(1);
    spec.resolve((pixels(size.0, across), pixels(size.1, along))).ok()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn the_view_of_a_part_has_the_same_rays_as_the_picture_there() {
        let size = (640, 360);
        let (eye, ahead) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.2, 1.0, -0.1));
        let view = View::new(eye, ahead, DVec3::Z, Some(70.0), None, size).unwrap();
        let part = [0.1, 0.25, 0.4, 0.75];
        let (cut, pixels) = cropped(&view, size, part).unwrap();
        assert_eq!(pixels, (192, 180));
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.8), (1.0, 1.0)] {
            let (_, own) = cut.ray(x, y);
            let (across, up) = (part[0] + x * (part[2] - part[0]), 1.0 - part[3] + y * 0.5);
            let (_, whole) = view.ray(across, up);
            assert!((own - whole).length() < 1e-9, "{x} {y}: {own} {whole}");
        }
    }
}
