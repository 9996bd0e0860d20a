//! A caster has everything that is needed to cast a frame repeatedly: with one strategy and fixed sizes, for one scene
//! on one device.

mod read;

use super::arguments::Arguments;
use super::band::Band;
use super::buffers::allocate;
use super::frame::{FrameTimes, Pass};
use super::half_light::{HalfLight, LightParts};
use super::held::FrameBytes;
use super::parts::Parts;
use super::records::Records;
use super::samples::Samples;
use super::setup::{Setup, Working, background_arguments, camera_arguments, sample_argument};
use super::shared::Shared;
use super::shared_frame::SharedFrame;
use super::steps::{Extent, Steps};
use super::subpixels::{frames, most_bits, subpixel_arguments, tiles_of_block};
use super::{DeviceTree, LaunchError, Queue};
use crate::clock::ms_since;
use crate::manifest::ROW_FLOATS;
use crate::scene::{Camera, Sample, SampleCounts, Sampling, Scene};
use crate::strategy::{Passes, Requirements, Strategy, WorkingMemory, Workload};
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};
use std::collections::HashSet;
use std::slice;
use std::sync::Arc;
use std::time::Instant;

/// A frame's kernels with their arguments, ready to cast the frame.
pub struct Caster {
    queue: Queue,
    steps: Steps,
    image: Buffer<Float4>,
    working: Working,
    samples: Option<Samples>,
    /// The two half pictures (pictures of half the width and height) in which soft light is cast; `None` if
    /// soft light is not cast at half resolution.
    half_light: Option<Box<HalfLight>>,
    /// The finest division of a pixel in a frame: 2^`most_bits` sub-pixels across and as many down, each with at most
    /// one sample.
    most_bits: u32,
    /// Number of rays in a tile, across and down, if a frame can leave out the rays of some tiles; `None` if every
    /// frame casts the rays of all tiles.
    tile: Option<[usize; 2]>,
    size: [u32; 2],
    /// True if the background is transparent: images contain the coverage (alpha) of each pixel.
    transparent: bool,
    /// True if the program contains a kernel file that the user added or changed.
    has_own_file: bool,
    records_ms: Option<f64>,
    _bytes: Option<FrameBytes>,
    /// The tree, whose buffers the kernels use. Some of these buffers may use the memory of the mesh's lists. This
    /// reference keeps the buffers, and the lists that they use, from being freed.
    _tree: Option<Arc<DeviceTree>>,
}

impl Caster {
    /// Makes buffers and kernels for a frame of `workload.image_size`, or for a band of the frame (the rows of
    /// work-groups that one of several devices casts). Also prepares the records of triangles, if the strategy has
    /// records, and makes the two half pictures, if the workload has soft light at half resolution. Even for a band,
    /// buffers have the size of the whole frame, and all triangles are prepared and rasterised. The caster owns
    /// `bytes`, so that its buffers' bytes are counted until the caster is dropped.
    pub(super) fn new(setup: Setup<'_>, band: Option<Band>, bytes: FrameBytes) -> Result<Self, LaunchError> {
        let caster = Self { _bytes: Some(bytes), ..Self::of(setup, band)? };
        let half_light =
            setup.workload.half_light.then(|| HalfLight::new(&setup, &caster.image)).transpose()?;
        Ok(Self { half_light: half_light.map(Box::new), ..caster })
    }

    /// Makes buffers and kernels for a half picture (a picture of half the width and height, for soft light).
    /// The bytes of the half picture's buffers are already counted as bytes of the frame that uses the half
    /// picture.
    pub(super) fn alone(setup: Setup<'_>) -> Result<Self, LaunchError> {
        Self::of(setup, None)
    }

