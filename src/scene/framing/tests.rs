use super::*;
use crate::scene::{Shape, generate, normals};

/// Returns a view from the default direction, for images with the aspect ratio `aspect`.
const fn three_quarter(aspect: f64) -> View {
    View {
        up: DVec3::Y,
        azimuth_degrees: None,
        elevation_degrees: None,
        lens: None,
        shot: Shot { aspect, ..Shot::SQUARE },
    }
}

fn from(azimuth: f64, elevation: f64, up: DVec3) -> View {
    View { up, azimuth_degrees: Some(azimuth), elevation_degrees: Some(elevation), ..three_quarter(1.6) }
}

/// Returns the extent of a mesh in a picture, as fractions of half the picture's width and height: left,
/// right, bottom, top.
fn extent(camera: &Camera, mesh: &Mesh, aspect: f64) -> [f64; 4] {
    let mut extent = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for position in &mesh.positions {
        let offset = (*position - camera.position).as_dvec3();
        let depth = offset.dot(camera.forward.as_dvec3()) * f64::from(camera.tan_half_fov);
        assert!(depth > 0.0);
        let x = offset.dot(camera.right.as_dvec3()) / depth / aspect;
        let y = offset.dot(camera.up.as_dvec3()) / depth;
        extent = [extent[0].min(x), extent[1].max(x), extent[2].min(y), extent[3].max(y)];
    }
    extent
}

/// Returns a box of this size around the point `centre`.
fn block(size: Vec3, centre: Vec3) -> Mesh {
    let mut mesh = generate(&Shape::Sphere { triangles: 400 });
    let corner = |p: Vec3| p.signum() * size / 2.0 + centre;
    mesh.positions.iter_mut().for_each(|p| *p = corner(*p));
    mesh
}

#[test]
fn the_whole_mesh_fills_a_picture_across_or_down_at_any_scale_and_length() {
    let mut teapot = generate(&Shape::Teapot { fineness: 4 });
    teapot.positions.iter_mut().for_each(|p| *p += 3.0);
    let long = [Vec3::new(40.0, 1.0, 1.0), Vec3::new(1.0, 40.0, 1.0), Vec3::new(1.0, 1.0, 40.0)];
    let blocks = long.map(|size| block(size, Vec3::new(-7.0, 2.0, 5.0)));
    for mesh in blocks.into_iter().chain([teapot]) {
        for (scale, aspect) in [(1e-4_f32, 1.6), (1.0, 0.5), (1.0, 1.0), (1e4, 2.4)] {
            let mut mesh = mesh.clone();
            mesh.positions.iter_mut().for_each(|p| *p *= scale);
            let view = three_quarter(aspect);
            let camera = camera(&mesh, Ball::around(&mesh, view.up), &view);
            let [left, right, bottom, top] = extent(&camera, &mesh, aspect);
            let (across, down) = (right - left, top - bottom);
            assert!((1.82..1.86).contains(&across.max(down)), "{across} {down} at {scale}, {aspect}");
            assert!(left > -0.93 && right < 0.93 && bottom > -0.93 && top < 0.93);
        }
    }
}

/// Returns the camera for a field of view in degrees, and the tangents of half its field of view across the
/// width and across the height.
fn with_lens(mesh: &Mesh, degrees: f64, fov_is_vertical: bool, shot: Shot) -> (Camera, [f64; 2]) {
    let tan = (degrees.to_radians() / 2.0).tan();
    let lens = Lens { tan_half_fov: tan as f32, fov_is_vertical };
    let view = View { lens: Some(lens), shot, ..three_quarter(shot.aspect) };
    let camera = camera(mesh, Ball::around(mesh, view.up), &view);
    let across_and_down = if fov_is_vertical { [tan * shot.aspect, tan] } else { [tan, tan / shot.aspect] };
    (camera, across_and_down)
}

