//! Finds the triangle at the pointer, with a ray of the reference through the pixel, in double precision.

use super::Live;
use super::room::check_room;
use crate::error::Result;
use crate::memory::Available;
use crate::reference::cutouts::Solid;
use crate::reference::layers::{normal_at, object_of};
use crate::reference::ray::Frame;
use crate::reference::traverse::Finder as _;
use crate::reference::tree::Tree;
use crate::scene::{Camera, Scene};
use crate::strategy::Culling;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

/// A triangle at a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Picked {
    /// The triangle's number in the scene, from 0.
    pub triangle: u32,
    /// The number of the triangle's object, from 0.
    pub object: u32,
    /// The number of the triangle's material, from 0.
    pub material: u32,
    /// The interpolated normal, of unit length.
    pub normal: [f32; 3],
}

impl Picked {
    /// Returns the triangle's description for the user.
    pub fn text(&self) -> String {
        let Self { triangle, object, material, normal: [x, y, z] } = self;
        format!("triangle {triangle}, object {object}, material {material}, normal ({x:.2}, {y:.2}, {z:.2})")
    }
}

/// Returns the triangle that the centre of the pixel `[x, y]` shows; `None` if it shows the background.
pub fn pick(
    scene: &Scene,
    tree: &Tree,
    camera: &Camera,
    [width, height]: [u32; 2],
    [x, y]: [u32; 2],
    object_starts: &[u32],
) -> Option<Picked> {
    let frame = Frame::<f64>::new(&camera.pixel_frame(width, height));
    let surfaces = Solid::new(tree, &scene.mesh.textures);
    let hit = surfaces.closest(&frame.primary(f64::from(x) + 0.5, f64::from(y) + 0.5))?;
    Some(Picked {
        triangle: hit.triangle,
        object: object_of(object_starts, hit.triangle),
        material: scene.mesh.triangles[hit.triangle as usize].material,
        normal: normal_at(&scene.mesh, &hit).as_vec3().to_array(),
    })
}

/// Finds out which triangle of a scene a pixel shows, by means of a tree. Another thread builds the tree when the
/// pointer is over the picture for the first time, and again after the scene or the strategy's culling has changed.
#[derive(Default)]
pub struct Picker {
    /// The scene and the culling of the tree that was last requested, even if this request was refused; `None`
    /// before the first request.
    of: Option<(Arc<Scene>, Culling)>,
    building: Option<JoinHandle<Tree>>,
    tree: Option<Tree>,
}

impl Picker {
    /// Returns the triangle at a pixel of the picture; `None` if the pixel shows no triangle, or if there is no tree
    /// (yet).
    ///
    /// # Errors
    ///
    /// Fails if the tree needs more memory than is available. Only the first call fails; later calls return `None`
    /// until the scene or the culling changes.
    pub fn pick(&mut self, live: &Live, camera: &Camera, pixel: [u32; 2]) -> Result<Option<Picked>> {
        self.ask_for_tree(live.scene(), live.strategy().culling, Available::read)?;
        let found = |tree| pick(live.scene(), tree, camera, live.size(), pixel, &live.loaded().object_starts);
        Ok(self.tree.as_ref().and_then(found))
    }

    /// Returns the size of the tree in memory, in bytes; 0 if there is no tree (yet).
    pub fn bytes(&self) -> u64 {
        self.tree.as_ref().map_or(0, Tree::bytes)
    }

    /// Returns true if a tree is being built.
    pub fn is_building(&self) -> bool {
        self.building.is_some()
    }

