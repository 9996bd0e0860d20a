//! Places a camera so that it shows a whole mesh, and adds lights to a mesh that has none.

use super::mesh::{Mesh, PARALLEL_TRIANGLES, Triangle};
use super::{Camera, Light, Shot};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Default field of view across the height. Like a portrait lens, this field of view distorts little.
const FOV_Y_DEGREES: f32 = 35.0;
/// The mesh usually fills the fraction `FILL` of the picture in one direction (across or down), and at most this
/// fraction in the other direction. If the eye would be nearer to the mesh than `NEAREST_RADII` allows, raycl moves
/// the eye away, and the mesh fills a smaller fraction.
const FILL: f64 = 0.92;
/// The default direction from a mesh to the camera: the components to the right, upwards and to the front.
const THREE_QUARTER: DVec3 = DVec3::new(0.6, 0.45, 1.0);
/// The camera of a turntable is placed so that the whole mesh is visible at `TURNS` equally spaced angles.
const TURNS: u32 = 24;
/// The smallest distance between the eye and the point of the mesh that is nearest to the eye, in radii of
/// the ball around the mesh. This distance is measured along the viewing direction.
const NEAREST_RADII: f64 = 0.3;
/// Smallest radius of the ball that represents a mesh, as a fraction of the distance from the origin to the
/// ball's centre. This smallest radius is 8 to 17 times the step between neighbouring f32 numbers that are as
/// large as the distance.
const LEAST_RADIUS: f64 = 1e-6;
/// A mesh is closed if the length of the sum of its area vectors (normal times area) is at most the fraction
/// `OPEN_PART` of the mesh's area. A mesh that is not closed is open if the horizontal part of this sum is also longer
/// than the fraction `OPEN_PART` of the mesh's area. If one triangle is reversed in a mesh whose area vectors add up to
/// zero, the length of the sum becomes twice the triangle's area. Reversing one triangle can therefore make such a mesh
/// open only if the triangle has more than half of the fraction `OPEN_PART` of the mesh's area. At most 19 triangles of
/// a mesh are so large.
const OPEN_PART: f64 = 0.1;
/// A triangle belongs to a wall if the distances of all its corners from a side of the bounding box are at most the
/// fraction `WALL_DEPTH` of the box's extent perpendicular to the side. `WALL_DEPTH` is above 0, since the walls of a
/// room are rarely exactly parallel to the sides of its bounding box.
const WALL_DEPTH: f64 = 1.0 / 16.0;
/// A mesh is a room or a shell only if at least `LEAST_WALLS` of the six sides of its bounding box have a wall.
const LEAST_WALLS: f64 = 3.0;
/// The walls of a mesh count as facing outwards if at least the fraction `OUTWARDS_PART` of their area faces outwards.
const OUTWARDS_PART: f64 = 0.9;
/// The surfaces between the walls of a mesh count as bodies (such as furniture) only if they have at least the fraction
/// `BODIES_PART` of the mesh's area.
const BODIES_PART: f64 = 0.02;
/// The surfaces between the walls of a mesh count as bodies only if they are nearly closed. They are nearly closed if
/// the sum of their area vectors (normal times area) has a length of at most the fraction `BODIES_OPEN_PART` of their
/// area. For a cube without a bottom face, this length is a fifth of the area. For a shallow recess in the wall of a
/// shell, the length is a larger part of the area.
const BODIES_OPEN_PART: f64 = 0.3;
/// A side of the bounding box counts as vertical if the absolute value of the upward direction's component along the
/// side's normal is less than `VERTICAL`.
const VERTICAL: f64 = 0.1;
/// Distance of the lights from the centre of the ball around the mesh, in radii of this ball. Nearer lights
/// would light the mesh unevenly; with lights much farther away, the shading would show less of the mesh's
/// shape.
const LIGHT_RADII: f64 = 10.0;

