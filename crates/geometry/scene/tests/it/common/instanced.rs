//! Small scenes with instances, for tests and as first inputs of fuzzing.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};
use holo_scene::{
    Channel, CutOut, FinishMap, Geometry, Maps, Material, NormalMap, Placement, Scene, Shading,
    Sun, Texture, Wrap, to_octahedral,
};

pub const TURNED: [[f64; 4]; 3] =
    [[0.0, -2.0, 0.0, 5.0], [2.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0, -3.0]];
pub const MIRRORED: [[f64; 4]; 3] =
    [[-1.0, 0.2, 0.0, 0.0], [0.0, 1.0, 0.0, 10.0], [0.1, 0.0, 0.5, 0.0]];

pub fn placement(rows: [[f64; 4]; 3]) -> Placement {
    Placement::new(rows).unwrap()
}

/// A triangle of the scene's own, and two instances of a mesh of two triangles.
pub fn scene() -> Scene {
    let own = vec![[0.0, 0.0, 8.0], [1.0, 0.0, 8.0], [0.0, 1.0, 8.0]];
    let materials = ["a", "b", "c"].map(Material::grey).to_vec();
    let scene =
        Scene::new(DVec3::splat(1e5), own, vec![[0, 1, 2]], vec![2], materials, [0.5; 3]).unwrap();
    let mesh = Geometry {
        positions: &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.25], [0.0, 1.0, 0.0]],
        triangles: &[[0, 1, 2], [0, 2, 3]],
        material_ids: &[0, 1],
    };
    scene.with_instances(&[mesh], &[(0, placement(TURNED)), (0, placement(MIRRORED))]).unwrap()
}

/// The same scene with colours and smooth normals.
pub fn shaded() -> Scene {
    scene().with_shading(colours_and_normals()).unwrap()
}

fn colours_and_normals() -> Shading {
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::new(0.3, 0.2, 1.0).normalize()].map(to_octahedral);
    Shading {
        normals: vec![[z; 3], [z, z, to_octahedral(Vec3::Z)], [z, x, y]].into(),
        colours: vec![[[255; 3]; 3], [[10, 20, 30], [40, 50, 60], [70, 80, 90]], [[9; 3]; 3]]
            .into(),
        ..Shading::default()
    }
}

/// The same scene with textures of each kind and a sun, too.
pub fn textured() -> Scene {
    let channel = |channel| Channel { texture: Some(0), channel, factor: 0.5 };
    let finish = FinishMap { roughness: channel(1), metalness: channel(2) };
    let normal = NormalMap { texture: 0, strength: 0.5 };
    let cut_out = CutOut { texture: 1, least: 0.25 };
    let maps = vec![
        Maps { base: Some(1), cut_out: Some(cut_out), ..Maps::default() },
        Maps { emission: Some(1), normal: Some(normal), finish: Some(finish), ..Maps::default() },
        Maps::default(),
    ];
    let picture = |is_linear| {
        Texture::decode(picture().into(), [Wrap::Mirror, Wrap::Clamp], is_linear, false).unwrap()
    };
    let shading = Shading {
        uvs: vec![[[0.0, 0.0], [1.0, 0.0], [0.5, 2.0]]; 3].into(),
        maps,
        textures: vec![picture(true), picture(false)],
        ..colours_and_normals()
    };
    let sun = Sun { towards: [0.0, 0.0, 1.0], irradiance: [3.0, 2.0, 1.0] };
    scene().with_shading(shading).and_then(|scene| scene.with_suns(vec![sun])).unwrap()
}

/// A picture of 2 × 2 texels as a BMP file of 32 bits a pixel. One of them is clear.
fn picture() -> Vec<u8> {
    let mut file = b"BM".to_vec();
    let words = [54 + 16, 0, 54, 40, 2, 2, 1 | 32 << 16, 0, 0, 0, 0, 0, 0];
    file.extend(words.into_iter().flat_map(i32::to_le_bytes));
    file.extend([[200, 128, 128, 255], [255, 140, 120, 255], [90, 60, 30, 255], [0; 4]].concat());
    file
}
