// Rays of a tile to the sky. Those of neighbouring pixels run into all directions, so that as a packet they would visit
// most of the tree. All rays of the tile are therefore sorted by their direction, and packets are made of sorted rays.

#define TILE_RAYS (VECTORS * WIDTH)
// Directions are sorted by the signs of their components and their longest one.
#define WAYS (8 * 3)

// The rays of a tile to the sky, in the order of its vectors, and their order by direction.
typedef struct {
    varying from[3][VECTORS], way[3][VECTORS];
    varying_int is_open[VECTORS]; // rays that are cast, then those that reach the sky: -1, else 0
    ushort sorted[TILE_RAYS];
    int count;
} SkyRays;

// Returns the number of the class of directions to which each lane's direction belongs.
varying_int class_of(Vec3 way) {
    const varying x = fabs(way.x), y = fabs(way.y), z = fabs(way.z);
    const varying_int longest = SELECT((x >= y) & (x >= z), (varying_int)(0), SELECT(y >= z, (varying_int)(1), (varying_int)(2)));
    // Comparisons are -1 where they are true.
    return 8 * longest - (way.x > 0.0f) - 2 * (way.y > 0.0f) - 4 * (way.z > 0.0f);
}

// Makes the rays of one vector, and counts them by class.
void make_sky_rays(SkyRays *rays, int vector, const Lighting *lighting, const Shaded *shaded, Pixels pixels, Mask hits,
                   IntLanes *classes, int *counts) {
    const Vec3 way = way_to_sky(&lighting->soft, lighting->light_count, pixels.x, pixels.y, shaded->normal);
    const Vec3 from = along(shaded->point, (varying)(lighting->bias), way);
    rays->from[0][vector] = from.x, rays->from[1][vector] = from.y, rays->from[2][vector] = from.z;
    rays->way[0][vector] = way.x, rays->way[1][vector] = way.y, rays->way[2][vector] = way.z;
    // Rays that point below the surface are not cast; they count in a class of their own, after all others.
    const Mask open = hits & (dot3(way, shaded->normal) > 0.0f);
    rays->is_open[vector] = open;
    classes->all = SELECT(open, class_of(way), (varying_int)(WAYS));
    for (int lane = 0; lane < WIDTH; lane++) counts[classes->each[lane]]++;
}

// Sorts the rays by class: a counting sort, which keeps the order of vectors within a class.
void sort_rays(SkyRays *rays, const IntLanes *classes, int *counts) {
    // Each class's count becomes the place where its first ray goes.
    int start = 0;
    for (int class = 0; class < WAYS; class++) {
        const int count = counts[class];
        counts[class] = start;
        start += count;
    }
    rays->count = start;
    for (int ray = 0; ray < TILE_RAYS; ray++) {
        const int class = classes[ray / WIDTH].each[ray % WIDTH];
        if (class < WAYS) rays->sorted[counts[class]++] = (ushort)ray;
    }
}

// Casts the packet of sorted rays that begins with the ray `first`. Those that something stops are then not open.
void cast_packet(const Tree *tree, SkyRays *rays, int first, varying t_max) {
    Lanes from[3], way[3];
    IntLanes stopped;
    for (int lane = 0; lane < WIDTH; lane++) {
        // Lanes after the last ray repeat it.
        const int ray = rays->sorted[min(first + lane, rays->count - 1)];
        for (int axis = 0; axis < 3; axis++) {
            from[axis].each[lane] = ((const float *)rays->from[axis])[ray];
            way[axis].each[lane] = ((const float *)rays->way[axis])[ray];
        }
    }
    const Vec3 origin = vec3(from[0].all, from[1].all, from[2].all), direction = vec3(way[0].all, way[1].all, way[2].all);
    stopped.all = are_stopped(tree, origin, direction, t_max, (Mask)(-1));
    for (int lane = 0; lane < WIDTH && first + lane < rays->count; lane++)
        if (stopped.each[lane]) ((int *)rays->is_open)[rays->sorted[first + lane]] = 0;
}

#if ENVIRONMENT
// Adds the picture of the sky as a vector of shiny surfaces mirrors it.
void add_mirrored_sky(const Bundle *bundle, const Lighting *lighting, int2 image_size, const Shaded *shaded, int vector, Vec3 *sum) {
    const Mask hits = bundle->place[vector] != NO_HIT;
    if (!ANY(hits)) return;
    const Pixels pixels = tile_pixels(vector, image_size);
    const Vec3 mirrored = mirrored_sky(&lighting->soft, lighting->light_count + 1, pixels.x, pixels.y, &shaded->surface,
                                       shaded->normal, shaded->to_eye);
    sum[vector] = select3(hits, add(sum[vector], mirrored), sum[vector]);
}
#endif

// Adds the light of the sky, from a direction whose probability is proportional to its cosine with the normal, so
// that k_L times its radiance arrives.
void add_sky(const Bundle *bundle, const SurfaceTree *tree, const Lighting *lighting, int2 image_size, const Shaded *shaded,
             Vec3 *sum) {
    SkyRays rays;
    IntLanes classes[VECTORS];
    int counts[WAYS + 1];
    for (int class = 0; class <= WAYS; class++) counts[class] = 0;
    for (int vector = 0; vector < VECTORS; vector++) {
        const Mask hits = bundle->place[vector] != NO_HIT;
        classes[vector].all = (varying_int)(WAYS);
        rays.is_open[vector] = (varying_int)(0);
        if (ANY(hits)) make_sky_rays(&rays, vector, lighting, shaded + vector, tile_pixels(vector, image_size), hits,
                                     classes + vector, counts);
    }
    sort_rays(&rays, classes, counts);
    const varying t_max = (varying)(reach_of_sky(&lighting->soft) - lighting->bias);
    for (int first = 0; first < rays.count; first += WIDTH) cast_packet(&tree->tree, &rays, first, t_max);
    // What is still open sees the sky.
    for (int vector = 0; vector < VECTORS; vector++) {
#if ENVIRONMENT
        add_mirrored_sky(bundle, lighting, image_size, shaded + vector, vector, sum);
#endif
        const Mask open = rays.is_open[vector];
        if (!ANY(open)) continue;
        const Vec3 way = vec3(rays.way[0][vector], rays.way[1][vector], rays.way[2][vector]);
        const Vec3 received = multiply(shaded[vector].surface.lambertian, radiance_of_sky(&lighting->soft, way));
        sum[vector] = select3(open, add(sum[vector], received), sum[vector]);
    }
}
