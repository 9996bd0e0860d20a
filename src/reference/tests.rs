//! Tests of the reference's radiance and of its certain pixels.

use super::cutouts::Solid;
use super::ray::Ray;
use super::traverse::Finder;
use super::*;
use crate::scene::{
    Camera, LEAST_ALPHA_UNIT, Light, Mapped, Material, Mesh, Sky, SkyPicture, Texture, Textures, Triangle,
    Wrap,
};
use crate::verify::verify;
use glam::{DVec3, Vec3, vec3};

/// Returns the radiance of pixel (x, y).
fn pixel(scene: &Scene, size: [u32; 2], [x, y]: [u32; 2]) -> Vec3 {
    let image = reference(scene, size, Culling::None).radiance;
    Vec3::from_array(image.pixels[(y * size[0] + x) as usize])
}

fn assert_near(actual: Vec3, expected: Vec3) {
    assert!((actual - expected).abs().max_element() < 2e-7 * expected.max_element(), "{actual} {expected}");
}

#[test]
fn the_single_triangle_seen_straight_on() {
    // The ray along -z hits the triangle at (0, 0, -2), with weights 51/121, 32/121, 38/121 (calculated on paper). The
    // expected radiance follows from the shading formulas, which were evaluated outside this program.
    let actual = pixel(&fixtures::single_triangle(), [1, 1], [0, 0]);
    assert_near(actual, vec3(0.023589239, 0.018874577, 0.000015931));
}

#[test]
fn a_texture_tints_the_material() {
    let colour = |lambertian: Vec3, texel: Option<u32>| {
        let mut scene = fixtures::single_triangle();
        let mesh = scene.mesh_mut();
        mesh.materials[0] = Material::lambertian(lambertian);
        if let Some(texel) = texel {
            let texture =
                Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], least_alpha: 0, texels: vec![texel].into() };
            let mapped = vec![Mapped { corners: [[0.5; 2]; 3], texture: Some(0), mask: None }];
            mesh.textures = Textures { list: vec![texture], mapped };
        }
        pixel(&scene, [1, 1], [0, 0])
    };
    let own = vec3(0.8, 0.5, 0.2);
    assert_near(colour(own, Some(0xff_ffff)), colour(own, None));
    // The texel is yellow: it takes away the blue light.
    assert_near(colour(own, Some(0x00_ffff)), colour(vec3(0.8, 0.5, 0.0), None));
}

#[test]
fn emitted_light_is_added_to_the_reflected_light_and_tinted_by_its_texture() {
    let with = |emitted: Vec3, texel: Option<u32>| {
        let mut scene = fixtures::single_triangle();
        let mesh = scene.mesh_mut();
        mesh.materials[0].emitted = emitted;
        if let Some(texel) = texel {
            let texture =
                Texture { size: [1, 1], wrap: [Wrap::Repeat; 2], least_alpha: 0, texels: vec![texel].into() };
            mesh.materials[0].emission_texture = Some(0);
            mesh.textures = Textures { list: vec![texture], mapped: vec![Mapped::NONE] };
        }
        pixel(&scene, [1, 1], [0, 0])
    };
    let (dark, emitted) = (with(Vec3::ZERO, None), vec3(0.5, 0.25, 2.0));
    assert_near(with(emitted, None), dark + emitted);
    // The texel is yellow: it takes away the blue light, but only of what is emitted.
    assert_near(with(emitted, Some(0x00_ffff)), dark + vec3(0.5, 0.25, 0.0));
}

#[test]
fn colours_of_corners_are_mixed_by_the_weights_of_the_hit() {
    let of = |colours: Vec<[u32; 3]>, lambertian: Vec3| {
        let mut scene = fixtures::single_triangle();
        let mesh = scene.mesh_mut();
        mesh.materials[0] = Material::lambertian(lambertian);
        mesh.corner_colours = colours;
        pixel(&scene, [1, 1], [0, 0])
    };
    let [red, green, blue] = [1023 << 20, 1023 << 10, 1023];
    // The ray hits the triangle at the weights 51/121, 32/121, 38/121 (calculated on paper).
    let expected = of(Vec::new(), vec3(51.0, 32.0, 38.0) / 121.0 * 0.8);
    assert_near(of(vec![[red, green, blue]], Vec3::splat(0.8)), expected);
    // A corner's colour is stored as square roots of linear light, so half of a channel's 1023 steps are a
    // quarter of the light.
    let quarter = (511.5_f32 / 1023.0).powi(2);
    let actual = of(vec![[red / 2; 3]], Vec3::ONE).x;
    let expected = of(Vec::new(), Vec3::splat(quarter)).x;
    assert!((actual / expected - 1.0).abs() < 3e-3, "{actual} {expected}");
}

