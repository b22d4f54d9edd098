//! Writes what fuzzing begins with: `seeds FOLDER` makes one folder for each target there.

#[path = "../../../crates/geometry/scene/tests/it/common/instanced.rs"]
mod instanced;
#[path = "../../../crates/geometry/photometry/tests/it/written.rs"]
#[allow(dead_code)]
mod written;

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

use holo_beamfile::{BeamFile, Maker, Options, format::BLOCK_HEADER_BYTES};
use holo_fuzz::short;
use holo_proto::frame::{HEADER_BYTES, FrameHeader};
use holo_photometry::Photometry;
use holo_scene::{HungLuminaire, LoadOptions, load};
use holo_scenes::{Bundled, MODELS, obj_and_mtl, write_model};
use glam::{DVec3, Vec3};
use holo_splats::{Origin, SplatTree, Surfel};
use image::{DynamicImage, ImageFormat};
use holo_section::{BeamId, BeamKey, RayCoords, NumberRun, Sample, SampleKind};

/// Models above this length are left out: a fuzzer gets nowhere with long ones.
const LONGEST: usize = 6 << 10;

/// What OBJ files may say.
const OBJ: &str = "mtllib a.mtl\no a room\ng wall\ns 1\nv 0 0 0 1\nv 1 0 0 .5 .5 .5\nv 1 1 0\n\
    v 0 1 0\nv .5 .5 1e0\nvn 0 0 1\nvn 0 -1 0\nvt 0 0 0\nvt 1 .5\nvt -1 2e-1\nusemtl a\n\
    f 1/1/1 2/2/1 3/3/1 4/1/1\ns off\nusemtl b\nf -1 -2 -3\nf 1//2 2//2 5//2\n\
    usemtl c\nf 1/1 2/2 5/3 \\\n3/1\nl 1 2\np 1\n# the end\n";

