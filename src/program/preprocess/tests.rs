//! Tests of the preprocessor, rule by rule; tests/kernel.rs compares whole kernels with the output of a C compiler's
//! preprocessor.

use super::{Preprocessed, Value, canonical, preprocess};
use crate::error::Result;
use std::collections::BTreeMap;

fn run(source: &str, options: &str) -> Result<Preprocessed> {
    preprocess(source, options, &BTreeMap::new())
}

#[track_caller]
fn text(source: &str) -> String {
    run(source, "").unwrap_or_else(|error| panic!("{error}")).text()
}

#[track_caller]
fn mistake(source: &str) -> String {
    run(source, "").map(|output| panic!("{}", output.text())).unwrap_or_else(|error| error.to_string())
}

/// Returns true if an `#if` condition is true when `ONE` is defined as 1.
#[track_caller]
fn holds(condition: &str) -> bool {
    text(&format!("#define ONE 1\n#define SUM(a, b) ((a) + (b))\n#if {condition}\nyes\n#endif\n")) == "yes\n"
}

#[test]
fn conditions_are_integer_expressions() {
    for condition in [
        "1",
        "ONE",
        "!0",
        "-1 < 0",
        "2 + 3 * 4 == 14",
        "(2 + 3) * 4 == 20",
        "7 / 2 == 3 && 7 % 2",
        "1 << 4 == 16",
        "0x10 == 16 && 010 == 8 && 3u == 3",
        "6 & 3 ^ 1 | 8",
        "0 ? 0 : 1",
        "ONE ? ONE : 0",
        "0 || 2 > 1",
        "~0 == -1",
        "SUM(ONE, 2) == 3",
        "nobody == 0",
        "defined ONE && !defined(TWO)",
        "0 == (0 && 1 / 0)",
        "1 || 1 / 0",
        "1 ? 1 : 1 / 0",
        "1 || 1 % 0",
        "0 == (0 && (1 ? 1 / 0 : 1))",
        "0 == (0 && (0 ? 1 : 1 / 0))",
        "1 - 1 - 1 == -1",
        "!defined(ONE) == 0",
        "5 >= 5 != 0 // a comment",
        "1 /* another */ == 1",
    ] {
        assert!(holds(condition), "{condition}");
        assert!(
            !holds(&format!("!({})", condition.split("//").next().unwrap_or_default())),
            "not {condition}"
        );
    }
    for condition in [
        "",
        "1 +",
        "(1",
        "1)",
        "1 / 0",
        "1 % 0",
        "1.5",
        "\"a\"",
        "1 2",
        "defined",
        "defined 5",
        "defined(5",
        "? 1 : 2",
    ] {
        let message = mistake(&format!("a\n#if {condition}\n#endif\n"));
        assert!(message.starts_with("the text, line 2: "), "{condition}: {message}");
    }
}

/// The C compiler's preprocessor finds each of these conditions true.
#[test]
fn values_are_signed_or_unsigned_as_in_c() {
    for condition in [
        "0xffffffffffffffff > 0",
        "01777777777777777777777 > 0",
        "18446744073709551615 > 0",
        "18446744073709551615u % 10 == 5",
        "-1 == 18446744073709551615u",
        "-0x7fffffffffffffff - 1 < 0",
        "-1 > 0u",
        "-1 / 2u > 1",
        "-3 % 2 == -1 && -3 % 2u == 1",
        "-1 * 0u - 1 > 0",
        "(0 | -1u) > 0 && (0u ^ -1) > 0 && (-1 & 3u) - 4 > 0",
        "~0u >> 63 == 1",
        "-1 >> 1u == -1",
        "(-1 << 1u) < 0",
        "-(1u) > 0 && +(1u) - 2 > 0",
        "!0u - 2 < 0",
        "(1u < 2) - 2 < 0 && (0u || 1u) - 2 < 0",
        "(1 ? -1 : 0u) > 0 && (0 ? 0u : -1) > 0",
        "(0 ? 1u / 0 : -1) > 0",
    ] {
        assert!(holds(condition), "{condition}");
        assert!(!holds(&format!("!({condition})")), "not {condition}");
    }
    assert!(holds("(-0x7fffffffffffffff - 1) / -1 < 0"), "an overflow that C leaves undefined");
    assert!(mistake("#if 18446744073709551616\n#endif\n").contains("is not an integer"));
}