#[test]
fn the_lit_ground_of_figure_4() {
    // The ray along (0.75, -0.75, -1) hits y = -1 at (1, -1, -4/3). The vector to the light at (1, 3, 1) is
    // (0, 4, 7/3). The squared length of the vector to the light is 193/9, and the cosine of its angle to the
    // normal is 4 / sqrt(193/9). Nothing blocks the light.
    let actual = pixel(&fixtures::figure_4(), [4, 4], [3, 3]);
    let square = 193.0_f64 / 9.0;
    let pi = std::f64::consts::PI;
    let expected = 10.0 / (4.0 * pi * square) * 0.8 / pi * 4.0 / square.sqrt();
    assert_near(actual, Vec3::splat(expected as f32));
}

#[test]
fn the_shadow_of_figure_4() {
    // The light's ray through (-1, -0.8, -2), a point of the triangle, hits the ground at (-1.105, -1,
    // -2.158). The eye sees this point of the ground below the edge of the scene's triangle, in the direction
    // (-0.512, -0.463, -1). The point's pixel coordinates in a picture of 80 x 80 pixels are (19.5, 58.5).
    let actual = pixel(&fixtures::figure_4(), [80, 80], [19, 58]);
    assert_eq!(actual, Vec3::ZERO);
}

/// Without smooth shadows, the facets of a coarse sphere shadow each other in steps along the border between light and
/// dark.
#[test]
fn with_smooth_shadows_a_coarse_sphere_is_lit_wherever_it_faces_the_light() {
    let mut scene = fixtures::sphere(8);
    scene.lights[0].position = vec3(6.0, 0.5, -2.5);
    let (size, bias) = ([80, 50], f64::from(scene.shadow_bias));
    let ground = scene.mesh.triangles.len() as u32 - 2;
    let mut shadowed = |smooth_shadows| {
        scene.smooth_shadows = smooth_shadows;
        let caster = Caster::<f64>::new(&scene, size, Exhaustive::new(&scene.mesh, Culling::None));
        let seen = Seen::of(&scene, Sample::CENTRE, [0, 0]);
        let is_shadowed = |index: &usize| {
            let [x, y] = cost::pixel_at(*index, size[0]).map(|at| f64::from(at) + 0.5);
            let (ray, hit) = caster.look(x, y);
            let Some(hit) = hit.filter(|hit| hit.triangle < ground) else { return false };
            let [point, normal] = shade::surface_at(&scene, &ray, &hit);
            let mut sights = shade::sights::<f64>(&seen, point, normal);
            sights.any(|sight| sight.w_i.dot(normal) > 0.01 && !caster.reaches(&sight, bias))
        };
        (0..count(size)).filter(is_shadowed).count()
    };
    let [without, with] = [false, true].map(&mut shadowed);
    assert!(without > 10 && with == 0, "{without} pixels without smooth shadows, {with} with them");
}

#[test]
fn smooth_shadows_move_a_hit_onto_the_planes_of_convex_corners_alone() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let move_to = |normals, weights: [f64; 3]| {
        let point = corners[1] * weights[1] + corners[2] * weights[2];
        shade::smooth_point::<f64>(point, weights, corners, normals) - point
    };
    let middle = [0.5, 0.5, 0.0];
    // A hit on a flat facet or between concave corners is not moved, and a hit at a corner stays where it is.
    assert_eq!(move_to([DVec3::Z; 3], middle), DVec3::ZERO);
    let tilted = |by: f64| [DVec3::new(-by, 0.0, 1.0), DVec3::new(by, 0.0, 1.0), DVec3::Z];
    assert_eq!(move_to(tilted(-0.5), middle), DVec3::ZERO);
    assert_eq!(move_to(tilted(0.5), [1.0, 0.0, 0.0]), DVec3::ZERO);
    // The plane of a corner is perpendicular to the corner's normal. Halfway between two corners, the planes
    // of both corners are 0.25 above the hit in the direction z. Along a corner's normal, this height is 0.25
    // / sqrt(1.25). The hit is moved by half of this height along each of the two normals, so the moves along x
    // cancel out.
    let lift = 0.25 / 1.25_f64;
    assert!(move_to(tilted(0.5), middle).distance(DVec3::Z * lift) < 1e-12);
    assert!(move_to(tilted(0.5).map(|normal| 3.0 * normal), middle).distance(DVec3::Z * lift) < 1e-12);
}

