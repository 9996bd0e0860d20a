// Reads and filters textures. All textures of a scene are in one buffer, not in OpenCL images, because images are
// filtered differently on different devices. src/reference/texture.rs samples the same textures in double precision.

#ifndef TEXTURE_HEAD_WORDS
#error "TEXTURE_HEAD_WORDS: words that describe a texture before its texels"
#endif
#if !defined(WRAP_REPEAT) || !defined(WRAP_CLAMP) || !defined(WRAP_MIRROR)
#error "WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR: numbers of the ways in which a texture continues beyond its edges"
#endif
#ifndef MIPS
#error "MIPS: 0 or 1: whether textures have mip levels"
#endif

// src/launch/textures.rs writes the buffer of all textures as follows, in words:
//
//     | 256 floats | head | head | ... | texels of texture 0, row by row from the top | texels of texture 1 | ...
//
// The 256 floats map each 8-bit value (sRGB) to linear light. Each texture has a head, four words that describe it:
//
//     | first texel | width | height | several numbers |
//
//     several numbers:  31 ........ 16 | 15 ... 12      | 11 .. 8 | 7 ... 0
//                       least alpha    | last mip level | wrap v  | wrap u
//     a texel:          31 .. 24 | 23 .. 16 | 15 .. 8 | 7 ... 0
//                       alpha    | blue     | green   | red
//
// "Wrap u" and "wrap v" define how the texture continues beyond its edges along u and v. common/cutouts.cl explains the
// least alpha. A texture's mip levels follow its texels. Each level is half as wide and half as high as the level
// before (rounded down, at least 1).
#define CHANNEL_VALUES 256

// The number of float4 in a triangle's row of texture data. Without mip levels, a triangle's row has two float4:
//
//     | u v of corner a, u v of corner b | u v of corner c, texture's number or -1, mask's number + 1 or 0 |
//
// With mip levels, a third float4 holds the triangle's unit normal, multiplied by the side of a texel on the triangle
// (in the scene's units). The texel belongs to the triangle's texture. If the triangle has no texture, the texel
// belongs to the emission texture that the material names.
#define MAPPED_QUADS (2 + MIPS)

typedef struct {
    const __global float4 *rows;
    const __global uint *words;
    float4 cone; // cone . (point - eye) is the width of the cone around a pixel's ray, at this point
} Textures;

// Returns a texture coordinate after wrapping it to the range from 0 to 1.
static float coordinate_in_texture(float coordinate, uint wrap) {
    if (wrap == WRAP_CLAMP) return clamp(coordinate, 0.0f, 1.0f);
    if (wrap == WRAP_MIRROR) {
        // Every second repetition runs backwards. The coordinate is therefore taken modulo 2, and reflected at 1.
        const float twice = coordinate - 2.0f * floor(0.5f * coordinate);
        return min(twice, 2.0f - twice);
    }
    return coordinate - floor(coordinate);
}

// Returns the column (or row) of a texel, moved into the texture. With WRAP_REPEAT, a column beyond an edge continues
// at the opposite edge; with other wrap modes, a column beyond an edge becomes the last one before this edge.
static int texel_in_texture(int texel, int size, uint wrap) {
    if (wrap == WRAP_REPEAT) texel += texel < 0 ? size : texel >= size ? -size : 0;
    // Whatever the texture coordinates are, no texel outside the texture may be read.
    return clamp(texel, 0, size - 1);
}

// Returns the colour, in linear light, of the texel in the word `at`.
static Uniform3 texel_colour(const __global uint *words, uint at) {
    const uint texel = words[at];
    return uniform3(as_float(words[texel & 255]), as_float(words[texel >> 8 & 255]), as_float(words[texel >> 16 & 255]));
}

// Returns a pointer to a texture's head: the 32-bit words that state the place of the texels, the size and more.
static const __global uint *texture_head(const Textures *textures, int number) {
    return textures->words + CHANNEL_VALUES + TEXTURE_HEAD_WORDS * number;
}

// A mip level of a texture: the index of the word with its first texel, and its size in texels.
typedef struct {
    uint first;
    int width, height;
} Level;

// Returns a texture's mip level 0, which is the texture itself.
static Level whole_texture(const __global uint *head) {
    Level level;
    level.first = head[0], level.width = (int)head[1], level.height = (int)head[2];
    return level;
}

// The four texels around a point of a texture, as indices of words, and the share of each in the filtered colour.
typedef struct {
    uint a, b, d, e;
    float ka, kb, kd, ke;
} Texels;