#[test]
fn one_branch_at_most_is_live() {
    let source = "#if A == 1\none\n#elif A == 2\n#ifdef B\nboth\n#else\ntwo\n#endif\n#elif A < 9\nfew\n#else\nmany\n#endif\n";
    for (options, expected) in [
        ("-D A=1", "one\n"),
        ("-D A", "one\n"),
        ("-D A=2", "two\n"),
        ("-DA=2 -D B", "both\n"),
        ("-D A=3 -cl-std=CL1.2", "few\n"),
        ("-D A=9", "many\n"),
        ("-D A=1 -D B=0", "one\n"),
    ] {
        assert_eq!(
            run(source, options).map(|output| output.text()).ok().as_deref(),
            Some(expected),
            "{options}"
        );
    }
}

#[test]
fn dead_branches_are_neither_read_nor_shown() {
    let source = "#if 0\n#if 1 / 0\n#error no\n#else\n#nonsense \"\n#endif\n// a comment\n#define A 1\nit's dead\n#elif 1\nlive A\n#else\n#error no\n#endif";
    assert_eq!(text(source), "live A\n");
}

#[test]
fn what_is_not_closed_or_not_opened_is_reported() {
    assert_eq!(mistake("a\n#if 1\nb\n"), "the text, line 2: this #if has no #endif");
    for name in ["else", "elif 1", "endif"] {
        assert!(mistake(&format!("#{name}\n")).contains("without #if"), "{name}");
    }
    for name in ["else", "elif 1"] {
        let said = mistake(&format!("#if 0\n#if 1\n#else\n#{name}\n#endif\n#endif\n"));
        assert_eq!(said, format!("the text, line 4: #{} after #else", &name[..4]));
    }
    assert!(mistake("#include \"a.cl\"\n").contains("raycl does not support the directive #include"));
    assert!(mistake("#define\n").contains("needs a name"));
    for wrong in ["F(a, ...) a", "F(a, b"] {
        let said = mistake(&format!("#define {wrong}\n"));
        assert!(said.ends_with("expected names separated by commas, and then `)`"), "{said}");
    }
}

#[test]
fn an_if_without_endif_has_its_own_file_and_line_and_remedy() {
    let source = "#line 1 \"a.cl\"\nx\n#line 1 \"b.cl\"\n\n#if 0\n#line 1 \"c.cl\"\ny\n#line 3 \"a.cl\"\nz\n";
    let error = run(source, "").unwrap_err();
    assert_eq!(error.to_string(), "b.cl, line 2: this #if has no #endif");
    assert_eq!(error.remedy(), "close the #if with #endif in the same file, in the folder of --cl-dir");
}

#[test]
fn only_errors_of_lines_that_may_ask_for_a_value_advise_to_set_it() {
    for (source, asks) in
        [("#error A\n", true), ("#if 1 / A\n#endif\n", true), ("#else\n", false), ("#nonsense\n", false)]
    {
        let remedy = run(source, "").unwrap_err().remedy().to_owned();
        assert_eq!(remedy.contains("requires another value of a macro"), asks, "{source}: {remedy}");
        assert!(remedy.contains("the folder of --cl-dir"), "{source}: {remedy}");
    }
}

#[test]
fn an_error_that_is_reached_has_its_file_and_line() {
    let source = "#line 1 \"a.cl\"\nx\n#if 0\n#line 1 \"b.cl\"\ny\n#line 4 \"a.cl\"\n#endif\n#ifndef WIDTH\n#error \"WIDTH: rays\"\n#endif\n";
    assert_eq!(mistake(source), "a.cl, line 6: #error \"WIDTH: rays\"");
    assert!(run(source, "-D WIDTH=1").is_ok());
}

#[test]
fn every_line_knows_its_file() {
    let source =
        "#line 7 \"a.cl\"\na\n#define B \\\n    b; \\\n    c;\n\nB\n#line 1 \"b.cl\"\nd\n#line 20\ne\n";
    let lines = run(source, "").map(|output| output.lines).unwrap_or_default();
    let lines_with_code: Vec<_> =
        lines.iter().filter(|line| line.is_code).map(|l| (&*l.file, l.number, &*l.text)).collect();
    let expected =
        [("a.cl", 7, "a"), ("a.cl", 12, "b;"), ("a.cl", 12, "c;"), ("b.cl", 1, "d"), ("b.cl", 20, "e")];
    assert_eq!(lines_with_code, expected);
}

