//! The mesh: cells of samples, and the triangulation of their vertices.

use crate::cells::{DirectionCells, VertexLight};
use crate::chart::Chart;
use crate::direction::GridDirection;
use crate::triangulation::{BASE, SphereTriangulation};

/// A triangulation whose vertices have light.
pub struct LitMesh {
    /// Directions around the canonical eye.
    pub chart: Chart,
    /// The samples.
    pub cells: DirectionCells,
    /// The triangles.
    pub triangles: SphereTriangulation,
    /// The light of each vertex; `None` for those of the icosahedron alone.
    pub lights: Vec<Option<VertexLight>>,
}

impl LitMesh {
    /// Returns a mesh without samples, with cells of 2^`shift` steps a side.
    pub fn new(chart: Chart, shift: u32) -> LitMesh {
        let (cells, triangles) = (DirectionCells::new(shift), SphereTriangulation::new());
        LitMesh { chart, cells, triangles, lights: vec![None; BASE as usize] }
    }

    /// Brings the triangles up to date with the cells.
    pub fn update(&mut self) {
        let LitMesh { cells, triangles, lights, .. } = self;
        cells.for_changed(|cell| {
            let before = lights.get(*cell.vertex as usize).copied().flatten();
            let is_at = |direction: GridDirection| before.is_some_and(|b| b.direction == direction);
            match cell.light {
                Some(light) if is_at(light.direction) => {
                    lights[*cell.vertex as usize] = Some(light);
                }
                light => {
                    if before.is_some() {
                        lights[*cell.vertex as usize] = None;
                        triangles.remove(*cell.vertex);
                        *cell.vertex = u32::MAX;
                    }
                    if let Some(light) = light {
                        *cell.vertex = triangles.insert(light.direction);
                        lights.resize(triangles.vertex_slots(), None);
                        lights[*cell.vertex as usize] = Some(light);
                    }
                }
            }
        });
    }
}
