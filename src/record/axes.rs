//! Reads the axes and their values from the text of a record's strategy, such as "traversal=bvh width=8".

/// Axes that are newer than some records. Each axis is listed with the value that describes what raycl did
/// before the axis existed.
const BEFORE: [(&str, &str); 1] = [("records", "each-test")];

/// Returns the axes in a strategy's text with their values, and then the axes that raycl did not have yet
/// when it wrote the text. Each of these newer axes has the value that describes what raycl did before the
/// axis existed. Returns no axis for a baseline.
pub fn axes(strategy: &str) -> impl Iterator<Item = (&str, &str)> {
    let stated = move || strategy.split_whitespace().filter_map(|part| part.split_once('='));
    let is_unstated = move |(axis, _): &(&str, &str)| {
        stated().any(|(name, _)| name == "traversal") && stated().all(|(name, _)| name != *axis)
    };
    stated().chain(BEFORE.into_iter().filter(is_unstated))
}
