//! Messages that a server does not send to workers.

use holo_net::Message;

/// Returns the error for a message that a server does not send to workers.
pub fn unexpected(message: &Message) -> anyhow::Error {
    let name = match message {
        Message::Control(_) => "control",
        Message::Work(_) => "work",
        Message::Results(_) => "results",
        Message::View(_) => "view",
        Message::Samples(_) => "samples",
        Message::BlobChunk(_) => "scene",
        Message::Unseen(_) => "unseen beams",
        Message::Cells(_) => "cells",
        Message::Rays(_) => "wanted rays",
        Message::LiveWanted(_) => "live rays",
        Message::LiveWork(_) => "live work",
        Message::LiveResults(_) => "live results",
        Message::LiveSamples(_) => "live samples",
    };
    anyhow::anyhow!("the server sent a {name} message, which is not for a worker")
}
