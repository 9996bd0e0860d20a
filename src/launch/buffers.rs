//! Makes buffers, transfers data to buffers, and reads buffers. OpenCL does not allow empty buffers, so every
//! buffer has at least one value. If the device shares the host's memory, rows of a buffer are written and
//! read in place; otherwise large transfers use pinned memory.

use super::Queue;
use crate::device::noted;
use ocl::{Buffer, MapFlags, MemFlags, MemMap, OclPrm};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Number of bytes that a thread of [`copy`] copies at a time.
const COPIED_TOGETHER: usize = 1 << 18;

/// Makes a read-only buffer that contains `values`.
pub fn upload<T: OclPrm>(queue: &Queue, values: &[T]) -> ocl::Result<Buffer<T>> {
    if queue.pins(size_of_val(values)) {
        return upload_rows(queue, [values.len(), 1], |range, piece| copy(&values[range], piece));
    }
    let placeholder = [T::default()];
    let values = if values.is_empty() { &placeholder[..] } else { values };
    Buffer::builder()
        .queue(queue.commands.clone())
        .flags(MemFlags::READ_ONLY)
        .len(values.len())
        .copy_host_slice(values)
        .build()
        .map_err(noted)
}

/// Makes a read-only buffer of `rows` rows with `row` values each. `fill` gets a range of rows, and the
/// memory into which it writes the values of these rows. If the device shares the host's memory, `fill`
/// writes into the buffer itself: a copy would take longer than computing the values. If the device has
/// separate memory, `fill` writes into the host's memory, from which the values are then transferred to the
/// buffer.
pub fn upload_rows<T: OclPrm>(
    queue: &Queue,
    [rows, row]: [usize; 2],
    fill: impl Fn(Range<usize>, &mut [T]),
) -> ocl::Result<Buffer<T>> {
    let len = rows * row;
    let pins = queue.pins(len * size_of::<T>());
    if len == 0 || !(queue.shares_memory || pins) {
        let mut values = vec![T::default(); len];
        fill(0..rows, &mut values);
        return upload(queue, &values);
    }
    let commands = queue.commands.clone();
    let buffer = Buffer::builder().queue(commands).flags(MemFlags::READ_ONLY).len(len);
    let buffer = buffer.build().map_err(noted)?;
    if pins {
        queue.staging.write(&queue.commands, &buffer, row, fill)?;
        return Ok(buffer);
    }
    let mut mapped = map(&buffer, MapFlags::new().write_invalidate_region())?;
    fill(0..rows, &mut mapped);
    mapped.unmap().enq().map_err(noted)?;
    Ok(buffer)
}

