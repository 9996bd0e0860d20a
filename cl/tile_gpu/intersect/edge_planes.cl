// Prepares a leaf's triangle (computes what all rays of a pass need), and tests rays against it. Each edge spans a
// plane with the rays' origin; a ray that hits is on the inner side of all three planes. Neighbouring triangles have
// the same plane at their common edge, up to sign and a power of two. The edge functions and 1/z are linear in a ray's
// slopes x and y (see entry.cl). A prepared triangle has a float4 for each of the corners a, b and c. The first three
// components of such a float4 are a plane: that of the edge opposite to the corner. On the inner side of the edge, the
// plane's edge function is not negative. The fourth component of a float4 is one of the three coefficients of 1/z:
//
//     a: | u.x u.y u.z (1/z).x |     b: | v.x v.y v.z (1/z).y |     c: | w.x w.y w.z (1/z).z |

// Returns the plane through the origin and an edge. `edge` is p - q; the edge's ends p and q are relative to the
// origin. The plane is multiplied by `scale`, so that the overlap of neighbouring triangles becomes 1, and this 1 is
// added. Before the 1 is added, swapping the ends p and q reverses all signs and changes nothing else. Neighbouring
// triangles overlap by half of the usual overlap (SHARED_EDGE_SLACK, see common/hit.cl). (Measured on a GPU: with the
// usual overlap, one of two million pixels of a terrain is wrongly dark. With half of it, no pixel is wrongly dark, and
// none of 60,516 rays aimed at edges and vertices slips through.)
INLINED Uniform3 edge_between(Uniform3 edge, Uniform3 p, Uniform3 q, float scale) {
    const Uniform3 plane = uniform_cross(edge, uniform3(p.x + q.x, p.y + q.y, p.z + q.z));
    return uniform3(plane.x * scale, plane.y * scale, MULTIPLY_ADD(plane.z, scale, 1.0f));
}

// Returns the absolute value of the factor by which an edge's plane is multiplied: 1 / the overlap of neighbouring
// triangles, where the overlap is rounded down to a power of two. `size` is the edge's size (1-norm), and `longer` is
// the size of the longer one of the edges e1 and e2. `slack` is the overlap divided by an edge's size.
INLINED float per_overlap(float slack, float size, float longer) {
    const float overlap = slack * min(longer, OVERLAP_EDGES * size);
    return as_float(0x7f000000 - (as_int(overlap) & 0x7f800000)); // the exponent e + 127 becomes 127 - e: 1 / 2^e
}

// Prepares the triangle at an index in leaf order. Returns 1 if any ray of the shaft may hit the triangle at a 1/z
// greater than `worst` (the smallest 1/z at which a hit matters), else 0.
//
// Edges are computed from the stored corners, because corners relative to a distant origin have lost their last digits.
// `height` is six times the signed volume of the tetrahedron that the origin and the triangle form. The sign of
// `height` shows which side of the triangle is visible, and 1/z = (x, y, 1) . n / height. For culling, the visible side
// is reversed in two cases. Shadow rays run towards their light, but are tested from the light. Rays that run towards
// smaller coordinates along the pass's axis have mirrored coordinates.
INLINED int prepare(const Shaft *shaft, const Tree *tree, int index, float worst, const int any, Candidate *triangle) {
    Uniform3 a, b, c;
    const int used = load_corners(shaft, tree, index, &a, &b, &c);
    const Uniform3 e1 = uniform_difference(b, a), e2 = uniform_difference(c, a), e3 = uniform_difference(b, c);
    a = seen(shaft, a), b = seen(shaft, b), c = seen(shaft, c);
    const Uniform3 n = uniform_cross(e1, e2);
    const float height = uniform_dot(a, n);
    const float size1 = uniform_size(e1), size2 = uniform_size(e2), longer = max(size1, size2);
    const float distance = uniform_size(a), nearest = max(distance - longer, 0.0f);
    const float slack = 0.5f * SHARED_EDGE_SLACK * shaft->longest * distance;
    const Uniform3 u = edge_between(e3, b, c, copysign(per_overlap(slack, uniform_size(e3), longer), height));
    const Uniform3 v = edge_between(e2, c, a, copysign(per_overlap(slack, size2, longer), height));
    const Uniform3 w =
        edge_between(uniform_scale(e1, -1.0f), a, b, copysign(per_overlap(slack, size1, longer), height));
    const Uniform3 per_z = uniform_scale(n, reciprocal(height));
    triangle->a = quad(u, per_z.x);
    triangle->b = quad(v, per_z.y);
    triangle->c = quad(w, per_z.z);
    // A triangle seen edge-on is not hit, as in common/planes_of_origin.cl.
    int wanted = used & (fabs(height) > max(EDGE_ON_ROUNDING * nearest * size1 * size2,
                                            0.5f * LEAST_VISIBLE(distance, longer)));
#if CULL_BACK
    wanted &= (any ? height : -height) * shaft->sign > 0.0f;
#endif
    // If all rays of the pass (the shaft) are outside the same edge, no ray hits. If the triangle is behind the nearest
    // hits of all rays, its hits do not matter. (The factor 1.00001 allows for the rounding of 1/z.)
    return wanted & (most_of(shaft, u) >= 0.0f) & (most_of(shaft, v) >= 0.0f) & (most_of(shaft, w) >= 0.0f) &
           (most_of(shaft, per_z) * 1.00001f > worst);
}

// Returns the value of a linear function for a ray with the slopes x and y: its direction is (x, y, 1).
INLINED float at_slopes(float4 plane, float x, float y) {
    return MULTIPLY_ADD(plane.x, x, MULTIPLY_ADD(plane.y, y, plane.z));
}

// Returns 1 if a ray hits the triangle at a 1/z greater than `nearest`, else 0. If `any` is 0 (only the nearest hit
// counts), 1/z must also be less than `ceiling`. `*per_depth` receives 1/z.
INLINED int is_hit(const Candidate *triangle, float x, float y, float nearest, float ceiling, const int any,
                   float *per_depth) {
    const float u = at_slopes(triangle->a, x, y), v = at_slopes(triangle->b, x, y), w = at_slopes(triangle->c, x, y);
    *per_depth = MULTIPLY_ADD(triangle->a.w, x, MULTIPLY_ADD(triangle->b.w, y, triangle->c.w));
    // `outside` is negative if any of the three edge functions is negative, since the bitwise or joins their sign bits.
    const int outside = as_int(u) | as_int(v) | as_int(w);
    return outside >= 0 && *per_depth > nearest && (any || *per_depth < ceiling);
}
