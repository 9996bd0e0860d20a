// Loads eight triangles of a leaf at once, one per lane.

#define TOGETHER 8
#if !defined(PADDING_ROWS) || PADDING_ROWS < TOGETHER
#error "PADDING_ROWS: rows after a tree's last triangle, at least as many as are loaded at once"
#endif

// A vector (x, y, z) for each of eight triangles, one triangle per lane.
typedef struct {
    float8 x, y, z;
} Lanes3;

static Lanes3 lanes_difference(Lanes3 a, Lanes3 b) {
    Lanes3 d;
    d.x = a.x - b.x, d.y = a.y - b.y, d.z = a.z - b.z;
    return d;
}

static Lanes3 lanes_sum(Lanes3 a, Lanes3 b) {
    Lanes3 s;
    s.x = a.x + b.x, s.y = a.y + b.y, s.z = a.z + b.z;
    return s;
}

static Lanes3 lanes_cross(Lanes3 a, Lanes3 b) {
    Lanes3 c;
    c.x = a.y * b.z - a.z * b.y, c.y = a.z * b.x - a.x * b.z, c.z = a.x * b.y - a.y * b.x;
    return c;
}

static float8 lanes_size(Lanes3 a) { return fabs(a.x) + fabs(a.y) + fabs(a.z); } // the 1-norm

// Loads one corner of each of eight triangles. After a leaf's last triangle, triangles of other leaves or padding are
// loaded. In memory, a corner is a float4: x y z and a word w. Separating even and odd lanes twice transposes eight
// corners:
//     x y z w, x y z w, ...  ->  even: x z x z ...,  odd: y w y w ...  ->  x x x x ...,  z z z z ...,  y y y y ...
static Lanes3 load_corners(const __global float4 *rows) {
    // A triangle has three float4, one for each corner, so every third float4 is loaded.
    const float16 a = (float16)(rows[0], rows[3], rows[6], rows[9]);
    const float16 b = (float16)(rows[12], rows[15], rows[18], rows[21]);
    const float8 xz = a.even, xz2 = b.even, yw = a.odd, yw2 = b.odd;
    Lanes3 corner;
    corner.x = (float8)(xz.even, xz2.even);
    corner.y = (float8)(yw.even, yw2.even);
    corner.z = (float8)(xz.odd, xz2.odd);
    return corner;
}
