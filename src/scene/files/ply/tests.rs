//! Tests with small PLY files.

mod unread;

use super::*;

fn parse(name: &str, bytes: &[u8]) -> Result<MeshFile> {
    super::parse(Named { name, quotes: true }, bytes, Limit::Usual)
}

const SQUARE: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty double x\nproperty double y\n\
    property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n\
    500000 5400000 0 255 0 0\n500001 5400000 0 255 0 0\n500001 5400001 0 255 0 0\n500000 5400001 0 255 0 0\n4 0 1 2 3\n0 1\n";

#[test]
fn a_square_of_a_map_is_two_red_triangles_around_its_middle() {
    let file = parse("a.ply", SQUARE.as_bytes()).unwrap();
    assert_eq!((file.mesh.triangles.len(), file.mesh.materials.len()), (2, 1));
    assert_eq!(file.mesh.materials[0].lambertian, Vec3::X);
    assert_eq!(file.placement.origin, DVec3::new(500000.5, 5400000.5, 0.0));
    assert_eq!(file.mesh.positions[0], Vec3::new(-0.5, -0.5, 0.0));
    assert!(file.notes.iter().any(|note| note.contains("(`edge` 1)")), "{:?}", file.notes);
    assert!(file.mesh.corner_colours.is_empty());
}

/// Two faces in one plane: a red triangle, and a square that is green with half the intensity. After the
/// faces, the file has a strip without a colour.
const PAINTED: &str = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n\
    property uchar blue\nelement tristrips 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n3 1 4 2 255 0 0\n4 0 1 2 3 0 188 0\n3 0 2 4\n";

/// Returns the colour of each triangle.
fn triangle_colours(file: &MeshFile) -> Vec<Vec3> {
    file.mesh.triangles.iter().map(|triangle| file.mesh.material(triangle).lambertian).collect()
}

#[test]
fn triangles_get_the_colours_of_their_faces_unless_vertices_have_colours() {
    let file = parse("a.ply", PAINTED.as_bytes()).unwrap();
    assert!(file.mesh.materials.len() == 3 && file.notes.is_empty(), "{:?}", file.notes);
    let green = Vec3::Y * colours::linear(188.0 / 255.0);
    let near = |actual: &Vec3, expected: &Vec3| (*actual - *expected).abs().max_element() < 2e-3;
    // The square is two triangles. The strip has the colour of a mesh without colours, rounded to 8 bits.
    let expected = [Vec3::X, green, green, Vec3::splat(0.8)];
    let actual = triangle_colours(&file);
    assert!(actual.len() == 4 && actual.iter().zip(&expected).all(|(a, b)| near(a, b)), "{actual:?}");
    // Faces cause the same notes as vertices: on their alpha, and on channels above 1.
    let clear = PAINTED.replace("property uchar blue\n", "property uchar blue\nproperty uchar alpha\n");
    let clear = clear.replace("255 0 0\n", "255 0 0 7\n").replace("0 188 0\n", "0 188 0 255\n");
    let file = parse("a.ply", clear.as_bytes()).unwrap();
    assert_eq!(triangle_colours(&file), actual);
    assert_eq!(file.notes, ["alpha of 1 face is not used: every surface is opaque"]);
    let bright = PAINTED.replace("uchar red", "float red").replace("uchar green", "float green");
    let notes = parse("a.ply", bright.as_bytes()).unwrap().notes;
    assert_eq!(notes, ["2 faces with a colour outside 0 to 1 are shown with channels limited to this range"]);
    // If the vertices also have a colour, here blue, the colours of the faces are not used.
    let vertices = "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
    let both = PAINTED.replace("property float z\n", vertices);
    let (header, data) = both.split_once("end_header\n").unwrap();
    let lines = data.lines().enumerate();
    let data = lines.map(|(at, line)| if at < 5 { format!("{line} 0 0 255\n") } else { format!("{line}\n") });
    let text = format!("{header}end_header\n{}", data.collect::<String>());
    let file = parse("a.ply", text.as_bytes()).unwrap();
    assert_eq!(triangle_colours(&file), [Vec3::Z; 4]);
    assert!(file.notes.contains(&"colours of 2 faces are not used, since vertices have colours".to_owned()));
}

#[test]
fn channels_that_are_not_whole_numbers_may_be_from_0_to_255() {
    let of = |red: &str, type_of_blue: &str| {
        let text = PAINTED
            .replace("uchar red", "float red")
            .replace("uchar green", "double green")
            .replace("uchar blue", &format!("{type_of_blue} blue"))
            .replace("255 0 0\n", &format!("{red} 0 0\n"));
        let file = parse("a.ply", text.as_bytes()).unwrap();
        (triangle_colours(&file), file.notes)
    };
    let bytes = parse("a.ply", PAINTED.as_bytes()).unwrap();
    assert_eq!(of("255", "float"), (triangle_colours(&bytes), Vec::new()));
    let note = "2 faces with a colour outside 0 to 1 are shown with channels limited to this range";
    assert_eq!(of("255", "uchar").1, [note], "blue has a known range");
    let dark = ["red", "green", "blue"].iter().fold(PAINTED.to_owned(), |text, channel| {
        text.replace(&format!("uchar {channel}"), &format!("float {channel}"))
    });
    let dark = dark.replace("255 0 0\n", "7 0 0\n").replace("0 188 0\n", "0 1 0\n");
    let notes = parse("a.ply", dark.as_bytes()).unwrap().notes;
    assert_eq!(
        notes,
        ["channels of colours are read as numbers from 0 to 255, not from 0 to 1, since one of them is 7"]
    );
}

