//! The rays and beams that a display wants traced (Larson & Simmons 1999, §2.2). Single rays that
//! it names come first, then its view's beams. Among the beams, the one with the fewest rays for
//! its weight comes first.
//!
//! Invariants:
//! - No view gets more than [`MAX_RAYS_PER_PIXEL`] rays for each pixel, of either sort.
//! - A view's beams are in the order of their names. A beam takes 32 bytes.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, VecDeque},
};

use holo_proto::{
    LEAST_TRACED_WEIGHT, MAX_RAYS_PER_PACKET,
    bulk::{RequestedBeam, WantedRay},
};
use holo_section::{BeamKey, RayCoords, Viewpoint};
use rustc_hash::FxHashMap;

/// Most rays per pixel, so that a forgotten view does not fill the disk. A picture of 640×480
/// pixels reaches it at 3 GB.
const MAX_RAYS_PER_PIXEL: f64 = 1024.0;

/// Beams of the views of all displays together, about: 128 MiB. With up to four displays, each may
/// want as many as a message holds.
const MAX_BEAMS: usize = 1 << 22;

/// Returns the most beams of one display's view, if there are so many displays.
pub fn most_beams(displays: usize) -> usize {
    MAX_BEAMS / displays.max(4)
}

/// Drops the beams of least weight above `most`. The others stay in the order of their names.
pub fn keep_heaviest(beams: &mut Vec<RequestedBeam>, most: usize) {
    if beams.len() > most {
        beams.select_nth_unstable_by(most, |one, other| other.weight.total_cmp(&one.weight));
        beams.truncate(most);
        beams.shrink_to_fit();
        beams.sort_unstable_by_key(|wanted| wanted.key);
    }
}

/// A display's present view.
pub struct Wishes {
    /// The display's number for the view.
    pub view: u32,
    /// The point that rays must pass, and how near.
    pub viewpoint: Viewpoint,
    beams: Box<[BeamWish]>,
    queue: BinaryHeap<Reverse<(Ratio, u32)>>,
    /// Single rays by beam, the most wanted first.
    rays: VecDeque<RayPacket>,
    /// Single rays that may still be given out.
    rays_left: u64,
    pixels: f64,
}

/// Single rays of one beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayPacket {
    /// The beam.
    pub key: BeamKey,
    /// The rays, followed by zeros.
    pub rays: [RayCoords; MAX_RAYS_PER_PACKET],
    /// The number of rays.
    pub count: u8,
}

struct BeamWish {
    key: BeamKey,
    /// The number of pixels that the beam serves.
    weight: f32,
    /// Rays stored or under way.
    computed: u32,
}
const _: () = assert!(size_of::<BeamWish>() == 24);

/// Computed rays over wanted rays, in total order.
#[derive(Clone, Copy, PartialEq)]
struct Ratio(f32);

impl Eq for Ratio {}

impl PartialOrd for Ratio {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ratio {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Wishes {
    /// Returns the wishes for a view: its beams in the order of their names, with their weights and
    /// the rays that each has.
    pub fn new(
        view: u32,
        viewpoint: Viewpoint,
        beams: impl IntoIterator<Item = (BeamKey, f32, u64)>,
    ) -> Wishes {
        let beams: Box<[BeamWish]> = beams
            .into_iter()
            .map(|(key, weight, computed)| BeamWish {
                key,
                weight,
                computed: u32::try_from(computed).unwrap_or(u32::MAX),
            })
            .collect();
        let queue = queue(&beams);
        let pixels: f64 = beams.iter().map(|wish| f64::from(wish.weight)).sum();
        let rays_left = (pixels * MAX_RAYS_PER_PIXEL) as u64;
        Wishes { view, viewpoint, beams, queue, rays: VecDeque::new(), rays_left, pixels }
    }

