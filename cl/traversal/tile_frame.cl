// The two kernels of a frame cast in tiles: the nearest hits, then their shading. tile.cl walks the tree for both.

// The pixels of a vector of a tile.
Pixels tile_pixels(int vector, int2 image_size) {
    Pixels pixels;
    const int across = TILE_X / BLOCK_X;
    pixels.x = (int)get_global_id(0) * TILE_X + vector % across * BLOCK_X + LANE_X;
    pixels.y = (int)get_global_id(1) * TILE_Y + vector / across * BLOCK_Y + LANE_Y;
    pixels.inside = (pixels.x < image_size.x) & (pixels.y < image_size.y);
    return pixels;
}

void make_camera_rays(Bundle *bundle, CAMERA_PARAMETERS, int2 image_size) {
    for (int vector = 0; vector < VECTORS; vector++) {
        const Pixels pixels = tile_pixels(vector, image_size);
        const varying x = TO_FLOAT(pixels.x) + 0.5f, y = TO_FLOAT(pixels.y) + 0.5f;
        bundle->x[vector] = corner.x + x * step_x.x + y * step_y.x;
        bundle->y[vector] = corner.y + x * step_x.y + y * step_y.y;
        bundle->z[vector] = corner.z + x * step_x.z + y * step_y.z;
        bundle->reach[vector] = SELECT(pixels.inside, (varying)(FAR), (varying)(-1.0f));
        bundle->place[vector] = (varying_int)(NO_HIT);
        finish_directions(bundle, vector);
    }
}

// The place in leaf order of every pixel's nearest triangle, or NO_HIT.
__kernel GROUP_SHAPE void tile_primary(TILE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size,
                                       __global int *restrict nearest) {
    Tree tree;
    tree.nodes = nodes;
    tree.leaves = leaves;
    const float x0 = get_global_id(0) * TILE_X + 0.5f, y0 = get_global_id(1) * TILE_Y + 0.5f;
    if (x0 > image_size.x || y0 > image_size.y) return; // no barriers here
    const Cone cone = camera_cone(corner, step_x, step_y, (float4)(x0, y0, x0 + TILE_X - 1, y0 + TILE_Y - 1));
    Bundle bundle;
    bundle.origin = uniform3(eye.x, eye.y, eye.z);
    bundle.t_min = eye.w;
    bundle.longest = cone.longest;
    make_camera_rays(&bundle, eye, corner, step_x, step_y, image_size);
    Slices slices;
    slice(&bundle, &slices);
    WaitingTile stack[STACK_SIZE];
    stack[0].word = 0;
    stack[0].entry = 0.0f;
    stack[0].live = ALL_VECTORS;
    walk(&bundle, &slices, &cone, &tree, stack, 1, ALL_VECTORS, 0);
    for (int vector = 0; vector < VECTORS; vector++)
        store_nearest(nearest, image_size, tile_pixels(vector, image_size), bundle.place[vector]);
}

// Each lane's row of three float4, as 12 columns: a load of 16 bytes a lane and quad, transposed in registers.
void gather_rows(const __global float4 *rows, varying_int places, varying *column) {
    IntLanes at;
    at.all = places * 3;
    for (int quad = 0; quad < 3; quad++) {
        const __global float4 *from = rows + quad;
        const float16 a = (float16)(from[at.each[0]], from[at.each[1]], from[at.each[2]], from[at.each[3]]);
        const float16 b = (float16)(from[at.each[4]], from[at.each[5]], from[at.each[6]], from[at.each[7]]);
        const float16 c = (float16)(from[at.each[8]], from[at.each[9]], from[at.each[10]], from[at.each[11]]);
        const float16 d = (float16)(from[at.each[12]], from[at.each[13]], from[at.each[14]], from[at.each[15]]);
        const float16 xz = (float16)(a.even, b.even), xz2 = (float16)(c.even, d.even);
        const float16 yw = (float16)(a.odd, b.odd), yw2 = (float16)(c.odd, d.odd);
        column[4 * quad] = (float16)(xz.even, xz2.even);
        column[4 * quad + 1] = (float16)(yw.even, yw2.even);
        column[4 * quad + 2] = (float16)(xz.odd, xz2.odd);
        column[4 * quad + 3] = (float16)(yw.odd, yw2.odd);
    }
}

// The materials of a vector's hits: one, mostly.
void gather_materials(const __global float *materials, varying number, Mask hits, Surface *surface) {
    IntLanes at, hit;
    at.all = AS_INT(number);
    hit.all = hits;
    Lanes column[8];
    for (int lane = 0; lane < WIDTH; lane++)
        for (int i = 0; i < 8; i++) column[i].each[lane] = hit.each[lane] ? materials[8 * at.each[lane] + i] : 0.0f;
    surface->lambertian = vec3(column[0].all, column[1].all, column[2].all);
    surface->glossy = vec3(column[3].all, column[4].all, column[5].all);
    surface->shininess = column[6].all;
    surface->kind = column[7].all;
}

void one_material(const __global float *material, Surface *surface) {
    surface->lambertian = splat(LOAD3(material));
    surface->glossy = splat(LOAD3(material + 3));
    surface->shininess = (varying)(material[6]);
    surface->kind = (varying)(material[7]);
}