#[test]
fn names_of_colour_channels_may_have_capitals() {
    for (text, colours) in [(SQUARE, vec![Vec3::X; 2]), (PAINTED, Vec::new())] {
        let plain = parse("a.ply", text.as_bytes()).unwrap();
        let mut capitals = text.to_owned();
        for (from, to) in
            [("uchar red", "uchar Red"), ("uchar green", "uchar GREEN"), ("uchar blue", "uchar Blue")]
        {
            assert!(capitals.contains(from));
            capitals = capitals.replace(from, to);
        }
        let file = parse("a.ply", capitals.as_bytes()).unwrap();
        assert_eq!((&file.mesh, &file.notes), (&plain.mesh, &plain.notes));
        assert!(colours.is_empty() || triangle_colours(&file) == colours);
    }
}

#[test]
fn the_list_of_a_faces_corners_has_one_of_two_names() {
    let mesh = |text: &str| parse("a.ply", text.as_bytes()).unwrap().mesh;
    assert_eq!(mesh(&SQUARE.replace("vertex_indices", "vertex_index")), mesh(SQUARE));
}

#[test]
fn colours_of_16_bits_are_read_as_those_of_8_bits_are() {
    let colour = |text: &str| parse("a.ply", text.as_bytes()).unwrap().mesh.materials[0].lambertian;
    let wide = SQUARE.replace("property uchar", "property ushort").replace(" 255 0 0", " 13107 0 0");
    // The fractions 13107/65535 and 51/255 are equal.
    assert_eq!(colour(&wide), colour(&SQUARE.replace(" 255 0 0", " 51 0 0")));
}

#[test]
fn binary_files_of_both_orders_and_strips() {
    let header = |order: &str| {
        format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\nelement tristrips 1\n\
             property list int int vertex_indices\nend_header\n"
        )
    };
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0_f32]];
    let floats: Vec<f32> = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0, 0.0, 0.0, 1.0]).collect();
    let ints = [6_i32, 0, 1, 2, 3, -1, 0];
    let little: Vec<u8> = floats
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .chain(ints.iter().flat_map(|v| v.to_le_bytes()))
        .collect();
    let big: Vec<u8> = floats
        .iter()
        .flat_map(|v| v.to_be_bytes())
        .chain(ints.iter().flat_map(|v| v.to_be_bytes()))
        .collect();
    for (order, payload) in [("little", little), ("big", big)] {
        let mesh = parse("a.ply", &[header(order).into_bytes(), payload].concat()).unwrap().mesh;
        let corners: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.positions).collect();
        assert_eq!(corners, [[0, 1, 2], [2, 1, 3]], "{order}");
        assert_eq!(mesh.corner_normals(&mesh.triangles[1]), [Vec3::Z; 3]);
    }
}

#[test]
fn mistakes_are_reported_without_the_files_text() {
    for (from, to, message) in [
        ("4 0 1 2 3", "4 0 1 2 9", "a.ply: face 0 has a vertex that does not exist"),
        ("4 0 1 2 3\n0 1\n", "", "a.ply"),
        ("500000 5400000 0 255 0 0\n", "500000 secret 0 255 0 0\n", "a.ply:17"),
        ("500000 5400000 0 255 0 0\n", "500000 5400000 0 255 0\n", "a.ply:17: the line has fewer numbers"),
        ("element vertex 4", "element vertex many", "a.ply:4"),
        ("comment made by hand", "property int secret", "a.ply:3"),
        ("element edge 1", "element secret 99", "a.ply: the file is too short"),
        ("element edge 1", "element secret 2", "a.ply"),
        ("4 0 1 2 3\n0 1\n", "4 0 1 2 3\n0 secret\n", "a.ply:22: a value is not valid; expected a whole"),
    ] {
        let text = SQUARE.replacen(from, to, 1);
        let error_of = |quotes| {
            super::parse(Named { name: "a.ply", quotes }, text.as_bytes(), Limit::Usual).err().unwrap()
        };
        let [shown, error] = [true, false].map(|quotes| error_of(quotes).to_string());
        assert!(error.contains(message) && !error.contains("secret") && !error.contains('\n'), "{error}");
        assert!(!shown.contains('\n'), "{shown}");
    }
}

#[test]
fn a_value_that_is_not_valid_is_named() {
    for (from, to, message) in [
        ("500000 5400000 0 255 0 0\n", "500000 secret 0 255 0 0\n", "a.ply:17: `secret`; expected a decimal"),
        ("4 0 1 2 3", "4 0 1 2 1.5", "a.ply:21: `1.5`; expected a whole number"),
        ("0 255 0 0\n", "0 256 0 0\n", "a.ply:17: `256`; expected a whole number in the range of its type"),
        ("element face 1", "element face 3", "a.ply: the file ends after 2 of 3 elements `face`"),
    ] {
        let error = parse("a.ply", SQUARE.replacen(from, to, 1).as_bytes()).err().unwrap().to_string();
        assert!(error.starts_with(message), "{error}");
    }
}