fn caster_of(scene: &Scene) -> Caster<'_, f64> {
    Caster::new(scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None))
}

/// The light lies in the plane of the ground, 0.01 units from the hit. The light reaches the hit only if rounding moves
/// the hit off the plane.
#[test]
fn with_smooth_shadows_rounding_also_moves_a_hit_to_either_side_of_its_plane() {
    let mut scene = fixtures::single_triangle();
    let mesh = scene.mesh_mut();
    mesh.positions = vec![vec3(-10.0, -1.0, -10.0), vec3(10.0, -1.0, -10.0), vec3(0.0, -1.0, 10.0)];
    mesh.normals.fill(Vec3::Y);
    mesh.materials[0].glossy = Vec3::ZERO;
    let (ray, hit) = caster_of(&scene).look(40.5, 30.5);
    let hit = hit.expect("the ground");
    let point = (ray.origin + ray.direction * hit.t).as_vec3();
    scene.lights[0].position = vec3(point.x + 0.01, -1.0, point.z);
    let mut brightest = |smooth_shadows| {
        scene.smooth_shadows = smooth_shadows;
        let caster = caster_of(&scene);
        let (seen, bias) = (Seen::of(&scene, Sample::CENTRE, [40, 30]), f64::from(scene.shadow_bias));
        let grazing = caster.grazing(&seen, &ray, &hit, bias, 1e-6).expect("the light grazes the ground");
        let values = caster.grazed(&seen, &ray, &hit, grazing);
        values.iter().fold(0.0, |brightest: f64, value| brightest.max(value.x))
    };
    let [without, with] = [false, true].map(&mut brightest);
    assert!(without > 1e-3 && (with - without).abs() < 1e-6 * without, "{without} {with}");
}

#[test]
fn back_faces_are_seen_unless_culled() {
    let mut scene = fixtures::single_triangle();
    scene.mesh_mut().triangles[0].positions.reverse();
    scene.mesh_mut().triangles[0].normals.reverse();
    let seen = reference(&scene, [40, 25], Culling::None);
    let culled = reference(&scene, [40, 25], Culling::Back);
    assert!(seen.hits > 100);
    assert_eq!(culled.hits, 0);
    assert_eq!(culled.radiance.pixels[500], scene.background.to_array());
}

#[test]
fn culled_faces_cast_no_shadow() {
    // A shadow ray hits the triangle from behind, and culling ignores such a hit. The scene therefore
    // contains a reversed copy of the triangle, as in the book by Hughes et al. (*Computer Graphics:
    // Principles and Practice*). The test then removes the reversed copy of the triangle.
    let mut scene = fixtures::figure_4();
    let black = |scene: &Scene| {
        let image = reference(scene, [80, 80], Culling::Back).radiance;
        image.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count()
    };
    assert!(black(&scene) > 50);
    scene.mesh_mut().triangles.remove(1);
    assert_eq!(black(&scene), 0);
}

#[test]
fn a_shadow_ray_passes_through_a_hole() {
    let mut scene = fixtures::single_triangle();
    let ray = Ray {
        origin: DVec3::ZERO,
        direction: DVec3::NEG_Z,
        near: 0.0,
        far: f64::INFINITY,
        to_light: true,
        is_shadow: true,
    };
    let is_blocked = |scene: &Scene| {
        let (mesh, culling) = (&scene.mesh, Culling::None);
        let exhaustive = Solid::new(Exhaustive::<f64>::new(mesh, culling), &mesh.textures);
        let tree = Solid::new(Tree::new(mesh, culling), &mesh.textures);
        [exhaustive.any(&ray), tree.any(&ray)]
    };
    assert_eq!(is_blocked(&scene), [true; 2]);
    fixtures::make_holes(scene.mesh_mut(), 1);
    assert_eq!(is_blocked(&scene), [false; 2]);
}

