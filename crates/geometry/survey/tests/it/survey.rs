//! Surveys of small scenes whose rooms, units and up axes are known.

#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use holo_raycast::{Ray, Raycaster};
use holo_scene::{Maps, Material, ModelFacts, Scene, Shading, StatedValue, Texture, Wrap};
use holo_survey::{ChosenView, Survey, UprightAxes, guess_up, is_lit_by_lamps};

/// Triangles with named materials.
#[derive(Default)]
struct Model {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    ids: Vec<u32>,
    materials: Vec<Material>,
}

impl Model {
    fn material(&mut self, name: &str, emission: f32) -> u32 {
        self.materials.push(Material { emission: [emission; 3], ..Material::grey(name) });
        self.materials.len() as u32 - 1
    }

    fn quad(&mut self, corners: [DVec3; 4], material: u32) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        self.ids.extend([material; 2]);
    }

    /// A box whose front faces look inwards or outwards.
    fn cuboid(&mut self, low: DVec3, high: DVec3, inwards: bool, material: u32) {
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [low, high] {
                let corner = |a: f64, b: f64| {
                    let mut p = side;
                    (p[u], p[v]) = (a, b);
                    p
                };
                let mut corners = [
                    corner(low[u], low[v]),
                    corner(high[u], low[v]),
                    corner(high[u], high[v]),
                    corner(low[u], high[v]),
                ];
                if (side == low) != inwards {
                    corners.reverse();
                }
                self.quad(corners, material);
            }
        }
    }

    /// A sphere, seen from outside.
    fn sphere(&mut self, middle: DVec3, radius: f64, material: u32) {
        let at = |i: usize, j: usize| {
            let (sin, cos) = (j as f64 / 48.0 * PI).sin_cos();
            let (y, x) = (i as f64 / 96.0 * TAU).sin_cos();
            middle + DVec3::new(x * sin, y * sin, cos) * radius
        };
        for (i, j) in (0..96).flat_map(|i| (0..48).map(move |j| (i, j))) {
            self.quad([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], material);
        }
    }

    fn scene(&self) -> Scene {
        let materials = self.materials.clone();
        Scene::from_world(&self.positions, &self.triangles, &self.ids, materials, [0.0; 3])
            .unwrap()
            .0
    }

    fn survey(&self, up: DVec3, unit: Option<f64>) -> (Survey, Raycaster) {
        let raycaster = Raycaster::build(Arc::new(self.scene())).unwrap();
        (Survey::new(&raycaster, UprightAxes::new(up), unit, &ModelFacts::default()), raycaster)
    }
}

/// Two rooms of 5 by 4 and 3 by 4 metres with a door between them, and a table in the larger one.
/// Lengths are multiplied by `scale`, and `turn` rotates the axes.
fn flat(scale: f64, turn: fn(DVec3) -> DVec3) -> Model {
    let mut model = Model::default();
    let wall = model.material("plaster", 0.0);
    let wood = model.material("oak", 0.0);
    model.cuboid(DVec3::ZERO, DVec3::new(8.0, 4.0, 2.5), true, wall);
    for (from, to) in [(0.0, 1.5), (2.4, 4.0)] {
        model.cuboid(DVec3::new(4.95, from, 0.0), DVec3::new(5.05, to, 2.5), false, wall);
    }
    model.cuboid(DVec3::new(2.0, 1.5, 0.7), DVec3::new(3.0, 2.5, 0.75), false, wood);
    model.positions.iter_mut().for_each(|p| *p = turn(*p) * scale);
    model
}

#[test]
fn rooms_are_free_boxes_at_eye_height_the_largest_first() {
    let (survey, raycaster) = flat(1.0, |p| p).survey(DVec3::Z, None);
    assert_eq!(survey.rooms.len(), 2);
    for (room, [from, to]) in survey.rooms.iter().zip([[0.0, 4.95], [5.05, 8.0]]) {
        let low = room.origin;
        let high = low + room.axes.iter().sum::<DVec3>();
        assert!(low.x > from && high.x < to && low.y > 0.0 && high.y < 4.0, "{low} {high}");
        assert!(low.z > 0.75 && low.z < 1.6 && high.z > 1.6 && high.z < 2.5, "{low} {high}");
        assert!(high.x - low.x > to - from - 0.6 && high.y - low.y > 3.4, "{low} {high}");
        assert!(!raycaster.scene().geometry_inside(low, room.axes));
    }
    assert_eq!(survey.unit.value, 1.0);
}

