//! From a strategy to something that casts: what a session's strategies share, and what stands in a strategy's way.

use crate::common::apart::apart;
use crate::common::{COMMON_LOCAL_SIZE, device, scene};
use raycl::device::DeviceLimits;
use raycl::launch::{Prepared, Refused, Session};
use raycl::program::Sources;
use raycl::strategy::{Strategy, preset};
use std::sync::Arc;

/// So large that a frame takes far more than the scene.
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
    assert!(said.starts_with("global memory") && said.contains("B of other points"), "{said}");
    let error = refused.into_error("the device").to_string();
    assert!(error.starts_with("the device cannot hold this: global memory"), "{error}");
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