    fn of(setup: Setup<'_>, band: Option<Band>) -> Result<Self, LaunchError> {
        let Setup { queue, strategy, workload, .. } = setup;
        let size = workload.image_size;
        let pixels = size[0] as usize * size[1] as usize;
        let image = allocate::<Float4>(queue, pixels)?;
        let working = working(queue, strategy, workload)?;
        let prepared = prepared_planes(queue, strategy, workload)?;
        let records = Records::prepare(&setup)?;
        let samples = Samples::allocate(queue, workload)?;
        let mut arguments = working.add_to(setup.arguments());
        if let Some(samples) = &samples {
            arguments = samples.add_to(arguments);
        }
        let arguments = arguments
            .with_any("records", records.as_ref().map(|records| &records.buffer))
            .with_any("prepared", prepared.as_ref());
        let tile = strategy.shared_tile().filter(|_| band.is_none());
        let parts = Parts { setup, arguments, working: &working, prepared: prepared.as_ref(), band };
        let steps = steps(&parts, &image)?;
        let mark = samples.as_ref().map(|samples| samples.mark_kernel(&parts, &image)).transpose()?;
        let samples = samples.zip(mark).map(|(samples, kernel)| samples.marked_by(kernel));
        let records_ms = records.as_ref().map(|records| records.prepare_ms);
        let most_bits = most_bits(&setup);
        let (queue, transparent) = (queue.clone(), setup.scene.transparent);
        Ok(Self {
            queue,
            steps,
            image,
            working,
            samples,
            half_light: None,
            most_bits,
            tile,
            size,
            transparent,
            has_own_file: !setup.own_files.is_empty(),
            records_ms,
            _bytes: None,
            _tree: setup.tree.cloned(),
        })
    }

    /// Returns the device time in milliseconds for preparing the records of triangles; `None` if the strategy
    /// has no records. The preparation is done once and is not part of a frame's time.
    pub fn records_ms(&self) -> Option<f64> {
        self.records_ms
    }

    /// Returns the image size in pixels: across, down.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Casts the frame once, waits until the frame is complete, and returns its times.
    pub fn cast(&self) -> Result<FrameTimes, LaunchError> {
        self.cast_batch(1)
    }

    /// Casts the frame `frames` times, waits until the last one is complete, and returns the mean times per
    /// frame.
    pub fn cast_batch(&self, frames: u32) -> Result<FrameTimes, LaunchError> {
        self.cast_extent(frames, Extent::default())
    }

    /// Casts the frame `frames` times, and waits until the last one is complete. `extent` says how many rays each pixel
    /// has, and of how many tiles the rays are cast. Returns the mean times per frame.
    fn cast_extent(&self, frames: u32, extent: Extent) -> Result<FrameTimes, LaunchError> {
        let start = Instant::now();
        let mut events = Vec::with_capacity(self.steps.len() * frames as usize);
        for _ in 0..frames {
            for (pass, step) in &self.steps {
                events.push((*pass, step.enqueue(&self.queue, extent)?));
            }
        }
        self.queue.commands.finish()?;
        Ok(FrameTimes::of(&events, ms_since(start), frames)?)
    }

    /// Sets the camera of the next frame and of all later frames.
    fn look_from(&self, camera: &Camera) -> Result<(), LaunchError> {
        let arguments = camera_arguments(Arguments::default(), camera, self.size);
        self.kernels().try_for_each(|kernel| arguments.rebind(kernel))
    }

    /// Sets the background, the shadow bias, the exposure and the tone curve to those of a scene, starting with the
    /// next frame. The exposure and the tone curve also decide which blocks of pixels are rough and get more samples.
    /// In a rough block, neighbouring pixels differ visibly when they are displayed.
    pub(super) fn show_background(&self, scene: &Scene) -> Result<(), LaunchError> {
        if let Some(samples) = &self.samples {
            samples.show(scene.display)?;
        }
        if let Some(half) = &self.half_light {
            half.show_background(scene)?;
        }
        let arguments = background_arguments(Arguments::default(), scene);
        self.kernels().try_for_each(|kernel| arguments.rebind(kernel))
    }

    /// Casts a picture with the samples that `sampling` asks for. If `sampling` is adaptive, only rough blocks of
    /// pixels get all samples. A frame may cast several samples at once, if the strategy supports this for the scene.
    /// The image becomes the mean of the samples. If `sampling` asks for soft light at half resolution, two pictures of
    /// half the width and height are cast, too. The light from surfaces in the image is then multiplied by the filtered
    /// ratio of these two pictures. Returns the total times of all frames.
    pub fn cast_samples(&self, camera: &Camera, sampling: &Sampling) -> Result<FrameTimes, LaunchError> {
        let times = self.cast_rounds(camera, sampling)?;
        let Some(half) = self.half_light(sampling) else { return Ok(times) };
        let times = times.and(&half.cast(camera, sampling)?);
        Ok(times.and(&half.apply(&self.queue)?))
    }

    /// Casts the picture of [`Self::cast_samples`] `pictures` times. Returns the mean times per picture.
    pub fn cast_samples_batch(
        &self,
        camera: &Camera,
        sampling: &Sampling,
        pictures: u32,
    ) -> Result<FrameTimes, LaunchError> {
        let add =
            |total: FrameTimes, _| Ok::<_, LaunchError>(total.and(&self.cast_samples(camera, sampling)?));
        Ok((0..pictures).try_fold(FrameTimes::default(), add)?.per_frame(pictures))
    }

