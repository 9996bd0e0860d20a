//! Lays out a preprocessed program for reading from top to bottom. Functions, types and variables that no
//! chosen kernel uses are left out, and their lines are counted. The lines that are not left out are divided
//! into parts: a part ends before the first line that comes from another file. A part begins with a comment
//! that has the file's name and the number of the part's first line. Lines of the file may be missing within
//! a part. Parts that contain only comments are left out too, but their lines are not counted.

use super::Line;
use super::token::{Kind, Token, lex};
use std::collections::HashSet;
use std::rc::Rc;

/// A program laid out for reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The program's parts, each under a comment that names the part's file and first line.
    pub text: String,
    /// Number of lines of unused functions, types and variables, which were left out.
    pub left_out: usize,
}

/// Lays out the functions, types and variables of a program that `kernels` use, or the whole program if
/// `kernels` is `None`. Parts of the program that contain only comments are left out, whether or not
/// `kernels` is `None`.
pub fn read(lines: &[Line], kernels: Option<&[&str]>) -> Reading {
    let items = items(lines);
    let needed = kernels.map(|kernels| needed(&items, kernels));
    let is_needed = |item: &Item| match (&needed, &item.name) {
        (Some(needed), Some(name)) => needed.contains(name),
        _ => true,
    };
    let left_out = items.iter().filter(|item| !is_needed(item)).map(|item| item.lines.len()).sum();
    let remaining: Vec<&Item> = items.iter().filter(|item| is_needed(item)).collect();
    let parts = remaining.chunk_by(|one, next| one.file() == next.file());
    let with_code = parts.filter(|part| part.iter().any(|item| item.has_code()));
    Reading { text: with_code.map(part).collect(), left_out }
}

/// Returns consecutive items of one file under a heading.
fn part(items: &[&Item]) -> String {
    let Some(first) = items.first().and_then(|item| item.lines.first()) else { return String::new() };
    let mut text = format!("\n// ---- {}, line {} ----\n", first.file, first.number);
    for (number, item) in items.iter().enumerate() {
        if item.apart || number == 0 {
            text.push('\n');
        }
        for line in &item.lines {
            text += &line.text;
            text.push('\n');
        }
    }
    text
}

/// A top-level item of a program: a function, a type, a variable or a pragma, with the comment before it. A
/// comment that does not belong to a function, a type, a variable or a pragma is an item, too.
struct Item<'a> {
    lines: Vec<&'a Line>,
    /// True if an empty line precedes the item.
    apart: bool,
    /// The name that the item declares, if this name can be determined.
    name: Option<String>,
    /// All names that the item uses.
    uses: HashSet<String>,
}

impl Item<'_> {
    fn file(&self) -> Option<&Rc<str>> {
        self.lines.first().map(|line| &line.file)
    }

    fn has_code(&self) -> bool {
        self.lines.iter().any(|line| line.is_code)
    }
}

/// Splits a program into its top-level items.
fn items(lines: &[Line]) -> Vec<Item<'_>> {
    let (mut items, mut item, mut apart, mut depth) = (Vec::new(), Vec::<&Line>::new(), false, 0);
    let mut end = |item: &mut Vec<_>, apart: &mut bool| {
        if !item.is_empty() {
            items.push(whole(std::mem::take(item), std::mem::take(apart)));
        }
    };
    for line in lines {
        let begun = item.iter().any(|line| line.is_code);
        if item.last().is_some_and(|last| last.file != line.file) || (line.text.is_empty() && !begun) {
            end(&mut item, &mut apart);
        }
        if line.text.is_empty() && !begun {
            apart = true;
            continue;
        }
        item.push(line);
        let code: Vec<Token> = lex(&line.text).into_iter().filter(Token::is_code).collect();
        depth += code.iter().map(nesting).sum::<i32>();
        let closes = code.last().is_some_and(|last| last.is(";") || last.is("}"));
        let is_directive = code.first().is_some_and(|first| first.is("#"));
        if depth == 0 && (closes || is_directive) {
            end(&mut item, &mut apart);
        }
    }
    end(&mut item, &mut apart);
    items
}

/// Returns the change of the bracket depth at a token: 1, -1 or 0.
fn nesting(token: &Token) -> i32 {
    match token.text.as_str() {
        "(" | "{" | "[" => 1,
        ")" | "}" | "]" => -1,
        _ => 0,
    }
}

fn whole(lines: Vec<&Line>, apart: bool) -> Item<'_> {
    let code: Vec<Token> = lines.iter().flat_map(|line| lex(&line.text)).filter(Token::is_code).collect();
    let names = code.iter().filter(|token| token.kind == Kind::Name).map(|token| token.text.clone());
    Item { name: declared(&code), uses: names.collect(), lines, apart }
}

