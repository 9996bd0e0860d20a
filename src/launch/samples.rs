//! Decides how many samples each block of pixels gets, for pictures with several samples per pixel. Buffers
//! on the device contain the blocks' numbers of samples, and a kernel marks rough blocks. Rough blocks get
//! more samples, because neighbouring pixels of a rough block differ visibly after the first samples.

use super::arguments::Arguments;
use super::buffers::allocate;
use super::frame::{FrameTimes, Pass};
use super::parts::Parts;
use super::steps::{Extent, Step};
use super::subpixels::{positions, subpixel_arguments};
use super::{LaunchError, Queue};
use crate::clock::ms_since;
use crate::manifest::Role;
use crate::scene::{Display, Sample, SampleCounts, Sampling, Tone};
use crate::strategy::Workload;
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};
use std::time::Instant;

/// The buffers on the device for several samples per pixel, and the kernel that marks rough blocks (which get
/// more samples).
pub(super) struct Samples {
    /// For each block of pixels, how many samples each pixel of the block gets at most.
    wanted: Buffer<u32>,
    /// The positions of the rough blocks (blocks in which neighbouring pixels differ visibly after the first samples).
    /// Only rough blocks get further samples after the first samples of every pixel.
    rough: Buffer<u32>,
    /// The number of rough blocks.
    rough_counter: Buffer<u32>,
    /// The position of each sample of a frame within its pixel.
    positions: Buffer<f32>,
    /// For each pixel, the number of its samples that hit something; `None` if the scene has no picture of
    /// the sky.
    hits_before: Option<Buffer<u32>>,
    size: [u32; 2],
    mark: Option<Step>,
}

impl Samples {
    /// Allocates the buffers; `None` if every pixel gets one sample.
    pub fn allocate(queue: &Queue, workload: &Workload) -> ocl::Result<Option<Self>> {
        if !workload.many_samples {
            return Ok(None);
        }
        let blocks = workload.sampled_blocks().iter().product::<u32>() as usize;
        let pixels = workload.pixels() as usize;
        let hits_before = (workload.sky_texels > 0).then(|| allocate(queue, pixels)).transpose()?;
        let positions = allocate(queue, positions(&[]).len())?;
        let [wanted, rough] = [allocate(queue, blocks)?, allocate(queue, blocks)?];
        let rough_counter = allocate(queue, 1)?;
        let size = workload.image_size;
        let samples = Self { wanted, rough, rough_counter, positions, hits_before, size, mark: None };
        samples.set_positions(queue, &[])?;
        samples.want_all(queue)?;
        Ok(Some(samples))
    }

    /// Adds the buffers to a frame's arguments.
    pub fn add_to<'a>(&'a self, arguments: Arguments<'a>) -> Arguments<'a> {
        let arguments = arguments.with("wanted", &self.wanted).with("positions", &self.positions);
        let arguments = arguments.with("earlier", 0_u32);
        let arguments = arguments.with("rough", &self.rough).with("rough_count", 0_u32);
        let arguments = arguments.with("rough_counter", &self.rough_counter);
        let (arguments, _) = subpixel_arguments(arguments, &[]);
        arguments.with_any("hits_before", self.hits_before.as_ref())
    }

    /// Makes the kernel that marks rough blocks of an image.
    pub fn mark_kernel(&self, parts: &Parts<'_>, image: &Buffer<Float4>) -> Result<Kernel, LaunchError> {
        let setup = &parts.setup;
        let arguments = parts.arguments.clone().with("means", image);
        let alpha_scale = if setup.scene.transparent { 255.0_f32 } else { 0.0 };
        let arguments = display_arguments(arguments, setup.scene.display);
        let arguments = arguments.with("alpha_scale", alpha_scale);
        let arguments = arguments.with("first", 0_u32).with("most", 0_u32);
        setup.row_kernel(setup.kernel_for(Role::Mark)?, &arguments, [self.wanted.len(), 1])
    }