    /// Begins to build the tree of a scene, unless the last request was for the same tree. Begins only after the
    /// previous tree is complete. If the function did not wait for the previous tree, and a scene changed quickly, the
    /// trees of several versions of the scene would be in memory together.
    fn ask_for_tree(
        &mut self,
        scene: &Arc<Scene>,
        culling: Culling,
        available: impl FnOnce() -> Available,
    ) -> Result<()> {
        if let Some(done) = self.building.take_if(|building| building.is_finished()) {
            // If the thread that builds the tree panicked, there is no tree, and `pick` finds no triangle.
            self.tree = done.join().ok();
        }
        let is_same = |(known, faces): &(Arc<Scene>, Culling)| Arc::ptr_eq(known, scene) && *faces == culling;
        if self.is_building() || self.of.as_ref().is_some_and(is_same) {
            return Ok(());
        }
        let of = Arc::clone(scene);
        self.of = Some((Arc::clone(scene), culling));
        self.tree = None;
        check_room(&scene.mesh, 1, "finding the triangle at the pointer", &available())?;
        // If no thread can be started, there is no tree, and `pick` finds no triangle.
        self.building = Builder::new().spawn(move || Tree::new(&of.mesh, culling)).ok();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Pose;
    use super::super::tests::{back_face_in, live_of};
    use super::*;
    use crate::reference::fixtures;
    use crate::reference::layers::{NOTHING, layers};
    use std::sync::mpsc::channel;
    use std::time::{Duration, Instant};

    #[test]
    fn what_is_picked_is_what_layers_have_there() {
        let scene = fixtures::figure_4();
        let (size, starts) = ([80, 60], [0, 1, 2]);
        let layer_images = layers(&scene, &starts, size, Culling::None).expect("a small scene");
        let tree = Tree::new(&scene.mesh, Culling::None);
        let mut hits = 0;
        for (x, y) in (0..size[0]).step_by(3).flat_map(|x| (0..size[1]).step_by(3).map(move |y| (x, y))) {
            let index = (y * size[0] + x) as usize;
            let picked = pick(&scene, &tree, &scene.camera, size, [x, y], &starts);
            let expected = (layer_images.triangle[index] != NOTHING).then(|| Picked {
                triangle: layer_images.triangle[index],
                object: layer_images.object[index],
                material: scene.mesh.triangles[layer_images.triangle[index] as usize].material,
                normal: layer_images.normal[index],
            });
            hits += usize::from(picked.is_some());
            assert_eq!(picked, expected, "({x}, {y})");
        }
        assert!(hits > 50, "{hits}");
    }

    /// Returns the triangle in the middle of the picture, as soon as the tree is built.
    fn in_the_middle(picker: &mut Picker, live: &Live) -> Option<Picked> {
        let deadline = Instant::now() + Duration::from_secs(120);
        loop {
            let picked = picker.pick(live, &live.camera(&Pose::START), [20, 10]).expect("room for a tree");
            if !picker.is_building() {
                return picked;
            }
            assert!(Instant::now() < deadline, "no tree is built");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_back_face_is_picked_only_if_the_strategy_shows_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = back_face_in(folder.path());
        let mut live = live_of(&path, ["40", "20"], &["--set", "culling=back"], 1);
        let mut picker = Picker::default();
        assert_eq!(in_the_middle(&mut picker, &live), None);
        // The strategies of all presets show both sides of triangles.
        live.next_strategy(1).expect("another strategy");
        assert_eq!(live.strategy().culling, Culling::None);
        let picked = in_the_middle(&mut picker, &live);
        assert_eq!(picked.map(|picked| picked.triangle), Some(0));
    }

    /// Returns an `Available` that states the given number of free bytes.
    fn memory(bytes: u64) -> Available {
        Available { bytes, source: "a test".to_owned() }
    }

    #[test]
    fn a_tree_that_needs_more_memory_than_is_available_is_refused_once() {
        let scene = Arc::new(fixtures::single_triangle());
        let mut picker = Picker::default();
        let mut refused = |culling| {
            let asked = picker.ask_for_tree(&scene, culling, || memory(151));
            assert!(!picker.is_building());
            asked.err().map(|error| error.to_string()).unwrap_or_default()
        };
        let expected = "finding the triangle at the pointer needs about 152 B of memory";
        assert!(refused(Culling::None).starts_with(expected) && refused(Culling::None).is_empty());
        assert!(refused(Culling::Back).starts_with(expected), "another tree");
        assert!(picker.ask_for_tree(&scene, Culling::None, || memory(152)).is_ok() && picker.is_building());
    }

    #[test]
    fn a_second_tree_is_built_only_after_the_first() {
        let [first, second] = [0; 2].map(|_| Arc::new(fixtures::single_triangle()));
        let mut picker = Picker { of: Some((Arc::clone(&first), Culling::None)), ..Picker::default() };
        // The thread that builds the first tree waits until `sender` is dropped.
        let (sender, receiver) = channel::<()>();
        let mesh = Arc::clone(&first.mesh);
        let slow = move || {
            let _ = receiver.recv();
            Tree::new(&mesh, Culling::None)
        };
        picker.building = Builder::new().spawn(slow).ok();
        let is_of = |picker: &Picker, scene| picker.of.as_ref().is_some_and(|(of, _)| Arc::ptr_eq(of, scene));
        let mut sender = Some(sender);
        let deadline = Instant::now() + Duration::from_secs(120);
        while !is_of(&picker, &second) || picker.is_building() {
            picker.ask_for_tree(&second, Culling::None, || memory(152)).expect("room for a tree");
            assert!(sender.take().is_none() || is_of(&picker, &first), "two trees are being built");
            assert!(Instant::now() < deadline, "no tree is built");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(picker.bytes() > 0);
    }

    #[test]
    fn it_is_described_in_words() {
        let picked = Picked { triangle: 7, object: 1, material: 0, normal: [0.0, 0.999, -0.5] };
        assert_eq!(picked.text(), "triangle 7, object 1, material 0, normal (0.00, 1.00, -0.50)");
    }
}