/// The ball that represents a mesh in framing and lighting.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// The centre of the bounding box.
    pub centre: DVec3,
    radius: f64,
    /// The horizontal direction from which an open mesh is seen. For a room without its front wall, this
    /// direction leads to the missing wall. `None` for other meshes.
    opening: Option<DVec3>,
    /// True if the area vectors (normal times area) of the mesh's triangles nearly add up to zero. Also true if they
    /// would nearly add up to zero after a single, wrongly wound triangle was reversed.
    closed: bool,
}

impl Ball {
    /// Returns the ball that represents a mesh whose upward direction is `up`. The radius is positive even if
    /// the mesh is a point. If the mesh is far from the origin, the ball's radius is made so large that its
    /// centre, rounded to f32, differs from an eye that is `NEAREST_RADII` radii away.
    pub fn around(mesh: &Mesh, up: DVec3) -> Self {
        let (low, high) = mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = (low + high) / 2.0;
        let radius = ((high - low).length() / 2.0).max(LEAST_RADIUS * centre.length()).max(1e-9);
        let areas = Areas::of_mesh(mesh, [low, high]);
        let closed = areas.are_closed() || areas.are_closed_but_for_one(mesh);
        let opening = if closed { None } else { areas.opening([low, high], up) };
        Self { centre, radius, opening, closed }
    }

    /// Returns the ball's centre and radius.
    pub fn centre_and_radius(&self) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    /// Returns true if the mesh is open in a horizontal direction, like a room without its front wall.
    pub fn is_open(&self) -> bool {
        self.opening.is_some()
    }

    /// Returns true if the mesh seems to enclose a volume, because its area vectors nearly add up to zero. Returns
    /// false, for example, for a flat sheet with one side, and for a room with an open side.
    pub fn is_closed(&self) -> bool {
        self.closed
    }
}

/// A field of view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    /// Tangent of half the field of view.
    pub tan_half_fov: f32,
    /// True if the field of view is measured across the height; otherwise across the width.
    pub fov_is_vertical: bool,
}

impl Lens {
    /// Returns `camera` with this field of view.
    pub fn on(self, camera: Camera) -> Camera {
        let Self { tan_half_fov, fov_is_vertical } = self;
        Camera { tan_half_fov, fov_is_vertical, ..camera }
    }
}

/// The direction from which a mesh is seen, and the field of view.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// The upward direction, of length 1.
    pub up: DVec3,
    /// The eye's angle from the front to the right of the mesh; `None` if the user does not set it.
    pub azimuth_degrees: Option<f64>,
    /// The eye's angle above the horizon; `None` if the user does not set it.
    pub elevation_degrees: Option<f64>,
    /// The field of view; `None` if the user does not set it. The default is `FOV_Y_DEGREES` across the
    /// height.
    pub lens: Option<Lens>,
    /// The pictures that the mesh should fill: their aspect ratio, and whether the mesh turns in them.
    pub shot: Shot,
}

impl View {
    /// Returns the rotations after each of which the mesh must fit into the pictures: `TURNS` rotations for a
    /// turntable, otherwise only the identity.
    fn turns(&self) -> Vec<DMat3> {
        let count = if self.shot.turns { TURNS } else { 1 };
        let angle = |number: u32| f64::from(number) / f64::from(count) * std::f64::consts::TAU;
        (0..count).map(|number| DMat3::from_axis_angle(self.up, angle(number))).collect()
    }

    /// Returns the horizontal directions to the right and to the front of the mesh. If y is up, the front is
    /// +z; if z is up, the front is -y.
    fn level(&self) -> [DVec3; 2] {
        let front = if self.up.z.abs() < 0.9 { DVec3::Z } else { DVec3::NEG_Y };
        let front = front.reject_from_normalized(self.up).normalize_or(DVec3::X);
        [self.up.cross(front), front]
    }

