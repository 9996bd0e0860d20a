//! Tests of sessions. A session is a scene on an open device; from a strategy, it makes a caster, which casts frames of
//! this scene. The tests check that the frames of a session share the device's memory, why a strategy may be refused,
//! and that a caster can change to another view of the scene.

use crate::common::apart::apart;
use crate::common::{COMMON_LOCAL_SIZE, device, scene};
use glam::Vec3;
use raycl::device::DeviceLimits;
use raycl::image::Radiance;
use raycl::launch::{Prepared, Refused, Session};
use raycl::program::Sources;
use raycl::scene::{Light, Sampling, Scene, Sky};
use raycl::strategy::{Strategy, preset};
use std::sync::Arc;

/// The image's size, so large that a frame needs much more memory than the scene.
const SIZE: [u32; 2] = [75, 47];

fn session() -> Session {
    let scene = Arc::new(scene("pyramid-lower.toml"));
    Session::open(&device(), &Sources::Embedded, scene).expect("an open device")
}

fn prepare(session: &mut Session, strategy: &Strategy) -> Result<Prepared, Refused> {
    session.prepare(strategy, SIZE, COMMON_LOCAL_SIZE)
}

fn deferred() -> Strategy {
    preset("deferred").expect("a preset").strategy
}

#[test]
fn frames_of_one_session_share_the_devices_memory() {
    apart!();
    let mut session = session();
    let first = prepare(&mut session, &deferred()).expect("it fits");
    let limits = device().info.limits;
    let room_for_one = DeviceLimits { global_bytes: first.device_bytes() * 3 / 2, ..limits };
    let mut session = session.limited(room_for_one);
    let caster = first.caster().expect("a frame");
    let Err(refused) = prepare(&mut session, &deferred()) else { panic!("there is no room for two") };
    assert!(matches!(refused, Refused::Device(_)), "{refused:?}");
    let said = refused.reason();
    assert!(said.starts_with("global memory") && said.contains("B that raycl already uses"), "{said}");
    let error = refused.into_error(&device().info).to_string();
    let start = format!("{} cannot cast this frame: global memory", device().info.label);
    assert!(error.starts_with(&start), "{error}");
    drop(caster);
    prepare(&mut session, &deferred()).expect("room again");
}

#[test]
fn a_strategy_that_contradicts_itself_is_the_users_mistake() {
    apart!();
    let mut strategy = deferred();
    strategy.set("shading", "eager").and_then(|()| strategy.set("triangles", "tiled")).expect("two values");
    let Err(said) = strategy.check() else { panic!("{strategy} contradicts itself") };
    match prepare(&mut session(), &strategy) {
        Err(Refused::Mistake(error)) => assert_eq!(error.to_string(), said.to_string()),
        Err(refused) => panic!("{refused:?}"),
        Ok(_) => panic!("it was built"),
    }
}

/// Returns the image of the last scene, cast with adaptive samples, and true if the caster accepted this scene. The
/// caster is created for the first scene, and then has to change to each of the other scenes.
fn image_of(strategy: &str, scenes: &[&Arc<Scene>]) -> (Radiance, bool) {
    sampled_image_of(strategy, Sampling { first: 2, ..Sampling::all(6) }, scenes)
}

/// Does the same as [`image_of`], but with the samples of `sampling`.
fn sampled_image_of(strategy: &str, sampling: Sampling, scenes: &[&Arc<Scene>]) -> (Radiance, bool) {
    let strategy = preset(strategy).expect("it works").strategy;
    let session = Session::open(&device(), &Sources::Embedded, Arc::clone(scenes[0])).expect("it works");
    let mut session = session.with_sampling(sampling);
    let mut prepared =
        session.prepare(&strategy, SIZE, COMMON_LOCAL_SIZE).map_err(|no| no.reason()).expect("it works");
    let caster = prepared.caster().map_err(|no| no.reason()).expect("it works");
    caster.cast_samples(&scenes[0].camera, &sampling).expect("it works");
    let mut shown = true;
    for scene in &scenes[1..] {
        shown = prepared.show(scene, &caster).expect("it works");
        caster.cast_samples(&scene.camera, &sampling).expect("it works");
    }
    (caster.read().expect("it works").0, shown)
}

#[test]
fn a_caster_that_is_shown_another_view_casts_what_a_new_one_casts() {
    apart!();
    let mut before = scene("pyramid-lower.toml");
    before.sky = Some(Sky { zenith: Vec3::ONE, horizon: Vec3::ZERO, up: Vec3::Y, reach: 1.0, picture: None });
    before.lights[0].radius = 0.2;
    let mut after = before.clone();
    after.lights = vec![Light {
        position: Vec3::new(-1.0, 2.0, 0.5),
        power: Vec3::new(3.0, 9.0, 5.0),
        radius: 0.4,
        area: None,
    }];
    after.sky = Some(Sky { zenith: Vec3::X, horizon: Vec3::ONE, up: Vec3::Y, reach: 3.0, picture: None });
    after.background = Vec3::new(0.01, 0.02, 0.04);
    after.shadow_bias = 0.3;
    // The exposure affects which pixels get all samples, so it is changed too.
    after.display.exposure *= 8.0;
    after.camera.position += Vec3::new(0.2, 0.1, 0.0);
    let [before, after] = [before, after].map(Arc::new);
    for strategy in ["naive", "deferred", "wide-common-origin", "bvh", "bvh-packet", "tile"] {
        let (one, _) = image_of(strategy, &[&after]);
        let (other, shown) = image_of(strategy, &[&before, &after]);
        assert!(shown && one == other, "{strategy}: another image");
        assert!(image_of(strategy, &[&before]).0 != other, "{strategy}: the same view");
    }
    // A scene with another mesh, another number of lights, no sky or a transparent background needs other
    // buffers or kernels, so the caster refuses such a scene.
    let change = |change: fn(&mut Scene)| {
        let mut scene = Scene::clone(&after);
        change(&mut scene);
        image_of("bvh", &[&after, &Arc::new(scene)]).1
    };
    assert!(!change(|scene| scene.mesh_mut().positions[0].x += 0.5));
    assert!(!change(|scene| scene.lights.push(scene.lights[0])));
    assert!(!change(|scene| scene.sky = None));
    assert!(!change(|scene| scene.transparent = true));
}

/// The first frame of a picture replaces the image of the last picture. If the frame instead added its samples to the
/// last image with a weight of 0 for that image, rounding errors of the much brighter image would remain. The 13
/// samples of a pixel are cast in one frame.
#[test]
fn nothing_of_a_bright_picture_remains_in_a_dark_one() {
    apart!();
    let dark = scene("pyramid-lower.toml");
    let mut bright = dark.clone();
    bright.lights[0].power *= 1e6;
    let [bright, dark] = [bright, dark].map(Arc::new);
    let (alone, _) = sampled_image_of("tile", Sampling::all(13), &[&dark]);
    let (after, shown) = sampled_image_of("tile", Sampling::all(13), &[&bright, &dark]);
    assert!(shown && alone == after, "another image");
}
