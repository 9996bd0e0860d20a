//! The sizes at which one way of casting becomes faster than another. `raycl rule --fit` generates this file from
//! stored sweeps; do not edit it. A constant that lies between two cases of the sweeps is near the geometric mean of
//! their values. A constant that no sweep determines keeps its former value.

use super::fastest::Constants;

/// For CPUs whose vectors hold 16 rays.
pub const CPU: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 47.0,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    few_triangles: 0.0,
    few_pixels_a_unit: 0.0,
    large_pixels_a_unit: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// For CPUs whose vectors hold 16 rays, with a watertight test.
pub const CPU_WATERTIGHT: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 13.0,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    few_triangles: 0.0,
    few_pixels_a_unit: 0.0,
    large_pixels_a_unit: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// For CPUs whose vectors hold fewer than 16 rays.
pub const NARROW_CPU: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 8.8,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    few_triangles: 0.0,
    few_pixels_a_unit: 0.0,
    large_pixels_a_unit: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// For CPUs whose vectors hold fewer than 16 rays, with a watertight test.
pub const NARROW_CPU_WATERTIGHT: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 2.5,
    single_triangles_a_pixel_inside: 13.0,
    single_pixels_a_unit: 0.0,
    few_triangles: 0.0,
    few_pixels_a_unit: 0.0,
    large_pixels_a_unit: f64::INFINITY,
    separate_pixels: f64::INFINITY,
    separate_pixels_inside: f64::INFINITY,
};

/// For GPUs whose work-items exchange values by PTX's lane operations.
pub const GPU: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 1.0,
    single_triangles_a_pixel_inside: 1.26,
    single_pixels_a_unit: 2.1,
    few_triangles: 100.0,
    few_pixels_a_unit: 7100.0,
    large_pixels_a_unit: 1400.0,
    separate_pixels: 7300000.0,
    separate_pixels_inside: 12000000.0,
};

/// For GPUs whose work-items exchange values by PTX's lane operations, with a watertight test.
pub const GPU_WATERTIGHT: Constants = Constants {
    tree_triangles: 0.0,
    single_triangles_a_pixel: 0.66,
    single_triangles_a_pixel_inside: 0.5,
    single_pixels_a_unit: 3.5,
    few_triangles: 3500.0,
    few_pixels_a_unit: 4800.0,
    large_pixels_a_unit: 2500.0,
    separate_pixels: 1500000.0,
    separate_pixels_inside: 440000.0,
};
