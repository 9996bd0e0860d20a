// What a surface sends of a light's radiance towards the eye: Hughes et al., Computer Graphics, chapter 15. Its readable
// twin in f64 is src/reference/.

// base to the power of exponent, neither of them negative: the built-in pow has to ask for more, and is not as precise.
varying power_of(varying base, varying exponent) {
    const varying at_zero = SELECT(exponent > 0.0f, (varying)(0.0f), (varying)(1.0f));
    return SELECT(base > 0.0f, exp2(exponent * log2(base)), at_zero);
}

// f(w_i, w_o, n): k_L / pi, and with a highlight (k_L + k_G (s + 8) max(0, n.w_h)^s / 8) / pi.
Vec3 reflectance(const Surface *surface, Vec3 to_light, Vec3 to_eye, Vec3 normal, Mask lit) {
    Vec3 sum = surface->lambertian;
    const Mask glossy = lit & (surface->kind > 0.0f);
    if (ANY(glossy)) {
        const Vec3 half_way = normalize_or_zero(add(to_light, to_eye));
        const varying cosine = max(dot3(normal, half_way), (varying)(0.0f));
        const varying s = surface->shininess;
        const varying highlight = (s + 8.0f) * power_of(cosine, s) * 0.125f;
        sum = select3(glossy, add(sum, scale(surface->glossy, highlight)), sum);
    }
    return scale(sum, (varying)(M_1_PI_F));
}