    /// Returns the direction from the mesh to the eye, and the direction that is upwards in the picture.
    /// `opening` is the direction from which an open mesh is seen.
    fn towards_eye(&self, opening: Option<DVec3>) -> [DVec3; 2] {
        let [right, front] = self.level();
        let DVec3 { x, y, z } = THREE_QUARTER;
        // An open mesh is seen from the direction `opening`; any other mesh is seen from the right, above and in
        // front.
        let usual = opening.unwrap_or_else(|| (right * x + self.up * y + front * z).normalize());
        if self.azimuth_degrees.is_none() && self.elevation_degrees.is_none() {
            return [usual, self.up];
        }
        // If the user sets only one angle, the other angle is that of the usual direction.
        let [x, y, z] = [right, self.up, front].map(|axis| usual.dot(axis));
        let azimuth = self.azimuth_degrees.map_or_else(|| x.atan2(z), f64::to_radians);
        let elevation = self.elevation_degrees.map_or_else(|| y.atan2(x.hypot(z)), f64::to_radians);
        let level = right * azimuth.sin() + front * azimuth.cos();
        // If the mesh is seen from straight above, the side at this azimuth (with an azimuth of 0, the front) is at
        // the bottom of the picture.
        let upright = self.up * elevation.cos() - level * elevation.sin();
        [self.up * elevation.sin() + level * elevation.cos(), upright]
    }
}

/// Returns a camera that shows the whole mesh. The distance of the eye depends on the field of view, so that
/// the mesh usually fills the fraction `FILL` of the picture's width or height.
pub(super) fn camera(mesh: &Mesh, ball: Ball, view: &View) -> Camera {
    let [towards_eye, upright] = view.towards_eye(ball.opening);
    let look = Camera::looking_at(Vec3::ZERO, -towards_eye.as_vec3(), upright.as_vec3(), FOV_Y_DEGREES, true);
    // `upright` is never parallel to the viewing direction, so the camera always exists.
    let look = look.unwrap_or(Camera::PAPER);
    let look = view.lens.map_or(look, |lens| lens.on(look));
    let tan = f64::from(look.tan_half_fov) * FILL;
    let aspect = view.shot.aspect;
    let (tan_x, tan_y) = if look.fov_is_vertical { (tan * aspect, tan) } else { (tan, tan / aspect) };
    let (right, up) = (look.right.as_dvec3(), look.up.as_dvec3());
    // The view pyramid, made narrower by `FILL`, has four sides. Consider the four planes that are parallel
    // to the sides of this pyramid and pass through the centre of the ball around the mesh. `reach_after`
    // returns five numbers for a corner of the mesh. The first four numbers are the distances, measured
    // across or up the picture, by which the corner is beyond the right, left, upper and lower plane. The
    // fifth number says how much nearer to the eye the corner is than the ball's centre.
    let reach_after = |turn: &DMat3, corner: Vec3| {
        let offset = *turn * (corner.as_dvec3() - ball.centre);
        let (x, y, depth) = (offset.dot(right), offset.dot(up), offset.dot(towards_eye));
        [x + tan_x * depth, tan_x * depth - x, y + tan_y * depth, tan_y * depth - y, depth]
    };
    let turns = view.turns();
    let most = |a: [f64; 5], b: [f64; 5]| std::array::from_fn(|i| a[i].max(b[i]));
    let reach =
        |corner| turns.iter().map(|turn| reach_after(turn, corner)).fold([f64::NEG_INFINITY; 5], most);
    // Triangles share corners, so it is faster to visit each position once.
    let is_corner = mesh.visible_positions();
    let of_chunk = |(positions, is_corner): (&[Vec3], &[bool])| {
        let corners = positions.iter().zip(is_corner).filter(|(_, is_corner)| **is_corner);
        corners.map(|(position, _)| reach(*position)).fold([f64::NEG_INFINITY; 5], most)
    };
    let chunks = mesh.positions.par_chunks(PARALLEL_TRIANGLES).zip(is_corner.par_chunks(PARALLEL_TRIANGLES));
    let [east, west, north, south, nearest] = chunks.map(of_chunk).reduce(|| [f64::NEG_INFINITY; 5], most);
    // If the left and the right plane are moved outwards until they touch the mesh, these two planes
    // intersect in a line. If the upper and the lower plane are moved outwards until they touch the mesh,
    // they intersect in a second line. The eye sees the whole mesh if it is as far away as the line that is farther
    // from the mesh.
    let across = (east + west) / (2.0 * tan_x);
    let down = (north + south) / (2.0 * tan_y);
    let distance = across.max(down).max(nearest + NEAREST_RADII * ball.radius);
    let aside = right * ((east - west) / 2.0) + up * ((north - south) / 2.0);
    Camera { position: (ball.centre + aside + towards_eye * distance).as_vec3(), z_near: 0.0, ..look }
}

