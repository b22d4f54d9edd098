//! Strategies for arbitrary messages.

use holo_proto::{bulk::*, control::*};
use holo_section::{
    BeamId, BeamKey, NumberRun, RayCoords, Sample, SampleKind, SectionSpec, ViewClass, Viewpoint,
};
use proptest::{collection::vec, prelude::*};

fn key() -> impl Strategy<Value = BeamKey> {
    any::<(u16, u64)>().prop_map(|(section, beam)| BeamKey { section, beam: BeamId(beam) })
}

fn finite() -> impl Strategy<Value = f64> {
    prop::num::f64::NORMAL | prop::num::f64::ZERO | prop::num::f64::SUBNORMAL
}

pub fn sample() -> impl Strategy<Value = Sample> {
    (any::<[u8; 4]>(), any::<[u8; 4]>(), any::<u16>())
        .prop_map(|(coords, rgbe, distance)| Sample::from_codes(RayCoords(coords), rgbe, distance))
}

pub fn viewpoint() -> impl Strategy<Value = Viewpoint> {
    ([finite(), finite(), finite()], finite())
        .prop_map(|(eye, radius)| Viewpoint { eye, radius: radius.abs() })
}

pub fn work() -> impl Strategy<Value = WorkPackets> {
    vec(viewpoint(), 0..4).prop_flat_map(|viewpoints| {
        let known = viewpoints.len() as u16;
        let rays = prop::option::of(vec(any::<[u8; 4]>(), 21));
        let packet =
            (any::<u64>(), key(), 0..u32::MAX - 21, 1..=21u8, 1..=u16::MAX, 0..=known, rays)
                .prop_map(move |(id, key, first, count, paths, viewpoint, rays)| Packet {
                    id,
                    key,
                    first,
                    count,
                    paths,
                    viewpoint: (viewpoint < known && rays.is_none()).then_some(viewpoint),
                    rays: rays.map(|rays| {
                        std::array::from_fn(|at| {
                            if at < usize::from(count) {
                                RayCoords(rays[at])
                            } else {
                                RayCoords::default()
                            }
                        })
                    }),
                });
        vec(packet, 0..20)
            .prop_map(move |packets| WorkPackets { viewpoints: viewpoints.clone(), packets })
    })
}

pub fn results() -> impl Strategy<Value = Results> {
    let packet = (any::<u64>(), any::<u32>(), vec(sample(), 1..=21));
    (vec(packet, 0..12), vec(any::<u64>(), 0..12)).prop_map(|(packets, unseen)| Results {
        unseen,
        packets: packets
            .iter()
            .map(|(id, nanoseconds, samples)| TracedPacket {
                id: *id,
                count: samples.len() as u32,
                nanoseconds: *nanoseconds,
            })
            .collect(),
        samples: packets.into_iter().flat_map(|(_, _, samples)| samples).collect(),
    })
}

pub fn view() -> impl Strategy<Value = ViewRequest> {
    let wanted =
        (key(), prop::num::f32::POSITIVE | prop::num::f32::NORMAL, 0..=MAX_HELD, any::<bool>())
            .prop_filter("finite", |(_, weight, ..)| weight.is_finite() && *weight != 0.0)
            .prop_map(|(key, weight, held, has_earlier)| RequestedBeam {
                key,
                weight: weight.abs(),
                held,
                has_earlier,
            });
    (any::<u32>(), viewpoint(), vec(wanted, 0..30))
        .prop_map(|(view, viewpoint, beams)| ViewRequest { view, viewpoint, beams })
}

pub fn samples() -> impl Strategy<Value = ViewSamples> {
    let kind = prop_oneof![
        Just(SampleKind::Uniform),
        Just(SampleKind::ViewpointLimited),
        Just(SampleKind::SingleRay)
    ];
    let run = (key(), kind, 0..u32::MAX - 50, 1..=u16::MAX, vec(sample(), 1..50));
    let source = prop_oneof![
        Just(SampleSource::Stored),
        Just(SampleSource::Traced),
        Just(SampleSource::Part),
        Just(SampleSource::Earlier)
    ];
    (any::<u32>(), source, vec(run, 0..8)).prop_map(|(view, source, runs)| ViewSamples {
        view,
        source,
        runs: runs
            .iter()
            .map(|(key, kind, first, paths, samples)| NumberRun {
                key: *key,
                kind: *kind,
                first: *first,
                count: samples.len() as u32,
                paths: *paths,
            })
            .collect(),
        samples: runs.into_iter().flat_map(|(.., samples)| samples).collect(),
    })
}