#[test]
fn a_line_of_a_header_that_is_not_valid_is_reported_with_what_was_expected() {
    for (from, to, message) in [
        ("ply\n", "PLY\n", "1: expected `ply` as the first line"),
        ("comment made by hand", "format binary_big_endian 1.0", "3: two different `format` lines"),
        (
            "format ascii 1.0",
            "format text 1.0",
            "2: expected `format ascii 1.0`, `format binary_little_endian 1.0` or",
        ),
        ("element vertex 4", "element vertex many", "4: expected `element NAME COUNT`"),
        ("comment made by hand", "property int a", "3: a `property` before the first `element`"),
        ("double x", "int64 x", "5: unknown type `int64`; expected char, uchar, short, "),
        ("list uchar int vertex", "list uchar int64 vertex", "12: unknown type `int64`; expected char, "),
        ("list uchar int vertex", "list int64 int vertex", "12: unknown type `int64`; expected char, "),
        (
            "list uchar int vertex",
            "list uchar vertex",
            "12: expected `property TYPE NAME` or `property list TYPE",
        ),
    ] {
        let text = SQUARE.replacen(from, to, 1);
        let error_of = |quotes| {
            super::parse(Named { name: "a.ply", quotes }, text.as_bytes(), Limit::Usual).err().unwrap()
        };
        let [shown, withheld] = [true, false].map(|quotes| error_of(quotes).to_string());
        assert!(shown.starts_with(&format!("a.ply:{message}")), "{shown}");
        assert_eq!(withheld, shown.replace(" `int64`;", ";"), "a word of the file is withheld");
    }
    let twice = SQUARE.replacen("comment made by hand", "format ascii 1.0", 1);
    assert!(parse("a.ply", twice.as_bytes()).is_ok());
}

#[test]
fn an_ascii_file_may_have_numbers_of_every_form_and_any_line_ends() {
    let mesh = parse("a.ply", SQUARE.as_bytes()).unwrap().mesh;
    let forms =
        SQUARE.replace("500000 5400000 0 255", "+500000. 54e5 .0 255.0").replace("4 0 1", "\n 4.0 +0\t1");
    for text in [forms.clone(), forms.replace('\n', "\r"), forms.replace('\n', "\r\n")] {
        assert_eq!(parse("a.ply", text.as_bytes()).unwrap().mesh, mesh, "{text:?}");
    }
    // The test adds a vertex whose coordinates are not all finite. The file's face does not use this vertex.
    let points = SQUARE.replace("element vertex 4", "element vertex 5");
    for point in ["nan NaN -nan", "inf -inf 0", "Infinity 1e400 0"] {
        let text = points.replacen("4 0 1 2 3", &format!("{point} 0 0 0\n4 0 1 2 3"), 1);
        let file = parse("a.ply", text.as_bytes()).unwrap();
        assert_eq!(file.mesh.triangles.len(), 2, "{point}");
        let note = "1 vertex that no face uses is ignored: a coordinate is not finite or beyond +-1e12";
        assert!(file.notes.iter().any(|other| other == note), "{point}: {:?}", file.notes);
    }
}

#[test]
fn headers_of_other_programs_are_read() {
    let mesh = parse("a.ply", SQUARE.as_bytes()).unwrap().mesh;
    let header = SQUARE
        .replace("comment made by hand", " comment by G\u{e4}nse")
        .replace("property uchar blue", "property uchar blue\n property float scalar_Roughness_(0.1)")
        .replace("255 0 0\n", "255 0 0 0.5\n");
    let latin1: Vec<u8> = header.chars().map(|char| char as u8).collect();
    for bytes in [latin1.clone(), [&b"\xef\xbb\xbf"[..], &latin1].concat()] {
        let file = parse("a.ply", &bytes).unwrap();
        assert_eq!(file.mesh, mesh);
        assert!(!file.notes.iter().any(|note| note.contains("in the header")), "{:?}", file.notes);
    }
}

/// The first two headers of this test state elements without properties. If raycl did not refuse the first
/// header, it would run out of memory. If raycl did not refuse the second header, it would read forever.
#[test]
fn a_header_that_states_more_elements_than_the_file_can_hold_is_refused() {
    let message_of = |format: &str, elements: &str, data: &str| {
        let text = format!("ply\nformat {format} 1.0\n{elements}\nend_header\n{data}");
        parse("a.ply", text.as_bytes()).err().unwrap().to_string()
    };
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for elements in ["element vertex 100000000000", "element odd 18446744073709551615"] {
            let message = message_of(format, elements, "");
            assert!(message.starts_with("a.ply: the header has elements without properties (`"), "{message}");
        }
        for (property, data) in [
            ("uchar x", "1 2 3 4"),
            ("list uchar int vertex_indices", "0 0 0 0"),
            ("double x", "12345678901234567890"),
        ] {
            for count in ["11", "100000000000", "18446744073709551615"] {
                let message =
                    message_of(format, &format!("element vertex {count}\nproperty {property}"), data);
                let elements = counted(count.parse().unwrap(), "element");
                let states = format!("the file is too short: its header states {elements} `vertex`");
                let left = format!("but only {} bytes are left for them", data.len());
                assert!(message.starts_with(&format!("a.ply: {states}")), "{message}");
                assert!(message.contains(&left), "{message}");
            }
        }
    }
    // In an ASCII file, no separator need follow the last number.
    let message = message_of("ascii", "element vertex 4\nproperty uchar x", "1 2 3 4");
    assert!(!message.contains("too short"), "{message}");
    let two =
        "element vertex 2\nproperty double x\nelement face 3\nproperty list ushort short a\nproperty float b";
    let message = message_of("binary_little_endian", two, &"x".repeat(33));
    let expected = "the file is too short: its header states 3 elements `face` of at least 6 bytes each, but only 17 \
                    bytes are left for them";
    assert_eq!(message, format!("a.ply: {expected}"));
    let message = message_of("binary_little_endian", "element vertex 1\nproperty short x", "x");
    let expected = "1 element `vertex` of at least 2 bytes each, but only 1 byte is left for them";
    assert!(message.ends_with(expected), "{message}");
    // Four numbers of one digit and the three blanks between them take 7 bytes.
    let four = "ply\nformat ascii 1.0\nelement vertex 4\nproperty uchar x\nend_header\n";
    let header = Parser::<Skipped>::new().read_header(&mut Reader::new(four.as_bytes())).unwrap();
    assert!(check_sizes(&header, 7).is_ok() && check_sizes(&header, 6).is_err());
}

