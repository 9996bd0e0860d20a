// Cut-outs are triangles with a mask: a texture whose alpha channel defines where the surface is and where it has
// holes. Rays pass through the holes. src/reference/cutouts.rs finds the holes in the same way, but in f64.

#ifndef LEAST_ALPHA_UNIT
#error "LEAST_ALPHA_UNIT: units of a mask's least alpha per step of an 8-bit channel"
#endif

// A mask's least alpha is a threshold: points with less alpha are holes. Four words, the head, describe the mask's
// texture (see textures.cl). The last word of a texture's head holds the least alpha, from bit 16 on:
//
//     31 ........ 16 | 15 ... 12  | 11 .. 8 | 7 ... 0
//     least alpha    | last level | wrap v  | wrap u
//
// The least alpha is stored in units of 1 / LEAST_ALPHA_UNIT of a step of an 8-bit alpha; 65535 stands for 1.
//
// A mask is always read at level 0, the texture itself. In a higher mip level, a texel's alpha is the mean over many
// texels. With such a level, a region of distant foliage would lose all its holes if the region's mean alpha is above
// the least alpha, and would vanish if the mean alpha is below.

// Returns 1 if a triangle is solid at one of its points, and 0 if it has a hole there. w1 and w2 are the point's
// barycentric weights of the second and third corner.
int is_solid(const Textures *textures, int triangle, float w1, float w2) {
    const __global float4 *row = textures->rows + MAPPED_QUADS * (size_t)triangle;
    const float4 c = row[1];
    const int mask = as_int(c.w); // 0 for no mask, else one more than the mask's number
    if (!mask) return 1;
    const __global uint *head = texture_head(textures, mask - 1), *words = textures->words;
    const Texels at = texels_at(whole_texture(head), head[3], row[0], c, w1, w2);
    const float alpha = at.ka * (float)(words[at.a] >> 24) + at.kb * (float)(words[at.b] >> 24) +
                        at.kd * (float)(words[at.d] >> 24) + at.ke * (float)(words[at.e] >> 24);
    // One unit is subtracted from the least alpha, because rounding could otherwise make a hole where all four texels
    // have exactly the least alpha.
    return (float)LEAST_ALPHA_UNIT * alpha >= (float)(head[3] >> 16) - 1.0f;
}

static int has_mask(const Textures *textures, int triangle) {
    return as_int(textures->rows[MAPPED_QUADS * (size_t)triangle + 1].w) != 0;
}

// Returns the lanes of `hits` in which the point with the weights w1 and w2 is on the triangle's surface, not in a
// hole.
Mask solid_lanes(const Textures *textures, int triangle, varying w1, varying w2, Mask hits) {
    if (!ANY(hits) || !has_mask(textures, triangle)) return hits;
    IntLanes solid;
    Lanes second, third;
    solid.all = hits;
    second.all = w1, third.all = w2;
    // Lanes hit different points, so texels are read one lane after the other.
    for (int lane = 0; lane < WIDTH; lane++)
        if (solid.each[lane] && !is_solid(textures, triangle, second.each[lane], third.each[lane])) solid.each[lane] = 0;
    return solid.all;
}

// Returns the lanes of `hits` whose ray meets the triangle's surface, not a hole. The rays start at `from`. The
// function is for callers that lack the hits' barycentric weights: it computes the weights itself.
Mask solid_on_rays(const Textures *textures, int triangle, Corners corners, Vec3 from, Vec3 direction, Mask hits) {
    if (!ANY(hits) || !has_mask(textures, triangle)) return hits;
    const Vec3 e1 = splat(uniform_difference(corners.b, corners.a)), e2 = splat(uniform_difference(corners.c, corners.a));
    const Hit hit = intersect_plane(splat(corners.a), e1, e2, from, direction);
    return solid_lanes(textures, triangle, hit.w1, hit.w2, hits);
}

#define SOLID(textures, triangle, hit) solid_lanes(textures, triangle, hit.w1, hit.w2, hit.lanes)
#define SOLID_ON_RAYS(textures, triangle, corners, from, direction, hits) \
    solid_on_rays(textures, triangle, corners, from, direction, hits)
