//! Prepares the scenes of an experiment: only one of several scenes with the same content is measured, and scenes with
//! different contents get different names.

use super::draft::of_scene;
use crate::config::Experiment;
use crate::error::Result;
use crate::record::{Record, tell_scenes_apart};

/// Loads the scenes of an experiment, one at a time. Of several scenes with the same content, keeps only the first one,
/// which gets a note for each of the others. Gives the scenes the names that they have in results. Points of scenes
/// with the same content would have the same keys, so the plan would count a measurement several times although it is
/// made only once.
///
/// # Errors
///
/// Fails if a scene cannot be loaded.
pub fn distinct_scenes(mut experiment: Experiment) -> Result<Experiment> {
    let (mut originals, mut copies) = (Vec::<Record>::new(), Vec::new());
    for (index, choice) in experiment.scenes.iter().enumerate() {
        let scene = of_scene(choice, &choice.load()?.into());
        match originals.iter().position(|other| other.scene_hash == scene.scene_hash) {
            Some(original) => copies.push((index, original, scene)),
            None => originals.push(scene),
        }
    }
    let names: Vec<String> = copies.iter().map(|(.., copy)| name_of_copy(copy, &originals)).collect();
    tell_scenes_apart(&mut originals);
    experiment.leave_out(copies.iter().map(|(index, ..)| *index).collect());
    for (choice, scene) in experiment.scenes.iter_mut().zip(&originals) {
        choice.name = Some(scene.scene.clone());
        choice.hash.clone_from(&scene.scene_hash);
    }
    for ((_, original, _), copy) in copies.into_iter().zip(names) {
        let name = &originals[original].scene;
        let note = format!("scene {copy} has the same content as {name}; it is measured once, as {name}");
        experiment.scenes[original].notes.push(note);
    }
    Ok(experiment)
}

/// Returns the name of a scene that is left out. If a scene that is kept has the same name, returns the file of the
/// scene that is left out.
fn name_of_copy(copy: &Record, originals: &[Record]) -> String {
    let is_namesake = originals.iter().any(|other| other.scene == copy.scene);
    copy.scene_file.as_ref().filter(|_| is_namesake).unwrap_or(&copy.scene).clone()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::{Past, Plan, asleep, dry_run, fixtures};
    use super::*;
    use crate::config::{self, SceneChoice};
    use crate::record::CurrentPlan;
    use tempfile::TempDir;

    /// Returns an experiment with these scenes, and its folder. The folder has three files `tri.toml`, in `a`, `b` and
    /// `c`, of which the last one has another content, and a file that states the name `named`.
    fn experiment(scenes: &str) -> (Experiment, TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let object = "[[object]]\nvertices = [[0, 0, -3], [1, 0, -3], [0, 1, -3]]\nfaces = [[0, 1, 2]]\n";
        let [larger, largest] =
            ["2", "3"].map(|side| object.replace("[1, 0, -3]", &format!("[{side}, 0, -3]")));
        let named = format!("name = 'named'\n{largest}");
        for (file, text) in [("a/tri", object), ("b/tri", object), ("c/tri", &larger), ("d/file", &named)] {
            let path = folder.path().join(format!("{file}.toml"));
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let text = format!(
            "question = '?'\nexpectation = '!'\nimage_sizes = [[8, 5]]\nstrategies = ['naive']\n\
             local_sizes = [4, 8]\n{scenes}"
        );
        (config::parse(&folder.path().join("test.toml"), text, &[]).unwrap(), folder)
    }

    fn labels(experiment: &Experiment) -> Vec<String> {
        experiment.scenes.iter().map(SceneChoice::label).collect()
    }

    #[test]
    fn of_scenes_with_the_same_content_the_first_is_kept_with_a_note() {
        let (all, _folder) = experiment("scenes = ['a/tri.toml', 'b/tri.toml', 'd/file.toml']");
        let distinct = distinct_scenes(all.clone()).unwrap();
        assert_eq!(
            (labels(&distinct), &distinct.left_out[..]),
            (vec!["tri".to_owned(), "named".to_owned()], &[1][..])
        );
        let [note] = &distinct.scenes[0].notes[..] else { panic!("{:?}", distinct.scenes[0].notes) };
        let end = "b/tri.toml has the same content as tri; it is measured once, as tri";
        assert!(note.starts_with("scene ") && note.ends_with(end), "{note}");
        assert!(distinct.scenes[1].notes.is_empty());
        let (namesakes, _folder) = experiment("scenes = ['a/tri.toml', 'b/tri.toml', 'c/tri.toml']");
        let notes = distinct_scenes(namesakes).unwrap().scenes.swap_remove(0).notes;
        let end = "b/tri.toml has the same content as a/tri; it is measured once, as a/tri";
        assert!(notes.len() == 1 && notes[0].ends_with(end), "{notes:?}");
        // A worker reads the config again, and leaves out the same scenes.
        let mut of_worker = all;
        of_worker.leave_out(distinct.left_out.clone());
        let files = |experiment: &Experiment| -> Vec<_> {
            experiment.scenes.iter().map(|choice| choice.path.clone()).collect()
        };
        assert_eq!(files(&of_worker), files(&distinct));
    }

    #[test]
    fn different_scenes_of_the_same_name_have_different_names_and_a_stated_name_is_used() {
        let (all, _folder) = experiment("scenes = ['a/tri.toml', 'c/tri.toml', 'd/file.toml']");
        let distinct = distinct_scenes(all).unwrap();
        assert_eq!(labels(&distinct), ["a/tri", "c/tri", "named"]);
        assert!(distinct.left_out.is_empty() && distinct.scenes.iter().all(|choice| choice.notes.is_empty()));
        assert_eq!(Plan::new(&distinct, 1).points[0].label(&distinct), "a/tri 8x5 naive 4x4");
    }

    #[test]
    fn a_copy_is_in_no_number_of_points_and_its_note_is_in_records() {
        let entry = "[[scene]]\nfile = 'a/tri.toml'\nset = { 'camera.position' = [[0.0, 0, 0], [0, 0, 0]] }";
        let (all, _folder) = experiment(entry);
        let distinct = distinct_scenes(all).unwrap();
        let (device, locks) = (asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&distinct, &devices, &locks);
        let (first, copy) = ("tri+position=[0.0, 0, 0]", "tri+position=[0, 0, 0]");
        let note = format!("scene {copy} has the same content as {first}; it is measured once, as {first}");
        let forecasts = dry_run(&run, &Past::default()).unwrap();
        assert!(forecasts.iter().all(|forecast| forecast.scene_notes.contains(&note)), "{forecasts:?}");
        let groups = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
        let records: Vec<&Record> = groups.iter().flatten().map(|pending| &pending.record).collect();
        assert!(records.iter().all(|record| record.scene_notes.contains(&note)), "{records:?}");
        let planned = CurrentPlan::of(records).points.len();
        let expected = run.expected(&[], &Past::default()).unwrap().points;
        assert_eq!((forecasts.len(), planned, expected), (2, 2, 2));
    }
}