#[test]
fn what_a_header_needs_is_held_against_the_memory() {
    let header_with = |vertices: usize, properties: &str, faces: usize| {
        let elements = format!("element vertex {vertices}\n{properties}element face {faces}\n");
        let text = format!("ply\nformat ascii 1.0\n{elements}end_header\n");
        Parser::<Skipped>::new().read_header(&mut Reader::new(text.as_bytes())).unwrap()
    };
    let header = |vertices: usize, faces: usize| header_with(vertices, "", faces);
    assert!(hold("a.ply", &header(1000, 1000)).is_ok());
    // A face's list of corners takes a separate block of memory.
    let (face, list, triangle) = (size_of::<Face>() as u64, 32, 28);
    assert_eq!(FACE_BYTES, face + list + triangle);
    for (vertices, faces) in [(1 << 50, 0), (0, 1 << 50)] {
        let message = hold("a.ply", &header(vertices, faces)).unwrap_err().to_string();
        let sum =
            format!("({VERTEX_BYTES} B x {vertices} vertices + {FACE_BYTES} B x {faces} faces or strips = ");
        assert!(message.starts_with("reading a.ply needs about") && message.contains(&sum), "{message}");
    }
    // If only faces have colours, each face needs more memory while the file is read: for a copy of the face with its
    // colour, and for the colour of one triangle.
    let painted = "element face 1000\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
    let text = format!("ply\nformat ascii 1.0\nelement vertex {}\n{painted}end_header\n", 1_u64 << 50);
    let header = Parser::<Skipped>::new().read_header(&mut Reader::new(text.as_bytes())).unwrap();
    let message = hold("a.ply", &header).unwrap_err().to_string();
    let face = FACE_BYTES + FACE_COLOUR_BYTES;
    assert!(
        message.contains(&format!(" + {face} B x 1000 faces or strips + {COLOUR_BYTES} B x 1000 colours")),
        "{message}"
    );
    // Each face may have a different colour, so the number of colours is estimated as the number of faces. The
    // estimate is at most 2^24, the number of all colours with 8 bits per channel.
    let colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    for (vertices, faces, colour_count) in [(1 << 50, 1000, 1000), (1 << 50, 1 << 30, 1 << 24)] {
        let message = hold("a.ply", &header_with(vertices, colours, faces)).unwrap_err().to_string();
        let sum = format!("{faces} faces or strips + {COLOUR_BYTES} B x {colour_count} colours = ");
        assert!(message.contains(&sum), "{message}");
    }
}

#[test]
fn a_header_above_the_limit_is_refused_with_the_limit() {
    let text = SQUARE.replacen("comment made by hand", &"comment by hand\n".repeat(1 << 16), 1);
    let error = parse("a.ply", text.as_bytes()).err().unwrap();
    let expected =
        "a.ply: no line `end_header` in the first 1048576 bytes; expected a header of at most this size";
    assert_eq!(error.to_string(), expected);
    assert!(!error.remedy().contains("damaged"), "{}", error.remedy());
}

#[test]
fn a_line_that_is_not_plys_is_ignored_with_a_note() {
    for (lines, expected) in [
        ("Created", "ignored 1 line in the header: it does not begin with a keyword of PLY"),
        ("Created\n\nCreated", "ignored 3 lines in the header: they do not begin with a keyword of PLY"),
    ] {
        let file = parse("a.ply", SQUARE.replacen("comment made", lines, 1).as_bytes()).unwrap();
        assert_eq!(file.mesh.triangles.len(), 2);
        assert!(file.notes.iter().any(|note| note == expected), "{:?}", file.notes);
    }
}

#[test]
fn alpha_of_vertices_is_noted() {
    for [red, green, blue, name] in [
        ["red", "green", "blue", "alpha"],
        ["diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"],
        ["diffuse_red", "diffuse_green", "diffuse_blue", "Diffuse_Alpha"],
        ["r", "g", "b", "a"],
        ["diffuse_red", "diffuse_green", "diffuse_blue", "alpha"],
        ["r", "g", "b", "Alpha"],
    ] {
        let alpha = SQUARE.replace("uchar red", &format!("uchar {red}"));
        let alpha = alpha.replace("uchar green", &format!("uchar {green}"));
        let alpha = alpha.replace("uchar blue", &format!("uchar {blue}\nproperty uchar {name}"));
        let alpha = alpha.replace("255 0 0\n", "255 0 0 128\n").replacen("128", "255", 1);
        let notes = parse("a.ply", alpha.as_bytes()).unwrap().notes;
        assert!(
            notes.iter().any(|note| note == "alpha of 3 vertices is not used: every surface is opaque"),
            "{name}: {notes:?}"
        );
    }
}