/// A triangle with a coloured surface under a lamp.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
"extensionsUsed":["KHR_lights_punctual","KHR_materials_transmission","KHR_texture_transform"],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":40}]}},
"nodes":[{"mesh":0,"scale":[2,2,2]},{"extensions":{"KHR_lights_punctual":{"light":0}},
"rotation":[0,0,0,1],"translation":[0,0,3],"camera":0}],
"cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}],
"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.8,0.6,0.4,1],"metallicFactor":0,
"roughnessFactor":0.5},"emissiveFactor":[1,1,1],"doubleSided":true,
"extensions":{"KHR_materials_transmission":{"transmissionFactor":0.5}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],
"max":[1,1,0]},{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":3}],
"buffers":[{"byteLength":40,"uri":"data:application/octet-stream;base64,
AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAECAA=="}]}"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [folder] = words.as_slice() else { return Err("usage: seeds FOLDER".into()) };
    messages(folder)?;
    beam_file(folder)?;
    models(folder)?;
    splats(folder)?;
    for (name, scene) in [
        ("instances", instanced::scene()),
        ("shaded-instances", instanced::shaded()),
        ("textured-instances", instanced::textured()),
    ] {
        write(folder, "packed_scene", name, &scene.pack())?;
    }
    photometry(folder)?;
    sky_pictures(folder)?;
    write(folder, "weather", "day", weather().as_bytes())?;
    write(folder, "obj", "all", OBJ.as_bytes())?;
    let gltf = GLTF.replace("base64,\n", "base64,");
    write(folder, "gltf", "triangle", gltf.as_bytes())?;
    write(folder, "gltf", "binary", &glb(&gltf))?;
    Ok(())
}

/// Photometric files of all kinds, with few angles.
fn photometry(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    use written::{Ies, NO_SYMMETRY, SAME_ACROSS_BOTH, angles, eulumdat};
    let (below, around) = (angles(0.0, 90.0, 45.0), angles(0.0, 90.0, 45.0));
    for (name, kind, tilt) in
        [("c", 1, "TILT=NONE\n"), ("b", 2, "TILT=INCLUDE\n1\n2\n0 90\n1 .8\n"), ("a", 3, "TILT=NONE\n")]
    {
        let ies = Ies { kind, tilt, opening: [-0.1, 0.4, 0.1], ..Ies::default() };
        let text = ies.write(SAME_ACROSS_BOTH, &below, &around);
        write(folder, "photometry", name, text.as_bytes())?;
    }
    for (symmetry, stored) in [(0, angles(0.0, 270.0, 90.0)), (3, angles(270.0, 450.0, 90.0))] {
        let text = eulumdat(NO_SYMMETRY, symmetry, 4, 60.0, &stored);
        write(folder, "photometry", &format!("eulumdat-{symmetry}"), text.as_bytes())?;
    }
    let text = Ies::default().write(SAME_ACROSS_BOTH, &below, &around);
    let read = Photometry::read(text.as_bytes())?;
    let lamp = HungLuminaire {
        name: "lamp".to_owned(),
        group: "lamps".to_owned(),
        place: DVec3::ZERO,
        axes: [DVec3::X, DVec3::Y, DVec3::Z],
        mesh: Arc::new(read.opening.mesh(read.web.halves())),
        web: Arc::new(read.web),
        colour: [1.0; 3],
    };
    let scene = instanced::scene().with_luminaires_hung(&[lamp.clone(), lamp], 1.0)?;
    write(folder, "packed_scene", "luminaires", &scene.pack())?;
    Ok(())
}

/// Pictures of the sky in both formats: equirectangular, and cubes in all layouts.
fn sky_pictures(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let shapes =
        [("whole", 8, 4), ("across", 12, 2), ("down", 2, 12), ("wide", 8, 6), ("tall", 6, 8)];
    for (shape, width, height) in shapes {
        let light = |x: u32, y: u32| {
            let bright = if (x, y) == (3, 1) { 1e4 } else { 0.5 };
            image::Rgb([bright, y as f32, 1.0])
        };
        let picture = DynamicImage::from(image::Rgb32FImage::from_fn(width, height, light));
        for (kind, format) in [("hdr", ImageFormat::Hdr), ("exr", ImageFormat::OpenExr)] {
            let mut bytes = io::Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format)?;
            write(folder, "sky_picture", &format!("{shape}-{kind}"), bytes.get_ref())?;
        }
    }
    Ok(())
}

/// A weather file with two days.
fn weather() -> String {
    let mut text = "LOCATION,Here,-,NLD,x,1,52.3,4.8,1.0,-2\nDATA PERIODS,1,1\n".to_owned();
    for (month, day) in [(1, 1), (6, 21)] {
        for hour in 1..=24 {
            let sun = if (8..17).contains(&hour) { 400 } else { 0 };
            text += &format!(
                "2001,{month},{day},{hour},60,?,9,5.5,80,101000,0,0,300,{sun},{sun},{}\n",
                sun / 2
            );
        }
    }
    text
}

/// A hierarchy of some levels, on a sheet.
fn splats(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let surfel = |at: u16| Surfel {
        position: Vec3::new(f32::from(at % 8), f32::from(at / 8), 0.0),
        normal: Vec3::Z,
        radius: 0.8,
        light: [f32::from(at), 1.0, 2.0],
        error: 0.1,
        is_directional: at == 3,
    };
    let origin = Origin {
        origin: DVec3::ZERO,
        spacing: 1.0,
        unit: 1.0,
        up: [0.0, 0.0, 1.0],
        sky: [0.0; 3],
        samples: 100,
        generation: 0,
        scene: [0; 32],
    };
    let tree = SplatTree::new((0..64).map(surfel).collect(), 1.0)?;
    Ok(write(folder, "splats", "sheet", &tree.to_bytes(&origin))?)
}

fn write(folder: &Path, target: &str, name: &str, bytes: &[u8]) -> io::Result<()> {
    let folder = folder.join(target);
    fs::create_dir_all(&folder)?;
    fs::write(folder.join(name), bytes)
}

/// The frames of the protocol's golden vectors, each as its kind and its payload.
fn messages(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    for entry in fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../proto/golden"))? {
        let path = entry?.path();
        let text = fs::read_to_string(&path)?;
        let hex =
            text.lines().filter(|line| !line.starts_with('#')).flat_map(str::split_whitespace);
        let frame = hex.map(|byte| u8::from_str_radix(byte, 16)).collect::<Result<Vec<u8>, _>>()?;
        let header = frame.first_chunk::<HEADER_BYTES>().ok_or("a frame without a header")?;
        let kind = FrameHeader::parse(*header)?.kind as u8;
        let name = path.file_stem().ok_or("a file without a name")?.to_string_lossy();
        write(folder, "messages", &name, &[&[kind], &frame[HEADER_BYTES..]].concat())?;
    }
    Ok(())
}

