//! `raycl view`: a scene that is cast while the user moves around it.
//!
//! A [`screen::Screen`] shows pictures and tells what the user did; [`live::Live`] casts, by the way that `render` takes. What
//! lies between is here: a loop that looks, acts, casts and shows.

mod camera;
mod choices;
pub mod keys;
mod live;
mod rate;
pub mod screen;
mod sum;
mod title;

use crate::error::{Error, Result};
use camera::{Pose, elevation};
use keys::{Action, action};
pub use live::Live;
use rate::Rate;
pub use rate::Total;
use screen::{Input, Screen};
use std::time::{Duration, Instant};

/// The pointer's way of one height of the picture, as an angle around the scene.
const DRAG: f64 = 3.0;
/// What it spins with each frame, in radians: a whole turn in 360.
const SPIN: f64 = std::f64::consts::TAU / 360.0;
/// How long it waits for the user where there is nothing to cast.
const REST: Duration = Duration::from_millis(8);

/// When it ends by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Until {
    /// After so many frames, or sooner where there are no more to cast.
    pub frames: Option<u32>,
    /// After so many seconds.
    pub seconds: Option<f64>,
}

/// A scene that is shown, and what the user did with it.
pub struct Viewer<S: Screen> {
    live: Live,
    screen: S,
    pose: Pose,
    spins: bool,
    rate: Rate,
    /// What the user ought to know: why a key did nothing.
    note: Option<String>,
    /// Whether the line beside the picture is out of date.
    stale: bool,
}

impl<S: Screen> Viewer<S> {
    /// Shows a scene, which may spin by itself.
    pub fn new(live: Live, screen: S, spins: bool) -> Self {
        Self { live, screen, pose: Pose::START, spins, rate: Rate::new(), note: None, stale: true }
    }

    /// Shows it until the user or the time ends it; whether files have `changed` is asked each time.
    pub fn run(mut self, until: Until, mut changed: impl FnMut() -> bool) -> Result<(Live, Total)> {
        let start = Instant::now();
        loop {
            let input = self.screen.input()?;
            if input.closed || self.obey(&input) {
                break;
            }
            if changed() {
                self.tried(Live::reload);
            }
            let rests = !self.show_next()?;
            self.tell()?;
            let over = until.seconds.is_some_and(|seconds| start.elapsed().as_secs_f64() >= seconds);
            let enough = until.frames.is_some_and(|frames| rests || self.rate.frames() >= frames);
            if over || enough {
                break;
            }
            if rests {
                std::thread::sleep(REST);
            }
        }
        let total = self.rate.total();
        Ok((self.live, total))
    }

    /// Casts and shows the next frame; whether there was one.
    fn show_next(&mut self) -> Result<bool> {
        if self.spins && self.rate.frames() > 0 {
            self.go(Action::Orbit([SPIN, 0.0]));
        }
        let Some(frame) = self.live.cast(&self.pose)? else { return Ok(false) };
        self.screen.show(&frame.picture)?;
        self.rate.count(frame.rays, frame.ms);
        Ok(true)
    }

    /// Does what the user wants; whether that is to end.
    fn obey(&mut self, input: &Input) -> bool {
        if input.orbit != [0.0; 2] {
            // Dragged to the right, the scene turns to the right: the eye goes left.
            self.go(Action::Orbit([-DRAG * input.orbit[0], DRAG * input.orbit[1]]));
        }
        if input.pan != [0.0; 2] {
            let heights = 2.0 * self.live.half_height();
            self.go(Action::Pan([-heights * input.pan[0], heights * input.pan[1]]));
        }
        if input.wheel != 0.0 {
            self.go(Action::Zoom(input.wheel));
        }
        let mut actions = input.keys.iter().filter_map(|key| action(*key));
        actions.any(|wanted| self.act(wanted))
    }

    /// Does one thing; whether that is to end.
    fn act(&mut self, wanted: Action) -> bool {
        match wanted {
            Action::Orbit(_) | Action::Pan(_) | Action::Zoom(_) | Action::Reset => self.go(wanted),
            Action::Spin => self.spins = !self.spins,
            Action::Strategy(step) => self.tried(|live| live.next_strategy(step)),
            Action::LocalSize(step) => self.tried(|live| live.next_local_size(step)),
            Action::Device => self.tried(Live::next_device),
            Action::Help => self.note = Some(keys::lines().collect::<Vec<_>>().join(", ")),
            Action::Quit => return true,
        }
        self.stale = true;
        false
    }

    /// Looks from somewhere else.
    fn go(&mut self, wanted: Action) {
        let level = elevation(&self.live.scene().camera, &self.live.loaded().orbit);
        match wanted {
            Action::Orbit(by) => self.pose.orbit(by, level),
            Action::Pan(by) => self.pose.pan(by),
            Action::Zoom(steps) => self.pose.zoom(steps),
            _ => self.pose = Pose::START,
        }
        self.live.moved();
    }

    /// Changes what casts; where that fails, everything stays as it is and the user learns why.
    fn tried(&mut self, change: impl FnOnce(&mut Live) -> Result<()>) {
        self.note = change(&mut self.live).err().map(|error: Error| error.to_string());
        self.stale = true;
    }

    fn tell(&mut self) -> Result<()> {
        let (rates, is_new) = self.rate.recent();
        if !is_new && !std::mem::take(&mut self.stale) {
            return Ok(());
        }
        self.screen.tell(&title::line(&self.live, rates, self.note.as_deref()))
    }
}
