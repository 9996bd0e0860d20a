// The anchor: a fixed piece of work that runs make beside their frames, so that a later run on the same device can tell a
// slower kernel from a slower machine. It casts rays at spheres, with the loads, the arithmetic and the branch of a ray caster,
// and shares no line with the kernels that are compared. A change here is another anchor: times beside the old one say
// nothing of times beside the new one.

#ifndef SPHERES
#error "SPHERES: how many spheres each ray is tested against"
#endif
#ifndef GROUP
#error "GROUP: work-items of a work-group"
#endif

#define MISS 1e30f

// spheres: centre, and the squared radius in w. distances: one per work-item, MISS where its ray hits nothing.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void cast_at_spheres(
    __global const float4 *restrict spheres, __global float *restrict distances) {
    const uint ray = get_global_id(0);
    // The eye is at the origin and looks along z, through the 64 x 64 points of a square; later rays begin again.
    const float3 direction = (float3)((float)(ray % 64) / 32.0f - 1.0f, (float)(ray / 64 % 64) / 32.0f - 1.0f, 1.0f);
    const float length_squared = dot(direction, direction);
    float nearest = MISS;
    for (int i = 0; i < SPHERES; i++) {
        const float4 sphere = spheres[i];
        // The roots of |t * direction - centre| = radius.
        const float along = dot(direction, sphere.xyz);
        const float beside = dot(sphere.xyz, sphere.xyz) - sphere.w;
        const float discriminant = along * along - length_squared * beside;
        if (discriminant > 0.0f) {
            const float distance = (along - sqrt(discriminant)) / length_squared;
            if (distance > 0.0f && distance < nearest) nearest = distance;
        }
    }
    distances[ray] = nearest;
}
