//! Buffers that contain a list of a mesh, such as its normals. A device that shares the host's memory reads the list
//! where the mesh stores it; any other device gets a copy.

use super::Queue;
use super::buffers::upload;
use crate::scene::Mesh;
use ocl::{Buffer, MemFlags, OclPrm};
use std::sync::Arc;

/// A read-only buffer for one of a mesh's lists, such as its normals. If the device shares the host's memory,
/// the mesh lends its list: the buffer uses the list's memory, and nothing is copied.
#[derive(Debug)]
pub(super) struct Lent<T: OclPrm> {
    buffer: Buffer<T>,
    commands: ocl::Queue,
    /// The mesh that owns the list. The mesh is neither changed nor freed while this reference exists.
    _mesh: Arc<Mesh>,
}

impl<T: OclPrm> Lent<T> {
    /// Makes a buffer that contains the list that `list` returns. If the device has memory of its own, the
    /// mesh's list is copied to this memory. The buffer of an empty list has one value.
    pub fn of(
        queue: &Queue,
        mesh: &Arc<Mesh>,
        list: impl for<'a> Fn(&'a Mesh) -> &'a [T],
    ) -> ocl::Result<Self> {
        let values = list(mesh);
        let buffer = if queue.shares_memory && !values.is_empty() {
            let builder = Buffer::builder().queue(queue.commands.clone()).flags(MemFlags::READ_ONLY);
            // SAFETY: the buffer is read-only, so that no command writes the list. The list in the buffer belongs to
            // the mesh, and `_mesh` keeps the mesh alive as long as the buffer. A caster keeps the tree, whose buffers
            // the caster's kernels use, and `drop` waits until no command uses the buffer. No command uses two buffers
            // of the same list of the mesh.
            unsafe { builder.use_host_slice(values) }.len(values.len()).build()?
        } else {
            upload(queue, values)?
        };
        Ok(Self { buffer, commands: queue.commands.clone(), _mesh: Arc::clone(mesh) })
    }

    /// Returns the OpenCL buffer that contains the list.
    pub fn buffer(&self) -> &Buffer<T> {
        &self.buffer
    }
}

impl<T: OclPrm> Drop for Lent<T> {
    /// Waits until no command uses the buffer.
    fn drop(&mut self) {
        // If waiting fails because the device has a fault, no command runs any more, so the error has no consequence.
        let _ = self.commands.finish();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::launch::Session;
    use crate::program::Sources;
    use crate::scene::load_scene;
    use crate::strategy::{Layout, Strategy, preset};
    use glam::Vec3;
    use std::path::Path;

    fn queue() -> Queue {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        Queue::open(&device).unwrap()
    }

    fn mesh(normals: usize) -> Arc<Mesh> {
        let normals = (0..normals).map(|index| Vec3::splat(index as f32)).collect();
        Arc::new(Mesh { normals, ..Mesh::default() })
    }

    fn read(lent: &Lent<f32>) -> Vec<f32> {
        let mut floats = vec![0.0; lent.buffer().len()];
        lent.buffer().read(&mut floats).enq().unwrap();
        floats
    }

    #[test]
    fn a_list_is_read_in_place_or_copied_and_its_mesh_is_kept() {
        for (queue, is_shared) in [(queue(), true), (queue().with_separate_memory(1 << 20), false)] {
            let mesh = mesh(100);
            let lent = Lent::of(&queue, &mesh, |mesh| bytemuck::cast_slice(&mesh.normals)).unwrap();
            let flags = lent.buffer().flags();
            assert_eq!(flags.unwrap().contains(MemFlags::new().use_host_ptr()), is_shared);
            assert_eq!(Arc::strong_count(&mesh), 2);
            let expected: Vec<f32> = mesh.normals.iter().flat_map(|normal| normal.to_array()).collect();
            drop(mesh);
            assert_eq!(read(&lent), expected, "{is_shared}");
        }
    }

    #[test]
    fn a_caster_keeps_the_mesh_that_its_kernels_read() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let mesh = Arc::clone(&scene.mesh);
        let strategy = Strategy { layout: Layout::INDEXED_32, ..preset("tile").unwrap().strategy };
        let mut session = Session::open(&device, &Sources::Embedded, scene).unwrap();
        let prepared = session.prepare(&strategy, [8, 8], [1, 1]).map_err(|refused| refused.reason());
        let prepared = prepared.unwrap();
        let caster = prepared.caster().map_err(|refused| refused.reason()).unwrap();
        drop((session, prepared));
        assert!(Arc::strong_count(&mesh) > 1);
        drop(caster);
        assert_eq!(Arc::strong_count(&mesh), 1);
    }

    #[test]
    fn an_empty_list_has_a_buffer_too() {
        let lent = Lent::of(&queue(), &mesh(0), |mesh| bytemuck::cast_slice(&mesh.normals)).unwrap();
        assert_eq!(read(&lent), [0.0]);
    }
}