    /// Takes the rays that are wanted most. They replace what is left of the last such list.
    pub fn want_rays(&mut self, rays: &[WantedRay]) {
        self.rays.clear();
        let mut open: FxHashMap<BeamKey, usize> = FxHashMap::default();
        for ray in rays {
            let known = open
                .get(&ray.key)
                .copied()
                .filter(|&at| usize::from(self.rays[at].count) < MAX_RAYS_PER_PACKET);
            let at = known.unwrap_or_else(|| {
                self.rays.push_back(RayPacket { key: ray.key, rays: Default::default(), count: 0 });
                open.insert(ray.key, self.rays.len() - 1);
                self.rays.len() - 1
            });
            let packet = &mut self.rays[at];
            packet.rays[usize::from(packet.count)] = ray.coords;
            packet.count += 1;
        }
    }

    /// Returns the most wanted single rays, as many as belong to one beam. Beams that are unseen by
    /// `is_unseen` get none.
    pub fn next_rays(&mut self, is_unseen: impl Fn(BeamKey) -> bool) -> Option<RayPacket> {
        loop {
            let packet = self.rays.pop_front()?;
            if self.rays_left < u64::from(packet.count) {
                self.rays.clear();
                return None;
            }
            if !is_unseen(packet.key) {
                self.rays_left -= u64::from(packet.count);
                return Some(packet);
            }
        }
    }

    /// Takes back rays that were not given out after all. They are next.
    pub fn put_back(&mut self, key: BeamKey, rays: &[RayCoords]) {
        if !rays.is_empty() {
            let mut packet = RayPacket { key, rays: Default::default(), count: 0 };
            for (to, ray) in packet.rays.iter_mut().zip(rays) {
                *to = *ray;
                packet.count += 1;
            }
            self.rays_left += u64::from(packet.count);
            self.rays.push_front(packet);
        }
    }

    /// Drops the beams of least weight above `most`, because more displays have come.
    pub fn keep_heaviest(&mut self, most: usize) {
        if self.beams.len() > most {
            let mut beams = std::mem::take(&mut self.beams).into_vec();
            beams.select_nth_unstable_by(most, |one, other| other.weight.total_cmp(&one.weight));
            beams.truncate(most);
            beams.sort_unstable_by_key(|wish| wish.key);
            self.beams = beams.into();
            self.pixels = self.beams.iter().map(|wish| f64::from(wish.weight)).sum();
            self.queue = queue(&self.beams);
        }
    }

    /// Wants all beams again, because some that were thought unseen are not.
    pub fn want_again(&mut self) {
        self.queue = queue(&self.beams);
    }

    /// Returns whether the view wants this beam.
    pub fn contains(&self, key: BeamKey) -> bool {
        self.beams.binary_search_by_key(&key, |wish| wish.key).is_ok()
    }

    /// Returns the number of the view's beams.
    pub fn len(&self) -> usize {
        self.beams.len()
    }

    /// Returns the number of pixels that its beams serve.
    pub fn pixels(&self) -> f64 {
        self.pixels
    }

    /// Returns the most urgent beam and the rays to give it next; `None` once every beam has all it
    /// may get. Beams that are unseen by `is_unseen` get none.
    pub fn next(&mut self, is_unseen: impl Fn(BeamKey) -> bool) -> Option<(BeamKey, u8)> {
        let index = loop {
            let Reverse((_, index)) = self.queue.pop()?;
            if !is_unseen(self.beams[index as usize].key) {
                break index;
            }
        };
        let wish = &mut self.beams[index as usize];
        // At first a ray for every second pixel, so that every beam gets its turn soon; then more.
        let count = (f64::from(wish.weight) / 2.0).max(f64::from(wish.computed) / 4.0);
        let count = count.clamp(1.0, MAX_RAYS_PER_PACKET as f64) as u8;
        wish.computed = wish.computed.saturating_add(u32::from(count));
        if f64::from(wish.ratio().0) < MAX_RAYS_PER_PIXEL {
            self.queue.push(Reverse((wish.ratio(), index)));
        }
        Some((wish.key, count))
    }
}

/// Returns the beams that may get rays, the least filled first.
fn queue(beams: &[BeamWish]) -> BinaryHeap<Reverse<(Ratio, u32)>> {
    let may_get = |wish: &BeamWish| {
        wish.weight >= LEAST_TRACED_WEIGHT && f64::from(wish.ratio().0) < MAX_RAYS_PER_PIXEL
    };
    let traced = beams.iter().zip(0..).filter(|(wish, _)| may_get(wish));
    traced.map(|(wish, index)| Reverse((wish.ratio(), index))).collect()
}

impl BeamWish {
    fn ratio(&self) -> Ratio {
        Ratio(self.computed as f32 / self.weight)
    }
}

#[cfg(test)]
mod tests {
    use holo_section::BeamId;

