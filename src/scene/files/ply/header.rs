//! The header of a PLY file. The crate `ply-rs-bw` reads only headers in the form that PLY defines. If a
//! program wrote a header in another form, raycl converts the header to PLY's form before `ply-rs-bw` reads
//! it.

use super::colour::with_lower_case;
use super::elements::with_usual_normal;
use crate::scene::files::flaw::Flaw;
use crate::scene::obj::quoted;
use std::borrow::Cow;
use std::collections::HashMap;

/// The first words of the lines that PLY defines for a header.
const WORDS: [&str; 7] = ["ply", "format", "comment", "obj_info", "element", "property", "end_header"];
/// The names that PLY defines for types of numbers.
const TYPES: [&str; 16] = [
    "char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8", "int16", "uint16",
    "int32", "uint32", "float32", "float64",
];
/// The longest header that is read, in bytes.
const MAX_BYTES: usize = 1 << 20;

/// A file whose header was converted to the form that PLY defines.
pub(super) struct Tidied<'a> {
    /// The lines of the header. Each line has the same number as in the file.
    pub header: String,
    /// The bytes after the header.
    pub payload: &'a [u8],
    /// The number of lines that are empty, or whose first word PLY does not define. For example, some exporters
    /// write their name into a line without the word `comment`. In `header`, such lines are turned into
    /// comments.
    pub strange: usize,
    /// The names that elements and properties have in the file. The key of an element is its name in `header` and
    /// an empty text. The key of a property is the name of its element and its own name, both as in `header`.
    pub names: HashMap<[String; 2], String>,
}

/// Brings a file's header into the form that PLY defines: UTF-8 without a byte order mark, with line feeds as
/// its only line ends, and without blanks before a line. Empty lines, and lines whose first word PLY does not
/// define, become comments. In the converted header, no two elements have the same name, and no two properties
/// of an element have the same name. Names of colour channels and of normals have their usual spelling. Fails if the
/// first line is `ply` but the header is longer than [`MAX_BYTES`].
pub(super) fn tidied(bytes: &[u8]) -> Result<Tidied<'_>, Flaw> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut tidied = Tidied { header: String::new(), payload: &[], strange: 0, names: HashMap::new() };
    let mut names = Names::default();
    let (head, mut rest) = (&bytes[..bytes.len().min(MAX_BYTES)], bytes);
    let end = line_end(head);
    let mut is_read = head.len() == bytes.len();
    for line in head.split(|&byte| byte == end) {
        rest = &rest[(line.len() + 1).min(rest.len())..];
        let text = String::from_utf8_lossy(line);
        let words: Vec<Cow<str>> = text.split_ascii_whitespace().map(Cow::Borrowed).collect();
        let is_known = words.first().is_some_and(|word| WORDS.contains(&&**word));
        if !is_known {
            tidied.header += "comment ";
            tidied.strange += 1;
        }
        tidied.header += &names.replaced(words).join(" ");
        tidied.header.push('\n');
        if line.trim_ascii() == b"end_header" {
            tidied.payload = rest;
            is_read = true;
            break;
        }
    }
    tidied.names = names.names;
    // If the first line is not `ply`, the file is refused later with a message about this line.
    let is_ply = tidied.header.lines().next().is_some_and(|line| line.trim_end().eq_ignore_ascii_case("ply"));
    if is_read || !is_ply { Ok(tidied) } else { Err(too_long()) }
}

/// Returns the error for a header that is longer than `MAX_BYTES`.
fn too_long() -> Flaw {
    Flaw::from(format!(
        "no line `end_header` in the first {MAX_BYTES} bytes; expected a header of at most this size"
    ))
    .with_remedy("export the file with fewer comments in its header, or convert it to OBJ")
}

