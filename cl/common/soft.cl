// What a pixel's sample sees of lights with a radius and of the sky: each pixel its own point of a light, and its own direction.
// They are points of Sobol's sequence in two dimensions, whose numbers go along a Z curve through the pixels, so that samples of
// a pixel, and those of pixels beside each other, are spread evenly (Ahmed and Wonka, "Screen-Space Blue-Noise Diffusion of Monte
// Carlo Sampling Error via Hierarchical Ordering of Pixels", ACM TOG 39(6), 2020). Owen's scrambling makes those of other lights
// independent. src/reference/soft.rs has the same, bit by bit.

#ifndef SOFT_HEAD_FLOATS
#error "SOFT_HEAD_FLOATS: floats of the sky before the lights' radii"
#endif

typedef struct {
    const __global float *numbers; // the sky: radiance at the zenith (3) and the horizon (3), up (3), reach; then a radius per light
    uint2 sample;                  // a pixel's sample, and how many it has
} Soft;

#if WIDTH == 1
typedef uint varying_uint;
#define AS_UINT(a) as_uint(a)
#else
typedef PASTE(uint, WIDTH) varying_uint;
#define AS_UINT(a) PASTE(as_uint, WIDTH)(a)
#endif

varying_uint reversed_bits(varying_uint bits) {
    bits = (bits >> 1 & 0x55555555u) | (bits & 0x55555555u) << 1;
    bits = (bits >> 2 & 0x33333333u) | (bits & 0x33333333u) << 2;
    bits = (bits >> 4 & 0x0f0f0f0fu) | (bits & 0x0f0f0f0fu) << 4;
    bits = (bits >> 8 & 0x00ff00ffu) | (bits & 0x00ff00ffu) << 8;
    return bits >> 16 | bits << 16;
}

// Owen's scrambling of bits in reverse order, by a hash in which each bit depends on the bits below it (Laine and Karras,
// "Stratified Sampling for Stochastic Transparency", 2011, with the constants of Burley, "Practical Hash-based Owen
// Scrambling", 2020).
varying_uint hashed_bits(varying_uint bits, uint seed) {
    bits += seed;
    bits ^= bits * 0x6c50b47cu;
    bits ^= bits * 0xb82f1e52u;
    bits ^= bits * 0xc7afe638u;
    bits ^= bits * 0x8d22f6e6u;
    return bits;
}

// A bit apart each: the lower 16 bits at even places.
varying_uint spread_bits(varying_uint bits) {
    bits = (bits | bits << 8) & 0x00ff00ffu;
    bits = (bits | bits << 4) & 0x0f0f0f0fu;
    bits = (bits | bits << 2) & 0x33333333u;
    return (bits | bits << 1) & 0x55555555u;
}

// A number's second coordinate in Sobol's sequence, its bits reversed: with the number as a polynomial over bits, that of x + 1.
varying_uint second_of_sobol(varying_uint bits) {
    bits ^= bits >> 16;
    bits ^= bits >> 8 & 0x00ff00ffu;
    bits ^= bits >> 4 & 0x0f0f0f0fu;
    bits ^= bits >> 2 & 0x33333333u;
    return bits ^ (bits >> 1 & 0x55555555u);
}

// 23 bits as a number between 0 and 1, exactly.
varying unit_of(varying_uint bits) { return (TO_FLOAT(bits >> 9) + 0.5f) * 1.1920928955078125e-7f; }

uint seed_of(int source, int which) { return (uint)(8 * source + which + 1) * 0x9e3779b9u; }

// Three numbers from 0 to 1 for a light, or for the sky, which comes after the lights; the first two are spread together.
Vec3 numbers_of(const Soft *soft, int source, varying_int x, varying_int y) {
    const varying_uint curve = spread_bits(AS_UINT(x) & 0xffffu) | spread_bits(AS_UINT(y) & 0xffffu) << 1;
    const varying_uint reversed = reversed_bits(curve * soft->sample.y + soft->sample.x);
    // Each source in an order of its own: else a place in one would go with a place in the next.
    const varying_uint first = reversed_bits(hashed_bits(reversed, seed_of(source, 0)));
    const varying_uint second = reversed_bits(hashed_bits(reversed, seed_of(source, 1)));
    return vec3(unit_of(reversed_bits(hashed_bits(first, seed_of(source, 2)))),
                unit_of(reversed_bits(hashed_bits(second_of_sobol(first), seed_of(source, 3)))),
                unit_of(reversed_bits(hashed_bits(second, seed_of(source, 4)))));
}

