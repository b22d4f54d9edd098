//! An edited scene: a file goes on with it, and samples of the scene before yield to new ones.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{collections::BTreeMap, path::Path};

use crate::common::{self, Peer, Place, beam, run};
use holo_beamfile::{BeamFile, Maker, Options};
use holo_net::Message;
use holo_proto::{
    bulk::{MAX_HELD, RequestedBeam, SampleSource, ViewRequest},
    control::{Control, MAX_PART},
    fading::ENOUGH,
    frame::FrameKind,
    hello::Role,
    stand_ins::{StandInKind, StandInRecord},
};
use holo_scene::Scene;
use holo_section::{BeamKey, Viewpoint};
use holo_server::{Holodeck, HolodeckDescription};

const BEAMS: u64 = 300;
const EDITED: &[u8] = b"an edited scene";

/// Returns the description of the file with the edited scene.
fn edited(file: &Path) -> HolodeckDescription {
    let old = Holodeck::open_read_only(file, 0).unwrap().about.clone();
    let new = HolodeckDescription::new(old.sections, old.settings, EDITED, old.source);
    HolodeckDescription { limits: old.limits, ..new }
}

/// Traces about so many samples of a view, on top of what there is, and ends.
async fn trace(place: &Place, samples: usize) {
    let server = place.serve(|_| {}).await;
    let worker = tokio::spawn(common::work(server.address));
    let mut display = Peer::join(server.address, Role::Display).await;
    // No stored sample is sent, so all that come are new.
    display.send(FrameKind::View, &view(MAX_HELD - 1, true));
    display.samples(samples).await;
    display.outbox.control(&Control::Settle { view: 1 }).unwrap();
    let settled = Message::Control(Control::Settled { view: 1 });
    display.wait_for(|message| *message == settled).await;
    drop(display);
    server.end().await;
    worker.await.unwrap();
}

fn view(held: u16, has_earlier: bool) -> Vec<u8> {
    let wanted = |number| RequestedBeam { key: beam(number), weight: 1.0, held, has_earlier };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    ViewRequest { view: 1, viewpoint, beams: (0..BEAMS).map(wanted).collect() }.encode()
}

/// How many samples there are of each beam: present ones, and earlier ones that count.
type Sent = [BTreeMap<BeamKey, u64>; 2];

/// Returns what messages bring until one of them is `last`.
async fn received(display: &mut Peer, mut last: impl FnMut(&Control) -> bool) -> Sent {
    let mut sent = Sent::default();
    loop {
        match display.wait_for(|_| true).await {
            Message::Samples(samples) => {
                let is_earlier = samples.source == SampleSource::Earlier;
                for (run, _) in samples.iter() {
                    let of = &mut sent[usize::from(is_earlier)];
                    *of.entry(run.key).or_default() += u64::from(run.count);
                }
            }
            Message::Control(control) if last(&control) => return sent,
            _ => {}
        }
    }
}

/// Returns what a display is sent of a file that nobody traces: for a view, and in parts.
async fn shown(place: &Place, has_earlier: bool) -> [Sent; 2] {
    let server = place.serve(|config| config.display_only = true).await;
    let mut display = Peer::join(server.address, Role::Display).await;
    display.send(FrameKind::View, &view(0, has_earlier));
    let of_view =
        received(&mut display, |control| matches!(control, Control::StoredSent { .. })).await;
    let (mut of_parts, mut next) = (Sent::default(), Some(0));
    while let Some(first) = next {
        let part = Control::PartWanted { section: 0, first, samples: MAX_PART, as_settled: false };
        display.outbox.control(&part).unwrap();
        let of_part = received(&mut display, |control| {
            if let Control::PartSent { next: then, .. } = *control {
                next = then;
                return true;
            }
            false
        })
        .await;
        // A beam is whole in one part.
        of_parts.iter_mut().zip(of_part).for_each(|(all, part)| all.extend(part));
    }
    server.end().await;
    [of_view, of_parts]
}

#[test]
fn earlier_samples_are_shown_first_and_each_new_one_replaces_some() {
    run(async {
        let place = Place::new();
        trace(&place, 20_000).await;
        let [[before, none], _] = shown(&place, false).await;
        assert!(before.len() as u64 == BEAMS && none.is_empty());

        Holodeck::restart(&place.file(), &edited(&place.file()), EDITED, &[]).unwrap();
        // As if killed right after: nothing of the new scene was traced yet.
        let [of_view, of_part] = shown(&place, false).await;
        assert_eq!(of_view, [BTreeMap::new(), before.clone()]);
        assert_eq!(of_part, of_view);
        assert_eq!(shown(&place, true).await[0], Sent::default(), "the display has them");

        let mut left = before.values().sum::<u64>();
        for samples in [3000, 6000, 20_000] {
            trace(&place, samples).await;
            let [of_view, of_part] = shown(&place, false).await;
            assert_eq!(of_part, of_view);
            let [present, earlier] = of_view;
            for (key, &many) in &before {
                let new = present.get(key).copied().unwrap_or(0);
                // Of each 64 of them, so many as there are new ones are gone.
                let whole = many / u64::from(ENOUGH) * (u64::from(ENOUGH).saturating_sub(new));
                let rest = (many % u64::from(ENOUGH)).saturating_sub(new);
                assert_eq!(earlier.get(key).copied().unwrap_or(0), whole + rest, "{new} {many}");
            }
            let now = earlier.values().sum::<u64>();
            assert!(now < left || now == 0, "{now} of {left}");
            left = now;
        }
        assert_eq!(left, 0, "no light of the scene before stays");
    });
}