    /// Casts and reads the three pictures from which a picture with soft light at half resolution is
    /// computed: the whole picture and the two half pictures. Returns `None` if soft light is not cast at
    /// half resolution.
    pub fn cast_parts(
        &self,
        camera: &Camera,
        sampling: &Sampling,
    ) -> Result<Option<LightParts>, LaunchError> {
        let Some(half) = self.half_light(sampling) else { return Ok(None) };
        self.cast_rounds(camera, sampling)?;
        half.cast(camera, sampling)?;
        let (whole, hits) = self.read()?;
        let hit_shares = self.read_hit_shares()?;
        let [lit, unoccluded] = half.read()?;
        let half_hit_shares = half.read_hit_shares()?;
        Ok(Some(LightParts { whole, hits, hit_shares, lit, unoccluded, half_hit_shares }))
    }

    /// Returns the two pictures of half the width and height, for soft light. Returns `None` if the caster
    /// has no such half pictures, or if `sampling` does not use them.
    fn half_light(&self, sampling: &Sampling) -> Option<&HalfLight> {
        self.half_light.as_deref().filter(|_| sampling.half_light > 0)
    }

    /// Casts the samples in at most two rounds: the first samples of every pixel, then the later samples of rough
    /// blocks (blocks in which neighbouring pixels differ visibly after the first samples). There is no second round if
    /// `sampling` is not adaptive, or if no block is rough. Does not cast soft light at half resolution. Returns the
    /// total times, which include the time for finding rough blocks.
    fn cast_rounds(&self, camera: &Camera, sampling: &Sampling) -> Result<FrameTimes, LaunchError> {
        let [first, rest] = sampling.rounds();
        let Some(samples) = &self.samples else { return self.cast_round(camera, &first, None) };
        // An earlier picture may have limited some blocks of pixels to fewer samples.
        samples.want_all(&self.queue)?;
        let times = self.cast_round(camera, &first, None)?;
        if !sampling.is_adaptive() {
            return Ok(times);
        }
        let (rough, marked) = samples.mark(&self.queue, sampling)?;
        let times = times.and(&marked);
        if rough == 0 { Ok(times) } else { Ok(times.and(&self.cast_round(camera, &rest, Some(rough))?)) }
    }

    /// Casts the given samples of every pixel or, if `rough` is not `None`, only of the pixels in rough blocks (blocks
    /// in which neighbouring pixels differ visibly). `rough` is then the number of these blocks. One frame may cast
    /// several samples, if the strategy supports this for the scene.
    pub(super) fn cast_round(
        &self,
        camera: &Camera,
        samples: &[Sample],
        rough: Option<usize>,
    ) -> Result<FrameTimes, LaunchError> {
        let cast = |times: FrameTimes, samples: &[Sample]| {
            Ok(times.and(&self.cast_together(camera, samples, rough)?))
        };
        frames(samples, self.most_bits).try_fold(FrameTimes::default(), cast)
    }

    /// Returns the device's buffer that contains the image.
    pub(super) fn image(&self) -> &Buffer<Float4> {
        &self.image
    }

    /// Returns how many samples the pixels of each block got at most; `None` if each pixel gets one sample.
    pub fn sample_counts(&self) -> Result<Option<SampleCounts>, LaunchError> {
        let read = self.samples.as_ref().map(|samples| samples.read(&self.queue));
        Ok(read.transpose()?)
    }

    /// Casts one frame with one sample of every pixel that needs more samples. Adds these samples to the mean
    /// in the image.
    pub fn cast_sample(&self, camera: &Camera, sample: &Sample) -> Result<FrameTimes, LaunchError> {
        self.cast_together(camera, slice::from_ref(sample), None)
    }

