//! Applies the display transform (exposure, tone curve, gamma and conversion to 8 bits) on devices with separate
//! memory, so that three bytes per pixel are transferred instead of sixteen.

use super::buffers::{allocate, upload};
use super::{LaunchError, Queue, Refused};
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::image::Shown;
use crate::program::{BuildError, BuiltProgram, ProgramCache, ProgramSpec, Sources};
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};
use std::ops::Range;

/// The source file of the kernel that applies the display transform.
const FILE: &str = "display/show.cl";
/// The name of the kernel that applies the display transform.
const KERNEL: &str = "show_pixels";
/// Number of pixels that a work-item displays. The 12 bytes of four displayed pixels fill three words.
const ITEM_PIXELS: usize = 4;
/// Bytes of a displayed pixel: red, green and blue.
const BYTES: usize = 3;

/// The program of the display transform.
#[derive(Debug)]
pub struct ShowProgram {
    built: BuiltProgram,
    /// The paths of the program's kernel files that the user added or changed.
    own_files: Vec<String>,
}

/// A caster's image, and its size in pixels.
pub(super) type Image<'a> = (&'a Buffer<Float4>, [u32; 2]);

impl ShowProgram {
    /// Returns the source to be compiled for an open device.
    pub fn spec(sources: &Sources, queue: &Queue) -> Result<ProgramSpec> {
        let options = format!(
            "-D SHOWN_VALUES={} -D INDEX_SHIFT={} -D ITEM_PIXELS={ITEM_PIXELS} -D GROUP={} -cl-std=CL1.2",
            Shown::VALUES,
            Shown::INDEX_SHIFT,
            queue.group
        );
        let (source, files) = sources.read_joined(FILE)?;
        Ok(ProgramSpec { source, options, files })
    }

    /// Builds the program for an open device, or takes the program from the cache.
    pub fn build(
        queue: &Queue,
        spec: &ProgramSpec,
        programs: &ProgramCache,
        sources: &Sources,
    ) -> std::result::Result<Self, BuildError> {
        let built = BuiltProgram::build(&queue.context, queue.device, spec, programs);
        let built = built.map_err(|error| error.located(sources, spec))?;
        Ok(Self { built, own_files: sources.changed_paths(&spec.files) })
    }

    /// Builds the program like [`build`](Self::build). Returns `None` if the program contains none of the user's files
    /// and cannot be built; the host then applies the display transform.
    ///
    /// # Errors
    ///
    /// Fails if the program contains one of the user's files and cannot be built.
    pub fn usable(
        queue: &Queue,
        spec: &ProgramSpec,
        programs: &ProgramCache,
        (sources, device): (&Sources, &DeviceInfo),
    ) -> Result<Option<Self>> {
        match Self::build(queue, spec, programs, sources) {
            Ok(program) => Ok(Some(program)),
            Err(error) if error.has_own_file => Err(Refused::Build(error).into_error(device)),
            Err(_) => Ok(None),
        }
    }

    /// Returns how long the build took, in milliseconds.
    pub fn build_ms(&self) -> f64 {
        self.built.build_ms
    }

