//! The part of a packed scene for meshes and their instances.
//!
//! The format is in [`crate::pack`].

use crate::geometry::check_limit;
use crate::instances::{InstanceTable, MeshRange};
use crate::limits::{MAX_INSTANCES, MAX_MESHES};
use crate::pack_values::split;
use crate::placement::Placement;
use crate::{PackedError, Scene, SceneError};
use bytemuck::{Pod, Zeroable};

/// The numbers of positions and triangles of a mesh.
type MeshRecord = [[u8; 4]; 2];

/// An instance, as bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct InstanceRecord {
    mesh: [u8; 4],
    rows: [[[u8; 8]; 4]; 3],
}
const _: () = assert!(size_of::<InstanceRecord>() == 100);

pub(crate) fn pack_instances(shared: &InstanceTable, out: &mut Vec<u8>) {
    out.extend((shared.meshes.len() as u32).to_le_bytes());
    out.extend((shared.instances.len() as u32).to_le_bytes());
    for part in &shared.meshes {
        out.extend((part.positions.len() as u32).to_le_bytes());
        out.extend((part.triangles.len() as u32).to_le_bytes());
    }
    for instance in &shared.instances {
        let mesh = instance.mesh.to_le_bytes();
        let rows = instance.placement.rows().map(|row| row.map(f64::to_le_bytes));
        out.extend_from_slice(bytemuck::bytes_of(&InstanceRecord { mesh, rows }));
    }
}

/// The parts of a scene's arrays, and its instances.
pub(crate) struct Unpacked {
    own: MeshRange,
    meshes: Vec<MeshRange>,
    instances: Vec<(u32, Placement)>,
}

/// Takes meshes and instances off the front of `bytes`. The scene's arrays have so many positions
/// and triangles in all.
pub(crate) fn unpack_instances(
    bytes: &mut &[u8],
    positions: usize,
    triangles: usize,
) -> Result<Unpacked, SceneError> {
    let malformed = PackedError::Instances;
    let (counts, rest) = split::<[[u8; 4]; 2]>(bytes).ok_or(malformed)?;
    let [meshes, instances] = counts.map(|count| u32::from_le_bytes(count) as usize);
    check_limit("meshes", meshes, MAX_MESHES)?;
    check_limit("instances", instances, MAX_INSTANCES)?;
    // Lengths first, so that a false count does not allocate memory.
    let (mesh_bytes, rest) =
        rest.split_at_checked(meshes * size_of::<MeshRecord>()).ok_or(malformed)?;
    let (instance_bytes, rest) =
        rest.split_at_checked(instances * size_of::<InstanceRecord>()).ok_or(malformed)?;
    *bytes = rest;
    if meshes == 0 || instances == 0 {
        return Err(malformed.into());
    }
    let records = bytemuck::cast_slice::<u8, MeshRecord>(mesh_bytes);
    let lengths = records.iter().map(|r| r.map(|count| u32::from_le_bytes(count) as usize));
    // At most 2¹⁶ · 2³² each.
    let (mut of_meshes, mut of_triangles) = (0_u64, 0_u64);
    for [positions, triangles] in lengths.clone() {
        of_meshes += positions as u64;
        of_triangles += triangles as u64;
    }
    if of_meshes > positions as u64 || of_triangles > triangles as u64 {
        return Err(malformed.into());
    }
    let own = MeshRange {
        positions: 0..positions - of_meshes as usize,
        triangles: 0..triangles - of_triangles as usize,
    };
    let (mut position, mut triangle) = (own.positions.end, own.triangles.end);
    let meshes = lengths.map(|[positions, triangles]| {
        let part = MeshRange {
            positions: position..position + positions,
            triangles: triangle..triangle + triangles,
        };
        (position, triangle) = (part.positions.end, part.triangles.end);
        part
    });
    let meshes = meshes.collect();
    let records = bytemuck::cast_slice::<u8, InstanceRecord>(instance_bytes);
    let placed = records.iter().enumerate().map(|(id, record)| {
        let rows = record.rows.map(|row| row.map(f64::from_le_bytes));
        let placement = Placement::new(rows).ok_or(PackedError::Placement(id))?;
        Ok((u32::from_le_bytes(record.mesh), placement))
    });
    let instances = placed.collect::<Result<_, PackedError>>()?;
    Ok(Unpacked { own, meshes, instances })
}

impl Unpacked {
    /// Makes them the scene's.
    pub(crate) fn share(self, scene: Scene) -> Result<Scene, SceneError> {
        scene.share(self.own, self.meshes, &self.instances)
    }
}
