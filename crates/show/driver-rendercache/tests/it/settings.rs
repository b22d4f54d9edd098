//! The render cache's numbers do what they say.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::scenes::{self, moment, room, view, wall, whole_picture};
use glam::DVec3;
use holo_driver_rendercache::{
    EmptyPixels, Moment, Place, PointImage, PointImageError, PointImageParams, RayResult, SETTINGS,
    Smoothing, Stages,
};
use holo_picture::View;

const SIZE: (u32, u32) = (40, 30);

fn cache(change: impl FnOnce(&mut PointImageParams)) -> PointImage {
    let mut params = PointImageParams {
        stages: Stages { depth_cull: false, prefilter: false, prediction: false, ..Stages::ALL },
        smoothing: Smoothing::Everywhere,
        empty: EmptyPixels::Black,
        ..PointImageParams::default()
    };
    change(&mut params);
    PointImage::new(SIZE, params).unwrap()
}

/// A sample in the middle of a pixel, on a wall at depth 2, of the view along +y.
fn point(column: u32, row: u32, light: f32) -> RayResult {
    let (x, y) = View::pixel_centre(SIZE, column, row);
    let (origin, direction) = ahead().ray(x, y);
    RayResult::new(wall(origin, direction, 2.0), [light; 3])
}

fn ahead() -> View {
    view(DVec3::ZERO, 0.0, SIZE)
}

#[test]
fn every_number_can_be_set_by_name_and_says_what_it_may_be() {
    for setting in SETTINGS {
        let mut params = PointImageParams::default();
        let value = setting.value(&params);
        params.set(&setting.name.replace('_', "-"), value).unwrap();
        assert_eq!(params, PointImageParams::default(), "{}", setting.name);
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            let error = params.set(setting.name, wrong).unwrap_err().to_string();
            assert_eq!(
                error,
                format!("{} is {wrong}: it must be {}", setting.name, setting.allowed)
            );
        }
        assert_eq!(params, PointImageParams::default(), "what was wrong changed nothing");
    }
    let mut params = PointImageParams::default();
    for (name, wrong) in
        [("group", 3.0), ("group", 128.0), ("prefilter_window", 4.0), ("prefilter_window", 11.0)]
    {
        assert!(
            matches!(params.set(name, wrong), Err(PointImageError::Parameter { .. })),
            "{name} {wrong}"
        );
    }
    let error = params.set("windows", 3.0).unwrap_err().to_string();
    assert!(
        error.starts_with("there is no setting windows: there are points_per_pixel, group, "),
        "{error}"
    );
    // A number that was put in otherwise is refused all the same.
    assert!(
        PointImage::new(
            SIZE,
            PointImageParams { prefilter_window: 8, ..PointImageParams::default() }
        )
        .is_err()
    );
}

#[test]
fn the_papers_numbers_are_the_defaults() {
    let params = PointImageParams::default();
    let of =
        |name: &str| SETTINGS.iter().find(|setting| setting.name == name).unwrap().value(&params);
    // Walter et al. 1999, §3.1: 10 % and weights 4-2-1; §4.3: groups of 8.
    assert!(
        (of("cull_threshold") - 0.1).abs() < 1e-7
            && of("centre_weight") == 2.0
            && of("group") == 8.0
    );
    // 2002, §3.1: a quarter of the resolution, half of the requests; §3.3: 7×7; §3.4: 128, and 255.
    assert!(
        of("predicted_block") == 4.0
            && of("predicted_share") == 0.5
            && of("prefilter_window") == 7.0
    );
    assert!(of("mean_last_age") == 128.0 && of("eviction_age") == 255.0);
}

#[test]
fn the_filter_weighs_by_the_centre_s_weight_its_root_and_one() {
    // The pixel that is looked at, one beside it, one at its corner.
    let places = [(20, 15, 1.0), (21, 15, 10.0), (19, 14, 100.0)];
    for centre in [1, 2, 5] {
        let mut cache = cache(|params| params.centre_weight = centre);
        let samples = places.map(|(column, row, light)| point(column, row, light));
        let picture = cache.frame(&moment(ahead(), &samples, 0)).picture();
        let c = f32::from(centre);
        let expected = (c * c + 10.0 * c + 100.0) / (c * c + c + 1.0);
        let found = picture.get(20, 15).unwrap()[0];
        // Colours are kept within 0.2 %.
        assert!((found / expected - 1.0).abs() < 5e-3, "{centre}: {found}, {expected} expected");
    }
}

#[test]
fn the_wide_filter_reaches_as_far_as_its_window() {
    for window in [3, 5, 7, 9] {
        let mut cache = cache(|params| {
            params.stages.prefilter = true;
            params.prefilter_window = window;
        });
        let frame = cache.frame(&moment(ahead(), &[point(20, 15, 1.0)], 0));
        let lit = frame.picture().pixels.iter().filter(|pixel| pixel[0] > 0.0).count();
        // The mean of each pixel whose window contains the point is the point's colour.
        assert_eq!(lit, (window * window) as usize);
    }
}