    /// Sets the kernel that marks rough blocks.
    #[must_use]
    pub fn marked_by(self, kernel: Kernel) -> Self {
        Self { mark: Some(Step::Run(kernel)), ..self }
    }

    /// Changes the exposure and the tone curve with which pixels are compared to find rough blocks.
    pub fn show(&self, display: Display) -> Result<(), LaunchError> {
        let kernel = self.mark.as_ref().and_then(Step::kernel);
        kernel.map_or(Ok(()), |kernel| display_arguments(Arguments::default(), display).rebind(kernel))
    }

    /// Sets the positions of the next frame's samples within their pixels.
    pub fn set_positions(&self, queue: &Queue, samples: &[Sample]) -> ocl::Result<()> {
        self.positions.cmd().queue(&queue.commands).write(&positions(samples)).enq()
    }

    /// Lets every pixel get all samples that are cast, even if its block is not rough.
    pub fn want_all(&self, queue: &Queue) -> ocl::Result<()> {
        self.wanted.cmd().queue(&queue.commands).fill(u32::MAX, None).enq()
    }

    /// Lets only rough blocks get further samples after the first ones. Returns the number of rough blocks, and the
    /// time for finding them.
    pub fn mark(&self, queue: &Queue, sampling: &Sampling) -> Result<(usize, FrameTimes), LaunchError> {
        let Some(step) = &self.mark else { return Ok(Default::default()) };
        let start = Instant::now();
        let arguments = Arguments::default().with("first", sampling.first).with("most", sampling.most);
        step.kernel().map_or(Ok(()), |kernel| arguments.rebind(kernel))?;
        self.rough_counter.cmd().queue(&queue.commands).fill(0, None).enq()?;
        let marked = step.enqueue(queue, Extent::default())?;
        let mut count = [0];
        self.rough_counter.cmd().queue(&queue.commands).read(&mut count[..]).enq()?;
        let times = FrameTimes::of(&[(Pass::Whole, marked)], ms_since(start), 1)?;
        Ok((count[0] as usize, times))
    }

    /// Reads from the device how many samples the pixels of each block get at most. The number is `u32::MAX` if rough
    /// blocks were not marked.
    pub fn read(&self, queue: &Queue) -> ocl::Result<SampleCounts> {
        let mut counts = vec![0; self.wanted.len()];
        self.wanted.cmd().queue(&queue.commands).read(&mut counts).enq()?;
        Ok(SampleCounts::new(self.size, counts))
    }
}