/// Sums over a mesh's triangles. All areas are doubled.
#[derive(Clone, Copy, Default)]
struct Areas {
    /// The sum of the area vectors (normal times area). Each triangle's normal points to the side of the
    /// triangle to which the mesh's own normals point.
    vector: DVec3,
    /// The sum of the area vectors, with normals that follow from the order of corners: each normal points to
    /// the side from which the triangle's corners appear counter-clockwise.
    wound: DVec3,
    area: f64,
    /// The area of the largest triangle.
    largest: f64,
    /// The projected areas of the walls at three sides of the bounding box: those with the least x, the least
    /// y and the least z. The area of each wall is projected along the coordinate axis perpendicular to its
    /// side of the box. In the sum for a side, triangles that face outwards are added, and triangles that
    /// face inwards are subtracted. The front and the back of a body at a wall therefore add up to about
    /// zero, and so do the slopes of a rough surface.
    low_walls: DVec3,
    /// Like `low_walls`, but for the sides of the bounding box with the greatest x, y and z.
    high_walls: DVec3,
    /// The sum of the area vectors of the inner triangles, which belong to no wall ([`WALL_DEPTH`]).
    inner_vector: DVec3,
    inner_area: f64,
}

impl Areas {
    fn of_mesh(mesh: &Mesh, bounds: [DVec3; 2]) -> Self {
        let chunks = mesh.triangles.par_chunks(PARALLEL_TRIANGLES);
        let areas = chunks.map(|triangles| {
            let mut sums = Self::default();
            for triangle in triangles {
                let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
                sums.add(corners, front_sign(mesh, triangle, corners), bounds);
            }
            sums
        });
        areas.reduce(Self::default, Self::plus)
    }

    /// Adds a single triangle to the sums. `sign` is the triangle's [`front_sign`]. `low` and `high` are the
    /// corners of the mesh's bounding box.
    fn add(&mut self, [a, b, c]: [DVec3; 3], sign: f64, [low, high]: [DVec3; 2]) {
        let wound = (b - a).cross(c - a);
        let vector = sign * wound;
        let area = vector.length();
        self.vector += vector;
        self.wound += wound;
        self.area += area;
        self.largest = self.largest.max(area);
        let depth = WALL_DEPTH * (high - low);
        let [at_low, at_high] = [a.max(b).max(c).cmplt(low + depth), a.min(b).min(c).cmpge(high - depth)];
        if at_low.any() || at_high.any() {
            self.low_walls -= DVec3::select(at_low, vector, DVec3::ZERO);
            self.high_walls += DVec3::select(at_high, vector, DVec3::ZERO);
        } else {
            self.inner_vector += vector;
            self.inner_area += area;
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            vector: self.vector + other.vector,
            wound: self.wound + other.wound,
            area: self.area + other.area,
            largest: self.largest.max(other.largest),
            low_walls: self.low_walls + other.low_walls,
            high_walls: self.high_walls + other.high_walls,
            inner_vector: self.inner_vector + other.inner_vector,
            inner_area: self.inner_area + other.inner_area,
        }
    }

    /// Returns true if the mesh is closed: the area vectors (normal times area) of a closed mesh's triangles
    /// add up to almost zero. In some meshes, the normals are wrong, for example because all have the same
    /// direction. In other meshes, the order of corners is wrong. A mesh therefore counts as closed if its
    /// sum of area vectors is small either with its own normals (`vector`) or with the normals from the order
    /// of corners (`wound`).
    fn are_closed(&self) -> bool {
        [self.vector, self.wound].iter().any(|sum| sum.length() <= OPEN_PART * self.area)
    }

