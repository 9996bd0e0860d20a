// Pixels that are shaded once. If a frame divides each pixel into 4 x 4 sub-pixels (see FrameSamples), a vector's rays
// are the samples of one pixel. Mostly, all samples hit the same triangle, and their radiance hardly differs. A pixel
// whose samples hardly differ is shaded only once, at the mean position of its samples, together with other pixels. In
// most variables of this file, a lane belongs to a whole vector of rays (as in Slices). Each lane thus belongs to one
// pixel, not to one ray.
//
//     each sample shaded: a vector per pixel     pixels shaded once: a vector for 16 pixels
//     pixel 0:   lane    0 1 2 3 4 ...           lane    0 1 2 3 4 ...
//                sample  0 1 2 3 4 ...           pixel   0 1 2 3 4 ...
//     pixel 1:   lane    0 1 2 3 4 ...
//                sample  0 1 2 3 4 ...
//
// Each sample still has its own shadow ray. If a light reaches only some of a pixel's samples, the radiance that this
// light causes is computed for each reached sample, at the sample's own hit (light_once.cl).

// The largest estimated relative error of a pixel that is shaded once: a tenth of the tolerance of verification.
#define ONCE_ERROR 1e-4f
// A part of a tile (see PARTS) has up to 16 pixels, one per vector of rays. In at least LEAST_ONCE of these pixels, all
// samples of the pixel must hit the same triangle; otherwise, no pixel of the part is shaded once. For fewer pixels, it
// takes less time to shade each sample.
#define LEAST_ONCE 3

// The positions of a frame's samples in their pixel, in units of a pixel's side.
typedef struct {
    float x, y;                     // the mean position
    float variance;                 // an upper bound of the variance along any line: max(xx, yy) + |xy| (Gershgorin)
    float left, right, top, bottom; // bounds of the positions, relative to the mean position
    float reach;                    // the largest distance of the four bounds from the mean position
} SamplePositions;

// The pixels that are shaded once.
typedef struct {
    uint vectors;                    // the pixels that are shaded once, one bit each
    uint split;                      // the pixels of `vectors` in which a light reaches some samples, but not all
    varying sum[3][PARTS];           // red, green and blue from the lights that reach all samples
    varying inverse_depth[3][PARTS]; // a vector; 1 / t of a hit is its dot product with the ray's direction
    Shaded mean[PARTS];              // the hit at the mean position of the samples
    Vec3 low[PARTS], high[PARTS];    // the box that contains the hits of all samples
    varying radius[PARTS];           // an upper bound of the distance between a sample's hit and `mean`
} OncePixels;

// The corners and normals of the triangles of 16 pixels: vectors with one lane per triangle (from gather_rows).
typedef struct {
    varying corner[12], normal[12];
} Triangles;

// How a hit changes from one pixel to the next, across or down, to first order.
typedef struct {
    Vec3 point;      // the change of the hit
    varying depth;   // the change of t, divided by t; later, its absolute value
    varying eye;     // the rays' directions turn by at most this angle, in radians
    varying turn;    // the normals turn by at most this angle, in radians
    varying stretch; // the change of the interpolated normal's length, divided by this length
} PixelStep;

SamplePositions sample_positions(const FrameSamples *samples) {
    const Mask filled = samples->filled;
    const varying zero = (varying)(0.0f);
    const float per_sample = 1.0f / (float)samples->count;
    SamplePositions positions;
    positions.x = per_sample * sum_of_lanes(SELECT(filled, samples->x, zero));
    positions.y = per_sample * sum_of_lanes(SELECT(filled, samples->y, zero));
    const varying x = SELECT(filled, samples->x - positions.x, zero);
    const varying y = SELECT(filled, samples->y - positions.y, zero);
    positions.variance =
        per_sample * (max(sum_of_lanes(x * x), sum_of_lanes(y * y)) + fabs(sum_of_lanes(x * y)));
    positions.left = least_lane(x), positions.right = most_lane(x);
    positions.top = least_lane(y), positions.bottom = most_lane(y);
    positions.reach = max(max(-positions.left, positions.right), max(-positions.top, positions.bottom));
    return positions;
}