/// Turns a mesh by `turn` about the origin. Returns the largest distances of the mesh's points from the
/// middle of a picture, as fractions of half the picture's width and height.
fn reach(camera: &Camera, mesh: &Mesh, [tan_x, tan_y]: [f64; 2], turn: DMat3) -> [f64; 2] {
    let mut reach = [0.0_f64; 2];
    for position in &mesh.positions {
        let offset = turn * position.as_dvec3() - camera.position.as_dvec3();
        let depth = offset.dot(camera.forward.as_dvec3());
        assert!(depth > 0.0);
        let x = offset.dot(camera.right.as_dvec3()) / (depth * tan_x);
        let y = offset.dot(camera.up.as_dvec3()) / (depth * tan_y);
        reach = [reach[0].max(x.abs()), reach[1].max(y.abs())];
    }
    reach
}

#[test]
fn the_distance_fits_the_field_of_view_across_the_width_or_the_height() {
    let mesh = generate(&Shape::Sphere { triangles: 400 });
    for (degrees, fov_is_vertical) in [(2.0, true), (10.0, false), (10.0, true), (70.0, false), (70.0, true)]
    {
        for aspect in [0.5, 1.0, 2.4] {
            let shot = Shot { aspect, ..Shot::SQUARE };
            let (camera, tangents) = with_lens(&mesh, degrees, fov_is_vertical, shot);
            assert_eq!(camera.fov_is_vertical, fov_is_vertical);
            let [x, y] = reach(&camera, &mesh, tangents, DMat3::IDENTITY);
            assert!((0.9..0.93).contains(&x.max(y)), "{x} {y}: {degrees} {fov_is_vertical} {aspect}");
        }
    }
}

#[test]
fn a_field_of_view_of_35_degrees_across_the_height_is_the_default_to_the_last_bit() {
    let mesh = generate(&Shape::Teapot { fineness: 4 });
    for turns in [false, true] {
        let shot = Shot { aspect: 1.6, turns, ..Shot::SQUARE };
        let view = View { shot, ..three_quarter(1.6) };
        let usual = camera(&mesh, Ball::around(&mesh, view.up), &view);
        assert_eq!(with_lens(&mesh, 35.0, true, shot).0, usual);
    }
}

#[test]
fn what_turns_is_seen_whole_with_any_field_of_view() {
    let mesh = block(Vec3::new(20.0, 1.0, 3.0), Vec3::ZERO);
    let shot = Shot { aspect: 1.6, turns: true, ..Shot::SQUARE };
    for (degrees, fov_is_vertical) in [(5.0, true), (20.0, false), (80.0, false)] {
        let (camera, tangents) = with_lens(&mesh, degrees, fov_is_vertical, shot);
        let mut most = 0.0_f64;
        for step in 0..90_i32 {
            let turn = DMat3::from_rotation_y(f64::from(step) * 4.0_f64.to_radians());
            let [x, y] = reach(&camera, &mesh, tangents, turn);
            most = most.max(x).max(y);
        }
        assert!((0.9..0.96).contains(&most), "{most}: {degrees} {fov_is_vertical}");
    }
}

#[test]
fn what_turns_is_seen_whole_from_all_around() {
    let mesh = block(Vec3::new(20.0, 1.0, 3.0), Vec3::new(4.0, 0.0, 0.0));
    let view = View { shot: Shot { aspect: 1.6, turns: true, ..Shot::SQUARE }, ..from(0.0, 20.0, DVec3::Y) };
    let camera = camera(&mesh, Ball::around(&mesh, view.up), &view);
    let mut widest: f64 = 0.0;
    for step in 0..90 {
        let turn = glam::Mat3::from_rotation_y(step as f32 * 4.0_f32.to_radians());
        let mut turned = mesh.clone();
        let centre = Vec3::new(4.0, 0.0, 0.0);
        turned.positions.iter_mut().for_each(|p| *p = turn * (*p - centre) + centre);
        let [left, right, bottom, top] = extent(&camera, &turned, 1.6);
        widest = widest.max(right).max(-left);
        assert!(bottom > -1.0 && top < 1.0, "{bottom} {top}");
    }
    assert!((0.9..0.96).contains(&widest), "{widest}");
}