/// Returns a scene with a lit triangle, whose mask has 1024 x 1024 texels. `alpha` returns the alpha of the
/// texel in a column and a row. The mask is repeated 256 times along each axis; the picture shows 4 x 4 of
/// these repetitions. In a picture of 32 x 32 pixels, neighbouring rays hit the mask 128 texels apart. One
/// ray hits the mask `from_left` texels from its left edge and 64 texels from its upper edge.
fn tiled(alpha: impl Fn(u32, u32) -> u32, least_alpha: u16, from_left: f32) -> Scene {
    let texels: Vec<u32> = (0..1 << 20).map(|at| alpha(at % 1024, at / 1024) << 24).collect();
    let mask = Texture { size: [1024; 2], wrap: [Wrap::Repeat; 2], least_alpha, texels: texels.into() };
    let left = (from_left - 64.0) / 1024.0;
    let corners = [[left, 0.0], [left + 256.0, 0.0], [left, 256.0]];
    // The triangle's corners are far away, so rounding would move hits further than the usual shadow bias.
    let mut scene = Scene { shadow_bias: 1e-2, ..fixtures::single_triangle() };
    let mesh = scene.mesh_mut();
    mesh.positions = [[-64.0, 64.0], [192.0, 64.0], [-64.0, -192.0]].map(|[x, y]| vec3(x, y, -2.0)).into();
    mesh.normals.fill(Vec3::Z);
    mesh.materials[0] = Material::lambertian(Vec3::splat(0.5));
    let mapped = vec![Mapped { corners, mask: Some(0), ..Mapped::NONE }];
    mesh.textures = Textures { list: vec![mask], mapped };
    scene
}

/// The mask of [`tiled`] is repeated so often that rounding may move a point by a quarter of a texel along each
/// axis, where the texture coordinates are largest. At the edge of a hole, a move by a quarter of a texel along
/// both axes may change alpha by half of alpha's range; elsewhere it changes nothing.
#[test]
fn only_the_edges_of_the_holes_of_a_mask_that_is_often_repeated_are_uncertain() {
    let size = [32; 2];
    // Squares of 128 texels are in turn opaque and transparent.
    let squares = |x: u32, y: u32| if (x / 128 + y / 128).is_multiple_of(2) { 255 } else { 0 };
    for (from_left, certain) in
        [(64.0, true), (126.5, true), (127.875, false), (128.125, false), (129.5, true)]
    {
        let expected = reference(&tiled(squares, 0x8000, from_left), size, Culling::None);
        assert!(expected.certain.iter().all(|pixel| *pixel == certain), "{from_left}");
    }
    let scene = tiled(squares, 0x8000, 64.0);
    let expected = reference(&scene, size, Culling::None);
    assert_eq!((expected.hits, expected.hits_range), (512, [512; 2]));
    let is_right = |colour: [f32; 3]| {
        let pixels = vec![colour; expected.radiance.pixels.len()];
        verify(&Radiance { pixels, ..expected.radiance.clone() }, None, &expected, scene.display).ok
    };
    assert!(verify(&expected.radiance, None, &expected, scene.display).ok);
    assert!(!is_right([0.0; 3]) && !is_right(scene.background.to_array()));
}

/// Along each row of this mask, alpha grows by 8 steps (of 255) per texel, and starts again at 0 every 32 texels.
/// Near the rays' hits, a move by a quarter of a texel changes alpha by only 2 steps. A point is solid if its
/// alpha is at least 127.5 of these steps. At the rays' hits, the exact alpha is 118 of 255 steps in the first of
/// the two pictures, and 126 of 255 steps in the second.
#[test]
fn where_alpha_changes_slowly_only_values_close_to_the_least_alpha_are_uncertain() {
    let ramp = |x: u32, _: u32| 8 * x % 256;
    for (from_left, certain) in [(15.25, true), (16.25, false)] {
        let expected = reference(&tiled(ramp, 0x8000, from_left), [32; 2], Culling::None);
        assert_eq!(expected.hits, 0, "{from_left}");
        assert!(expected.certain.iter().all(|pixel| *pixel == certain), "{from_left}");
    }
}

/// One texel is a hole. The alpha of all other texels equals the mask's `least_alpha`, which is slightly more
/// than the least alpha of a solid point (`Texture::least_step`).
#[test]
fn a_surface_whose_alpha_equals_the_least_alpha_is_certainly_solid() {
    for alpha in [255, 51] {
        let dotted = |x: u32, y: u32| if [x, y] == [0; 2] { 0 } else { alpha };
        let scene = tiled(dotted, alpha as u16 * LEAST_ALPHA_UNIT, 64.0);
        let expected = reference(&scene, [32; 2], Culling::None);
        assert_eq!((expected.hits, expected.uncertain_pixels()), (1024, 0), "{alpha}");
        assert!(expected.certain.iter().all(|certain| *certain), "{alpha}");
    }
}

