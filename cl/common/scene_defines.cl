// The defines that describe which features a scene has. Every kernel family needs all defines of this file.

#ifndef TEXTURES
#error "TEXTURES: 0 or 1: whether triangles have textures"
#endif
#ifndef CORNER_COLOURS
#error "CORNER_COLOURS: 0 or 1: whether the corners of triangles have colours"
#endif
#ifndef EMISSIVE
#error "EMISSIVE: 0 or 1: whether surfaces emit light"
#endif
#ifndef CUTOUTS
#error "CUTOUTS: 0 or 1: whether triangles have masks, and so holes"
#endif
#if !defined(SOFT) || !defined(SKY)
#error "SOFT, SKY: 0 or 1: whether lights with an extent or a sky are sampled, and whether there is a sky"
#endif
#ifndef SAMPLED
#error "SAMPLED: 0 or 1: whether a pixel gets several samples"
#endif
#ifndef HALF_LIGHT
#error "HALF_LIGHT: 0 or 1: whether soft light is cast at half resolution"
#endif
#ifndef ENVIRONMENT
#error "ENVIRONMENT: 0 or 1: whether the sky is a picture"
#endif
#ifndef SMOOTH_SHADOWS
#error "SMOOTH_SHADOWS: 0 or 1: whether hits are lit on a smooth surface above their triangles"
#endif
#ifndef AREA_LIGHTS
#error "AREA_LIGHTS: 0 or 1: whether some lights are rectangles or discs"
#endif
#if !defined(LIGHT_FLOATS) || !defined(MATERIAL_FLOATS)
#error "LIGHT_FLOATS, MATERIAL_FLOATS: floats of a light, and of a material"
#endif
