//! Collects what a run records about the machine, the devices, the program and the input files.

use crate::config::Experiment;
use crate::device::{DeviceInfo, variables};
use crate::program::Sources;
use crate::record::{BUILT_IN, DeviceEnvironment, Environment, Host, Source, git_state_of_folder};

/// Returns what a run that begins now records about the machine, the devices, the program and the files.
pub fn environment(experiment: &Experiment, devices: &[&DeviceInfo], kernels: &[Sources]) -> Environment {
    Environment {
        raycl_version: env!("CARGO_PKG_VERSION").to_owned(),
        git_revision: option_env!("RAYCL_GIT_REVISION").map(str::to_owned),
        build: env!("RAYCL_BUILD").to_owned(),
        variables: variables::all(),
        started: jiff::Timestamp::now().to_string(),
        // Arguments need not be UTF-8. `std::env::args` would panic at an argument that is not UTF-8, so the
        // conversion replaces the bytes that are not UTF-8.
        command_line: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        host: Host::read(),
        devices: devices.iter().map(|device| DeviceEnvironment::of(device)).collect(),
        build_options: vec!["-cl-std=CL1.2".to_owned(), "-cl-kernel-arg-info".to_owned()],
        config_path: experiment.path.display().to_string(),
        config: experiment.source.clone(),
        config_hash: Environment::hash_of(&experiment.source, &experiment.overrides),
        overrides: experiment.overrides.clone(),
        config_notes: experiment.notes_on_equal_strategies(),
        sources: files(experiment).chain(kernels.iter().map(of_kernels)).collect(),
    }
}

/// Returns the config's file and the scenes' files, with their current hashes.
fn files(experiment: &Experiment) -> impl Iterator<Item = Source> {
    let scenes = experiment.scenes.iter().map(|scene| Source::file("scene", &scene.path));
    std::iter::once(Source::file("config", &experiment.path)).chain(scenes)
}

/// Returns the description of the kernel files (the built-in files, or the files of a folder) for the list of
/// the run's input files.
fn of_kernels(kernels: &Sources) -> Source {
    let (path, git) = match kernels {
        Sources::Embedded => (BUILT_IN.to_owned(), None),
        Sources::Folder(folder) => {
            let files = kernels.own_files().unwrap_or_default();
            (folder.display().to_string(), git_state_of_folder(folder, &files, "cl"))
        }
    };
    Source { what: "kernels".to_owned(), path, hash: kernels.hash(), git }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_hash_of_a_config_depends_on_its_overrides() {
        let hash = |seed: Option<&str>| {
            let text = "question = '?'\nexpectation = '!'\nscenes = ['scenes/triangle.toml']\nlocal_sizes = [4]\n\
                        strategies = ['naive']\nimage_sizes = [[8, 5]]\n";
            let overrides: Vec<_> =
                seed.iter().map(|seed| ("timing.seed".to_owned(), seed.parse().unwrap())).collect();
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("test.toml");
            let experiment = crate::config::parse(&path, text.to_owned(), &overrides).unwrap();
            environment(&experiment, &[], &[]).config_hash
        };
        assert_eq!(hash(None), hash(None));
        assert!(hash(Some("3")) != hash(None) && hash(Some("3")) != hash(Some("4")));
    }

    #[test]
    fn the_environment_has_the_config_the_devices_and_the_hash_of_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let config = folder.path().join("a.toml");
        let text = format!(
            "question = '?'\nexpectation = '!'\nscenes = [{scene:?}]\nlocal_sizes = [4]\nstrategies = ['naive']\n\
             image_sizes = [[8, 5]]\n[[strategy]]\npreset = 'naive'\nname = 'twin'\n"
        );
        std::fs::write(&config, &text).unwrap();
        let experiment = crate::config::load(&config, &[("timing.seed".to_owned(), "3".to_owned())]).unwrap();
        let device = crate::experiment::asleep::device(1.0);
        let own = Sources::Folder(folder.path().to_owned());
        let described = environment(&experiment, &[&device], &[Sources::Embedded, own.clone()]);
        assert_eq!((described.config_path, described.config), (config.display().to_string(), text));
        assert_eq!((described.overrides.len(), described.devices.len()), (1, 1));
        assert_eq!(described.devices[0], DeviceEnvironment::of(&device));
        let note = "Strategy twin equals naive on all axes; raycl measures only naive.";
        assert_eq!(described.config_notes, [note]);
        let hash = |path: &Path| Some(blake3::hash(&std::fs::read(path).unwrap()).to_hex().to_string());
        let expected = [
            ("config", config.display().to_string(), hash(&config)),
            ("scene", scene.display().to_string(), hash(&scene)),
            ("kernels", "built in".to_owned(), Sources::Embedded.hash()),
            ("kernels", folder.path().display().to_string(), own.hash()),
        ];
        let sources: Vec<_> = described
            .sources
            .iter()
            .map(|source| (&*source.what, source.path.clone(), source.hash.clone()))
            .collect();
        assert_eq!(sources, expected);
    }
}