#[test]
fn a_property_with_a_name_of_another_row_is_no_channel() {
    let read = |text: &str| parse("a.ply", text.as_bytes()).unwrap();
    for other in ["r", "b", "a", "diffuse_alpha"] {
        let blue = format!("property uchar blue\nproperty float {other}\n");
        for plain in [SQUARE, PAINTED] {
            let text = plain.replace("property uchar blue\n", &blue);
            let text = text.replace("255 0 0\n", "255 0 0 0.5\n").replace("0 188 0\n", "0 188 0 0.5\n");
            let [mut actual, expected] = [text.as_str(), plain].map(read);
            actual.notes.retain(|note| !note.ends_with(&format!("not read (`{other}`)")));
            assert_eq!((actual.mesh, actual.notes), (expected.mesh, expected.notes), "{other}");
        }
    }
    // Beside `red`, there is no `green` and no `blue`, so `r`, `g` and `b` are the channels.
    let text = SQUARE.replace("uchar red", "uchar r").replace("uchar green", "uchar g");
    let text = text.replace("uchar blue", "uchar b\nproperty uchar red\nproperty uchar diffuse_alpha");
    let file = read(&text.replace("255 0 0\n", "255 0 0 7 7\n"));
    assert_eq!(file.mesh, read(SQUARE).mesh);
    assert!(!file.notes.iter().any(|note| note.starts_with("alpha")), "{:?}", file.notes);
}

#[test]
fn channels_of_every_type_of_number_are_divided_by_their_range() {
    for (channel, full) in [
        ("char", "127"),
        ("uchar", "255"),
        ("short", "255"),
        ("ushort", "65535"),
        ("int", "255"),
        ("uint", "255"),
        ("float", "1.0"),
        ("double", "1.0"),
    ] {
        let text = SQUARE.replace("property uchar", &format!("property {channel}"));
        let text = |of: &str| text.replace("255 0 0\n", &format!("{of} 0 0\n"));
        let red = |of: &str| {
            let file = parse("a.ply", text(of).as_bytes()).unwrap();
            file.mesh.materials[0].lambertian.x
        };
        assert_eq!(red(full), 1.0, "{channel}");
        if channel.ends_with("int") || channel == "short" {
            assert!(red("51") < 0.04, "{channel}: a fifth is 0.033 in linear light");
        }
    }
}

#[test]
fn channels_of_16_bits_count_as_those_of_8_bits_if_none_is_larger_than_255() {
    let file = |text: &str, from: &str, to: &str| {
        parse("a.ply", text.replace("property uchar", from).replace(" 255 0 0\n", to).as_bytes()).unwrap()
    };
    let red = |file: &MeshFile| triangle_colours(file)[0].x;
    let note =
        "channels of colours are read as numbers from 0 to 255, not to 65535, since none is larger than 255";
    for text in [SQUARE, PAINTED] {
        let wide = |to: &str| file(text, "property ushort", to);
        let narrow = wide(" 255 0 0\n");
        assert!(red(&narrow) > 0.999 && narrow.notes.contains(&note.to_owned()), "{:?}", narrow.notes);
        assert!((red(&wide(" 51 0 0\n")) - red(&file(text, "property uchar", " 51 0 0\n"))).abs() < 1e-4);
        let dark = wide(" 256 0 0\n");
        assert!(red(&dark) < 0.001 && !dark.notes.contains(&note.to_owned()), "{:?}", dark.notes);
    }
    let doubtful =
        "channels of colours are read as numbers from 0 to 255, but none is larger than 1".to_owned();
    let is_noted = |kind: &str, to: &str| file(SQUARE, kind, to).notes.contains(&doubtful);
    assert_eq!(
        ["0", "1", "2"].map(|to| is_noted("property int", &format!(" {to} 0 0\n"))),
        [false, true, false]
    );
    assert_eq!(
        ["0", "1", "2"].map(|to| is_noted("property uchar", &format!(" {to} 0 0\n"))),
        [false, true, false]
    );
    let doubtful = doubtful.replace("255", "127");
    assert!(file(SQUARE, "property char", " 1 0 0\n").notes.contains(&doubtful));
    let doubtful =
        "channels of colours are read as numbers from 0 to 65535, but none is larger than 1023".to_owned();
    let ten_bits = |to: &str| file(SQUARE, "property ushort", to).notes.contains(&doubtful);
    assert_eq!([" 255 0 0\n", " 1023 0 0\n", " 1024 0 0\n"].map(ten_bits), [false, true, false]);
}

#[test]
fn alpha_of_16_bits_counts_as_that_of_8_bits_beside_such_channels() {
    let notes = |alpha: &str| {
        let text = SQUARE.replace("property uchar", "property ushort");
        let text = text.replace("property ushort blue\n", "property ushort blue\nproperty ushort alpha\n");
        parse("a.ply", text.replace(" 255 0 0\n", &format!(" 255 0 0 {alpha}\n")).as_bytes()).unwrap().notes
    };
    let is_clear = |alpha| notes(alpha).iter().any(|note| note.starts_with("alpha of 4 vertices"));
    assert_eq!(["255", "254", "65535"].map(is_clear), [false, true, false]);
}

#[test]
fn vertices_that_no_face_uses_are_noted_if_they_are_most() {
    let points = ["5 5 5"; 4];
    let notes = |more: &[&str]| {
        let vertices = [&["0 0 0", "1 0 0", "0 1 0"], more].concat();
        parse("a.ply", triangle_of_floats(&vertices).as_bytes()).unwrap().notes
    };
    assert_eq!(notes(&points), ["4 vertices that no face uses are not drawn"]);
    assert_eq!(notes(&points[..3]), [""; 0]);
    let invalid = notes(&["nan 0 0"; 4]);
    assert!(invalid.len() == 1 && invalid[0].contains("a coordinate is not finite"), "{invalid:?}");
}