    /// Applies the display transform to an image's rows. `take` receives the rows from top to bottom, as red, green and
    /// blue bytes. Each call except the last receives a multiple of `together` rows. Returns the number of pixels that
    /// hit something, or `None` if a pixel is not finite, since it cannot be displayed.
    pub(super) fn read(
        &self,
        queue: &Queue,
        (image, [width, height]): Image<'_>,
        shown: &Shown,
        together: usize,
        mut take: impl FnMut(&[u8]),
    ) -> std::result::Result<Option<usize>, LaunchError> {
        let (width, height) = (width as usize, height as usize);
        let pins = queue.pins(BYTES * width * height);
        let piece_rows = if pins { queue.staging.rows(BYTES * width, together).min(height) } else { height };
        // Kernels and transfers alternate in one queue, so a single buffer is enough.
        let items = (piece_rows * width).div_ceil(ITEM_PIXELS);
        let rows = allocate::<u8>(queue, BYTES * ITEM_PIXELS * items)?;
        let (smallest, at_least) = shown.tables();
        let (smallest, at_least) = (upload(queue, smallest)?, upload(queue, at_least)?);
        let counts = allocate::<u32>(queue, 2)?;
        counts.write(&[0, 0][..]).enq()?;
        let kernel = self.kernel(queue, items, image, (&smallest, &at_least), &rows, &counts)?;
        let show = |piece: Range<usize>| -> ocl::Result<(Buffer<u8>, usize)> {
            kernel.set_arg("first", (piece.start * width) as u64)?;
            kernel.set_arg("count", (piece.len() * width) as u32)?;
            // SAFETY: `rows` has room for the pixels of every piece, and the image contains the piece's
            // pixels.
            unsafe { kernel.enq()? };
            Ok((rows.clone(), 0))
        };
        if pins {
            let rows = (0..height, BYTES * width, together);
            queue.staging.read(&queue.commands, rows, show, |_, piece| take(piece))?;
        } else {
            let mut copy = vec![0; BYTES * width * height];
            show(0..height)?.0.read(&mut copy[..]).enq()?;
            take(&copy);
        }
        let mut counted = [0_u32; 2];
        counts.read(&mut counted[..]).enq()?;
        Ok((counted[1] == 0).then_some(counted[0] as usize))
    }

    /// Builds the kernel for pieces of at most `items` work-items. The kernel reads pixels of `image` and the
    /// two tables that [`Shown::tables`] returns, and writes the displayed pixels to `rows`. The kernel adds
    /// two numbers to `counts`: how many pixels hit something, and how many are not finite.
    fn kernel(
        &self,
        queue: &Queue,
        items: usize,
        image: &Buffer<Float4>,
        (smallest, at_least): (&Buffer<f32>, &Buffer<u8>),
        rows: &Buffer<u8>,
        counts: &Buffer<u32>,
    ) -> std::result::Result<Kernel, LaunchError> {
        Kernel::builder()
            .program(&self.built.program)
            .name(KERNEL)
            .queue(queue.commands.clone())
            .global_work_size(items.next_multiple_of(queue.group))
            .local_work_size(queue.group)
            .arg(image)
            .arg_named("first", 0_u64)
            .arg_named("count", 0_u32)
            .arg(smallest)
            .arg(at_least)
            .arg(rows)
            .arg(counts)
            .build()
            .map_err(|error| LaunchError::of_kernel(KERNEL, &self.own_files, error))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::scene::Display;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// The size of the images. The number of pixels is not a multiple of the pixels per work-item, and the height is
    /// not a multiple of the rows that are transferred together.
    const SIZE: [u32; 2] = [37, 101];

    /// Returns a queue that treats a CPU as a device with separate memory, and transfers images in small pieces.
    fn queue() -> Queue {
        queue_of(2000)
    }

    fn queue_of(piece_bytes: usize) -> Queue {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        Queue::open(&device).unwrap().with_separate_memory(piece_bytes)
    }

    fn display(exposure: f32, gamma: f32) -> Display {
        Display { exposure, gamma, ..Display::default() }
    }

    /// Returns the displayed bytes, and the number of pixels that hit something; `None` if a pixel is not
    /// finite.
    fn show(
        queue: &Queue,
        spec: &ProgramSpec,
        pixels: &[Float4],
        display: Display,
    ) -> (Vec<u8>, Option<usize>) {
        let program = ShowProgram::build(queue, spec, &ProgramCache::default(), &Sources::Embedded).unwrap();
        let image = upload(queue, pixels).unwrap();
        let mut bytes = Vec::new();
        let take = |rows: &[u8]| bytes.extend_from_slice(rows);
        let hits = program.read(queue, (&image, SIZE), &Shown::of(display), 8, take).unwrap();
        (bytes, hits)
    }

    /// Returns pixels with radiances of many magnitudes, and with special values. The fourth channel is the
    /// share of a pixel's samples that hit something: no sample, half of the samples, or all.
    fn radiances() -> Vec<Float4> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let steps = Shown::of(Display::default());
        let ends = [0.0, -0.0, -1.0, 1.0, 1.5, f32::MAX, f32::MIN_POSITIVE, 1.0 / 15.0];
        let mut radiance = |index: usize| match index % 4 {
            0 => ends[index / 4 % ends.len()],
            1 => rng.random_range(-0.1..1.2),
            2 => steps.tables().0[index % (Shown::VALUES - 1)],
            _ => rng.random_range(-30.0_f32..10.0).exp2(),
        };
        let mut pixel = |index: usize| {
            Float4::new(radiance(index), radiance(index + 1), radiance(index / 3), (index % 3) as f32 / 2.0)
        };
        (0..SIZE[0] as usize * SIZE[1] as usize).map(&mut pixel).collect()
    }

