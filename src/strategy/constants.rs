//! Where one way of casting becomes faster than another: made of stored sweeps by `raycl rule --fit`, not by hand. A place between two
//! cases of the sweeps is their geometric mean; what no sweep tells stays as it was.

use super::fastest::Constants;

/// CPUs whose vectors hold the rays of tiles.
pub const CPU: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 47.0,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    large_pixels: f64::INFINITY,
    large_pixels_a_triangle: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// The same where no ray may leak.
pub const CPU_WATERTIGHT: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 13.0,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    large_pixels: f64::INFINITY,
    large_pixels_a_triangle: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// GPUs whose work-items can share tiles.
pub const GPU: Constants = Constants {
    tree_triangles: 4.9,
    single_triangles_a_pixel: 2.0,
    single_triangles_a_pixel_inside: 0.97,
    single_pixels_a_unit: 61.0,
    large_pixels: 600000.0,
    large_pixels_a_triangle: 25.0,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: 12000000.0,
};

/// The same where no ray may leak.
pub const GPU_WATERTIGHT: Constants = Constants {
    tree_triangles: 24.0,
    single_triangles_a_pixel: 2.0,
    single_triangles_a_pixel_inside: 2.0,
    single_pixels_a_unit: 0.0,
    large_pixels: 6000000.0,
    large_pixels_a_triangle: 25.0,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: 910000.0,
};