/// Returns the error for the line `number`, from 1, of a header that the crate `ply-rs-bw` refuses. Returns
/// `None` if this function has no better message than `ply-rs-bw`.
pub(super) fn mistake(header: &str, number: usize) -> Option<Flaw> {
    let before = || header.lines().take(number.saturating_sub(1));
    let line = header.lines().nth(number.checked_sub(1)?)?;
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let flaw: Flaw = match words[..] {
        _ if number == 1 => "expected `ply` as the first line".into(),
        ["format", ..] if before().any(|other| other.starts_with("format ") && other != line) => {
            "two different `format` lines".into()
        }
        ["format", ..] => "expected `format ascii 1.0`, `format binary_little_endian 1.0` or \
                           `format binary_big_endian 1.0`"
            .into(),
        ["element", ..] => "expected `element NAME COUNT`".into(),
        ["property", ..] if !before().any(|other| other.starts_with("element ")) => {
            "a `property` before the first `element`".into()
        }
        ["property", "list", count, item, _] => of_types(&[count, item]),
        ["property", of, _] => of_types(&[of]),
        ["property", ..] => of_types(&[]),
        _ => return None,
    };
    Some(flaw)
}

/// Returns the error for the header line of a property. `types` has the names of the types in this line.
fn of_types(types: &[&str]) -> Flaw {
    match types.iter().find(|of| !TYPES.contains(of)) {
        Some(unknown) => {
            let what = format!("unknown type {}", quoted(unknown.as_bytes()));
            let expected = format!("expected {}", TYPES.join(", "));
            Flaw::quoting(format!("{what}; {expected}"), format!("unknown type; {expected}"))
        }
        None => "expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into(),
    }
}

/// Returns the byte that ends each line of a header. This byte is CR if the first line ends with a CR that no
/// LF follows, and otherwise LF. Only the first line is examined: after the header's last line, a binary file
/// has data, which may begin with a byte equal to LF.
fn line_end(head: &[u8]) -> u8 {
    match head.iter().position(|&byte| byte == b'\n' || byte == b'\r') {
        Some(at) if head[at] == b'\r' && head.get(at + 1) != Some(&b'\n') => b'\r',
        _ => b'\n',
    }
}

/// The names in the lines of the header that were read so far.
#[derive(Default)]
struct Names {
    /// The map [`Tidied::names`].
    names: HashMap<[String; 2], String>,
    /// The last element's name in the tidied header.
    element: String,
    line: usize,
}

impl Names {
    /// Returns the words of the next line. The name of an element or a property is replaced if `ply-rs-bw`
    /// would refuse the name. `ply-rs-bw` refuses names that occur twice, and names with characters that PLY
    /// does not define, such as brackets. The name of a colour channel or of a normal gets its usual spelling.
    fn replaced<'a>(&mut self, mut words: Vec<Cow<'a, str>>) -> Vec<Cow<'a, str>> {
        self.line += 1;
        let is_element = match words.first().map(|word| &**word) {
            Some("element") => true,
            Some("property") => false,
            _ => return words,
        };
        let at = if is_element { 1 } else { (words.len() - 1).max(1) };
        if let Some(name) = words.get_mut(at) {
            let key = |valid: &String| match is_element {
                true => [valid.clone(), String::new()],
                false => [self.element.clone(), valid.clone()],
            };
            let mut valid = with_usual_normal(with_lower_case(valid(name)));
            while self.names.contains_key(&key(&valid)) {
                valid = format!("{valid}_{}", self.line);
            }
            self.names.insert(key(&valid), name.to_string());
            if is_element {
                self.element.clone_from(&valid);
            }
            *name = Cow::Owned(valid);
        }
        words
    }
}