// Finds the vectors of rays in `hit` whose samples all hit the same triangle, and returns one bit for each. `triangles`
// receives the triangles' indices in leaf order, one lane per vector. The lanes of all other vectors get one of these
// indices, too, so that every lane can load a triangle.
static uint vectors_on_one_triangle(const FrameSamples *samples, const Bundle *bundle, uint hit, varying_int *triangles) {
    IntLanes index[PARTS];
    uint found = 0;
    int last = 0;
    for (; hit; hit &= hit - 1) {
        const int vector = LOWEST_BIT(hit);
        const varying_int hits = bundle->leaf_index[vector];
        const int first = hits.s0; // lane 0 has the frame's first sample
        if (first == NO_HIT || ANY(samples->filled & (hits != first))) continue;
        found |= 1u << vector;
        index[vector / 16].each[vector % 16] = last = first;
    }
    for (int part = 0; part < PARTS; part++)
        triangles[part] = SELECT(LANES_OF(found, part), index[part].all, (varying_int)(last));
    return found;
}

static varying length_of(Vec3 a) { return sqrt(dot3(a, a)); }
static varying largest_of(Vec3 a) { return max(max(a.x, a.y), a.z); }

// Computes `inverse_depth` from the planes of the pixels' triangles, and how hits change from pixel to pixel (`right`,
// `below`). `d` has the directions through the mean positions; adding `across` or `down` gives the next pixel's
// direction. Returns the pixels for which the computed numbers are accurate enough.
Mask find_planes(OncePixels *once, int part, const Triangles *triangles, const SamplePositions *samples, Vec3 origin,
                 Vec3 d, Vec3 across, Vec3 down, PixelStep *right, PixelStep *below) {
    const varying *corner = triangles->corner, *normal = triangles->normal;
    const Shaded *mean = once->mean + part;
    const Vec3 v0 = vec3(corner[0], corner[1], corner[2]);
    const Vec3 e1 = subtract(vec3(corner[4], corner[5], corner[6]), v0);
    const Vec3 e2 = subtract(vec3(corner[8], corner[9], corner[10]), v0);
    const Vec3 n = cross3(e1, e2);
    // Points origin + t d of the plane satisfy n . (t d) = n . (mean - origin), so 1 / t = d . m with the vector
    // m = n / (n . (mean - origin)).
    const Vec3 m = scale(n, 1.0f / dot3(n, subtract(mean->point, origin)));
    once->inverse_depth[0][part] = m.x, once->inverse_depth[1][part] = m.y, once->inverse_depth[2][part] = m.z;
    const varying inv_t = dot3(d, m), t = 1.0f / inv_t, length = length_of(d);
    // From one pixel to the next, 1 / t changes by the dot product of m with `across` or `down`.
    right->depth = -t * dot3(across, m), below->depth = -t * dot3(down, m);
    right->point = scale(along(across, right->depth, d), t), below->point = scale(along(down, below->depth, d), t);
    right->eye = length_of(across) / length, below->eye = length_of(down) / length;
    // If the hit moves by p, the barycentric weight w1 (of e1) changes by p . g1 / (n . n), since e1 . g1 = n . n and
    // e2 . g1 = 0. The weight w2 (of e2) changes by p . g2 / (n . n).
    const Vec3 g1 = cross3(e2, n), g2 = cross3(n, e1);
    const Vec3 n0 = vec3(normal[0], normal[1], normal[2]), n1 = vec3(normal[4], normal[5], normal[6]);
    const Vec3 n2 = vec3(normal[8], normal[9], normal[10]), turn1 = subtract(n1, n0), turn2 = subtract(n2, n0);
    // The interpolated normal turns by at most the length of its change divided by its own length. `least` is a lower
    // bound of its own length: each corner's normal has at least this component along the mean position's normal.
    const varying least = min(min(dot3(n0, mean->normal), dot3(n1, mean->normal)), dot3(n2, mean->normal));
    const varying squared = dot3(n, n), per = 1.0f / (squared * least);
    const Vec3 to_right = add(scale(turn1, dot3(right->point, g1)), scale(turn2, dot3(right->point, g2)));
    const Vec3 to_below = add(scale(turn1, dot3(below->point, g1)), scale(turn2, dot3(below->point, g2)));
    right->turn = per * length_of(to_right), below->turn = per * length_of(to_below);
    right->stretch = per * fabs(dot3(to_right, mean->normal));
    below->stretch = per * fabs(dot3(to_below, mean->normal));
    // Rounding would matter if e1 and e2 were nearly parallel, or if rays grazed the plane. If a sample's t differed
    // by more than about a tenth from the t at the mean position, the sample's hit would lie too far from the linear
    // function of the sample's position that approximates it.
    return (least > 0.0f) & (squared > 0.0625f * dot3(e1, e1) * dot3(e2, e2)) &
           (fabs(d.x * m.x) + fabs(d.y * m.y) + fabs(d.z * m.z) < 20.0f * inv_t) &
           ((fabs(right->depth) + fabs(below->depth)) * samples->reach < 0.1f);
}

