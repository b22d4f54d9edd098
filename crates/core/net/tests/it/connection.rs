//! Frames in both directions of a connection, and the connection's end.

use std::time::Duration;

use crate::common::{SOON, pair, raw_client, until};
use holo_net::{LONGEST_BUSY, Message, NetError, SILENCE};
use holo_proto::{
    ProtoError,
    bulk::{BlobChunk, SampleSource, ViewSamples},
    control::{Control, Farewell},
    frame::{self, FrameHeader, FrameKind},
};
use holo_section::{BeamId, BeamKey, NumberRun, RayCoords, Sample, SampleKind};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    time::{Instant, sleep, timeout},
};

fn samples(count: u32) -> ViewSamples {
    let kind = SampleKind::Uniform;
    let run =
        NumberRun { key: BeamKey { section: 1, beam: BeamId(2) }, kind, first: 3, count, paths: 4 };
    let samples = (0..count)
        .map(|i| Sample::from_codes(RayCoords(i.to_le_bytes()), [i as u8; 4], i as u16))
        .collect();
    ViewSamples { view: 5, source: SampleSource::Traced, runs: vec![run], samples }
}

fn ping(number: u64) -> Message {
    Message::Control(Control::Ping(number))
}

#[tokio::test]
async fn messages_arrive_whole_and_in_order_both_ways() {
    let ((mut inbox, outbox), (mut theirs_in, theirs_out)) = pair().await;
    for number in 1..=1000 {
        outbox.control(&Control::Ping(number)).unwrap();
        theirs_out.send(FrameKind::Samples, &samples(number as u32).encode()).unwrap();
    }
    for number in 1..=1000 {
        assert_eq!(theirs_in.next().await.unwrap(), ping(number));
        assert_eq!(inbox.next().await.unwrap(), Message::Samples(samples(number as u32)));
    }
}

#[tokio::test]
async fn an_ended_connection_sends_what_was_queued_and_nothing_more() {
    let ((mut inbox, _outbox), (_theirs_in, theirs_out)) = pair().await;
    let other = theirs_out.clone();
    for number in 1..=1000 {
        theirs_out.control(&Control::Ping(number)).unwrap();
    }
    theirs_out.end();
    // The owner of a clone can send no more, and does not keep the connection open.
    other.control(&Control::Ping(1001)).unwrap();
    for number in 1..=1000 {
        assert_eq!(inbox.next().await.unwrap(), ping(number));
    }
    assert!(matches!(timeout(SOON, inbox.next()).await.unwrap(), Err(NetError::Closed)));
    until(|| other.is_closed() && other.queued_bytes() == 0).await;
}

#[tokio::test]
async fn a_frame_that_comes_byte_by_byte_arrives() {
    let (mut client, (mut inbox, _outbox)) = raw_client().await;
    client.set_nodelay(true).unwrap();
    let message = samples(30);
    let frame = frame::encode(FrameKind::Samples, &message.encode()).unwrap();
    let writing = tokio::spawn(async move {
        for byte in frame {
            client.write_all(&[byte]).await.unwrap();
            tokio::task::yield_now().await;
        }
        client
    });
    assert_eq!(timeout(SOON, inbox.next()).await.unwrap().unwrap(), Message::Samples(message));
    drop(writing.await.unwrap());
    assert!(matches!(inbox.next().await, Err(NetError::Closed)));
}

#[tokio::test]
async fn the_longest_frame_arrives_and_one_byte_more_is_not_sent() {
    let ((mut inbox, _outbox), (_theirs_in, theirs_out)) = pair().await;
    let bytes = (frame::MAX_BULK_BYTES - 12) as usize;
    let chunk = BlobChunk { offset: 1 << 40, bytes: (0..bytes).map(|i| (i % 251) as u8).collect() };
    theirs_out.send(FrameKind::BlobChunk, &chunk.encode()).unwrap();
    let longer = BlobChunk { offset: 0, bytes: vec![0; bytes + 1] };
    assert!(matches!(
        theirs_out.send(FrameKind::BlobChunk, &longer.encode()),
        Err(ProtoError::TooLong { .. })
    ));
    let Message::BlobChunk(arrived) = timeout(SOON, inbox.next()).await.unwrap().unwrap() else {
        panic!("other")
    };
    assert!(arrived == chunk);
    theirs_out.drained().await;
    assert_eq!(theirs_out.queued_bytes(), 0, "what was too long is not counted");
}

