//! Pinned memory of the host, which a device with separate memory can access directly, without a copy by the driver.
//! The pinned memory consists of two pieces: one is filled or emptied while the other is transferred.

use crate::device::noted;
use crate::threads::locked;
use ocl::core::{enqueue_read_buffer, enqueue_write_buffer};
use ocl::{Buffer, Event, MapFlags, MemFlags, MemMap, OclPrm, Queue};
use std::ops::Range;
use std::sync::Mutex;

/// Size of a piece in bytes: large enough that the cost of starting a transfer is negligible, and that all cores have
/// work.
const PIECE_BYTES: usize = 16 << 20;

/// The pinned memory of a queue. Pinned memory is allocated at first use, since pinning takes longer than a short
/// transfer.
#[derive(Debug)]
pub(super) struct Staging {
    piece_bytes: usize,
    pieces: Mutex<Option<Pieces>>,
}

impl Default for Staging {
    fn default() -> Self {
        Self::of(PIECE_BYTES)
    }
}

impl Staging {
    /// Returns a `Staging` whose pieces have `piece_bytes` bytes. The pieces of pinned memory are allocated
    /// at first use.
    pub fn of(piece_bytes: usize) -> Self {
        Self { piece_bytes, pieces: Mutex::new(None) }
    }

    /// Returns true if a transfer of `bytes` bytes is so large that pinned memory saves time.
    pub fn pays(&self, bytes: usize) -> bool {
        bytes > 2 * self.piece_bytes
    }

    /// Returns the number of rows in a piece: the largest multiple of `together` that fits, but at least `together`.
    pub fn rows(&self, row_bytes: usize, together: usize) -> usize {
        let unit = (row_bytes * together).max(1);
        (self.piece_bytes / unit).max(1) * together
    }

    /// Writes the rows of a buffer, each with `row` values; `fill` computes the rows piece by piece.
    pub fn write<T: OclPrm>(
        &self,
        commands: &Queue,
        buffer: &Buffer<T>,
        row: usize,
        fill: impl Fn(Range<usize>, &mut [T]),
    ) -> ocl::Result<()> {
        let cut = Cut::new(0..buffer.len() / row, self.rows(row * size_of::<T>(), 1));
        self.with(commands, cut.most() * row * size_of::<T>(), |pieces| {
            let mut in_flight: [Option<Event>; 2] = [None, None];
            for number in 0..cut.count() {
                let (rows, half) = (cut.rows(number), number % 2);
                if let Some(event) = in_flight[half].take() {
                    event.wait_for().map_err(noted)?;
                }
                let values = pieces.values(half, rows.len() * row);
                fill(rows.clone(), values);
                let mut event = Event::empty();
                // SAFETY: the values stay in place until the event has completed, since this function or
                // `with` waits for the event.
                unsafe {
                    enqueue_write_buffer(
                        commands,
                        buffer.as_core(),
                        false,
                        rows.start * row,
                        values,
                        NO_EVENTS,
                        Some(&mut event),
                    )
                    .map_err(noted)?;
                }
                commands.flush().map_err(noted)?;
                in_flight[half] = Some(event);
            }
            Ok(())
        })
    }

