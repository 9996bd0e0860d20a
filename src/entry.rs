//! Finds an entry of a list, or adds one. Unlike a map, the list keeps its entries in the order in which they were added.

/// Returns the first entry of `list` that `is_it` accepts. If no entry is accepted, adds the entry that `new`
/// returns to the end of the list, and returns the new entry.
pub fn entry<T>(list: &mut Vec<T>, is_it: impl Fn(&T) -> bool, new: impl FnOnce() -> T) -> &mut T {
    let index = list.iter().position(is_it).unwrap_or_else(|| {
        list.push(new());
        list.len() - 1
    });
    &mut list[index]
}

#[cfg(test)]
mod tests {
    use super::entry;

    #[test]
    fn entries_keep_the_order_in_which_they_were_added() {
        let mut counts: Vec<(char, u32)> = Vec::new();
        for letter in "banana".chars() {
            entry(&mut counts, |(known, _)| *known == letter, || (letter, 0)).1 += 1;
        }
        assert_eq!(counts, [('b', 1), ('a', 3), ('n', 2)]);
    }
}
