//! Prepares the scenes of an experiment: only one of several scenes with the same content is measured, and scenes with
//! different contents get different names.

use super::draft::{Hashed, of_scene};
use crate::config::{Experiment, SceneChoice};
use crate::error::Result;
use crate::record::{Record, tell_scenes_apart};

/// Loads the scenes of an experiment, one at a time. If several scenes have the same content, keeps only the
/// first scene, and adds a note to this scene for each scene that is left out. Gives the scenes the names
/// that they have in results. If scenes with the same content were kept, their points would have the same
/// keys, and the plan would count one measurement several times.
///
/// # Errors
///
/// Fails if a scene cannot be loaded.
pub fn distinct_scenes(mut experiment: Experiment) -> Result<Experiment> {
    let (mut originals, mut contents) = (Vec::<Record>::new(), Vec::<Vec<String>>::new());
    let (mut copies, shapes) = (Vec::new(), experiment.shapes());
    for (index, choice) in experiment.scenes.iter().enumerate() {
        let (scene, hashes) = identified(choice, &shapes)?;
        match contents.iter().position(|other| *other == hashes) {
            Some(original) => copies.push((index, original, scene)),
            None => {
                originals.push(scene);
                contents.push(hashes);
            }
        }
    }
    let names: Vec<String> = copies.iter().map(|(.., copy)| name_of_copy(copy, &originals)).collect();
    tell_scenes_apart(&mut originals);
    experiment.leave_out(copies.iter().map(|(index, ..)| *index).collect());
    for ((choice, scene), hashes) in experiment.scenes.iter_mut().zip(&originals).zip(contents) {
        choice.name = Some(scene.scene.clone());
        choice.hashes = hashes;
    }
    for ((_, original, _), copy) in copies.into_iter().zip(names) {
        let name = &originals[original].scene;
        let note = format!("scene {copy} has the same content as {name}; raycl measures only {name}");
        experiment.scenes[original].notes.push(note);
    }
    Ok(experiment)
}

/// Returns a record that only identifies a scene, and the hashes of the scene's content. If raycl places the
/// camera, there is one hash for each shape (ratio of width to height) in `shapes`; otherwise, there is a
/// single hash.
fn identified(choice: &SceneChoice, shapes: &[[u32; 2]]) -> Result<(Record, Vec<String>)> {
    let (mut scene, mut hashes) = (Record::default(), Vec::new());
    for &shape in shapes {
        let at = Hashed::load(choice, shape)?;
        scene = of_scene(choice, &at);
        hashes.push(at.hash);
        if at.framed_for.is_none() {
            break;
        }
    }
    Ok((scene, hashes))
}

/// Returns the name of a scene that is left out. If another scene that is measured has the same name, returns
/// the file of the left-out scene instead of the name.
fn name_of_copy(copy: &Record, originals: &[Record]) -> String {
    let is_namesake = originals.iter().any(|other| other.scene == copy.scene);
    copy.scene_file.as_ref().filter(|_| is_namesake).unwrap_or(&copy.scene).clone()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::super::{Past, Plan, asleep, dry_run, fixtures};
    use super::*;
    use crate::config;
    use crate::record::CurrentPlan;
    use crate::scene::{Shot, load_scene_for};
    use std::path::Path;
    use tempfile::TempDir;

    /// Returns an experiment with these scenes, and its folder. The folder has the files `tri.toml` in `a`,
    /// `b` and `c`, and a file that states the name `named`. The file in `c` has other contents than the
    /// files in `a` and `b`.
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
        let end = "b/tri.toml has the same content as tri; raycl measures only tri";
        assert!(note.starts_with("scene ") && note.ends_with(end), "{note}");
        assert!(distinct.scenes[1].notes.is_empty());
        let (namesakes, _folder) = experiment("scenes = ['a/tri.toml', 'b/tri.toml', 'c/tri.toml']");
        let notes = distinct_scenes(namesakes).unwrap().scenes.swap_remove(0).notes;
        let end = "b/tri.toml has the same content as a/tri; raycl measures only a/tri";
        assert!(notes.len() == 1 && notes[0].ends_with(end), "{notes:?}");
        // A worker reads the config again, and leaves out the scenes that the run has left out.
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
    fn raycl_places_a_camera_for_the_shape_of_the_images_as_render_does() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str, scene: &str| std::fs::write(folder.path().join(name), scene).unwrap();
        of("bar.obj", "v 0 0 0\nv 9 0 0\nv 0 1 2\nf 1 2 3\n");
        of("from-left.toml", "camera = { azimuth_degrees = -90 }\nobject = [{ mesh = 'bar.obj' }]\n");
        of("placed.toml", "camera = { position = [0, 1, 9] }\nobject = [{ mesh = 'bar.obj' }]\n");
        let text = "question = '?'\nexpectation = '!'\nimage_sizes = [[40, 100], [100, 40], [20, 50], 16]\n\
                    scenes = ['bar.obj', 'from-left.toml', 'placed.toml']\nbaselines = ['serial']\n";
        let all = config::parse(&folder.path().join("test.toml"), text.to_owned(), &[]).unwrap();
        let (experiment, locks) = (distinct_scenes(all).unwrap(), fixtures::own_locks());
        let run = fixtures::run(&experiment, &[], &locks);
        let hash = |file: &str, [width, height]: [u32; 2]| {
            let shot = Shot { aspect: f64::from(width) / f64::from(height), ..Shot::SQUARE };
            load_scene_for(Path::new(file), &[], shot).unwrap().scene.content_hash()
        };
        for pending in run.pending_points(&run.plan(), &run.plan().whole()).unwrap().iter().flatten() {
            let (size, file) = (pending.record.image_size, pending.record.scene_file.as_ref().unwrap());
            assert_eq!(pending.record.scene_hash, Some(hash(file, size)), "{file} {size:?}");
        }
        let counts = experiment.scenes.iter().map(|choice| choice.hashes.len());
        assert_eq!(counts.collect::<Vec<_>>(), [3, 3, 1], "one hash for each of the three shapes");
        let mut hashes: Vec<&String> = experiment.scenes.iter().flat_map(|choice| &choice.hashes).collect();
        hashes.sort();
        hashes.dedup();
        assert_eq!(hashes.len(), 7);
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
        let note = format!("scene {copy} has the same content as {first}; raycl measures only {first}");
        let forecasts = dry_run(&run, &Past::default()).unwrap();
        assert!(forecasts.iter().all(|forecast| forecast.scene_notes.contains(&note)), "{forecasts:?}");
        let groups = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
        let records: Vec<&Record> = groups.iter().flatten().map(|pending| &pending.record).collect();
        assert!(records.iter().all(|record| record.scene_notes.contains(&note)), "{records:?}");
        let planned = CurrentPlan::of(records).points.len();
        let expected = run.expected(&[], &Past::default()).unwrap().points;
        assert_eq!((forecasts.len(), planned, expected), (2, 2, 2));
    }

    #[test]
    fn a_note_on_a_copy_is_with_the_scene_that_is_measured_in_its_place() {
        let (all, _folder) = experiment("scenes = ['d/file.toml', 'a/tri.toml', 'b/tri.toml']");
        let distinct = distinct_scenes(all).unwrap();
        let counts = distinct.scenes.iter().map(|choice| choice.notes.len());
        assert_eq!(counts.collect::<Vec<_>>(), [0, 1]);
    }
}
