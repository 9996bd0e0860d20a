//! Predicts, before anything is allocated, how much of the host's memory casting needs: the largest number of bytes in
//! use at any moment.

use super::requirements::{CORNER_COLOURS_BYTES, global_beside_mesh, scene_beside_mesh, scratch};
use super::sum::Sum;
use super::{Infeasible, Strategy, Workload};
use crate::accel::Bvh;
use crate::memory::{Available, resident_bytes};
use crate::scene::{Mapped, Material, Mesh};

/// Bytes of the program, its libraries and a driver whose device shares the host's memory. With PoCL 3.1,
/// casting a scene of one triangle took 258 to 305 MB (2026-11-27), in runs in which LLVM 15 compiled the
/// kernels. Of all presets, `tile-group` needed the most memory. A process that lists all devices also starts
/// the drivers of other devices. `PROGRAM_BYTES` does not include the drivers of other devices. On a machine
/// with an NVIDIA GPU, casting a picture with the CPU took up to 84 MB more.
const PROGRAM_BYTES: u64 = 305_000_000;
/// The host's bytes for the program, its libraries and a driver, if the driver's device has memory of its
/// own. With NVIDIA's driver 580.159.04 and an H200, 432 MB were measured for a small picture (2026-11-27).
const PROGRAM_BYTES_BESIDE_GPU: u64 = 432_000_000;
/// An upper bound of the bytes per triangle in the reference's tree. `REFERENCE_BYTES` assumes 80 bytes for a
/// triangle, and 72 bytes for two nodes. In fact, a triangle takes only 44 bytes.
pub const REFERENCE_BYTES: u64 = 80 + 72;
/// Bytes per pixel of the reference: a sample (`PixelSample`, 96 bytes), the radiance, the alpha, the share of the
/// pixel's samples that hit something, and whether the pixel is certain.
const REFERENCE_PIXEL_BYTES: u64 = 96 + 12 + 4 + 4 + 1;
/// Bytes per pixel of a picture: radiance that was read back, 8-bit channels, and the file.
const PICTURE_BYTES: u64 = 12 + 3 + 3;

/// Bytes of a material. A mesh with vertex colours may have millions of materials.
const MATERIAL_BYTES: u64 = size_of::<Material>() as u64;

/// Bytes per triangle of the mesh for the texture coordinates and the numbers of the texture and the mask.
const MAPPED_BYTES: u64 = size_of::<Mapped>() as u64;

/// Bytes per pixel for verifying a picture with soft light at half resolution: the picture's unoccluded light
/// and hits, two half pictures (of half the width and height) with their hits and ratios, and the picture
/// that is expected from all of these.
const LIGHT_PARTS_BYTES: u64 = 12 + 4 + (12 + 12 + 4 + 24) / 4 + 12;

/// Bytes per pixel while layers are computed: radiance and alpha of the picture, two counts, and the optional
/// hit of the pixel's ray (depth, normal, base colour and triangle).
const LAYERS_COMPUTED_BYTES: u64 = 16 + 8 + 36;
/// Bytes per pixel while layers are written: radiance and alpha of the picture, all layers, and a second copy
/// of all these numbers as channels of an EXR.
const LAYERS_WRITTEN_BYTES: u64 = 2 * (16 + 44);

/// What the host does with a picture after it has been cast.
#[derive(Clone, Copy, Debug, Default)]
pub struct Afterwards {
    /// True if the picture is compared with the reference.
    pub verified: bool,
    /// True if the picture's layers are computed and written.
    pub layers: bool,
}