/// Returns `count` rooms of 3 by 3 metres in a row, with a door of 0.9 metres from each to the
/// next. Only the door after the room of index `shut` is closed. The first room is longer by a
/// metre, the second by half a metre.
fn row_of_rooms(count: usize, shut: Option<usize>) -> Model {
    let mut model = Model::default();
    let wall = model.material("plaster", 0.0);
    let end = |n: usize| match n {
        0 => 4.0,
        _ => 3.0 * n as f64 + 4.5,
    };
    model.cuboid(DVec3::ZERO, DVec3::new(end(count - 1), 3.0, 2.5), true, wall);
    for n in 0..count - 1 {
        let mut panel = |from: f64, to: f64, low: f64| {
            let corner = DVec3::new(end(n) - 0.05, from, low);
            model.cuboid(corner, DVec3::new(end(n) + 0.05, to, 2.5), false, wall);
        };
        panel(0.0, 1.0, 0.0);
        panel(1.9, 3.0, 0.0);
        panel(1.0, 1.9, if shut == Some(n) { 0.0 } else { 2.05 });
    }
    model
}

/// Returns whether a point is in a box.
fn is_in(point: DVec3, origin: DVec3, axes: [DVec3; 3]) -> bool {
    axes.iter().all(|axis| {
        let share = (point - origin).dot(*axis) / axis.length_squared();
        (0.0..=1.0).contains(&share)
    })
}

/// Returns the boxes of rooms and doors.
fn boxes(survey: &Survey) -> Vec<(DVec3, [DVec3; 3])> {
    let rooms = survey.rooms.iter().map(|room| (room.origin, room.axes));
    rooms.chain(survey.doors.iter().map(|door| (door.origin, door.axes))).collect()
}

#[test]
fn a_walk_through_a_door_is_always_in_a_box() {
    for (name, model, y) in
        [("two rooms", flat(1.0, |p| p), 1.95), ("ten rooms", row_of_rooms(10, None), 1.45)]
    {
        let (mut survey, raycaster) = model.survey(DVec3::Z, None);
        assert!(survey.doors.is_empty());
        let rooms = survey.rooms.len();
        survey.limit(rooms);
        assert_eq!(survey.doors.len(), rooms - 1, "{name}");
        let boxes = boxes(&survey);
        assert!(
            boxes
                .iter()
                .all(|(origin, axes)| { !raycaster.scene().geometry_inside(*origin, *axes) })
        );
        let ends = boxes.iter().map(|(origin, axes)| [origin.x, origin.x + axes[0].x]);
        let (low, high) =
            ends.fold((f64::MAX, 0.0_f64), |(low, high), [from, to]| (low.min(from), high.max(to)));
        for step in 1..1000 {
            let eye = DVec3::new(low + (high - low) * f64::from(step) / 1000.0, y, 1.6);
            assert!(boxes.iter().any(|(o, axes)| is_in(eye, *o, *axes)), "{name}: {eye}");
        }
        // A box in a door is as wide as the door, so that an eye within it sees the jambs.
        for door in &survey.doors {
            assert!(door.axes[1].y > 0.6 && door.axes[1].y < 0.9, "{name}: {door:?}");
            assert!(door.axes[0].x < 1.3, "{name}: {door:?}");
        }
    }
}

#[test]
fn rooms_behind_a_wall_without_a_door_are_not_joined() {
    let (mut survey, _) = row_of_rooms(3, Some(1)).survey(DVec3::Z, None);
    assert_eq!(survey.rooms.len(), 3);
    survey.limit(3);
    assert_eq!(survey.doors.len(), 1);
    assert!((survey.doors[0].origin.x - 4.0).abs() < 0.7, "{:?}", survey.doors[0]);
}

