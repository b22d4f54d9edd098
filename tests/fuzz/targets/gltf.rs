//! A glTF file: JSON or GLB, with what it has inside.
#![no_main]

use std::cell::LazyCell;

use holo_fuzz::Folder;
use libfuzzer_sys::fuzz_target;

thread_local! {
    static FOLDER: LazyCell<Folder> = LazyCell::new(Folder::default);
}

fuzz_target!(|bytes: &[u8]| {
    let name = if bytes.starts_with(b"glTF") { "a.glb" } else { "a.gltf" };
    FOLDER.with(|folder| folder.load(name, bytes));
});