#[test]
fn azimuth_goes_from_front_to_right_and_elevation_up() {
    let mesh = block(Vec3::ONE, Vec3::ZERO);
    let eye = |view: View| camera(&mesh, Ball::around(&mesh, view.up), &view).position.normalize();
    for (view, direction) in [
        (from(0.0, 0.0, DVec3::Y), Vec3::Z),
        (from(90.0, 0.0, DVec3::Y), Vec3::X),
        (from(0.0, 90.0, DVec3::Y), Vec3::Y),
        (from(0.0, 0.0, DVec3::Z), Vec3::NEG_Y),
        (from(90.0, 0.0, DVec3::Z), Vec3::X),
        (from(45.0, -90.0, DVec3::Z), Vec3::NEG_Z),
        (from(0.0, 0.0, DVec3::NEG_Z), Vec3::NEG_Y),
        (from(-90.0, 0.0, DVec3::NEG_Y), Vec3::X),
        (from(0.0, 0.0, DVec3::NEG_Y), Vec3::Z),
        (from(0.0, 0.0, DVec3::X), Vec3::Z),
        (from(0.0, 0.0, DVec3::NEG_X), Vec3::Z),
    ] {
        assert!(eye(view).distance(direction) < 1e-5, "{view:?}: {}", eye(view));
    }
    let top = camera(&mesh, Ball::around(&mesh, DVec3::Z), &from(0.0, 90.0, DVec3::Z));
    assert!(top.up.distance(Vec3::Y) < 1e-5, "the front is at the bottom");
}

#[test]
fn an_angle_that_is_not_given_is_that_of_a_bare_mesh() {
    let without_left_wall = sides_of_box(Vec3::ZERO, Vec3::new(3.0, 2.0, 4.0), [0, 1, 1, 1, -1, -1]);
    for (mesh, usual) in [(block(Vec3::ONE, Vec3::ZERO), [31.0, 21.0]), (without_left_wall, [-90.0, 0.0])] {
        for given in [[None, None], [None, Some(10.0)], [Some(50.0), None], [Some(50.0), Some(10.0)]] {
            let [azimuth_degrees, elevation_degrees] = given;
            let view = View { azimuth_degrees, elevation_degrees, ..three_quarter(1.6) };
            let eye = -camera(&mesh, Ball::around(&mesh, view.up), &view).forward.as_dvec3();
            let actual = [eye.x.atan2(eye.z), eye.y.asin()].map(f64::to_degrees);
            let expected = [0, 1].map(|angle: usize| given[angle].unwrap_or(usual[angle]));
            assert!(
                (0..2).all(|i| (actual[i] - expected[i]).abs() < 0.2),
                "{actual:?}, expected {expected:?}"
            );
        }
    }
}

#[test]
fn z_up_looks_as_y_up_does() {
    let mut mesh = generate(&Shape::Teapot { fineness: 4 });
    let view = three_quarter(1.6);
    let upright = camera(&mesh, Ball::around(&mesh, view.up), &view);
    for vector in mesh.positions.iter_mut().chain(&mut mesh.normals) {
        *vector = Vec3::new(vector.x, -vector.z, vector.y);
    }
    let view = View { up: DVec3::Z, ..view };
    let turned = camera(&mesh, Ball::around(&mesh, view.up), &view);
    let Vec3 { x, y, z } = upright.position;
    assert!(turned.position.distance(Vec3::new(x, -z, y)) < 1e-4 * upright.position.length());
}

