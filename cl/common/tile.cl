// Code for all tiles of rays: those of one work-item, and those that a group shares.

#if !defined(TILE_X) || !defined(TILE_Y)
#error "TILE_X, TILE_Y: pixels of a tile across and down"
#endif
#ifndef CULL_BACK
#error "CULL_BACK: 0 or 1: whether culling = back"
#endif
#ifndef WATERTIGHT
#error "WATERTIGHT: 0 or 1: whether intersector = watertight"
#endif
#ifndef TEXTURES
#error "TEXTURES: 0 or 1: whether triangles have textures"
#endif
#ifndef CUTOUTS
#error "CUTOUTS: 0 or 1: whether triangles have masks, and so holes"
#endif
#if !defined(SOFT) || !defined(SKY)
#error "SOFT, SKY: 0 or 1: whether lights with a radius or a sky are sampled, and whether there is a sky"
#endif
#ifndef SAMPLED
#error "SAMPLED: 0 or 1: whether a pixel gets several samples"
#endif
#ifndef ENVIRONMENT
#error "ENVIRONMENT: 0 or 1: whether the sky is a picture"
#endif
#if !defined(LIGHT_FLOATS) || !defined(MATERIAL_FLOATS)
#error "LIGHT_FLOATS, MATERIAL_FLOATS: floats of a light, and of a material"
#endif

#include "common/work_group.cl"
#include "common/width.cl"
#include "common/vec3.cl"
#include "common/camera.cl"
#include "common/hit.cl"
#include "common/rows.cl"
#if SAMPLED
#include "common/samples.cl"
#include "common/mark_rough.cl"
#endif
#if TEXTURES
#include "common/textures.cl"
#else
#define TEXTURED(surface, textures, triangle, w1, w2) surface
#endif
#if SOFT
#include "common/soft.cl"
#endif
#if ENVIRONMENT
#include "common/show_sky.cl"
#endif
