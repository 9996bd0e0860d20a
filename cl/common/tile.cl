// Code for both kinds of tiles of pixels: tiles that one work-item casts (tile_cpu/), and tiles that a group of 32
// work-items shares (tile_gpu/).

#if !defined(TILE_X) || !defined(TILE_Y)
#error "TILE_X, TILE_Y: pixels of a tile across and down"
#endif
#ifndef FUSED
#error "FUSED: 0 or 1: whether the kernel for primary rays also does as much of the rest of a frame as it can"
#endif
#ifndef CULL_BACK
#error "CULL_BACK: 0 or 1: whether culling = back"
#endif
#if !defined(NORMAL_FLOATS) || NORMAL_FLOATS != 9
#error "NORMAL_FLOATS: floats of a triangle's three normals, which are 9"
#endif
#ifndef WATERTIGHT
#error "WATERTIGHT: 0 or 1: whether the ray-triangle test needs exact signs, like intersector = watertight"
#endif
#include "common/scene_defines.cl"

#include "common/work_group.cl"
#include "common/width.cl"
#include "common/vec3.cl"
#include "common/camera.cl"
#include "common/hit.cl"
#include "common/rows.cl"
#if SMOOTH_SHADOWS
#include "common/smooth_shadows.cl"
#endif
#if SAMPLED
#include "common/samples.cl"
#include "common/mark_rough.cl"
#endif
#if TEXTURES
#include "common/textures.cl"
#else
#define TEXTURED(surface, textures, triangle, w1, w2, direction, t) surface
#endif
#if AREA_LIGHTS
#include "common/area_light.cl"
#endif
#if CORNER_COLOURS
#include "common/corner_colours.cl"
#else
#define COLOURED(surface, colours, triangle, w1, w2) surface
#endif
#if SOFT
#include "common/soft.cl"
#endif
#if ENVIRONMENT
#include "common/show_sky.cl"
#endif
