// A tile of rays with a common origin (the eye, or a light) traverses the tree together, as in tile_cpu/. In tile_gpu/,
// a group of 32 work-items (lanes) owns the tile. Each lane has three tasks: lane i casts RAYS of the tile's rays,
// tests child i of a node, and prepares triangle i of a leaf. __local memory holds the group's stack, and those
// triangles of a leaf against which the group's rays are tested.
//
// A pass consists of rays that run mainly along one axis of the scene. Let the pass's axis be z. Relative to the rays'
// origin, the point of a ray at depth z is (x z, y z, z); x and y are the ray's slopes. Over a triangle, 1/z is a
// linear function of the slopes x and y, and so are the edge functions. The nearest hit has the largest 1/z.

#if SAMPLED // a pixel may have several rays, each through a different point of the pixel
#define SUBPIXELS
#endif
#include "common/tile.cl"
#if WATERTIGHT
#include "common/exact_signs.cl"
#endif
#include "common/tree.cl"
#include "common/intersect_plane.cl"
#include "common/shadow_end.cl"
#include "common/tile_masks.cl"
#include "common/reflectance.cl"
#if HALF_LIGHT
#include "common/pixel_rows.cl"
#include "common/half_light.cl"
#endif
#include "common/lanes.cl"

#if WIDTH != 1 || TILE_X % 8 || TILE_Y % 4
#error "a group's tile consists of blocks of 8 x 4 rays, WIDTH 1"
#endif
#if NODE_WIDTH != GROUP_LANES
#error "a group walks a tree of 32 children per node"
#endif
#ifndef LEFTOVER_KERNEL
#error "LEFTOVER_KERNEL: 0 or 1: whether a separate kernel casts the leftover shadow rays"
#endif
#ifndef PLANES_OF_ORIGIN
#error "PLANES_OF_ORIGIN: 0 or 1: whether a row per triangle is prepared for the eye and each light"
#endif

// A tile of 8 x 8 pixels consists of two blocks of 8 x 4 pixels, so that each of the 32 lanes has two rays.
//
//     ray 0:   lane  0  1  2  3  4  5  6  7      ray 1:   the same lanes, four rows of pixels below
//                    8  9 10 11 12 13 14 15
//                   16 17 18 19 20 21 22 23
//                   24 25 26 27 28 29 30 31
//
// A lane has three roles in turn: it owns its rays, it tests child `lane` of a node, and it prepares triangle `lane` of
// a leaf.
#define RAYS (TILE_X * TILE_Y / GROUP_LANES)
#define EACH_RAY(ray) _Pragma("unroll") for (int ray = 0; ray < RAYS; ray++)
#define HAS(bits, ray) (((bits) >> (ray)) & 1u)

// A ray can join a pass only if its direction's component along the pass's axis is more than ALONG_AXIS times the
// direction's 1-norm. The leader, the ray that determines the axis, can join: the component of its direction
// along this axis is the largest, and so at least a third of the 1-norm.
#define ALONG_AXIS 0.25f
// A pass may be restricted to rays close to its leader (the ray that determines the pass's axis). The largest distance
// of a ray from the leader is in this case NEIGHBOURS times the distance between neighbouring rays. A tile's rays to
// one surface are at most as far apart as the tile is wide, so NEIGHBOURS is the width of a tile in rays.
#define NEIGHBOURS ((float)TILE_X)
// The lane in the middle of the 8 x 4 lanes. If this lane still has a ray to cast, one of its rays becomes the leader
// of the pass (see ALONG_AXIS).
#define MIDDLE_LANE 20

#include "tile_gpu/shaft.cl"

// A lane's rays in a pass. A ray that is not in the pass, or is finished, has nearest = FAR.
typedef struct {
    float x[RAYS], y[RAYS]; // the rays' slopes: x and y per unit of z
    float nearest[RAYS];  // 1/z of the nearest hit so far, or of the ray's end
    float ceiling[RAYS];  // hits at this 1/z, or at a larger 1/z, are too near and are ignored
    int leaf_index[RAYS]; // the nearest triangle so far, as an index in leaf order
#if CUTOUTS
    Vec3 point[RAYS]; // the points of Directions, in coordinates along the pass's axes
#endif
} RayPacket;