// Where a vector's rays hit, and the surface there.
typedef struct {
    Vec3 point, normal, to_eye;
    Surface surface;
} Shaded;

Shaded meet_vector(const Tree *tree, const __global float4 *surfaces, const __global float *materials,
                   const int material_count, Ray ray, varying_int place, Mask hits) {
    const varying_int safe = SELECT(hits, place, (varying_int)(0));
    varying corner[12], normal[12];
    gather_rows((const __global float4 *)tree->leaves, safe, corner);
    gather_rows(surfaces, safe, normal);
    const Vec3 v0 = vec3(corner[0], corner[1], corner[2]);
    const Vec3 e1 = subtract(vec3(corner[4], corner[5], corner[6]), v0);
    const Vec3 e2 = subtract(vec3(corner[8], corner[9], corner[10]), v0);
    const Hit hit = meet_plane(v0, e1, e2, ray.origin, ray.direction);
    Shaded shaded;
    shaded.point = along(ray.origin, hit.t, ray.direction);
    const Vec3 n0 = vec3(normal[0], normal[1], normal[2]);
    const Vec3 n1 = vec3(normal[4], normal[5], normal[6]);
    const Vec3 n2 = vec3(normal[8], normal[9], normal[10]);
    shaded.normal = normalize_or_zero(along(along(scale(n0, 1.0f - hit.w1 - hit.w2), hit.w1, n1), hit.w2, n2));
    shaded.to_eye = negate(ray.direction);
    if (material_count == 1) one_material(materials, &shaded.surface);
    else gather_materials(materials, corner[7], hits, &shaded.surface);
    return shaded;
}

// Shades a tile's nearest hits: for each light, what arrives at them if nothing is in between, then a walk from the
// light to find where something is.
__kernel GROUP_SHAPE void tile_shade(TILE_PARAMETERS, CAMERA_PARAMETERS, const int2 image_size, const float4 background,
                                     __global float4 *restrict image, const __global int *restrict nearest) {
    Tree tree;
    tree.nodes = nodes;
    tree.leaves = leaves;
    if (get_global_id(0) * TILE_X >= image_size.x || get_global_id(1) * TILE_Y >= image_size.y) return;
    Vec3 sum[VECTORS];
    for (int vector = 0; vector < VECTORS; vector++)
        sum[vector] = vec3((varying)(0.0f), (varying)(0.0f), (varying)(0.0f));
    Bundle bundle;
    WaitingTile stack[STACK_SIZE];
    Slices unused;
    for (int light = 0; light < light_count; light++) {
        const __global float *at = lights + 6 * light;
        const Uniform3 from = LOAD3(at);
        const Vec3 power = splat(LOAD3(at + 3));
        Vec3 arriving[VECTORS];
        varying furthest_point = (varying)(0.0f);
        uint open = 0;
        for (int vector = 0; vector < VECTORS; vector++) {
            const Pixels pixels = tile_pixels(vector, image_size);
            const varying_int place = load_nearest(nearest, image_size, pixels);
            const Mask hits = place != NO_HIT;
            bundle.reach[vector] = (varying)(-1.0f);
            if (!ANY(hits)) continue;
            const Ray ray = camera_ray(eye, corner, step_x, step_y, pixels);
            const Shaded shaded = meet_vector(&tree, surfaces, materials, material_count, ray, place, hits);
            const Vec3 offset = subtract(splat(from), shaded.point);
            const varying squared = dot3(offset, offset);
            const varying distance = sqrt(squared);
            const Vec3 to_light = scale(offset, 1.0f / distance);
            const varying cosine = dot3(to_light, shaded.normal);
            const Mask lit = hits & (cosine > 0.0f) & (distance > bias);
            if (!ANY(lit)) continue;
            const Vec3 f = reflectance(&shaded.surface, to_light, shaded.to_eye, shaded.normal, lit);
            arriving[vector] = scale(multiply(power, f), cosine / (4.0f * M_PI_F * squared));
            bundle.x[vector] = -offset.x;
            bundle.y[vector] = -offset.y;
            bundle.z[vector] = -offset.z;
            finish_directions(&bundle, vector);
            bundle.reach[vector] = SELECT(lit, 1.0f - bias / distance, (varying)(-1.0f));
            furthest_point = max(furthest_point, SELECT(lit, distance, (varying)(0.0f)));
            open |= 1u << vector;
        }
        if (!open) continue;
        bundle.origin = from;
        bundle.t_min = 0.0f;
        bundle.longest = most_lane(furthest_point);
        const Cone cone = bundle_cone(&bundle);
        stack[0].word = 0;
        stack[0].entry = 0.0f;
        stack[0].live = open;
        const uint lit_vectors = open;
        walk(&bundle, &unused, &cone, &tree, stack, 1, open, 1);
        for (uint left = lit_vectors; left; left &= left - 1) {
            const int vector = LOWEST_BIT(left);
            sum[vector] = select3(bundle.reach[vector] > 0.0f, add(sum[vector], arriving[vector]), sum[vector]);
        }
    }
    for (int vector = 0; vector < VECTORS; vector++) {
        const Pixels pixels = tile_pixels(vector, image_size);
        const Mask hits = load_nearest(nearest, image_size, pixels) != NO_HIT;
        store_radiance(image, image_size, background, sum[vector], pixels, hits);
    }
}
