// Chooses the rays of a pixel's sample: rays to points of lights with an extent, and a ray to the sky. The choices
// follow Sobol's sequence in two dimensions. The samples are numbered along a Z-order curve through the pixels, so that
// the samples of a pixel and of its neighbours are evenly distributed (Ahmed and Wonka, "Screen-Space Blue-Noise
// Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels", ACM TOG 39(6), 2020). Owen's scrambling
// makes the sequences of different lights independent. src/reference/soft.rs computes the same numbers as numbers_of,
// bit for bit, and then computes the rays from these numbers in f64.

#ifndef SOFT_HEAD_FLOATS
#error "SOFT_HEAD_FLOATS: number of floats that describe the sky, before the lights' radii"
#endif

#if WIDTH == 1
typedef uint varying_uint;
#define AS_UINT(a) as_uint(a)
#else
typedef PASTE(uint, WIDTH) varying_uint;
#define AS_UINT(a) PASTE(as_uint, WIDTH)(a)
#endif

typedef struct {
    // First, the sky: its radiance at the zenith (3 floats) and at the horizon (3), the upward direction (3), and the
    // sky's reach (see reach_of_sky). (environment.cl shows the floats of a sky that is a picture.) After the sky, one
    // radius per light follows (see radius_of).
    const __global float *numbers;
    // All pixels get a first round of samples; pixels of rough blocks also get a second round. sample.x is the number,
    // within its round, of the first sample that this frame casts for each pixel. sample.y is the round's number of
    // samples per pixel. If sample.y is 0, the picture is unoccluded: see IS_UNOCCLUDED.
    uint2 sample;
#ifdef SUBPIXELS
    varying_uint lane_sample; // the number of each lane's sample, minus sample.x
#endif
} Soft;
#ifdef SUBPIXELS
#define SAMPLE_NUMBER(soft) ((soft)->sample.x + (soft)->lane_sample)
#else
#define SAMPLE_NUMBER(soft) ((soft)->sample.x)
#endif

// With soft light at half resolution (half_light.cl), some pictures have the light that would arrive if nothing blocked
// it. In these pictures of unoccluded light, sample.y is 0, and lights are points. No ray is cast to the sky: each hit
// receives the mean of the sky's radiance around the hit's normal (mean_of_sky).
#if HALF_LIGHT
#ifndef INTERLEAVED
#error "INTERLEAVED: number of pixels across and down after which the points of lights repeat, a power of two"
#endif
#define IS_UNOCCLUDED(soft) ((soft)->sample.y == 0)
#else
#define IS_UNOCCLUDED(soft) 0
#endif

// Returns the 32 bits in reverse order: swaps neighbouring bits, then pairs of bits, and so on.
static varying_uint reversed_bits(varying_uint bits) {
    bits = (bits >> 1 & 0x55555555u) | (bits & 0x55555555u) << 1;
    bits = (bits >> 2 & 0x33333333u) | (bits & 0x33333333u) << 2;
    bits = (bits >> 4 & 0x0f0f0f0fu) | (bits & 0x0f0f0f0fu) << 4;
    bits = (bits >> 8 & 0x00ff00ffu) | (bits & 0x00ff00ffu) << 8;
    return bits >> 16 | bits << 16;
}

// Applies Owen's scrambling to bits in reverse order, by a hash in which each bit depends on the bits below it (Laine
// and Karras, "Stratified Sampling for Stochastic Transparency", 2011, with the constants of Burley, "Practical
// Hash-based Owen Scrambling", 2020).
static varying_uint hashed_bits(varying_uint bits, uint seed) {
    bits += seed;
    bits ^= bits * 0x6c50b47cu;
    bits ^= bits * 0xb82f1e52u;
    bits ^= bits * 0xc7afe638u;
    bits ^= bits * 0x8d22f6e6u;
    return bits;
}

// Inserts a zero above each of the lower 16 bits. The four bits d c b a, for example, become:
//
//     d c b a  ->  0 d 0 c 0 b 0 a
static varying_uint spread_bits(varying_uint bits) {
    bits = (bits | bits << 8) & 0x00ff00ffu;
    bits = (bits | bits << 4) & 0x0f0f0f0fu;
    bits = (bits | bits << 2) & 0x33333333u;
    return (bits | bits << 1) & 0x55555555u;
}