// The radius of a light; one sample alone sees lights as points.
float radius_of(const Soft *soft, int light) { return soft->sample.y > 1 ? soft->numbers[SOFT_HEAD_FLOATS + light] : 0.0f; }

// From the middle of a light's ball to the point that a pixel's sample sees. Points are spread as the uniform ones of a sphere in
// four dimensions are seen in three, so that from afar the ball looks equally bright all over from every side, as a disc does.
Vec3 off_middle(const Soft *soft, int light, varying_int x, varying_int y) {
    const Vec3 u = numbers_of(soft, light, x, y);
    const varying ring = sqrt(1.0f - u.x);
    return scale(vec3(ring * sinpi(2.0f * u.y), ring * cospi(2.0f * u.y), sqrt(u.x) * sinpi(2.0f * u.z)),
                 (varying)(radius_of(soft, light)));
}

#if SKY
// A unit vector about a normal, as likely as its cosine is large: towards a point of the unit sphere that stands on the surface.
// No axes across the normal are needed, which would have to jump somewhere.
Vec3 way_to_sky(const Soft *soft, int source, varying_int x, varying_int y, Vec3 normal) {
    const Vec3 u = numbers_of(soft, source, x, y);
    const varying ring = 2.0f * sqrt(u.x * (1.0f - u.x));
    const Vec3 point = vec3(ring * sinpi(2.0f * u.y), ring * cospi(2.0f * u.y), 1.0f - 2.0f * u.x);
    return normalize_or_zero(add(normal, point));
}

// How far away something still hides the sky.
float reach_of_sky(const Soft *soft) { return soft->numbers[9]; }

// The sky's radiance in a direction; below the horizon it is the horizon's.
Vec3 radiance_of_sky(const Soft *soft, Vec3 way) {
    const Vec3 horizon = splat(LOAD3(soft->numbers + 3));
    const varying height = max(dot3(way, splat(LOAD3(soft->numbers + 6))), (varying)(0.0f));
    return along(horizon, height, subtract(splat(LOAD3(soft->numbers)), horizon));
}
#endif

// Lanes whose ray a triangle stops before t_max: Moeller and Trumbore's test, for rays of any origins and unit directions.
// Weights are allowed their rounding error, as in cast/intersect/moller_trumbore.cl.
Mask is_stopped_by(Corners corners, Vec3 from, Vec3 way, varying t_max) {
    const Uniform3 edge1 = uniform_difference(corners.b, corners.a), edge2 = uniform_difference(corners.c, corners.a);
    const float size1 = uniform_size(edge1), size2 = uniform_size(edge2);
    const Vec3 e1 = splat(edge1), e2 = splat(edge2);
    const Vec3 q = cross3(way, e2), s = subtract(from, splat(corners.a)), r = cross3(s, e1);
    const varying a = dot3(e1, q), size = fabs(a);
    const varying_int sign = sign_bit(a);
    const varying distance = fabs(s.x) + fabs(s.y) + fabs(s.z);
    const varying slack1 = ROUNDING * size2 * distance, slack2 = ROUNDING * size1 * distance;
    const varying w1 = flip_sign(dot3(s, q), sign), w2 = flip_sign(dot3(way, r), sign);
    const varying t = flip_sign(dot3(e2, r), sign); // times size
    Mask stopped = (w1 >= -slack1) & (w2 >= -slack2) & (w1 + w2 <= size + slack1 + slack2);
    // Seen edge-on it stops nothing.
    stopped &= (size > 1e-5f * size1 * size2) & (t > 0.0f) & (t / size < t_max);
#if CULL_BACK
    stopped &= a > 0.0f;
#endif
    return stopped;
}
