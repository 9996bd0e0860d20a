// Interpolates the colours of triangles' corners. src/reference/texture.rs interpolates them in f64.

#ifndef COLOUR_STEPS
#error "COLOUR_STEPS: steps of a channel of 10 bits"
#endif

// A triangle has three words, the colours of its corners. A word has three channels, each of 10 bits. A channel stores
// the square root of linear light, times COLOUR_STEPS, so that dark colours have finer steps than bright ones:
//
//     31 30  | 29 .. 20 | 19 .. 10 | 9 .... 0
//     unused | red      | green    | blue
static Uniform3 corner_colour(uint word) {
    const float step = 1.0f / COLOUR_STEPS;
    const float red = step * (float)(word >> 20 & COLOUR_STEPS);
    const float green = step * (float)(word >> 10 & COLOUR_STEPS), blue = step * (float)(word & COLOUR_STEPS);
    return uniform3(red * red, green * green, blue * blue);
}

// Returns `surface`, with its diffuse reflectance multiplied by the colour of each lane's triangle at the point with
// the weights w1 and w2. Lanes whose triangle is NO_HIT keep their diffuse reflectance.
static Surface coloured(Surface surface, const __global uint *colours, varying_int triangle, varying w1, varying w2) {
    IntLanes id;
    Lanes second, third, red, green, blue;
    id.all = triangle;
    second.all = w1, third.all = w2;
    red.all = green.all = blue.all = (varying)(1.0f);
    // Lanes may have different triangles, so colours are read one lane after the other.
    for (int lane = 0; lane < WIDTH; lane++) {
        if (id.each[lane] == NO_HIT) continue;
        const __global uint *words = colours + 3 * (size_t)id.each[lane];
        const Uniform3 a = corner_colour(words[0]), b = corner_colour(words[1]), c = corner_colour(words[2]);
        const float kb = second.each[lane], kc = third.each[lane], ka = 1.0f - kb - kc;
        red.each[lane] = ka * a.x + kb * b.x + kc * c.x;
        green.each[lane] = ka * a.y + kb * b.y + kc * c.y;
        blue.each[lane] = ka * a.z + kb * b.z + kc * c.z;
    }
    surface.lambertian = multiply(surface.lambertian, vec3(red.all, green.all, blue.all));
    return surface;
}

#define COLOURED(surface, colours, triangle, w1, w2) coloured(surface, colours, triangle, w1, w2)