    /// Returns true if the mesh would be closed if a single, wrongly wound triangle were reversed.
    fn are_closed_but_for_one(&self, mesh: &Mesh) -> bool {
        // A wrongly wound triangle makes a closed mesh seem open only if the triangle is large
        // ([`OPEN_PART`]).
        let least = OPEN_PART / 2.0 * self.area;
        if self.largest <= least {
            return false;
        }
        let would_close = |triangle: &Triangle| {
            let [a, b, c] = outline(mesh, triangle);
            let vector = (b - a).cross(c - a);
            let reversed = self.vector - 2.0 * vector;
            vector.length() > least && reversed.length() <= OPEN_PART * self.area
        };
        let triangles = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES);
        triangles.any(|triangle| would_close(triangle) && is_wound_wrongly(mesh, triangle))
    }

    /// Returns true if bodies, such as furniture, lie between the walls.
    fn have_bodies_inside(&self) -> bool {
        self.inner_area >= BODIES_PART * self.area
            && self.inner_vector.length() <= BODIES_OPEN_PART * self.inner_area
    }

    /// Returns the horizontal direction to the open sides of a room. A vertical side of the bounding box is
    /// open if it has no wall, but the opposite side has a wall. If no side is open, returns the zero vector.
    /// If the mesh is not a room, returns `None`.
    fn away_from_walls(&self, [low, high]: [DVec3; 2], up: DVec3) -> Option<DVec3> {
        let size = high - low;
        let sides = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
        // `low_walls` and `high_walls` are doubled areas, so a side of the bounding box counts as a wall if
        // walls cover more than half of the side.
        let is_wall = [self.low_walls, self.high_walls].map(|walls| walls.abs().cmpgt(sides));
        let [at_low, at_high] = is_wall.map(|is_wall| DVec3::select(is_wall, DVec3::ONE, DVec3::ZERO));
        let outwards = at_low * self.low_walls.max(DVec3::ZERO) + at_high * self.high_walls.max(DVec3::ZERO);
        let all = at_low * self.low_walls.abs() + at_high * self.high_walls.abs();
        let face_outwards = outwards.element_sum() >= OUTWARDS_PART * all.element_sum();
        let is_room =
            (at_low + at_high).element_sum() >= LEAST_WALLS && (!face_outwards || self.have_bodies_inside());
        let vertical = up.abs().cmplt(DVec3::splat(VERTICAL));
        let away = DVec3::select(vertical, at_low - at_high, DVec3::ZERO);
        is_room.then(|| away.reject_from_normalized(up))
    }

    /// Returns the horizontal direction from which an open mesh is seen. Returns `None` for a mesh that is
    /// not open ([`OPEN_PART`]). A room is seen through its open sides. If every upright wall of the room is
    /// opposite another wall, no side is open, and the result is `None`. A mesh whose walls face outwards is a
    /// room only if bodies, such as furniture, lie between the walls. Without such bodies, the mesh is a shell,
    /// such as the housing of a device without its back. A shell's shape does not show from which side the shell
    /// should be seen. A shell is seen from the direction in which its normals point on average. Any other mesh that
    /// is not a room, such as the scan of a person's head from one side, is seen in the same way.
    fn opening(&self, bounds: [DVec3; 2], up: DVec3) -> Option<DVec3> {
        let front = self.vector.reject_from_normalized(up);
        let is_open = front.length() > OPEN_PART * self.area;
        is_open.then(|| self.away_from_walls(bounds, up).unwrap_or(front).try_normalize()).flatten()
    }
}

/// Returns the corners of a triangle, counter-clockwise as seen from the triangle's front.
fn outline(mesh: &Mesh, triangle: &Triangle) -> [DVec3; 3] {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    if front_sign(mesh, triangle, [a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] }
}