#[tokio::test]
async fn a_hostile_length_ends_the_connection_before_anything_is_read() {
    let (mut client, (mut inbox, _outbox)) = raw_client().await;
    let header = [0xff, 0xff, 0xff, 0xff, FrameKind::Samples as u8, 0, 0, 0];
    client.write_all(&header).await.unwrap();
    // Nothing follows the header. A reader that waited for the payload would wait until silence is
    // noticed.
    let error = timeout(SOON, inbox.next()).await.unwrap().unwrap_err();
    let refused = ProtoError::TooLong {
        kind: FrameKind::Samples,
        length: u64::from(u32::MAX),
        limit: frame::MAX_BULK_BYTES,
    };
    assert!(matches!(&error, NetError::Proto(found) if *found == refused), "{error}");
}

#[tokio::test]
async fn broken_messages_are_distinguished_from_closed_connections() {
    for (bytes, expected) in [
        (frame::encode(FrameKind::Hello, b"again").unwrap(), ProtoError::Kind(1)),
        (frame::encode(FrameKind::Samples, &[0; 17]).unwrap(), ProtoError::Trailing(1)),
        (
            FrameHeader { kind: FrameKind::Work, length: 0 }.to_bytes().to_vec(),
            ProtoError::Truncated { what: "work message", needed: 8, found: 0 },
        ),
    ] {
        let (mut client, (mut inbox, _outbox)) = raw_client().await;
        client.write_all(&bytes).await.unwrap();
        let error = timeout(SOON, inbox.next()).await.unwrap().unwrap_err();
        assert!(matches!(&error, NetError::Proto(found) if *found == expected), "{error}");
    }
    // The connection closes within a frame.
    let (mut client, (mut inbox, _outbox)) = raw_client().await;
    client
        .write_all(&frame::encode(FrameKind::Samples, &samples(9).encode()).unwrap()[..50])
        .await
        .unwrap();
    drop(client);
    assert!(matches!(timeout(SOON, inbox.next()).await.unwrap(), Err(NetError::Closed)));
}

#[tokio::test]
async fn silence_is_noticed_in_time() {
    let (_client, (mut inbox, _outbox)) = raw_client().await;
    tokio::time::pause();
    let start = Instant::now();
    let error = inbox.next().await.unwrap_err();
    let waited = start.elapsed();
    assert!(matches!(error, NetError::Silent), "{error}");
    assert!(waited >= SILENCE && waited < SILENCE + Duration::from_millis(100), "{waited:?}");
}

#[tokio::test]
async fn a_slow_line_is_not_silence() {
    let (mut client, (mut inbox, _outbox)) = raw_client().await;
    let message = samples(100);
    let frame = frame::encode(FrameKind::Samples, &message.encode()).unwrap();
    tokio::time::pause();
    let start = Instant::now();
    let writing = tokio::spawn(async move {
        for piece in frame.chunks(100) {
            sleep(SILENCE * 2 / 3).await;
            client.write_all(piece).await.unwrap();
        }
        client
    });
    assert_eq!(inbox.next().await.unwrap(), Message::Samples(message));
    assert!(start.elapsed() > 5 * SILENCE, "{:?}", start.elapsed());
    drop(writing.await.unwrap());
}

