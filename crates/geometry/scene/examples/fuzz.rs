//! Feeds many damaged files to one reader. A panic, or memory beyond the process's limit, ends the
//! program, and the file that caused it stays in the folder.
//!
//! `cargo run --release -p holo-scene --example fuzz -- READER SEEDS FOLDER CASES [FIRST]`
//!
//! READER is `obj`, `mtl`, `gltf`, `glb`, `packed` or `texture`. SEEDS is a folder of models, as
//! `holo-scenes models` writes it. FOLDER is where damaged files are written; best in memory. Case
//! number FIRST is the first, so that one case can be repeated.

#[path = "../tests/it/common/instanced.rs"]
mod instanced;

use std::error::Error;
use std::fs;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use holo_scene::{LoadOptions, Scene, SceneError, Texture, Wrap, load};
use image::{DynamicImage, ImageFormat, Rgb32FImage, RgbImage};

type Failure = Box<dyn Error>;

/// Longest seed, in bytes. Most mutations of a long file hit its numbers, which say little.
const LONGEST: usize = 6000;

/// Words that readers may stumble over.
const WORDS: [&[u8]; 24] = [
    b"0",
    b"-1",
    b"1",
    b"65535",
    b"4294967295",
    b"2147483648",
    b"18446744073709551616",
    b"1e38",
    b"1e39",
    b"-1e308",
    b"nan",
    b"inf",
    b"1e-45",
    b"\n",
    b"\\\n",
    b" ",
    b"\0",
    b"\xff",
    b"\xc3",
    b"{}",
    b"[",
    b"null",
    b"\"\"",
    b"f 1 2 3\n",
];

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [reader, seeds, folder, cases, rest @ ..] = arguments.as_slice() else {
        return Err("usage: fuzz READER SEEDS FOLDER CASES [FIRST]".into());
    };
    let (seeds, folder) = (Path::new(seeds), Path::new(folder));
    let reader = Reader::new(reader, seeds, folder)?;
    let first: u64 = rest.first().map_or(Ok(0), |first| first.parse())?;
    let cases: u64 = cases.parse()?;
    let is_json = matches!(reader.name.as_str(), "gltf" | "glb");
    let (mut accepted, mut slowest) = (0_u64, (Duration::ZERO, 0));
    for case in first..first + cases {
        let damaged = damaged(&reader.seeds, is_json, case);
        fs::write(&reader.file, &damaged)?;
        let start = Instant::now();
        let Ok(is_scene) = catch_unwind(AssertUnwindSafe(|| reader.accepts(&damaged))) else {
            let file = reader.file.display();
            return Err(format!("case {case} panics; its file is {file}").into());
        };
        accepted += u64::from(is_scene);
        slowest = slowest.max((start.elapsed(), case));
    }
    let (seconds, case) = (slowest.0.as_secs_f64(), slowest.1);
    let name = reader.name;
    println!("{name}: {cases} files, {accepted} accepted; {seconds:.2} s at most (case {case})");
    Ok(())
}

/// A reader, and files that it reads.
struct Reader {
    name: String,
    seeds: Vec<Vec<u8>>,
    /// The damaged file.
    file: PathBuf,
    /// The model to load, if the reader reads models.
    model: PathBuf,
}

impl Reader {
    fn new(name: &str, seeds: &Path, folder: &Path) -> Result<Reader, Failure> {
        fs::create_dir_all(folder)?;
        let (file, model) = match name {
            "obj" => ("s.obj", "s.obj"),
            "mtl" => ("s.mtl", "s.obj"),
            "gltf" => ("s.gltf", "s.gltf"),
            "glb" => ("s.glb", "s.glb"),
            "packed" | "texture" => ("s.bytes", "s.bytes"),
            _ => return Err(format!("there is no reader `{name}`").into()),
        };
        let texts = |ending: &str| -> Result<Vec<Vec<u8>>, Failure> {
            let mut found = Vec::new();
            for entry in fs::read_dir(seeds)? {
                let path = entry?.path();
                if path.extension().is_some_and(|e| e == ending) {
                    found.push((path.clone(), fs::read(path)?));
                }
            }
            found.sort();
            Ok(found.into_iter().map(|(_, bytes)| bytes).collect())
        };
        let glbs = texts("glb")?;
        let (json, binary) =
            glbs.first().and_then(|glb| halves(glb)).ok_or("no .glb among the seeds")?;
        fs::write(folder.join("s.bin"), &binary)?;
        fs::write(folder.join("t.png"), picture(ImageFormat::Png)?)?;
        let found = match name {
            "obj" => texts("obj")?.iter().map(|obj| excerpt(obj)).collect(),
            "mtl" => {
                fs::write(folder.join("s.obj"), all_materials(&texts("mtl")?))?;
                texts("mtl")?
            }
            "gltf" => vec![json],
            "glb" => glbs,
            "packed" => packed(seeds)?,
            _ => FORMATS.into_iter().map(picture).collect::<Result<_, _>>()?,
        };
        let (file, model) = (folder.join(file), folder.join(model));
        Ok(Reader { name: name.to_owned(), seeds: found, file, model })
    }

    /// Reads the damaged file; returns whether it is accepted.
    fn accepts(&self, damaged: &[u8]) -> bool {
        let scene = match self.name.as_str() {
            "packed" => Scene::unpack(damaged),
            "texture" => {
                return Texture::decode(Arc::from(damaged), [Wrap::Repeat; 2], false, false)
                    .is_ok();
            }
            _ => load(&self.model, &LoadOptions::default()).map(|loaded| loaded.scene),
        };
        let again = |scene: &Scene| Scene::unpack(&scene.pack());
        scene.is_ok_and(|scene| {
            let is_same = again(&scene).is_ok_and(|again| again.pack() == scene.pack());
            assert!(is_same, "the scene does not survive packing");
            true
        })
    }
}

