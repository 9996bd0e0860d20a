//! `raycl view`: a scene that is cast while the user moves around it.
//!
//! A [`screen::Screen`] shows pictures and reads the user's input. [`live::Live`] casts the pictures, with
//! the same code as the command `raycl render`. The loop in this file reads the user's input, carries out the
//! user's actions, casts a picture, and shows it.

mod camera;
mod choices;
mod heat;
mod help;
pub mod keys;
mod live;
mod pick;
mod rate;
mod room;
pub mod screen;
mod sum;
mod title;

use crate::error::Result;
use crate::memory::Available;
use crate::strategy::Strategy;
use crate::words::counted;
use camera::{Pose, elevation};
use heat::Heat;
use image::RgbImage;
use keys::{Action, actions};
pub use live::Live;
use pick::{Picked, Picker};
use rate::Rate;
pub use rate::Total;
use screen::{Input, Screen};
use std::time::{Duration, Instant};

/// The angle by which the eye goes around the scene, in radians, if the pointer is dragged by the picture's
/// height.
const DRAG: f64 = 3.0;
/// The angle by which the eye goes around the scene with each frame of a spin, in radians: a whole turn in 360 frames.
const SPIN: f64 = std::f64::consts::TAU / 360.0;
/// While there is nothing to cast, the view sleeps for this time before it looks for the user's input again.
const REST: Duration = Duration::from_millis(8);

/// The number of frames and the time after which the view ends.
#[derive(Clone, Copy, Debug, Default)]
pub struct Until {
    /// The number of frames; `None` if frames are not limited. If the number of frames is limited, the view
    /// also ends when nothing is left to cast.
    pub frames: Option<u32>,
    /// The time after which the view ends; `None` if the time is not limited.
    pub time: Option<Duration>,
}

/// A scene that is shown, and the state that the user's actions change.
pub struct Viewer<S: Screen> {
    live: Live,
    screen: S,
    pose: Pose,
    spins: bool,
    rate: Rate,
    /// The heat map of ray-triangle tests, if it is shown instead of the picture.
    heat: Option<Heat>,
    /// The largest number of ray-triangle tests for the rays of one pixel, in the last heat map; 0 before the
    /// first heat map.
    most_tests: u32,
    /// The drawing of the list of keys; `None` if the list is hidden.
    help: Option<RgbImage>,
    /// The last picture, without the list of keys over it.
    shown: Option<RgbImage>,
    picker: Picker,
    /// The size of the largest picture for which the screen had room when the input was last read, in pixels
    /// across and down; `None` if the size is not known.
    room: Option<[u32; 2]>,
    /// True if a change has succeeded since the screen's size was last compared with the picture's size. If the device
    /// refused the screen's size before the change, this size may now be possible.
    refits: bool,
    pointer: Option<[u32; 2]>,
    picked: Option<Picked>,
    /// The mistake in the files that were read last; `None` if these files have no mistake, or if a key has
    /// since switched to another strategy, local size or device. While the files have a mistake, the scene is
    /// cast as it was before the mistake.
    mistake: Option<String>,
    /// The answer to the user's last action (a key, a change of the screen's size, or a movement of the pointer): the
    /// reason why the action had no effect, or the list of keys; `None` if there is nothing to tell.
    answer: Option<String>,
    /// The first note about the scene, with the number of the other notes. The note is shown in three cases:
    /// at the start, after the scene was read again, and after the picture's size has changed.
    note: Option<String>,
    /// True if the picture must be shown again, because the list of keys over it was shown or hidden, or because the
    /// screen was cleared.
    redraws: bool,
    /// True if the line of text beside the picture must be shown again, because the screen was cleared, or
    /// because something that the line states (such as the strategy) has changed.
    stale: bool,
}

impl<S: Screen> Viewer<S> {
    /// Makes a viewer of a scene. If `spins` is true, the eye goes around the scene by itself.
    pub fn new(live: Live, screen: S, spins: bool) -> Self {
        let note = of_scene(&live);
        Self {
            live,
            screen,
            pose: Pose::START,
            spins,
            rate: Rate::new(),
            heat: None,
            most_tests: 0,
            help: None,
            shown: None,
            picker: Picker::default(),
            room: None,
            refits: false,
            pointer: None,
            picked: None,
            mistake: None,
            answer: None,
            note,
            redraws: false,
            stale: true,
        }
    }