#[tokio::test]
async fn a_side_that_is_busy_for_minutes_is_not_silent_and_loses_nothing() {
    let ((mut busy, _their_outbox), (mut inbox, outbox)) = pair().await;
    tokio::time::pause();
    let start = Instant::now();
    let piece = |offset| BlobChunk { offset, bytes: vec![offset as u8; 1 << 20] };
    // Far more than what is read in advance and what the systems hold.
    for offset in 0..200 {
        outbox.send(FrameKind::BlobChunk, &piece(offset).encode()).unwrap();
    }
    // The peer takes no message out of its inbox, as a display that draws a large picture.
    let heard = timeout(LONGEST_BUSY - SILENCE, inbox.next()).await;
    assert!(heard.is_err(), "neither a message nor an end: {heard:?}");
    assert!(start.elapsed() >= LONGEST_BUSY - SILENCE && !outbox.is_closed());
    assert!(outbox.queued_bytes() > 100 << 20, "the peer reads little in advance");
    for offset in 0..200 {
        assert_eq!(busy.next().await.unwrap(), Message::BlobChunk(piece(offset)));
    }
}

#[tokio::test]
async fn a_side_that_pings_and_never_takes_anything_is_given_up_in_the_end() {
    let ((_busy, their_outbox), (_inbox, outbox)) = pair().await;
    let piece = BlobChunk { offset: 0, bytes: vec![1; 1 << 20] }.encode();
    for _ in 0..200 {
        outbox.send(FrameKind::BlobChunk, &piece).unwrap();
    }
    tokio::time::pause();
    let tick = Duration::from_millis(100);
    let (mut left, mut since) = (outbox.queued_bytes(), Instant::now());
    while !outbox.is_closed() && since.elapsed() < 2 * LONGEST_BUSY {
        if outbox.queued_bytes() != left {
            (left, since) = (outbox.queued_bytes(), Instant::now());
        }
        sleep(tick).await;
    }
    assert!(outbox.is_closed(), "given up");
    // The last bytes left at most a tick before that was seen.
    let waited = since.elapsed() + tick;
    assert!(waited >= LONGEST_BUSY && waited <= LONGEST_BUSY + SILENCE, "{waited:?}");
    drop(their_outbox);
}

#[tokio::test]
async fn a_server_that_has_nothing_to_say_is_not_silent() {
    let ((mut inbox, _outbox), _server) = pair().await;
    tokio::time::pause();
    let heard = timeout(10 * SILENCE, inbox.next()).await;
    assert!(heard.is_err(), "neither a message nor an end: {heard:?}");
}

#[tokio::test]
async fn a_wait_for_a_message_that_is_given_up_loses_nothing() {
    let ((mut inbox, _outbox), (_theirs_in, theirs_out)) = pair().await;
    let message = samples(200_000);
    theirs_out.send(FrameKind::Samples, &message.encode()).unwrap();
    while timeout(Duration::ZERO, inbox.next()).await.map(|found| found.unwrap())
        != Ok(Message::Samples(message.clone()))
    {
        tokio::task::yield_now().await;
    }
}

#[tokio::test]
async fn queued_bytes_count_until_the_system_has_them() {
    let (mut client, (_inbox, outbox)) = raw_client().await;
    let payload = BlobChunk { offset: 0, bytes: vec![1; 8 << 20] }.encode();
    let frame = payload.len() + frame::HEADER_BYTES;
    for _ in 0..4 {
        outbox.send(FrameKind::BlobChunk, &payload).unwrap();
    }
    assert_eq!(outbox.queued_bytes(), 4 * frame, "the task that writes has not run yet");
    // The peer reads nothing. The system's buffers hold some frames, but not all.
    until(|| outbox.queued_bytes() < 4 * frame).await;
    tokio::time::pause();
    assert!(timeout(SILENCE / 2, outbox.drained()).await.is_err(), "drained waits");
    assert!(outbox.queued_bytes() > 0);
    tokio::time::resume();
    let mut received = vec![0; 4 * frame];
    timeout(SOON, client.read_exact(&mut received)).await.unwrap().unwrap();
    timeout(SOON, outbox.drained()).await.unwrap();
    assert_eq!(outbox.queued_bytes(), 0);
}