// A lane's rays before they are divided into passes. x, y and z are the rays' directions, which may have any length. A
// ray's t is its distance from the origin, divided by the length of the ray's direction. All rays begin at 1/t =
// `per_begin`, which is FAR for rays that begin at the origin. All rays end at 1/t = `per_end`, which is 0 for rays
// without an end.
typedef struct {
    float x[RAYS], y[RAYS], z[RAYS];
    float per_begin, per_end;
#if CUTOUTS
    // A point of each ray: the eye, or the hit to which a shadow ray runs. The point at which a mask is read is
    // computed from this point. (Computed from a distant light, the point in the mask would lose its last digits.)
    Vec3 point[RAYS];
#endif
} Directions;

// Returns the component of a ray's direction along the axis of a pass, or 0 if this component is too small for the ray
// to join the pass (see ALONG_AXIS).
INLINED float depth_of(const Shaft *shaft, float x, float y, float z) {
    const float depth = shaft->sign * component(x, y, z, shaft->along);
    return depth > ALONG_AXIS * (fabs(x) + fabs(y) + fabs(z)) ? depth : 0.0f;
}

#include "tile_gpu/intersect/{intersector}.cl"

// Estimates how far the rays of neighbouring lanes are from the leading ray of a pass. (The leading ray determines the
// pass's axis.) `leader` is the lane of the leading ray. Of each lane's rays, only the ray with the same number as the
// leading ray counts. `distance` is the distance of this ray from the leading ray, measured in slopes (x and y per unit
// of z), or FAR if the ray cannot join the pass. The function takes the nearer of the two neighbours in the row of the
// lane `leader`, and the nearer of the two neighbours in the column of this lane. It returns the larger of these two
// distances. If only the row or only the column has a neighbour with a ray, the function returns the distance of this
// neighbour's ray; if neither has one, it returns FAR. The lanes form a block of 8 x 4, so the indices of neighbours
// differ by 1 in a row, and by 8 in a column. At the block's edge, the index wraps around to the opposite edge.
INLINED float spacing_at(Group *group, float distance, int leader) {
    const int row = leader & ~7;
    const float left = lane_get_float(group, distance, row | ((leader - 1) & 7));
    const float right = lane_get_float(group, distance, row | ((leader + 1) & 7));
    const float above = lane_get_float(group, distance, (leader - 8) & 31);
    const float below = lane_get_float(group, distance, (leader + 8) & 31);
    const float across = fmin(left, right), down = fmin(above, below);
    return fmax(across, down) < FAR ? fmax(across, down) : fmin(across, down);
}