    /// Casts one frame with consecutive samples, and adds the samples to the mean in the image. All samples belong to
    /// one round (the first samples of every pixel, or the later samples of rough blocks). `rough` is the number of
    /// rough blocks if only these blocks get the samples, and `None` otherwise. Casts nothing if `samples` is empty.
    fn cast_together(
        &self,
        camera: &Camera,
        samples: &[Sample],
        rough: Option<usize>,
    ) -> Result<FrameTimes, LaunchError> {
        let Some(first) = samples.first() else { return Ok(FrameTimes::default()) };
        // If a frame casts several samples, the kernel shifts their rays within the pixel. If a frame casts a single
        // sample, the camera is shifted instead of the rays.
        let offset = if samples.len() > 1 { [0.0; 2] } else { first.offset };
        self.look_from(&camera.of_sample(&Sample { offset, ..*first }))?;
        let arguments = sample_argument(Arguments::default(), first);
        let (arguments, bits) = subpixel_arguments(arguments, samples);
        if let Some(numbers) = self.samples.as_ref().filter(|_| self.most_bits > 0) {
            numbers.set_positions(&self.queue, samples)?;
        }
        // The frame casts only the rays of tiles in rough blocks if three conditions hold: only rough blocks get
        // samples, each block consists of whole tiles, and the frame can leave out tiles (`self.tile`).
        let tiles =
            rough.zip(self.tile).and_then(|(blocks, tile)| Some(blocks * tiles_of_block(tile, bits)?));
        let listed = if tiles.is_some() { rough.unwrap_or(0) } else { 0 };
        let arguments = arguments.with("rough_count", listed as u32);
        self.kernels().try_for_each(|kernel| arguments.rebind(kernel))?;
        self.cast_extent(1, Extent { bits, tiles })
    }

    /// Returns the kernels of a frame in the order in which they run. A kernel that the frame starts several times,
    /// such as once for each round of lights, is returned each time, with the arguments of this start.
    pub fn kernels(&self) -> impl Iterator<Item = &Kernel> {
        self.steps.iter().filter_map(|(_, step)| step.kernel())
    }

    /// Returns the kernels of a frame in the order in which they first run, each once.
    pub fn distinct_kernels(&self) -> impl Iterator<Item = &Kernel> {
        let mut names = HashSet::new();
        self.kernels().filter(move |kernel| kernel.name().ok().is_none_or(|name| names.insert(name)))
    }
}

/// Returns the commands of a frame. The commands prepare planes and clear buffers if the strategy needs this, cast the
/// frame's rays, and shade the hits. If the sky is a picture that rays can see, the last command shows this picture
/// where rays hit nothing.
fn steps(parts: &Parts<'_>, image: &Buffer<Float4>) -> Result<Steps, LaunchError> {
    let Setup { queue, strategy, workload, .. } = parts.setup;
    let mut steps = match strategy.passes {
        _ if strategy.shares_tiles() => {
            let rays = workload.nearest_count(strategy);
            let nearest = allocate::<i32>(queue, rays)?;
            let shared = Shared::allocate(queue, rays)?;
            SharedFrame::new(parts, image, &nearest, &shared).cast()?
        }
        Passes::Fused => parts.cast_fused(image)?,
        Passes::Separate => {
            let nearest = allocate::<i32>(queue, workload.nearest_count(strategy))?;
            parts.cast_separate(image, &nearest)?
        }
    };
    steps.extend(parts.show_sky(image, steps.last().map_or(Pass::Whole, |(pass, _)| *pass))?);
    Ok(steps)
}

fn working(queue: &Queue, strategy: &Strategy, workload: &Workload) -> ocl::Result<Working> {
    // The workload `own` leaves out the two half pictures for soft light, since their working vectors have
    // buffers of their own.
    let own = Workload { half_light: false, ..*workload };
    let bytes = Requirements::working_bytes(strategy, &own) as usize;
    Ok(match strategy.vectors.memory() {
        WorkingMemory::Private | WorkingMemory::Local => Working::None,
        WorkingMemory::Scratch => Working::Scratch(allocate(queue, bytes / 4)?),
        WorkingMemory::Heap => {
            // `Requirements::check` refuses a heap with more values than a `u32` can count.
            let size = (bytes / 4 / strategy.width.rays()) as u32;
            Working::Heap { pool: allocate(queue, bytes / 4)?, top: allocate(queue, 1)?, size }
        }
    })
}

/// Allocates memory for the planes of every triangle. Each plane contains one edge of the triangle, and the
/// eye or a light. If the strategy casts shadow rays to a few lights at a time, each triangle has planes only
/// for the eye and for these few lights. Returns `None` if the strategy's ray-triangle test uses no planes.
fn prepared_planes(
    queue: &Queue,
    strategy: &Strategy,
    workload: &Workload,
) -> ocl::Result<Option<Buffer<f32>>> {
    let rows = workload.prepared_origins(strategy) * workload.triangles;
    strategy.intersector.prepares_planes().then(|| allocate(queue, ROW_FLOATS * rows)).transpose()
}