#[test]
fn empty_pixels_among_points_have_the_gap_s_priority() {
    // Left half: a pixel in four has no point, and all around it have one; right half: no points.
    let samples: Vec<_> = (0..SIZE.0 / 2)
        .flat_map(|column| (0..SIZE.1).map(move |row| (column, row)))
        .filter(|(column, row)| column % 2 == 0 || row % 2 == 0)
        .map(|(column, row)| point(column, row, 1.0))
        .collect();
    let left = |gap: u8| {
        let mut cache = cache(|params| params.gap_priority = gap);
        let frame = cache.frame(&moment(ahead(), &samples, 200));
        let is_left =
            |direction: DVec3| ahead().project_direction(direction).is_some_and(|(x, _)| x < 0.5);
        (
            frame.requests().filter(|(_, _, direction)| is_left(*direction)).count(),
            frame.requests().count(),
        )
    };
    // New points have priority 0. On the left 10×15 pixels have the gap's; on the right 19×30 have
    // 255, and one column somewhat less.
    for (gap, per_gap) in [(255, 255.0), (135, 135.0), (15, 15.0)] {
        let (found, all) = left(gap);
        let share = 150.0 * per_gap / (150.0 * per_gap + 600.0 * 255.0);
        let expected = share * all as f64;
        // A dither is nearer than chance would be; pixels at the border between the halves are
        // worth 12 at most.
        let allowed = 12.0 + 2.0 * expected.sqrt();
        assert!(
            (found as f64 - expected).abs() <= allowed,
            "{gap}: {found} of {all}, {expected} expected"
        );
    }
    assert!(left(255).0 > left(135).0 && left(135).0 > 2 * left(15).0);
}

#[test]
fn prediction_asks_once_for_each_block_of_the_chosen_side() {
    let pixels = (SIZE.0 * SIZE.1) as usize;
    for side in [1, 3, 4, 16] {
        let mut cache = cache(|params| {
            params.stages.prediction = true;
            params.predicted_block = side;
            params.predicted_share = 1.0;
        });
        let view = ahead();
        let predicted = Some(scenes::view(DVec3::ZERO, 180.0, SIZE));
        let (_, ahead) =
            cache.frame(&Moment { view, predicted, samples: &[], wanted: pixels }).request_counts();
        assert_eq!(ahead, (SIZE.0.div_ceil(side) * SIZE.1.div_ceil(side)) as usize, "{side}");
    }
}

/// Distances in pixels from one that gets `new` of those whose points become so old by it that they
/// leave.
fn gone_after(change: impl FnOnce(&mut PointImageParams), new: RayResult) -> Vec<u32> {
    let mut cache = cache(|params| {
        // Below what a change adds.
        params.eviction_age = 50;
        change(params);
    });
    let here = ahead();
    let all =
        whole_picture(&here, SIZE, &|origin, direction| (wall(origin, direction, 2.0), [0.5; 3]));
    cache.frame(&moment(here, &all, 0));
    let tag = cache.pixel_tag(20, 15).unwrap();
    cache.frame(&moment(here, &[RayResult { tag, ..new }], 0));
    // Samples beside the picture let all points grow older, by less than makes one leave.
    let behind = view(DVec3::ZERO, 180.0, SIZE);
    let beside = whole_picture(&behind, SIZE, &room);
    let frame = cache.frame(&moment(here, &beside[..200], 0));
    let gone = (0..SIZE.0 * SIZE.1).zip(frame.depth()).filter(|(_, depth)| *depth == 0.0);
    let distance = |pixel: u32| (pixel % SIZE.0).abs_diff(20).max((pixel / SIZE.0).abs_diff(15));
    let mut found: Vec<_> = gone.map(|(pixel, _)| distance(pixel)).collect();
    found.sort_unstable();
    found
}

#[test]
fn a_change_makes_points_older_as_far_as_it_reaches() {
    let changed = point(20, 15, 1.0);
    assert_eq!(gone_after(|_| {}, changed), [1; 8]);
    let far: Vec<_> = [[1; 8].as_slice(), &[2; 16], &[3; 24]].concat();
    assert_eq!(gone_after(|params| params.change_reach = 3, changed), far);
    assert!(gone_after(|params| params.change_reach = 0, changed).is_empty());
    assert!(gone_after(|params| params.change_ageing = 20, changed).is_empty());
}

#[test]
fn the_threshold_of_a_change_is_a_setting() {
    // A fifth brighter, with a noise of a tenth of the light, and as far behind.
    let brighter = point(20, 15, 0.6);
    let is_change = |change: fn(&mut PointImageParams), new| !gone_after(change, new).is_empty();
    assert!(is_change(|_| {}, brighter));
    assert!(!is_change(|params| params.change_threshold = 0.2, brighter));
    let noisy = RayResult { noise: 0.05, ..brighter };
    assert!(!is_change(|_| {}, noisy));
    assert!(is_change(|params| params.noise_deviations = 0.5, noisy));
    let Place::At(place) = point(20, 15, 0.5).place else { unreachable!() };
    let behind = RayResult::new(Place::At(1.2 * place), [0.5; 3]);
    assert!(is_change(|_| {}, behind));
    assert!(!is_change(|params| params.move_threshold = 0.3, behind));
}
