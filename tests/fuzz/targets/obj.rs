//! An OBJ file whose materials are in a file that is sound.
#![no_main]

use std::cell::LazyCell;

use holo_fuzz::Folder;
use libfuzzer_sys::fuzz_target;

const MATERIALS: &[u8] = b"newmtl a\nKd .5 .4 .3\nnewmtl b\nKe 1 1 1\nnewmtl c\nillum 7\nNi 1.5\n";

thread_local! {
    static FOLDER: LazyCell<Folder> = LazyCell::new(|| {
        let folder = Folder::default();
        folder.write("a.mtl", MATERIALS);
        folder
    });
}

fuzz_target!(|bytes: &[u8]| FOLDER.with(|folder| folder.load("a.obj", bytes)));
