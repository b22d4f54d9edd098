//! Six models as other programs write them: their headers, units, axes, materials and mistakes.
//!
//! They show that a model opens with no option, and test it. Each is a few rooms or one object,
//! made of the same parts in metres with +z up, and written with the habits of one program.

mod glb;
mod parts;
mod png;
mod text;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use parts::{room, two_rooms, vase};
use text::{Style, obj};

/// Names of all models, each also that of its files.
pub const MODELS: [&str; 6] =
    ["blender-room", "sketchup-flat", "rhino-vase", "max-lounge", "revit-flat", "blender-kitchen"];

/// Blender's materials: a coat by default, textures, and no lamp.
const BLENDER: &str = "# Blender 4.1.0 MTL File: 'room.blend'\n# www.blender.org\n\n\
newmtl Wall\nNs 250\nKa 1 1 1\nKd 0.800000 0.780000 0.740000\nKs 0.000000 0.000000 0.000000\nKe 0 0 0\nNi 1.45\nd 1.0\nillum 1\n\n\
newmtl Floor\nNs 250\nKa 1 1 1\nKd 0 0 0\nKs 0.500000 0.500000 0.500000\nNi 1.450000\nd 1.000000\nillum 2\nmap_Kd tiles.png\n\n\
newmtl Table\nNs 250\nKd 0.45 0.28 0.15\nKs 0.5 0.5 0.5\nNi 1.45\nd 1\nillum 2\n\n\
newmtl Glass\nNs 1000\nKd 0.9 0.95 0.95\nKs 0.5 0.5 0.5\nNi 1.45\nd 0.1\nillum 9\n\n\
newmtl Vase\nNs 400\nKd 0.15 0.3 0.55\nKs 0.5 0.5 0.5\nNi 1.45\nd 1\nillum 2\n";

const SKETCHUP: &str = "#\n## Alias OBJ Material File\n# Exported from SketchUp, (c) 2000-2012 Trimble Navigation Limited\n\
newmtl Wall\nKa 0.000000 0.000000 0.000000\nKd 0.900000 0.880000 0.850000\nKs 0.330000 0.330000 0.330000\n\
newmtl Floor\nKa 0 0 0\nKd 0.5 0.36 0.24\nKs 0.33 0.33 0.33\nmap_Kd tiles.png\n\
newmtl Table\nKd 0.6 0.6 0.62\nKs 0.33 0.33 0.33\n\
newmtl Glass\nKd 0.8 0.9 0.9\nKs 0.33 0.33 0.33\nd 0.2\n\
newmtl Vase\nKd 0.7 0.2 0.15\nKs 0.33 0.33 0.33\n";

const RHINO: &str =
    "# Rhino\nnewmtl Vase\nKa 0 0 0\nKd 0.55 0.62 0.4\nKs 0.9 0.9 0.9\nNs 60\nd 1.0\nillum 2\n";

const MAX: &str = "# 3ds Max Wavefront OBJ Exporter v0.97b\r\n\r\n\
newmtl Wall\r\n\tNs 10.0000\r\n\tNi 1.5000\r\n\td 1.0000\r\n\tTr 0.0000\r\n\tTf 1.0000 1.0000 1.0000\r\n\tillum 2\r\n\tKd 0.7 0.7 0.66\r\n\tKs 0 0 0\r\n\r\n\
newmtl Floor\r\n\tillum 2\r\n\tKd 0.3 0.25 0.2\r\n\tKs 0.1 0.1 0.1\r\n\tNs 30\r\n\tTr 0\r\n\td 1\r\n\tmap_Kd C:\\Users\\me\\Maps\\TILES.PNG\r\n\r\n\
newmtl Table\r\n\tillum 2\r\n\tKd 0.2 0.2 0.22\r\n\tKs 0.3 0.3 0.3\r\n\tNs 80\r\n\td 1\r\n\r\n\
newmtl Glass\r\n\tillum 2\r\n\tKd 0.9 0.9 0.9\r\n\tKs 0.5 0.5 0.5\r\n\td 0.1\r\n\r\n\
newmtl Vase\r\n\tillum 2\r\n\tKd 0.7 0.65 0.3\r\n\tKs 0.2 0.2 0.2\r\n\tNs 40\r\n\td 1\r\n\r\n\
newmtl Lamp\r\n\tillum 2\r\n\tKd 0 0 0\r\n\tKe 18 16 13\r\n\td 1\r\n";

/// Writes a model into `dir`, which is created if it does not exist. Returns its file. `None` if
/// there is no model of this name.
///
/// # Errors
/// Those of the file system.
pub fn write_model(name: &str, dir: &Path) -> io::Result<Option<PathBuf>> {
    fs::create_dir_all(dir)?;
    let file = dir.join(name).with_extension(if name == "blender-kitchen" { "glb" } else { "obj" });
    let write =
        |ending: &str, bytes: &[u8]| fs::write(dir.join(name).with_extension(ending), bytes);
    let plain = Style::default();
    let model = match name {
        "blender-room" => {
            write("mtl", BLENDER.as_bytes())?;
            let header = "# Blender 4.1.0\n# www.blender.org\n";
            obj(&room(false), &Style { header, library: "blender-room.mtl", y_up: true, ..plain })
        }
        "sketchup-flat" => {
            write("mtl", SKETCHUP.as_bytes())?;
            // Half of the faces are turned round.
            let header =
                "# Alias OBJ Model File\n# Exported from SketchUp\n# File units = inches\n";
            let scale = 1.0 / 0.0254;
            let library = "sketchup-flat.mtl";
            obj(&two_rooms(), &Style { header, library, scale, turned: 2, ..plain })
        }
        "rhino-vase" => {
            write("mtl", RHINO.as_bytes())?;
            let (header, library) = ("# Rhino\n\n", "rhino-vase.mat");
            obj(&vase(64), &Style { header, library, scale: 1000.0, y_up: true, ..plain })
        }
        "max-lounge" => {
            // UTF-16 with a mark, as editors of some systems save it.
            let mtl: Vec<u8> = "\u{feff}"
                .encode_utf16()
                .chain(MAX.encode_utf16())
                .flat_map(u16::to_le_bytes)
                .collect();
            write("mtl", &mtl)?;
            let header = "# 3ds Max Wavefront OBJ Exporter v0.97b - (c)2007 guruware\n";
            let library = "max-lounge.mtl";
            let style = Style { header, library, scale: 100.0, y_up: true, ..plain };
            obj(&room(true), &Style { negative: true, groups: true, ..style })
        }
        "revit-flat" => {
            // Its MTL file was not sent along.
            let (header, library) = ("# Exported from Revit\n", "C:\\Temp\\revit flat.mtl");
            obj(&two_rooms(), &Style { header, library, scale: 1.0 / 0.3048, ..plain })
        }
        "blender-kitchen" => {
            fs::write(&file, glb::glb(&room(false)))?;
            return Ok(Some(file));
        }
        _ => return Ok(None),
    };
    if name != "rhino-vase" && name != "revit-flat" {
        fs::write(dir.join("tiles.png"), png::tiles())?;
    }
    fs::write(&file, model)?;
    Ok(Some(file))
}