#[test]
fn whoever_connects_gets_the_edited_scene() {
    run(async {
        let place = Place::new();
        let server = place.serve(|_| {}).await;
        let old = Peer::join(server.address, Role::Display).await.welcome;
        server.end().await;
        Holodeck::restart(&place.file(), &edited(&place.file()), EDITED, &[]).unwrap();
        let server = place.serve(|_| {}).await;
        let mut display = Peer::join(server.address, Role::Display).await;
        assert_ne!(display.welcome.scene, old.scene);
        assert_eq!(display.welcome.sections, old.sections);
        display.outbox.control(&Control::SceneWanted).unwrap();
        let piece = display.wait_for(|message| matches!(message, Message::BlobChunk(_))).await;
        let Message::BlobChunk(piece) = piece else { panic!("{piece:?}") };
        assert_eq!(piece.bytes, EDITED);
        drop(display);
        server.end().await;
    });
}

#[test]
fn a_display_that_has_the_scene_gets_the_stand_ins_alone() {
    run(async {
        let place = Place::new();
        for has_some in [false, true] {
            if has_some {
                let (packed, kind) = (b"simpler".to_vec(), StandInKind::Geometry);
                let part = StandInRecord { section: 0, kind, packed };
                let mut file = Holodeck::open(&place.file(), 1 << 20).unwrap();
                file.set_stand_ins(&[(part, "simpler.obj".into())]).unwrap();
            }
            let server = place.serve(|_| {}).await;
            let mut display = Peer::join(server.address, Role::Display).await;
            display.outbox.control(&Control::StandInsWanted).unwrap();
            let is_answer = |message: &Message| {
                matches!(message, Message::BlobChunk(_) | Message::Control(Control::StandIns(_)))
            };
            let answer = display.wait_for(is_answer).await;
            let Message::Control(Control::StandIns(info)) = answer else { panic!("{answer:?}") };
            assert_eq!(info.bytes > 0, has_some);
            if has_some {
                let piece = display.wait_for(is_answer).await;
                let Message::BlobChunk(piece) = piece else { panic!("{piece:?}") };
                assert_eq!(Scene::content_hash(&piece.bytes), info.hash);
            }
            drop(display);
            server.end().await;
        }
    });
}

#[test]
fn a_restart_that_is_refused_or_cut_short_leaves_the_scene_before() {
    run(async {
        let place = Place::new();
        trace(&place, 3000).await;
        let before = shown(&place, false).await;
        let mut other = edited(&place.file());
        other.sections[0].grid = [9; 3];
        let refused =
            Holodeck::restart(&place.file(), &other, EDITED, &[]).unwrap_err().to_string();
        assert!(refused.contains("sections differ") && refused.contains("another file"));
        let mut other = edited(&place.file());
        other.settings.bounces = Some(1);
        let refused =
            Holodeck::restart(&place.file(), &other, EDITED, &[]).unwrap_err().to_string();
        assert!(refused.contains("other settings"), "{refused}");
        let wrong = Holodeck::restart(&place.file(), &edited(&place.file()), b"others", &[]);
        assert!(wrong.is_err());
        // Killed between the scene and its description.
        let file = BeamFile::open(place.file(), Options { cache_bytes: 0, layout: Vec::new() });
        file.unwrap().put_blob("scene-1", EDITED).unwrap();
        assert_eq!(shown(&place, false).await, before);
        let opened = Holodeck::open_read_only(&place.file(), 0).unwrap();
        assert_eq!(opened.about.generation, 0);
        assert_eq!(*opened.packed_scene().unwrap(), *b"a scene");
    });
}

#[test]
fn what_is_forgotten_merged_or_started_over_keeps_generations_apart() {
    run(async {
        let place = Place::new();
        trace(&place, 3000).await;
        Holodeck::restart(&place.file(), &edited(&place.file()), EDITED, &[]).unwrap();
        trace(&place, 1000).await;
        let before = shown(&place, false).await;
        // Nobody unknown has made any.
        Holodeck::forget(&place.file(), &[Maker::UNKNOWN]).unwrap();
        assert_eq!(shown(&place, false).await, before);

        // Samples of the scene before are of no use to another file.
        let fresh = place.file().with_extension("fresh");
        let ours = Holodeck::open_read_only(&place.file(), 0).unwrap();
        let merged = ours.without_samples(&fresh).unwrap();
        merged.merge(&ours).unwrap();
        let (stats, all) = (merged.file.stats(), ours.file.stats());
        assert!(all.earlier > 0);
        assert_eq!((stats.samples, stats.earlier), (all.samples, 0));
        drop((merged, ours));

        Holodeck::start_over(&place.file()).unwrap();
        let opened = Holodeck::open(&place.file(), 0).unwrap();
        let stats = opened.file.stats();
        assert_eq!((opened.about.generation, stats.samples, stats.earlier), (1, 0, 0));
        assert_eq!(*opened.packed_scene().unwrap(), *EDITED);
    });
}
