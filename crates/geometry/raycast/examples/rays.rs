//! Measures rays per second of one core: incoherent rays one by one, and the 21 rays of a beam
//! together; nearest hit and occlusion.
//!
//! `cargo run --release -p holo-raycast --example rays -- [--json] [--obj FILE] [--triangles N,N…]
//! [--rays N] [--dump FOLDER] [--flatten] [--stored FOLDER]`
//!
//! Without `--obj`, which reads any model file, the scenes are closed displaced spheres of about
//! 10³ to 10⁶ triangles. `--triangles 10000000` takes a few GB and a minute. Times are processor
//! seconds of the thread where the system reports them (Linux), so other programs do not count.
//!
//! `--flatten` makes a copy of a shared mesh for each of its instances.
//!
//! `--stored` stores each scene in a folder, and casts rays at the mapped files. It prints how long
//! they take to open, and the memory that this process alone has of them.
//!
//! `--dump` writes scene and rays for `scripts/embree-bench`, little-endian. The counts of
//! vertices, triangles, incoherent rays and beam rays (u32) come first. Positions (3 f32),
//! triangles (3 u32) and rays (origin, direction, t_min, t_max: 8 f32) follow.

use std::error::Error;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, MAX_TOGETHER, Ray, Raycaster, StoredScenes};
use holo_scene::{Material, Scene};

/// Cells along each edge of a wall, for beams: about the default grid of a section.
const GRID: f32 = 16.0;

/// Returns the processor time of this thread; the time since `start` where the system does not
/// report it.
fn seconds(start: Instant) -> f64 {
    let ran = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds =
        ran.and_then(|text| text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

struct Random(u64);

impl Random {
    /// Returns a number that is uniform in [0, 1).
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
    }

    fn in_cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) - 0.5
    }

    /// Chooses a cell of a wall of the cube from -½ to ½. Returns a function that makes random
    /// points of the cell.
    fn cell(&mut self) -> impl Fn(&mut Self) -> Vec3 + use<> {
        let (axis, side) = ((self.unit() * 3.0) as usize, (self.unit() * 2.0).floor() - 0.5);
        let corner = [(self.unit() * GRID).floor(), (self.unit() * GRID).floor()];
        move |random| {
            let mut point = [side; 3];
            for (i, corner) in corner.iter().enumerate() {
                point[(axis + 1 + i) % 3] = (corner + random.unit()) / GRID - 0.5;
            }
            point.into()
        }
    }
}

/// Returns a sphere of radius 1 with bumps, of about `triangles` triangles: rings of latitude,
/// closed at the poles.
fn bumpy_sphere(triangles: usize) -> Result<Scene, Box<dyn Error>> {
    let rings = ((triangles as f64 / 4.0).sqrt().round() as u32).max(2);
    let around = 2 * rings;
    let point = |ring: u32, step: u32| {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        let phi = std::f64::consts::TAU * f64::from(step) / f64::from(around);
        let d = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let bump = (11.0 * d.x).sin() * (13.0 * d.y).sin() * (12.0 * d.z).sin();
        (d * (1.0 + 0.15 * bump)).as_vec3().to_array()
    };
    let mut positions = vec![point(0, 0), point(rings, 0)];
    for ring in 1..rings {
        positions.extend((0..around).map(|step| point(ring, step)));
    }
    let id = |ring: u32, step: u32| match ring {
        0 => 0,
        r if r == rings => 1,
        r => 2 + (r - 1) * around + step % around,
    };
    let mut faces = Vec::new();
    for ring in 0..rings {
        for step in 0..around {
            if ring > 0 {
                faces.push([id(ring, step), id(ring + 1, step), id(ring, step + 1)]);
            }
            if ring + 1 < rings {
                faces.push([id(ring, step + 1), id(ring + 1, step), id(ring + 1, step + 1)]);
            }
        }
    }
    let materials = vec![0; faces.len()];
    Ok(Scene::new(DVec3::ZERO, positions, faces, materials, vec![Material::grey("m")], [0.0; 3])?)
}

