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
    let is_needed = |item: &Item| needed.as_ref().is_none_or(|needed| item.is_needed(needed));
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
    /// The names that the item declares. An item is always needed if its names cannot be determined.
    names: Vec<String>,
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

    /// Returns true if `needed` has one of the item's names, or if the item has no name.
    fn is_needed(&self, needed: &HashSet<String>) -> bool {
        self.names.is_empty() || self.names.iter().any(|name| needed.contains(name))
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
    let uses = code.iter().filter(|token| token.kind == Kind::Name).map(|token| token.text.clone());
    Item { names: declared(&code), uses: uses.collect(), lines, apart }
}

/// The symbols that may follow a declared name: the brackets after the name of a function, an array or a structure,
/// and the symbols after a variable or another type.
const ENDS: [&str; 6] = ["(", "[", "{", "=", ",", ";"];
/// Words that may precede a symbol of [`ENDS`] and declare nothing.
const WORDS: [&str; 5] = ["__attribute__", "__attribute", "_Pragma", "struct", "union"];

/// Returns the names that an item declares: the names of all functions, types and variables, since an item may be a
/// list of variables, or have several functions on one line. May also return a name that the item only uses, so the
/// item may be kept needlessly. Returns no name for an item without a name, such as a pragma. Also returns no name for
/// an `enum`, because a program uses the values of an `enum` without its name.
fn declared(code: &[Token]) -> Vec<String> {
    let outer = outer(code);
    if outer.iter().any(|token| token.text == "enum") {
        return Vec::new();
    }
    let named = |pair: &[&Token]| {
        let begins = pair[0].kind == Kind::Name && ENDS.iter().any(|end| pair[1].is(end));
        (begins && !WORDS.contains(&pair[0].text.as_str())).then(|| pair[0].text.clone())
    };
    outer.windows(2).filter_map(named).collect()
}

/// Returns an item's tokens outside brackets, with the brackets themselves. Leaves out the values of variables, because
/// the item only uses the names in these values, and does not declare them.
fn outer(code: &[Token]) -> Vec<&Token> {
    let (mut outer, mut depth, mut is_value) = (Vec::new(), 0, false);
    for token in code {
        let before = depth;
        depth += nesting(token);
        if before.min(depth) > 0 {
            continue;
        }
        is_value &= !token.is(",") && !token.is(";");
        if !is_value {
            outer.push(token);
        }
        is_value |= token.is("=");
    }
    outer
}

/// Returns the kernels' names, and all names that the kernels use, directly or indirectly. Items without
/// a name, such as pragmas, are always needed, so the names that they use are needed too.
fn needed(items: &[Item], kernels: &[&str]) -> HashSet<String> {
    let mut needed: HashSet<String> = kernels.iter().map(|&name| name.to_owned()).collect();
    loop {
        let count = needed.len();
        for item in items.iter().rev() {
            if item.is_needed(&needed) {
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

    /// Returns the reading of a kernel that contains the statement `used`, after a declaration.
    fn reading_of(declaration: &str, used: &str) -> Reading {
        let source = format!("{declaration}\n__kernel void mine(__global float *out) {{ {used} }}\n");
        let lines = preprocess(&source, "", &BTreeMap::new()).map(|preprocessed| preprocessed.lines);
        read(&lines.unwrap_or_else(|error| panic!("{error}")), Some(&["mine"]))
    }

    #[test]
    fn an_item_that_declares_several_names_stays_if_one_of_them_is_used() {
        let both = "#define BOTH(a, b) float a(void) { return 1.0f; } float b(void) { return 2.0f; }\n";
        let made = format!("{both}BOTH(first, second)");
        for (declaration, used) in [
            ("__constant float A = 1.0f, B = 0.5f;", "out[0] = B;"),
            ("__constant float A = 1.0f,\n                 B[2] = {0.5f, 0.25f};", "out[0] = B[1];"),
            ("__constant float A = 1.0f; __constant float B = 0.5f;", "out[0] = B;"),
            ("float a(void) { return 1.0f; } float b(void) { return 2.0f; }", "out[0] = b();"),
            (made.as_str(), "out[0] = second();"),
            ("float a(float), b(float);", "out[0] = b(1.0f);"),
            ("typedef float F, G;", "G g = 1.0f;"),
            ("typedef float F, G[2];", "G g;"),
            ("typedef float F; float f(void) { return 1.0f; }", "out[0] = f();"),
            ("typedef struct T { float x; } U;", "struct T t;"),
            ("typedef struct T { float x; } U;", "U u;"),
            ("struct T { float x; };", "struct T t;"),
            ("typedef union { float x; int n; } U;", "U u;"),
        ] {
            let reading = reading_of(declaration, used);
            assert_eq!(reading.left_out, 0, "{declaration}\n{}", reading.text);
            assert!(reading_of(declaration, "").left_out > 0, "{declaration}");
        }
    }

    #[test]
    fn an_item_whose_names_cannot_be_determined_stays() {
        for declaration in [
            "typedef float F __attribute((aligned(16)));",
            "typedef float F __attribute__((aligned(16)));",
            "typedef enum { ONE, TWO } Number;",
            "enum Number { ONE, TWO };",
        ] {
            assert_eq!(reading_of(declaration, "").left_out, 0, "{declaration}");
        }
    }

    #[test]
    fn a_name_that_an_item_only_uses_does_not_keep_the_item() {
        let source = "float base(void);\n__constant float UNUSED = base(), OTHER = 2.0f;";
        assert_eq!(reading_of(source, "out[0] = base();").left_out, 1);
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