    use super::*;

    fn key(beam: u64) -> BeamKey {
        BeamKey { section: 0, beam: BeamId(beam) }
    }

    #[test]
    fn the_least_filled_beams_come_first_and_all_end_in_proportion_to_their_weights() {
        let weights = [1.0, 4.0, 16.0, 64.0];
        let stored = [500, 0, 0, 10];
        let beams = (0..4).map(|i| (key(i as u64), weights[i], stored[i]));
        let mut wishes = Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, beams);
        let mut rays = stored;
        assert!(
            (1..=2).contains(&wishes.next(|_| false).unwrap().0.beam.0),
            "an empty beam comes before one with rays"
        );
        let mut wishes = Wishes::new(
            1,
            wishes.viewpoint,
            (0..4).map(|i| (key(i as u64), weights[i], stored[i])),
        );
        for _ in 0..3000 {
            let (key, count) = wishes.next(|_| false).unwrap();
            rays[key.beam.0 as usize] += u64::from(count);
        }
        let ratios: Vec<f64> =
            rays.iter().zip(weights).map(|(&n, w)| n as f64 / f64::from(w)).collect();
        let (low, high) = ratios.iter().fold((f64::MAX, 0.0f64), |(l, h), &x| (l.min(x), h.max(x)));
        // The beam of weight 1 moves in steps of 21.
        assert!(high - low <= 21.0 + 1e-9, "{ratios:?}");
    }

    #[test]
    fn of_more_beams_than_fit_the_heaviest_stay_and_in_order() {
        let wanted = |i: u64| RequestedBeam {
            key: key(i),
            weight: ((i * 37) % 101) as f32 + 1.0,
            held: 0,
            has_earlier: false,
        };
        let mut beams: Vec<_> = (0..101).map(wanted).collect();
        let all = beams.clone();
        keep_heaviest(&mut beams, 101);
        assert_eq!(beams, all);
        keep_heaviest(&mut beams, 30);
        let heavy: Vec<_> = all.into_iter().filter(|wanted| wanted.weight > 71.0).collect();
        assert_eq!(beams, heavy);
        assert!((1..300).all(|displays| displays * most_beams(displays) <= MAX_BEAMS));
        assert_eq!(most_beams(1), 1 << 20, "as many as a message holds");
    }

    #[test]
    fn a_view_that_must_make_room_keeps_its_heaviest_beams_and_what_these_have() {
        let weight = |i: u64| ((i * 37) % 101) as f32 + 1.0;
        let viewpoint = Viewpoint { eye: [0.0; 3], radius: 0.1 };
        let mut wishes = Wishes::new(1, viewpoint, (0..101).map(|i| (key(i), weight(i), i)));
        wishes.keep_heaviest(30);
        let heavy: Vec<u64> = (0..101).filter(|&i| weight(i) > 71.0).collect();
        assert!((0..101).all(|i| wishes.contains(key(i)) == heavy.contains(&i)));
        assert_eq!(wishes.pixels(), heavy.iter().map(|&i| f64::from(weight(i))).sum::<f64>());
        let least = heavy.iter().min_by(|&&one, &&other| {
            (one as f32 / weight(one)).total_cmp(&(other as f32 / weight(other)))
        });
        assert_eq!(wishes.next(|_| false).unwrap().0, key(*least.unwrap()));
    }