pub fn unseen() -> impl Strategy<Value = Unseen> {
    (any::<u32>(), vec(key(), 0..30)).prop_map(|(view, beams)| Unseen { view, beams })
}

/// Records of all legal numbers, also the least and the greatest.
pub fn cells() -> impl Strategy<Value = CellBatch> {
    let three = || prop::array::uniform3(-1e30..=1e30_f32);
    let positive = || prop::array::uniform3(0.0..=1.0_f32);
    let numbers = (any::<[u32; 2]>(), any::<[u16; 2]>(), 1..=MAX_ESTIMATES, 0_usize..3);
    let cell = (three(), positive(), positive(), numbers).prop_map(
        |(point, light, albedo, ([material, bounces], [level, maker], count, axis))| {
            let mut normal = [0.0; 3];
            normal[axis] = -1.0;
            WireCell { point, normal, material, bounces, level, maker, count, light, albedo }
        },
    );
    vec(cell, 0..20).prop_map(|cells| CellBatch { cells })
}

pub fn live_ray() -> impl Strategy<Value = LiveRay> {
    let direction =
        prop::array::uniform3(-1.0..1.0).prop_filter_map("a direction", |d: [f64; 3]| {
            let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
            (length > 1e-3).then(|| d.map(|x| x / length))
        });
    ([finite(), finite(), finite()], direction, any::<u64>())
        .prop_map(|(origin, direction, number)| LiveRay { origin, direction, number })
}

fn live_hit() -> impl Strategy<Value = LiveHit> {
    (prop::array::uniform3(0.0..=f32::MAX), prop_oneof![0.0..=f32::MAX, Just(f32::INFINITY)])
        .prop_map(|(radiance, distance)| LiveHit { radiance, distance })
}

pub fn live_wanted() -> impl Strategy<Value = LiveWanted> {
    (any::<(u32, u32)>(), vec(live_ray(), 0..30)).prop_map(|((view, pixels), rays)| LiveWanted {
        view,
        pixels,
        rays,
    })
}

pub fn live_work() -> impl Strategy<Value = LiveWork> {
    let packet = (any::<u64>(), 1..=u16::MAX, vec(live_ray(), 1..=21));
    vec(packet.prop_map(|(id, paths, rays)| LivePacket { id, paths, rays }), 0..6)
        .prop_map(|packets| LiveWork { packets })
}

pub fn live_results() -> impl Strategy<Value = LiveResults> {
    vec((any::<u64>(), any::<u32>(), vec(live_hit(), 1..=21)), 0..6).prop_map(|packets| {
        LiveResults {
            packets: packets
                .iter()
                .map(|(id, nanoseconds, hits)| TracedPacket {
                    id: *id,
                    count: hits.len() as u32,
                    nanoseconds: *nanoseconds,
                })
                .collect(),
            hits: packets.into_iter().flat_map(|(.., hits)| hits).collect(),
        }
    })
}

pub fn live_samples() -> impl Strategy<Value = LiveSamples> {
    let sample = (any::<u64>(), live_hit()).prop_map(|(number, hit)| LiveResult { number, hit });
    (any::<u32>(), vec(sample, 0..30)).prop_map(|(view, samples)| LiveSamples { view, samples })
}

pub fn chunk() -> impl Strategy<Value = BlobChunk> {
    // Few values, so that some pieces get shorter.
    let bytes = prop_oneof![vec(any::<u8>(), 0..200), vec(0..3u8, 0..200)];
    (any::<u64>(), bytes).prop_map(|(offset, bytes)| BlobChunk { offset, bytes })
}

/// Texts without control characters, which decoders leave unchanged.
fn text() -> impl Strategy<Value = String> {
    "\\PC{0,40}".prop_map(|text| text.replace(char::is_control, " "))
}