/// Returns 1 if a triangle lists its corners `a`, `b` and `c` counter-clockwise as seen from its front,
/// otherwise -1. The front is the side of the triangle's plane to which the mean of its corner normals
/// points.
fn front_sign(mesh: &Mesh, triangle: &Triangle, [a, b, c]: [DVec3; 3]) -> f64 {
    let shading: DVec3 = mesh.corner_normals(triangle).iter().map(|normal| normal.as_dvec3()).sum();
    if (b - a).cross(c - a).dot(shading) < 0.0 { -1.0 } else { 1.0 }
}

/// Returns true if a triangle's front is on the wrong side of the surface. Two neighbours whose fronts are on
/// the same side of a surface pass their common edge in opposite directions. The front of `triangle` is on
/// the wrong side if each of its edges belongs to exactly one other triangle, which passes the edge in the
/// same direction as `triangle`. The three triangles that share the three edges with `triangle` must be
/// different triangles.
fn is_wound_wrongly(mesh: &Mesh, triangle: &Triangle) -> bool {
    let edges = |triangle: &Triangle| {
        let [a, b, c] = outline(mesh, triangle);
        [[a, b], [b, c], [c, a]]
    };
    let own = edges(triangle);
    let mut neighbours = [0_usize; 3];
    for other in mesh.triangles.iter().filter(|other| !std::ptr::eq(*other, triangle)) {
        let others = edges(other);
        let shared = own.map(|edge| usize::from(others.contains(&edge)));
        let is_opposite = own.iter().any(|[from, to]| others.contains(&[*to, *from]));
        if is_opposite || shared.iter().sum::<usize>() > 1 {
            return false;
        }
        neighbours = std::array::from_fn(|edge| neighbours[edge] + shared[edge]);
    }
    neighbours == [1; 3]
}

/// Returns the key light's power, and the light's distance from the nearest point of the ball that represents
/// the mesh.
pub(super) fn key_at(ball: Ball) -> (f64, f64) {
    let distance = (LIGHT_RADII - 1.0) * ball.radius;
    (key_power(distance), distance)
}

/// Returns a key light at the viewer's upper left and a weaker fill light at the right. For an open mesh, the
/// directions to both lights are within 17 degrees of the direction to the viewer. The power of the lights is
/// proportional to the square of the mesh's size, so the picture does not depend on the mesh's scale.
/// Consider a surface with a diffuse reflectance (k_L) of 0.8 that faces the key light and receives no other
/// light. At the ball's nearest point to the light, the surface is displayed as 88% of white; at the ball's
/// centre, as 80%.
pub(super) fn lights(camera: &Camera, ball: Ball) -> Vec<Light> {
    let axes = [camera.right, camera.up, camera.forward].map(|axis| axis.as_dvec3());
    let light = |right: f64, up: f64, back: f64, strength: f64| {
        let direction = (axes[0] * right + axes[1] * up - axes[2] * back).normalize();
        let position = ball.centre + direction * (LIGHT_RADII * ball.radius);
        let power = strength * key_at(ball).0;
        Light { position: position.as_vec3(), power: Vec3::splat(power as f32), radius: 0.0, area: None }
    };
    match ball.opening {
        // The viewer looks into a room through its open side. Only light from about the viewer's direction
        // enters the room.
        Some(_) => vec![light(-0.12, 0.08, 1.0, 1.0), light(0.3, 0.05, 1.0, 0.3)],
        None => vec![light(-0.55, 0.75, 0.9, 1.0), light(0.9, 0.15, 0.6, 0.3)],
    }
}

/// Returns the power of a light that makes a surface at `distance` appear as 88% of white. The surface faces
/// the light and has a diffuse reflectance (k_L) of 0.8, so its radiance is
/// `L = power / (4 pi distance^2) * 0.8 / pi`. With the default exposure of 15 and gamma of 2.2, 88% of white
/// means `15 L = 0.88^2.2`.
fn key_power(distance: f64) -> f64 {
    let radiance = 0.88_f64.powf(2.2) / 15.0;
    radiance * 4.0 * std::f64::consts::PI.powi(2) * distance * distance / 0.8
}

#[cfg(test)]
mod tests;
