//! Casts a scene on a device again and again, from the eye's current position and with the current strategy. The
//! pictures are cast by the same code as in the command `raycl render`.

use super::camera::Pose;
use super::choices::{Choices, local_sizes, strategies};
use super::sum::Sum;
use crate::cache::Cache;
use crate::cli::choice::one_device;
use crate::cli::subject::Subject;
use crate::device::{Device, DeviceInfo, common_names, discover};
use crate::error::{Error, Result};
use crate::image::to_rgb8;
use crate::launch::{Caster, FrameTimes, Prepared, Queue, Refused, Session, ShowProgram};
use crate::program::{ProgramCache, Sources};
use crate::scene::{Camera, Light, Loaded, Sample, Sampling, Scene};
use crate::strategy::Strategy;
use crate::words::counted;
use image::RgbImage;
use std::sync::Arc;

/// A picture that was cast, with the number of its rays and its time.
pub struct Frame {
    pub picture: RgbImage,
    /// The number of primary and shadow rays. Each pixel counts as a primary ray. Each pixel with a hit counts as one
    /// shadow ray per light, and as one more if there is a sky.
    pub rays: f64,
    /// The device time in milliseconds.
    pub ms: f64,
}

/// A scene on a device, ready to be cast.
pub struct Live {
    subject: Subject,
    /// True if a bare mesh without lights gets soft light, a sky and usually a ground.
    dressed: bool,
    samples: u32,
    sources: Sources,
    loaded: Loaded,
    scene: Arc<Scene>,
    /// The size of the first picture. If raycl places the scene's camera, the scene fits into a picture of this size.
    framed: [u32; 2],
    casting: Casting,
    /// The number of bytes of the host's memory that two trees use: the heat map's tree, and the tree with which raycl
    /// finds the triangle at the pointer.
    pub(super) bytes_of_trees: u64,
    /// The labels of all devices, as listed when the user last asked for the next device; empty before the user first
    /// asks for it.
    labels: Vec<String>,
    sum: Sum,
}

/// A device, with the objects that cast the scene on it.
struct Casting {
    device: Device,
    queue: Queue,
    show: Option<ShowProgram>,
    session: Session,
    strategies: Choices<Strategy>,
    local_sizes: Choices<[u32; 2]>,
    prepared: Prepared,
    caster: Caster,
}

/// The inputs of casting that do not depend on the device: the scene, the kernels and the options.
struct Wanted<'a> {
    subject: &'a Subject,
    sources: &'a Sources,
    scene: &'a Arc<Scene>,
    samples: u32,
    /// The number of bytes of the host's memory that two trees use: the heat map's tree, and the tree with which raycl
    /// finds the triangle at the pointer.
    bytes_of_trees: u64,
}

/// The list of strategies and the list of local sizes from which the user chooses with keys. Each list knows which of
/// its values is chosen now.
type Selection = (Choices<Strategy>, Choices<[u32; 2]>);
/// The objects that cast with one strategy.
type Ready = (Prepared, Caster);

impl Casting {
    /// Opens a device and prepares it for the first frame, with the user's strategy and local size. If the user has
    /// named no strategy or no local size, raycl chooses one for the device and the scene.
    fn usual_on(device: Device, wanted: &Wanted<'_>) -> Result<Self> {
        let queue = Queue::open(&device)?;
        let selection = usual(wanted.subject, &device, wanted.scene)?;
        Self::on(device, queue, wanted, selection)
    }

    /// Prepares an open device for the first frame.
    fn on(device: Device, queue: Queue, wanted: &Wanted<'_>, selection: Selection) -> Result<Self> {
        let mut session = session(&queue, &device, wanted);
        let ready =
            ready(wanted.subject, &mut session, &selection).map_err(|no| no.into_error(&device.info))?;
        let show = show(&queue, wanted.sources, &device.info)?;
        let ((strategies, local_sizes), (prepared, caster)) = (selection, ready);
        Ok(Self { device, queue, show, session, strategies, local_sizes, prepared, caster })
    }

    /// Returns copies of the list of strategies and of the list of local sizes.
    fn selection(&self) -> Selection {
        (self.strategies.clone(), self.local_sizes.clone())
    }

    /// Changes to the strategy and the local size in `selection`, and to the picture's size in `subject`. If
    /// the device cannot cast with this strategy, local size and picture size, `self` stays unchanged.
    fn change(&mut self, subject: &Subject, selection: Selection) -> std::result::Result<(), Refused> {
        (self.prepared, self.caster) = ready(subject, &mut self.session, &selection)?;
        (self.strategies, self.local_sizes) = selection;
        Ok(())
    }
}