#[tokio::test]
async fn drained_means_that_even_the_shortest_message_has_left() {
    let (client, (_inbox, outbox)) = raw_client().await;
    for number in 0..200 {
        outbox.control(&Control::Ping(number)).unwrap();
        outbox.drained().await;
        let mut frame = [0; 20];
        // The system already has the bytes, so they can be read without any other task.
        assert_eq!(client.try_read(&mut frame).ok(), Some(20), "message {number}");
    }
}

#[tokio::test]
async fn nothing_is_counted_for_a_connection_that_has_gone() {
    let (client, (_inbox, outbox)) = raw_client().await;
    let payload = BlobChunk { offset: 0, bytes: vec![1; 8 << 20] }.encode();
    for _ in 0..4 {
        outbox.send(FrameKind::BlobChunk, &payload).unwrap();
    }
    until(|| outbox.queued_bytes() < 4 * payload.len()).await;
    assert!(outbox.queued_bytes() > 0 && !outbox.is_closed());
    drop(client);
    until(|| outbox.is_closed() && outbox.queued_bytes() == 0).await;
    outbox.send(FrameKind::BlobChunk, &payload).unwrap();
    assert_eq!(outbox.queued_bytes(), 0, "a frame that cannot arrive is dropped");
    outbox.drained().await;
}

#[tokio::test]
async fn a_side_that_never_reads_is_given_up() {
    let (client, (_inbox, outbox)) = raw_client().await;
    let payload = BlobChunk { offset: 0, bytes: vec![1; 15 << 20] }.encode();
    for _ in 0..2 {
        outbox.send(FrameKind::BlobChunk, &payload).unwrap();
    }
    until(|| outbox.queued_bytes() < 2 * payload.len()).await;
    tokio::time::pause();
    // The system's buffers may take some more. Then nothing happens until the connection is given
    // up.
    let (mut left, mut since) = (outbox.queued_bytes(), Instant::now());
    while !outbox.is_closed() && since.elapsed() < 2 * SILENCE {
        assert!(left > 0);
        if outbox.queued_bytes() != left {
            (left, since) = (outbox.queued_bytes(), Instant::now());
        }
        sleep(Duration::from_millis(100)).await;
    }
    assert!(outbox.is_closed(), "given up");
    assert!(since.elapsed() <= SILENCE + Duration::from_secs(1), "{:?}", since.elapsed());
    until(|| outbox.queued_bytes() == 0).await;
    drop(client);
}

#[tokio::test]
async fn the_last_queued_message_arrives_after_everything_is_dropped() {
    let ((mut inbox, _outbox), (theirs_in, theirs_out)) = pair().await;
    for _ in 0..20 {
        theirs_out.send(FrameKind::Samples, &samples(10_000).encode()).unwrap();
    }
    let copy = theirs_out.clone();
    drop((theirs_in, theirs_out));
    copy.control(&Control::Bye(Farewell::SessionOver)).unwrap();
    drop(copy);
    for _ in 0..20 {
        assert_eq!(inbox.next().await.unwrap(), Message::Samples(samples(10_000)));
    }
    assert_eq!(inbox.next().await.unwrap(), Message::Control(Control::Bye(Farewell::SessionOver)));
    assert!(matches!(inbox.next().await, Err(NetError::Closed)));
}

#[tokio::test]
async fn a_server_that_starts_again_ends_the_connection_after_all_that_it_has_sent() {
    let ((mut inbox, _outbox), (_theirs_in, theirs_out)) = pair().await;
    theirs_out.send(FrameKind::Samples, &samples(10).encode()).unwrap();
    theirs_out.control(&Control::Bye(Farewell::StartsAgain)).unwrap();
    assert_eq!(inbox.next().await.unwrap(), Message::Samples(samples(10)));
    let error = inbox.next().await.unwrap_err();
    assert!(matches!(error, NetError::StartsAgain) && error.is_lost(), "{error}");
}