/// Adds the exposure and the tone curve, with which rough blocks are found, to the arguments.
fn display_arguments(arguments: Arguments<'_>, display: Display) -> Arguments<'_> {
    arguments.with("exposure", display.exposure).with("tone", coefficients(display.tone))
}

/// Returns the coefficients of a tone curve as the kernel reads them.
fn coefficients(tone: Tone) -> Float4 {
    Float4::from(tone.coefficients().map(|coefficient| coefficient as f32))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::coefficients;
    use crate::device::discover;
    use crate::image::Radiance;
    use crate::launch::alone::Alone;
    use crate::launch::buffers::{allocate, upload};
    use crate::launch::{Caster, Session};
    use crate::manifest::{ROUGH_STEPS, SAMPLED_BLOCK};
    use crate::program::Sources;
    use crate::reference::rough::{rough_steps, steps_of_blocks};
    use crate::scene::{Display, SampleCounts, Sampling, Scene, Tone, load_scene};
    use crate::strategy::preset;
    use ocl::Buffer;
    use ocl::prm::{Float4, Int2};
    use std::path::Path;
    use std::sync::Arc;

    /// The pictures' width and height, which are not multiples of the side of a block of pixels.
    const SIZE: [u32; 2] = [75, 61];

    fn cast(sampling: Sampling) -> (Radiance, SampleCounts, Display) {
        cast_in_turn(sampling, &[sampling])
    }

    /// Casts one picture for each sampling, all with the same caster. Returns the last picture, the numbers
    /// of samples of its blocks, and how the scene is displayed.
    fn cast_in_turn(prepared_for: Sampling, samplings: &[Sampling]) -> (Radiance, SampleCounts, Display) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/still-life.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let caster = caster_of(&scene, SIZE, prepared_for);
        for sampling in samplings {
            caster.cast_samples(&scene.camera, sampling).unwrap();
        }
        (caster.read().unwrap().0, caster.sample_counts().unwrap().unwrap(), scene.display)
    }

    fn caster_of(scene: &Arc<Scene>, size: [u32; 2], prepared_for: Sampling) -> Caster {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let session = Session::open(&device, &Sources::Embedded, Arc::clone(scene)).unwrap();
        let strategy = preset("bvh").unwrap().strategy;
        let prepared = session.with_sampling(prepared_for).prepare(&strategy, size, [1, 1]);
        let caster = prepared.map_err(|refused| refused.reason()).unwrap().caster();
        caster.map_err(|refused| refused.reason()).unwrap()
    }

    /// Casts one picture for each sampling, all with the same caster. `text` is the text of the scene's file.
    fn pictures<const N: usize>(text: &str, size: [u32; 2], samplings: [Sampling; N]) -> [Radiance; N] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let caster = caster_of(&scene, size, samplings[0]);
        samplings.map(|sampling| {
            caster.cast_samples(&scene.camera, &sampling).unwrap();
            caster.read().unwrap().0
        })
    }

    /// A plate between a large light and the ground. The penumbra of the plate's edge is more than half as wide as the
    /// picture.
    const PENUMBRA: &str = "background = [0, 0, 0]
        camera = { position = [0.5, 1.4, 0], look_at = [0.5, 0, 0], up = [0, 0, -1], fov_x_degrees = 90 }
        [[light]]
        position = [0, 4, 0]
        power = 600
        radius = 1.2
        [[object]]
        vertices = [[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]]
        faces = [[0, 3, 2, 1]]
        material = { k_l = 1 }
        [[object]]
        vertices = [[-9, 1.5, -9], [0, 1.5, -9], [0, 1.5, 9], [-9, 1.5, 9]]
        faces = [[0, 3, 2, 1]]
        material = { k_l = 1 }
        ";

    /// If the first sample saw the centre of the light, the shadow would have a sharp edge, and only the blocks along
    /// this edge would get more samples.
    #[test]
    fn a_penumbra_is_soft_although_pixels_first_get_one_sample() {
        let samplings = [Sampling::adaptive(16), Sampling::adaptive(2), Sampling::all(256)];
        // The mean of each strip of four columns.
        let [sixteen, two, all] = pictures(PENUMBRA, [96, 24], samplings).map(|picture| {
            let mean = |strip: usize| {
                let rows = picture.pixels.chunks(96).map(|row| &row[4 * strip..4 * strip + 4]);
                rows.flatten().map(|pixel| pixel[0]).sum::<f32>() / 96.0
            };
            (0..24).map(mean).collect::<Vec<_>>()
        });
        for (strip, expected) in all.iter().enumerate() {
            for actual in [sixteen[strip], two[strip]] {
                assert!((actual - expected).abs() < 0.15, "strip {strip}: {actual} {expected}");
            }
        }
    }

    /// A ball on the ground, under a sky.
    const BALL: &str = "background = \"white\"
        camera = { position = [0, 1.5, 3], look_at = [0, 0.3, 0] }
        sky.zenith = 0.06
        [[object]]
        vertices = [[-50, 0, -50], [50, 0, -50], [50, 0, 50], [-50, 0, 50]]
        faces = [[0, 3, 2, 1]]
        [[object]]
        shape = \"sphere\"
        triangles = 2000
        translation = [0, 1, 0]
        ";

    /// A pixel that may get 64 samples first gets four of them, and a pixel that may get 32 samples first
    /// gets two. With four samples, neighbouring pixels differ less by chance than with two. If the limit for
    /// rough blocks were the same for two and four samples, most of the picture would get no further samples
    /// after the first four.
    #[test]
    fn more_adaptive_samples_make_no_worse_picture() {
        let samplings = [Sampling::adaptive(32), Sampling::adaptive(64), Sampling::all(256)];
        let [few, many, all] = pictures(BALL, [48, 30], samplings);
        let [few, many] = [few, many].map(|picture| {
            let pairs = picture.pixels.iter().zip(&all.pixels);
            pairs.map(|(pixel, expected)| (pixel[0] - expected[0]).powi(2)).sum::<f32>()
        });
        assert!(many <= few, "the sums of squared errors are {few} and {many}");
    }

    #[test]
    fn the_blocks_that_get_more_samples_are_those_where_the_first_ones_differ() {
        let adaptive = Sampling { first: 2, ..Sampling::all(8) };
        let (means, _, display) = cast(Sampling::all(2));
        let counts = cast(adaptive).1;
        let steps = steps_of_blocks(&means, display);
        let blocks = (0..61_u32).step_by(4).flat_map(|y| (0..75_u32).step_by(4).map(move |x| [x, y]));
        let limit = rough_steps(adaptive.first);
        for (block, steps) in blocks.zip(&steps).filter(|(_, steps)| (**steps - limit).abs() > 1e-2) {
            let expected = if *steps > limit { adaptive.most } else { adaptive.first };
            assert_eq!(counts.at(block), expected, "{block:?}: {steps}");
        }
        let rough = steps.iter().filter(|steps| **steps > limit).count();
        assert!((20..steps.len() - 20).contains(&rough), "{rough} of {}", steps.len());
        assert!(counts.are_of(&adaptive) && !counts.are_of(&Sampling::all(8)));
    }

    #[test]
    fn blocks_that_wanted_few_samples_get_all_of_the_next_picture() {
        let adaptive = Sampling { first: 2, ..Sampling::all(8) };
        for next in [Sampling::all(8), Sampling { first: 4, ..adaptive }] {
            let [alone, after] =
                [&[next][..], &[adaptive, next]].map(|samplings| cast_in_turn(adaptive, samplings));
            assert!(alone == after, "{next:?}: another picture");
        }
    }

    /// A picture of 13 x 9 pixels. The kernel that marks the picture's rough blocks runs alone, without the rest of a
    /// frame.
    struct Marking {
        device: Alone,
        /// The number of samples that each pixel gets before rough blocks are marked.
        first: u32,
        tone: Tone,
    }

    impl Marking {
        const SIDES: [usize; 2] = [13, 9];
        /// The exposure with which the picture is displayed.
        const EXPOSURE: f32 = 15.0;
        /// The number of samples that each pixel of a rough block gets.
        const MOST: u32 = 64;

        fn new() -> Self {
            let before = "#define MARK_ROUGH_PARAMETERS __global uint *wanted, const __global float4 *means, \
                          int2 image_size, float exposure, float4 tone, float alpha_scale, uint first, uint most, \
                          __global uint *rough, volatile __global uint *rough_counter";
            let options = format!("-D SAMPLED_BLOCK={SAMPLED_BLOCK} -D ROUGH_STEPS={ROUGH_STEPS}");
            let files = ["common/samples.cl", "common/mark_rough.cl"];
            Self { device: Alone::of([before, ""], &files, &options), first: 1, tone: Tone::Clip }
        }

        /// Returns the columns and rows of the blocks that get more samples in an opaque picture.
        fn rough(&self, pixel: impl Fn(usize, usize) -> [f32; 3]) -> Vec<[usize; 2]> {
            let opaque = |[red, green, blue]: [f32; 3]| [red, green, blue, 1.0];
            self.rough_with_alpha(0.0, |x, y| opaque(pixel(x, y)))
        }

        /// Returns the columns and rows of the blocks that get more samples. `pixel` returns colour and
        /// alpha. `alpha_scale` is 255 if differences of alpha make a block rough, and 0 if alpha is ignored.
        fn rough_with_alpha(
            &self,
            alpha_scale: f32,
            pixel: impl Fn(usize, usize) -> [f32; 4],
        ) -> Vec<[usize; 2]> {
            let [width, height] = Self::SIDES;
            let means: Vec<Float4> = (0..width * height)
                .map(|at| pixel(at % width, at / width))
                .map(|[red, green, blue, alpha]| Float4::new(red, green, blue, alpha))
                .collect();
            let means = upload(&self.device.queue, &means).unwrap();
            let across = width.div_ceil(SAMPLED_BLOCK as usize);
            let blocks = across * height.div_ceil(SAMPLED_BLOCK as usize);
            let size = Int2::new(width as i32, height as i32);
            let listed: Buffer<u32> = allocate(&self.device.queue, blocks).unwrap();
            let counter: Buffer<u32> = upload(&self.device.queue, &[0]).unwrap();
            let wanted: Vec<u32> = self.device.results(blocks, |wanted| {
                let mut kernel = self.device.kernel("mark_rough", blocks);
                kernel
                    .arg(wanted)
                    .arg(&means)
                    .arg(size)
                    .arg(Self::EXPOSURE)
                    .arg(coefficients(self.tone))
                    .arg(alpha_scale);
                kernel.arg(self.first).arg(Self::MOST).arg(&listed).arg(&counter).build()
            });
            assert!(wanted.iter().all(|wanted| [self.first, Self::MOST].contains(wanted)), "{wanted:?}");
            let rough = wanted.iter().enumerate().filter(|(_, wanted)| **wanted == Self::MOST);
            let rough: Vec<_> = rough.map(|(block, _)| [block % across, block / across]).collect();
            assert_eq!(Self::listed(&listed, &counter), rough);
            rough
        }

        /// Returns the columns and rows of the blocks in a list, row by row.
        fn listed(blocks: &Buffer<u32>, counter: &Buffer<u32>) -> Vec<[usize; 2]> {
            let [mut all, mut count] = [vec![0; blocks.len()], vec![0]];
            blocks.read(&mut all).enq().unwrap();
            counter.read(&mut count).enq().unwrap();
            let mut positions: Vec<_> =
                all[..count[0] as usize].iter().map(|block| [block & 0xffff, block >> 16]).collect();
            positions.sort_by_key(|[column, row]| [*row, *column]);
            positions.into_iter().map(|block| block.map(|number| number as usize)).collect()
        }
    }

    /// In each picture, one colour channel changes between two neighbouring columns, or between two
    /// neighbouring rows. A block is rough if it contains pixels of at least one of the two columns or rows
    /// between which the colour changes.
    #[test]
    fn an_edge_is_in_the_blocks_on_both_its_sides() {
        let marking = Marking::new();
        let side = SAMPLED_BLOCK as usize;
        for axis in 0..2 {
            for edge in 1..Marking::SIDES[axis] {
                for channel in 0..3 {
                    let rough = marking.rough(|x, y| {
                        let mut colour = [0.01; 3];
                        colour[channel] *= f32::from(u8::from([x, y][axis] >= edge));
                        colour
                    });
                    let blocks = |sides: usize| 0..Marking::SIDES[sides].div_ceil(side);
                    let touches =
                        |block: &[usize; 2]| (side * block[axis]..=side * block[axis] + side).contains(&edge);
                    let all = blocks(1).flat_map(|y| blocks(0).map(move |x| [x, y]));
                    assert_eq!(
                        rough,
                        all.filter(touches).collect::<Vec<_>>(),
                        "axis {axis}, edge {edge}, channel {channel}"
                    );
                }
            }
        }
    }

    /// To find rough blocks, the kernel compares displayed values. Values beyond white are therefore equal,
    /// and a gamma of 2 enlarges differences near black. The more samples a pixel has when the kernel
    /// compares values, the smaller is the difference that makes a block rough.
    #[test]
    fn a_block_is_rough_where_its_pixels_are_shown_more_than_some_steps_apart() {
        let mut marking = Marking::new();
        for (first, limit) in [(1, ROUGH_STEPS as f32), (4, ROUGH_STEPS as f32 / 2.0)] {
            marking.first = first;
            let steps = |a: f32, b: f32| {
                let radiance = |shown: f32| (shown / 255.0).powi(2) / Marking::EXPOSURE;
                let colours = [a, b].map(|shown| [radiance(shown); 3]);
                !marking.rough(|x, _| colours[usize::from(x == 6)]).is_empty()
            };
            for shown in [0.0, 100.0, 255.0 - limit - 0.1] {
                assert!(!steps(shown, shown + limit - 0.1) && steps(shown, shown + limit + 0.1), "{shown}");
                assert!(!steps(shown + limit - 0.1, shown) && steps(shown + limit + 0.1, shown), "{shown}");
            }
            assert!(!steps(255.0, 1000.0) && !steps(1000.0, 255.0 - limit + 0.1));
        }
    }

    /// Exposed radiances of 1.05 and 7 are both white with the usual curve. With the filmic curve, exposed
    /// radiances of 1.05 and 7 are displayed as 230 and 255.
    #[test]
    fn a_tone_curve_that_keeps_shades_makes_blocks_of_bright_pixels_rough() {
        let mut marking = Marking::new();
        marking.first = 16; // the limit is then a quarter of ROUGH_STEPS
        for (tone, rough) in [(Tone::Clip, false), (Tone::Filmic, true)] {
            marking.tone = tone;
            let colours = [1.05, 7.0].map(|exposed: f32| [exposed / Marking::EXPOSURE; 3]);
            let listed = marking.rough(|x, _| colours[usize::from(x == 6)]);
            assert_eq!(!listed.is_empty(), rough, "{tone:?}");
        }
    }

    /// With the filmic tone curve, too, a block gets more samples if its displayed pixels differ by more than the
    /// limit. The square of the brightest radiance is infinite in single precision.
    #[test]
    fn pixels_are_compared_as_their_tone_curve_shows_them() {
        let mut marking = Marking::new();
        marking.tone = Tone::Filmic;
        let is_rough = |colours: [f32; 2]| {
            !marking.rough(|x, _| [colours[usize::from(x == 6)] / Marking::EXPOSURE; 3]).is_empty()
        };
        let exposed = |shown: f64| Tone::Filmic.inverse((shown / 255.0).powi(2)) as f32;
        let limit = f64::from(ROUGH_STEPS);
        for shown in [0.0, 100.0, 254.0 - limit] {
            let apart = |steps: f64| is_rough([shown, shown + steps].map(exposed));
            assert!(!apart(limit - 0.1) && apart(limit + 0.1), "{shown}");
        }
        assert!(is_rough([0.0, 1e28]) && !is_rough([1e28, 1e28]));
    }

    /// A dark surface differs from a transparent background only in its alpha.
    #[test]
    fn before_a_transparent_background_a_block_is_rough_where_only_alpha_differs() {
        let marking = Marking::new();
        let rough = |alpha_scale: f32, alpha: f32| {
            let pixel = |x: usize, _: usize| [0.0, 0.0, 0.0, if x < 6 { alpha } else { 0.0 }];
            !marking.rough_with_alpha(alpha_scale, pixel).is_empty()
        };
        let limit = ROUGH_STEPS as f32 / 255.0;
        assert!(rough(255.0, 1.0) && rough(255.0, limit + 1e-3) && !rough(255.0, limit - 1e-3));
        assert!(!rough(0.0, 1.0), "the alpha of an opaque picture is not shown");
    }
}
