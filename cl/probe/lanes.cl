// Tests whether one implementation of the operations across lanes works on a device. Each lane computes results that
// the host knows; a wrong result means that the implementation does not work. Lane i of group g uses the number (7i+g)
// mod 32, which differs from lane to lane within a group.

#if !defined(LOCAL_X) || !defined(LOCAL_Y)
#error "LOCAL_X, LOCAL_Y: lanes of a group, and groups of the work-group"
#endif

#include "common/lanes.cl"

#define ANSWERS 8

__kernel __attribute__((reqd_work_group_size(LOCAL_X, LOCAL_Y, 1))) GROUP_ATTRIBUTE void probe_lanes(PROBE_LANES_PARAMETERS) {
    GROUP_LOCALS
    __local uint words[LOCAL_Y][GROUP_LANES];
#if LANE_OPERATIONS == LANES_BY_SUB_GROUPS
    // A driver may make sub-groups of another size than GROUP_LANES. The number of a group or of a lane could then be
    // too large for the arrays `words` and `answers`. With such sub-groups, the kernel writes nothing, and the host
    // finds no `answers`.
    if (get_sub_group_size() != GROUP_LANES) return;
#endif
    Group group;
    BIND_GROUP(group)
    const uint own = (7u * (uint)forgotten(group.lane) + (uint)group.number) & 31u;
    __global uint *answer = answers + ANSWERS * (GROUP_LANES * group.number + group.lane);
    // The host knows what each of the eight results in `answer` must be (src/device/lanes.rs).
    answer[0] = lane_ballot(&group, own % 3u == 0u);
    answer[1] = lane_get(&group, own, 5);
    answer[2] = lane_least(&group, own + 100u);
    answer[3] = (uint)lane_rank(&group, own, 0x0f0f00ffu);
    answer[4] = as_uint(lane_min(&group, (float)own - 15.5f));
    answer[5] = as_uint(lane_max(&group, (float)own - 15.5f));
    // Tests whether lane_sync makes a lane's store visible to the other lanes.
    words[group.number][group.lane] = own;
    lane_sync(&group);
    answer[6] = words[group.number][31 - group.lane];
    answer[7] = own;
}
