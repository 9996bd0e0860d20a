//! The YAML of docs/clusters.md, for Kubernetes and for CIs.

use super::Ground;
use crate::binary::{has, repository};

/// The YAML in docs/clusters.md can be parsed, and each of its examples asks for as many shards as it starts
/// processes.
#[test]
fn the_yaml_of_the_documents_is_read_and_asks_for_as_many_shards_as_it_starts() {
    let text = std::fs::read_to_string(repository("docs/clusters.md")).expect("the page");
    let blocks: Vec<&str> =
        text.split("```yaml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    let read = |text: &&str| yaml_rust2::YamlLoader::load_from_str(text).expect("YAML").remove(0);
    let [job, github, gitlab] = &blocks.iter().map(read).collect::<Vec<_>>()[..] else {
        panic!("three blocks of YAML")
    };
    let spec = &job["spec"];
    let container = &spec["template"]["spec"]["containers"][0];
    let words = container["command"].as_vec().expect("words");
    let words: Vec<&str> = words.iter().filter_map(yaml_rust2::Yaml::as_str).collect();
    // The container's image contains no config, so the config must be on the mounted volume.
    let volume = container["volumeMounts"][0]["mountPath"].as_str().expect("a volume");
    assert!(words[2].starts_with(&format!("{volume}/configs/")), "{words:?} {volume}");
    assert_eq!((spec["completionMode"].as_str(), spec["completions"].as_i64()), (Some("Indexed"), Some(16)));
    assert!(words.join(" ").contains("--shard auto/16") && words[0] == "raycl", "{words:?}");
    let shards = github["jobs"]["shard"]["strategy"]["matrix"]["shard"].as_vec().expect("a matrix").len();
    let steps = github["jobs"]["shard"]["steps"].as_vec().expect("steps");
    let run = steps
        .iter()
        .filter_map(|step| step["run"].as_str())
        .find(|run| run.contains("--shard"))
        .expect("a shard");
    assert!(run.contains(&format!("/{shards} ")), "{run}");
    assert_eq!(gitlab["shard"]["parallel"].as_i64(), Some(4));
    assert!(gitlab["shard"]["script"][1].as_str().is_some_and(|line| line.contains("--shard auto ")));
    // The example must name an image, since GitLab's default image has neither Rust nor make.
    let image = gitlab["default"]["image"].as_str().expect("an image");
    let setup = gitlab["default"]["before_script"].as_vec().expect("commands");
    assert!(image.starts_with("rust:"), "{image}");
    assert!(
        setup.iter().filter_map(yaml_rust2::Yaml::as_str).any(|line| line.contains(" make")),
        "{setup:?}"
    );
    // The options in the YAML of docs/clusters.md are options of `raycl run`.
    for option in ["--shard", "--out", "--device"] {
        has(&Ground::new().folder.output(&["run", "--help"]), &[option]);
    }
}