#[test]
fn a_limit_keeps_the_largest_rooms_and_the_doors_between_them() {
    let (mut survey, raycaster) = row_of_rooms(10, None).survey(DVec3::Z, None);
    assert_eq!(survey.rooms.len(), 10);
    let area = |n: usize| survey.rooms[n].axes[0].x * survey.rooms[n].axes[1].y;
    assert!((1..10).all(|n| area(n) <= area(n - 1)));
    survey.limit(2);
    assert_eq!((survey.rooms.len(), survey.doors.len()), (2, 1));
    let from = |n: usize| survey.rooms[n].origin.x;
    assert!(from(0) < 1.0 && (4.0..5.0).contains(&from(1)), "the two at the end are longer");
    assert_eq!(survey.views(&raycaster).len(), 2);
    survey.limit(1);
    assert!(survey.doors.is_empty());
}

#[test]
fn the_unit_follows_from_the_height_of_rooms_unless_it_is_stated() {
    for unit in [0.001, 0.01, 0.0254, 0.3048, 1.0] {
        let (survey, _) = flat(1.0 / unit, |p| p).survey(DVec3::Z, None);
        assert_eq!(survey.unit.value, unit, "{}", survey.unit.reason);
        assert_eq!(survey.rooms.len(), 2, "{unit}");
    }
    let (survey, _) = flat(1.0, |p| p).survey(DVec3::Z, Some(0.5));
    assert_eq!(survey.unit.value, 0.5);
    assert!(!survey.rooms.is_empty(), "rooms too low for a person have eyes, too");
}

#[test]
fn a_room_is_seen_along_its_longest_line_from_within() {
    let (survey, raycaster) = flat(1.0, |p| p).survey(DVec3::Z, None);
    let sight = survey.rooms[0].sight;
    assert!((sight.eye.z - 1.6).abs() < 0.1, "{sight:?}");
    let (ray, _) = raycaster.localize(sight.eye, sight.direction).unwrap();
    let ahead = raycaster.nearest(&Ray { t_max: f32::INFINITY, ..ray }).unwrap().t;
    assert!(ahead > 4.5, "{ahead}");
    assert_eq!(survey.views(&raycaster)[0], ("room 1".to_owned(), sight));
}

#[test]
fn scenes_may_lie_on_their_side() {
    // Up is +y, as in most model files: z points towards the viewer.
    let model = flat(1.0, |p| DVec3::new(p.x, p.z, -p.y));
    let (survey, _) = model.survey(DVec3::Y, None);
    assert_eq!(survey.rooms.len(), 2);
    assert!((survey.rooms[0].sight.eye.y - 1.6).abs() < 0.1);
    assert_eq!(survey.rooms[0].sight.up, DVec3::Y);
}

#[test]
fn faces_turned_round_do_not_hide_a_room() {
    let mut model = flat(1.0, |p| p);
    model.triangles.iter_mut().step_by(2).for_each(|t| t.reverse());
    assert_eq!(model.survey(DVec3::Z, None).0.rooms.len(), 2);
}

/// Returns whether a view of 16:9 shows all corners of a model.
fn shows_all(model: &Model, sight: &ChosenView) -> bool {
    let right = sight.direction.cross(sight.up).normalize();
    let above = right.cross(sight.direction);
    let slope = (sight.angle / 2.0).to_radians().tan();
    model.positions.iter().all(|corner| {
        let towards = *corner - sight.eye;
        let ahead = towards.dot(sight.direction) * slope;
        towards.dot(right).abs() < ahead && towards.dot(above).abs() < ahead * 9.0 / 16.0
    })
}

#[test]
fn objects_have_no_rooms_and_are_seen_whole_from_outside() {
    let mut ball = Model::default();
    let steel = ball.material("steel", 0.0);
    ball.sphere(DVec3::new(10.0, 20.0, 30.0), 3.0, steel);
    let mut crate_of_wood = Model::default();
    let wood = crate_of_wood.material("wood", 0.0);
    crate_of_wood.cuboid(DVec3::ZERO, DVec3::splat(3.0), false, wood);
    let mut post = Model::default();
    post.material("wood", 0.0);
    post.cuboid(DVec3::ZERO, DVec3::new(0.1, 0.1, 7.0), false, 0);
    // Each side has a material, as in some test models.
    let mut dice = Model::default();
    dice.cuboid(DVec3::ZERO, DVec3::splat(3.0), false, 0);
    dice.ids = (0..12).map(|triangle| triangle / 2).collect();
    (0..6).for_each(|side| _ = dice.material(&format!("side {side}"), 0.0));
    for model in [ball, crate_of_wood, post, dice] {
        let (survey, raycaster) = model.survey(DVec3::Z, None);
        assert!(survey.rooms.is_empty() && survey.plan().is_none());
        let (name, sight) = &survey.views(&raycaster)[0];
        assert_eq!(name, "outside");
        assert!(shows_all(&model, sight), "{sight:?}");
    }
}