#[test]
fn macros_are_expanded_until_nothing_is_left() {
    let calls = [
        ("#define A B + 1\n#define B c\nA", "c + 1"),
        ("#define F(x, y) (x) * (y)\nF(a + b, F(c, d))", "(a + b) * ((c) * (d))"),
        ("#define F(x) G(x) x\n#define G(x) [x]\nF(a)", "[a] a"),
        ("#define F(x) x + 1\nF, F (a) F((a, b))", "F, a + 1 (a, b) + 1"),
        ("#define CALL(f, x) f(x)\n#define F(x) <x>\nCALL(F, a)", "<a>"),
        (
            "#define F(a, b) a##b\n#define G(a, b) F(a, b)\n#define C d\nF(or_, C) G(or_, C) F(, x) F(x,)",
            "or_C or_d x x",
        ),
        ("#define S(x) #x\n#define D S(b)\nS(a  +\n \"q\\n\") D", "\"a + \\\"q\\\\n\\\"\" \"b\""),
        ("#define NONE\n#define ARGS , a\nf(x NONE) f(x ARGS) NONE g()", "f(x) f(x, a) g()"),
        ("#define F() f\nF() F( )", "f f"),
        ("#define M -1\n#define P +\n-M P+ +P", "- -1 /* M */ + + + +"),
        ("#define A 1\n#undef A\nA", "A"),
        ("\"A\" // A\n#define A 1", "\"A\" // A"),
    ];
    for (source, expected) in calls {
        assert_eq!(text(source).trim_end(), expected, "{source}");
    }
    assert!(mistake("#define F(a, b) a\n\nF(1)\n").contains("line 3: F takes 2 arguments, not 1"));
    assert!(mistake("#define F(a) a\nF(1\n#undef F\n)\n").contains("line 2: the call of F is not closed"));
    assert!(mistake("#define F(a) a ## +\nF(b)\n").contains("b ## + is not one token"));
}

#[test]
fn no_macro_is_called_out_of_its_own_expansion() {
    assert_eq!(text("#define A A + B\n#define B A\nA\n"), "A + A\n");
    assert_eq!(text("#define f(x) f(x + 1)\nf(f(2))\n"), "f(f(2 + 1) + 1)\n");
}

#[test]
fn macros_are_those_of_their_line() {
    assert_eq!(text("A\n#define A b\nA\n#undef A\nA\n#define A c\nA\n"), "A\nb\nA\nc\n");
}

#[test]
fn constants_keep_their_names() {
    assert_eq!(
        text("#define WIDTH 4\n#define STRIDE (2 * WIDTH)\na[STRIDE];\n"),
        "a[(2 * 4) /* STRIDE */];\n"
    );
    // A macro can become a constant when another macro is defined again.
    assert_eq!(text("#define A b\n#define C A\nC\n#define A 4\nC\n"), "b\n4 /* C */\n");
}

#[test]
fn the_compilers_own_macros_are_asked_for_and_left_alone() {
    let source = "#if defined(OWN) && OWN > 2\nOWN\n#elif defined(OTHER)\nother\n#endif\n#ifdef __has_builtin\n#if __has_builtin(f)\nbuiltin\n#endif\n#endif\n";
    let absent = run(source, "").map(|output| (output.text(), output.asked)).ok();
    let asked =
        ["OWN", "defined(OTHER)", "defined(OWN)", "defined(__has_builtin)"].map(str::to_owned).to_vec();
    assert_eq!(absent, Some((String::new(), asked)));
    let answers = [("OWN", 3), ("defined(OWN)", 1), ("defined(__has_builtin)", 1), ("__has_builtin(f)", 1)];
    let given = answers.map(|(asked, bits)| (asked.to_owned(), Value { bits, is_unsigned: false }));
    let known =
        preprocess(source, "", &BTreeMap::from(given)).map(|output| (output.text(), output.asked)).ok();
    assert_eq!(known, Some(("OWN\nbuiltin\n".to_owned(), Vec::new())));
}

#[test]
fn only_a_macro_whose_value_matters_is_asked_for_its_value() {
    let output = run("#ifdef A\n#endif\n#ifndef B\n#endif\n#if defined(C) && D\n#endif\n", "").unwrap();
    assert_eq!(output.asked, ["D", "defined(A)", "defined(B)", "defined(C)"]);
    let output = run("#if defined(A) && A > 1\n#elif __has_builtin(f)\n#endif\n", "").unwrap();
    assert_eq!(output.undefined().into_iter().collect::<Vec<_>>(), ["A", "__has_builtin(f)"]);
    let most = Value { bits: u64::MAX, is_unsigned: true };
    let given = BTreeMap::from([("MOST".to_owned(), most)]);
    assert_eq!(preprocess("#if MOST > 0\nlarge\n#endif\n", "", &given).unwrap().text(), "large\n");
}