#[test]
fn a_facing_surface_shows_80_to_90_percent_at_any_scale() {
    for scale in [1e-3, 1.0, 1e4_f32] {
        let mut mesh = generate(&Shape::Sphere { triangles: 100 });
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let ball = Ball::around(&mesh, DVec3::Y);
        let key = lights(&camera(&mesh, ball, &three_quarter(1.0)), ball)[0];
        let at_centre = ball.centre.distance(key.position.as_dvec3());
        assert!((at_centre / ball.radius - 10.0).abs() < 1e-3, "{at_centre} at {scale}: ten radii away");
        for distance in [at_centre, 9.5 * ball.radius] {
            let pi = std::f64::consts::PI;
            let radiance = f64::from(key.power.x) / (4.0 * pi * distance * distance) * 0.8 / pi;
            let grey = (15.0 * radiance).powf(1.0 / 2.2);
            assert!((0.79..0.9).contains(&grey), "{grey}");
        }
    }
}

#[test]
fn a_point_is_framed_too() {
    let mut mesh = generate(&Shape::Ground);
    mesh.positions.iter_mut().for_each(|p| *p = Vec3::new(1.0, 1.0, -2.0));
    let ball = Ball::around(&mesh, DVec3::Y);
    let camera = camera(&mesh, ball, &three_quarter(1.6));
    assert!(camera.position.is_finite() && camera.position.distance(ball.centre.as_vec3()) > 0.0);
    assert!(lights(&camera, ball).iter().all(|light| light.power.min_element() > 0.0));
}

/// Far from the origin, neighbouring f32 numbers are far apart, so an eye very close to a point could round
/// to this point.
#[test]
fn the_eye_is_not_in_the_centre_of_a_point_far_from_the_origin() {
    let mut mesh = generate(&Shape::Ground);
    let point = Vec3::new(3e6, 4e6, 1.2e7);
    mesh.positions.iter_mut().for_each(|position| *position = point);
    let ball = Ball::around(&mesh, DVec3::Y);
    // The point is 1.3e7 away from the origin, and the ball's radius is a millionth of this distance.
    assert!((ball.radius - 13.0).abs() < 1e-9, "{}", ball.radius);
    let camera = camera(&mesh, ball, &three_quarter(1.0));
    assert_ne!(camera.position, point);
}

#[test]
fn a_small_mesh_far_from_the_origin_fills_the_picture() {
    for far in [1e3, 1e5, 1e6] {
        let mesh = block(Vec3::splat(2.0), Vec3::new(far, 0.0, 0.0));
        let ball = Ball::around(&mesh, DVec3::Y);
        assert!((ball.radius - 3.0_f64.sqrt()).abs() < 1e-9, "{}", ball.radius);
        let camera = camera(&mesh, ball, &three_quarter(1.0));
        let [left, right, bottom, top] = extent(&camera, &mesh, 1.0);
        let larger = (right - left).max(top - bottom);
        // If the mesh is 1e6 away from the origin along x, the eye's x coordinate is rounded to a sixteenth.
        assert!((1.75..1.95).contains(&larger), "{larger} at {far}");
    }
}

#[test]
fn the_key_light_is_to_the_viewers_upper_left_and_the_fill_light_to_the_right() {
    let mesh = block(Vec3::ONE, Vec3::new(3.0, 4.0, 5.0));
    let ball = Ball::around(&mesh, DVec3::Y);
    // Seen from +z, x points to the right and y upwards.
    let camera = camera(&mesh, ball, &from(0.0, 0.0, DVec3::Y));
    let towards = |ball: Ball| -> Vec<DVec3> {
        let of = |light: &Light| light.position.as_dvec3() - ball.centre;
        lights(&camera, ball).iter().map(of).collect()
    };
    let [key, fill] = towards(Ball { opening: None, ..ball })[..] else { panic!("two lights") };
    assert!(key.x < 0.0 && key.y > 0.0 && key.z > 0.0, "{key}");
    assert!(fill.x > 0.0 && fill.y > 0.0 && fill.z > 0.0, "{fill}");
    // Here, the mesh counts as open towards +z, where the eye is. Only light from the eye's side would enter such a
    // mesh.
    for light in towards(Ball { opening: Some(DVec3::Z), ..ball }) {
        assert!(light.normalize().z > 0.9, "{light}");
    }
    for opening in [None, Some(DVec3::Z)] {
        let [key, fill] = lights(&camera, Ball { opening, ..ball })[..] else { panic!("two lights") };
        assert!((fill.power.x / key.power.x - 0.3).abs() < 1e-6, "{opening:?}");
    }
}