#[test]
fn no_board_is_looked_at_along_its_surface() {
    for turn in 0..36 {
        let (sin, cos) = (f64::from(turn) / 36.0 * PI).sin_cos();
        for tilt in [0.0, 0.5, 1.0, 2.0] {
            let mut board = Model::default();
            board.material("wood", 0.0);
            let side = DVec3::new(cos, sin, 0.0);
            let up = DVec3::new(-sin * tilt, cos * tilt, 1.0).normalize();
            board.quad([DVec3::ZERO, side, side + up, up], 0);
            let (survey, raycaster) = board.survey(DVec3::Z, None);
            let shown = side.cross(up).dot(survey.outside(&raycaster).direction).abs();
            assert!(shown > 0.3, "{turn} {tilt}: {shown}");
            assert!(shows_all(&board, &survey.outside(&raycaster)));
        }
    }
}

#[test]
fn a_box_is_looked_at_through_its_open_side() {
    for (open, shine) in (0..4).flat_map(|open| [(open, 5.0), (open, 0.0)]) {
        let (sin, cos) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][open];
        let mut stage = Model::default();
        let (wall, lamp) = (stage.material("wall", 0.0), stage.material("lamp", shine));
        stage.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), true, wall);
        // Without the side at y = -1. The lamp below the lid shines down.
        let is_open = |triangle: &[u32; 3]| {
            triangle.iter().all(|&corner| stage.positions[corner as usize].y == -1.0)
        };
        stage.triangles = stage.triangles.iter().filter(|t| !is_open(t)).copied().collect();
        stage.ids.truncate(stage.triangles.len());
        let corners = [[-0.3, -0.3], [-0.3, 0.3], [0.3, 0.3], [0.3, -0.3]];
        stage.quad(corners.map(|[x, y]| DVec3::new(x, y, 0.9)), lamp);
        let turn = |p: DVec3| DVec3::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos, p.z);
        stage.positions.iter_mut().for_each(|p| *p = turn(*p));
        let (survey, raycaster) = stage.survey(DVec3::Z, None);
        let ahead = turn(DVec3::Y).dot(survey.outside(&raycaster).direction);
        assert!(
            survey.rooms.is_empty() && ahead > 0.999,
            "{open}: {:?}",
            survey.outside(&raycaster)
        );
        assert!(shows_all(&stage, &survey.outside(&raycaster)));
    }
}

#[test]
fn a_screen_before_a_lamp_is_looked_at_from_its_lit_side() {
    for lit in [-1.0, 1.0] {
        let mut stage = Model::default();
        let (grey, lamp) = (stage.material("grey", 0.0), stage.material("lamp", 5.0));
        let square = |half: f64, y: f64| {
            [(-half, -half), (half, -half), (half, half), (-half, half)]
                .map(|(x, z)| DVec3::new(x, y, z))
        };
        stage.quad(square(1.0, 0.0), grey);
        // A screen of one triangle fills half of the bounds, so no side counts as open.
        stage.triangles.pop();
        stage.ids.pop();
        let mut corners = square(0.1, 0.8 * lit);
        // The first corners face -y.
        if lit < 0.0 {
            corners.reverse();
        }
        stage.quad(corners, lamp);
        let (survey, raycaster) = stage.survey(DVec3::Z, None);
        let towards = survey.outside(&raycaster).direction.y * lit;
        assert!(towards < -0.3, "{lit}: {towards}");
    }
}

#[test]
fn the_inside_of_a_device_is_no_room_even_if_it_glows() {
    // A case of 12 cm in a file in metres, emitting on both sides.
    let mut device = Model::default();
    let case = device.material("case", 1.0);
    device.cuboid(DVec3::ZERO, DVec3::new(0.12, 0.06, 0.05), false, case);
    device.materials[0].two_sided_emission = true;
    assert!(device.survey(DVec3::Z, Some(1.0)).0.rooms.is_empty());
    // A larger lantern glows outwards only.
    let mut lantern = Model::default();
    let glass = lantern.material("glass", 1.0);
    lantern.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), false, glass);
    assert!(lantern.survey(DVec3::Z, Some(1.0)).0.rooms.is_empty());
}

