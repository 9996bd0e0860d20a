//! Makes the names of files from the names of scenes, devices and strategies.

use super::summary::Group;

/// The longest file name without extension, in bytes. Most file systems allow names of up to 255 bytes. The bytes
/// beyond `LONGEST_NAME` are for the extension, and for words that raycl adds to the name, such as the kind
/// of a plot.
const LONGEST_NAME: usize = 200;

/// Turns a name into a file name without folders: all characters except ASCII letters, digits and "-_."
/// become dashes. If the name is too long, its end is replaced by a hash of the whole name, so that different
/// long names stay different.
pub fn file_name(name: &str) -> String {
    let valid = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let mut file: String = name.chars().map(valid).collect();
    if file.len() > LONGEST_NAME {
        let hash = &blake3::hash(name.as_bytes()).to_hex()[..16];
        file.truncate(LONGEST_NAME - 1 - hash.len());
        file.extend(["-", hash]);
    }
    file
}

/// Returns a file name without extension for each group. A file name consists of the group's scene, image
/// size and device. No two names are equal.
pub fn file_names(groups: &[Group<'_>]) -> Vec<String> {
    let mut files: Vec<String> = Vec::new();
    for group in groups {
        let [width, height] = group.image_size;
        let mut file = file_name(&format!("{}-{width}x{height}-{}", group.scene, group.device));
        // "a/scene" and "a-scene" are different scenes and need different file names.
        while files.contains(&file) {
            file.push('_');
        }
        files.push(file);
    }
    files
}

#[cfg(test)]
mod tests {
    use super::super::summary::groups;
    use super::super::summary::tests::measured;
    use super::super::types::Record;
    use super::*;

    #[test]
    fn no_name_leaves_the_folder() {
        assert_eq!(file_name("../../etc/passwd"), "..-..-etc-passwd");
        assert_eq!(file_name("a b/c\\d<e>"), "a-b-c-d-e-");
    }

    #[test]
    fn long_names_are_shortened_and_stay_different() {
        let longest = "a".repeat(200);
        assert_eq!(file_name(&longest), longest);
        let names = ["a", "b"].map(|end| file_name(&format!("{}{end}", "é".repeat(300))));
        assert!(names[0] != names[1] && names.iter().all(|name| name.len() == 200), "{names:?}");
        let long = "s".repeat(300);
        assert_ne!(file_name(&format!("{long}/a")), file_name(&format!("{long}-a")));
    }

    #[test]
    fn groups_with_the_same_valid_characters_have_names_of_their_own() {
        let of = |scene: &str| Record { scene: scene.to_owned(), ..measured("gpu", "naive", 8, 2.0) };
        let long = "s".repeat(240);
        let records = ["a/scene", "a-scene", "é", "è", long.as_str()].map(of);
        let names = file_names(&groups(&records));
        let expected = ["a-scene-800x500-gpu", "a-scene-800x500-gpu_", "--800x500-gpu", "--800x500-gpu_"];
        assert_eq!(names[..4], expected);
        assert_eq!(names[4].len(), 200);
    }
}
