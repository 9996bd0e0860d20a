// Area lights: rectangles and discs that emit light from their front only. Programs for scenes with area lights include
// this file. In scenes with area lights, a light has 16 floats. The last ten are 0 for a point light or a ball:
//
//     position (3) | power (3) | 4 x unit normal of the front (3) | edge (3) | other edge (3) | shape
//
// The shape is AREA_DISC for a disc, and another number except 0 for a rectangle. src/reference/{soft,shade}.rs compute
// area lights in f64.

#ifndef AREA_DISC
#error "AREA_DISC: the number of the shape of discs"
#endif

static int is_area_light(const __global float *light) { return light[15] != 0.0f; }

// Returns the irradiance from a light, divided by the irradiance from a point light of the same power at the same
// place. `to_light` is the unit vector towards the light. The light's front has the same radiance L = power / (pi A)
// everywhere and in all directions; A is the front's area. From a large distance r, at the angle a to the front's
// normal, the front fills the solid angle A cos(a) / r^2. A surface that faces the light thus receives L A cos(a) / r^2
// = power cos(a) / (pi r^2), which is 4 cos(a) times the irradiance power / (4 pi r^2) of a point light.
static varying share_towards(const __global float *light, Vec3 to_light) {
    if (!is_area_light(light)) return (varying)(1.0f);
    return max(-dot3(to_light, splat(LOAD3(light + 6))), (varying)(0.0f));
}

// Returns a point of an area light, relative to the light's centre. If a and b are uniformly distributed from 0 to 1,
// the point is uniformly distributed over the light's surface.
static Vec3 off_centre(const __global float *light, varying a, varying b) {
    varying across = a - 0.5f, down = b - 0.5f;
    if (light[15] == (float)AREA_DISC) {
        // The disc's radius is half an edge. The area within a radius r is proportional to r squared.
        const varying distance = 0.5f * sqrt(a);
        across = distance * sinpi(2.0f * b), down = distance * cospi(2.0f * b);
    }
    return along(scale(splat(LOAD3(light + 9)), across), down, splat(LOAD3(light + 12)));
}