/// One texel is a hole. The alpha of all other texels is exactly the least alpha of a point that is not a
/// hole (`Texture::least_step`). If rounding makes the mean alpha of four texels smaller, the point becomes a
/// hole.
#[test]
fn a_surface_whose_alpha_has_no_slack_is_uncertain() {
    let dotted = |x: u32, y: u32| if [x, y] == [0; 2] { 0 } else { 128 };
    let expected = reference(&tiled(dotted, 128 * LEAST_ALPHA_UNIT + 1, 64.0), [32; 2], Culling::None);
    assert!(expected.certain.iter().all(|certain| !certain));
}

#[test]
fn hits_nearer_than_z_near_are_not_seen() {
    let mut scene = fixtures::single_triangle();
    scene.camera.z_near = 1.999;
    assert!(reference(&scene, [40, 25], Culling::None).hits > 100);
    scene.camera.z_near = 2.001;
    assert_eq!(reference(&scene, [40, 25], Culling::None).hits, 0);
}

#[test]
fn a_light_nearer_than_the_bias_and_normals_of_no_length_give_nothing() {
    let mut scene = fixtures::single_triangle();
    scene.lights[0].position = vec3(0.0, 0.0, -1.9999);
    scene.shadow_bias = 1e-3;
    assert_eq!(pixel(&scene, [1, 1], [0, 0]), Vec3::ZERO);
    scene.lights[0].position = vec3(0.0, 0.0, -1.0);
    assert_ne!(pixel(&scene, [1, 1], [0, 0]), Vec3::ZERO);
    scene.mesh_mut().normals.fill(Vec3::ZERO);
    assert_eq!(pixel(&scene, [1, 1], [0, 0]), Vec3::ZERO);
    scene.lights.clear();
    assert_eq!(pixel(&scene, [1, 1], [0, 0]), Vec3::ZERO);
}

#[test]
fn a_pixel_is_uncertain_where_a_silhouette_passes_through_its_centre() {
    // The triangle's left edge along x = 0 divides an image of odd width into halves.
    let mut scene = fixtures::single_triangle();
    scene.mesh_mut().positions = vec![vec3(0.0, 9.0, -2.0), vec3(0.0, -9.0, -2.0), vec3(9.0, 0.0, -2.0)];
    let reference = reference(&scene, [9, 5], Culling::None);
    for (index, certain) in reference.certain.iter().enumerate() {
        assert_eq!(*certain, index % 9 != 4, "pixel {index}");
    }
    // The triangle's silhouette passes through the centres of five pixels.
    assert_eq!(reference.hits_range[1] - reference.hits_range[0], 5);
    assert!((reference.hits_range[0]..=reference.hits_range[1]).contains(&reference.hits));
}

#[test]
fn a_pixel_is_uncertain_beside_what_is_narrower_than_the_wider_nudge() {
    // The triangle is a narrow strip. Seen from the eye, the strip lies from half a microradian to five
    // microradians beside the middle pixel's ray. Wide nudges (small turns of the ray) turn the middle
    // pixel's ray by ten microradians, past the narrow strip.
    let mut scene = fixtures::single_triangle();
    scene.mesh_mut().positions = vec![vec3(1e-6, 9.0, -2.0), vec3(1e-6, -9.0, -2.0), vec3(1e-5, 0.0, -2.0)];
    let reference = reference(&scene, [9, 5], Culling::None);
    assert_eq!((reference.hits, reference.certain[2 * 9 + 4]), (0, false));
    assert!(reference.hits_range[0] == 0 && reference.hits_range[1] > 0, "{:?}", reference.hits_range);
}