#[test]
fn a_position_that_no_triangle_uses_does_not_move_the_camera() {
    let mesh = block(Vec3::ONE, Vec3::new(3.0, 4.0, 5.0));
    let mut other = mesh.clone();
    other.positions.push(Vec3::new(100.0, 0.0, 0.0));
    let seen = |mesh: &Mesh| camera(mesh, Ball::around(mesh, DVec3::Y), &three_quarter(1.0));
    assert_eq!(seen(&other).position, seen(&mesh).position);
}

#[test]
fn a_room_may_have_a_wall_that_leans_a_little() {
    let mut room = sides_of_box(Vec3::ZERO, Vec3::new(3.0, 2.0, 4.0), [-1, -1, -1, -1, -1, 0]);
    let upper_left = room.positions.iter_mut().filter(|p| p.x == 0.0 && p.y == 2.0);
    upper_left.for_each(|corner| corner.x = 0.1);
    assert_eq!(Ball::around(&room, DVec3::Y).opening, Some(DVec3::Z));
}

#[test]
fn a_mesh_is_open_if_opposite_sides_differ_by_more_than_a_tenth_of_its_area() {
    let opening = |back: f32| {
        let rectangle = |width: f32, z: f32| {
            [[0.0, 0.0], [width, 0.0], [width, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z))
        };
        let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
        let mesh = Mesh {
            positions: [rectangle(1.0, 0.0), rectangle(back, -1.0)].concat(),
            triangles: [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]].map(triangle).to_vec(),
            ..generate(&Shape::Ground)
        };
        Ball::around(&mesh, DVec3::Y).opening
    };
    // The mesh has a front with an area of 1, and a back with the area `back`. If the back has an area of
    // 0.82, the two areas differ by 0.18, which is less than a tenth of their sum, 1.82. If the back has an
    // area of 0.8, the two areas differ by 0.2, which is more than a tenth of their sum, 1.8.
    assert_eq!([opening(0.82), opening(0.8)], [None, Some(DVec3::Z)]);
    assert_eq!(opening(1.25), Some(DVec3::NEG_Z));
}

/// Returns a box of this size. The box's corner with the smallest coordinates is at `corner`. `sides` has a
/// number for each side: left, right, bottom, top, back, front. The number is 1 if the side faces outwards,
/// -1 if it faces inwards, and 0 if it is missing.
fn sides_of_box(corner: Vec3, size: Vec3, sides: [i32; 6]) -> Mesh {
    // The three lowest bits of a corner's number say where the corner is along x, y and z: 0 at the end with
    // the smaller coordinate, and 1 at the other end.
    let units = (0..8_u32).map(|corner| Vec3::from_array([0, 1, 2].map(|axis| (corner >> axis & 1) as f32)));
    let outwards = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6_u32]];
    let positions = units.map(|unit| corner + unit * size).collect();
    let mut mesh = Mesh { positions, ..Mesh::default() };
    for ([a, b, c, d], side) in outwards.into_iter().zip(sides).filter(|(_, side)| *side != 0) {
        for [first, second] in [[b, c], [c, d]] {
            let positions = if side > 0 { [a, first, second] } else { [a, second, first] };
            mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
        }
    }
    normals::flatten(&mut mesh);
    mesh
}

fn opening_of_box(size: Vec3, sides: [i32; 6]) -> Option<DVec3> {
    Ball::around(&sides_of_box(Vec3::ZERO, size, sides), DVec3::Y).opening
}