/// Makes a read-only buffer that contains the values of all `parts`, one part after another. Unlike [`upload`], this
/// function needs no single list of all values. To make such a list of a large picture would take memory that raycl
/// does not count when it predicts how much memory a run needs.
pub fn upload_joined<T: OclPrm>(queue: &Queue, parts: &[Cow<'_, [T]>]) -> ocl::Result<Buffer<T>> {
    let len = parts.iter().map(|part| part.len()).sum();
    upload_rows(queue, [len, 1], |range, values| copy_joined(parts, range.start, values))
}

/// Replaces the first values of a buffer by the values of all `parts`, one part after another. The buffer's values
/// after the last part stay the same.
pub fn write_joined<T: OclPrm>(queue: &Queue, buffer: &Buffer<T>, parts: &[Cow<'_, [T]>]) -> ocl::Result<()> {
    let mut at = 0;
    for part in parts.iter().filter(|part| !part.is_empty()) {
        buffer.write(&part[..]).offset(at).queue(&queue.commands).enq().map_err(noted)?;
        at += part.len();
    }
    Ok(())
}

/// Joins all `parts`, one part after another, and copies values to `to` until `to` is full. The first copied value is
/// the value number `start` of the joined parts.
fn copy_joined<T: OclPrm>(parts: &[Cow<'_, [T]>], mut start: usize, mut to: &mut [T]) {
    for part in parts {
        let from = &part[start.min(part.len())..];
        start -= part.len() - from.len();
        let (here, rest) = to.split_at_mut(from.len().min(to.len()));
        copy(&from[..here.len()], here);
        to = rest;
    }
}

/// Passes the rows `rows` of a buffer to `take`. Each row has `row` values. If there are no values, `take` is not
/// called. If the device shares the host's memory, `take` is called once and reads the rows in place. If the device has
/// separate memory, the function `take` gets copies of the buffer's rows. A large transfer is divided into pieces:
/// `take` processes one piece while the next piece is being transferred. Each piece except the last has a multiple of
/// `together` rows.
pub fn read_rows<T: OclPrm>(
    queue: &Queue,
    buffer: &Buffer<T>,
    (rows, row, together): (Range<usize>, usize, usize),
    mut take: impl FnMut(Range<usize>, &[T]),
) -> ocl::Result<()> {
    let values = rows.start * row..rows.end * row;
    if values.is_empty() {
        return Ok(());
    }
    if queue.shares_memory {
        let mut mapped = map(buffer, MapFlags::new().read())?;
        take(rows, &mapped[values]);
        return mapped.unmap().enq().map_err(noted);
    }
    if queue.pins(values.len() * size_of::<T>()) {
        let made = |rows: Range<usize>| Ok((buffer.clone(), rows.start * row));
        return queue.staging.read(&queue.commands, (rows, row, together), made, take);
    }
    let mut copy = vec![T::default(); values.len()];
    buffer.cmd().read(&mut copy[..]).offset(values.start).enq().map_err(noted)?;
    take(rows, &copy);
    Ok(())
}

/// Copies values on all cores.
pub fn copy<T: OclPrm>(from: &[T], to: &mut [T]) {
    let together = COPIED_TOGETHER / size_of::<T>();
    to.par_chunks_mut(together)
        .zip(from.par_chunks(together))
        .for_each(|(to, from)| to.copy_from_slice(from));
}

fn map<T: OclPrm>(buffer: &Buffer<T>, flags: MapFlags) -> ocl::Result<MemMap<T>> {
    // SAFETY: the queue is in order, and the call waits for earlier commands, so no command writes the buffer
    // while the buffer is mapped. The buffer is unmapped before anything else is enqueued.
    unsafe { buffer.map().flags(flags).enq() }.map_err(noted)
}

/// Makes a buffer of `len` values that kernels read and write.
pub fn allocate<T: OclPrm>(queue: &Queue, len: usize) -> ocl::Result<Buffer<T>> {
    let buffer = Buffer::builder().queue(queue.commands.clone()).flags(MemFlags::READ_WRITE).len(len.max(1));
    buffer.build().map_err(noted)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::program::Sources;

    /// Number of values in a row of the tests' buffers.
    const ROW: usize = 3;

    #[test]
    fn rows_are_read_from_their_place_in_the_buffer() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let open = || Queue::open(&device).unwrap();
        // The first queue reads the buffer without a copy. The second queue reads pieces of two rows of the
        // buffer, and the third queue reads all rows at once.
        let shared = Queue { shares_memory: true, ..open() };
        let separate = [2 * ROW * size_of::<u32>(), 1 << 20].map(|bytes| open().with_separate_memory(bytes));
        let values: Vec<u32> = (0..30).collect();
        let all_pieces = [vec![7], vec![2, 2, 2, 1], vec![7]];
        for (queue, expected) in [shared].into_iter().chain(separate).zip(all_pieces) {
            let buffer = upload(&queue, &values).unwrap();
            let (mut read, mut pieces) = (Vec::new(), Vec::new());
            let take = |rows: Range<usize>, part: &[u32]| {
                assert_eq!((part[0] as usize, part.len()), (rows.start * ROW, rows.len() * ROW));
                pieces.push(rows.len());
                read.extend_from_slice(part);
            };
            read_rows(&queue, &buffer, (2..9, ROW, 1), take).unwrap();
            assert_eq!(read, values[2 * ROW..9 * ROW]);
            assert_eq!(pieces, expected);
            // Three rows belong together here, so a piece has three rows, although the second queue's pieces usually
            // have two.
            let mut together = Vec::new();
            read_rows(&queue, &buffer, (2..9, ROW, 3), |rows, _: &[u32]| together.push(rows.len())).unwrap();
            assert_eq!(together, if expected == [7] { vec![7] } else { vec![3, 3, 1] });
        }
    }

    #[test]
    fn parts_are_uploaded_one_after_another_also_in_pieces() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let open = || Queue::open(&device).unwrap();
        let shared = Queue { shares_memory: true, ..open() };
        // The second queue writes pieces of two values, which begin and end within parts.
        let separate = [2 * size_of::<u32>(), 1 << 20].map(|bytes| open().with_separate_memory(bytes));
        let parts = [&[1_u32, 2, 3][..], &[], &[4, 5], &[6]].map(Cow::Borrowed);
        for queue in [shared].into_iter().chain(separate) {
            let buffer = upload_joined(&queue, &parts).unwrap();
            let values = || {
                let mut values = vec![0; buffer.len()];
                buffer.read(&mut values).enq().unwrap();
                values
            };
            assert_eq!(values(), [1, 2, 3, 4, 5, 6]);
            write_joined(&queue, &buffer, &[&[7_u32][..], &[], &[8, 9]].map(Cow::Borrowed)).unwrap();
            assert_eq!(values(), [7, 8, 9, 4, 5, 6]);
        }
    }

    #[test]
    fn a_buffer_without_rows_has_one_value() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let queue = Queue { shares_memory: true, ..Queue::open(&device).unwrap() };
        let buffer: Buffer<u32> = upload_rows(&queue, [0, ROW], |_, _| ()).unwrap();
        assert_eq!(buffer.len(), 1);
    }
}