/// The bytes of the host's memory in use at several moments of the work. Each moment has its own sum of
/// bytes. Casting needs as much memory as the largest of these sums.
#[derive(Clone, Debug)]
pub struct HostNeeds {
    /// The bytes that the program, its libraries and the driver need. At every moment of the work,
    /// `program_bytes` is a part of the sum of bytes in use.
    program_bytes: u64,
    moments: Vec<(&'static str, Sum)>,
}

impl HostNeeds {
    /// Returns the memory that `strategy` needs for `workload` until the picture has been cast and the work that
    /// `afterwards` names has been done. `shared` means that the device uses the host's memory.
    pub fn of(strategy: &Strategy, workload: &Workload, shared: bool, afterwards: Afterwards) -> Self {
        let w = workload;
        let pixels = pixels(w);
        let program_bytes = if shared { PROGRAM_BYTES } else { PROGRAM_BYTES_BESIDE_GPU };
        let base = base_memory(w, program_bytes);
        let mut moments = Vec::new();
        if strategy.needs_tree() {
            let mut sum = base.clone();
            // `WideBvh::of_mesh` makes the tree from a binary tree. The sum of bytes assumes that the binary
            // tree has small leaves. This is so with fewer than 32 children per node. With 32 children per
            // node, the binary tree may have larger leaves, and then needs less memory than this sum.
            let leaf_size = strategy.leaf_size.triangles().min(Bvh::LEAF_SIZE);
            let build_bytes = Bvh::build_bytes(w.triangles as u64, leaf_size as u64);
            sum.add("tree being built", &[(build_bytes, " B")]);
            moments.push(("building the tree", sum));
        }
        let mut casting = base.clone();
        if strategy.needs_tree() {
            // While the triangles are uploaded, only the leaf order of the tree is left in the host's memory: the
            // host's copy of the nodes is freed before. The sum counts uploading and casting as one moment.
            casting.add("leaf order", &[(4, " B"), (w.triangles as u64, " triangles")]);
        }
        if shared {
            casting.join(global_beside_mesh(strategy, w));
            casting.join(scratch(strategy, w));
        }
        casting.add("picture", &[(PICTURE_BYTES, " B"), (pixels, " pixels")]);
        moments.push(("casting", casting));
        if afterwards.layers {
            moments.extend(with_layers(strategy, w, shared, &base));
        }
        if afterwards.verified {
            let mut sum = base;
            sum.add("reference's tree", &[(REFERENCE_BYTES, " B"), (w.triangles as u64, " triangles")]);
            sum.add("reference", &[(REFERENCE_PIXEL_BYTES + 12, " B"), (pixels, " pixels")]);
            if w.half_light {
                sum.add("parts with soft light", &[(LIGHT_PARTS_BYTES, " B"), (pixels, " pixels")]);
            }
            if shared {
                // An experiment keeps the caster while its picture is compared, since the caster is timed afterwards.
                sum.join(global_beside_mesh(strategy, w));
                sum.join(scratch(strategy, w));
            }
            moments.push(("verifying", sum));
        }
        Self { program_bytes, moments }
    }

    /// Returns the largest number of bytes of the host's memory that are in use at any moment.
    pub fn bytes(&self) -> u64 {
        self.moments.iter().map(|(_, sum)| sum.recorded()).max().unwrap_or(0)
    }

    /// Returns the number of bytes that [`Self::bytes`] returns, minus the bytes of the program, its
    /// libraries and the driver.
    pub fn bytes_beside_program(&self) -> u64 {
        self.bytes().saturating_sub(self.program_bytes)
    }

    /// Returns an error if casting needs more memory than this process can have now. The process can have the available
    /// memory, plus the memory that it already uses for casting. `other_bytes` is the number of bytes that this process
    /// uses for data that `self` does not count.
    pub fn check_now(&self, other_bytes: u64) -> Result<(), Infeasible> {
        self.check(&Available::read(), own_bytes(resident_bytes(), other_bytes))
    }

