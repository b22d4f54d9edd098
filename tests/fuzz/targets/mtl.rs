//! An MTL file whose first materials a sound OBJ file uses.
#![no_main]

use std::cell::LazyCell;

use holo_fuzz::Folder;
use libfuzzer_sys::fuzz_target;

const MODEL: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
    usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 4/2\nusemtl c\nf 2/2 3/3 4/1\n";

thread_local! {
    static FOLDER: LazyCell<Folder> = LazyCell::new(Folder::default);
}

fuzz_target!(|bytes: &[u8]| FOLDER.with(|folder| {
    folder.write("a.mtl", bytes);
    folder.load("a.obj", MODEL);
}));