    /// Shows the scene until the user or a limit ends the view. In each round of its loop, even while no frame is
    /// left to cast, the function calls `changed`. If `changed` returns true (files have changed), the function
    /// reads the scene and the kernels again. Returns the scene as it was last cast, and the numbers for the report.
    pub fn run(mut self, until: Until, mut changed: impl FnMut() -> bool) -> Result<(Live, Total)> {
        let start = Instant::now();
        loop {
            let input = self.screen.input()?;
            if input.closed || self.obey(&input) {
                break;
            }
            self.redraws |= input.redraws;
            self.stale |= input.redraws;
            self.fit(input.room);
            if changed() {
                self.reload();
            }
            let rests = !self.show_next()?;
            self.redraw()?;
            self.point(input.pointer);
            self.tell()?;
            let over = until.time.is_some_and(|time| start.elapsed() >= time);
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

    /// Casts and shows the next frame, and returns true. If nothing has changed since the last sample or the finest
    /// heat map was shown, there is no next frame, and the function returns false.
    fn show_next(&mut self) -> Result<bool> {
        if self.spins && self.rate.frames() > 0 {
            self.go(Action::Orbit([SPIN, 0.0]));
        }
        let Some(picture) = self.next_picture()? else { return Ok(false) };
        self.show(picture)?;
        self.rate.count();
        Ok(true)
    }

    /// Returns the next picture or heat map. After the last sample or the finest heat map, returns `None` until
    /// something changes, for example the camera.
    fn next_picture(&mut self) -> Result<Option<RgbImage>> {
        if let Some(heat) = &mut self.heat {
            let view = self.live.view(&self.pose);
            let Some(map) = heat.next(&self.live, view) else { return Ok(None) };
            self.most_tests = map.most;
            self.stale = true;
            return Ok(Some(map.picture));
        }
        let Some(frame) = self.live.cast(&self.pose)? else { return Ok(None) };
        self.rate.count_rays(frame.rays, frame.ms);
        Ok(Some(frame.picture))
    }

    /// Shows a picture, with the list of keys over it if the user wants this list.
    fn show(&mut self, picture: RgbImage) -> Result<()> {
        let has_room = match &self.help {
            Some(panel) => {
                let mut under = picture.clone();
                let has_room = help::lay(panel, &mut under);
                self.screen.show(&under)?;
                has_room
            }
            None => {
                self.screen.show(&picture)?;
                true
            }
        };
        if !has_room {
            self.list_keys()?;
        }
        self.shown = Some(picture);
        self.redraws = false;
        Ok(())
    }

    /// Shows the list of keys as lines of text over the picture. raycl calls this function if the picture is too small
    /// for a drawing of the list of keys. If the screen writes no text over pictures, the line beside the picture shows
    /// the keys, unless `answer` already has another text for this line.
    fn list_keys(&mut self) -> Result<()> {
        let lines: Vec<String> = keys::lines().collect();
        if !self.screen.write_over(&lines)? && self.answer.is_none() {
            self.answer = Some(lines.join("; "));
            self.stale = true;
        }
        Ok(())
    }

    /// Shows the last picture again if `redraws` is set.
    fn redraw(&mut self) -> Result<()> {
        match self.shown.take() {
            Some(picture) if std::mem::take(&mut self.redraws) => self.show(picture),
            picture => {
                self.shown = picture;
                Ok(())
            }
        }
    }

    /// Carries out the actions that the user's input asks for. Returns true if the user wants to end the
    /// view.
    fn obey(&mut self, input: &Input) -> bool {
        if input.orbit != [0.0; 2] {
            self.go(dragged(input));
        }
        if input.pan != [0.0; 2] {
            let heights = 2.0 * self.live.half_height();
            self.go(Action::Pan([-heights * input.pan[0], heights * input.pan[1]]));
        }
        if input.wheel != 0.0 {
            self.go(Action::Zoom(input.wheel));
        }
        actions(&input.keys).into_iter().any(|wanted| self.act(wanted))
    }

    /// Carries out one action. Returns true if the user wants to end the view.
    fn act(&mut self, wanted: Action) -> bool {
        self.answer = None;
        match wanted {
            Action::Orbit(_) | Action::Pan(_) | Action::Zoom(_) | Action::Reset => self.go(wanted),
            Action::Spin => self.spins = !self.spins,
            Action::Strategy(steps) => {
                let next = self.live.strategy_after(steps);
                self.compiled(next, |live| live.next_strategy(steps));
            }
            Action::LocalSize(steps) => {
                let same = self.live.strategy();
                self.compiled(same, |live| live.next_local_size(steps));
            }
            Action::Device => {
                self.announced(title::OPENING, Live::next_device);
            }
            Action::Tests => self.turn_heat(),
            Action::Help => self.turn_help(),
            Action::Quit => return true,
        }
        self.stale = true;
        false
    }

    /// Shows the heat map of triangle tests or, if the heat map is shown, the picture again.
    fn turn_heat(&mut self) {
        let is_shown = self.heat.take().is_some();
        self.live.moved();
        if !is_shown {
            self.make_heat();
        }
    }

    /// Makes the heat map. If the heat map cannot be made, the line beside the picture states the reason.
    fn make_heat(&mut self) {
        match Heat::new(self.live.scene(), &Available::read()) {
            Ok(heat) => self.heat = Some(heat),
            Err(error) => self.answer = Some(error.in_a_line()),
        }
    }

    /// Shows the list of keys or, if the list is shown, hides it.
    fn turn_help(&mut self) {
        self.help = match self.help.take() {
            Some(_) => None,
            None => help::panel().ok(),
        };
        self.redraws = true;
    }

    /// If the screen has become larger or smaller, casts pictures of the screen's new size from now on. If the device
    /// refuses this size, the size is tried again after the next change that succeeds.
    fn fit(&mut self, room: Option<[u32; 2]>) {
        let known = std::mem::replace(&mut self.room, room);
        let refits = std::mem::take(&mut self.refits);
        // A window system may clear a window when the window's size changes, so the picture is shown again.
        self.redraws |= known.is_some() && known != room;
        let changed = room.filter(|size| (known != room || refits) && *size != self.live.size());
        if let Some(size) = changed {
            // A resize does not read the scene again, so a mistake in the files remains.
            let mistake = self.mistake.take();
            self.tried(|live| live.resize(size));
            self.mistake = mistake;
            self.note_again();
        }
    }

    /// Moves the eye as the action `wanted` says.
    fn go(&mut self, wanted: Action) {
        let level = elevation(&self.live.scene().camera, &self.live.loaded().orbit);
        match wanted {
            Action::Orbit(by) => self.pose.orbit(by, level),
            Action::Pan(by) => self.pose.pan(by),
            Action::Zoom(steps) => self.pose.zoom(steps),
            _ => self.pose = Pose::START,
        }
        self.changed();
    }

    /// Begins a new picture or heat map after a change of the eye's position, the scene, the strategy, the local size,
    /// the device or the picture's size. A new picture also begins if such a change has failed.
    fn changed(&mut self) {
        self.live.moved();
        self.picked = None;
        if let Some(heat) = &mut self.heat {
            heat.restart();
        }
    }

    /// Makes a change for which raycl may have to compile the program of `strategy`. Before the change, the line beside
    /// the picture says that raycl compiles this strategy. Returns true if the change succeeded.
    fn compiled(&mut self, strategy: Strategy, change: impl FnOnce(&mut Live) -> Result<()>) -> bool {
        self.announced(&title::compiling(&strategy), change)
    }

    /// Makes a change that may take long. Until the change is made, no picture is shown and no key is obeyed,
    /// so the line beside the picture first says what raycl does. Returns true if the change succeeded.
    fn announced(&mut self, line: &str, change: impl FnOnce(&mut Live) -> Result<()>) -> bool {
        // If the screen cannot show the line, it cannot show the next picture either. The error about showing
        // the next picture will end the view.
        let _ = self.screen.tell_at_once(line);
        self.tried(change)
    }

    /// Makes a change of the strategy, the local size, the device, the picture's size or the files. If the
    /// change fails, the scene is cast as before, and the line beside the picture states the reason. Returns true
    /// if the change succeeded.
    fn tried(&mut self, change: impl FnOnce(&mut Live) -> Result<()>) -> bool {
        let of_heat = self.heat.as_ref().map_or(0, Heat::bytes);
        self.live.count_trees(of_heat + self.picker.bytes());
        let result = change(&mut self.live);
        let succeeded = result.is_ok();
        match result {
            Ok(()) => {
                (self.mistake, self.answer, self.note) = (None, None, None);
                self.rate.switched();
                self.refits = true;
            }
            Err(error) => self.answer = Some(error.in_a_line()),
        }
        if self.heat.as_ref().is_some_and(|heat| !heat.is_of(self.live.scene())) {
            // The tree of the old map is freed before a new one is built.
            self.heat = None;
            self.make_heat();
        }
        self.changed();
        self.stale = true;
        succeeded
    }

    /// Reads the scene and the kernels again after a file has changed. If reading succeeds, the first note
    /// about the scene is shown again, since the change may have added or removed notes. If a file has a
    /// mistake, the message about the mistake stays even if the user moves the eye.
    fn reload(&mut self) {
        let succeeded = if self.live.has_own_kernels() {
            let same = self.live.strategy();
            self.compiled(same, Live::reload)
        } else {
            self.tried(Live::reload)
        };
        if succeeded {
            self.note = of_scene(&self.live);
        } else {
            self.mistake = self.answer.take();
        }
    }

    /// Shows the first note about the scene again, unless the last change has failed.
    fn note_again(&mut self) {
        if self.answer.is_none() {
            self.note = of_scene(&self.live);
        }
    }

    /// Finds the triangle at the pointer. Does nothing if the triangle at this pixel is known and cannot have changed.
    /// If the search needs more memory than is available, the line beside the picture states this.
    fn point(&mut self, pointer: Option<[u32; 2]>) {
        let known = std::mem::replace(&mut self.pointer, pointer);
        let Some(pixel) = pointer else {
            self.stale |= self.picked.take().is_some();
            return;
        };
        if known == pointer && self.picked.is_some() && !self.picker.is_building() {
            return;
        }
        let picked =
            self.picker.pick(&self.live, &self.live.camera(&self.pose), pixel).unwrap_or_else(|error| {
                self.answer = Some(error.in_a_line());
                self.stale = true;
                None
            });
        self.stale |= picked != self.picked;
        self.picked = picked;
    }

    fn tell(&mut self) -> Result<()> {
        let (rates, is_new) = self.rate.recent();
        if !is_new && !std::mem::take(&mut self.stale) {
            return Ok(());
        }
        let tests = self.heat.as_ref().map(|_| format!("at most {} tests per pixel", self.most_tests));
        let picked = self.picked.as_ref().map(Picked::text);
        let first = [self.mistake.clone(), self.answer.clone(), picked, tests].into_iter().flatten();
        self.screen.tell(&title::line(&self.live, rates, first, self.note.clone()))
    }
}

/// Returns the first note about the scene, with the number of the other notes; `None` if there are no notes.
/// All notes together would be too long for one line. The report at the end of the command contains all
/// notes.
fn of_scene(live: &Live) -> Option<String> {
    let (first, others) = live.loaded().notes.split_first()?;
    match others.len() {
        0 => Some(first.clone()),
        count => Some(format!("{first} (and {})", counted(count, "more note"))),
    }
}

/// Returns how the eye goes around the scene if the pointer is dragged. The eye goes to the left if the
/// pointer goes to the right, and up if the pointer goes down, so that the scene seems to move with the
/// pointer.
fn dragged(input: &Input) -> Action {
    Action::Orbit([-DRAG * input.orbit[0], DRAG * input.orbit[1]])
}

#[cfg(test)]
mod tests;