fn section() -> impl Strategy<Value = SectionSpec> {
    let numbers = || [finite(), finite(), finite()];
    (numbers(), [numbers(), numbers(), numbers()], any::<[u32; 3]>(), any::<bool>(), any::<bool>())
        .prop_map(|(origin, axes, grid, interior, obstructions)| SectionSpec {
            origin,
            axes,
            grid,
            class: if interior { ViewClass::Interior } else { ViewClass::Exterior },
            obstructions,
        })
}

fn welcome() -> impl Strategy<Value = Control> {
    let engine = prop_oneof![Just(Engine::Path), Just(Engine::Gather), Just(Engine::Captured)];
    let numbers = (any::<Option<u32>>(), 1..=u16::MAX, any::<u64>(), any::<bool>());
    let settings = (engine, numbers).prop_map(
        |(engine, (bounces, paths_per_sample, seed, virtual_distance))| RenderSettings {
            engine,
            bounces,
            paths_per_sample,
            seed,
            virtual_distance,
        },
    );
    let scene =
        (any::<[u8; 32]>(), any::<u64>()).prop_map(|(hash, bytes)| SceneInfo { hash, bytes });
    let up = [finite(), finite(), finite()].prop_filter("an axis", |up| *up != [0.0; 3]);
    let radiance = || any::<u32>().prop_map(|bits| bits as f32 * 1e-6);
    let unit = (1..=u32::MAX).prop_map(|bits| f64::from(bits) * 1e-6);
    let sky = ([radiance(), radiance(), radiance()], any::<bool>(), unit, any::<bool>());
    let views = vec((text(), text()), 0..5);
    (text(), vec(section(), 1..6), settings, scene, up, views, any::<u64>(), any::<bool>(), sky)
        .prop_map(
            |(
                software,
                sections,
                settings,
                scene,
                up,
                views,
                samples,
                tracing,
                (sky, skip_unseen, unit, sky_varies),
            )| {
                Control::Welcome(Box::new(Welcome {
                    software,
                    sections,
                    settings,
                    scene,
                    up,
                    views,
                    samples,
                    tracing,
                    sky,
                    sky_varies,
                    skip_unseen,
                    unit,
                }))
            },
        )
}

pub fn control() -> impl Strategy<Value = Control> {
    let status = (any::<u64>(), finite(), any::<u32>(), any::<u32>()).prop_map(
        |(samples, rate, workers, displays)| {
            Control::Status(Status { samples, samples_per_second: rate, workers, displays })
        },
    );
    prop_oneof![
        welcome(),
        status,
        any::<u32>().prop_map(|view| Control::StoredSent { view }),
        any::<u32>().prop_map(|view| Control::Settled { view }),
        Just(Control::Bye(Farewell::SessionOver)),
        text().prop_map(|reason| Control::Bye(Farewell::Dropped { reason })),
        Just(Control::Bye(Farewell::StartsAgain)),
        any::<u64>().prop_map(Control::Ping),
        any::<u64>().prop_map(Control::Pong),
        Just(Control::SceneWanted),
        any::<u16>().prop_map(|threads| Control::Ready { threads }),
        text().prop_map(|reason| Control::Failed { reason }),
        any::<u32>().prop_map(|view| Control::Settle { view }),
        Just(Control::CellsWanted),
        (any::<[u8; 32]>(), any::<u64>())
            .prop_map(|(hash, bytes)| Control::StandIns(SceneInfo { hash, bytes })),
        Just(Control::StandInsWanted),
        ("[a-z ]{1,60}", "[-a-z0-9 ]{0,80}")
            .prop_map(|(name, options)| Control::KeepView { name, options }),
        vec((text(), text()), 0..4).prop_map(Control::Views),
        text().prop_map(|reason| Control::Refused { reason }),
        (any::<u16>(), any::<u64>(), 0..=MAX_PART).prop_map(|(section, first, samples)| {
            let as_settled = samples % 2 == 1;
            Control::PartWanted { section, first, samples, as_settled }
        }),
        (any::<u16>(), any::<Option<u64>>())
            .prop_map(|(section, next)| Control::PartSent { section, next }),
        any::<u16>().prop_map(|maker| Control::CellsUsed { maker }),
    ]
}