/// Returns the name that an item declares. A type's name is the last name in the item, a function's name
/// precedes the opening bracket, and a variable's name precedes its array size, its value or the semicolon.
/// Returns `None` for an item without a name, such as a pragma.
fn declared(code: &[Token]) -> Option<String> {
    let mut depth = 0;
    let mut outer: Vec<&Token> = Vec::new();
    for token in code {
        let before = depth;
        depth += nesting(token);
        if before.min(depth) == 0 {
            outer.push(token);
        }
    }
    let is_type = outer.first().is_some_and(|first| first.text == "typedef");
    let named = |pair: &[&Token]| {
        let ends: &[&str] = if is_type { &[";"] } else { &["(", "[", "=", ";"] };
        let begins = pair[0].kind == Kind::Name && ends.iter().any(|end| pair[1].is(end));
        let own = !["__attribute__", "_Pragma", "struct", "enum", "union"].contains(&pair[0].text.as_str());
        (begins && own).then(|| pair[0].text.clone())
    };
    outer.windows(2).find_map(named)
}

/// Returns the names of all items that the kernels use, directly or indirectly.
fn needed(items: &[Item], kernels: &[&str]) -> HashSet<String> {
    let mut needed: HashSet<String> = kernels.iter().map(|&name| name.to_owned()).collect();
    // Items without a name, such as pragmas, are always included, so the items whose names they use are
    // needed too.
    needed.extend(items.iter().filter(|item| item.name.is_none()).flat_map(|item| item.uses.clone()));
    loop {
        let count = needed.len();
        for item in items.iter().rev() {
            if item.name.as_ref().is_some_and(|name| needed.contains(name)) {
                needed.extend(item.uses.iter().cloned());
            }
        }
        if needed.len() == count {
            return needed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::preprocess;
    use super::*;
    use std::collections::BTreeMap;

    const SOURCE: &str = "#line 1 \"a.cl\"
// The file.

typedef struct {
    int x;
} Used;
typedef struct { int y; } Unused;

// Called.
static int called(Used used) {
    return used.x;
}

// Called only by a function that the kernel `mine` does not call.
int not_called(void) { return 1; }
#line 1 \"b.cl\"
int nor_this(void) { return not_called(); }
#line 1 \"c.cl\"
#pragma OPENCL FP_CONTRACT OFF
__constant float table[2] = {1.0f, 2.0f};
__kernel __attribute__((reqd_work_group_size(8, 8, 1))) void mine(__global int *out) {
    Used used;
    out[0] = called(used) + (int)table[0];
}

__kernel void other(void) { nor_this(); }
";

    fn reading(kernels: Option<&[&str]>) -> Reading {
        let lines = preprocess(SOURCE, "", &BTreeMap::new()).map(|preprocessed| preprocessed.lines);
        read(&lines.unwrap_or_else(|error| panic!("{error}")), kernels)
    }

    #[test]
    fn what_no_kernel_needs_is_left_out_and_counted() {
        let reading_of_mine = reading(Some(&["mine"]));
        for gone in ["Unused", "not_called", "nor_this", "b.cl", "other"] {
            assert!(!reading_of_mine.text.contains(gone), "{gone} in:\n{}", reading_of_mine.text);
        }
        for part in [
            "// The file.\n\ntypedef",
            "} Used;",
            "// Called.\nstatic",
            "// ---- c.cl, line 1 ----\n\n#pragma",
            "table[2]",
        ] {
            assert!(reading_of_mine.text.contains(part), "{part} not in:\n{}", reading_of_mine.text);
        }
        assert_eq!(reading_of_mine.left_out, 5);
        assert!(reading(Some(&["other"])).text.contains("b.cl, line 1"));
    }

    #[test]
    fn what_a_function_uses_that_is_defined_after_its_call_stays() {
        let source = "int used(void) { return 1; }\nint later(void);\n\
            __kernel void mine(void) { later(); }\nint later(void) { return used(); }\n";
        let lines = preprocess(source, "", &BTreeMap::new()).map(|output| output.lines).unwrap_or_default();
        let reading = read(&lines, Some(&["mine"]));
        assert!(reading.left_out == 0 && reading.text.contains("int used(void)"), "{}", reading.text);
    }

    #[test]
    fn nothing_is_left_out_where_all_is_asked_for() {
        let whole = reading(None);
        assert_eq!(whole.left_out, 0);
        let lines = |text: &str| text.lines().filter(|line| !line.is_empty()).count();
        assert_eq!(lines(&whole.text), lines(SOURCE));
    }

    #[test]
    fn a_comment_after_a_pragma_that_a_macro_made_stays() {
        let pragma = "#define EXACT _Pragma(\"OPENCL FP_CONTRACT OFF\")\n";
        let source = format!("{pragma}EXACT // why\n__kernel void mine(void) {{}}\n");
        let lines = preprocess(&source, "", &BTreeMap::new()).map(|output| output.lines).unwrap_or_default();
        let text = read(&lines, Some(&["mine"])).text;
        assert!(text.contains("#pragma OPENCL FP_CONTRACT OFF\n// why\n__kernel"), "{text}");
    }
}