struct Arguments {
    json: bool,
    obj: Option<PathBuf>,
    triangles: Vec<usize>,
    rays: usize,
    dump: Option<PathBuf>,
    flatten: bool,
    stored: Option<PathBuf>,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut parsed = Arguments {
        json: false,
        obj: None,
        triangles: vec![1_000, 10_000, 100_000, 1_000_000],
        rays: 1_000_000,
        dump: None,
        flatten: false,
        stored: None,
    };
    let mut given = std::env::args().skip(1);
    while let Some(name) = given.next() {
        let mut value = || given.next().ok_or(format!("{name} needs a value"));
        match name.as_str() {
            "--json" => parsed.json = true,
            "--flatten" => parsed.flatten = true,
            "--obj" => parsed.obj = Some(value()?.into()),
            "--triangles" => {
                parsed.triangles = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?
            }
            "--rays" => parsed.rays = value()?.parse()?,
            "--stored" => parsed.stored = Some(value()?.into()),
            "--dump" => parsed.dump = Some(value()?.into()),
            other => return Err(format!("unknown argument {other}").into()),
        }
    }
    Ok(parsed)
}

fn dump(path: &PathBuf, scene: &Scene, sets: [&[Ray]; 2]) -> Result<(), Box<dyn Error>> {
    let mut file = BufWriter::new(std::fs::File::create(path)?);
    let own = scene.own();
    for count in [own.positions.len(), own.triangles.len(), sets[0].len(), sets[1].len()] {
        file.write_all(&u32::try_from(count)?.to_le_bytes())?;
    }
    for value in own.positions.iter().flatten() {
        file.write_all(&value.to_le_bytes())?;
    }
    for index in own.triangles.iter().flatten() {
        file.write_all(&index.to_le_bytes())?;
    }
    for ray in sets.into_iter().flatten() {
        for value in ray
            .origin
            .to_array()
            .into_iter()
            .chain(ray.direction.to_array())
            .chain([ray.t_min, ray.t_max])
        {
            file.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(file.flush()?)
}

/// Returns the best of three runs, in millions per second, and what that run counted.
fn rate(rays: usize, mut run: impl FnMut() -> usize) -> (f64, usize) {
    let clock = Instant::now();
    let mut best = (f64::INFINITY, 0);
    for _ in 0..3 {
        let start = seconds(clock);
        let count = run();
        let taken = seconds(clock) - start;
        if taken < best.0 {
            best = (taken, count);
        }
    }
    (rays as f64 / best.0 / 1e6, best.1)
}

/// Returns kilobytes of this process's memory: all that it has touched, and what it alone has.
fn memory() -> Option<[u64; 2]> {
    let text = std::fs::read_to_string("/proc/self/smaps_rollup").ok()?;
    let sum = |names: [&str; 2]| -> u64 {
        let of_name = |line: &&str| names.iter().any(|name| line.starts_with(name));
        let number = |line: &str| line.split_whitespace().nth(1)?.parse::<u64>().ok();
        text.lines().filter(of_name).filter_map(number).sum()
    };
    Some([sum(["Rss:", "-"]), sum(["Private_Clean:", "Private_Dirty:"])])
}

/// Stores a scene, unless it is, and opens it.
fn mapped(scene: &Arc<Scene>, stored: StoredScenes) -> Result<Raycaster, Box<dyn Error>> {
    let hash = Scene::content_hash(&scene.pack());
    if stored.open(&hash)?.is_none() {
        stored.prepare(scene.clone(), Some(hash))?;
    }
    let before = memory();
    let start = Instant::now();
    let opened = stored.open(&hash)?.ok_or("the scene is too small, or cannot be stored")?;
    println!("opened in {:.3} s", start.elapsed().as_secs_f64());
    if let (Some(before), Some(after)) = (before, memory()) {
        let [all, own] = [0, 1].map(|k| after[k].saturating_sub(before[k]) / 1024);
        println!("memory of the opened scene: {all} MiB, of which {own} MiB are not shared");
    }
    Ok(opened)
}

fn measure(name: &str, scene: Scene, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(scene);
    let (low, high) = scene.bounds();
    let (centre, size) = (((low + high) * 0.5 - scene.origin).as_vec3(), (high - low).as_vec3());
    let mut random = Random(1);
    let incoherent: Vec<Ray> = (0..arguments.rays)
        .map(|_| {
            let (from, to) = (centre + random.in_cube() * size, centre + random.in_cube() * size);
            Ray::new(from, (to - from).normalize())
        })
        .collect();
    // A section is nine tenths of the bounds, so its beams begin inside the scene.
    let section = size * 0.9;
    let mut beams: Vec<Ray> = Vec::with_capacity(arguments.rays);
    while beams.len() + MAX_TOGETHER <= arguments.rays {
        let (entry, exit) = (random.cell(), random.cell());
        for _ in 0..MAX_TOGETHER {
            let (from, to) =
                (centre + entry(&mut random) * section, centre + exit(&mut random) * section);
            beams.push(Ray::new(from, (to - from).normalize_or(Vec3::X)));
        }
    }
    if let Some(folder) = &arguments.dump {
        std::fs::create_dir_all(folder)?;
        dump(&folder.join(format!("{name}.rays")), &scene, [&incoherent, &beams])?;
    }
    let clock = Instant::now();
    let start = seconds(clock);
    let raycaster = match &arguments.stored {
        None => Raycaster::build(scene.clone())?,
        Some(folder) => mapped(&scene, StoredScenes::new(Some(folder.clone())))?,
    };
    let built = seconds(clock) - start;

    let short = |ray: &Ray| Ray { t_max: 1.0, ..*ray };
    let single = |rays: &[Ray]| {
        rate(rays.len(), || rays.iter().filter(|ray| raycaster.nearest(ray).is_some()).count())
    };
    let occluded = |rays: &[Ray]| {
        rate(rays.len(), || rays.iter().filter(|ray| raycaster.occluded(&short(ray))).count())
    };
    let together = |rays: &[Ray]| {
        rate(rays.len(), || {
            let mut hits: [Option<Hit>; MAX_TOGETHER] = [None; MAX_TOGETHER];
            let mut count = 0;
            for beam in rays.chunks(MAX_TOGETHER) {
                raycaster.nearest_many(beam, &mut hits);
                count += hits[..beam.len()].iter().flatten().count();
            }
            count
        })
    };
    let rows = [
        ("nearest", single(&incoherent)),
        ("together", together(&incoherent)),
        ("occluded", occluded(&incoherent)),
        ("beam_nearest", single(&beams)),
        ("beam_together", together(&beams)),
        ("beam_occluded", occluded(&beams)),
    ];
    let triangles = scene.triangles().len();
    if arguments.json {
        let fields: String = rows
            .iter()
            .map(|(n, (rate, count))| format!(",\"{n}\":{rate:.4},\"{n}_count\":{count}"))
            .collect();
        println!(
            "{{\"scene\":\"{name}\",\"triangles\":{triangles},\"build_seconds\":{built:.3}{fields}}}"
        );
    } else {
        println!(
            "{name}: {triangles} triangles, built in {built:.2} s; million rays per second, and number of hits:"
        );
        for (n, (rate, count)) in rows {
            println!("    {n:14} {rate:7.2} {count:9}");
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    if let Some(path) = &arguments.obj {
        let name = path
            .file_stem()
            .map_or_else(|| "scene".into(), |stem| stem.to_string_lossy().into_owned());
        let scene = holo_scene::load(path, &Default::default())?.scene;
        let scene = if arguments.flatten { scene.flattened() } else { scene };
        return measure(&name, scene, &arguments);
    }
    for &triangles in &arguments.triangles {
        measure(&format!("sphere{triangles}"), bumpy_sphere(triangles)?, &arguments)?;
    }
    Ok(())
}
