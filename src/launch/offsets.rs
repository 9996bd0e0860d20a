//! Tests of offsets, indices and positions, many of which have more than 31 bits. Most of the tests' kernels
//! compute addresses, but read nothing from these addresses, so that the tests need no large buffers. The
//! kernels of this file's last two tests compute indices, and positions of tiles.

use super::alone::Alone;
use super::buffers::{allocate, upload};
use crate::manifest::{LIGHT_FLOATS, SAMPLED_BLOCK, soup_floats};
use crate::scene::Material;
use crate::sources::Sources;
use ocl::Buffer;

/// Size of a `float` in kernels, in bytes.
const FLOAT: u64 = 4;

/// Returns the results of a kernel with two parameters: a list of `len` results, and a buffer. From a result
/// that is an address, the kernel subtracts the address of the buffer's start.
fn results_of(device: &Alone, kernel: &str, len: usize) -> Vec<u64> {
    let buffer: Buffer<f32> = allocate(&device.queue, 1).unwrap();
    device.results(len, |results| device.kernel(kernel, 1).arg(results).arg(&buffer).build())
}

/// Returns the addresses of a work-item's nine working vectors, in bytes from the start of the scratch buffer.
/// `functions` are macros that replace functions of OpenCL C, such as `get_global_size`.
fn addresses_of_vectors(functions: &str) -> Vec<u64> {
    // In this test's kernel, reading a working vector returns not the vector's value but the address of its
    // first number.
    let before = format!(
        "typedef float varying;
         typedef struct {{ float x, y, z; ulong address; }} Vec3;
         Vec3 vec3_at(ulong address) {{ Vec3 v; v.address = address; return v; }}
         #define vec3(x, y, z) vec3_at((ulong)&(x))
         {functions}"
    );
    let after = "__kernel void find(__global ulong *results, __global float *scratch) {
                     Working working;
                     BIND_WORKING(working)
                     for (int which = 0; which < 9; which++)
                         results[which] = working_get(&working, which).address - (ulong)scratch;
                 }";
    results_of(&Alone::of([&before, after], &["cast/vectors/global.cl"], ""), "find", 9)
}

#[test]
fn the_working_vectors_of_a_billion_work_items_do_not_overlap() {
    const ITEMS: u64 = 1_000_000_000;
    let sizes = format!("#define get_global_size(dimension) ((dimension) ? (size_t)1 : (size_t){ITEMS})");
    let expected: Vec<u64> = (0..9).map(|which| which * 3 * ITEMS * FLOAT).collect();
    assert_eq!(addresses_of_vectors(&sizes), expected);
}

/// A band consists of some of a frame's rows of work-groups. The band of this test has 4 rows of 10
/// work-items and begins in row 20 of the frame. The test looks at the last work-item of this band of rows.
/// The work-items in the frame's rows above the band have no vectors in the buffer.
#[test]
fn the_working_vectors_of_a_band_are_counted_from_its_first_work_item() {
    const ITEMS: u64 = 4 * 10;
    let functions = "#define get_global_size(dimension) ((dimension) ? (size_t)4 : (size_t)10)
         #define get_global_offset(dimension) ((dimension) ? (size_t)20 : (size_t)0)
         #define get_global_id(dimension) ((dimension) ? (size_t)23 : (size_t)9)";
    let expected: Vec<u64> = (0..9).map(|which| 3 * (which * ITEMS + ITEMS - 1) * FLOAT).collect();
    assert_eq!(addresses_of_vectors(functions), expected);
}

#[test]
fn the_last_of_a_hundred_million_triangles_lies_after_all_others() {
    const TRIANGLE: u64 = 100_000_000;
    // In this test, reading a corner returns not the corner's coordinates but their address.
    let before = format!(
        "#define VERTEX_SPACE __global
         #define NORMAL_SPACE __global
         #define MATERIAL_SPACE __global
         #define LOAD3(at) ((ulong)(at))
         #define get_global_id(dimension) ((dimension) ? 0 : {TRIANGLE})
         #define PREPARE_ORIGINS_PARAMETERS __global ulong *results, const __global float *soup
         #define planes_of(corners, from, sign) corners
         #define uniform3(x, y, z) 0ul
         #define STORE_ROW(row, to) results[0] = (row).a - (ulong)soup;
         #define lights soup
         #define triangle_count ({TRIANGLE} + 1)
         typedef ulong Uniform3;
         typedef union {{ float all, each[1]; }} Lanes;
         typedef struct {{ ulong a, b, c; }} Corners;
         typedef Corners Row;"
    );
    let after = "__kernel void find(__global ulong *results, const __global float *soup) {
                     Geometry geometry;
                     geometry.vertices = soup;
                     results[0] = corners(&geometry, get_global_id(0)).a - (ulong)soup;
                 }";
    let files = ["cast/layout/soup.cl", "cast/prepare_origins.cl"];
    let stride = soup_floats(false);
    let options = format!(
        "-D SOUP_STRIDE={stride} -D MATERIAL_FLOATS={} -D LIGHT_FLOATS={LIGHT_FLOATS}",
        Material::FLOATS
    );
    let device = Alone::of([&before, after], &files, &options);
    let expected = TRIANGLE * stride as u64 * FLOAT;
    assert_eq!([results_of(&device, "find", 1), results_of(&device, "prepare_origins", 1)], [[expected]; 2]);
}