const FORMATS: [ImageFormat; 6] = [
    ImageFormat::Png,
    ImageFormat::Jpeg,
    ImageFormat::Hdr,
    ImageFormat::OpenExr,
    ImageFormat::Bmp,
    ImageFormat::Tga,
];

fn picture(format: ImageFormat) -> Result<Vec<u8>, Failure> {
    let value = |x: u32, y: u32, k: u32| ((x * 31 + y * 17 + k * 57) % 256) as u8;
    let bytes = RgbImage::from_fn(12, 9, |x, y| {
        image::Rgb([value(x, y, 0), value(x, y, 1), value(x, y, 2)])
    });
    let floats = || {
        Rgb32FImage::from_fn(12, 9, |x, y| image::Rgb([0, 1, 2].map(|k| f32::from(value(x, y, k)))))
    };
    let is_float = matches!(format, ImageFormat::Hdr | ImageFormat::OpenExr);
    let image: DynamicImage = if is_float { floats().into() } else { bytes.into() };
    let mut encoded = Cursor::new(Vec::new());
    image.write_to(&mut encoded, format)?;
    Ok(encoded.into_inner())
}

/// Returns the beginning and the end of a long text, cut between lines.
fn excerpt(text: &[u8]) -> Vec<u8> {
    let lines: Vec<&[u8]> = text.split_inclusive(|&byte| byte == b'\n').collect();
    let (mut from, mut to, mut bytes) = (0, lines.len(), 0);
    while from < to && bytes < LONGEST {
        bytes += lines[from].len() + lines[to - 1].len();
        (from, to) = (from + 1, to - 1);
    }
    [lines[..from].concat(), lines[to.max(from)..].concat()].concat()
}

/// Returns a model that uses every material of these files.
fn all_materials(libraries: &[Vec<u8>]) -> String {
    let mut obj = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n".to_owned();
    for line in libraries.iter().flat_map(|text| text.split(|&byte| byte == b'\n')) {
        if let Some(name) = line.strip_prefix(b"newmtl ") {
            let name = String::from_utf8_lossy(name);
            obj += &format!("usemtl {}\nf 1/1 2/2 3/3\n", name.trim());
        }
    }
    obj
}

fn packed(seeds: &Path) -> Result<Vec<Vec<u8>>, Failure> {
    let mut found = Vec::new();
    for entry in fs::read_dir(seeds)? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "obj" || e == "glb") {
            let loaded: Result<_, SceneError> = load(&path, &LoadOptions::default());
            found.push(loaded?.scene.pack());
        }
    }
    found
        .extend([instanced::scene(), instanced::shaded(), instanced::textured()].map(|s| s.pack()));
    found.sort();
    Ok(found)
}

/// Returns the JSON of a binary glTF file, with its buffer named `s.bin`, and the buffer.
fn halves(glb: &[u8]) -> Option<(Vec<u8>, Vec<u8>)> {
    let length = |at: usize| Some(u32::from_le_bytes(*glb.get(at..)?.first_chunk()?) as usize);
    let json = glb.get(20..20 + length(12)?)?;
    let binary = glb.get(28 + json.len()..)?;
    let json = String::from_utf8_lossy(json);
    let json = json.replacen(r#""buffers":[{"#, r#""buffers":[{"uri":"s.bin","#, 1);
    Some((json.into_bytes(), binary.to_vec()))
}

/// Returns a seed with one to eight changes: a function of the case alone.
///
/// In every other case of a JSON file, only digits change. JSON survives few other changes, and
/// most of a glTF reader lies behind its parser.
fn damaged(seeds: &[Vec<u8>], is_json: bool, case: u64) -> Vec<u8> {
    let mut random = Random(case.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let mut bytes = seeds[random.below(seeds.len())].clone();
    let is_gentle = is_json && case % 2 == 1;
    for _ in 0..=random.below(8) {
        let at = random.place(bytes.len());
        if is_gentle {
            let digits = bytes[at..].iter_mut().skip_while(|byte| !byte.is_ascii_digit());
            for digit in digits.take_while(|byte| byte.is_ascii_digit()) {
                // Not 0: JSON has no numbers that begin with it.
                *digit = b'1' + random.below(9) as u8;
            }
            continue;
        }
        let end = (at + 1 + random.below(16)).min(bytes.len());
        match random.below(9) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => bytes.insert(at, random.below(256) as u8),
            3 => {
                let part = bytes[at..end].to_vec();
                let to = random.place(bytes.len());
                bytes.splice(to..to, part);
            }
            4 => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
            5 => {
                // A whole number or word becomes another.
                let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || b".-+_".contains(byte);
                let length = bytes[at..].iter().take_while(|byte| is_part(byte)).count();
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at + length, word.iter().copied());
            }
            6 => {
                // A number of 16 or 32 bits becomes one that is extreme.
                let value = [u32::MAX, 0, 1 << 31, 0x7f80_0000, 0xffff][random.below(5)];
                let length = [2, 4][random.below(2)].min(bytes.len() - at);
                bytes[at..at + length].copy_from_slice(&value.to_le_bytes()[..length]);
            }
            _ if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            _ => {}
        }
    }
    bytes
}

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    }

    /// Returns a place in so many bytes. Half of them are near the beginning, where headers are.
    fn place(&mut self, length: usize) -> usize {
        let near = if self.below(2) == 0 { 200 } else { usize::MAX };
        self.below((length + 1).min(near))
    }
}