    #[test]
    fn every_byte_is_the_hosts() {
        let pixels = radiances();
        // Of the three queues, the first transfers the image in pieces, and the second transfers the whole
        // image at once. The third of the three queues treats its device as if the device allowed only small
        // work-groups.
        let queues = [queue(), queue_of(1 << 20), queue().in_groups_of(8)];
        let displays = [Display::default(), display(1.0, 1.0), display(0.0, 2.2), display(1e6, 5.0)];
        for (display, queue) in
            displays.into_iter().flat_map(|display| queues.iter().map(move |q| (display, q)))
        {
            let spec = ShowProgram::spec(&Sources::Embedded, queue).unwrap();
            let (bytes, hits) = show(queue, &spec, &pixels, display);
            let shown = Shown::of(display);
            let expected: Vec<u8> =
                pixels.iter().flat_map(|pixel| shown.pixel([pixel[0], pixel[1], pixel[2]])).collect();
            assert!(bytes == expected, "{display:?}: other bytes");
            assert_eq!(hits, Some(pixels.iter().filter(|pixel| pixel[3] > 0.0).count()));
        }
    }

    #[test]
    fn what_is_not_finite_is_not_shown() {
        let queue = queue();
        let spec = ShowProgram::spec(&Sources::Embedded, &queue).unwrap();
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for channel in 0..3 {
                let mut pixels = radiances();
                let last = pixels.len() - 1;
                pixels[last][channel] = wrong;
                assert_eq!(show(&queue, &spec, &pixels, Display::default()).1, None, "{wrong}");
            }
        }
    }

    #[test]
    fn a_kernel_that_the_users_file_lacks_is_the_users_mistake() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("display")).unwrap();
        let file = folder.path().join(FILE);
        let text = Sources::Embedded.read(FILE).unwrap();
        assert_eq!(text.matches(KERNEL).count(), 1);
        std::fs::write(&file, text.replace(KERNEL, "show_all")).unwrap();
        let (queue, sources) = (queue(), Sources::Folder(folder.path().to_owned()));
        let spec = ShowProgram::spec(&sources, &queue).unwrap();
        let program = ShowProgram::build(&queue, &spec, &ProgramCache::default(), &sources).unwrap();
        let image = upload(&queue, &radiances()).unwrap();
        let shown = program.read(&queue, (&image, SIZE), &Shown::of(Display::default()), 8, |_| {});
        let error = shown.unwrap_err();
        assert!(matches!(error, LaunchError::OwnKernel(_)), "{error:?}");
        let expected = format!("{} defines no kernel `{KERNEL}`, which raycl needs", file.display());
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn a_kernel_that_shows_otherwise_is_noticed() {
        let queue = queue();
        let right = ShowProgram::spec(&Sources::Embedded, &queue).unwrap();
        let pixels = radiances();
        let expected = show(&queue, &right, &pixels, Display::default());
        for (from, to) in [
            ("smallest[value] <= radiance", "smallest[value] < radiance"),
            ("bytes[3 * i + 1] = shown(pixel.y", "bytes[3 * i + 1] = shown(pixel.x"),
            ("own_hits += pixel.w > 0.0f", "own_hits += pixel.w >= 0.0f"),
            ("own_hits += pixel.w > 0.0f", "own_hits += pixel.w >= 1.0f"),
            ("image[first + begin + i]", "image[begin + i]"),
            ("if (hits) atomic_add", "if (!hits) atomic_add"),
        ] {
            assert_eq!(right.source.matches(from).count(), 1, "{from}");
            let wrong = ProgramSpec { source: right.source.replace(from, to), ..right.clone() };
            assert!(
                show(&queue, &wrong, &pixels, Display::default()) != expected,
                "{from}: nothing notices {to}"
            );
        }
    }
}
