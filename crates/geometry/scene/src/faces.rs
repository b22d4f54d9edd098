//! The line and the material of each triangle of an OBJ file.
//!
//! Invariant: runs are in the order of their triangles, and each has at least one face.

/// Faces on consecutive lines with the same material and number of corners, as most are.
struct FaceRun {
    /// The first triangle of the first face.
    triangle: u32,
    triangles_per_face: u32,
    /// The line of the first face.
    line: usize,
    material: u32,
}

/// The line and the material of every triangle.
#[derive(Default)]
pub(crate) struct Faces {
    runs: Vec<FaceRun>,
    triangles: usize,
}

impl Faces {
    /// Returns the number of triangles of all faces.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles
    }

    /// Adds a face of at least one triangle. There are at most [`crate::limits::MAX_TRIANGLES`].
    pub(crate) fn push(&mut self, triangles: usize, line: usize, material: u32) {
        let continues = |run: &FaceRun| {
            let faces = (self.triangles - run.triangle as usize) / run.triangles_per_face as usize;
            run.triangles_per_face as usize == triangles
                && run.material == material
                && run.line + faces == line
        };
        if !self.runs.last().is_some_and(continues) {
            let (triangle, triangles_per_face) = (self.triangles as u32, triangles as u32);
            self.runs.push(FaceRun { triangle, triangles_per_face, line, material });
        }
        self.triangles += triangles;
    }

    /// Returns the line of a triangle's face; `None` if there is no such face.
    pub(crate) fn line(&self, triangle: usize) -> Option<usize> {
        let after = self.runs.partition_point(|run| run.triangle as usize <= triangle);
        let run = &self.runs[after.checked_sub(1)?];
        Some(run.line + (triangle - run.triangle as usize) / run.triangles_per_face as usize)
    }

    /// Returns the material of each triangle.
    pub(crate) fn material_ids(&self) -> Vec<u32> {
        let mut ids = Vec::with_capacity(self.triangles);
        let ends =
            self.runs.iter().skip(1).map(|run| run.triangle as usize).chain([self.triangles]);
        for (run, end) in self.runs.iter().zip(ends) {
            ids.resize(end, run.material);
        }
        ids
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn similar_faces_on_consecutive_lines_are_one_run() {
        let mut faces = Faces::default();
        (10..1010).for_each(|line| faces.push(2, line, 7));
        assert_eq!((faces.runs.len(), faces.triangles(), faces.line(1999)), (1, 2000, Some(1009)));
    }

    proptest! {
        #[test]
        fn lines_and_materials_are_those_of_a_list(pushed in prop::collection::vec((1usize..4, 1usize..3, 0u32..2), 0..60)) {
            let (mut faces, mut lines, mut ids, mut line) = (Faces::default(), Vec::new(), Vec::new(), 0);
            for (triangles, step, material) in pushed {
                line += step;
                faces.push(triangles, line, material);
                lines.extend(std::iter::repeat_n(line, triangles));
                ids.extend(std::iter::repeat_n(material, triangles));
            }
            prop_assert_eq!((0..faces.triangles()).filter_map(|t| faces.line(t)).collect::<Vec<_>>(), lines);
            prop_assert_eq!(faces.material_ids(), ids);
        }
    }
}