/// A holodeck with samples of all kinds in two blocks, some of them superseded, and a blob.
fn beam_file(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let temporary = tempfile::tempdir()?;
    let path = temporary.path().join("a.holo");
    let file = BeamFile::create(&path, Options { cache_bytes: 0, layout: vec![100, 7] })?;
    for paths in [1, 4] {
        for (number, kind) in
            [SampleKind::Uniform, SampleKind::ViewpointLimited, SampleKind::SingleRay]
                .into_iter()
                .enumerate()
        {
            let key = BeamKey { section: 0, beam: BeamId(number as u64) };
            let samples =
                [Sample::from_codes(RayCoords([1, 2, 3, 4]), [128, 64, 32, 128], 500); 30];
            let run = NumberRun { key, kind, first: 0, count: samples.len() as u32, paths };
            match paths {
                1 => file.append(run, Maker(1), &samples)?,
                _ => file.supersede(run, Maker(2), &samples)?,
            }
        }
        file.flush()?;
    }
    file.put_blob("holodeck", b"{}")?;
    let blocks = file.stats().file_bytes as usize;
    file.close()?;
    let bytes = fs::read(&path)?;
    write(folder, "beam_file", "small", &short(&bytes))?;
    write(folder, "index", "small", &payload(&bytes[blocks..])?)?;
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../../crates/core/beamfile/tests/golden");
    for entry in fs::read_dir(golden)? {
        let path = entry?.path();
        let name = path.file_stem().ok_or("a file without a name")?.to_string_lossy();
        write(folder, "beam_file", &name, &short(&fs::read(&path)?))?;
    }
    Ok(())
}

/// Returns what the target `index` begins with: the block's own range, then its payload.
fn payload(block: &[u8]) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let word = |at: usize| -> Option<usize> {
        Some(u32::from_le_bytes(*block.get(at..)?.first_chunk()?) as usize)
    };
    let (table, length) = word(32).zip(word(40)).ok_or("an index block without a header")?;
    let begin = (BLOCK_HEADER_BYTES + table).next_multiple_of(16);
    let range = block.get(BLOCK_HEADER_BYTES..BLOCK_HEADER_BYTES + 48);
    let payload = block.get(begin..begin + length);
    let (range, payload) = range.zip(payload).ok_or("an index block that ends too soon")?;
    Ok([range, payload].concat())
}

/// Models as programs write them: text, and packed.
fn models(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let temporary = tempfile::tempdir()?;
    let mut found = Vec::new();
    for scene in [Bundled::Cornell, Bundled::Corridor] {
        let written = holo_scenes::write(scene, temporary.path())?;
        let packed = load(&written.obj, &LoadOptions::default())?.scene.pack();
        write(folder, "packed_scene", scene.name(), &packed)?;
        found.push((scene.name(), obj_and_mtl(scene)));
    }
    for model in MODELS {
        write_model(model, temporary.path())?;
        let text = |extension: &str| -> io::Result<String> {
            let path = temporary.path().join(format!("{model}.{extension}"));
            Ok(fs::read_to_string(path).unwrap_or_default())
        };
        found.push((model, (text("obj")?, text("mtl")?)));
    }
    for (name, (obj, mtl)) in &found {
        for (target, text) in [("obj", obj), ("mtl", mtl)] {
            if (1..=LONGEST).contains(&text.len()) {
                write(folder, target, name, text.as_bytes())?;
            }
        }
    }
    Ok(())
}

/// Returns glTF text as a binary file.
fn glb(json: &str) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let words = [0x4654_6C67, 2, 20 + json.len() as u32, json.len() as u32, 0x4E4F_534A];
    words.iter().flat_map(|word: &u32| word.to_le_bytes()).chain(json).collect()
}