#[test]
fn a_room_is_seen_through_its_open_side_whatever_the_order_of_its_corners() {
    let size = Vec3::new(3.0, 2.0, 4.0);
    for sides in [[-1, -1, -1, -1, -1, 0], [1, -1, 1, 1, 1, 0], [1, -1, -1, -1, -1, 0]] {
        assert_eq!(opening_of_box(size, sides), Some(DVec3::Z), "{sides:?}");
    }
    assert_eq!(opening_of_box(size, [0, 1, 1, 1, -1, -1]), Some(DVec3::NEG_X));
    assert_eq!(opening_of_box(size, [-1, 0, 1, 0, 1, 1]), Some(DVec3::X), "without a ceiling");
    // The first box has no open side; the second box is open at its back and at its front.
    assert_eq!(opening_of_box(size, [1, -1, 1, 1, 1, 1]), None);
    assert_eq!(opening_of_box(size, [1, -1, 1, 1, 0, 0]), None);
    // A single wall is no room, not even with a ground, so the wall is seen from its front.
    assert_eq!(opening_of_box(size, [0, 0, 0, 0, 1, 0]), Some(DVec3::NEG_Z));
    assert_eq!(opening_of_box(size, [0, 0, 1, 0, 1, 0]), Some(DVec3::NEG_Z));
}

/// The walls of a shell face outwards. The walls of a room also face outwards if its faces list their corners
/// in reversed order. Only bodies between the walls show that a mesh whose walls face outwards is a room.
#[test]
fn walls_that_face_outwards_are_a_shell_unless_there_are_bodies_inside() {
    let opening = |inside: &[(Vec3, Vec3, [i32; 6])]| {
        let mut mesh = sides_of_box(Vec3::ZERO, Vec3::new(3.0, 2.0, 4.0), [1, 1, 1, 1, 1, 0]);
        inside.iter().for_each(|(corner, size, sides)| mesh.append(sides_of_box(*corner, *size, *sides)));
        Ball::around(&mesh, DVec3::Y).opening
    };
    assert_eq!(opening(&[]), Some(DVec3::NEG_Z));
    let on_floor = Vec3::new(1.0, 0.0, 1.5);
    let cube = Vec3::splat(0.8);
    for sides in [[1; 6], [-1; 6], [1, 1, 0, 1, 1, 1]] {
        assert_eq!(opening(&[(on_floor, cube, sides)]), Some(DVec3::Z), "{sides:?}");
    }
    // The mesh counts as a shell, not as a room, if it contains only a small body, or if a part of the shell
    // is recessed.
    assert_eq!(opening(&[(on_floor, cube * 0.5, [1; 6])]), Some(DVec3::NEG_Z));
    let recess = (Vec3::new(0.5, 0.5, 1.0), Vec3::new(2.0, 1.2, 0.5), [0, 0, 0, 0, 1, 0]);
    assert_eq!(opening(&[recess]), Some(DVec3::NEG_Z));
}

/// Near each side of its bounding box, a rough surface has triangles that are together as large as a wall.
#[test]
fn a_rough_surface_is_no_room() {
    let count = 48_u32;
    let mut state = 1_u32;
    let mut height = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        3.0 * (state >> 16) as f32 / 65_536.0
    };
    let points = (0..=count).flat_map(|y| (0..=count).map(move |x| (x as f32, y as f32)));
    let positions = points.map(|(x, y)| Vec3::new(x, y, height())).collect();
    let squares = (0..count).flat_map(|y| (0..count).map(move |x| y * (count + 1) + x));
    let faces = squares.flat_map(|a| {
        let above = a + count + 1;
        [[a, above, above + 1], [a, above + 1, a + 1]]
    });
    let triangles = faces.map(|positions| Triangle { positions, normals: [0; 3], material: 0 }).collect();
    let mut mesh = Mesh { positions, triangles, ..Mesh::default() };
    normals::flatten(&mut mesh);
    let opening = Ball::around(&mesh, DVec3::Y).opening.unwrap_or(DVec3::NAN);
    assert!(opening.z < -0.99, "{opening}");
}

