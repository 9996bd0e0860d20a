// A sky that is an environment map: an equirectangular picture of the light from all directions.
// src/reference/environment.rs computes the light of such a sky in f64.

// The array `numbers` (a field of Soft, see soft.cl) begins with the floats of the sky. If the sky is not a picture,
// the first six floats are the radiance at the zenith and at the horizon. If the sky is a picture, the first six floats
// are the index of the picture's first texel in `numbers`, the picture's width and height in texels, and the direction
// in which the middle of the picture is seen. The picture's texels come after the lights' radii:
//
//     | first texel | width | height | middle (3) | up (3) | reach | radius of light 0 | ... | red green blue | ...
//
// A texel's column is proportional to the angle around the zenith, and its row to the angle from the zenith. Row 0 is
// at the zenith.

// Returns, for each lane, the radiance of the texel in the lane's column and row of the sky's picture.
static Vec3 texel_of_sky(const Soft *soft, varying_int column, varying_int row) {
    const __global float *texels = soft->numbers + (int)soft->numbers[0];
    const int width = (int)soft->numbers[1];
    IntLanes x, y;
    Lanes red, green, blue;
    x.all = column, y.all = row;
    // Lanes look in different directions, so each loads its own texel.
    for (int lane = 0; lane < WIDTH; lane++) {
        const __global float *texel = texels + 3 * ((size_t)y.each[lane] * width + x.each[lane]);
        red.each[lane] = texel[0], green.each[lane] = texel[1], blue.each[lane] = texel[2];
    }
    return vec3(red.all, green.all, blue.all);
}

// Returns the sky's radiance in a direction, interpolated between four texels of the sky's picture.
static Vec3 radiance_of_sky(const Soft *soft, Vec3 direction) {
    const int width = (int)soft->numbers[1], height = (int)soft->numbers[2];
    const Uniform3 middle = LOAD3(soft->numbers + 3), up = LOAD3(soft->numbers + 6);
    const varying ahead = dot3(direction, splat(middle)), right = dot3(direction, splat(uniform_cross(middle, up)));
    // `around` is the angle around the zenith, as a part of a full turn; `below` is the angle from the zenith, as a
    // part of a half turn. atan2pi computes both angles, since an arc cosine would lose digits near the zenith.
    const varying around = 0.5f + 0.5f * atan2pi(right, ahead);
    const varying below = atan2pi(sqrt(right * right + ahead * ahead), dot3(direction, splat(up)));
    // Centres of texels lie at half-integers. The picture shows all directions around the zenith, so its right edge
    // meets its left edge.
    const varying x = around * (float)width - 0.5f;
    const varying y = clamp(below * (float)height - 0.5f, (varying)(0.0f), (varying)((float)(height - 1)));
    const varying left = floor(x), top = floor(y), to_right = x - left, to_bottom = y - top;
    const varying_int x0 = TO_INT(left), y0 = TO_INT(top);
    const varying_int first = SELECT(x0 < 0, (varying_int)(width - 1), min(x0, width - 1));
    const varying_int second = SELECT(first + 1 < width, first + 1, (varying_int)(0));
    // The sky's picture ends at the zenith and at the nadir, so rows do not wrap around as columns do.
    const varying_int upper = clamp(y0, 0, height - 1), lower = clamp(y0 + 1, 0, height - 1);
    const Vec3 a = texel_of_sky(soft, first, upper), b = texel_of_sky(soft, second, upper);
    const Vec3 c = texel_of_sky(soft, first, lower), d = texel_of_sky(soft, second, lower);
    const Vec3 above = along(scale(a, 1.0f - to_right), to_right, b);
    const Vec3 underneath = along(scale(c, 1.0f - to_right), to_right, d);
    return along(scale(above, 1.0f - to_bottom), to_bottom, underneath);
}

// Let `axis` be the direction (0.36, 0.48, 0.8) of the scene. `vector` is given in coordinates whose third axis is
// `axis`. Returns `vector` in the scene's coordinates, after the shortest rotation that turns `axis` to the normal. If
// the normal is opposite to `axis`, the shortest rotation is undefined. Few surfaces have such a normal, since `axis`
// is oblique to all three coordinate axes of the scene.
Vec3 turned_to(Vec3 normal, Vec3 vector) {
    const Vec3 axis = splat(uniform3(0.36f, 0.48f, 0.8f)), across = splat(uniform3(0.8f, -0.6f, 0.0f));
    const Vec3 down = splat(uniform3(0.48f, 0.64f, -0.6f));
    const Vec3 own = along(along(scale(across, vector.x), vector.y, down), vector.z, axis);
    const Vec3 both = add(axis, normal);
    const varying part = dot3(both, own) / max(1.0f + dot3(axis, normal), (varying)(1e-6f));
    return along(along(own, -part, both), 2.0f * vector.z, normal);
}

// Estimates the radiance that a surface's highlight reflects from the picture of the sky to the eye, as if nothing
// blocked the sky. A half vector h is chosen with the density (s + 1) / (2 pi) (n . h)^s (n: normal, s: shininess). Let
// w_o be the direction to the eye, and w_i this direction mirrored at h. The density of w_i is that of h, divided by
// 4 w_o . h. The highlight k_G (s + 8) / (8 pi) (n . h)^s, times n . w_i, divided by the density of w_i, is k_G (s + 8)
// / (s + 1) (w_o . h) (n . w_i), with k_G = surface->glossy. The estimate is this quotient, times the radiance from
// w_i.
Vec3 mirrored_sky(const Soft *soft, int source, varying_int x, varying_int y, const Surface *surface, Vec3 normal,
                  Vec3 to_eye) {
    const Vec3 u = numbers_of(soft, source, x, y);
    // The cosine of the angle between half vector and normal is u.x^(1 / (s + 1)), with the shininess s. The squared
    // sine is 1 minus the squared cosine; expm1 keeps the digits that the subtraction from 1 would lose.
    const varying squared_sine = -expm1(2.0f / (surface->shininess + 1.0f) * log(u.x));
    const varying sine = sqrt(squared_sine);
    const Vec3 half_vector = turned_to(normal, vec3(sine * sinpi(2.0f * u.y), sine * cospi(2.0f * u.y), sqrt(1.0f - squared_sine)));
    // The light arrives from the direction w_i: the direction to the eye, mirrored at the half vector.
    const varying to_half = dot3(to_eye, half_vector);
    const Vec3 direction = along(negate(to_eye), 2.0f * to_half, half_vector);
    const varying cosines = max(to_half, (varying)(0.0f)) * max(dot3(direction, normal), (varying)(0.0f));
    const varying share = cosines * (surface->shininess + 8.0f) / (surface->shininess + 1.0f);
    return scale(multiply(surface->glossy, radiance_of_sky(soft, direction)), share);
}