// Returns the second coordinate of a point of Sobol's sequence, as bits in reverse order. If the bits of the point's
// number are the coefficients of a polynomial p(x) modulo 2, the bits of the result are the coefficients of p(x + 1).
static varying_uint second_of_sobol(varying_uint bits) {
    bits ^= bits >> 16;
    bits ^= bits >> 8 & 0x00ff00ffu;
    bits ^= bits >> 4 & 0x0f0f0f0fu;
    bits ^= bits >> 2 & 0x33333333u;
    return bits ^ (bits >> 1 & 0x55555555u);
}

// Converts the upper 23 bits to a number between 0 and 1, without rounding.
static varying unit_of(varying_uint bits) { return (TO_FLOAT(bits >> 9) + 0.5f) * 1.1920928955078125e-7f; }

// Returns the seed of a hash. Each source (a light or the sky) uses several hashes; `which` is the number of the hash.
static uint seed_of(int source, int which) { return (uint)(8 * source + which + 1) * 0x9e3779b9u; }

// Returns three numbers between 0 and 1 for the current sample of the pixel (x, y). `source` is the index of a light,
// or a number above the last light's index for the sky. The first two numbers are the coordinates of a point in the
// unit square, over which the points of a pixel's samples are evenly distributed.
Vec3 numbers_of(const Soft *soft, int source, varying_int x, varying_int y) {
    // A pixel's samples have consecutive numbers, and pixels that are close on the Z-order curve have close numbers.
    varying_uint curve = spread_bits(AS_UINT(x) & 0xffffu) | spread_bits(AS_UINT(y) & 0xffffu) << 1;
#if HALF_LIGHT // only the half picture with shadows uses these numbers, since other pictures are unoccluded
    curve &= INTERLEAVED * INTERLEAVED - 1u;
#endif
    const varying_uint reversed = reversed_bits(curve * soft->sample.y + SAMPLE_NUMBER(soft));
    // Each source (a light or the sky) has its own order of samples, so that two sources' samples are not correlated.
    const varying_uint first = reversed_bits(hashed_bits(reversed, seed_of(source, 0)));
    const varying_uint second = reversed_bits(hashed_bits(reversed, seed_of(source, 1)));
    return vec3(unit_of(reversed_bits(hashed_bits(first, seed_of(source, 2)))),
                unit_of(reversed_bits(hashed_bits(second_of_sobol(first), seed_of(source, 3)))),
                unit_of(reversed_bits(hashed_bits(second, seed_of(source, 4)))));
}

// Returns the radius of a light (1 for an area light), or 0 if the light is treated as a point: in pictures with a
// single sample per pixel, and in unoccluded pictures. The define SAMPLED is tested, not sample.y, since a round may
// have only one sample per pixel even if the picture has several samples per pixel.
static float radius_of(const Soft *soft, int light) {
    return SAMPLED && !IS_UNOCCLUDED(soft) ? soft->numbers[SOFT_HEAD_FLOATS + light] : 0.0f;
}

// Returns the point of a light to which a pixel's sample casts a ray, relative to the light's centre. `at` points to
// the light's floats. A light with a radius is a ball. To choose points of the ball, points that are uniformly
// distributed on a sphere in four dimensions are projected to three dimensions. Because of this distribution, the ball
// looks like an evenly bright disc from any side, seen from a distance.
static Vec3 off_middle(const Soft *soft, int light, const __global float *at, varying_int x, varying_int y) {
    const Vec3 u = numbers_of(soft, light, x, y);
#if AREA_LIGHTS
    if (is_area_light(at)) return scale(off_centre(at, u.x, u.y), (varying)(radius_of(soft, light)));
#endif
    // The first argument of `scale` has three of the four coordinates of a point on the unit sphere in four dimensions.
    // The second argument is the light's radius.
    const varying ring = sqrt(1.0f - u.x);
    return scale(vec3(ring * sinpi(2.0f * u.y), ring * cospi(2.0f * u.y), sqrt(u.x) * sinpi(2.0f * u.z)),
                 (varying)(radius_of(soft, light)));
}

#if SKY
// Returns a point of the unit sphere for the current sample of the pixel (x, y). The points are uniformly distributed.
static Vec3 point_of_sphere(const Soft *soft, int source, varying_int x, varying_int y) {
    const Vec3 u = numbers_of(soft, source, x, y);
    const varying ring = 2.0f * sqrt(u.x * (1.0f - u.x));
    return vec3(ring * sinpi(2.0f * u.y), ring * cospi(2.0f * u.y), 1.0f - 2.0f * u.x);
}

