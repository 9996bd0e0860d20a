// Operations across the lanes of a group. A group consists of the 32 work-items (lanes) that share a tile. All lanes of
// a group must take the same path through every loop and branch that calls an operation across lanes.

#ifndef GROUP_LANES
#error "GROUP_LANES: work-items of a group"
#endif

// Four implementations of the operations across lanes; src/device/lanes.rs finds out which ones work on a device.
#define LANES_BY_BARRIERS 0     // __local memory and barriers; one group per work-group
#define LANES_BY_SUB_GROUPS 1   // OpenCL's sub-groups, of 32 work-items
#define LANES_BY_PTX_SHUFFLES 2 // inline PTX: votes and shuffles
#define LANES_BY_PTX 3          // inline PTX: votes, shuffles and reductions
#ifndef LANE_OPERATIONS
#error "LANE_OPERATIONS: one of LANES_BY_*"
#endif

// Except with LANES_BY_BARRIERS, compilers inline every function marked with INLINED, so that its arguments stay in
// registers, even arguments that are passed by pointer. With LANES_BY_BARRIERS, the compiler decides whether to inline.
// (The simulator Oclgrind uses LANES_BY_BARRIERS, and its compiler cannot inline functions.)
#if LANE_OPERATIONS == LANES_BY_BARRIERS
#define INLINED
#else
#define INLINED static __attribute__((always_inline))
#endif

typedef struct {
    int lane;   // this work-item's number in the group: 0 to 31
    int number; // the group's number within its work-group
#if LANE_OPERATIONS == LANES_BY_BARRIERS
    __local uint *board; // two words per lane, used in turn: see write_board
    int turn;            // which of the two words the next operation uses: 0 or 1
#endif
#if SAMPLED
    const __global uint *wanted;     // for each block of pixels: the number of samples of each pixel of the block
    uint earlier;                    // number of samples of each pixel that are already in the image
    int bits;                        // a pixel has 2^bits x 2^bits sub-pixels, each with room for one ray
    int samples;                     // rays that the frame casts for each pixel; the other sub-pixels stay empty
    const __global float *positions; // for each ray of a pixel: its position (x, y) in the pixel
    uint tile;                       // where the group's tile begins in the grid of rays: see packed_tile
#endif
} Group;

#define LOWEST_BIT(bits) (31 - clz((bits) & (0u - (bits))))
#define HIGHEST_BIT(bits) (31 - clz(bits))
// Returns how many of the set bits of `bits` belong to lanes before this one.
#define BITS_BEFORE(group, bits) popcount((bits) & ((1u << (group)->lane) - 1u))

#if LANE_OPERATIONS == LANES_BY_BARRIERS
#if LOCAL_X * LOCAL_Y != GROUP_LANES
#error "lanes that share barriers need a work-group of their own: 32 work-items"
#endif
#define GROUP_ATTRIBUTE
#define GROUP_LOCALS __local uint board[2 * GROUP_LANES];
#define BIND_GROUP(group)                                               \
    group.lane = (int)(get_local_id(1) * LOCAL_X + get_local_id(0)); \
    group.number = 0;                                                   \
    group.board = board;                                                \
    group.turn = 0;

// Loops over the lanes are not unrolled: there are many such loops, and programs with barriers compile slowly.
#define EACH_LANE(lane) _Pragma("unroll 1") for (int lane = 0; lane < GROUP_LANES; lane++)

INLINED void lane_sync(Group *group) { barrier(CLK_LOCAL_MEM_FENCE); }

// Writes a lane's value to a row of the board, a __local array with two rows of one word per lane. Returns the row,
// which then contains the values of all lanes. The two rows are used in turn:
//
//     lane 0    writes row 0 | barrier | reads row 0, writes row 1 | barrier | reads row 1, writes row 0 | ...
//     lane 31   writes row 0 | barrier |   reads row 0, writes row 1 | barrier |   reads row 1, ...
//
// One barrier per operation is enough: a lane writes row 0 again only after the second barrier, when all lanes have
// read row 0.
INLINED const __local uint *write_board(Group *group, uint value) {
    __local uint *row = group->board + GROUP_LANES * group->turn;
    group->turn ^= 1;
    row[group->lane] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    return row;
}

// Returns the `value` that the lane `from` has.
INLINED uint lane_get(Group *group, uint value, int from) { return write_board(group, value)[from]; }

// Returns a word in which bit i is set if `yes` is not 0 in lane i.
INLINED uint lane_ballot(Group *group, int yes) {
    // Each lane writes its own bit to the board, and then joins the bits of all 32 lanes.
    const __local uint *row = write_board(group, yes ? 1u << group->lane : 0u);
    uint bits = 0;
    EACH_LANE(lane) bits |= row[lane];
    return bits;
}

// Returns the smallest value of all lanes.
INLINED uint lane_least(Group *group, uint value) {
    const __local uint *row = write_board(group, value);
    uint least = value;
    EACH_LANE(lane) least = min(least, row[lane]);
    return least;
}

// Returns how many of the lanes whose bits are set in `among` have a smaller key than this lane.
INLINED int lane_rank(Group *group, uint key, uint among) {
    const __local uint *row = write_board(group, key);
    int rank = 0;
    for (uint left = among; left; left &= left - 1) rank += row[LOWEST_BIT(left)] < key;
    return rank;
}

#else
#define GROUP_LOCALS