// For each pixel, computes a box that contains the hits of all samples of the pixel. The samples' positions lie in a
// rectangle, so the hits lie in a quadrilateral: the rays through the rectangle's corners meet the triangle's plane in
// the corners of the quadrilateral.
void bound_hits(OncePixels *once, int part, const SamplePositions *samples, varying depth, const PixelStep *right,
                const PixelStep *below) {
    const Vec3 mean = once->mean[part].point;
    Vec3 low = mean, high = mean;
    varying squared = (varying)(0.0f);
    for (int corner = 0; corner < 4; corner++) {
        const varying x = (varying)(corner & 1 ? samples->right : samples->left);
        const varying y = (varying)(corner & 2 ? samples->bottom : samples->top);
        const varying t = 1.0f / (1.0f - x * right->depth - y * below->depth); // relative to t at the mean position
        const Vec3 away = scale(add(scale(right->point, x), scale(below->point, y)), t);
        squared = max(squared, dot3(away, away));
        const Vec3 hit = add(mean, away);
        low = vec3(min(low.x, hit.x), min(low.y, hit.y), min(low.z, hit.z));
        high = vec3(max(high.x, hit.x), max(high.y, hit.y), max(high.z, hit.z));
    }
    // find_planes returns only pixels in which the relative rounding error of 1 / t is at most about 20 times that of a
    // single product.
    const varying rounding = 1e-5f * depth + 1e-6f * (fabs(mean.x) + fabs(mean.y) + fabs(mean.z));
    const Vec3 wider = vec3(rounding, rounding, rounding);
    once->low[part] = subtract(low, wider), once->high[part] = add(high, wider);
    once->radius[part] = sqrt(squared);
}

// The properties of a light at a pixel that the function second_derivative needs.
typedef struct {
    varying per_distance;    // 1 / distance of the light
    varying per_cosine;      // 1 / |cosine| of the angle between the normal and the direction to the light
    varying per_half;        // 1 / length of the sum of the directions to the light and to the eye
    varying shininess;       // the exponent s of the highlight (reflectance.cl)
    varying tangent_squared; // tan^2 of the angle between the half vector and the normal
    varying glossy;          // the highlight's fraction of the radiance, where the highlight is brightest
} LightAtPixel;

// Returns an upper bound of the angle by which the direction to the light turns in one step, from a pixel to the next.
static varying light_turn(const LightAtPixel *light, const PixelStep *step) {
    return length_of(step->point) * light->per_distance;
}

// Returns an upper bound of the angle by which the half vector turns relative to the normal in one step, from a pixel
// to the next. The half vector lies halfway between the directions to the light and to the eye.
static varying half_turn(const LightAtPixel *light, const PixelStep *step) {
    return (light_turn(light, step) + step->eye) * light->per_half + step->turn;
}

