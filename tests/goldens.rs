//! The figures of the student paper that raycl reproduces: pictures that are computed here in f64, without
//! raycl's code and scene files, are compared with the binary's pictures and with raycl's reference.
//!
//! The formulas and the single triangle are from Hughes, van Dam, McGuire et al., *Computer Graphics:
//! Principles and Practice*, 3rd ed., chapter 15. The scenes are those of the student paper.

use crate::binary::{WorkFolder, device, repository};
use glam::{DVec3, dvec3};
use image::RgbImage;
use raycl::image::psnr_db;
use raycl::reference::reference;
use raycl::scene::load_scene;
use raycl::strategy::Culling;
use std::f64::consts::PI;

const BACKGROUND: DVec3 = dvec3(0.0022, 0.0032, 0.0053);
/// The least peak signal-to-noise ratio, in decibels, at which two pictures count as the same.
const SAME_DB: f64 = 40.0;

#[derive(Clone, Copy)]
struct Triangle {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    lambertian: DVec3,
    /// The reflectance k_G of a surface's highlight. If k_G is not 0, the shininess is 100.
    glossy: f64,
}

struct Figure {
    scene: &'static str,
    triangles: Vec<Triangle>,
    light: DVec3,
    bias: f64,
}

struct Ray {
    from: DVec3,
    along: DVec3,
}

/// Returns the distance of the hit, and the barycentric weights of the triangle's second and third corner;
/// `None` if the ray misses the triangle.
fn intersect(ray: &Ray, triangle: &Triangle) -> Option<(f64, f64, f64)> {
    let [v0, v1, v2] = triangle.corners;
    let (e1, e2) = (v1 - v0, v2 - v0);
    let q = ray.along.cross(e2);
    let a = e1.dot(q);
    if a.abs() <= 1e-7 {
        return None;
    }
    let s = ray.from - v0;
    let r = s.cross(e1);
    let (w1, w2, t) = (s.dot(q) / a, ray.along.dot(r) / a, e2.dot(r) / a);
    let inside = [w1, w2, 1.0 - w1 - w2].into_iter().all(|w| w >= -1e-10);
    (inside && t > 0.0).then_some((t, w1, w2))
}

impl Figure {
    fn new(scene: &'static str, triangles: Vec<Triangle>) -> Self {
        Self { scene, triangles, light: dvec3(1.0, 3.0, 1.0), bias: 1e-4 }
    }

    fn radiance(&self, ray: &Ray) -> DVec3 {
        let hits = self.triangles.iter().filter_map(|triangle| Some((intersect(ray, triangle)?, triangle)));
        match hits.min_by(|(one, _), (other, _)| one.0.total_cmp(&other.0)) {
            None => BACKGROUND,
            Some(((t, w1, w2), triangle)) => {
                let [n0, n1, n2] = triangle.normals;
                let normal = ((1.0 - w1 - w2) * n0 + w1 * n1 + w2 * n2).normalize();
                self.reflected(triangle, ray.from + t * ray.along, normal, -ray.along)
            }
        }
    }

    fn reflected(&self, triangle: &Triangle, point: DVec3, normal: DVec3, to_eye: DVec3) -> DVec3 {
        let offset = self.light - point;
        let distance = offset.length();
        let to_light = offset / distance;
        let shadow = Ray { from: point + self.bias * to_light, along: to_light };
        let blocks = |t: &Triangle| intersect(&shadow, t).is_some_and(|hit| hit.0 < distance - self.bias);
        if self.triangles.iter().any(blocks) {
            return DVec3::ZERO;
        }
        let half_vector = (to_light + to_eye).normalize();
        let highlight = triangle.glossy * 108.0 * normal.dot(half_vector).max(0.0).powi(100) / 8.0;
        let reflectance = (triangle.lambertian + DVec3::splat(highlight)) / PI;
        let power = 10.0 / (4.0 * PI * distance * distance);
        power * reflectance * to_light.dot(normal).max(0.0)
    }

    /// Returns the radiance at every pixel. The field of view is pi / 2 across; row 0 is at the top.
    fn image(&self, [width, height]: [u32; 2]) -> Vec<DVec3> {
        let (w, h) = (f64::from(width), f64::from(height));
        let s = -2.0 * (PI / 4.0).tan();
        let ray = |x: u32, y: u32| {
            let (across, down) = ((f64::from(x) + 0.5) / w - 0.5, (f64::from(y) + 0.5) / h - 0.5);
            let start = dvec3(across * s, -down * s * h / w, 1.0) * -0.1;
            Ray { from: DVec3::ZERO, along: start.normalize() }
        };
        (0..height).flat_map(|y| (0..width).map(move |x| self.radiance(&ray(x, y)))).collect()
    }