#[test]
fn vertices_that_no_face_uses_may_be_nan() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar uchar vertex_indices\nend_header\n";
    let floats = [1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 1.0, 0.0, f32::NAN, 0.0, 0.0];
    let with = |corners: [u8; 3]| {
        let floats = floats.iter().flat_map(|value| value.to_le_bytes());
        parse("a.ply", &header.bytes().chain(floats).chain([3]).chain(corners).collect::<Vec<_>>())
    };
    let mesh = with([0, 1, 2]).unwrap().mesh;
    assert_eq!((mesh.triangles.len(), mesh.positions[3]), (1, Vec3::X));
    let error = with([0, 1, 3]).err().unwrap().to_string();
    assert!(error.contains("vertex 3 is at [NaN, 0, 0]"), "{error}");
}

#[test]
fn comments_between_the_elements_of_an_ascii_file_are_ignored() {
    let text = SQUARE.replacen("500001 5400000", "comment a corner\n500001 5400000", 1);
    let text = text.replacen("4 0 1 2 3\n", "  comment\n4 0 1 2 3\n", 1) + "comment the end\n";
    let [plain, commented] = [SQUARE, text.as_str()].map(|text| parse("a.ply", text.as_bytes()).unwrap());
    assert_eq!((commented.mesh, commented.notes), (plain.mesh, plain.notes));
    // The line number in an error message also counts the lines of comments before the mistake.
    let error = parse("a.ply", text.replacen("4 0 1 2 3", "4 0 1 x 3", 1).as_bytes()).err().unwrap();
    assert!(error.to_string().starts_with("a.ply:23: `x`"), "{error}");
}

#[test]
fn textures_of_a_file_are_noted_and_its_other_comments_are_not() {
    let textured =
        SQUARE.replacen("comment made by hand", "comment TextureFile a.png\ncomment TextureFile b.png", 1);
    let is_noted = |text: &str| {
        let notes = parse("a.ply", text.as_bytes()).unwrap().notes;
        notes.iter().any(|note| note.contains("with the name of a texture or an MTL file"))
    };
    assert_eq!([SQUARE, &textured].map(is_noted), [false, true]);
    for (line, expected) in [
        ("comment texturefile a.png", true),
        ("comment TEXTURE: ./my a.png", true),
        ("comment material a.mtl", true),
        ("obj_info TextureFile a.png", true),
        ("comment texture: A.JPG", true),
        ("comment TextureFile \"my a.png\"", true),
        ("comment texture coordinates are missing.", false),
        ("comment Texture mapping by foo v1.2", false),
        ("comment material properties: density 7.85", false),
        ("comment texture generated by www.example.com", false),
        ("comment textured by hand with a.png", false),
        ("comment material", false),
    ] {
        assert_eq!(is_noted(&SQUARE.replacen("comment made by hand", line, 1)), expected, "{line}");
    }
}

#[test]
fn vertices_without_alpha_are_opaque() {
    let notes = parse("a.ply", SQUARE.as_bytes()).unwrap().notes;
    assert!(!notes.iter().any(|note| note.contains("alpha")), "{notes:?}");
}

#[test]
fn the_number_of_vertices_is_not_the_number_of_a_vertex() {
    for (corner, number) in [("4 0 1 2 4", "4"), ("4 0 1 2 -1", "-1")] {
        let text = SQUARE.replacen("4 0 1 2 3", corner, 1);
        let error = parse("a.ply", text.as_bytes()).err().unwrap().to_string();
        let expected = format!("vertex {number} does not exist; the file has 4 vertices, numbered from 0");
        assert!(error.contains(&expected), "{error}");
    }
    let one = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 1 0\n";
    let error = parse("a.ply", one.as_bytes()).err().unwrap().to_string();
    assert!(error.contains("vertex 1 does not exist; the file has 1 vertex, numbered from 0"), "{error}");
}

#[test]
fn faces_of_two_corners_are_left_out_with_a_note() {
    let text = SQUARE.replacen("element face 1", "element face 2", 1).replacen(
        "4 0 1 2 3\n",
        "4 0 1 2 3\n2 0 1\n",
        1,
    );
    let file = parse("a.ply", text.as_bytes()).unwrap();
    assert_eq!(file.mesh.triangles.len(), 2);
    let note = "1 face of fewer than three corners is left out".to_owned();
    assert!(file.notes.contains(&note), "{:?}", file.notes);
    assert!(!parse("a.ply", SQUARE.as_bytes()).unwrap().notes.iter().any(|note| note.contains("fewer")));
}

#[test]
fn a_message_begins_with_the_files_name() {
    for (from, to) in
        [("4 0 1 2 3\n0 1\n", ""), ("4 0 1 2 3", "4 0 1 2 9"), ("element vertex 4", "element vertex many")]
    {
        let error = parse("a.ply", SQUARE.replacen(from, to, 1).as_bytes()).err().unwrap().to_string();
        assert!(error.starts_with("a.ply:"), "{error}");
    }
    // The data of a binary file have no lines, so a message about these data names no line.
    let binary = "ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nend_header\n1234";
    let error = parse("a.ply", binary.as_bytes()).err().unwrap().to_string();
    assert!(error.starts_with("a.ply:"), "{error}");
}