#[test]
fn a_pixel_is_uncertain_where_light_grazes_its_triangle() {
    // The triangle is so small that a shadow ray that starts far below the triangle's plane passes beside the triangle.
    let uncertain = |height: f32| {
        let mut scene = fixtures::single_triangle();
        scene.mesh_mut().positions =
            vec![vec3(0.05, -0.05, -2.0), vec3(0.0, 0.05, -2.0), vec3(-0.05, -0.05, -2.0)];
        scene.mesh_mut().normals.fill(vec3(0.0, 1.0, 0.0)); // as on a curved surface, so that the light is not faint
        scene.lights[0].position = vec3(0.0, 9.0, -2.0 + height);
        let reference = reference(&scene, [401, 251], Culling::None);
        let pixels = reference.radiance.pixels.iter().zip(&reference.certain);
        let lit = pixels.filter(|(pixel, _)| **pixel != [0.0; 3]);
        lit.filter(|(_, certain)| !**certain).count()
    };
    assert!(uncertain(1e-4) > 10);
    assert!(uncertain(1.0) < 3);
}

#[test]
fn coincident_surfaces_are_uncertain_only_where_they_look_different() {
    let mut scene = fixtures::single_triangle();
    let mut twin = scene.mesh.triangles[0];
    twin.positions.reverse();
    twin.normals.reverse();
    scene.mesh_mut().triangles.push(twin);
    let alike = reference(&scene, [40, 25], Culling::None);
    assert!(alike.certain.iter().filter(|certain| !**certain).count() < 10);
    let mut other = scene.mesh.materials[0];
    other.lambertian = Vec3::splat(0.1);
    scene.mesh_mut().materials.push(other);
    scene.mesh_mut().triangles[1].material = 1;
    let different = reference(&scene, [40, 25], Culling::None);
    assert!(different.certain.iter().filter(|certain| !**certain).count() > 100);
}

/// The first of two coincident triangles is dark, and the second one is lit. A device may show either of the
/// two coincident triangles. Rounding also decides whether the light is blocked: by a triangle that touches
/// the light or, if there is no shadow bias, by the second triangle itself.
#[test]
fn a_surface_that_coincides_with_another_may_have_a_second_doubt() {
    let (lit, size) = (fixtures::single_triangle(), [80, 50]);
    let seen = reference(&lit, size, Culling::None).radiance;
    let mut twins = lit.clone();
    twins.mesh_mut().normals.iter_mut().for_each(|normal| *normal = -*normal);
    twins.mesh_mut().append((*lit.mesh).clone());
    let light = lit.lights[0].position;
    let mut touching = (*lit.mesh).clone();
    touching.positions = vec![light, light + vec3(1.0, 1.0, 2.0), light + vec3(-1.0, 2.0, 1.0)];
    let mut touched = twins.clone();
    touched.mesh_mut().append(touching);
    let without_bias = Scene { shadow_bias: 0.0, ..twins };
    for (name, scene) in [("a triangle touches the light", touched), ("there is no bias", without_bias)] {
        let expected = reference(&scene, size, Culling::None);
        let is_right = |factor: f32| {
            let mut image = seen.clone();
            for pixel in image.pixels.iter_mut().filter(|pixel| **pixel != lit.background.to_array()) {
                *pixel = pixel.map(|channel| factor * channel);
            }
            verify(&image, None, &expected, scene.display).ok
        };
        // A pixel may be dark or have exactly the light of the second triangle, but no other brightness.
        assert_eq!([0.0, 1.0, 1.01].map(is_right), [true, true, false], "{name}");
    }
}

/// In the middle of this picture, rounding turns the pixel's ray by 2e-4 radian. The ray's direction is the
/// sum of three vectors that are some 5,000 times longer than the sum.
#[test]
fn the_middle_of_a_very_wide_picture_is_uncertain() {
    let camera = Camera::looking_at(vec3(3.6, 2.2, 4.8), vec3(0.0, 0.5, 0.0), Vec3::Y, 179.98, false);
    let (lambertian, glossy) = (Vec3::splat(0.1), Vec3::splat(5.0));
    let material = Material::blinn_phong(lambertian, glossy, 1000.0);
    let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
    let mesh = Mesh {
        positions: [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, z]| vec3(x, 0.0, z)).into(),
        normals: vec![Vec3::Y],
        triangles: [[0, 3, 2], [0, 2, 1]].map(triangle).into(),
        materials: vec![material],
        ..Mesh::default()
    };
    let scene = Scene {
        mesh: mesh.into(),
        camera: camera.expect("two different points"),
        lights: vec![Light {
            position: vec3(2.5, 4.0, 3.0),
            power: Vec3::splat(100.0),
            radius: 0.0,
            area: None,
        }],
        ..fixtures::single_triangle()
    };
    let size = [101, 67];
    let expected = reference(&scene, size, Culling::None);
    let mut image = cast_serial_f32(&scene, size);
    let verdict = verify(&image, None, &expected, scene.display);
    assert!(verdict.ok, "{verdict:?}");
    // Far from the picture's middle, rounding turns rays by less than a nudge of the usual size. Verification
    // still finds a wrong pixel there.
    let far_pixel = 60 * 101 + 20;
    assert!(expected.certain[far_pixel] && expected.radiance.pixels[far_pixel] != [0.0; 3]);
    image.pixels[far_pixel] = image.pixels[far_pixel].map(|channel| 1.01 * channel);
    assert!(!verify(&image, None, &expected, scene.display).ok);
}