#[test]
fn the_loop_over_a_queue_ends_at_the_largest_number_of_entries() {
    let text = Sources::Embedded.read_joined("tile_gpu/shade.cl").unwrap().0;
    let queued = text.lines().find(|line| line.starts_with("#define FOR_QUEUED")).expect("the loop");
    // The kernel leaves the loop after four entries of the queue, in case the loop never ends.
    let after = "__kernel void find(__global ulong *results, const __global float *unused) {
                     const uint count = 0xffffffffu, first = count - 100u, groups = 60u;
                     int n = 0;
                     for (int at = 0; at < 4; at++) results[at] = 0;
                     FOR_QUEUED(i, first, groups, count) {
                         if (n == 4) break;
                         results[n++] = i;
                     }
                 }";
    let device = Alone::of([queued, after], &[], "");
    let most = u64::from(u32::MAX);
    assert_eq!(results_of(&device, "find", 4), [most - 100, most - 40, 0, 0]);
}

/// Returns the program of a kernel that stores the first column and row of tiles that cover rough blocks. Each
/// work-item computes the tile of one group. A tile has 8 x 8 rays, and each pixel has 4 x 4 rays. The functions of
/// tile_gpu/frame.cl that compute the tile come before `// STACK_LOCALS`.
fn tiles_of_rough_blocks() -> Alone {
    let text = Sources::Embedded.read_joined("tile_gpu/frame.cl").unwrap().0;
    let (_, rest) = text.split_once("INLINED int2 tile_in_row").expect("the first function");
    let (functions, _) = rest.split_once("// STACK_LOCALS").expect("the end of the last function");
    let after = format!(
        "#define INLINED
         #define get_global_id(dimension) 0
         #define get_group_id(dimension) 0
         #define get_num_groups(dimension) 1
         typedef struct {{ int number, bits; }} Group;
         INLINED int2 tile_in_row{functions}
         #undef get_global_id
         __kernel void find(__global int *results, const __global uint *rough, int rough_count) {{
             Group group;
             group.number = (int)get_global_id(0), group.bits = 2;
             const int2 at = unpacked_tile(own_tile(&group, rough, rough_count));
             results[2 * group.number] = at.x, results[2 * group.number + 1] = at.y;
         }}"
    );
    let options = format!(
        "-D SAMPLED=1 -D SAMPLED_BLOCK={SAMPLED_BLOCK} -D TILE_X=8 -D TILE_Y=8 -D LOCAL_Y=1 -D TILES_ACROSS=1 \
         -D TILES_DOWN=1"
    );
    Alone::of(["", &after], &["common/samples.cl"], &options)
}

/// A picture may have 65,536 pixels across and down. A block's column and row therefore have up to 14 bits. A tile's
/// packed column and row have up to 16 bits.
#[test]
fn the_tiles_of_rough_blocks_lie_in_their_blocks() {
    let blocks: [[u32; 2]; 6] = [[0, 0], [255, 256], [256, 255], [1, 16_383], [16_383, 1], [16_383, 16_383]];
    let device = tiles_of_rough_blocks();
    let rough: Vec<u32> = blocks.iter().map(|[column, row]| row << 16 | column).collect();
    let rough = upload(&device.queue, &rough).unwrap();
    let items = 4 * blocks.len() + 1;
    let found: Vec<i32> = device.results(2 * items, |found| {
        device.kernel("find", items).arg(found).arg(&rough).arg(blocks.len() as i32).build()
    });
    // A block has 16 x 16 rays, and so 2 x 2 tiles. The last group has no tile, and gets a position beyond every
    // picture.
    let tiles = blocks.iter().flat_map(|block| {
        [[0, 0], [8, 0], [0, 8], [8, 8]]
            .map(|within| [0, 1].map(|axis| 16 * block[axis] as i32 + within[axis]))
    });
    let expected: Vec<i32> = tiles.chain([[8 * 0xffff, 4 * 0xffff]]).flatten().collect();
    assert_eq!(found, expected);
}