#[test]
fn lines_of_a_macro_stay_lines_and_are_indented_as_its_call() {
    let source = "\
#define INNER(s) \\
    s.b = 1;     \\
    if (x)       \\
        s.c = 2;
#define BIND(s) \\
    s.a = 0;    \\
    INNER(s.in) \\
    s.d = 3;
#define LOCALS __local int x; __local int y;
void f(void) {
    LOCALS
    BIND(t)
}
";
    let expected = "\
void f(void) {
    __local int x;
    __local int y;
    t.a = 0;
    t.in.b = 1;
    if (x)
        t.in.c = 2;
    t.d = 3;
}
";
    assert_eq!(text(source), expected);
}

#[test]
fn long_lines_that_macros_made_are_broken_beside_their_bracket() {
    let parameters = (0..8).map(|i| format!("const int parameter_{i}")).collect::<Vec<_>>();
    let broken = text(&format!("#define ALL {}\nvoid f(ALL) {{}}\n", parameters.join(", ")));
    assert!(broken.lines().count() == 2 && broken.lines().all(|line| line.len() <= 120), "{broken}");
    assert!(broken.lines().nth(1).is_some_and(|line| line.starts_with("       const int")), "{broken}");
}

#[test]
fn comments_of_live_code_stay_and_those_of_macros_go() {
    let source = "\
// What the file is.

// Of a macro.
#define A a

// Of a function, which needs
// a macro.
#if 1
void f() { A; } // here
#endif
// Of a function that is not compiled.
#if 0
void g() {}
#endif



/* Of both
   kinds. */
int x;
";
    let expected = "\
// What the file is.

// Of a function, which needs
// a macro.
void f() { a; } // here

/* Of both
   kinds. */
int x;
";
    assert_eq!(text(source), expected);
}

#[test]
fn the_text_of_a_file_does_not_begin_with_an_empty_line() {
    let source = "#line 1 \"a.cl\"\na\n#line 1 \"b.cl\"\n\nb\n\nc\n";
    assert_eq!(text(source), "a\nb\n\nc\n");
}

#[test]
fn no_code_is_joined_to_a_comment() {
    let text = text("#define A a\nf(A, // why\n  b);\n");
    assert!(text.lines().any(|line| line.trim() == "b);"), "{text}");
}

#[test]
fn pragmas_are_kept() {
    let source = "#pragma unroll 4 // faster\nfor (;;)\n_Pragma(\"unroll 1\") for (;;) {}\n";
    assert_eq!(text(source), source);
    assert_eq!(canonical(source), "#pragma unroll 4\nfor ( ; ; )\n#pragma unroll 1\nfor ( ; ; ) {\n}\n");
}

/// In the string of `_Pragma`, a backslash before a quote or before another backslash is not part of the pragma.
#[test]
fn a_pragma_of_a_macro_may_have_quotes_and_backslashes_and_blanks_around_its_string() {
    let pragma = "_Pragma ( \"message \\\"a\\\\b\\\"\" )";
    let expected = "#pragma message \"a\\b\"\n";
    assert_eq!(text(&format!("#define P {pragma}\nP\n")), expected);
    assert_eq!(canonical(&format!("{pragma}\n")), expected);
}

#[test]
fn canonical_texts_differ_where_the_compiler_sees_a_difference_only() {
    assert_eq!(canonical("int  a=1; // one\n"), canonical("int/**/a\n  = 1 ;"));
    for other in ["int a = 2;", "inta = 1;", "int a == 1;", "#pragma a\nint a = 1;"] {
        assert_ne!(canonical("int a = 1;"), canonical(other));
    }
}

/// Generates texts with macros, comments and conditions, each from its `#if` to its `#endif`.
fn sources() -> impl proptest::strategy::Strategy<Value = String> {
    use proptest::prelude::*;
    let line = prop_oneof![
        Just("// a comment".to_owned()),
        Just(String::new()),
        Just("    F(a, F(b, c)) + A;".to_owned()),
        Just("A B C".to_owned()),
        Just("#define A 1\n".to_owned()),
        Just("#undef A".to_owned()),
        Just("#define F(x, y) { \\\n  x; \\\n    y; \\\n  }".to_owned()),
        Just("#pragma unroll".to_owned()),
        Just("#if A\nlive(A);\n#else\n// dead\ndead(F);\n#endif".to_owned()),
        Just("#define B C, A, B".to_owned()),
        Just("int x; B int y; /* why */".to_owned()),
        "[a-c(){};,+ -]{0,30}".prop_map(|text| format!("{text};")),
    ];
    prop::collection::vec(line, 0..12).prop_map(|lines| lines.join("\n") + "\n")
}

