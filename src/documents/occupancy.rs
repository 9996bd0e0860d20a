//! Computes how many threads a GPU's multiprocessor holds at the same time.

use super::of_record::{Figure, Form};
use crate::device::occupancy::{Limiter, multiprocessor, occupancy};
use std::collections::HashMap;

/// Answers two kinds of query, which both contain the local size. "groups=8 threads=1536 8x8" asks how many threads fit
/// on a multiprocessor with room for 8 work-groups and 1536 threads. As in Figure 5 of the student paper that raycl
/// reproduces, a multiprocessor holds only whole work-groups. "capability=2.0 registers=63 bytes-per-item=108 8x8" asks
/// how many threads a multiprocessor of compute capability 2.0 holds if each thread uses 63 registers and 108 B of
/// `__local` memory, and which limit determines this number. If a work-group of this local size cannot run, the answer
/// to the second kind is "cannot launch". The error says what the query lacks, or that raycl does not support the
/// compute capability.
pub fn threads(words: &[&str]) -> Result<Figure, String> {
    let given: HashMap<&str, &str> = words.iter().filter_map(|word| word.split_once('=')).collect();
    let number = |key: &str| given.get(key).and_then(|text| text.parse::<u32>().ok());
    let sides = words.iter().find_map(|word| word.split_once('x'));
    let items =
        sides.and_then(|(across, down)| Some(across.parse::<u32>().ok()? * down.parse::<u32>().ok()?));
    let items = items.filter(|items| *items > 0).ok_or("expected a local size, such as 8x8")?;
    if let (Some(groups), Some(threads)) = (number("groups"), number("threads")) {
        return Ok(Figure::Number(f64::from(groups.min(threads / items) * items), Form::Count));
    }
    let sm = given.get("capability").ok_or("expected groups= and threads=, or capability= and registers=")?;
    let sm = multiprocessor(sm).map_err(|error| error.to_string())?;
    let bytes = u64::from(number("bytes-per-item").unwrap_or(0)) * u64::from(items);
    let held = occupancy(sm, number("registers").ok_or("registers= is missing")?, bytes, items);
    Ok(Figure::Words(match held.limiter {
        Limiter::CannotLaunch(_) => "cannot launch".to_owned(),
        limiter => format!("{} ({limiter})", held.threads),
    }))
}