// Returns a unit vector on the normal's side of a surface: the direction from the hit to a point (point_of_sphere) of
// the unit sphere that touches the surface at the hit. The vector's probability density is proportional to the cosine
// of the angle between the vector and the normal. To choose a point of this sphere, no axes perpendicular to the normal
// are needed. (No choice of such axes changes continuously with the normal everywhere.)
static Vec3 direction_to_sky(Vec3 point, Vec3 normal) { return normalize_or_zero(add(normal, point)); }

// Returns the distance up to which surfaces occlude the sky.
static float reach_of_sky(const Soft *soft) { return soft->numbers[9]; }

#if ENVIRONMENT
#include "common/environment.cl"
#else
// Returns the sky's radiance in a direction. Below the horizon, the sky has the radiance of the horizon.
static Vec3 radiance_of_sky(const Soft *soft, Vec3 direction) {
    const Vec3 horizon = splat(LOAD3(soft->numbers + 3));
    const varying height = max(dot3(direction, splat(LOAD3(soft->numbers + 6))), (varying)(0.0f));
    return along(horizon, height, subtract(splat(LOAD3(soft->numbers)), horizon));
}
#endif

// Returns the mean of the sky's radiance around a normal. Each direction has the weight of its cosine with the normal.
// A direction's height is its dot product with the upward direction, but at least 0. The mean height of the directions
// around the normal is 2 / (3 pi) (sin a + (pi - a) cos a), where a is the angle between the normal and the upward
// direction. A parabola in the cosine of a gives this mean, with an error of at most 0.006. (A picture of the sky needs
// no mean, since such a sky is not cast at half resolution.)
static Vec3 mean_of_sky(const Soft *soft, Vec3 normal) {
#if ENVIRONMENT
    return radiance_of_sky(soft, normal);
#else
    const Vec3 horizon = splat(LOAD3(soft->numbers + 3));
    const varying cosine = dot3(normal, splat(LOAD3(soft->numbers + 6)));
    const varying height = 0.2122f + cosine * (0.3333f + 0.1211f * cosine);
    return along(horizon, height, subtract(splat(LOAD3(soft->numbers)), horizon));
#endif
}
#endif

// Returns the lanes in which a triangle stops a ray before t_max. The test is Moeller and Trumbore's, for rays with any
// origins and with unit directions. The triangle is given by a corner, the edges e1 and e2 from this corner, and the
// edges' 1-norms (size1, size2). The test allows for the rounding error of the weights, as in
// cast/intersect/moller_trumbore.cl.
static Mask stops(const Vec3 *corner, const Vec3 *e1, const Vec3 *e2, varying size1, varying size2, const Vec3 *from,
           const Vec3 *direction, varying t_max) {
    const Vec3 q = cross3(*direction, *e2), s = subtract(*from, *corner), r = cross3(s, *e1);
    const varying a = dot3(*e1, q), size = fabs(a);
    // The variables w1, w2 and t are the weights and the distance, multiplied by |a|; `a` is the determinant.
    const varying_int sign = sign_bit(a);
    const varying distance = fabs(s.x) + fabs(s.y) + fabs(s.z);
    const varying slack1 = ROUNDING * size2 * distance, slack2 = ROUNDING * size1 * distance;
    const varying w1 = flip_sign(dot3(s, q), sign), w2 = flip_sign(dot3(*direction, r), sign);
    const varying t = flip_sign(dot3(*e2, r), sign);
    Mask stopped = (w1 >= -slack1) & (w2 >= -slack2) & (w1 + w2 <= size + slack1 + slack2);
    // A triangle that is seen edge-on stops no ray.
    stopped &= (size > EDGE_ON_ROUNDING * size1 * size2) & (t > 0.0f) & (t / size < t_max);
#if CULL_BACK
    stopped &= a > 0.0f;
#endif
    return stopped;
}

// Returns the lanes whose ray is stopped by one triangle before t_max.
Mask is_stopped_by(Corners corners, Vec3 from, Vec3 direction, varying t_max) {
    const Uniform3 edge1 = uniform_difference(corners.b, corners.a), edge2 = uniform_difference(corners.c, corners.a);
    const Vec3 corner = splat(corners.a), e1 = splat(edge1), e2 = splat(edge2);
    return stops(&corner, &e1, &e2, (varying)(uniform_size(edge1)), (varying)(uniform_size(edge2)), &from, &direction, t_max);
}
