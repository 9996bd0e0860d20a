// Textures. All of a scene's textures are in one buffer and not in OpenCL images, so that one source runs on every
// device and gives the same bits. src/reference/texture.rs has the same in f64.

#ifndef TEXTURE_HEAD_WORDS
#error "TEXTURE_HEAD_WORDS: words that tell of a texture before its texels"
#endif
#if !defined(WRAP_REPEAT) || !defined(WRAP_CLAMP) || !defined(WRAP_MIRROR)
#error "WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR: numbers of what a texture is beyond its edges"
#endif

// The buffer, in words, as src/launch/textures.rs writes it:
//
//     | 256 floats | head | head | ... | texels of texture 0, row by row from the top | texels of texture 1 | ...
//
// The floats are the linear light of each 8-bit value (sRGB). A head is a texture's first texel, its width, its height, and how
// it wraps beyond its edges: u in the lowest 8 bits, v in the next; the rest is common/cutouts.cl's. A texel has red in the
// lowest 8 bits, then green, blue and alpha.
#define CHANNEL_VALUES 256

typedef struct {
    const __global float4 *rows; // two per triangle: u and v of its corners, the texture's number or -1, the mask's
    const __global uint *words;
} Textures;

// Returns a texture coordinate wrapped to the range from 0 to 1.
float place_in_texture(float place, uint wrap) {
    if (wrap == WRAP_CLAMP) return clamp(place, 0.0f, 1.0f);
    if (wrap == WRAP_MIRROR) {
        // Every second repetition runs backwards: the coordinate modulo 2, reflected at 1.
        const float twice = place - 2.0f * floor(0.5f * place);
        return min(twice, 2.0f - twice);
    }
    return place - floor(place);
}

// Returns the index of a texel along an axis, wrapped if the filter needs one beyond the edge.
int texel_in_texture(int texel, int size, uint wrap) {
    if (wrap == WRAP_REPEAT) texel += texel < 0 ? size : texel >= size ? -size : 0;
    // For any coordinates, no texel outside the texture is read.
    return clamp(texel, 0, size - 1);
}

Uniform3 texel_colour(const __global uint *words, uint at) {
    const uint texel = words[at];
    return uniform3(as_float(words[texel & 255]), as_float(words[texel >> 8 & 255]), as_float(words[texel >> 16 & 255]));
}

// Returns a texture's first word.
const __global uint *texture_head(const Textures *textures, int number) {
    return textures->words + CHANNEL_VALUES + TEXTURE_HEAD_WORDS * number;
}

// The four texels around a point of a texture, as indices of words, and the share of each.
typedef struct {
    uint a, b, d, e;
    float ka, kb, kd, ke;
} Texels;

// Returns the texels at the point of a triangle with these weights; `ab` and `c` are the triangle's row.
Texels texels_at(const __global uint *head, float4 ab, float4 c, float w1, float w2) {
    const int width = (int)head[1], height = (int)head[2];
    const uint across = head[3] & 255, down = head[3] >> 8 & 255;
    // Centres of texels lie at half-integers, like those of pixels.
    const float w0 = 1.0f - w1 - w2;
    const float x = place_in_texture(w0 * ab.x + w1 * ab.z + w2 * c.x, across) * (float)width - 0.5f;
    const float y = place_in_texture(w0 * ab.y + w1 * ab.w + w2 * c.y, down) * (float)height - 0.5f;
    const float left = floor(x), top = floor(y);
    const int x0 = texel_in_texture((int)left, width, across), x1 = texel_in_texture((int)left + 1, width, across);
    const uint row0 = head[0] + (uint)(texel_in_texture((int)top, height, down) * width);
    const uint row1 = head[0] + (uint)(texel_in_texture((int)top + 1, height, down) * width);
    const float to_right = x - left, to_bottom = y - top;
    // Each texel's share is the area of the rectangle opposite to it.
    Texels texels;
    texels.a = row0 + x0, texels.b = row0 + x1, texels.d = row1 + x0, texels.e = row1 + x1;
    texels.ka = (1.0f - to_right) * (1.0f - to_bottom), texels.kb = to_right * (1.0f - to_bottom);
    texels.kd = (1.0f - to_right) * to_bottom, texels.ke = to_right * to_bottom;
    return texels;
}

// Returns the texture's colour at a point of a triangle with these weights: four texels, mixed in linear light. White
// without a texture.
Uniform3 texture_colour(const Textures *textures, int triangle, float w1, float w2) {
    const float4 ab = textures->rows[2 * (size_t)triangle], c = textures->rows[2 * (size_t)triangle + 1];
    const int number = as_int(c.z);
    if (number < 0) return uniform3(1.0f, 1.0f, 1.0f);
    const Texels at = texels_at(texture_head(textures, number), ab, c, w1, w2);
    const Uniform3 a = texel_colour(textures->words, at.a), b = texel_colour(textures->words, at.b);
    const Uniform3 d = texel_colour(textures->words, at.d), e = texel_colour(textures->words, at.e);
    return uniform3(at.ka * a.x + at.kb * b.x + at.kd * d.x + at.ke * e.x,
                    at.ka * a.y + at.kb * b.y + at.kd * d.y + at.ke * e.y,
                    at.ka * a.z + at.kb * b.z + at.kd * d.z + at.ke * e.z);
}

// Returns a surface whose colour is multiplied by the texture of each lane's triangle. Lanes whose triangle is NO_HIT
// keep their colour.
Surface textured(Surface surface, const Textures *textures, varying_int triangle, varying w1, varying w2) {
    IntLanes id;
    Lanes second, third, red, green, blue;
    id.all = triangle;
    second.all = w1, third.all = w2;
    red.all = green.all = blue.all = (varying)(1.0f);
    // Lanes may have different textures, so texels are read one lane after the other.
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
        const Uniform3 colour = texture_colour(textures, id.each[lane], second.each[lane], third.each[lane]);
        red.each[lane] = colour.x, green.each[lane] = colour.y, blue.each[lane] = colour.z;
    }
    surface.lambertian = multiply(surface.lambertian, vec3(red.all, green.all, blue.all));
    return surface;
}

#define TEXTURED(surface, textures, triangle, w1, w2) textured(surface, textures, triangle, w1, w2)