/// The surface's normal points away from the eye, so some half vectors (between the directions to the eye and
/// to the light) point away from the eye, too. If a direction is mirrored at a half vector that points away
/// from the eye, the mirrored direction may nevertheless be above the surface.
#[test]
fn nothing_is_mirrored_at_a_half_vector_that_points_away_from_the_eye() {
    let mut scene = fixtures::single_triangle();
    scene.lights.clear();
    let mesh = scene.mesh_mut();
    mesh.normals.fill(vec3(0.96, 0.0, -0.28));
    mesh.materials[0] = Material::blinn_phong(Vec3::ZERO, Vec3::ONE, 2.0);
    let picture = SkyPicture { size: [4, 2], texels: [[1.0; 3]; 8].into(), ahead: Vec3::X, is_seen: false };
    let (up, picture) = (Vec3::Y, Some(picture.into()));
    scene.sky = Some(Sky { zenith: Vec3::ZERO, horizon: Vec3::ZERO, up, reach: f32::MAX, picture });
    let pixels = reference(&scene, [40, 25], Culling::None).radiance.pixels;
    assert!(pixels.iter().flatten().all(|channel| *channel >= 0.0), "a negative radiance");
    assert!(pixels.iter().any(|pixel| pixel[0] > 0.1), "other half vectors mirror the sky");
}

#[test]
fn some_pixels_are_those_of_all() {
    let (scene, size) = (fixtures::figure_4(), [80, 50]);
    let all = reference(&scene, size, Culling::None);
    let of = |some| {
        reference_of(&scene, size, Culling::None, &some_pixels(size, some), (&[Sample::CENTRE], &|_| 1))
    };
    let some = of(700);
    assert_eq!((some.judged, all.judged), (700, 4000));
    let is_lit = |index: &&usize| some.radiance.pixels[**index] != [0.0; 3];
    let indices: Vec<usize> = (0..4000).collect();
    let lit: Vec<_> = indices.iter().filter(is_lit).collect();
    assert!(lit.len() > 500 && lit.iter().all(|&&at| some.radiance.pixels[at] == all.radiance.pixels[at]));
    assert_eq!(of(9000), all);
}

#[test]
fn the_papers_scenes_are_certain_almost_everywhere() {
    for scene in [
        fixtures::single_triangle(),
        fixtures::figure_4(),
        fixtures::pyramid_upper(),
        fixtures::pyramid_lower(),
        fixtures::sphere(24),
    ] {
        let reference = reference(&scene, [160, 100], Culling::None);
        let uncertain = reference.certain.iter().filter(|certain| !**certain).count();
        assert!(uncertain <= 160, "{}: {uncertain} uncertain pixels", scene.name);
    }
}

#[test]
fn a_pixel_is_uncertain_where_a_level_silhouette_passes_through_its_centre() {
    let mut scene = fixtures::single_triangle();
    scene.mesh_mut().positions = vec![vec3(-9.0, 0.0, -2.0), vec3(9.0, 0.0, -2.0), vec3(0.0, 9.0, -2.0)];
    let reference = reference(&scene, [8, 5], Culling::None);
    assert!(reference.certain[16..24].iter().all(|certain| !certain), "{:?}", reference.certain);
}

#[test]
fn a_pixel_is_uncertain_close_to_a_silhouette_on_any_side() {
    // The triangle's edge is two units away from the eye, and `beside` units away from the middle pixel's
    // ray. The angle between the ray and the edge is thus half of `beside`, in radians.
    let certain = |side: Vec3, beside: f32| {
        let mut scene = fixtures::single_triangle();
        let along = 9.0 * side.cross(Vec3::Z);
        let corners = [side * beside + along, side * beside - along, side * 9.0];
        scene.mesh_mut().positions = corners.map(|corner| corner - 2.0 * Vec3::Z).to_vec();
        reference(&scene, [9, 5], Culling::None).certain[2 * 9 + 4]
    };
    for side in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y] {
        assert_eq!([certain(side, 1e-5), certain(side, 1e-4)], [false, true], "{side}");
    }
}

