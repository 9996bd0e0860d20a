//! Decides which `#include` lines of kernel files are replaced by the included file. An include under `#if
//! NAME` or `#if !NAME` is not followed if the host's defines make the condition false, so the program does
//! not contain the included file. Conditions that the host cannot decide count as true.

/// The values of the `#if` conditions around a line, outermost first. A condition that the host cannot decide
/// is `None`, and counts as true.
#[derive(Default)]
pub(super) struct Branches(Vec<Option<bool>>);

impl Branches {
    /// Processes a line from which comments have been removed: if it is a directive such as `#if`, the conditions
    /// around the following lines change.
    pub fn pass(&mut self, line: &str, defines: &[(&'static str, u64)]) {
        let Some(directive) = line.trim().strip_prefix('#').map(str::trim) else { return };
        let end = directive.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(directive.len());
        let (word, rest) = directive.split_at(end);
        match word {
            "if" => self.0.push(holds(rest.trim(), defines)),
            "ifdef" | "ifndef" => self.0.push(None),
            "elif" => self.turn(|_| None),
            "else" => self.turn(|holds| holds.map(|holds| !holds)),
            "endif" => {
                self.0.pop();
            }
            _ => {}
        }
    }

    fn turn(&mut self, change: impl FnOnce(Option<bool>) -> Option<bool>) {
        if let Some(last) = self.0.last_mut() {
            *last = change(*last);
        }
    }

    /// Returns true if the compiler may see the next line: no condition around the line is known to be false.
    pub fn may_be_live(&self) -> bool {
        !self.0.contains(&Some(false))
    }
}

/// Returns the value of a condition of the form `NAME` or `!NAME`, where the host defines `NAME`; `None` for
/// any other condition.
fn holds(condition: &str, defines: &[(&'static str, u64)]) -> Option<bool> {
    let (name, wanted) = condition.strip_prefix('!').map_or((condition, true), |name| (name, false));
    let (_, value) = defines.iter().find(|(define, _)| *define == name)?;
    Some((*value != 0) == wanted)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn live(lines: &str) -> bool {
        let mut branches = Branches::default();
        for line in crate::sources::lines("a.cl", lines).unwrap() {
            branches.pass(&line.directive, &[("TREE", 1), ("WATERTIGHT", 0)]);
        }
        branches.may_be_live()
    }

    #[test]
    fn only_what_the_host_knows_to_be_dead_is() {
        assert!(live("") && live("#if TREE") && live("#if !WATERTIGHT") && live("#if TREE\n#if OTHER"));
        assert!(
            !live("#if WATERTIGHT // why") && !live("#if TREE\n#else") && !live("#if WATERTIGHT\n#if TREE")
        );
        assert!(
            live("#if WATERTIGHT\n#else") && live("#if WATERTIGHT\n#endif") && live("#if WATERTIGHT == 0")
        );
        assert!(live("#ifndef TREE") && live("#if WATERTIGHT\n#elif OTHER") && live("#define WATERTIGHT 0"));
    }

    #[test]
    fn directives_need_no_blanks_and_comments_contain_none() {
        assert!(!live("#if WATERTIGHT /* why */") && live("#if WATERTIGHT\n#else/**/"));
        assert!(live("#if WATERTIGHT\n#endif/**/") && !live("#if WATERTIGHT\n#if(TREE)\n#endif"));
        assert!(live("/*\n#if WATERTIGHT\n*/") && !live("#if WATERTIGHT\n/*\n#endif\n*/"));
    }

    #[test]
    fn every_value_but_0_is_true() {
        for (line, expected) in [("#if LANES", true), ("#if !LANES", false)] {
            let mut branches = Branches::default();
            branches.pass(line, &[("LANES", 32)]);
            assert_eq!(branches.may_be_live(), expected, "{line}");
        }
    }
}
