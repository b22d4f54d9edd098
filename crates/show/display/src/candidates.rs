//! Finds the beams whose stored rays can show what a view ray sees.
//!
//! A view ray counts as a whole line. The line may meet a section ahead of the eye, behind it, or
//! around it (Larson & Simmons 1999, §2.1 and Figure 3: views A to D). The stored rays see what the
//! eye sees if nothing stands between the eye and the points where they start. This module cannot
//! check that, and accepts it as the paper does. Reprojection drops samples behind the eye.
//!
//! In a clipped view, the point on the fore clipping surface takes the place of the eye.
//!
//! Invariant: selection and coverage both use this rule, so a section covers a pixel exactly if a
//! beam can be requested for the pixel's ray.

use glam::DVec3;
use holo_picture::View;
use holo_section::{BeamKey, Section};

/// The side of the eye on which a view ray meets a section.
#[derive(Clone, Copy)]
enum RaySide {
    /// The eye is inside the section, or on its wall.
    Around,
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
    /// Distance from the eye to the section along the ray. For a section that contains the eye, it
    /// is the length of the line inside, because the smaller of two such sections has the finer
    /// beams.
    rank_distance: f64,
}

/// Replaces the contents of `found` with the beams of the view ray from `eye` along unit
/// `direction`, best first.
///
/// "The holodeck section grid or grids the viewer is closest to" (§2.4.2): every section that
/// contains the eye, then the nearest section ahead, then the nearest behind.
pub fn candidates(sections: &[Section], eye: DVec3, direction: DVec3, found: &mut Vec<Candidate>) {
    found.clear();
    let (mut ahead, mut behind): (Option<Candidate>, Option<Candidate>) = (None, None);
    for (number, section) in (0..=u16::MAX).zip(sections) {
        let Some(hit) = section.line(eye, direction) else { continue };
        let (side, rank_distance) = if hit.entry_t > 0.0 {
            (RaySide::Ahead, hit.entry_t)
        } else if hit.exit_t < 0.0 {
            (RaySide::Behind, -hit.exit_t)
        } else {
            (RaySide::Around, hit.exit_t - hit.entry_t)
        };
        let candidate = Candidate {
            key: BeamKey { section: number, beam: section.beam(hit.pair) },
            rank_distance,
        };
        let nearest = match side {
            RaySide::Around => {
                found.push(candidate);
                continue;
            }
            RaySide::Ahead => &mut ahead,
            RaySide::Behind => &mut behind,
        };
        // Strictly nearer, so that of equal ones the lower section number stays.
        if nearest.is_none_or(|kept| candidate.rank_distance < kept.rank_distance) {
            *nearest = Some(candidate);
        }
    }
    found.sort_by(|a, b| {
        a.rank_distance.total_cmp(&b.rank_distance).then(a.key.section.cmp(&b.key.section))
    });
    found.extend(ahead);
    found.extend(behind);
}

/// Returns the best beam for a view ray from `eye` along unit `direction`; `None` if the ray meets
/// no section.
pub fn best_beam(sections: &[Section], eye: DVec3, direction: DVec3) -> Option<BeamKey> {
    let mut found = Vec::new();
    candidates(sections, eye, direction, &mut found);
    found.first().map(|best| best.key)
}

/// Returns the section of the best beam for the ray through the picture's middle; `None` if that
/// ray meets no section.
pub fn section_of(sections: &[Section], view: &View) -> Option<u16> {
    let (eye, direction, _) = view.clipped_ray(0.5, 0.5)?;
    let mut found = Vec::new();
    candidates(sections, eye, direction, &mut found);
    found.first().map(|candidate| candidate.key.section)
}

/// Returns whether any section can show what the view ray sees.
///
/// `hint` is the index of the section to try first. The function sets it to the section found.
pub fn is_covered(sections: &[Section], eye: DVec3, direction: DVec3, hint: &mut usize) -> bool {
    if sections.get(*hint).is_some_and(|section| section.line(eye, direction).is_some()) {
        return true;
    }
    let met =
        sections.iter().take(1 << 16).position(|section| section.line(eye, direction).is_some());
    *hint = met.unwrap_or(*hint);
    met.is_some()
}