    fn displayed(&self, size: [u32; 2]) -> RgbImage {
        let byte = |value: f64| (255.0 * (15.0 * value).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8;
        let bytes = self.image(size).iter().flat_map(|pixel| pixel.to_array().map(byte)).collect();
        RgbImage::from_raw(size[0], size[1], bytes).expect("three bytes per pixel")
    }
}

/// Returns the single triangle of the book *Computer Graphics: Principles and Practice*.
fn triangle(lambertian: DVec3) -> Triangle {
    Triangle {
        corners: [dvec3(0.0, 1.0, -2.0), dvec3(-1.9, -1.0, -2.0), dvec3(1.6, -0.5, -2.0)],
        normals: [dvec3(0.0, 0.6, 1.0), dvec3(-0.4, -0.4, 1.0), dvec3(0.4, -0.4, 1.0)],
        lambertian,
        glossy: 0.2,
    }
}

fn ground() -> [Triangle; 2] {
    let corner = |x, z| dvec3(x, -1.0, z);
    let [a, b, c, d] = [corner(-10.0, -0.01), corner(10.0, -0.01), corner(10.0, -10.0), corner(-10.0, -10.0)];
    let flat =
        |corners| Triangle { corners, normals: [DVec3::Y; 3], lambertian: DVec3::splat(0.8), glossy: 0.0 };
    [flat([a, b, c]), flat([a, c, d])]
}

fn figure_4() -> Figure {
    let green = triangle(dvec3(0.0, 0.6, 0.0));
    let twin = |[a, b, c]: [DVec3; 3]| [b, a, c];
    let reversed = Triangle { corners: twin(green.corners), normals: twin(green.normals), ..green };
    Figure::new("figure-4", [&[green, reversed], &ground()[..]].concat())
}

/// Returns the pyramid of the student paper's Figure 3. The camera does not see the pyramid's back and base, but these
/// two faces throw shadows.
fn pyramid(scene: &'static str) -> Figure {
    let (apex, front) = (dvec3(0.0, 2.0, -3.5), dvec3(0.0, -1.0, -2.0));
    let (left, right) = (dvec3(-2.0, -1.0, -3.0), dvec3(2.0, -1.0, -3.0));
    let face = |corners, normal| Triangle {
        corners,
        normals: [normal; 3],
        lambertian: dvec3(2.5, 0.2, 2.0),
        glossy: 0.2,
    };
    let faces = [
        face([apex, left, front], dvec3(1.0, 2.0, 1.0)),
        face([apex, front, right], DVec3::Z),
        face([apex, right, left], DVec3::NEG_Z),
        face([front, left, right], DVec3::NEG_Y),
    ];
    Figure::new(scene, [&faces, &ground()[..]].concat())
}

fn figures() -> [Figure; 4] {
    let lower = Figure { light: dvec3(3.0, 0.95, -1.5), bias: 1e-2, ..pyramid("pyramid-lower") };
    let single = Figure::new("triangle", vec![triangle(dvec3(2.5, 2.0, 0.0))]);
    [single, figure_4(), pyramid("pyramid-upper"), lower]
}

/// Returns the picture that the binary renders of a scene file at the paper's 800 x 500; `name` is the picture's file.
fn rendered(scene: &str, strategy: &[&str], name: &str) -> RgbImage {
    let (folder, device) = (WorkFolder::new(), device());
    let path = repository(&format!("scenes/{scene}.toml"));
    let render = ["render", path.to_str().expect("UTF-8"), "-o", name, "--width", "800", "--height", "500"];
    folder.output(&[&render[..], &["--device", &device], strategy].concat());
    image::open(folder.path(name)).expect("a picture").to_rgb8()
}

#[test]
fn renders_are_the_papers_figures() {
    for figure in figures() {
        let expected = figure.displayed([800, 500]);
        for strategy in [&[][..], &["--strategy", "naive"], &["--strategy", "raster"]] {
            let db = psnr_db(&rendered(figure.scene, strategy, "a.png"), &expected);
            assert!(db >= SAME_DB, "{} {strategy:?}: {db:.1} dB", figure.scene);
        }
    }
}

#[test]
fn a_jpeg_at_its_quality_is_the_papers_figure_too() {
    for figure in figures() {
        let db = psnr_db(&rendered(figure.scene, &[], "a.jpg"), &figure.displayed([800, 500]));
        assert!(db >= SAME_DB, "{}: {db:.1} dB", figure.scene);
    }
}

/// Other tests compare images with the reference; this test checks the reference itself.
#[test]
fn the_reference_agrees_with_the_formulas() {
    // At this image size, no row of pixels lies on the ground's far edge.
    let size = [210, 131];
    for figure in figures() {
        let path = repository(&format!("scenes/{}.toml", figure.scene));
        let scene = load_scene(&path).expect("a scene").scene;
        let actual = reference(&scene, size, Culling::None).radiance;
        let apart = |(actual, expected): (&[f32; 3], DVec3)| {
            let actual = DVec3::from_array(actual.map(f64::from));
            (actual - expected).abs().max_element() > 1e-4 * expected.max_element().max(0.005)
        };
        let pairs = actual.pixels.iter().zip(figure.image(size));
        let wrong = pairs.filter(|pair| apart(*pair)).count();
        // Scene files are read as f32, which may move parts of an edge by a pixel.
        assert!(wrong <= 10, "{}: {wrong} of 27510 pixels", figure.scene);
    }
}