#if LANE_OPERATIONS == LANES_BY_SUB_GROUPS
#ifdef cl_khr_subgroups
#pragma OPENCL EXTENSION cl_khr_subgroups : enable
#endif
#ifdef cl_khr_subgroup_ballot
#pragma OPENCL EXTENSION cl_khr_subgroup_ballot : enable
#endif
#ifdef cl_intel_required_subgroup_size
#pragma OPENCL EXTENSION cl_intel_required_subgroup_size : enable
#define GROUP_ATTRIBUTE __attribute__((intel_reqd_sub_group_size(GROUP_LANES)))
#else
#define GROUP_ATTRIBUTE
#endif
#define BIND_GROUP(group)                         \
    group.lane = (int)get_sub_group_local_id(); \
    group.number = (int)get_sub_group_id();

INLINED void lane_sync(Group *group) { sub_group_barrier(CLK_LOCAL_MEM_FENCE); }

INLINED uint lane_get(Group *group, uint value, int from) { return sub_group_broadcast(value, (uint)from); }

INLINED uint lane_ballot(Group *group, int yes) {
#ifdef cl_khr_subgroup_ballot
    return sub_group_ballot(yes).x;
#else
    return sub_group_reduce_add(yes ? 1u << group->lane : 0u);
#endif
}

INLINED uint lane_least(Group *group, uint value) { return sub_group_reduce_min(value); }

#else // inline PTX
#define GROUP_ATTRIBUTE
#define BIND_GROUP(group)                   \
    group.lane = (int)get_local_id(0);   \
    group.number = (int)get_local_id(1);
#if LOCAL_X != GROUP_LANES
#error "a group is a row of the work-group: 32 work-items across"
#endif

INLINED void lane_sync(Group *group) { asm volatile("bar.warp.sync 0xffffffff;" ::: "memory"); }

INLINED uint lane_get(Group *group, uint value, int from) {
    uint result;
    asm volatile("shfl.sync.idx.b32 %0, %1, %2, 0x1f, 0xffffffff;" : "=r"(result) : "r"(value), "r"(from));
    return result;
}

INLINED uint lane_ballot(Group *group, int yes) {
    uint bits;
    asm volatile("{ .reg .pred yes; setp.ne.s32 yes, %1, 0; vote.sync.ballot.b32 %0, yes, 0xffffffff; }"
                 : "=r"(bits)
                 : "r"(yes));
    return bits;
}

INLINED uint lane_least(Group *group, uint value) {
    uint least;
#if LANE_OPERATIONS == LANES_BY_PTX
    asm volatile("redux.sync.min.u32 %0, %1, 0xffffffff;" : "=r"(least) : "r"(value));
#else
    least = value;
    // A butterfly: after exchanges at distances 16, 8, 4, 2 and 1, every lane has the smallest of all 32 values.
    for (int distance = 16; distance; distance >>= 1) {
        uint other;
        asm volatile("shfl.sync.bfly.b32 %0, %1, %2, 0x1f, 0xffffffff;" : "=r"(other) : "r"(least), "r"(distance));
        least = min(least, other);
    }
#endif
    return least;
}
#endif

// Returns how many of the lanes whose bits are set in `among` have a smaller key than this lane.
INLINED int lane_rank(Group *group, uint key, uint among) {
    int rank = 0;
    // `left & (left - 1)` clears the lowest set bit of `left`: the loop runs once per lane of `among`.
    for (uint left = among; left; left &= left - 1) rank += lane_get(group, key, LOWEST_BIT(left)) < key;
    return rank;
}
#endif

// Returns `value`. With inline PTX, the compiler does not know that the result equals `value`. If the code calls this
// function wherever it needs a number that depends on `value`, the compiler computes this number each time, instead of
// keeping it in a register.
INLINED int forgotten(int value) {
#if LANE_OPERATIONS >= LANES_BY_PTX_SHUFFLES
    asm volatile("" : "+r"(value));
#endif
    return value;
}

// Returns 1 / a. With inline PTX, the result's error is at most one unit in the last place (subnormal numbers become
// 0). All uses in the kernels allow this error. An exact division would take five instructions with some compilers.
INLINED float reciprocal(float a) {
#if LANE_OPERATIONS >= LANES_BY_PTX_SHUFFLES
    float result;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(a));
    return result;
#else
    return 1.0f / a;
#endif
}

INLINED int lane_any(Group *group, int yes) { return lane_ballot(group, yes) != 0; }

INLINED float lane_get_float(Group *group, float value, int from) {
    return as_float(lane_get(group, as_uint(value), from));
}

// Returns the smallest of the lanes' numbers, none of which may be negative. The bits of floats of 0 or more, read as
// integers, have the same order as the floats.
INLINED float lane_least_positive(Group *group, float value) { return as_float(lane_least(group, as_uint(value))); }

// Returns the smallest of the lanes' numbers, which may be negative. The bits of the numbers are converted to unsigned
// integers of the same order, and back.
INLINED float lane_min(Group *group, float value) {
    const uint bits = as_uint(value);
    // As unsigned integers, positive floats have the right order and negative floats the reverse order. Inverting the
    // sign bit of positive floats, and all bits of negative floats, gives the right order to all floats.
    const uint least = lane_least(group, bits ^ ((uint)(as_int(value) >> 31) | 0x80000000u));
    return as_float(least & 0x80000000u ? least ^ 0x80000000u : ~least);
}

INLINED float lane_max(Group *group, float value) { return -lane_min(group, -value); }