    /// Returns an error if the needs exceed the available memory plus `own_bytes`. `own_bytes` is the part of the needs
    /// that this process has already allocated, such as the program and the mesh.
    pub fn check(&self, available: &Available, own_bytes: u64) -> Result<(), Infeasible> {
        let limit = available.bytes.saturating_add(own_bytes);
        let Some((moment, sum)) = self.moments.iter().max_by_key(|(_, sum)| sum.bytes) else { return Ok(()) };
        sum.within(&format!("{} ({moment})", Infeasible::ON_HOST), limit).map_err(|refused| {
            Infeasible::beyond(format!("{} according to {}", refused.reason, available.source))
        })
    }
}

/// Returns the number of bytes that this process uses, minus `other_bytes`. `resident_bytes` is `None` if the
/// system does not report the bytes that this process uses.
fn own_bytes(resident_bytes: Option<u64>, other_bytes: u64) -> u64 {
    resident_bytes.unwrap_or(0).saturating_sub(other_bytes)
}

/// Returns the part of the host's memory that is in use at every moment: the program, the driver and the
/// scene's data.
fn base_memory(w: &Workload, program_bytes: u64) -> Sum {
    let mut base = Sum::default();
    base.add("program and driver", &[(program_bytes, " B")]);
    base.add("mesh", &[(mesh_bytes(w), " B")]);
    base.add("materials", &[(MATERIAL_BYTES, " B"), (w.materials as u64, "")]);
    if w.is_textured() {
        base.add("textures", &[(4, " B"), (w.texture_words as u64, " words")]);
        base.add("places in textures", &[(MAPPED_BYTES, " B"), (w.triangles as u64, " triangles")]);
    }
    if w.corner_colours {
        base.add("corner colours", &[(CORNER_COLOURS_BYTES, " B"), (w.triangles as u64, " triangles")]);
    }
    if w.sky_texels > 0 {
        base.add("sky", &[(12, " B"), (w.sky_texels as u64, " texels")]);
    }
    base
}

/// Returns the memory in use while a picture's layers are computed, and while they are written. The buffers
/// of the caster's frame are freed before the layers (such as depth and normals) are computed. A device that
/// shares the host's memory still holds the scene. To find out how many tests each ray needs, raycl also
/// builds a second tree. The second tree is freed before the reference's tree is built, and is smaller than
/// the reference's tree, so the returned sums do not count the second tree.
fn with_layers(strategy: &Strategy, w: &Workload, shared: bool, base: &Sum) -> [(&'static str, Sum); 2] {
    let mut computing = base.clone();
    if shared {
        computing.join(scene_beside_mesh(strategy, w));
    }
    let mut writing = computing.clone();
    computing.add("reference's tree", &[(REFERENCE_BYTES, " B"), (w.triangles as u64, " triangles")]);
    computing.add("picture and hits", &[(LAYERS_COMPUTED_BYTES, " B"), (pixels(w), " pixels")]);
    writing.add("picture and layers", &[(LAYERS_WRITTEN_BYTES, " B"), (pixels(w), " pixels")]);
    [("computing the layers", computing), ("writing the layers", writing)]
}

fn pixels(w: &Workload) -> u64 {
    u64::from(w.image_size[0]) * u64::from(w.image_size[1])
}

/// Returns the bytes of a mesh with a workload's sizes.
fn mesh_bytes(w: &Workload) -> u64 {
    Mesh::bytes(w.triangles as u64, w.positions as u64, w.normals as u64)
}

#[cfg(test)]
mod tests {
    use super::super::{Layout, Requirements, preset};
    use super::*;
    use crate::reference::layers::PixelHit;

    fn workload(triangles: usize, side: u32) -> Workload {
        Workload {
            triangles,
            positions: triangles / 2,
            normals: triangles / 2,
            materials: 1,
            lights: 1,
            image_size: [side, side],
            local_size: [1, 1],
            ..Workload::default()
        }
    }

    fn needs(name: &str, w: &Workload, shared: bool, verified: bool) -> HostNeeds {
        let strategy = preset(name).map(|preset| preset.strategy);
        let afterwards = Afterwards { verified, layers: false };
        HostNeeds::of(&strategy.unwrap_or_else(|error| panic!("{error}")), w, shared, afterwards)
    }

    #[test]
    fn more_triangles_pixels_or_work_never_need_less() {
        let small = workload(1_000_000, 1000);
        let bytes =
            |w: &Workload, shared, verified| needs("tile", w, shared, verified).bytes_beside_program();
        let base = bytes(&small, true, false);
        assert!(bytes(&workload(10_000_000, 1000), true, false) > base + 9_000_000 * 100);
        assert!(bytes(&workload(1_000_000, 8000), true, false) > base + 63_000_000 * 20);
        assert!(bytes(&small, true, true) > base);
        assert!(bytes(&small, false, false) <= base);
        let colourful = bytes(&Workload { materials: 10_000_001, ..small }, false, false);
        assert_eq!(colourful, bytes(&small, false, false) + 10_000_000 * MATERIAL_BYTES);
    }

    /// A triangle has six texture coordinates, and the numbers of a texture and of a mask, which may be missing.
    #[test]
    fn textures_and_the_places_of_triangles_in_them_are_counted_as_the_mesh_stores_them() {
        let plain = workload(1_000, 10);
        let textured = Workload { texture_words: 5_000, ..plain };
        let bytes = |w: &Workload| needs("tile", w, false, false).bytes_beside_program();
        assert_eq!(bytes(&textured) - bytes(&plain), 4 * 5_000 + (6 * 4 + 2 * 8) * 1_000);
    }

    #[test]
    fn the_driver_of_a_device_with_its_own_memory_needs_more_of_the_hosts() {
        let w = workload(1, 64);
        for (shared, program_bytes) in [(true, 305_000_000), (false, 432_000_000)] {
            let needs = needs("tile", &w, shared, false);
            assert_eq!(needs.bytes() - needs.bytes_beside_program(), program_bytes, "{shared}");
        }
    }

    #[test]
    fn a_refusal_names_the_moment_and_every_term() {
        let available = Available { bytes: 1_000_000_000, source: "a test".to_owned() };
        let needs = needs("tile", &workload(10_000_000, 100), false, false);
        let reason = needs.check(&available, 0).map_err(|refused| refused.reason).unwrap_err();
        // The tree being built takes 10 M x (32 + 4) B for boxes and the leaf order, and 8,000,002 x 32 B for nodes.
        // The mesh takes 10 M x (28 + 12 / 2 + 12 / 2) B.
        assert_eq!(
            reason,
            "the host's memory (building the tree): program and driver 432000000 B + mesh 400000000 B \
             + materials 52 B x 1 \
             + tree being built 616000064 B = 1448000116 B > 1000000000 B according to a test"
        );
        assert!(needs.check(&available, 600_000_000).is_ok());
    }

    #[test]
    fn bytes_of_others_are_not_available_to_a_strategy() {
        assert_eq!([own_bytes(Some(10), 3), own_bytes(Some(10), 11), own_bytes(None, 3)], [7, 0, 0]);
    }

    #[test]
    fn a_device_that_shares_the_hosts_memory_has_its_buffers_and_working_vectors_there() {
        let w = workload(10, 4000);
        let naive = preset("naive").unwrap().strategy;
        assert_eq!(Requirements::working_bytes(&naive, &w), 108 * 4000 * 4000);
        let beside_program = |shared| needs("naive", &w, shared, false).bytes_beside_program();
        let [shared, own] = [true, false].map(beside_program);
        assert_eq!(shared - own, Requirements::buffer_bytes(&naive, &w));
    }

    #[test]
    fn a_device_that_shares_the_hosts_memory_reads_indexed_normals_in_place() {
        let w = workload(1_000_000, 100);
        let rows = preset("tile").unwrap().strategy;
        let indexed = Strategy { layout: Layout::INDEXED_32, ..rows };
        let bytes = |strategy: &Strategy, shared| {
            HostNeeds::of(strategy, &w, shared, Afterwards::default()).bytes_beside_program()
        };
        let casting = |strategy: &Strategy, shared| {
            let needs = HostNeeds::of(strategy, &w, shared, Afterwards::default());
            needs.moments.iter().find(|(moment, _)| *moment == "casting").unwrap().1.recorded()
        };
        assert_eq!(casting(&rows, true) - casting(&indexed, true), 36 * 1_000_001);
        assert_eq!(casting(&rows, false), casting(&indexed, false));
        assert!(bytes(&indexed, true) < bytes(&rows, true));
        // A device with memory of its own holds a copy of the mesh's normals (12 bytes each) and triangles (28 bytes).
        let of_tree = |strategy: &Strategy| Requirements::tree_bytes(strategy, &w);
        assert_eq!(of_tree(&rows) + (12 * 500_000 + 28 * 1_000_000), of_tree(&indexed) + 36 * 1_000_001);
    }

    #[test]
    fn a_picture_is_verified_while_the_buffers_and_working_vectors_of_its_caster_exist() {
        let w = workload(10, 4000);
        let pixels = 4000 * 4000;
        let naive = preset("naive").unwrap().strategy;
        let compared = (REFERENCE_PIXEL_BYTES + 12) * pixels;
        let beside_program = |shared| needs("naive", &w, shared, true).bytes_beside_program();
        let [shared, own] = [true, false].map(beside_program);
        assert_eq!(shared - own, Requirements::buffer_bytes(&naive, &w));
        assert!(own > compared && own < compared + 1_000_000, "{own}");
    }

    #[test]
    fn layers_are_computed_with_a_tree_and_then_written_with_a_copy() {
        let strategy = preset("deferred").unwrap().strategy;
        let beside_scene = |w: &Workload, shared| {
            let afterwards = Afterwards { layers: true, ..Afterwards::default() };
            let of_device = if shared { Requirements::scene_bytes(&strategy, w) } else { 0 };
            let needs = HostNeeds::of(&strategy, w, shared, afterwards);
            needs.bytes_beside_program() - mesh_bytes(w) - MATERIAL_BYTES - of_device
        };
        for shared in [false, true] {
            // With many triangles, the reference's tree needs most of the memory; with many pixels, the copy of the
            // layers does.
            assert_eq!(beside_scene(&workload(10_000_000, 100), shared), 152 * 10_000_000 + 60 * 10_000);
            assert_eq!(beside_scene(&workload(10, 4000), shared), 120 * 4000 * 4000);
        }
        let of_layers = LAYERS_COMPUTED_BYTES as usize;
        assert_eq!(of_layers, 16 + 2 * size_of::<u32>() + size_of::<Option<PixelHit>>());
        assert!(Bvh::build_bytes(1_000_000, 4) < 1_000_000 * REFERENCE_BYTES, "the tree that counts tests");
    }

    #[test]
    fn without_a_tree_casting_is_the_worst_moment() {
        let available = Available { bytes: 0, source: "a test".to_owned() };
        let reason =
            needs("deferred", &workload(10, 4000), true, false).check(&available, 0).unwrap_err().reason;
        assert!(reason.contains("(casting)") && reason.contains("image 16 B x 16000000 pixels"), "{reason}");
    }
}
