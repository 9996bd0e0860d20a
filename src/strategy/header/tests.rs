//! Tests of correct headers, and of mistakes in headers.

use super::super::AXES;
use super::*;

fn read(axis: &'static str, text: &str) -> Result<Header> {
    let names_of = |axis: &str| match axis {
        "intersector" => vec!["moller-trumbore".to_owned(), "my-test".to_owned()],
        _ => {
            let listed = AXES.iter().filter(|info| info.name == axis).flat_map(|info| info.listed);
            listed.map(|(name, _)| (*name).to_owned()).collect()
        }
    };
    let (file, path) = ("cast/intersect/my_test.cl", "kernels/cast/intersect/my_test.cl");
    let includes = |other: &str| Ok(text.contains(&format!("\n#include \"{other}\"\n")));
    let reader = Reader { axis, file, path, names_of: &names_of, included_at: &|| None, includes: &includes };
    reader.read("my-test".to_owned(), vec!["cast/intersect/"], text)
}

const RIGHT: &str = "// A test of mine: see below.\n// meaning: mine\n// record_floats: 9\n// prepared_for: any-ray\n\
                     // exact_signs: no\n// contradicts: culling=back, math=fast because I say so\n//\n// prose: this\n";

#[test]
fn a_header_says_what_the_host_must_know() {
    let header = read("intersector", RIGHT).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((header.name.as_str(), header.meaning.as_str()), ("my-test", "mine"));
    assert_eq!((header.number("record_floats"), header.word("prepared_for")), (Some(9), "any-ray"));
    assert_eq!((header.number("operations"), header.word("memory")), (None, ""));
    let contradicts: Vec<_> = header
        .contradicts
        .iter()
        .map(|other| (other.axis, other.value.as_str(), other.because.as_deref()))
        .collect();
    let because = Some("I say so");
    assert_eq!(contradicts, [("culling", "back", because), ("math", "fast", because)]);
}

