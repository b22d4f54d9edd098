//! Which sections can show what a view ray sees.
//!
//! A view ray is a whole line: it may meet a section in front of the eye, behind it, or around it (Larson & Simmons
//! 1999, §2.1 and Figure 3: views A to D). What the stored rays of the beam so met see is what the eye sees as long as
//! nothing stands between the eye and the point where they start. That cannot be known here, and is accepted as the
//! paper accepts it; a sample whose surface lies behind the eye is dropped when it is reprojected.
//!
//! Rays begin on a view's fore clipping surface: that is what stands for the eye.
//!
//! Invariant: selection and the coverage of a picture use this one rule, so a pixel is covered exactly if some beam
//! could be requested for its ray.

use glam::DVec3;
use holo_picture::View;
use holo_section::{BeamKey, Section};

/// Where a section lies on a view ray.
#[derive(Clone, Copy)]
enum Place {
    /// The eye is inside the section, or on its wall.
    Contains,
    /// The ray enters the section ahead of the eye.
    Ahead,
    /// The ray has left the section before it reaches the eye.
    Behind,
}

/// One beam that a view ray belongs to.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The beam.
    pub key: BeamKey,
    /// How far the section is from the eye along the ray; for a section around the eye, the length of its chord: of
    /// two that contain the eye, the smaller has the finer beams.
    reach: f64,
}

/// Beams of the view ray from `eye` along unit `direction`, best first, into `found` (cleared first).
///
/// "The holodeck section grid or grids the viewer is closest to" (§2.4.2): every section that contains the eye, the
/// nearest ahead and the nearest behind.
pub fn candidates(sections: &[Section], eye: DVec3, direction: DVec3, found: &mut Vec<Candidate>) {
    found.clear();
    let (mut ahead, mut behind): (Option<Candidate>, Option<Candidate>) = (None, None);
    for (number, section) in (0..=u16::MAX).zip(sections) {
        let Some(hit) = section.line(eye, direction) else { continue };
        let (place, reach) = if hit.entry_t > 0.0 {
            (Place::Ahead, hit.entry_t)
        } else if hit.exit_t < 0.0 {
            (Place::Behind, -hit.exit_t)
        } else {
            (Place::Contains, hit.exit_t - hit.entry_t)
        };
        let candidate =
            Candidate { key: BeamKey { section: number, beam: section.beam(hit.pair) }, reach };
        let nearest = match place {
            Place::Contains => {
                found.push(candidate);
                continue;
            }
            Place::Ahead => &mut ahead,
            Place::Behind => &mut behind,
        };
        // Strictly nearer: of equals the lower section number stays.
        if nearest.is_none_or(|kept| candidate.reach < kept.reach) {
            *nearest = Some(candidate);
        }
    }
    found.sort_by(|a, b| a.reach.total_cmp(&b.reach).then(a.key.section.cmp(&b.key.section)));
    found.extend(ahead);
    found.extend(behind);
}

/// Returns the best beam for a view ray from `eye` along unit `direction`.
pub fn best_beam(sections: &[Section], eye: DVec3, direction: DVec3) -> Option<BeamKey> {
    let mut found = Vec::new();
    candidates(sections, eye, direction, &mut found);
    found.first().map(|best| best.key)
}

/// The section that a view is of: the one around the eye, else the one that the picture's middle sees best. `None` if it sees none.
pub fn section_of(sections: &[Section], view: &View) -> Option<u16> {
    let (eye, direction, _) = view.clipped_ray(0.5, 0.5)?;
    let mut found = Vec::new();
    candidates(sections, eye, direction, &mut found);
    found.first().map(|candidate| candidate.key.section)
}

/// Whether any section can show what the view ray sees. `hint` is a section to try first, and is set to the one found.
pub fn is_covered(sections: &[Section], eye: DVec3, direction: DVec3, hint: &mut usize) -> bool {
    if sections.get(*hint).is_some_and(|section| section.line(eye, direction).is_some()) {
        return true;
    }
    let met =
        sections.iter().take(1 << 16).position(|section| section.line(eye, direction).is_some());
    *hint = met.unwrap_or(*hint);
    met.is_some()
}