// Returns the texels of a mip level around a point of a triangle; w1 and w2 are the point's weights. `ab` and `c` have
// the texture coordinates of the triangle's corners. `wrap` is the last of the four words that describe the texture.
Texels texels_at(Level level, uint wrap, float4 ab, float4 c, float w1, float w2) {
    const int width = level.width, height = level.height;
    const uint across = wrap & 255, down = wrap >> 8 & 15;
    // Centres of texels lie at half-integers, like those of pixels.
    const float w0 = 1.0f - w1 - w2;
    const float x = coordinate_in_texture(w0 * ab.x + w1 * ab.z + w2 * c.x, across) * (float)width - 0.5f;
    const float y = coordinate_in_texture(w0 * ab.y + w1 * ab.w + w2 * c.y, down) * (float)height - 0.5f;
    const float left = floor(x), top = floor(y);
    const int x0 = texel_in_texture((int)left, width, across), x1 = texel_in_texture((int)left + 1, width, across);
    const uint row0 = level.first + (uint)(texel_in_texture((int)top, height, down) * width);
    const uint row1 = level.first + (uint)(texel_in_texture((int)top + 1, height, down) * width);
    const float to_right = x - left, to_bottom = y - top;
    // A texel's share of the colour is the area of the rectangle between the point and the opposite texel.
    Texels texels;
    texels.a = row0 + x0, texels.b = row0 + x1, texels.d = row1 + x0, texels.e = row1 + x1;
    texels.ka = (1.0f - to_right) * (1.0f - to_bottom), texels.kb = to_right * (1.0f - to_bottom);
    texels.kd = (1.0f - to_right) * to_bottom, texels.ke = to_right * to_bottom;
    return texels;
}

// Returns the weighted mean of four texels, mixed in linear light.
static Uniform3 mixed_colour(const __global uint *words, Texels at) {
    const Uniform3 a = texel_colour(words, at.a), b = texel_colour(words, at.b);
    const Uniform3 d = texel_colour(words, at.d), e = texel_colour(words, at.e);
    return uniform3(at.ka * a.x + at.kb * b.x + at.kd * d.x + at.ke * e.x,
                    at.ka * a.y + at.kb * b.y + at.kd * d.y + at.ke * e.y,
                    at.ka * a.z + at.kb * b.z + at.kd * d.z + at.ke * e.z);
}

#if MIPS
// Returns the next mip level: it is half as wide and half as high (rounded down, at least 1), and its texels follow
// those of `level`.
static Level next_level(Level level) {
    level.first += (uint)(level.width * level.height);
    level.width = max(level.width / 2, 1), level.height = max(level.height / 2, 1);
    return level;
}

// Returns, for each lane, the mip level whose texels are as large as a pixel. The result may lie between two levels,
// and is less than 0 if the texels of level 0 are larger than a pixel. `t` is the distance along the ray from the eye.
// The method is that of Akenine-Moeller et al., "Texture Level of Detail Strategies for Real-Time Ray Tracing", Ray
// Tracing Gems, 2019.
static varying levels_for(const Textures *textures, varying_int triangle, Vec3 direction, varying t) {
    IntLanes id;
    Lanes x, y, z;
    id.all = triangle;
    // Lanes may have different triangles, so normals are read one lane after the other.
    x.all = y.all = z.all = (varying)(1.0f);
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
        const float4 texel = textures->rows[MAPPED_QUADS * (size_t)id.each[lane] + 2];
        x.each[lane] = texel.x, y.each[lane] = texel.y, z.each[lane] = texel.z;
    }
    const float4 cone = textures->cone;
    const varying width = t * (direction.x * cone.x + direction.y * cone.y + direction.z * cone.z);
    // The cone around a pixel's ray meets an oblique surface in an ellipse. The ellipse's length is its width divided
    // by the cosine between ray and normal. `across` is the cosine between ray and normal, times a texel's side.
    const varying across = fabs(dot3(vec3(x.all, y.all, z.all), direction));
    return log2(width / across);
}
#else
#define levels_for(textures, triangle, direction, t) (varying)(0.0f)
#endif

// Returns the colour of the texture `number` at the point of a triangle with the weights w1 and w2; `ab` and `c` have
// the texture coordinates of the triangle's corners. The colour is a weighted mean of the two mip levels nearest to the
// level `wanted`; without MIPS, it is the colour in level 0.
Uniform3 filtered_colour(const Textures *textures, int number, float4 ab, float4 c, float w1, float w2, float wanted) {
    const __global uint *words = textures->words;
    const __global uint *head = texture_head(textures, number);
#if MIPS
    const int last = (int)(head[3] >> 12 & 15);
    const float between = clamp(wanted, 0.0f, (float)last);
    // Whatever `wanted` is, no texel outside the texture may be read.
    const int finer = clamp((int)between, 0, last);
    Level level = whole_texture(head);
    for (int i = 0; i < finer; i++) level = next_level(level);
    const Uniform3 colour = mixed_colour(words, texels_at(level, head[3], ab, c, w1, w2));
    const float part = between - (float)finer, rest = 1.0f - part;
    // For most pixels that show near surfaces, mip level 0 alone is enough.
    if (finer == last || !(part > 0.0f)) return colour;
    const Uniform3 other = mixed_colour(words, texels_at(next_level(level), head[3], ab, c, w1, w2));
    return uniform3(rest * colour.x + part * other.x, rest * colour.y + part * other.y, rest * colour.z + part * other.z);
#else
    return mixed_colour(words, texels_at(whole_texture(head), head[3], ab, c, w1, w2));
#endif
}

