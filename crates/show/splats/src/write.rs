//! Writes a hierarchy as a file.

use std::{fs, io::Write, path::Path};

use glam::DVec3;

use crate::{
    SplatError, SplatHeader, SplatTree,
    children::count,
    format::{CHUNK_NODES, ENTRY_BYTES, HASH_BYTES, HEADER_BYTES},
};

/// Where splats come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// The place in the scene that the surfels' coordinates are relative to.
    pub origin: DVec3,
    /// Distance between surfels, scene units: that of the tree.
    pub spacing: f64,
    /// Metres per scene unit.
    pub unit: f64,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// Radiance of rays that hit nothing.
    pub sky: [f32; 3],
    /// Samples that the light is the mean of.
    pub samples: u64,
    /// The holodeck's generation.
    pub generation: u32,
    /// Hash of the holodeck's packed scene.
    pub scene: [u8; 32],
}

impl SplatTree {
    /// Returns the file's header.
    fn header(&self, origin: &Origin) -> SplatHeader {
        SplatHeader {
            nodes: self.nodes.len() as u64,
            surfels: self.surfels as u64,
            levels: self.levels.iter().map(|&start| start as u64).collect(),
            origin: origin.origin,
            sphere: self.sphere,
            peak: self.peak,
            spacing: origin.spacing,
            unit: origin.unit,
            up: origin.up,
            sky: origin.sky,
            samples: origin.samples,
            generation: origin.generation,
            scene: origin.scene,
        }
    }

    /// Returns the bytes of the file before its nodes.
    fn beginning(&self, origin: &Origin) -> Vec<u8> {
        let header = self.header(origin);
        let mut bytes = vec![0; HEADER_BYTES];
        let mut child = 1_u64;
        for nodes in self.nodes.chunks(CHUNK_NODES) {
            let hash = blake3::hash(bytemuck::cast_slice(nodes));
            let mut entry = [0; ENTRY_BYTES];
            entry[..HASH_BYTES].copy_from_slice(&hash.as_bytes()[..HASH_BYTES]);
            entry[HASH_BYTES..].copy_from_slice(&child.to_le_bytes());
            bytes.extend(entry);
            child += u64::from(count(nodes));
        }
        let head = header.encode(&bytes[HEADER_BYTES..]);
        bytes[..HEADER_BYTES].copy_from_slice(&head);
        bytes
    }

    /// Returns the whole file.
    pub fn to_bytes(&self, origin: &Origin) -> Vec<u8> {
        let mut bytes = self.beginning(origin);
        bytes.extend_from_slice(bytemuck::cast_slice(&self.nodes));
        bytes
    }
}

/// Writes splats to a file. It appears whole or not at all, in place of one that was there.
///
/// # Errors
/// If it cannot be written. A file that was there is then as before.
pub fn write(path: &Path, tree: &SplatTree, origin: &Origin) -> Result<(), SplatError> {
    let failed = |error| SplatError::Io { action: "writing", path: path.to_owned(), error };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let mut draft =
        tempfile::Builder::new().prefix(".splats-").tempfile_in(folder).map_err(failed)?;
    let write = |file: &mut fs::File| {
        file.write_all(&tree.beginning(origin))?;
        file.write_all(bytemuck::cast_slice(&tree.nodes))?;
        file.sync_all()
    };
    write(draft.as_file_mut()).map_err(failed)?;
    make_readable(draft.as_file()).map_err(failed)?;
    draft.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Gives a draft the permissions that files of this system usually have.
fn make_readable(file: &fs::File) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Some origin.
    pub(crate) fn origin() -> Origin {
        Origin {
            origin: DVec3::new(1.0, 2.0, 3.0),
            spacing: 1.0,
            unit: 1.0,
            up: [0.0, 0.0, 1.0],
            sky: [0.1, 0.2, 0.3],
            samples: 12_345,
            generation: 2,
            scene: [7; 32],
        }
    }
}
