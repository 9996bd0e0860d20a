// The pixels and rays of a work-item. The ray through the point (x, y) of the image, in pixels, starts at eye.xyz in
// the direction corner + x * step_x + y * step_y (from src/scene/camera.rs). The direction's depth, its component along
// the view direction, is 1. Pixel centres lie at half-integers. eye.w is z_near: hits up to this depth are ignored.

#ifndef CAMERA_PARAMETERS
#error "CAMERA_PARAMETERS: the parameters eye, corner, step_x and step_y of kernels, with their types"
#endif

typedef struct {
    varying_int x, y;
    // `inside` is set in the lanes whose pixel is in the image and gets a sample. (A work-item's pixels form a block,
    // which may extend beyond the image's right or lower border.)
    Mask inside;
#ifdef SUBPIXELS
    // The position at which the ray passes through its pixel, across and down: 0.5 at the centre. The pixel filter is
    // wider than a pixel, so the position may lie below 0 or above 1.
    varying sample_x, sample_y;
#endif
} Pixels;

// The column and row, in pixels, of the point of the image through which a ray passes. This point is the centre of the
// ray's pixel or, with SUBPIXELS, the position of the sample.
#ifdef SUBPIXELS
#define RAY_X(pixels) (TO_FLOAT((pixels).x) + (pixels).sample_x)
#define RAY_Y(pixels) (TO_FLOAT((pixels).y) + (pixels).sample_y)
#else
#define RAY_X(pixels) (TO_FLOAT((pixels).x) + 0.5f)
#define RAY_Y(pixels) (TO_FLOAT((pixels).y) + 0.5f)
#endif

// Returns the pixels of this work-item's lanes. The pixels form a block. An example with four lanes in two columns:
//     lane  0 1  at  (x, y)      (x + 1, y)
//           2 3      (x, y + 1)  (x + 1, y + 1)
// The rays through a block of pixels stay close to each other, so they mostly meet the same triangles and boxes.
static Pixels own_pixels(int2 image_size) {
    Pixels pixels;
    pixels.x = (int)get_global_id(0) * BLOCK_X + LANE_X;
    pixels.y = (int)get_global_id(1) * BLOCK_Y + LANE_Y;
    pixels.inside = (pixels.x < image_size.x) & (pixels.y < image_size.y);
#ifdef SUBPIXELS
    pixels.sample_x = pixels.sample_y = (varying)(0.5f);
#endif
    return pixels;
}

typedef struct {
    Vec3 origin;
    Vec3 direction; // of length 1, except in pixel coordinates (ray_in_pixels)
    varying t_min;  // hits at this t or nearer are ignored (t is a distance or, in pixel coordinates, a depth)
} Ray;

#if WIDTH == 1
#define TO_FLOAT(i) convert_float(i)
#define TO_INT(a) convert_int(a)
#else
#define TO_FLOAT(i) PASTE(convert_float, WIDTH)(i)
#define TO_INT(a) PASTE(convert_int, WIDTH)(a)
#endif

// Returns the ray from the eye through each lane's pixel.
static Ray camera_ray(CAMERA_PARAMETERS, const Pixels *pixels) {
    const varying x = RAY_X(*pixels), y = RAY_Y(*pixels);
    const Vec3 d = vec3(corner.x + x * step_x.x + y * step_y.x,
                        corner.y + x * step_x.y + y * step_y.y,
                        corner.z + x * step_x.z + y * step_y.z);
    const varying length = sqrt(dot3(d, d));
    Ray ray;
    ray.origin = vec3((varying)(eye.x), (varying)(eye.y), (varying)(eye.z));
    ray.direction = scale(d, 1.0f / length); // so that t is a distance
    // z_near (eye.w) is a depth. Along the ray, the depth grows by 1 / length per unit of t.
    ray.t_min = eye.w * length;
    return ray;
}

// Returns the same rays as camera_ray, but in pixel coordinates: the direction of a ray through the point (x, y) of the
// image is (x, y, 1), and t is the depth.
static Ray ray_in_pixels(CAMERA_PARAMETERS, const Pixels *pixels) {
    Ray ray;
    ray.origin = vec3((varying)(eye.x), (varying)(eye.y), (varying)(eye.z));
    ray.direction = vec3(RAY_X(*pixels), RAY_Y(*pixels), (varying)(1.0f)); // no square root is needed
    ray.t_min = (varying)(eye.w); // z_near, since t is the depth
    return ray;
}