impl Live {
    /// Loads the scene, and prepares everything for the first frame.
    pub fn open(subject: Subject, samples: u32) -> Result<Self> {
        let sources = Sources::of(subject.cl_dir.clone())?;
        let dressed = !subject.look.plain;
        let loaded = load(&subject, dressed)?;
        let device = one_device(subject.device.as_deref(), &sources)?;
        let scene = Arc::new(loaded.scene.clone());
        // The trees of the heat map and of the pointer are built later, if they fit into the memory that is then free.
        let bytes_of_trees = 0;
        let wanted = Wanted { subject: &subject, sources: &sources, scene: &scene, samples, bytes_of_trees };
        let casting = Casting::usual_on(device, &wanted)?;
        let (framed, sum) = (subject.size(), Sum::of(samples));
        let labels = Vec::new();
        Ok(Self {
            subject,
            dressed,
            samples,
            sources,
            loaded,
            scene,
            framed,
            casting,
            bytes_of_trees,
            labels,
            sum,
        })
    }

    /// Sets how many bytes of the host's memory two trees use: the heat map's tree, and the tree with which raycl finds
    /// the triangle at the pointer. When the strategy, the device, the scene or the picture's size next changes, these
    /// bytes count as used.
    pub fn count_trees(&mut self, bytes_of_trees: u64) {
        self.bytes_of_trees = bytes_of_trees;
        self.casting.session.set_bytes_beside(bytes_of_trees);
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns the scene as it was loaded, with the notes about it for the user.
    pub fn loaded(&self) -> &Loaded {
        &self.loaded
    }

    /// Adds notes for the user to those about the scene.
    pub fn add_notes(&mut self, notes: impl IntoIterator<Item = String>) {
        self.loaded.notes.extend(notes);
    }

    /// Returns the device.
    pub fn device(&self) -> &DeviceInfo {
        &self.casting.device.info
    }

    /// Returns the device's name for the user. Devices with the same common name get different names once the user has
    /// asked for the next device.
    pub fn device_name(&self) -> String {
        told_apart(self.device(), &self.labels)
    }

    /// Returns the strategy.
    pub fn strategy(&self) -> Strategy {
        self.casting.strategies.taken()
    }

    /// Returns the strategy to which [`Self::next_strategy`] changes if the device can use it; the present
    /// strategy if the list has no other strategy.
    pub fn strategy_after(&self, steps: isize) -> Strategy {
        self.casting.strategies.others(steps).next().map_or_else(|| self.strategy(), |next| next.taken())
    }

    /// Returns true if the user has named a folder of kernel files, which may change while the scene is
    /// shown.
    pub fn has_own_kernels(&self) -> bool {
        self.subject.cl_dir.is_some()
    }

    /// Returns the local size.
    pub fn local_size(&self) -> [u32; 2] {
        self.casting.prepared.workload.local_size
    }

    /// Returns the picture's size: pixels across and down.
    pub fn size(&self) -> [u32; 2] {
        self.subject.size()
    }

    /// Returns the number of samples per pixel that have been cast so far, and the number of samples per
    /// pixel that will be cast in all.
    pub fn progress(&self) -> [usize; 2] {
        self.sum.progress()
    }

    /// Returns the camera at a position of the eye.
    pub fn camera(&self, pose: &Pose) -> Camera {
        self.view(pose).0
    }

    /// Returns the camera and the lights for a position of the eye. Lights that raycl added to a mesh turn with the eye
    /// around the scene's vertical axis, but follow no other movement of the eye.
    pub fn view(&self, pose: &Pose) -> (Camera, Vec<Light>) {
        let (camera, lights) = pose.at(&self.scene, &self.loaded.orbit);
        (fitted(camera, self.framed, self.size()), lights)
    }

    /// Returns half the height of the image plane at distance 1 from the eye.
    pub fn half_height(&self) -> f64 {
        half_height(&fitted(self.scene.camera, self.framed, self.size()), self.size())
    }

    /// Begins a new picture, for example because the eye has moved.
    pub fn moved(&mut self) {
        self.sum.restart();
    }

    /// Casts the next sample from a position of the eye. Returns the mean of the samples so far, or `None` if all
    /// samples have been cast.
    pub fn cast(&mut self, pose: &Pose) -> Result<Option<Frame>> {
        let Some(sample) = self.sum.next() else { return Ok(None) };
        let frame = self.frame(pose, &sample);
        frame.map(Some).map_err(|refused| refused.into_error(self.device()))
    }

    fn frame(&mut self, pose: &Pose, sample: &Sample) -> std::result::Result<Frame, Refused> {
        let reading = Refused::at("reading the image");
        let (camera, lights) = self.view(pose);
        if self.loaded.orbit.with_lights {
            self.casting.prepared.move_lights(&lights).map_err(Refused::at("moving the lights"))?;
        }
        let times = self.casting.caster.cast_sample(&camera, sample).map_err(Refused::at("the launch"))?;
        self.sum.add();
        if let Some((picture, hits)) = self.shown().map_err(&reading)? {
            return Ok(self.frame_of(picture, hits, &times));
        }
        let (mean, hits) = self.casting.caster.read().map_err(&reading)?;
        Ok(self.frame_of(to_rgb8(&mean, self.scene.display), hits, &times))
    }

    /// Returns the mean of the samples so far as an 8-bit picture, and the number of pixels that hit something; `None`
    /// if a pixel's value is not finite.
    fn shown(&self) -> std::result::Result<Option<(RgbImage, usize)>, crate::launch::LaunchError> {
        let display = self.scene.display;
        let Casting { show, caster, .. } = &self.casting;
        caster.read_8_bits(show.as_ref(), display)
    }

    fn frame_of(&self, picture: RgbImage, hits: usize, times: &FrameTimes) -> Frame {
        let lights = self.scene.lights.len() + usize::from(self.scene.sky.is_some());
        let pixels = picture.pixels().len();
        Frame { picture, rays: (pixels + hits * lights) as f64, ms: times.frame_ms }
    }

    /// Changes to the strategy that is `steps` steps further in the list, or back if `steps` is negative. If
    /// the device cannot use this strategy, changes to the first usable strategy after it (before it, if
    /// `steps` is negative). The view then uses the local size that the user has named on the command line.
    /// If the user has named no local size, or if the device cannot use the named local size with the new
    /// strategy, the view uses the usual local size of the new strategy.
    ///
    /// # Errors
    ///
    /// Fails if the device can use no other strategy of the list. The message states why the device cannot
    /// use the last strategy that was tried.
    pub fn next_strategy(&mut self, steps: isize) -> Result<()> {
        let (first, first_local_size) = self.first()?;
        let selections = self.casting.strategies.others(steps).flat_map(|strategies| {
            let taken = strategies.taken();
            let usual =
                if taken == first { first_local_size } else { taken.usual_local_size(&self.device().limits) };
            let named = self.subject.local_size.filter(|named| *named != usual);
            let sizes = named.into_iter().chain([usual]);
            sizes.map(move |local_size| (strategies.clone(), local_sizes(local_size)))
        });
        self.take(selections.collect(), "strategy")
    }

    /// Changes to the local size that is `steps` steps further in the list, or back if `steps` is negative. If the
    /// device cannot use this local size, changes to the first usable local size after it (before it, if `steps` is
    /// negative). If the user has named no local size on the command line, the first local size of the list is raycl's
    /// choice. Only for this choice, raycl may shrink a work-group that is too large for the device.
    ///
    /// # Errors
    ///
    /// Fails if the device can use no other local size of the list. The message states why the device cannot
    /// use the last local size that was tried.
    pub fn next_local_size(&mut self, steps: isize) -> Result<()> {
        let Casting { strategies, local_sizes, .. } = &self.casting;
        let selections = local_sizes.others(steps).map(|sizes| (strategies.clone(), sizes));
        self.take(selections.collect(), "local size")
    }

    /// Returns the strategy and the local size with which the device casts first: the strategy and the local
    /// size that the user has named on the command line. raycl chooses whatever the user has not named.
    fn first(&self) -> Result<(Strategy, [u32; 2])> {
        self.subject.strategy(self.device(), self.subject.task(&self.scene, 1))
    }

    /// Changes to the first pair in `selections` (a strategy and a local size) that the device can use. Fails if the
    /// device can use none of them. Also fails if `selections` is empty; in this case, the message says that there is
    /// no other `choice`, such as "strategy".
    fn take(&mut self, selections: Vec<Selection>, choice: &str) -> Result<()> {
        let mut last = None;
        for selection in selections {
            match self.casting.change(&self.subject, selection) {
                Ok(()) => {
                    self.sum.restart();
                    return Ok(());
                }
                Err(refused) => last = Some(refused),
            }
        }
        Err(match last {
            Some(refused) => refused.into_error(self.device()),
            None => Error::input(format!("there is no other {choice} to choose")),
        })
    }

    /// Changes to the next device, with the strategy and the local size that the user has named on the command line. If
    /// the user has named no strategy or no local size, raycl chooses one for the next device and the scene. If the
    /// next device cannot be opened or cannot cast the scene, changes to the first later device that can cast the
    /// scene.
    ///
    /// # Errors
    ///
    /// Fails if the devices cannot be listed, or if no other usable device can cast the scene. If raycl has tried other
    /// devices, the message states why the last one cannot cast the scene.
    pub fn next_device(&mut self) -> Result<()> {
        let all = discover(&self.sources)?;
        self.labels = all.iter().map(|device| device.info.label.clone()).collect();
        self.move_to_first(others(self.device(), all))
    }

    /// Changes to the first device in `devices` that can cast the scene. If none of them can cast the scene, returns
    /// the error of the last device. If `devices` is empty, returns the error of [`only`].
    fn move_to_first(&mut self, devices: Vec<Device>) -> Result<()> {
        let mut last = only(self.device());
        for device in devices {
            match self.move_to(device) {
                Ok(()) => return Ok(()),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn move_to(&mut self, mut device: Device) -> Result<()> {
        device.test_lanes(&self.sources)?;
        let Self { subject, sources, scene, samples, bytes_of_trees, .. } = &*self;
        let (samples, bytes_of_trees) = (*samples, *bytes_of_trees);
        let wanted = Wanted { subject, sources, scene, samples, bytes_of_trees };
        self.casting = Casting::usual_on(device, &wanted)?;
        self.sum.restart();
        Ok(())
    }

    /// Casts pictures of another size from now on. Each picture of the new size shows at least the part of
    /// the scene that a picture of the first size shows. If the device cannot cast pictures of this size,
    /// `self` stays unchanged.
    pub fn resize(&mut self, [width, height]: [u32; 2]) -> Result<()> {
        let subject = Subject { width, height, ..self.subject.clone() };
        let changed = self.casting.change(&subject, self.casting.selection());
        changed.map_err(|no| no.into_error(self.device()))?;
        self.subject = subject;
        self.sum.restart();
        Ok(())
    }

    /// Reads the scene and the kernels again, and keeps the strategy and the local size. If the reload fails,
    /// `self` stays unchanged.
    pub fn reload(&mut self) -> Result<()> {
        let sources = Sources::of(self.subject.cl_dir.clone())?;
        let [width, height] = self.framed;
        let framed = Subject { width, height, ..self.subject.clone() };
        let loaded = load(&framed, self.dressed)?;
        let scene = Arc::new(loaded.scene.clone());
        let (subject, samples, bytes_of_trees) = (&self.subject, self.samples, self.bytes_of_trees);
        let wanted = Wanted { subject, sources: &sources, scene: &scene, samples, bytes_of_trees };
        let Casting { device, queue, .. } = &self.casting;
        self.casting = Casting::on(device.clone(), queue.clone(), &wanted, self.casting.selection())?;
        (self.sources, self.loaded, self.scene) = (sources, loaded, scene);
        self.sum.restart();
        Ok(())
    }
}

/// Loads the scene. If raycl places the camera, the camera is so far away that the whole scene is visible from several
/// angles all around. Notes say that the view shows only the first frame of an animation, and black in place of a
/// transparent background.
fn load(subject: &Subject, dressed: bool) -> Result<Loaded> {
    let mut loaded = subject.load(true, dressed)?;
    let frames = loaded.animation.as_ref().map_or(1, |animation| animation.frames);
    if frames > 1 {
        let frames = counted(frames as usize, "frame");
        let note = format!("the view shows the first of {frames}: `raycl render --animate` renders all");
        loaded.notes.push(note);
    }
    if loaded.scene.transparent {
        loaded.notes.push("the view shows a transparent background as black".to_owned());
    }
    Ok(loaded)
}

/// Returns the usable devices other than `current`: first those that follow `current` in `devices`, then those before
/// it.
fn others(current: &DeviceInfo, devices: Vec<Device>) -> Vec<Device> {
    let is_current = |device: &Device| device.info.identity() == current.identity();
    let mut usable = devices;
    usable.retain(|device| device.info.unusable.is_none());
    let next = usable.iter().position(is_current).map_or(0, |index| index + 1);
    usable.rotate_left(next);
    usable.retain(|device| !is_current(device));
    usable
}

/// Returns the device's common name or, if one of the other devices in `labels` has the same common name, the device's
/// label.
fn told_apart(device: &DeviceInfo, labels: &[String]) -> String {
    let mut names = common_names(labels.iter().map(String::as_str));
    names.remove(device.label.as_str()).unwrap_or_else(|| device.common_name())
}

/// Returns the error for the case that there is no other usable device. The message names the device by its common
/// name.
fn only(device: &DeviceInfo) -> Error {
    Error::input(format!("{} is the only usable device", device.common_name()))
}

/// Opens a session: a scene on an open device, for which programs and buffers can be prepared. When the user changes
/// the device, the new session is opened before the old session is closed, so both sessions are open for a moment. PoCL
/// 5.0 aborts the process if two of PoCL's devices run the same program. If the user changes from a CPU to its twin (a
/// second device with the same properties), each of the two therefore gets a program of its own. Twins that are GPUs
/// use the same program.
fn session(queue: &Queue, device: &Device, wanted: &Wanted<'_>) -> Session {
    let mut session = Session::new(queue.clone(), &device.info, wanted.sources, Arc::clone(wanted.scene))
        .among_twins(device.info.program_twin())
        .with_sampling(Sampling::all(wanted.samples));
    session.set_bytes_beside(wanted.bytes_of_trees);
    session
}

/// Returns the program with which a device with its own memory applies the display transform (exposure, tone curve,
/// gamma and conversion to 8 bits). Returns `None` if the device uses the host's memory. Also returns `None` if the
/// program contains none of the user's files and cannot be built for the device. If the device has no program for the
/// display transform, the host applies the transform.
///
/// # Errors
///
/// Fails if the program contains one of the user's files and cannot be built.
fn show(queue: &Queue, sources: &Sources, device: &DeviceInfo) -> Result<Option<ShowProgram>> {
    if queue.shares_memory {
        return Ok(None);
    }
    let spec = ShowProgram::spec(sources, queue)?;
    ShowProgram::usable(queue, &spec, &ProgramCache::of(Cache::of_user(), device), (sources, device))
}

/// Returns the list of strategies and the list of local sizes from which the user chooses with keys. The first value of
/// each list is chosen now: the value that the user has named on the command line or, if the user has named none,
/// raycl's choice for the device and the scene.
fn usual(subject: &Subject, device: &Device, scene: &Scene) -> Result<Selection> {
    let (strategy, local_size) = subject.strategy(&device.info, subject.task(scene, 1))?;
    Ok((strategies(strategy, &device.info), local_sizes(local_size)))
}

/// Prepares the strategy and the local size in `selection`. A local size that the user has chosen with keys counts
/// like one that is named on the command line: raycl does not replace it by a smaller one.
fn ready(
    subject: &Subject,
    session: &mut Session,
    selection: &Selection,
) -> std::result::Result<Ready, Refused> {
    let (strategies, local_sizes) = selection;
    let local_size = local_sizes.taken_after_first().or(subject.local_size);
    let subject = Subject { local_size, ..subject.clone() };
    let prepared = subject.prepare(session, &strategies.taken(), local_sizes.taken())?;
    let caster = prepared.caster()?;
    Ok((prepared, caster))
}

/// Returns the camera for pictures of `size`, made from `camera`, the camera for pictures of the size `framed`. If the
/// new pictures are wider in proportion to their height, the vertical field of view stays the same. If the new pictures
/// are narrower in proportion, the horizontal field of view stays the same. Everything that is visible in pictures of
/// the size `framed` therefore stays visible.
fn fitted(camera: Camera, framed: [u32; 2], size: [u32; 2]) -> Camera {
    let [aspect, old_aspect] = [size, framed].map(|[width, height]| f64::from(width) / f64::from(height));
    if aspect == old_aspect {
        return camera;
    }
    let half_height = half_height(&camera, framed);
    let fov_is_vertical = aspect > old_aspect;
    let tan = if fov_is_vertical { half_height } else { half_height * old_aspect };
    Camera { tan_half_fov: tan as f32, fov_is_vertical, ..camera }
}

/// Returns half the height of the image plane at distance 1 from the eye, for a picture of this size.
fn half_height(camera: &Camera, size: [u32; 2]) -> f64 {
    let [width, height] = size.map(f64::from);
    f64::from(camera.tan_half_fov) * if camera.fov_is_vertical { 1.0 } else { height / width }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_pictures_height_is_where_its_rays_end() {
        for fov_is_vertical in [false, true] {
            let camera = Camera { fov_is_vertical, tan_half_fov: 0.75, ..Camera::PAPER };
            let top = camera.pixel_frame(200, 80).corner.y;
            assert!((half_height(&camera, [200, 80]) - top).abs() < 1e-12, "{fov_is_vertical}: {top}");
        }
    }

    #[test]
    fn a_picture_of_another_size_shows_all_that_was_visible() {
        for fov_is_vertical in [false, true] {
            let camera = Camera { fov_is_vertical, tan_half_fov: 0.75, ..Camera::PAPER };
            assert_eq!(fitted(camera, [200, 80], [100, 40]), camera, "the same proportions");
            let corner = |camera: Camera, [width, height]: [u32; 2]| {
                let corner = camera.pixel_frame(width, height).corner;
                [-corner.x, corner.y]
            };
            let [half_width, half_height] = corner(camera, [200, 80]);
            let fitted = |size| corner(fitted(camera, [200, 80], size), size);
            for (size, expected) in [
                ([300, 80], [1.5 * half_width, half_height]),
                ([200, 160], [half_width, 2.0 * half_height]),
                ([50, 80], [half_width, 4.0 * half_height]),
            ] {
                let [x, y] = fitted(size);
                let is_near = (x - expected[0]).abs() < 1e-6 && (y - expected[1]).abs() < 1e-6;
                assert!(is_near, "{fov_is_vertical} {size:?}: {x} {y}, not {expected:?}");
            }
        }
    }

    #[test]
    fn a_scene_that_is_read_again_keeps_what_a_picture_of_another_size_shows() {
        let mut live = live(&[], 1);
        live.resize([80, 20]).expect("another size");
        let before = live.view(&Pose::START);
        live.reload().expect("the same scene");
        assert!(before.0.fov_is_vertical && live.size() == [80, 20]);
        assert_eq!(live.view(&Pose::START), before);
    }

    use super::super::tests::{live, live_of};

    #[test]
    fn a_note_says_that_only_the_first_frame_of_an_animated_scene_is_shown() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        let write = |frames: u32| {
            let still = include_str!("../../scenes/triangle.toml");
            std::fs::write(&path, format!("{still}\n[animation]\nframes = {frames}\n")).expect("a file");
        };
        write(4);
        let mut live = live_of(&path, ["40", "20"], &[], 1);
        let note = |frames| {
            format!("the view shows the first of {frames} frames: `raycl render --animate` renders all")
        };
        assert_eq!(live.loaded().notes, [note(4)]);
        write(3);
        live.reload().expect("it can be read");
        assert_eq!(live.loaded().notes, [note(3)]);
        write(1);
        live.reload().expect("it can be read");
        assert!(live.loaded().notes.is_empty(), "{:?}", live.loaded().notes);
    }

    #[test]
    fn a_note_says_that_a_transparent_background_is_black() {
        let noted = |options: &[&str]| {
            live(options, 1)
                .loaded()
                .notes
                .iter()
                .any(|note| note.contains("transparent background as black"))
        };
        assert!(noted(&["--background", "transparent"]) && !noted(&["--background", "black"]));
    }

    #[test]
    fn shadow_rays_of_all_lights_and_of_the_sky_are_counted() {
        let rays = |options: &[&str]| {
            let frame = live(options, 1).cast(&Pose::START).expect("it casts").expect("a frame");
            let background = frame.picture.get_pixel(0, 0);
            let hits = frame.picture.pixels().filter(|pixel| *pixel != background).count();
            (frame.rays as usize - 800, hits)
        };
        let (of_light, hits) = rays(&[]);
        assert!(of_light > 50 && of_light == hits, "{of_light} {hits}");
        let (of_light_and_sky, _) = rays(&["--set", "sky.zenith=1"]);
        assert_eq!(of_light_and_sky, 2 * of_light);
    }

    #[test]
    fn another_local_size_or_strategy_begins_a_new_picture_and_steps_back_return() {
        let mut live = live(&[], 2);
        let (strategy, own) = (live.strategy(), live.local_size());
        let cast = |live: &mut Live| {
            live.cast(&Pose::START).expect("it casts").expect("a frame");
            live.progress()
        };
        assert_eq!((own, cast(&mut live)), ([8, 8], [1, 2]));
        live.next_local_size(1).expect("another size");
        assert_eq!((live.local_size(), live.strategy(), live.progress()), ([1, 1], strategy, [0, 2]));
        cast(&mut live);
        live.next_local_size(-1).expect("the first size");
        assert_eq!((live.local_size(), live.progress()), (own, [0, 2]));
        cast(&mut live);
        live.next_strategy(1).expect("another strategy");
        assert_eq!(live.progress(), [0, 2]);
        let next = strategies(strategy, live.device()).others(1).next().map(|next| next.taken());
        assert_eq!(Some(live.strategy()), next);
        live.next_strategy(-1).expect("the first strategy");
        assert_eq!((live.strategy(), live.local_size()), (strategy, own));
        cast(&mut live);
        live.moved();
        assert_eq!(live.progress(), [0, 2]);
    }

    #[test]
    fn a_step_to_another_strategy_keeps_a_local_size_that_was_named_and_a_step_back_brings_back_the_usual_one()
     {
        let mut named = live(&["--local-size", "4x2"], 1);
        named.next_strategy(1).expect("another strategy");
        assert_eq!(named.local_size(), [4, 2]);
        let mut tile = live(&["--strategy", "tile"], 1);
        let own = tile.local_size();
        tile.next_strategy(1).expect("another strategy");
        assert_eq!((tile.local_size(), own), ([8, 8], [1, 1]));
        tile.next_strategy(-1).expect("the first strategy");
        assert_eq!(tile.local_size(), own);
    }

    /// With tiles, the work-groups of some local sizes are too large for the stack of a CPU's thread.
    #[test]
    fn steps_through_the_local_sizes_show_each_size_once() {
        let mut tile = live(&["--strategy", "tile"], 1);
        let mut seen = vec![tile.local_size()];
        loop {
            tile.next_local_size(1).expect("another size");
            if tile.local_size() == seen[0] {
                break;
            }
            assert!(!seen.contains(&tile.local_size()), "{:?} after {seen:?}", tile.local_size());
            seen.push(tile.local_size());
        }
        assert!(seen.len() > 3, "{seen:?}");
    }

    #[test]
    fn the_next_device_is_the_next_usable_one_and_the_last_is_followed_by_the_first() {
        let device = discover(&Sources::Embedded).expect("devices").remove(0);
        let named = |name: &str, unusable: Option<&str>| {
            let (name, unusable) = (name.to_owned(), unusable.map(str::to_owned));
            Device { info: DeviceInfo { name, unusable, ..device.info.clone() }, ..device.clone() }
        };
        let devices =
            ["a", "b", "c", "d"].map(|name| named(name, (name == "c").then_some("its driver is old")));
        let next = |current: &str, devices: &[Device]| {
            let others = others(&named(current, None).info, devices.to_vec());
            others.into_iter().map(|device| device.info.name).collect::<String>()
        };
        assert_eq!(["a", "b", "d"].map(|name| next(name, &devices)), ["bd", "da", "ab"]);
        assert_eq!(next("unplugged", &devices), "abd");
        // A twin is a second device with the same properties as another device; only `twins_before`
        // distinguishes the two.
        let mut twin = named("a", None);
        twin.info.twins_before = 1;
        let of_twin = others(&twin.info, vec![devices[0].clone(), twin.clone()]);
        assert_eq!(of_twin.iter().map(|next| next.info.twins_before).collect::<Vec<_>>(), [0]);
        assert_eq!([next("a", &devices[..1]), next("b", &devices[1..3]), next("a", &[])], [""; 3]);
    }

    #[test]
    fn the_only_device_has_the_name_that_the_line_shows() {
        let name = "pthread-haswell-AMD EPYC".to_owned();
        let device = DeviceInfo { label: name.clone(), name, ..crate::experiment::asleep::device(1.0) };
        assert_eq!(only(&device).to_string(), "AMD EPYC, PoCL is the only usable device");
    }

    #[test]
    fn devices_of_one_common_name_are_told_apart_by_their_labels() {
        let device = |driver: &str| {
            let name = format!("{driver}-Intel(R) Xeon(R) Processor");
            DeviceInfo { label: name.clone(), name, ..crate::experiment::asleep::device(1.0) }
        };
        let devices = ["basic", "pthread"].map(device);
        let labels = devices.each_ref().map(|device| device.label.clone());
        let names = |labels: &[String]| devices.each_ref().map(|device| told_apart(device, labels));
        assert_eq!(names(&labels), labels);
        assert_eq!([names(&[]), names(&labels[..1])], [["Intel Xeon, PoCL"; 2]; 2]);
    }

    #[test]
    fn another_device_begins_a_new_picture_in_the_usual_way_and_one_that_cannot_cast_changes_nothing() {
        let mut live = live(&[], 2);
        let (usual, own) = ((live.strategy(), live.local_size()), live.device().name.clone());
        let cast = |live: &mut Live| live.cast(&Pose::START).expect("it casts").expect("a frame").picture;
        let picture = cast(&mut live);
        live.next_strategy(1).expect("another strategy");
        live.next_local_size(1).expect("another size");
        let chosen = (live.strategy(), live.local_size());
        assert!(chosen.0 != usual.0 && chosen.1 != usual.1);
        cast(&mut live);
        let mut small = live.casting.device.clone();
        small.info.limits.allocation_bytes = 1;
        small.info.name = "small".into();
        let error = live.move_to_first(vec![small.clone()]).expect_err("nothing fits into a byte");
        assert_eq!(
            ((live.strategy(), live.local_size()), live.device().name.clone(), live.progress()),
            (chosen, own, [1, 2]),
            "{error}"
        );
        let mut other = live.casting.device.clone();
        other.info.name = "other".into();
        live.move_to_first(vec![small, other]).expect("the second device can cast");
        assert_eq!(
            ((live.strategy(), live.local_size()), live.device().name.as_str(), live.progress()),
            (usual, "other", [0, 2])
        );
        assert!(cast(&mut live) == picture);
    }

    #[test]
    fn the_twin_of_a_cpu_has_a_program_of_its_own() {
        let mut live = live(&[], 1);
        let spec = |live: &Live| live.casting.prepared.spec.clone();
        let ordinary = spec(&live);
        let mut twin = live.casting.device.clone();
        twin.info.twins_before = 1;
        live.move_to(twin).expect("it can cast");
        assert_eq!(spec(&live).source, ordinary.source);
        assert_eq!(spec(&live).options, format!("{} -D TWINS_BEFORE=1", ordinary.options));
        live.reload().expect("it can be read");
        assert!(spec(&live).options.ends_with(" -D TWINS_BEFORE=1"), "{}", spec(&live).options);
    }

    #[test]
    fn a_scene_that_is_read_again_is_cast_in_the_chosen_way() {
        let mut live = live(&[], 2);
        live.next_strategy(1).expect("another strategy");
        live.next_local_size(1).expect("another size");
        let chosen = (live.strategy(), live.local_size());
        live.cast(&Pose::START).expect("it casts");
        live.reload().expect("it can be read");
        assert_eq!(((live.strategy(), live.local_size()), live.progress()), (chosen, [0, 2]));
    }

    #[test]
    fn the_users_display_kernel_is_read_again_too_and_its_mistakes_are_reported() {
        let own = Sources::Embedded.read("display/show.cl").expect("a kernel file");
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("display")).expect("a folder");
        let write = |text: &str| {
            std::fs::write(folder.path().join("display/show.cl"), text).expect("a file");
        };
        write(&own);
        let mut live = live(&["--cl-dir", folder.path().to_str().expect("UTF-8")], 2);
        // Only a device with memory of its own uses the kernel for the display transform.
        live.casting.queue = live.casting.queue.clone().with_separate_memory(1 << 20);
        let reds = |live: &mut Live| {
            let picture = live.cast(&Pose::START).expect("it casts").expect("a frame").picture;
            picture.pixels().filter(|pixel| pixel[0] == 77).count()
        };
        assert!(reds(&mut live) < 800);
        let red = "bytes[3 * i] = shown(pixel.x, smallest, at_least);";
        assert_eq!(own.matches(red).count(), 1);
        write(&own.replace(red, "bytes[3 * i] = 77;"));
        live.reload().expect("it can be read");
        assert_eq!(reds(&mut live), 800, "all pixels");
        write(&own.replace(red, "bytes[3 * i] = ;"));
        let error = live.reload().expect_err("it does not compile").to_string();
        assert!(error.starts_with("a kernel file does not compile: "), "{error}");
        assert!(error.contains(&format!("{}:", folder.path().join("display/show.cl").display())), "{error}");
        live.moved();
        assert_eq!(reds(&mut live), 800, "it is shown as before");
    }
}
