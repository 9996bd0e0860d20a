// The reflectance (BRDF) of a surface: the radiance that the surface reflects to the eye, divided by the irradiance
// that the surface receives from a light. The formulas are from Hughes et al., Computer Graphics, 3rd ed., chapter 15.
// src/reference/ has the same formulas in f64.

// Returns `base` to the power of `exponent`; neither may be negative. The function computes x^y as 2^(y log2 x). A base
// of zero is a special case, because the logarithm of zero is infinite: 0^0 is 1, other powers of 0 are 0. The built-in
// pow handles more cases, and is slower.
static varying power_of(varying base, varying exponent) {
    const varying at_zero = SELECT(exponent > 0.0f, (varying)(0.0f), (varying)(1.0f));
    return SELECT(base > 0.0f, exp2(exponent * log2(base)), at_zero);
}

// Returns f(w_i, w_o, n): without a highlight k_L / pi, with a highlight (k_L + k_G (s + 8) max(0, n.w_h)^s / 8) / pi.
// w_i is the direction to the light, and w_o the direction to the eye. w_h is the unit vector halfway between w_i and
// w_o, and n is the normal. k_L, k_G and s are explained in rows.cl. Lanes that are not in `lit` get no highlight.
static Vec3 reflectance(const Surface *surface, Vec3 to_light, Vec3 to_eye, Vec3 normal, Mask lit) {
    Vec3 sum = surface->lambertian;
    // A highlight costs a division, a logarithm and an exponential, which are skipped if no lane of `lit` has a
    // highlight.
    const Mask glossy = lit & (surface->kind > 0.0f);
    if (ANY(glossy)) {
        // `half_vector` is Blinn's half vector w_h, but of any length. The squared cosine of the angle between
        // `half_vector` and the normal needs no square root.
        const Vec3 half_vector = add(to_light, to_eye);
        const varying along_normal = max(dot3(normal, half_vector), (varying)(0.0f)), squared = dot3(half_vector, half_vector);
        const varying cosine_squared = SELECT(squared > 0.0f, along_normal * along_normal / squared, (varying)(0.0f));
        const varying s = surface->shininess;
        // The factor (s + 8) / 8 keeps the energy of a highlight about the same for every shininess s.
        const varying highlight = (s + 8.0f) * power_of(cosine_squared, 0.5f * s) * 0.125f;
        sum = select3(glossy, add(sum, scale(surface->glossy, highlight)), sum);
    }
    return scale(sum, (varying)(M_1_PI_F));
}