/// Like a room without its front wall, the scan of a human face is open on one side. Unlike a room, the scan must be
/// seen from outside.
#[test]
fn a_vaulted_surface_is_seen_from_its_front_whatever_the_order_of_its_corners() {
    let half = |is_reversed: bool, front: f32| {
        let mut mesh = generate(&Shape::Sphere { triangles: 1600 });
        let ahead = |triangle: &Triangle| mesh.corners(triangle).iter().all(|corner| corner.z > -1e-6);
        let mut triangles: Vec<_> = mesh.triangles.iter().copied().filter(ahead).collect();
        if is_reversed {
            triangles.iter_mut().for_each(|triangle| triangle.positions.reverse());
        }
        mesh.triangles = triangles;
        mesh.normals.iter_mut().for_each(|normal| *normal *= front);
        Ball::around(&mesh, DVec3::Y).opening.unwrap_or(DVec3::NAN)
    };
    for is_reversed in [false, true] {
        let [outer, inner] = [1.0, -1.0].map(|front| half(is_reversed, front));
        assert!(outer.z > 0.9 && inner.z < -0.9, "{outer} {inner}");
    }
}

#[test]
fn a_closed_mesh_is_closed_although_all_its_normals_have_the_same_direction() {
    let mut mesh = generate(&Shape::Sphere { triangles: 1600 });
    mesh.normals.iter_mut().for_each(|normal| *normal = Vec3::X);
    let ball = Ball::around(&mesh, DVec3::Y);
    assert!(ball.is_closed() && ball.opening.is_none());
}

/// Each of the 12 triangles of a cube has a twelfth of the cube's area. If one of these triangles is
/// reversed, the sum of the cube's area vectors has the length of a sixth of the cube's area.
#[test]
fn one_triangle_that_is_wound_wrongly_does_not_open_a_closed_mesh() {
    let cube = |wrong: &[usize], own_normals: bool| {
        let mut mesh = sides_of_box(Vec3::ZERO, Vec3::ONE, [1; 6]);
        for number in wrong {
            mesh.triangles[*number].positions.reverse();
        }
        if !own_normals {
            normals::flatten(&mut mesh);
        }
        let ball = Ball::around(&mesh, DVec3::Y);
        (ball.is_open(), ball.is_closed())
    };
    for wrong in 0..12 {
        assert_eq!(cube(&[wrong], true), (false, true), "{wrong}");
        assert_eq!(cube(&[wrong], false), (false, true), "{wrong}");
    }
    // If the mesh has its own normals, the order of corners does not matter. If the normals follow from the
    // order of corners, a cube with a whole side that faces inwards is not closed. In this test, the front
    // faces inwards; its triangles are the last two.
    assert_eq!(cube(&[10, 11], true), (false, true));
    assert_eq!(cube(&[10, 11], false), (false, false));
    // A cube without a side has the same sum of area vectors as a cube with one reversed triangle.
    let open = Ball::around(&sides_of_box(Vec3::ZERO, Vec3::ONE, [1, 1, 1, 1, 1, 0]), DVec3::Y);
    assert!(open.is_open() && !open.is_closed());
    // The largest triangle need not be the last one: a tiny closed box may follow.
    let mut cube_and_box = sides_of_box(Vec3::ZERO, Vec3::ONE, [1; 6]);
    cube_and_box.triangles[3].positions.reverse();
    cube_and_box.append(sides_of_box(Vec3::splat(0.5), Vec3::splat(1e-3), [1; 6]));
    normals::flatten(&mut cube_and_box);
    assert!(Ball::around(&cube_and_box, DVec3::Y).is_closed());
    // A sheet is open, even if it has two triangles in the same place.
    let mut sheet = sides_of_box(Vec3::ZERO, Vec3::ONE, [0, 0, 0, 0, 0, 1]);
    sheet.triangles.truncate(1);
    sheet.append(sheet.clone());
    assert!(Ball::around(&sheet, DVec3::Y).is_open());
}