#[test]
fn a_light_behind_a_surface_gives_nothing() {
    let mut scene = fixtures::single_triangle();
    scene.lights[0].position = vec3(0.0, 0.0, -3.0);
    assert_eq!(pixel(&scene, [1, 1], [0, 0]), Vec3::ZERO);
}

#[test]
fn what_is_nearer_than_the_bias_casts_no_shadow() {
    let lit = |gap: f32| pixel(&fixtures::lit_from_behind(gap), [1, 1], [0, 0]) != Vec3::ZERO;
    assert_eq!((lit(5e-3), lit(2e-2)), (true, false));
}

/// Rounding may decide whether a surface casts a shadow if the surface's distance from the hit is between
/// half the shadow bias and twice the bias.
#[test]
fn a_shadow_of_what_is_about_as_near_as_the_bias_is_uncertain() {
    let certain = |gap: f32| reference(&fixtures::lit_from_behind(gap), [1, 1], Culling::None).certain[0];
    assert_eq!([4e-3, 7e-3, 1.4e-2, 2.5e-2].map(certain), [true, false, false, true]);
}

/// If a light is 100,000 units away, a device that casts shadow rays from the light ends them 0.05 units before the
/// hit. Rounding may also move an occluder that the light grazes, by up to 2.5 units. Devices that cast shadow rays
/// from the light may therefore miss an occluder that is less than 2.55 units from the hit; devices that cast shadow
/// rays from the hit find it.
#[test]
fn a_distant_lights_shadow_is_uncertain_right_in_front_of_a_surface() {
    let certain = |distance: f32, gap: f32| {
        let mut scene = fixtures::single_triangle();
        scene.mesh_mut().normals.fill(Vec3::NEG_Z);
        scene.lights[0].position = vec3(0.0, 0.0, -distance);
        scene.lights[0].power = Vec3::splat(100.0 * distance * distance);
        scene.shadow_bias = 1e-3;
        let mut behind = (*scene.mesh).clone();
        behind.positions.iter_mut().for_each(|corner| corner.z -= gap);
        scene.mesh_mut().append(behind);
        let reference = reference(&scene, [1, 1], Culling::None);
        (reference.certain[0], reference.radiance.pixels[0] == [0.0; 3])
    };
    for (distance, gap, expected) in [
        (1e5, 0.02, false),
        (1e5, 2.0, false),
        (1e5, 3.0, true),
        // If the light is only 1e3 away, rounding moves the hit's triangle by less than the bias. Rounding
        // moves a triangle that the light grazes by up to 0.025.
        (1e3, 0.01, false),
        (1e3, 0.05, true),
    ] {
        assert_eq!(certain(distance, gap), (expected, true), "{distance} {gap}");
    }
}

/// One of the pixel's samples hits a triangle from which a shadow ray rises by only 0.3 degrees, towards one of the
/// lights. The shadow ray runs 0.2 degrees below a neighbouring triangle. All kernels find the shadow ray blocked,
/// since rounding lifts the start of the shadow ray off the plane of the triangle that was hit.
#[test]
fn a_shadow_ray_along_a_neighbour_is_uncertain() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/table.toml");
    let scene = crate::scene::load_scene(&path).map(|loaded| loaded.scene);
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let (size, [x, y]) = ([321, 243], [115, 127]);
    let pixel = y * size[0] as usize + x;
    let samples = crate::scene::pixel_samples(16);
    let reference = reference_of(&scene, size, Culling::None, &[pixel], (&samples, &|_| 16));
    let doubt = reference.doubts.iter().find(|doubt| doubt.pixel == pixel);
    let doubt = doubt.unwrap_or_else(|| panic!("certain: {:?}", reference.radiance.pixels[pixel]));
    let kernels = [2.55171e-3, 5.13738e-3, 8.48109e-3];
    for (channel, value) in kernels.into_iter().enumerate() {
        let range = 0.9999 * doubt.low[channel]..=1.0001 * doubt.high[channel];
        assert!(range.contains(&value), "{value} {range:?}");
    }
}