#[test]
fn blanks_around_the_equals_sign_of_a_contradiction_do_not_matter() {
    let text = RIGHT.replacen("culling=back", "culling = back", 1);
    let header = read("intersector", &text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((header.contradicts[0].axis, header.contradicts[0].value.as_str()), ("culling", "back"));
}

#[test]
fn prose_may_have_colons_and_addresses() {
    let text = RIGHT.replacen("see below", "see\n// https://example.org/a.pdf", 1);
    assert_eq!(read("intersector", &text).map(|header| header.meaning).unwrap_or_default(), "mine");
}

/// Replaces a line of the correct header by a mistake; checks the error's message, its line number, and its
/// remedy.
fn mistake(line: &str, by: &str, said: &str, help: &str) {
    let text = RIGHT.replacen(line, by, 1);
    assert_ne!(text, RIGHT, "{line} is not in it");
    let error = read("intersector", &text).err().unwrap_or_else(|| panic!("{by} is taken"));
    let message = error.to_string();
    assert!(message.starts_with("kernels/cast/intersect/my_test.cl, "), "{message}");
    assert!(message.contains(said), "{message} does not say {said}");
    assert!(format!("{error:?}").contains(help), "{error:?} does not help with {help}");
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn what_is_missing_is_reported_with_what_to_write() {
    mistake("// meaning: mine\n", "", "line 1: the file's header has no 'meaning'", "`// meaning: ...`");
    mistake("// record_floats: 9\n", "", "line 1: the file's header has no 'record_floats'", "1 to 64");
    mistake("// prepared_for: any-ray\n", "", "has no 'prepared_for'", "any-ray or origin or pixels or tile");
    mistake(
        "// A test of mine: see below.\n",
        "int x;\n",
        "line 1: the file has no header: it does not begin with a `//` comment; 'meaning' is only in line 2",
        "docs/own-kernels.md",
    );
}

#[test]
fn a_key_without_its_colon_is_reported_with_its_line() {
    let said = |line: usize, key: &str| {
        format!("line {line}: the header's key '{key}' is not directly followed by a colon")
    };
    for by in ["// exact_signs no\n", "// exact_signs = no\n", "// exact_signs : no\n"] {
        mistake("// exact_signs: no\n", by, &said(5, "exact_signs"), "write `// exact_signs: no`");
    }
    mistake("// meaning: mine\n", "// meaning mine\n", &said(2, "meaning"), "write `// meaning: mine`");
    let other = "// exact_signs_of mine\n";
    mistake("// exact_signs: no\n", other, "line 1: the file's header has no 'exact_signs'", "yes or no");
}

#[test]
fn a_header_that_is_not_at_the_files_start_is_reported_with_its_line() {
    let not_a_comment = "line 1: the file has no header: it does not begin with a `//` comment";
    for (start, said) in [
        ("\n\n", format!("{not_a_comment}; 'meaning' is only in line 4")),
        ("#pragma once\n", format!("{not_a_comment}; 'meaning' is only in line 3")),
        ("//\n", "has no 'meaning' (the value's meaning, in a line); 'meaning' is only in line 3".to_owned()),
    ] {
        mistake("// A test of", &format!("{start}// A test of"), &said, "`// meaning: ...`");
    }
    for (text, said) in [
        ("", not_a_comment.to_owned()),
        (
            "/* meaning: mine\n   record_floats: 9 */\n",
            format!("{not_a_comment}; 'meaning' is only in line 1"),
        ),
    ] {
        let message = read("intersector", text).map(|_| ()).unwrap_err().to_string();
        assert!(message.ends_with(&said), "{message}");
    }
}

#[test]
fn a_wrong_value_has_its_line_what_was_expected_and_the_nearest() {
    mistake("meaning: mine", "meaning:", "line 2: 'meaning' is empty", "docs/own-kernels.md");
    mistake(
        "floats: 9",
        "floats: nine",
        "line 3: 'nine' is not a valid 'record_floats'; expected 1 to 64",
        "docs/own-kernels.md",
    );
    mistake("floats: 9", "floats: 65", "line 3: '65' is not a valid 'record_floats'", "docs/own-kernels.md");
    mistake(
        "any-ray",
        "anyray",
        "line 4: 'anyray' is not a valid 'prepared_for'; expected any-ray or",
        "'any-ray'",
    );
    mistake(
        "signs: no",
        "signs: nope",
        "line 5: 'nope' is not a valid 'exact_signs'; expected yes or no",
        "docs/own-kernels.md",
    );
    mistake(
        "record_floats",
        "record_float",
        "line 3: 'record_float' is not a key in headers of the axis 'inter",
        "'record_floats'",
    );
    mistake(
        "exact_signs: no",
        "memory: local",
        "line 5: 'memory' is not a key in headers of the axis 'inter",
        "docs/own-kernels.md",
    );
}

#[test]
fn a_contradiction_names_a_value_of_another_axis() {
    mistake("culling=back", "culling", "line 6: 'culling' is not axis=value", "docs/own-kernels.md");
    mistake(
        "culling=back",
        "cullin=back",
        "line 6: 'contradicts' in a header of the axis 'intersector' cannot name 'cullin'",
        "'culling'",
    );
    mistake("culling=back", "culling=bakc", "line 6: 'bakc' is not a value of culling", "'back'");
    mistake(
        "culling=back",
        "intersector=my-test",
        "line 6: 'contradicts' in a header of the axis 'intersector' cannot name 'intersector'",
        "",
    );
}

#[test]
fn a_test_in_the_folder_of_families_without_tiles_is_not_prepared_for_a_tile() {
    mistake(
        "any-ray",
        "tile",
        "line 4: 'prepared_for' is tile, but the kernels that include files of cast/intersect/ have no tiles of rays",
        "docs/own-kernels.md",
    );
}

#[test]
fn a_test_with_exact_signs_includes_the_file_that_forbids_contraction() {
    mistake(
        "exact_signs: no",
        "exact_signs: yes",
        "line 5: 'exact_signs' is yes, but the file does not include common/exact_signs.cl",
        "between the header and the first function",
    );
    let yes = RIGHT.replace("exact_signs: no", "exact_signs: yes");
    let with_include = format!("{yes}\n#include \"common/exact_signs.cl\"\n");
    let header = read("intersector", &with_include).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(header.word("exact_signs"), "yes");
}

#[test]
fn a_header_that_contradicts_itself_has_both_lines() {
    mistake(
        "// exact_signs: no\n",
        "// exact_signs: no\n// exact_signs: yes\n",
        "line 6: 'exact_signs' occurs twice: first in line 5",
        "",
    );
    mistake("mine\n", "mine\n// meaning: yours\n", "line 3: 'meaning' occurs twice: first in line 2", "");
    for planes in ["origin", "pixels"] {
        mistake(
            "any-ray",
            planes,
            "line 3: 'record_floats' is 9; expected 12, since 'prepared_for' in line 4 is origin or pixels",
            "",
        );
    }
}