// Returns an upper bound of the second derivative of the radiance, divided by the radiance. The derivative is with
// respect to the position in the picture; the unit of length is one step, from a pixel to the next. The radiance is
// proportional to the reflectance times cosine / r^2, where r is the light's distance.
static varying second_derivative(const LightAtPixel *light, const PixelStep *step) {
    const varying to_light = light_turn(light, step), turn = half_turn(light, step), s = light->shininess;
    // `first` and `second` bound |g'| / g and |g''| / g for g = n . v / r^3 (v: hit to light). With respect to the
    // hit's position, v / r^3 has first and second derivatives of at most 2 / r^3 and 6 / r^4. A step moves the hit by
    // r * to_light. With b = step->turn, |g'| / g is at most b + 2 to_light, divided by the cosine. |g''| / g is at
    // most b^2, plus 2 b (stretch + depth) + 4 depth to_light + 4 b to_light + 6 to_light^2, divided by the cosine.
    // (The hit's path p bends where depth changes: |p''| = 2 depth |p'|.) The factors 3, 8 and 4 in the code suffice.
    const varying first = (step->turn + 3.0f * to_light) * light->per_cosine;
    const varying second = step->turn * (step->turn + 2.0f * step->stretch * light->per_cosine) +
                           (8.0f * to_light + 4.0f * step->depth) * (to_light + step->turn) * light->per_cosine;
    // The highlight h is cos^s of the angle between half vector and normal. If this angle changed by exactly `turn` per
    // step, |h'| / h would be s tan * turn, and |h''| / h at most (s + s^2 tan^2) turn^2. Two terms are added. One is
    // the term 2 h' g' of (h g)'', where g = cosine / r^2. The other is 2 s tan * turn * bend, because half vector and
    // normal are no linear functions of the pixel. Each of the two terms, 2 x y, is at most x^2 + y^2.
    const varying power = s + 3.0f * s * s * light->tangent_squared, bend = step->stretch + step->depth;
    return second + light->glossy * (turn * turn * power + first * first + bend * bend);
}

// Computes glossy and tangent_squared of a light that shines on the pixels in `lit`. `power` is the light's power, and
// `reach` the largest distance of a sample from the mean position, across or down. Returns the pixels that do not
// contain the highlight's border.
Mask bound_highlight(const Shaded *mean, Vec3 to_light, Uniform3 power, float reach, const PixelStep *right,
                     const PixelStep *below, Mask lit, LightAtPixel *light) {
    light->tangent_squared = light->glossy = (varying)(0.0f);
    const Mask glossy = lit & (mean->surface.kind > 0.0f);
    if (!ANY(glossy)) return (Mask)(-1);
    // A small highlight can be much brighter at a sample than at the mean. `nearest` is an upper bound of cos(half
    // vector, normal) at the samples: the half vector turns by at most `turn` (1.1 allows for second derivatives).
    const varying turn = 1.1f * reach * (half_turn(light, right) + half_turn(light, below));
    const varying cosine = dot3(add(to_light, mean->to_eye), mean->normal) * light->per_half;
    const varying here = max(cosine, (varying)(0.0f)), sine = sqrt(max(1.0f - cosine * cosine, (varying)(0.0f)));
    const varying nearest = clamp(cosine + turn * (sine + turn), (varying)(0.0f), (varying)(1.0f));
    const varying s = light->shininess, factor = 0.125f * (s + 8.0f);
    const varying most = factor * power_of(nearest * nearest, 0.5f * s);
    const varying at_mean = factor * power_of(here * here, 0.5f * s);
    // Reflectances are multiplied by the light's colour: light and surface may be bright in different channels.
    const Vec3 colour = splat(uniform_scale(power, 1.0f / max(max(power.x, max(power.y, power.z)), FLT_MIN)));
    const Vec3 k_g = multiply(colour, mean->surface.glossy);
    const Vec3 all = add(multiply(colour, mean->surface.lambertian), scale(k_g, at_mean));
    light->glossy =
        SELECT(glossy, most * largest_of(k_g) / max(largest_of(all), (varying)(FLT_MIN)), (varying)(0.0f));
    light->tangent_squared = 1.0f / max(here * here, (varying)(1e-6f)) - 1.0f + turn * turn;
    return !glossy | (fabs(cosine) > 2.0f * turn); // the highlight ends where the half vector leaves the surface
}

