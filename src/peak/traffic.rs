//! The number of bytes that a ray-triangle test reads, which depends on the strategy.

use crate::record::Record;
use crate::strategy::{Axis as _, Copied, Intersector, Layout, Triangles, Vectors, WorkingMemory};

/// Bytes of the two working vectors that a kernel reads for each test of a primary ray: the ray's origin and
/// direction, three floats each. A common-origin test does not need the origin. The kernel reads the origin
/// for a common-origin test too, because accesses to the working vectors are volatile.
const RAY_BYTES: f64 = 24.0;
/// Bytes of a triangle's three corners.
const CORNER_BYTES: f64 = 36.0;
const FLOAT_BYTES: f64 = 4.0;

/// The bytes that the test of one ray against one triangle reads. Caches are not considered: these numbers count the
/// bytes that work-items request, not the bytes that come from a device's memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic<'a> {
    /// Bytes that a work-item reads of one triangle, divided by the number of rays of the work-item, since a
    /// work-item reads a triangle once for all its rays.
    pub triangle_bytes: f64,
    /// The memory that contains the triangle.
    pub triangle_in: &'a str,
    /// Bytes that the test reads of the ray; 0 with private vectors.
    pub ray_bytes: f64,
    /// The memory that contains the ray.
    pub ray_in: &'a str,
}

impl<'a> Traffic<'a> {
    /// Returns the bytes that one ray-triangle test of a measured point reads. If the point's record states
    /// the bytes of the triangle, all values come from the record. The result is then `None` if the record
    /// lacks the bytes of the ray, the memory of the ray or the memory of the triangle. Records of earlier
    /// versions of raycl do not state how many bytes a test reads of its triangle. For these records, the
    /// result is that of [`Self::by_headers`].
    pub fn of(record: &'a Record) -> Option<Self> {
        let Some(triangle_bytes) = record.triangle_bytes_per_test else { return Self::by_headers(record) };
        Some(Self {
            triangle_bytes,
            triangle_in: record.triangle_memory.as_deref()?,
            ray_bytes: record.ray_bytes_per_test?,
            ray_in: record.ray_memory.as_deref()?,
        })
    }

    /// Returns the bytes that each ray-triangle test of a record's strategy reads. These numbers depend
    /// on the headers of the kernel files that implement the strategy's values. Returns `None` for baselines,
    /// and if this version of raycl does not know one of the strategy's values. Also returns `None` for
    /// strategies that do not test every primary ray against every triangle: their number of tests is unknown, so
    /// the bytes per test would not yield the bytes of a frame.
    pub fn by_headers(record: &Record) -> Option<Self> {
        if record.is_baseline() || !record.tests_every_triangle() {
            return None;
        }
        let triangles = Triangles::parse(record.axis("triangles")?).ok()?;
        let vectors = Vectors::parse(record.axis("vectors")?).ok()?;
        let width: f64 = record.axis("width")?.parse().ok()?;
        let ray_in = match vectors.memory() {
            WorkingMemory::Private => "registers",
            WorkingMemory::Local => "__local",
            WorkingMemory::Scratch | WorkingMemory::Heap => "global",
        };
        Some(Self {
            triangle_bytes: triangle_bytes(record, triangles)? / width,
            triangle_in: match triangles.copied() {
                Copied::Scene | Copied::Vertices | Copied::Rows => "__local",
                Copied::Nothing | Copied::Normals if triangles.are_constant() => "__constant",
                Copied::Nothing | Copied::Normals => "global",
            },
            ray_bytes: if vectors.memory() == WorkingMemory::Private { 0.0 } else { RAY_BYTES },
            ray_in,
        })
    }

    /// Returns the total number of bytes that a test reads.
    pub fn bytes(&self) -> f64 {
        self.triangle_bytes + self.ray_bytes
    }
}

/// Returns the bytes of a triangle that a test reads: numbers that were prepared for the test, or corners with their
/// indices.
fn triangle_bytes(record: &Record, triangles: Triangles) -> Option<f64> {
    let test = Intersector::parse(record.axis("intersector")?).ok()?;
    let prepared = test.prepares_planes()
        || record.axis("records") == Some("once")
        || triangles.copied() == Copied::Rows;
    if prepared {
        return Some(FLOAT_BYTES * test.record_floats() as f64);
    }
    let layout = Layout::parse(record.axis("layout")?).ok()?;
    let index_bytes = layout.index_bits().map_or(0.0, |bits| f64::from(bits) / 8.0);
    Some(CORNER_BYTES + 3.0 * index_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::preset;

    fn traffic(strategy: &str) -> Option<Traffic<'static>> {
        let (name, set) = strategy.split_once(',').unwrap_or((strategy, ""));
        let mut strategy = preset(name).expect("a preset").strategy;
        if let Some((axis, value)) = set.split_once('=') {
            strategy.set(axis, value).expect("a value");
        }
        Traffic::by_headers(&Record { strategy: strategy.to_string(), ..Record::default() })
    }

    #[test]
    fn a_test_reads_a_triangle_and_a_ray_that_is_not_in_registers() {
        let of = |strategy| {
            traffic(strategy).map(|one| (one.triangle_bytes, one.triangle_in, one.ray_bytes, one.ray_in))
        };
        assert_eq!(of("naive"), Some((36.0, "global", 24.0, "global")));
        assert_eq!(of("naive,layout=indexed16"), Some((42.0, "global", 24.0, "global")));
        assert_eq!(of("naive,records=once"), Some((48.0, "global", 24.0, "global")));
        assert_eq!(of("naive,intersector=common-origin"), Some((48.0, "global", 24.0, "global")));
        assert_eq!(of("local-vectors"), Some((36.0, "global", 24.0, "__local")));
        assert_eq!(of("tiled"), Some((48.0, "__local", 0.0, "registers")));
        assert_eq!(of("deferred,width=4"), Some((9.0, "global", 0.0, "registers")));
        assert_eq!(of("bvh"), None, "the number of tests in a tree is unknown");
        assert_eq!(traffic("naive").map(|one| one.bytes()), Some(60.0));
    }
}