    /// Reads rows of `row` values piece by piece. Each piece except the last has a multiple of `together`
    /// rows. `enqueue` is called with the range of a piece's rows. If a kernel must compute the rows of a
    /// piece before they can be read, `enqueue` enqueues this kernel. `enqueue` returns the buffer that will
    /// contain the rows, and the index of the rows' first value in this buffer. After a piece was read, the
    /// callback `take` is called with the range of the piece's rows and the values of these rows.
    pub fn read<T: OclPrm>(
        &self,
        commands: &Queue,
        (rows, row, together): (Range<usize>, usize, usize),
        mut enqueue: impl FnMut(Range<usize>) -> ocl::Result<(Buffer<T>, usize)>,
        mut take: impl FnMut(Range<usize>, &[T]),
    ) -> ocl::Result<()> {
        let cut = Cut::new(rows, self.rows(row * size_of::<T>(), together));
        self.with(commands, cut.most() * row * size_of::<T>(), |pieces| {
            let mut begin = |number: usize, pieces: &mut Pieces| -> ocl::Result<Event> {
                let rows = cut.rows(number);
                let (buffer, offset) = enqueue(rows.clone())?;
                let values: &mut [T] = pieces.values(number % 2, rows.len() * row);
                let mut event = Event::empty();
                // SAFETY: until the event has completed, nobody reads the values, and the values stay in place.
                unsafe {
                    enqueue_read_buffer(
                        commands,
                        buffer.as_core(),
                        false,
                        offset,
                        values,
                        NO_EVENTS,
                        Some(&mut event),
                    )
                    .map_err(noted)?;
                }
                commands.flush().map_err(noted)?;
                Ok(event)
            };
            let mut coming = (cut.count() > 0).then(|| begin(0, pieces)).transpose()?;
            for number in 0..cut.count() {
                let event = coming.take();
                // The next piece is transferred while the current piece is processed.
                if number + 1 < cut.count() {
                    coming = Some(begin(number + 1, pieces)?);
                }
                event.map_or(Ok(()), |event| event.wait_for().map_err(noted))?;
                let rows = cut.rows(number);
                take(rows.clone(), pieces.values(number % 2, rows.len() * row));
            }
            Ok(())
        })
    }

    /// Calls `work` with pieces of at least `bytes` bytes, and waits for all transfers at the end.
    fn with(
        &self,
        commands: &Queue,
        bytes: usize,
        work: impl FnOnce(&mut Pieces) -> ocl::Result<()>,
    ) -> ocl::Result<()> {
        // If a thread panicked while it held the lock, the memory can still be used.
        let mut stored = locked(&self.pieces);
        let pieces = match stored.take() {
            Some(pieces) if pieces.bytes() >= bytes => pieces,
            _ => Pieces::allocate(commands, bytes.max(self.piece_bytes))?,
        };
        let pieces = stored.insert(pieces);
        let done = work(pieces);
        done.and(commands.finish().map_err(noted))
    }
}

/// An empty list of events. Transfers need not wait for events, since the queue executes its commands in order.
const NO_EVENTS: Option<&Event> = None;

/// Rows divided into pieces of equal size; the last piece may be smaller.
struct Cut {
    rows: Range<usize>,
    piece: usize,
}

impl Cut {
    fn new(rows: Range<usize>, piece: usize) -> Self {
        Self { rows, piece }
    }

    fn count(&self) -> usize {
        self.rows.len().div_ceil(self.piece)
    }

    /// Returns the largest number of rows in a piece.
    fn most(&self) -> usize {
        self.piece.min(self.rows.len())
    }

    fn rows(&self, number: usize) -> Range<usize> {
        let start = self.rows.start + number * self.piece;
        start..(start + self.piece).min(self.rows.end)
    }
}

/// The two pieces of pinned memory.
#[derive(Debug)]
struct Pieces([MemMap<u8>; 2]);

impl Pieces {
    fn allocate(commands: &Queue, bytes: usize) -> ocl::Result<Self> {
        let piece = || -> ocl::Result<MemMap<u8>> {
            let flags = MemFlags::READ_WRITE | MemFlags::ALLOC_HOST_PTR;
            let buffer = Buffer::<u8>::builder().queue(commands.clone()).flags(flags).len(bytes).build()?;
            let flags = MapFlags::new().read().write();
            // SAFETY: the buffer is mapped once, and no command uses the buffer. The mapping keeps the buffer
            // alive.
            unsafe { buffer.map().flags(flags).enq() }
        };
        Ok(Self([piece()?, piece()?]))
    }

    fn bytes(&self) -> usize {
        self.0[0].len()
    }

    /// Returns the first `count` values of the first piece (`half` = 0) or of the second piece (`half` = 1).
    fn values<T: OclPrm>(&mut self, half: usize, count: usize) -> &mut [T] {
        let bytes = &mut self.0[half][..count * size_of::<T>()];
        // SAFETY: the slice `bytes` has room for `count` values. Mapped memory is aligned for every OpenCL type, and
        // every bit pattern is a valid value of these types.
        unsafe { std::slice::from_raw_parts_mut(bytes.as_mut_ptr().cast(), count) }
    }
}