// Returns the pixels that one light allows to be shaded once. In such a pixel, all samples have the light on the same
// side of the surface, and the light is farther away than twice the bias. Moreover, shading once changes the pixel's
// radiance little.
Mask shade_alike(const OncePixels *once, int part, const Lighting *lighting, int number, const SamplePositions *samples,
                 const PixelStep *right, const PixelStep *below) {
    const Shaded *mean = once->mean + part;
    LightDirection direction;
    find_light_direction(lighting, number, mean, &direction);
    const Mask lit = direction.cosine > 0.0f;
    const Vec3 half_vector = add(direction.to_light, mean->to_eye);
    LightAtPixel light;
    light.per_distance = direction.per_distance;
    // The numbers 1e-6 keep the divisions finite.
    light.per_cosine = 1.0f / max(fabs(direction.cosine), (varying)(1e-6f));
    light.per_half = 1.0f / sqrt(dot3(half_vector, half_vector) + 1e-6f);
    light.shininess = mean->surface.shininess;
    const Uniform3 power = LOAD3(lighting->lights + LIGHT_FLOATS * number + 3);
    const Mask smooth = bound_highlight(mean, direction.to_light, power, samples->reach, right, below, lit, &light);
    const varying second = second_derivative(&light, right) + second_derivative(&light, below);
    // The light is on the same side of the surface for all samples if the angle between normal and light, in radians,
    // changes by less than the absolute value of the angle's cosine. The factor 4 leaves a margin.
    const varying turn = right->turn + below->turn + 2.0f * once->radius[part] * direction.per_distance;
    const Mask one_side = 4.0f * turn * light.per_cosine < 1.0f;
    // The mean of a function differs from the function's value at the mean position by about half the function's second
    // derivative times the variance of the positions.
    const Mask alike = smooth & (0.5f * samples->variance * second < ONCE_ERROR);
    return one_side & (direction.distance > 2.0f * lighting->bias) & (!lit | alike);
}

// Finds the pixels that can be shaded once, and computes for each of them the hit at the mean position of its samples.
// `hit` has a bit for each vector with a hit.
void find_once(OncePixels *once, const FrameSamples *samples, const Bundle *bundle, const SurfaceTree *tree,
               const Lighting *lighting, CAMERA_PARAMETERS, uint hit) {
    once->vectors = once->split = 0;
    if (!IS_PIXEL_A_VECTOR(samples)) return;
    varying_int triangles[PARTS];
    const uint found = vectors_on_one_triangle(samples, bundle, hit, triangles);
    if (popcount(found) < LEAST_ONCE) return;
    const SamplePositions positions = sample_positions(samples);
    const Vec3 origin = splat(LOAD3((const float *)&eye));
    const Vec3 across = splat(LOAD3((const float *)&step_x)), down = splat(LOAD3((const float *)&step_y));
    for (int part = 0; part < PARTS; part++) {
        Mask pixels = LANES_OF(found, part);
        if (popcount(LANE_BITS16(pixels)) < LEAST_ONCE) continue;
        const varying x = TO_FLOAT(FIRST_COLUMN(LANES + 16 * part)) + positions.x;
        const varying y = TO_FLOAT(FIRST_ROW(LANES + 16 * part)) + positions.y;
        const Vec3 d = along(along(splat(LOAD3((const float *)&corner)), x, across), y, down);
        const varying length = length_of(d);
        Triangles columns;
        gather_rows(tree->tree.leaves, ROW_FLOATS / 3, triangles[part], columns.corner);
        gather_normals(&tree->normals, triangles[part], AS_INT(columns.corner[3]), columns.normal);
        compute_surface_points(lighting, origin, scale(d, 1.0f / length), columns.corner, columns.normal, pixels,
                               once->mean + part);
        PixelStep right, below;
        pixels &= find_planes(once, part, &columns, &positions, origin, d, across, down, &right, &below);
        bound_hits(once, part, &positions, length_of(subtract(once->mean[part].point, origin)), &right, &below);
        right.depth = fabs(right.depth), below.depth = fabs(below.depth);
        for (int light = 0; light < lighting->light_count; light++)
            pixels &= shade_alike(once, part, lighting, light, &positions, &right, &below);
        once->vectors |= LANE_BITS16(pixels) << (16 * part);
        for (int channel = 0; channel < 3; channel++) once->sum[channel][part] = (varying)(0.0f);
    }
}