/// The triangles and positions of a large mesh are processed in several chunks.
#[test]
fn a_large_mesh_is_framed_alike_in_any_order_of_its_parts() {
    let mesh = generate(&Shape::Sphere { triangles: 80_000 });
    assert!(mesh.positions.len() > 2 * PARALLEL_TRIANGLES);
    let mut reversed = mesh.clone();
    reversed.positions.reverse();
    reversed.triangles.reverse();
    let last = mesh.positions.len() as u32 - 1;
    for triangle in &mut reversed.triangles {
        triangle.positions = triangle.positions.map(|index| last - index);
    }
    assert_eq!(mesh.bounds(), reversed.bounds());
    assert!(mesh.visible_positions().into_iter().all(|is_visible| is_visible));
    let framed = |framed: &Mesh| camera(framed, Ball::around(&mesh, DVec3::Y), &three_quarter(1.6));
    assert_eq!(framed(&mesh), framed(&reversed));
}

/// The sums of a large mesh are computed in several chunks. The chunks contain different parts of the room and of the
/// body in the room, so that their sums differ.
#[test]
fn the_sums_of_a_large_mesh_are_those_over_all_its_triangles() {
    let mut mesh = sides_of_box(Vec3::ZERO, Vec3::new(3.0, 2.0, 4.0), [-1, 1, -1, -1, 1, 0]);
    mesh.append(sides_of_box(Vec3::new(1.0, 0.0, 1.5), Vec3::splat(0.8), [1, 1, 0, 1, -1, 1]));
    let repeated = mesh.triangles.iter().flat_map(|triangle| std::iter::repeat_n(*triangle, 5000));
    mesh.triangles = repeated.collect();
    let (low, high) = mesh.bounds().unwrap();
    let bounds = [low.as_dvec3(), high.as_dvec3()];
    let mut expected = Areas::default();
    for triangle in &mesh.triangles {
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        expected.add(corners, front_sign(&mesh, triangle, corners), bounds);
    }
    let numbers = |areas: Areas| {
        let Areas { vector, wound, area, largest, low_walls, high_walls, inner_vector, inner_area } = areas;
        let vectors = [vector, wound, low_walls, high_walls, inner_vector].map(|sum| sum.to_array());
        [vectors.as_flattened(), &[area, largest, inner_area]].concat()
    };
    let [sums, expected] = [Areas::of_mesh(&mesh, bounds), expected].map(numbers);
    for (sum, expected) in sums.iter().zip(&expected) {
        assert!((sum - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{sums:?}, not {expected:?}");
    }
}

#[test]
fn a_ball_is_around_the_bounding_box() {
    let ball = Ball::around(&block(Vec3::new(2.0, 4.0, 4.0), Vec3::new(1.0, 2.0, 3.0)), DVec3::Y);
    // The radius is half of the diagonal of a box of 2 x 4 x 4; the diagonal is 6.
    assert_eq!(ball.centre_and_radius(), (DVec3::new(1.0, 2.0, 3.0), 3.0));
    assert!(!ball.is_open());
}

#[test]
fn a_ball_is_closed_and_a_level_sheet_is_neither_closed_nor_a_room() {
    let sphere = generate(&Shape::Sphere { triangles: 400 });
    assert!(Ball::around(&sphere, DVec3::Y).is_closed());
    let sheet = sides_of_box(Vec3::ZERO, Vec3::ONE, [0, 0, 0, 1, 0, 0]);
    let ball = Ball::around(&sheet, DVec3::Y);
    assert!(!ball.is_open() && !ball.is_closed());
}

#[test]
fn a_turntable_stops_at_24_equal_steps_about_the_upward_direction() {
    let view = View { up: DVec3::Z, shot: Shot { turns: true, ..Shot::SQUARE }, ..three_quarter(1.0) };
    let turns = view.turns();
    assert_eq!((turns.len(), turns[0]), (24, DMat3::IDENTITY));
    assert!((turns[6] * DVec3::X).distance(DVec3::Y) < 1e-12, "a quarter");
    assert!((turns[12] * DVec3::X).distance(DVec3::NEG_X) < 1e-12 && turns[5] * DVec3::Z == DVec3::Z);
    assert_eq!(three_quarter(1.0).turns(), [DMat3::IDENTITY]);
}