/// Returns the name with `_` in place of each character that PLY does not define, and with `_` before a first
/// character that is neither a letter nor `_`.
fn valid(name: &str) -> String {
    let is_valid = |char: char| char.is_ascii_alphanumeric() || char == '_' || char == '-';
    let name: String = name.chars().map(|char| if is_valid(char) { char } else { '_' }).collect();
    if name.starts_with(|char: char| char.is_ascii_alphabetic() || char == '_') {
        name
    } else {
        "_".to_owned() + &name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8]) -> (String, &[u8], usize) {
        let Tidied { header, payload, strange, .. } = tidied(bytes).unwrap();
        (header, payload, strange)
    }

    #[test]
    fn strange_lines_become_comments_and_data_stays() {
        let plain = &b"ply\r\nformat ascii 1.0\r\ncomment a\r\nend_header\r\nBlender 1\r\n"[..];
        let header = "ply\nformat ascii 1.0\ncomment a\nend_header\n";
        assert_eq!(of(plain), (header.to_owned(), &b"Blender 1\r\n"[..], 0));
        let strange = b"ply\nformat ascii 1.0\nCreated by Blender\n\nend_header\nBlender\n";
        let header = "ply\nformat ascii 1.0\ncomment Created by Blender\ncomment \nend_header\n";
        assert_eq!(of(strange), (header.to_owned(), &b"Blender\n"[..], 2));
        let header = "ply\ncomment Blender\nend_header\n".to_owned();
        assert_eq!(of(b"ply\r\nBlender\r\nend_header\r\nBlender\r\n"), (header, &b"Blender\r\n"[..], 1));
        assert_eq!(of(b"ply\nBlender").0, "ply\ncomment Blender\n", "the header has no end");
    }

    #[test]
    fn a_header_ends_with_its_own_line_end_and_the_data_begin_with_any_byte() {
        for (end, data) in [("\n", "\nabc"), ("\r\n", "\nabc"), ("\r", "\nabc"), ("\n", ""), ("\r", "")] {
            let text = format!("ply{end}format ascii 1.0{end}end_header{end}{data}");
            let header = "ply\nformat ascii 1.0\nend_header\n".to_owned();
            assert_eq!(of(text.as_bytes()), (header, data.as_bytes(), 0), "{end:?}");
        }
    }

    #[test]
    fn a_header_may_be_as_long_as_the_limit_but_no_longer() {
        let header = |bytes: usize| {
            let [start, end] = ["ply\ncomment ", "\nend_header"];
            format!("{start}{}{end}\n1 2 3\n", "a".repeat(bytes - start.len() - end.len()))
        };
        assert_eq!(of(header(MAX_BYTES).as_bytes()).1, b"1 2 3\n");
        assert!(tidied(header(MAX_BYTES + 1).as_bytes()).is_err());
        assert!(tidied(format!("ply\n{}", " ".repeat(MAX_BYTES)).as_bytes()).is_err());
        // `tidied` accepts a long file that is no PLY, because a later check refuses the file's first line.
        assert!(tidied(" ".repeat(MAX_BYTES + 1).as_bytes()).is_ok());
        // `tidied` also accepts a file of exactly `MAX_BYTES` bytes without `end_header`, because a later
        // check reports the file's mistake.
        assert!(tidied(" ".repeat(MAX_BYTES).as_bytes()).is_ok());
    }

    #[test]
    fn a_header_of_other_programs_is_tidied() {
        let text =
            b"\xef\xbb\xbfply\n comment G\xe4nse\n\telement vertex 1 \n property  float\tx\nend_header\n";
        let header = "ply\ncomment G\u{fffd}nse\nelement vertex 1\nproperty float x\nend_header\n";
        assert_eq!(of(text), (header.to_owned(), &b""[..], 0));
    }

    #[test]
    fn names_that_are_not_valid_or_occur_twice_are_replaced() {
        let lines = |text: &str| of(text.as_bytes()).0.lines().map(str::to_owned).collect::<Vec<_>>();
        let text = "element vertex 1\nproperty float x\nproperty float scalar_R_(0.1)\nproperty float scalar_R_[0.1]\n\
            property float 8\nproperty float x\nelement face 1\nproperty list uchar int x\nelement vertex 2\nproperty";
        let names: Vec<_> =
            lines(text).iter().map(|line| line.rsplit(' ').next().unwrap().to_owned()).collect();
        let expected =
            ["1", "x", "scalar_R__0_1_", "scalar_R__0_1__4", "_8", "x_6", "1", "x", "2", "property"];
        assert_eq!(names, expected);
        assert_eq!(lines(text)[8], "element vertex_9 2");
        let originals = tidied(text.as_bytes()).unwrap().names;
        let original = |key: [&str; 2]| originals[&key.map(str::to_owned)].as_str();
        let keys = [["vertex_9", ""], ["vertex", "x_6"], ["vertex", "scalar_R__0_1__4"], ["face", "x"]];
        assert_eq!(keys.map(original), ["vertex", "x", "scalar_R_[0.1]", "x"]);
    }
}