    #[test]
    fn beams_that_are_wanted_for_what_is_stored_are_not_traced() {
        let beams =
            (0..4).map(|i| (key(i), if i == 2 { 100.0 } else { 0.5 * LEAST_TRACED_WEIGHT }, 0));
        let mut wishes = Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, beams);
        assert!((0..4).all(|i| wishes.contains(key(i))));
        assert!((0..100).all(|_| wishes.next(|_| false).unwrap().0 == key(2)));
    }

    #[test]
    fn beams_that_see_nothing_get_no_rays_however_urgent_they_are() {
        let beams = (0..4).map(|i| (key(i), if i == 2 { 6400.0 } else { 100.0 }, 0));
        let mut wishes = Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, beams);
        let mut rays = [0u64; 4];
        for step in 0..200 {
            // Beam 2 from the beginning, beam 0 from step 50 on.
            let is_unseen = |beam: BeamKey| beam.beam.0 == 2 || (beam.beam.0 == 0 && step >= 50);
            let before = rays[0];
            let (key, count) = wishes.next(is_unseen).unwrap();
            rays[key.beam.0 as usize] += u64::from(count);
            assert!(step < 50 || rays[0] == before);
        }
        assert!(rays[2] == 0 && rays[0] > 0 && rays[1] > rays[0] && rays[3] > rays[0], "{rays:?}");
        assert!(wishes.contains(key(2)), "samples that the file has of it are still sent");
    }

    #[test]
    fn single_rays_come_in_the_order_in_which_beams_were_first_named_and_only_the_newest() {
        let beams = (0..3).map(|i| (key(i), 10.0, 0));
        let mut wishes = Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, beams);
        let ray =
            |beam: u64, number: u8| WantedRay { key: key(beam), coords: RayCoords([number; 4]) };
        wishes.want_rays(&[ray(1, 77)]);
        let many: Vec<WantedRay> =
            (0..60).map(|number| ray([2, 0, 5][usize::from(number) % 3], number)).collect();
        wishes.want_rays(&[&many[..], &[ray(2, 60), ray(2, 61)]].concat());
        let mut given = Vec::new();
        while let Some(packet) = wishes.next_rays(|beam| beam == key(0)) {
            assert!(
                packet.rays[usize::from(packet.count)..]
                    .iter()
                    .all(|ray| *ray == RayCoords::default())
            );
            given.push((packet.key, packet.rays[..usize::from(packet.count)].to_vec()));
        }
        let of = |numbers: &[u8]| {
            numbers.iter().map(|&number| RayCoords([number; 4])).collect::<Vec<_>>()
        };
        let every_third = |from: u8| (0..20).map(|i| from + 3 * i).collect::<Vec<u8>>();
        let first = [every_third(0), vec![60]].concat();
        let wanted = [(key(2), of(&first)), (key(5), of(&every_third(2))), (key(2), of(&[61]))];
        assert_eq!(given, wanted);
        wishes.put_back(key(2), &of(&[61]));
        assert_eq!(
            wishes.next_rays(|_| false).map(|packet| (packet.key, packet.count)),
            Some((key(2), 1))
        );
    }

    #[test]
    fn single_rays_of_a_forgotten_view_end_by_themselves() {
        let mut wishes =
            Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, [(key(0), 2.0, 0)]);
        let ray = WantedRay { key: key(0), coords: RayCoords::default() };
        let mut rays = 0;
        loop {
            wishes.want_rays(&[ray; 10]);
            let Some(packet) = wishes.next_rays(|_| false) else { break };
            rays += u32::from(packet.count);
            assert!(rays <= 2048);
        }
        assert!(rays > 2048 - 10, "{rays}");
    }

    #[test]
    fn a_forgotten_view_ends_by_itself() {
        let beams = [(key(0), 2.0, 0), (key(1), 1.0, 5000)];
        let mut wishes = Wishes::new(1, Viewpoint { eye: [0.0; 3], radius: 0.1 }, beams);
        let mut rays = 0;
        while let Some((_, count)) = wishes.next(|_| false) {
            rays += u64::from(count);
        }
        assert!((2048..2048 + 3 * 21).contains(&rays), "{rays}");
    }
}