proptest::proptest! {
    #[test]
    fn what_is_preprocessed_stays_as_it_is(source in sources()) {
        // Some of the generated texts call the macro F wrongly, which is an error.
        if let Ok(once) = run(&source, "") {
            let again = run(&once.text(), "").map(|output| output.text());
            proptest::prop_assert_eq!(again.ok(), Some(once.text()));
        }
    }
}

/// If a statement with braces would be wider than 120 columns, the contents of the braces get separate lines.
#[test]
fn a_long_body_is_set_apart_from_its_head_and_a_short_one_is_not() {
    let of = |name: &str| {
        let calls: String = (0..4).map(|i| format!(" {name}({i});")).collect();
        text(&format!("#define BODY{calls}\n    if (x) {{ BODY }}\n"))
    };
    assert_eq!(of("f"), "    if (x) { f(0); f(1); f(2); f(3); }\n");
    let name = "f".repeat(30);
    let calls: String = (0..4).map(|i| format!("        {name}({i});\n")).collect();
    assert_eq!(of(&name), format!("    if (x) {{\n{calls}    }}\n"));
}

#[test]
fn a_call_whose_brackets_close_on_a_later_line_is_joined() {
    assert_eq!(text("#define CALL f\nCALL(a,\n    (b),\n    c);\nd;\n"), "f(a, (b), c);\nd;\n");
}

#[test]
fn calls_nested_too_deeply_are_refused_with_their_line() {
    let nested = |levels| format!("#define F(a) a\n\n{}1{}\n", "F(".repeat(levels), ")".repeat(levels));
    assert_eq!(text(&nested(90)).trim(), "1");
    let said = mistake(&nested(20_000));
    assert!(said.contains("line 3: macro calls are nested more than 100 levels deep"), "{said}");
}

#[test]
fn macros_that_double_a_text_again_and_again_are_refused() {
    let doubled = |times: usize| {
        let define = |n| format!("#define D{} D{n} x D{n}\n", n + 1);
        format!("#define D0 y\n{}\nD{times}\n", (0..times).map(define).collect::<String>())
    };
    assert_eq!(text(&doubled(3)).matches('x').count(), 7);
    let said = mistake(&doubled(40));
    assert!(said.contains("line 43: macros expand to more than 500000 tokens"), "{said}");
}

#[test]
fn a_chain_of_macros_may_be_long_but_not_endless() {
    let link = |n| format!("#define C{n} C{}\n", n + 1);
    let chain = format!("{}#define C50 f()\nC0;\n", (0..50).map(link).collect::<String>());
    assert_eq!(text(&chain).trim(), "f();");
    let endless = format!("{}C0;\n", (0..20_000).map(link).collect::<String>());
    assert!(mistake(&endless).contains("line 20001: macros expand to more than 500000 tokens"));
}

#[test]
fn conditions_nested_too_deeply_are_refused_with_their_line() {
    let inside = |before: &str, after: &str, levels| {
        format!("\n#if {}1{}\nyes\n#endif\n", before.repeat(levels), after.repeat(levels))
    };
    let expected =
        "line 2: the condition has brackets, unary operators or ?: nested more than 100 levels deep";
    for (before, after) in [("(", ")"), ("!!", ""), ("1 ? 1 : ", ""), ("-(0 + ", ")")] {
        assert_eq!(text(&inside(before, after, 30)).trim(), "yes", "{before}");
        let said = mistake(&inside(before, after, 50_000));
        assert!(said.contains(expected), "{said}");
    }
}

/// If the name of a called function has 79 characters, the call's opening bracket ends at column 80.
#[test]
fn a_long_call_is_aligned_with_its_bracket_up_to_column_80() {
    let arguments = (0..8).map(|i| format!("argument_{i}")).collect::<Vec<_>>().join(", ");
    let indent = |name_length: usize| {
        let call = format!("#define ALL {arguments}\n{}(ALL);\n", "f".repeat(name_length));
        text(&call).lines().nth(1).map(|line| line.len() - line.trim_start().len())
    };
    assert_eq!([79, 80].map(indent), [Some(80), Some(4)]);
}

#[test]
fn a_comment_in_an_argument_is_a_blank_in_a_string_and_does_not_prevent_joining() {
    let macros = "#define S(x) #x\n#define T(x) S(x)\n#define J(a, b) a##b\n#define W 4\n";
    for (call, expected) in [
        ("S(/* why */ a /* so */ + /* b */)", "\"a +\""),
        ("S(a/**/b)", "\"a b\""),
        ("T(W)", "\"4\""),
        ("J(/* why */ x, /* so */ y)", "xy"),
    ] {
        assert_eq!(text(&format!("{macros}{call}\n")), format!("{expected}\n"), "{call}");
    }
}