#[test]
fn a_lamp_in_a_box_makes_it_a_room_whichever_way_its_faces_look() {
    let mut model = Model::default();
    let (wall, lamp) = (model.material("w", 0.0), model.material("l", 5.0));
    model.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), false, wall);
    model.cuboid(DVec3::new(1.8, 1.4, 2.3), DVec3::new(2.2, 1.6, 2.4), false, lamp);
    assert_eq!(model.survey(DVec3::Z, None).0.rooms.len(), 1);
}

#[test]
fn a_surface_is_a_lamp_only_if_its_texture_of_emission_is_bright() {
    // One material has the shell of a post and a beam in it, and its texture says what glows.
    let mut model = Model::default();
    let post = model.material("post", 1.0);
    model.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), false, post);
    model.cuboid(DVec3::new(1.8, 1.4, 2.3), DVec3::new(2.2, 1.6, 2.4), false, post);
    for (texel, rooms) in [(0, 0), (10, 0), (200, 1)] {
        // A BMP file of one texel.
        let mut file = b"BM".to_vec();
        let words = [58, 0, 54, 40, 1, 1, 1 | 24 << 16, 0, 4, 0, 0, 0, 0];
        file.extend(words.into_iter().flat_map(i32::to_le_bytes));
        file.extend([texel, texel, texel, 0]);
        let texture = Texture::decode(file.into(), [Wrap::Repeat; 2], false, false).unwrap();
        let shading = Shading {
            uvs: vec![[[0.5; 2]; 3]; model.triangles.len()].into(),
            textures: vec![texture],
            maps: vec![Maps { emission: Some(0), ..Maps::default() }],
            ..Shading::default()
        };
        let scene = model.scene().with_shading(shading).unwrap();
        let raycaster = Raycaster::build(Arc::new(scene)).unwrap();
        let up = UprightAxes::new(DVec3::Z);
        let survey = Survey::new(&raycaster, up, Some(1.0), &ModelFacts::default());
        assert_eq!(survey.rooms.len(), rooms, "{texel}");
        assert_eq!(is_lit_by_lamps(&raycaster), texel == 200, "{texel}");
    }
}

#[test]
fn a_distant_ground_plane_does_not_hide_the_house() {
    let mut model = flat(1.0, |p| p);
    let grass = model.material("meadow", 0.0);
    // Small objects along the walls: most corners of the scene are in its house.
    for k in 0..200 {
        let (x, up) = (0.05 + 0.039 * f64::from(k), f64::from(k % 3) * 1.2);
        let y = if k % 2 == 0 { 0.05 } else { 3.9 };
        let low = DVec3::new(x, y, 0.01 + up);
        model.cuboid(low, low + 0.02, false, 0);
    }
    let far = 2000.0;
    let corner = |x: f64, y: f64| DVec3::new(x * far, y * far, -0.2);
    model.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], grass);
    assert_eq!(model.survey(DVec3::Z, None).0.rooms.len(), 2);
}

#[test]
fn a_plan_shows_walls_rooms_and_views() {
    let (mut survey, _) = flat(1.0, |p| p).survey(DVec3::Z, None);
    survey.limit(2);
    let plan = survey.plan().unwrap();
    assert_eq!(plan.rgb.len(), 3 * plan.width * plan.height);
    let mut colours: Vec<&[u8]> = plan.rgb.chunks(3).collect();
    colours.sort_unstable();
    colours.dedup();
    assert_eq!(colours.len(), 7, "outside, indoors, solid, two rooms, a door, views");
}

