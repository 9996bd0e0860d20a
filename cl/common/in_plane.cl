// Finds rays that start in a triangle's plane. Such a ray misses the triangle. If the ray starts on the triangle,
// a test of edges nevertheless finds a hit, whose distance t consists only of rounding errors.

// A bound of the rounding error of a sum of three products, relative to the sum of the products' absolute values.
#define SUM_ROUNDING (4.0f * ROUNDING)
// The watertight tests in cast/ and tile_cpu/ compute t from a sum of three numbers. If the ray starts on the triangle,
// these numbers nearly cancel. Only hits with |sum| <= NEAR_START * (sum of |numbers|) need the test starts_in_plane.
#define NEAR_START 0.01f

// Returns the lanes in which |the sum of three numbers| is at most `part` times the sum of their absolute values.
static Mask cancels(varying x, varying y, varying z, float part) {
    return fabs(x + y + z) <= part * (fabs(x) + fabs(y) + fabs(z));
}

// Returns a normal of the triangle with the corners a, b and c. The normal's length is not 1.
static Uniform3 normal_of(Uniform3 a, Uniform3 b, Uniform3 c) {
    return uniform_cross(uniform_difference(b, a), uniform_difference(c, a));
}

// Returns the lanes whose ray starts in the triangle's plane, up to rounding errors. `a` is a corner of the triangle
// relative to the ray's start, and `n` the triangle's normal, of any length.
static Mask starts_in_plane(Vec3 a, Vec3 n) { return cancels(a.x * n.x, a.y * n.y, a.z * n.z, SUM_ROUNDING); }