/// Returns an ASCII file with the vertices `vertices`, and with one face whose corners are the first three
/// vertices.
fn triangle_of_floats(vertices: &[&str]) -> String {
    let (count, lines) = (vertices.len(), vertices.join("\n"));
    format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n{lines}\n3 0 1 2\n"
    )
}

#[test]
fn a_map_keeps_all_digits_of_its_text_beside_a_vertex_that_no_face_uses() {
    let map = ["500000.00 5400000.00 200", "500000.01 5400000.00 200", "500100.00 5400080.00 205"];
    let with_unused = [&map[..], &["0 0 0"]].concat();
    for vertices in [&map[..], &with_unused[..]] {
        let file = parse("a.ply", triangle_of_floats(vertices).as_bytes()).unwrap();
        let [a, b] = [file.mesh.positions[0], file.mesh.positions[1]];
        assert!((b.x - a.x - 0.01).abs() < 1e-5, "{vertices:?}: {a} {b}");
    }
    let far = ["0 0 0", "1 0 0", "0 1 0", "1e11 0 0"];
    let file = parse("a.ply", triangle_of_floats(&far).as_bytes()).unwrap();
    assert_eq!((file.placement.scale, file.mesh.positions[1]), (1.0, Vec3::X));
}

#[test]
fn a_tiny_concave_face_is_divided_like_a_large_one() {
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    // The face is concave at its second corner. A fan from the first corner would contain a triangle outside the
    // face.
    let corners = |edge: f64| {
        let text = format!(
            "{header}{edge:e} 0 0\n{quarter:e} {quarter:e} 0\n0 {edge:e} 0\n0 0 0\n4 0 1 2 3\n",
            quarter = edge / 4.0
        );
        let triangles = parse("a.ply", text.as_bytes()).unwrap().mesh.triangles;
        triangles.iter().map(|triangle| triangle.positions).collect::<Vec<_>>()
    };
    assert_eq!(corners(1e-200), corners(1.0));
    assert_ne!(corners(1.0)[0], [0, 1, 2]);
}

#[test]
fn a_header_without_what_a_mesh_needs_is_refused_by_name() {
    let indices = "list uchar int vertex_indices";
    for (from, to, message) in [
        ("double x", "double X", "`vertex` has no number `x`; it has `X`, `y`, `z`, `red`, `green`, `blue`"),
        ("double x", "list uchar int x", "`vertex` has no number `x`; it has `x` (a list), `y`, `z`, "),
        ("double y", "double secret", "`vertex` has no number `y`; it has `x`, `secret`, `z`, "),
        (
            indices,
            "list uchar int vertex_indexes",
            "`face` has no list `vertex_indices` (or `vertex_index`) of whole numbers; it has `vertex_indexes` (a list)",
        ),
        (
            indices,
            "list uchar float vertex_indices",
            "`face` has no list `vertex_indices` (or `vertex_index`) of whole numbers; it has `vertex_indices` (a list \
             of decimal numbers)",
        ),
        (indices, "int vertex_indices", "`face` has no list `vertex_indices` "),
        ("element face", "element faces", "the header has no element `face`; did you mean `faces`?"),
        ("element vertex", "element Vertex", "the header has no element `vertex`; did you mean `Vertex`?"),
    ] {
        let text = SQUARE.replacen(from, to, 1);
        let error_of = |quotes| {
            super::parse(Named { name: "a.ply", quotes }, text.as_bytes(), Limit::Usual).err().unwrap()
        };
        let [shown, withheld] = [true, false].map(|quotes| error_of(quotes).to_string());
        assert!(shown.starts_with(&format!("a.ply: {message}")), "{shown}");
        assert_eq!(withheld, shown.split_once(';').map_or(&*shown, |(what, _)| what), "{shown}");
    }
    // Like faces, strips of triangles need a list of corners. If the header states 0 elements of a type, this
    // type needs no properties.
    let strips = SQUARE.replacen("element face", "element tristrips", 1).replacen("indices", "list", 1);
    let error = parse("a.ply", strips.as_bytes()).err().unwrap().to_string();
    assert!(error.starts_with("a.ply: `tristrips` has no list "), "{error}");
    let none = SQUARE.replacen("element edge 1", "element tristrips 0\nproperty int a\nelement edge 1", 1);
    assert!(parse("a.ply", none.as_bytes()).is_ok());
}

#[test]
fn properties_of_vertices_of_which_some_are_missing_are_noted() {
    let notes = |from: &str, to: &str| parse("a.ply", SQUARE.replace(from, to).as_bytes()).unwrap().notes;
    let edges = "elements other than `vertex`, `face` and `tristrips`, and second definitions of these, are left out \
                 (`edge` 1)";
    let unread = |name: &str| format!("1 property of 4 vertices is not read (`{name}`)");
    assert_eq!(notes("float z", "float w"), ["4 vertices without z: z is 0", &unread("w"), edges]);
    let incomplete =
        "vertices have only 2 of the properties red, green, blue, so raycl reads none of these properties";
    assert_eq!(notes("uchar blue", "uchar bleu"), [incomplete, &unread("bleu"), edges]);
    let one = "vertices have only 1 of the properties nx, ny, nz, so raycl reads none of these properties";
    assert_eq!(notes("uchar blue", "uchar nx"), [one, incomplete, edges]);
    let of_faces = parse("a.ply", PAINTED.replace("uchar blue", "uchar bleu").as_bytes()).unwrap().notes;
    let of_faces_expected =
        [incomplete, &unread("bleu")].map(|note| note.replace("vertices", "faces").replace('4', "2"));
    assert_eq!(of_faces, of_faces_expected);
    // A property `r` without `g` and `b` is often a radius, so no note says that `g` and `b` are missing.
    assert_eq!(notes("uchar blue", "uchar r"), [incomplete, &unread("r"), edges]);
}

