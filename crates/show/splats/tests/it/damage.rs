//! Files that are cut off, changed, foreign or made to harm.

use holo_splats::{CHUNK_NODES, HEADER_BYTES, SplatError, SplatFile, seal};

use crate::common::{ball, file, random};

/// Visits every node that can be reached. Returns their number, at most `limit`.
fn visit(file: &SplatFile, limit: usize) -> usize {
    let mut open: Vec<_> = file.root().into_iter().collect();
    let mut visited = 0;
    while let Some(node) = open.pop() {
        visited += 1;
        assert!(visited <= limit, "a traversal does not end");
        open.extend(file.children(&node).unwrap_or_default());
    }
    visited
}

#[test]
fn files_that_are_none_and_files_that_are_cut_off_are_refused() {
    let whole = file(ball(400));
    assert!(matches!(SplatFile::from_bytes(Vec::new()), Err(SplatError::Foreign)));
    assert!(matches!(SplatFile::from_bytes(b"holodeck".to_vec()), Err(SplatError::Foreign)));
    for length in [8, 100, HEADER_BYTES, HEADER_BYTES + 10, whole.len() - 1] {
        let cut = SplatFile::from_bytes(whole[..length].to_vec());
        assert!(matches!(cut, Err(SplatError::Length { .. })), "{length}: {cut:?}");
    }
    let long = [whole.clone(), vec![0]].concat();
    assert!(matches!(SplatFile::from_bytes(long), Err(SplatError::Length { .. })));
    let mut later = whole;
    later[8] = 2;
    assert!(matches!(SplatFile::from_bytes(later), Err(SplatError::Version(2))));
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty.splats");
    std::fs::write(&empty, []).unwrap();
    assert!(matches!(SplatFile::open(&empty), Err(SplatError::Foreign)));
    let none = SplatFile::open(&folder.path().join("none")).unwrap_err().to_string();
    assert!(none.contains("reading"), "{none}");
}

#[test]
fn a_changed_byte_is_found_wherever_it_is() {
    let whole = file(ball(CHUNK_NODES as u32));
    for at in (0..whole.len()).step_by(97).chain([9, 12, 16, 960, 992]) {
        let mut changed = whole.clone();
        changed[at] ^= 0x10;
        match SplatFile::from_bytes(changed) {
            Err(_) => {}
            Ok(file) => {
                let error = file.verify().unwrap_err();
                assert!(matches!(error, SplatError::Hash(_)), "{at}: {error}");
            }
        }
    }
}

#[test]
fn what_is_above_a_damaged_chunk_can_still_be_read() {
    let mut bytes = file(ball(3 * CHUNK_NODES as u32));
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    let file = SplatFile::from_bytes(bytes).unwrap();
    let reached = visit(&file, file.header().nodes as usize);
    assert!(reached > CHUNK_NODES && (reached as u64) < file.header().nodes, "{reached}");
}

#[test]
fn files_with_any_bytes_and_true_hashes_are_refused_or_end() {
    let whole = file(ball(900));
    let mut opened = 0;
    for case in 0..4000_u64 {
        let mut changed = whole.clone();
        for change in 0..1 + case % 8 {
            let seed = case * 16 + change;
            // Half of the changes hit the header.
            let range = if change % 2 == 0 { 300 } else { changed.len() };
            let at = (random(seed) * range as f32) as usize;
            changed[at] = match case % 3 {
                0 => (random(seed ^ 0x5555) * 256.0) as u8,
                1 => changed[at] ^ 1 << (seed % 8),
                _ => [0, 1, 0x7F, 0x80, 0xFF][(seed % 5) as usize],
            };
        }
        seal(&mut changed);
        if let Ok(file) = SplatFile::from_bytes(changed) {
            opened += 1;
            visit(&file, file.header().nodes as usize);
        }
    }
    assert!(opened > 500, "{opened} of 4000 files were opened");
}

#[test]
fn a_node_that_is_its_own_child_is_refused() {
    let mut bytes = file(ball(900));
    let first_of_first = HEADER_BYTES + 16;
    bytes[first_of_first..first_of_first + 8].copy_from_slice(&0_u64.to_le_bytes());
    seal(&mut bytes);
    let file = SplatFile::from_bytes(bytes).unwrap();
    let root = file.root().unwrap();
    let error = file.first_child(&root).unwrap_err().to_string();
    assert!(error.contains("cannot be its own"), "{error}");
    visit(&file, file.header().nodes as usize);
}

#[test]
fn a_node_with_two_parents_is_refused() {
    // With many chunks that share children, a traversal would take for ever.
    let mut bytes = file(ball(3 * CHUNK_NODES as u32));
    let first_of_second = HEADER_BYTES + 24 + 16;
    bytes[first_of_second..first_of_second + 8].copy_from_slice(&9000_u64.to_le_bytes());
    seal(&mut bytes);
    let file = SplatFile::from_bytes(bytes).unwrap();
    let error = file.verify().unwrap_err().to_string();
    assert!(error.contains("the same children"), "{error}");
    visit(&file, file.header().nodes as usize);
}
