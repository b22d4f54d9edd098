//! Files that are no model that can be read, by their first bytes or by the end of their name.

use std::path::Path;

/// First bytes of formats that no reader accepts, and what to say.
const STARTS: [(&[u8], &str); 20] = [
    (
        b"HOLOBEAM",
        "it is a holodeck, not a model: `holodeck picture` makes a picture of it, and `holodeck view` \
         and `holodeck replay` walk through it",
    ),
    (b"\x1f\x8b", "it is compressed by gzip: unpack it"),
    (b"BZh", "it is compressed by bzip2: unpack it"),
    (b"\xfd7zXZ", "it is compressed by xz: unpack it"),
    (b"\x28\xb5\x2f\xfd", "it is compressed by zstd: unpack it"),
    (b"7z\xbc\xaf\x27\x1c", "it is a 7z archive: unpack it"),
    (b"Rar!", "it is a RAR archive: unpack it"),
    (b"PXR-USDC", USD),
    (b"#usda", USD),
    (b"AC10", "it is a drawing of AutoCAD (DWG): export glTF or OBJ"),
    (b"AutoCAD Binary DXF", "it is a DXF file: export glTF or OBJ"),
    (b"\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h\0U\0p\0", "it is a SketchUp model: export glTF or OBJ"),
    (b"DRACO", "it is geometry compressed by Draco alone: export glTF or OBJ"),
    (
        b"\xd0\xcf\x11\xe0",
        "it is a compound document, such as of 3ds Max or Revit: export glTF or OBJ",
    ),
    (b"%PDF", "it is a PDF document"),
    (b"\x89PNG", PICTURE),
    (b"\xff\xd8\xff", PICTURE),
    (b"\x76\x2f\x31\x01", PICTURE),
    (b"GIF8", PICTURE),
    (b"SQLite format 3", "it is a database"),
];

const USD: &str = "it is a USD file: export glTF or OBJ";
const PICTURE: &str = "it is a picture";

/// Ends of names of formats that have no certain first bytes, and what to say.
const ENDS: [(&[&str], &str); 19] = [
    (&["usd", "usda", "usdc", "usdz"], USD),
    (&["rad", "oct"], "it is a scene of Radiance: convert its objects to OBJ or glTF"),
    (&["ifc", "ifczip", "ifcxml"], "it is an IFC file: export glTF or OBJ, as IfcConvert does"),
    (&["step", "stp", "iges", "igs"], "it is a CAD file (STEP or IGES): export glTF or OBJ"),
    (&["dwg", "dxf"], "it is a drawing (DWG or DXF): export glTF or OBJ"),
    (&["dae"], "it is a COLLADA file: export glTF or OBJ"),
    (&["fbx"], "it is an FBX file: export glTF or OBJ"),
    (&["skp"], "it is a SketchUp model: export glTF or OBJ"),
    (&["3dm"], "it is a Rhino model: export glTF or OBJ"),
    (&["3ds", "max"], "it is a model of 3ds Max: export glTF or OBJ"),
    (
        &[
            "3mf", "ac", "amf", "ase", "b3d", "b3dm", "c4d", "i3dm", "lwo", "lws", "ma", "mb",
            "md2", "md3", "ms3d", "off", "ogex", "pnts", "vtk", "vtp", "wrl", "x", "x3d",
        ],
        "its format is not read: export glTF or OBJ",
    ),
    (&["blend"], "it is a Blender file: export glTF or OBJ"),
    (&["stl", "ply"], "it is a mesh without materials (STL or PLY): export glTF or OBJ"),
    (&["rvt", "rfa", "pln"], "it is a building model: export IFC, and from that glTF or OBJ"),
    (&["mtl"], "it is an MTL file: name the .obj file that uses it"),
    (
        &["ies", "ldt"],
        "it is a photometric file: name it in a `[[luminaire]]` of a configuration, or by `ies` in an \
         MTL file",
    ),
    (&["epw", "wea"], "it is a weather file: use it with a model and `--weather`"),
    (&["vf"], "it is a view: use it with a model and `--vf`"),
    (&["vrm.gz", "gz", "zip", "7z", "rar", "tar", "tgz"], "it is an archive: unpack it"),
];

/// Returns what a file is, and what to do, if its first bytes are of another format.
pub(crate) fn by_content(first: &[u8], path: &Path) -> Option<&'static str> {
    let by_start = || STARTS.iter().find(|(start, _)| first.starts_with(start));
    // Archives of USD are zip files, and IFC files are STEP files: the name is more exact.
    let is_container = first.starts_with(b"PK\x03\x04") || first.starts_with(b"ISO-10303-21");
    if is_container && let Some(words) = by_name(path) {
        return Some(words);
    }
    by_start().map(|(_, words)| *words)
}

/// Returns what a file without triangles is by its name, and what to do.
pub(crate) fn by_name(path: &Path) -> Option<&'static str> {
    let end = path.extension()?.to_str()?.to_ascii_lowercase();
    ENDS.iter().find(|(ends, _)| ends.contains(&end.as_str())).map(|(_, words)| *words)
}

#[cfg(test)]
mod tests {
    use crate::{LoadOptions, load};

    #[test]
    fn files_of_other_formats_are_named_by_content_or_name() {
        let folder = tempfile::tempdir().unwrap();
        let said = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            load(&path, &LoadOptions::default()).unwrap_err().to_string()
        };
        let holodeck = [&b"HOLOBEAM"[..], &[0; 400], b"\nf x\nf y\nf z\n"].concat();
        for (name, bytes, words) in [
            ("room.holo", holodeck.as_slice(), "it is a holodeck"),
            ("room.obj", &holodeck, "holodeck picture"),
            ("a.obj", b"\x1f\x8b\x08\0\0\0f 1 2\nf", "gzip"),
            ("a.glb", b"\x28\xb5\x2f\xfd\0\0", "zstd"),
            ("a.usdz", b"PK\x03\x04....", "USD"),
            ("a.usda", b"#usda 1.0\n(\n)\n", "USD"),
            ("a.usd", b"PXR-USDC\0\0", "USD"),
            ("house.ifc", b"ISO-10303-21;\nHEADER;\n", "IFC"),
            ("part.stp", b"ISO-10303-21;\nHEADER;\n", "STEP"),
            ("plan.dwg", b"AC1027\0\0\0", "AutoCAD"),
            ("plan.dxf", b"0\nSECTION\n2\nHEADER\n", "DXF"),
            ("scene.rad", b"void plastic white\n0\n0\n5 .8 .8 .8 0 0\n", "Radiance"),
            ("chair.3ds", b"MM\x10\0\0\0\x02\0", "3ds Max"),
            ("chair.SKP", b"\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h\0U\0p\0", "SketchUp"),
            ("chair.png", b"\x89PNG\r\n\x1a\n", "picture"),
            ("tile.b3dm", b"b3dm\x01\0\0\0", "not read"),
            ("room.mtl", b"# Blender 4.1\n\nnewmtl a\nKd 1 0 0\n", "name the .obj file"),
            ("lamp.ies", b"IESNA:LM-63-1995\nTILT=NONE\n1 -1 1\n", "[[luminaire]]"),
            ("city.epw", b"LOCATION,Nowhere,-,-\n", "--weather"),
            ("a.vf", b"rvu -vtv -vp 0 0 0 -vd 1 0 0\n", "--vf"),
        ] {
            let said = said(name, bytes);
            assert!(said.contains(words) && said.contains(name), "{said}");
        }
        // A model is a model whatever its name.
        let path = folder.path().join("model.rad");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert!(load(&path, &LoadOptions::default()).is_ok());
    }
}