#[test]
fn what_follows_the_last_element_is_noted() {
    let rest = |text: &[u8]| {
        let notes = parse("a.ply", text).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("after the last element")).collect::<Vec<_>>()
    };
    for (more, expected) in [
        ("", &[][..]),
        (" \n\r\n", &[]),
        ("3 0 1 2", &["1 line after the last element is ignored"]),
        ("3 0 1 2\n\n3 0 1 2\n", &["2 lines after the last element are ignored"]),
    ] {
        assert_eq!(rest([SQUARE, more].concat().as_bytes()), expected, "{more:?}");
    }
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar x\nproperty uchar y\n\
        property uchar z\nelement face 1\nproperty list uchar uchar vertex_indices\nend_header\n";
    let data = [0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2];
    for (more, expected) in [
        (&b""[..], &[][..]),
        (b"\r\n", &[]),
        (b"x\n", &["2 bytes after the last element are ignored"]),
        (b"\0", &["1 byte after the last element is ignored"]),
    ] {
        assert_eq!(rest(&[header.as_bytes(), &data, more].concat()), expected, "{more:?}");
    }
}

#[test]
fn a_second_type_of_elements_with_the_same_name_is_called_by_this_name() {
    let second = SQUARE.replacen("element edge 1", "element face 1", 1);
    let notes = parse("a.ply", second.as_bytes()).unwrap().notes;
    let left_out = "elements other than `vertex`, `face` and `tristrips`, and second definitions of these, are left \
                    out (`face` 1)";
    assert_eq!(notes, [left_out]);
    let error = parse("a.ply", second.replacen("3\n0 1\n", "3\n", 1).as_bytes()).err().unwrap().to_string();
    assert!(error.contains("elements `face`"), "{error}");
}

#[test]
fn an_error_about_a_missing_property_lists_at_most_eight_others() {
    let message = |count: u8| {
        let property = |name: u8| format!("property float {}\n", char::from(name));
        let properties: String = (b'a'..b'a' + count).map(property).collect();
        let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let data = format!("{}\n3 0 0 0\n", "0 ".repeat(usize::from(count)));
        let text = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}{faces}{data}");
        parse("a.ply", text.as_bytes()).err().unwrap().to_string()
    };
    let list = "a.ply: `vertex` has no number `x`; it has `a`, `b`, `c`, `d`, `e`, `f`, `g`, `h`";
    assert!(message(8).starts_with(list) && !message(8).contains("..."), "{}", message(8));
    assert!(message(9).starts_with(&format!("{list}, ...")), "{}", message(9));
}

#[test]
fn channels_of_different_types_have_ranges_of_their_own() {
    let file = |kinds: [&str; 3], red: &str| {
        let of = |text: String, (name, kind): (&str, &str)| {
            text.replace(&format!("property uchar {name}"), &format!("property {kind} {name}"))
        };
        let text = ["red", "green", "blue"].into_iter().zip(kinds).fold(SQUARE.to_owned(), of);
        let file = parse("a.ply", text.replace(" 255 0 0\n", &format!(" {red} 0 0\n")).as_bytes()).unwrap();
        let note = file.notes.into_iter().find(|note| note.starts_with("channels of colours"));
        (file.mesh.materials[0].lambertian.x, note)
    };
    let (narrow, note) = file(["ushort", "uchar", "uchar"], "255");
    let expected = "channels of colours of the type ushort are read as numbers from 0 to 255, not to 65535, since none \
                    is larger than 255";
    assert!(narrow > 0.999 && note.as_deref() == Some(expected), "{narrow} {note:?}");
    assert_eq!(file(["ushort", "uchar", "float"], "65535"), (1.0, None));
    assert_eq!(file(["uchar", "ushort", "ushort"], "255"), (1.0, None));
    let dark = "channels of colours are read as numbers from 0 to 255, but none is larger than 1";
    assert_eq!(file(["uchar", "int", "short"], "1").1.as_deref(), Some(dark));
    assert_eq!(file(["float", "uchar", "uchar"], "1"), (1.0, None));
    assert_eq!(file(["uchar", "float", "float"], "1").1, None);
    // The green of this colour is 255, and its blue is 0.
    let (red, _) = file(["float", "ushort", "uchar"], "0.001 255");
    assert!(red < 0.001, "{red}");
}

#[test]
fn alpha_of_16_bits_beside_colours_of_8_bits_may_have_8_bits() {
    let notes = |alpha: &str| {
        let text = SQUARE.replace("property uchar blue\n", "property uchar blue\nproperty ushort alpha\n");
        parse("a.ply", text.replace(" 255 0 0\n", &format!(" 255 0 0 {alpha}\n")).as_bytes()).unwrap().notes
    };
    let is_noted = |alpha| notes(alpha).iter().any(|note| note.starts_with("alpha of 4 vertices"));
    assert_eq!(["255", "254", "256", "65535", "0"].map(is_noted), [false, true, true, false, true]);
    assert!(!notes("255").iter().any(|note| note.starts_with("channels")));
}