// Returns the colour of a triangle's texture at the point with the weights w1 and w2, in the mip level `wanted`.
// Returns white if the triangle has no texture.
static Uniform3 texture_colour(const Textures *textures, int triangle, float w1, float w2, float wanted) {
    const __global float4 *row = textures->rows + MAPPED_QUADS * (size_t)triangle;
    const float4 ab = row[0], c = row[1];
    const int number = as_int(c.z);
    if (number < 0) return uniform3(1.0f, 1.0f, 1.0f);
    return filtered_colour(textures, number, ab, c, w1, w2, wanted);
}

#if EMISSIVE
// Returns the colour of the texture `number`, by which the triangle's emitted radiance is multiplied, or white if
// `number` is -1. The emission texture has the same coordinates as the triangle's texture.
Uniform3 emission_colour(const Textures *textures, int number, int triangle, float w1, float w2, float wanted) {
    if (number < 0) return uniform3(1.0f, 1.0f, 1.0f);
    const __global float4 *row = textures->rows + MAPPED_QUADS * (size_t)triangle;
    const float4 ab = row[0], c = row[1];
#if MIPS
    // `wanted` is the level of the triangle's own texture, if it has one. Suppose that the emission texture has half as
    // many texels across and down as the triangle's own texture. The emission texture's texels are then twice as large,
    // so the emission texture is read one level lower.
    if (as_int(c.z) >= 0) {
        const __global uint *head = texture_head(textures, number), *own = texture_head(textures, as_int(c.z));
        wanted += 0.5f * log2((float)head[1] * (float)head[2] / ((float)own[1] * (float)own[2]));
    }
#endif
    return filtered_colour(textures, number, ab, c, w1, w2, wanted);
}

// Returns `surface`, with its emitted radiance multiplied by the colour of the material's emission texture. `level` is
// the mip level of the triangles' own textures.
Surface with_emission_texture(Surface surface, const Textures *textures, varying_int triangle, varying w1, varying w2,
                              varying level) {
    IntLanes id;
    Lanes number, second, third, wanted, red, green, blue;
    id.all = triangle, number.all = surface.emission_texture;
    second.all = w1, third.all = w2, wanted.all = level;
    red.all = green.all = blue.all = (varying)(1.0f);
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
        const Uniform3 colour = emission_colour(textures, (int)number.each[lane] - 1, id.each[lane],
                                                second.each[lane], third.each[lane], wanted.each[lane]);
        red.each[lane] = colour.x, green.each[lane] = colour.y, blue.each[lane] = colour.z;
    }
    surface.emitted = multiply(surface.emitted, vec3(red.all, green.all, blue.all));
    return surface;
}
#else
#define with_emission_texture(surface, textures, triangle, w1, w2, level) surface
#endif

// Returns `surface`, with its diffuse reflectance multiplied by the colour of the texture of each lane's triangle. The
// ray from the eye meets the triangle at distance t, at the point with the weights w1 and w2. Lanes whose triangle is
// NO_HIT keep their diffuse reflectance.
static Surface textured(Surface surface, const Textures *textures, varying_int triangle, varying w1, varying w2, Vec3 direction, varying t) {
    IntLanes id;
    Lanes second, third, level, red, green, blue;
    id.all = triangle;
    second.all = w1, third.all = w2;
    level.all = levels_for(textures, triangle, direction, t);
    red.all = green.all = blue.all = (varying)(1.0f);
    // Lanes may have different textures, so texels are read one lane after the other.
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
        const Uniform3 colour =
            texture_colour(textures, id.each[lane], second.each[lane], third.each[lane], level.each[lane]);
        red.each[lane] = colour.x, green.each[lane] = colour.y, blue.each[lane] = colour.z;
    }
    surface.lambertian = multiply(surface.lambertian, vec3(red.all, green.all, blue.all));
    return with_emission_texture(surface, textures, triangle, w1, w2, level.all);
}

#define TEXTURED(surface, textures, triangle, w1, w2, direction, t) textured(surface, textures, triangle, w1, w2, direction, t)
