use super::*;
use crate::scene::{Shape, Triangle, generate};

/// Returns a view from the default direction, for images of an aspect ratio.
const fn three_quarter(aspect: f64) -> View {
    View {
        up: DVec3::Y,
        azimuth_degrees: None,
        elevation_degrees: None,
        shot: Shot { aspect, ..Shot::SQUARE },
    }
}

fn from(azimuth: f64, elevation: f64, up: DVec3) -> View {
    View { up, azimuth_degrees: Some(azimuth), elevation_degrees: Some(elevation), ..three_quarter(1.6) }
}

/// Returns the extent of a mesh in a picture, as fractions of half the picture's width and height: left, right, bottom,
/// top.
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
    ] {
        assert!(eye(view).distance(direction) < 1e-5, "{view:?}: {}", eye(view));
    }
    let top = camera(&mesh, Ball::around(&mesh, DVec3::Z), &from(0.0, 90.0, DVec3::Z));
    assert!(top.up.distance(Vec3::Y) < 1e-5, "the front is at the bottom");
}

#[test]
fn an_angle_that_is_not_given_is_that_of_a_bare_mesh() {
    let mesh = block(Vec3::ONE, Vec3::ZERO);
    for (azimuth_degrees, elevation_degrees, angles) in [
        (None, None, [31.0, 21.0]),
        (None, Some(10.0), [31.0, 10.0]),
        (Some(50.0), None, [50.0, 21.0]),
        (Some(50.0), Some(10.0), [50.0, 10.0]),
    ] {
        let view = View { azimuth_degrees, elevation_degrees, ..three_quarter(1.6) };
        let eye = -camera(&mesh, Ball::around(&mesh, view.up), &view).forward;
        let found = [eye.x.atan2(eye.z), eye.y.asin()].map(f32::to_degrees);
        assert!((0..2).all(|i| (found[i] - angles[i]).abs() < 0.2), "{found:?}, expected {angles:?}");
    }
}

#[test]
fn z_up_looks_as_y_up_does() {
    let mut mesh = generate(&Shape::Teapot { fineness: 4 });
    let view = three_quarter(1.6);
    let upright = camera(&mesh, Ball::around(&mesh, view.up), &view);
    mesh.positions.iter_mut().for_each(|p| *p = Vec3::new(p.x, -p.z, p.y));
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
        for distance in [ball.centre.distance(key.position.as_dvec3()), 9.5 * ball.radius] {
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

#[test]
fn a_small_mesh_far_from_the_origin_fills_the_picture() {
    for far in [1e3, 1e5, 1e6] {
        let mesh = block(Vec3::splat(2.0), Vec3::new(far, 0.0, 0.0));
        let ball = Ball::around(&mesh, DVec3::Y);
        assert!((ball.radius - 3.0_f64.sqrt()).abs() < 1e-9, "{}", ball.radius);
        let camera = camera(&mesh, ball, &three_quarter(1.0));
        let [left, right, bottom, top] = extent(&camera, &mesh, 1.0);
        let larger = (right - left).max(top - bottom);
        // At 1e6, the eye's position is rounded to sixteenths.
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
    // The mesh is open towards +z, where the eye is. Only light from there enters the mesh.
    for light in towards(Ball { opening: Some(DVec3::Z), ..ball }) {
        assert!(light.normalize().z > 0.9, "{light}");
    }
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
    // The mesh has a front with an area of 1, and a back with the given area. With a back of 0.82, the two areas differ
    // by 0.18, which is less than a tenth of their sum, 1.82. With a back of 0.8, they differ by 0.2, which is more
    // than a tenth of their sum, 1.8.
    assert_eq!([opening(0.82), opening(0.8)], [None, Some(DVec3::Z)]);
    assert_eq!(opening(1.25), Some(DVec3::NEG_Z));
}

#[test]
fn a_ball_is_around_the_bounding_box() {
    let ball = Ball::around(&block(Vec3::new(2.0, 4.0, 4.0), Vec3::new(1.0, 2.0, 3.0)), DVec3::Y);
    // The radius is half of the diagonal of a box of 2 x 4 x 4; the diagonal is 6.
    assert_eq!(ball.place(), (DVec3::new(1.0, 2.0, 3.0), 3.0));
    assert!(!ball.is_open());
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