// Begins a pass, in which rays walk the tree together. Chooses a leading ray, which determines the pass's axis. Finds
// the rays of `todo` that belong to the pass, and computes the shaft and the packet of these rays. With `close`, only
// rays close to the leading ray's direction belong to the pass. Returns which of this lane's rays belong to the pass,
// one bit each. The leading ray always belongs to its pass, unless its direction is zero or not a number (NaN).
INLINED uint begin_pass(Group *group, const Tree *tree, Origin origin, const Directions *directions, uint todo,
                        const int close, Shaft *shaft, RayPacket *packet) {
    // All lanes choose the same lane, `leader`. The first remaining ray of the lane `leader` determines the pass's
    // axis. If the lane in the middle of the 8 x 4 lanes still has a ray, all choose this lane, because its rays are
    // closest to the rays of the other lanes. Otherwise, the first lane that still has a ray is chosen.
    const uint lanes = lane_ballot(group, todo != 0);
    const int leader = HAS(lanes, MIDDLE_LANE) ? MIDDLE_LANE : LOWEST_BIT(lanes);
    // `first` has a single bit: the bit of the leading ray among the rays of the lane `leader`. In every lane, `own` is
    // the direction of the lane's own ray that has the same number as the leading ray.
    const uint first = lane_get(group, todo & (0u - todo), leader);
    Uniform3 direction = uniform3(0.0f, 0.0f, 0.0f);
    EACH_RAY(ray) if (HAS(first, ray)) direction = uniform3(directions->x[ray], directions->y[ray], directions->z[ray]);
    const Uniform3 own = direction;
    direction.x = lane_get_float(group, direction.x, leader);
    direction.y = lane_get_float(group, direction.y, leader);
    direction.z = lane_get_float(group, direction.z, leader);
    // The axis of the largest component of the leader's direction becomes the pass's z. Slopes are a direction's
    // components along the pass's x and y, per unit of z.
    aim(group, tree, origin, direction, shaft);

    const float per_leader = reciprocal(fabs(component(direction.x, direction.y, direction.z, shaft->along)));
    const float leader_x = component(direction.x, direction.y, direction.z, shaft->across) * per_leader;
    const float leader_y = component(direction.x, direction.y, direction.z, shaft->down) * per_leader;
    // Rays from the eye are close to each other. Shadow rays may be far apart, since their hits may lie on several
    // surfaces. With `close`, only rays near the leading ray belong to the pass.
    float tolerance = FAR;
    if (close) {
        const float depth = depth_of(shaft, own.x, own.y, own.z), per_depth = reciprocal(depth);
        const float x = component(own.x, own.y, own.z, shaft->across) * per_depth;
        const float y = component(own.x, own.y, own.z, shaft->down) * per_depth;
        const int beside = (todo & first) && depth > 0.0f;
        const float spacing = spacing_at(group, beside ? fabs(x - leader_x) + fabs(y - leader_y) : FAR, leader);
        tolerance = (spacing < FAR ? NEIGHBOURS * spacing : 0.0f) + 2.0f * SLOPE_ROUNDING;
    }

    // Computes the slopes of each ray (x and y per unit of z), and the box around the slopes of the pass's rays.
    uint joining = 0;
    float low_x = FAR, high_x = -FAR, low_y = FAR, high_y = -FAR;
    EACH_RAY(ray) {
        const float depth = depth_of(shaft, directions->x[ray], directions->y[ray], directions->z[ray]);
        const float per_depth = depth > 0.0f ? reciprocal(depth) : 0.0f;
        const float x = component(directions->x[ray], directions->y[ray], directions->z[ray], shaft->across) * per_depth;
        const float y = component(directions->x[ray], directions->y[ray], directions->z[ray], shaft->down) * per_depth;
        const int joins = HAS(todo, ray) && depth > 0.0f &&
                          (!close || (fabs(x - leader_x) < tolerance && fabs(y - leader_y) < tolerance));
        joining |= joins ? 1u << ray : 0u;
        low_x = joins ? fmin(low_x, x) : low_x;
        high_x = joins ? fmax(high_x, x) : high_x;
        low_y = joins ? fmin(low_y, y) : low_y;
        high_y = joins ? fmax(high_y, y) : high_y;
        packet->x[ray] = x;
        packet->y[ray] = y;
        // Distances are stored as 1 / z, where z is t times the direction's component along the pass's axis.
        packet->nearest[ray] = joins ? directions->per_end * per_depth : FAR;
        packet->ceiling[ray] = fmin(directions->per_begin * per_depth, FAR);
#if CUTOUTS
        packet->point[ray] = point_along_axes(shaft, directions->point[ray]);
#endif
    }
    widen(shaft, lane_min(group, low_x), lane_max(group, high_x), lane_min(group, low_y), lane_max(group, high_y));
    return joining;
}

#include "tile_gpu/walk.cl"
#include "tile_gpu/frame.cl"
#include "tile_gpu/shadow.cl"
#include "tile_gpu/shade.cl"