#[test]
fn up_follows_from_the_file_names_lamps_habits_or_shape_in_this_order() {
    let said = |value| Some(StatedValue { value, words: "so".to_owned() });
    let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let low = |sides: DVec3, name: &str| {
        let mut model = Model::default();
        let material = model.material(name, 0.0);
        model.cuboid(DVec3::ZERO, sides, false, material);
        model
    };
    let up = |model: &Model, about: &ModelFacts| guess_up(&model.scene(), about).value.to_array();
    let about = ModelFacts::default();
    assert_eq!(up(&low(DVec3::new(3.0, 3.0, 1.0), "a"), &about), z);
    assert_eq!(up(&low(DVec3::new(3.0, 1.0, 3.0), "a"), &about), y);
    assert_eq!(up(&low(DVec3::ONE, "a"), &about), y, "as in most files");
    let usual = ModelFacts { usual_up: said(y), ..ModelFacts::default() };
    let mut model = low(DVec3::new(3.0, 3.0, 1.0), "a");
    assert_eq!(up(&model, &usual), y);
    let lamp = model.material("lamp", 1.0);
    let corners = [[1.0, 1.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0]];
    model.quad(corners.map(|[x, y]| DVec3::new(x, y, 0.9)), lamp);
    assert_eq!(up(&model, &usual), z, "the lamp shines down");
    let floor = model.material("Floor_01", 0.0);
    model.quad(
        [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, z]| DVec3::new(x, 0.5, z)),
        floor,
    );
    assert_eq!(up(&model, &usual), y);
    assert_eq!(up(&model, &ModelFacts { up: said(z), ..usual }), z);
}

impl Model {
    /// A closed surface around an upright axis: circles of these radii at these heights, with a
    /// material for each ring of faces. Its front faces look outwards.
    fn turned(&mut self, rings: &[(f64, f64, u32)], axis: DVec3) {
        let sides = 24;
        let at = |(radius, height, _): (f64, f64, u32), i: usize| {
            let (sin, cos) = (i as f64 / sides as f64 * TAU).sin_cos();
            axis + DVec3::new(radius * cos, radius * sin, height)
        };
        for (pair, i) in rings.windows(2).flat_map(|pair| (0..sides).map(move |i| (pair, i))) {
            let [low, high] = [pair[0], pair[1]];
            self.quad([at(low, i), at(low, i + 1), at(high, i + 1), at(high, i)], high.2);
        }
    }

    fn scaled(mut self, scale: f64) -> Model {
        self.positions.iter_mut().for_each(|p| *p *= scale);
        self
    }
}

/// A person of 1.8 m with shoes, trousers, a shirt, a head, and eyes of their own within it.
fn figure() -> Model {
    let mut model = Model::default();
    let [shoes, trousers, shirt, skin, eyes] =
        ["shoes", "trousers", "shirt", "skin", "eyes"].map(|name| model.material(name, 0.0));
    let body = [
        (0.0, 0.0, shoes),
        (0.3, 0.0, shoes),
        (0.3, 0.1, shoes),
        (0.32, 0.9, trousers),
        (0.35, 1.4, shirt),
        (0.16, 1.5, skin),
        (0.2, 1.65, skin),
        (0.1, 1.78, skin),
        (0.0, 1.8, skin),
    ];
    model.turned(&body, DVec3::ZERO);
    for x in [-0.05, 0.05] {
        model.sphere(DVec3::new(x, 0.12, 1.65), 0.02, eyes);
    }
    model
}

/// An armchair of closed solids: base, cushion, back and arms, each of its own material.
fn armchair() -> Model {
    let mut model = Model::default();
    let parts = [
        ("base", [0.0, 0.0, 0.05], [0.9, 0.9, 0.4]),
        ("cushion", [0.15, 0.1, 0.4], [0.75, 0.7, 0.55]),
        ("back", [0.0, 0.7, 0.4], [0.9, 0.9, 1.0]),
        ("arm", [0.0, 0.0, 0.4], [0.15, 0.7, 0.65]),
        ("arm", [0.75, 0.0, 0.4], [0.9, 0.7, 0.65]),
    ];
    for (name, low, high) in parts {
        let material = model.material(name, 0.0);
        model.cuboid(DVec3::from_array(low), DVec3::from_array(high), false, material);
    }
    model
}

