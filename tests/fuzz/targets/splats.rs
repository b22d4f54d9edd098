//! A file of splats with any bytes, and the hashes that belong to them.
#![no_main]

use holo_splats::{SplatFile, seal};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut file = bytes.to_vec();
    seal(&mut file);
    let Ok(file) = SplatFile::from_bytes(file) else { return };
    let mut open: Vec<_> = file.root().into_iter().collect();
    let mut visited = 0;
    while let Some(node) = open.pop() {
        visited += 1;
        assert!(visited <= file.header().nodes, "a node is reached twice");
        open.extend(file.children(&node).unwrap_or_default());
    }
    let _ = file.verify();
});
