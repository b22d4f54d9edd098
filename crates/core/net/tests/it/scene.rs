//! Scenes that arrive in pieces.

use holo_net::{NetError, SCENE_CHUNK_BYTES, SceneReceiver, absent};
use holo_proto::{bulk::BlobChunk, control::SceneInfo, frame::MAX_BULK_BYTES};

fn info(bytes: u64) -> SceneInfo {
    SceneInfo { hash: [0; 32], bytes }
}

fn chunk(offset: u64, bytes: &[u8]) -> BlobChunk {
    BlobChunk { offset, bytes: bytes.to_vec() }
}

#[test]
fn pieces_in_order_make_the_scene() {
    let scene: Vec<u8> = (0..=255).cycle().take(1000).collect();
    let mut receiver = SceneReceiver::new(&info(1000)).unwrap();
    let mut offset = 0;
    for piece in scene.chunks(300) {
        let done = receiver.take(&chunk(offset, piece)).unwrap();
        offset += piece.len() as u64;
        assert_eq!(done, offset == 1000);
    }
    assert!(receiver.take(&chunk(1000, b"x")).is_err(), "more than was announced");
    assert_eq!(receiver.into_bytes(), scene);
}

#[test]
fn pieces_out_of_order_twice_empty_or_too_long_are_refused() {
    for bad in [
        chunk(0, b"abc"),
        chunk(4, b"abc"),
        chunk(2, b"abc"),
        chunk(3, b""),
        chunk(3, &[0; 8]),
        chunk(u64::MAX, b"a"),
    ] {
        let mut receiver = SceneReceiver::new(&info(10)).unwrap();
        assert!(!receiver.take(&chunk(0, b"abc")).unwrap());
        let error = receiver.take(&bad).unwrap_err();
        assert!(matches!(error, NetError::Scene(_)), "{bad:?}: {error}");
        assert_eq!(receiver.into_bytes(), b"abc", "nothing of it is kept");
    }
}

#[test]
fn an_empty_first_piece_means_that_there_is_no_scene() {
    let mut receiver = SceneReceiver::new(&info(10)).unwrap();
    assert!(matches!(receiver.take(&absent()), Err(NetError::Absent)));
    assert_eq!(BlobChunk::decode(&absent().encode()).unwrap(), absent(), "it can be sent");
}

#[test]
fn absurd_sizes_are_refused_and_large_ones_take_no_memory_before_they_come() {
    assert!(matches!(SceneReceiver::new(&info(0)), Err(NetError::Scene(_))));
    assert!(matches!(SceneReceiver::new(&info((4 << 30) + 1)), Err(NetError::Scene(_))));
    assert!(matches!(SceneReceiver::new(&info(u64::MAX)), Err(NetError::Scene(_))));
    let receiver = SceneReceiver::new(&info(4 << 30)).unwrap();
    assert_eq!(receiver.into_bytes().capacity(), 0);
    assert!(SCENE_CHUNK_BYTES as u64 + 12 <= MAX_BULK_BYTES, "a piece fits a frame");
}