/// A car with open windows: a body and a roof of outward faces, seats, and wheels. With `lining`,
/// the cabin has faces of its own that look inwards.
fn car(lining: bool) -> Model {
    let mut model = Model::default();
    let [paint, cloth, rubber, trim] =
        ["paint", "cloth", "rubber", "trim"].map(|name| model.material(name, 0.0));
    model.cuboid(DVec3::new(0.0, 0.0, 0.25), DVec3::new(4.4, 1.8, 0.8), false, paint);
    model.cuboid(DVec3::new(1.2, 0.1, 1.25), DVec3::new(3.4, 1.7, 1.3), false, paint);
    for x in [1.2, 2.2, 3.35] {
        for y in [0.1, 1.65] {
            model.cuboid(DVec3::new(x, y, 0.8), DVec3::new(x + 0.05, y + 0.05, 1.25), false, paint);
        }
    }
    for x in [1.7, 2.6] {
        for y in [0.3, 1.0] {
            model.cuboid(DVec3::new(x, y, 0.8), DVec3::new(x + 0.5, y + 0.5, 0.85), false, cloth);
        }
    }
    for (x, y) in [(0.8, 0.05), (0.8, 1.6), (3.6, 0.05), (3.6, 1.6)] {
        model.sphere(DVec3::new(x, y + 0.07, 0.3), 0.3, rubber);
    }
    if lining {
        model.cuboid(DVec3::new(1.25, 0.15, 0.35), DVec3::new(3.35, 1.65, 1.24), true, trim);
    }
    model
}

#[test]
fn things_on_their_own_are_seen_from_outside() {
    for (name, model) in [
        ("figure", figure()),
        ("armchair", armchair()),
        ("car", car(false)),
        ("lined car", car(true)),
    ] {
        // Metres as the file says, and units that nobody says.
        for (scale, unit) in [(1.0, Some(1.0)), (1.0, None), (100.0, Some(0.01)), (100.0, None)] {
            let model = Model {
                positions: model.positions.clone(),
                triangles: model.triangles.clone(),
                ids: model.ids.clone(),
                materials: model.materials.clone(),
            };
            let model = model.scaled(scale);
            let (survey, raycaster) = model.survey(DVec3::Z, unit);
            let views = survey.views(&raycaster);
            let of = format!("{name} {scale} {unit:?}: {:?}, {views:?}", survey.unit);
            assert_eq!(views[0].0, "outside", "{of}");
            assert!(shows_all(&model, &views[0].1), "{of}");
            // A cabin may be named, and the place between the arms of a chair of unknown size.
            let may_have_rooms = name.contains("car") || unit.is_none();
            assert!(may_have_rooms || survey.rooms.is_empty(), "{of}");
        }
    }
}

#[test]
fn a_van_with_a_hold_is_seen_from_outside_and_its_hold_is_named() {
    let mut van = Model::default();
    let [paint, steel, rubber] = ["paint", "steel", "rubber"].map(|name| van.material(name, 0.0));
    van.cuboid(DVec3::new(0.0, 0.0, 0.6), DVec3::new(6.0, 2.4, 3.0), false, paint);
    van.cuboid(DVec3::new(0.1, 0.1, 0.7), DVec3::new(5.9, 2.3, 2.9), true, steel);
    for (x, y) in [(1.0, 0.0), (1.0, 2.4), (5.0, 0.0), (5.0, 2.4)] {
        van.sphere(DVec3::new(x, y, 0.1), 0.5, rubber);
    }
    let (survey, raycaster) = van.survey(DVec3::Z, Some(1.0));
    let names: Vec<String> = survey.views(&raycaster).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["outside", "room 1"]);
    assert!(survey.is_thing);
}

#[test]
fn rooms_are_seen_from_within_whatever_their_unit_and_walls() {
    // Walls without thickness, in units that nobody says: a person's room, and one of a doll.
    for scale in [1.0, 0.4, 0.05] {
        let (survey, raycaster) = flat(scale, |p| p).survey(DVec3::Z, None);
        assert_eq!(survey.views(&raycaster)[0].0, "room 1", "{scale}");
    }
    // A room with thick walls and furniture.
    let mut model = flat(1.0, |p| p);
    model.cuboid(DVec3::splat(-0.2), DVec3::new(8.2, 4.2, 2.7), false, 0);
    let (survey, raycaster) = model.survey(DVec3::Z, None);
    assert_eq!(survey.views(&raycaster)[0].0, "room 1");
    assert!(!survey.is_thing);
    // The same house for dolls is a thing, and its rooms are named.
    let (survey, raycaster) = model.scaled(1.0 / 6.0).survey(DVec3::Z, Some(1.0));
    let names: Vec<String> = survey.views(&raycaster).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["outside", "room 1", "room 2"]);
}
