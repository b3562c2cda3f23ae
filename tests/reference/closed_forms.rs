//! Receivers in a row on the ground, blockers whose shadow has a closed form.

use std::f64::consts::PI;

use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Reference, Sampling};
use antumbra::scene::Scene;
use glam::{DVec2, DVec3, UVec2, Vec3};

use super::{cast, ground, lamp, quad, row_camera, scene};

/// Receivers in a row.
const COUNT: u32 = 96;

struct Case {
    name: &'static str,
    scene: Scene,
    light: AreaLight,
    /// The row reaches that far to each side, in metres.
    half: f32,
    /// V at a point of the ground.
    truth: Box<dyn Fn(DVec3) -> f64>,
}

impl Case {
    /// Casts and compares; prints a line of the table.
    fn check(&self, samples: u32, most_rmse: f64) {
        let camera = row_camera(COUNT, self.half, 0.3);
        let size = [COUNT, 1];
        let sampling = Sampling::samples(samples);
        let found = cast(&self.scene, &camera, size, &self.light, sampling);
        let reference = Reference::new(&self.scene).unwrap();
        let (mut sum, mut squares, mut worst, mut partial) = (0.0, 0.0, 0.0_f64, 0);
        for x in 0..COUNT {
            let at = reference.surface(&camera, size, UVec2::new(x, 0)).unwrap();
            assert!(at.position.y.abs() < 1e-9, "the ground is seen");
            let truth = (self.truth)(at.position);
            let error = f64::from(found.visibility[x as usize]) - truth;
            sum += error;
            squares += error * error;
            worst = worst.max(error.abs());
            partial += usize::from(truth > 0.0 && truth < 1.0);
        }
        assert!(
            partial as u32 > COUNT / 3,
            "{}: {partial} in the penumbra",
            self.name
        );
        let rmse = (squares / f64::from(COUNT)).sqrt();
        let bias = sum / f64::from(COUNT);
        let error = found.standard_error.unwrap();
        println!(
            "{:34} {samples:5}  rmse {rmse:.2e}  bias {bias:+.1e}  max {worst:.2e}  \
             estimated {:.2e}",
            self.name, error.rms
        );
        assert!(rmse <= most_rmse, "{}: rmse {rmse}", self.name);
        // The mean of all, by the error of a mean; the worst of many, by Gauss's tail.
        let of_mean = error.rms * (error.pixels as f64).sqrt() / f64::from(COUNT);
        assert!(
            bias.abs() <= 3.0 * of_mean,
            "{}: bias {bias}, {of_mean}",
            self.name
        );
        assert!(worst <= 4.5 * error.rms, "{}: worst {worst}", self.name);
        // Estimated over the partly lit receivers, the only ones with an error.
        let of_partial = (squares / error.pixels as f64).sqrt();
        let ratio = of_partial / error.rms;
        assert!(
            (0.3..1.1).contains(&ratio),
            "{}: {ratio} of the estimate",
            self.name
        );
    }

    fn check_both(&self) {
        self.check(1024, 3.0e-3);
        self.check(4096, 1.2e-3);
    }
}

/// The part of a convex polygon on the side of a line where `normal . p <= offset`.
fn clip(polygon: &[DVec2], normal: DVec2, offset: f64) -> Vec<DVec2> {
    let mut out = Vec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (normal.dot(a) - offset, normal.dot(b) - offset);
        if da <= 0.0 {
            out.push(a);
        }
        if (da < 0.0) != (db < 0.0) && da != db {
            out.push(a + (b - a) * (da / (da - db)));
        }
    }
    out
}

fn area(polygon: &[DVec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    let twice: f64 = polygon.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum();
    0.5 * twice.abs()
}

/// The part of the unit disk where x > `at`.
fn disk_beyond(at: f64) -> f64 {
    let x = at.clamp(-1.0, 1.0);
    (x.acos() - x * (1.0 - x * x).sqrt()) / PI
}

/// Where the line from the ground's `p` through `q` meets the height `y`, as (x, z).
fn onto(p: DVec3, q: DVec3, y: f64) -> DVec2 {
    let s = p + (q - p) * ((y - p.y) / (q.y - p.y));
    DVec2::new(s.x, s.z)
}

const LAMP_HEIGHT: f32 = 3.0;
const EDGE_HEIGHT: f32 = 1.25;
/// Outward normal of the blocking half-plane in the ground's plane, in radians from X.
const EDGE_TURN: f32 = 0.5;

/// A sheet that covers all with `normal . (x, z) < 0` as far as any light here can tell.
fn half_plane() -> Scene {
    let (sin, cos) = EDGE_TURN.sin_cos();
    let at = |across: f32, along: f32| {
        Vec3::new(
            cos * across - sin * along,
            EDGE_HEIGHT,
            sin * across + cos * along,
        )
    };
    let mut triangles = ground(50.0);
    triangles.extend(quad([
        at(-60.0, -60.0),
        at(0.0, -60.0),
        at(0.0, 60.0),
        at(-60.0, 60.0),
    ]));
    scene(&triangles)
}

fn edge_normal() -> DVec2 {
    let turn = f64::from(EDGE_TURN);
    DVec2::new(turn.cos(), turn.sin())
}

/// How far the shadow of the edge lies along its normal, in the light's plane.
fn edge_on_light(p: DVec3) -> f64 {
    let along = edge_normal().dot(DVec2::new(p.x, p.z));
    along * (1.0 - f64::from(LAMP_HEIGHT / EDGE_HEIGHT))
}

#[test]
fn half_plane_over_a_disk() {
    let radius = 0.5;
    Case {
        name: "half-plane over a disk",
        scene: half_plane(),
        light: lamp(LightShape::Disk { radius }, Vec3::Y * LAMP_HEIGHT, 0.2),
        half: 0.5,
        truth: Box::new(move |p| disk_beyond(edge_on_light(p) / f64::from(radius))),
    }
    .check_both();
}

#[test]
fn half_plane_over_a_rectangle() {
    let (width, height) = (1.2_f32, 0.5_f32);
    for turn in [0.2_f32, EDGE_TURN] {
        let light = lamp(
            LightShape::Rect { width, height },
            Vec3::Y * LAMP_HEIGHT,
            turn,
        );
        let flat = |v: Vec3| DVec2::new(v.x.into(), v.z.into());
        let x = flat(light.axis_x) * f64::from(0.5 * width);
        let y = flat(light.axis_y) * f64::from(0.5 * height);
        let corners = [-x - y, x - y, x + y, y - x];
        Case {
            name: "half-plane over a rectangle",
            scene: half_plane(),
            light,
            half: 0.6,
            truth: Box::new(move |p| {
                let lit = clip(&corners, -edge_normal(), -edge_on_light(p));
                area(&lit) / area(&corners)
            }),
        }
        .check_both();
    }
}

#[test]
fn half_plane_over_a_line() {
    let length = 1.5_f32;
    let light = lamp(LightShape::Line { length }, Vec3::Y * LAMP_HEIGHT, 1.1);
    let slope = edge_normal().dot(DVec2::new(light.axis_x.x.into(), light.axis_x.z.into()));
    Case {
        name: "half-plane over a line",
        scene: half_plane(),
        light,
        half: 0.6,
        truth: Box::new(move |p| {
            // Along the line, from -1 to 1.
            let at = edge_on_light(p) / (slope * f64::from(0.5 * length));
            (0.5 - 0.5 * at).clamp(0.0, 1.0)
        }),
    }
    .check_both();
}

#[test]
fn half_plane_over_a_sun() {
    let angular_diameter = 0.4_f32;
    let direction = Vec3::new(0.2, -1.0, 0.1);
    let shape = LightShape::Sun { angular_diameter };
    let light = AreaLight::new(shape, Vec3::ZERO, direction, Vec3::X);
    let towards = -light.direction.as_dvec3();
    let normal = edge_normal();
    Case {
        name: "half-plane over a sun",
        scene: half_plane(),
        light,
        half: 0.5,
        truth: Box::new(move |p| {
            let along = normal.dot(DVec2::new(p.x, p.z));
            // Across the plane through the receiver and the edge, to the lit side.
            let across = DVec3::new(
                normal.x * f64::from(EDGE_HEIGHT),
                along,
                normal.y * f64::from(EDGE_HEIGHT),
            )
            .normalize();
            cap_beyond(towards, f64::from(0.5 * angular_diameter), across)
        }),
    }
    .check_both();
}

/// The part of the directions within `half` of `axis` with `across . d > 0`: ring by ring.
fn cap_beyond(axis: DVec3, half: f64, across: DVec3) -> f64 {
    const RINGS: usize = 20_000;
    let (rise, up) = (1.0 - half.cos(), across.dot(axis));
    let out = (1.0 - up * up).sqrt();
    let ring = |i: usize| {
        let cos = 1.0 - rise * (i as f64 + 0.5) / RINGS as f64;
        let sin = (1.0 - cos * cos).sqrt();
        // up cos + out sin cos(angle) > 0
        (-up * cos / (out * sin)).clamp(-1.0, 1.0).acos() / PI
    };
    (0..RINGS).map(ring).sum::<f64>() / RINGS as f64
}

#[test]
fn rectangle_blocks_a_rectangle() {
    let blocker = [
        Vec3::new(-0.3, 1.1, -0.2),
        Vec3::new(0.25, 1.3, -0.25),
        Vec3::new(0.3, 1.5, 0.2),
        Vec3::new(-0.25, 1.3, 0.25),
    ];
    let mut triangles = ground(20.0);
    triangles.extend(quad(blocker));
    let (width, height) = (1.4_f32, 0.9_f32);
    let light = lamp(
        LightShape::Rect { width, height },
        Vec3::Y * LAMP_HEIGHT,
        0.7,
    );
    let flat = |v: Vec3| DVec2::new(v.x.into(), v.z.into());
    let (x, y) = (flat(light.axis_x), flat(light.axis_y));
    let half = DVec2::new(width.into(), height.into()) * 0.5;
    Case {
        name: "rectangle blocks a rectangle",
        scene: scene(&triangles),
        light,
        half: 0.9,
        truth: Box::new(move |p| {
            let mut shadow: Vec<DVec2> = (blocker.iter())
                .map(|corner| onto(p, corner.as_dvec3(), LAMP_HEIGHT.into()))
                .collect();
            for (axis, half) in [(x, half.x), (y, half.y)] {
                shadow = clip(&shadow, axis, half);
                shadow = clip(&shadow, -axis, half);
            }
            1.0 - area(&shadow) / (4.0 * half.x * half.y)
        }),
    }
    .check_both();
}

#[test]
fn parallel_slabs() {
    // Bars along Z at three heights; their shadows on the light overlap here and there.
    let bars = [
        (-0.35_f32, -0.15_f32, 0.8_f32),
        (0.0, 0.1, 1.2),
        (0.15, 0.4, 1.6),
        (-0.1, 0.05, 2.0),
    ];
    let mut triangles = ground(20.0);
    for (from, to, y) in bars {
        let at = |x: f32, z: f32| Vec3::new(x, y, z);
        triangles.extend(quad([
            at(from, -30.0),
            at(to, -30.0),
            at(to, 30.0),
            at(from, 30.0),
        ]));
    }
    let (width, height) = (1.6_f32, 0.7_f32);
    Case {
        name: "parallel slabs",
        scene: scene(&triangles),
        light: lamp(
            LightShape::Rect { width, height },
            Vec3::Y * LAMP_HEIGHT,
            0.0,
        ),
        half: 1.0,
        truth: Box::new(move |p| {
            let half = f64::from(0.5 * width);
            let mut shadows: Vec<(f64, f64)> = (bars.iter())
                .map(|&(from, to, y)| {
                    let at = |x: f32| {
                        let q = DVec3::new(x.into(), y.into(), p.z);
                        onto(p, q, LAMP_HEIGHT.into()).x.clamp(-half, half)
                    };
                    (at(from), at(to))
                })
                .collect();
            shadows.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (mut dark, mut reached) = (0.0, -half);
            for (from, to) in shadows {
                dark += (to - from.max(reached)).max(0.0);
                reached = reached.max(to);
            }
            1.0 - dark / (2.0 * half)
        }),
    }
    .check_both();
}

/// A finely tessellated sphere.
pub fn ball(center: Vec3, radius: f32, rings: u32) -> Vec<[Vec3; 3]> {
    let sectors = 2 * rings;
    let at = |ring: u32, sector: u32| {
        let (ring, sector) = (f64::from(ring), f64::from(sector % sectors));
        let theta = PI * ring / f64::from(rings);
        let phi = 2.0 * PI * sector / f64::from(sectors);
        let unit = DVec3::new(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        );
        (center.as_dvec3() + f64::from(radius) * unit).as_vec3()
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for sector in 0..sectors {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    triangles
}

/// The part of a disk that a ball does not hide from `p`: for each chord along `y` the ball's cone
/// leaves out the stretch between the roots of a quadratic.
fn disk_past_ball(
    p: DVec3,
    [center, x, y]: [DVec3; 3],
    radius: f64,
    ball: DVec3,
    ball_radius: f64,
) -> f64 {
    const CHORDS: usize = 4000;
    let axis = ball - p;
    let square = axis.length_squared();
    // d is in the cone if (d . axis)^2 >= k |d|^2 in front.
    let k = square - ball_radius * ball_radius;
    let mut dark = 0.0;
    for i in 0..CHORDS {
        // Even in angle, so that the ends of the disk are met smoothly.
        let angle = PI * (i as f64 + 0.5) / CHORDS as f64;
        let u = -angle.cos() * radius;
        let half = angle.sin() * radius;
        let weight = angle.sin() * radius * PI / CHORDS as f64;
        let d = center - p + u * x;
        let (da, ya) = (d.dot(axis), y.dot(axis));
        let a = ya * ya - k;
        let b = da * ya - k * d.dot(y);
        let c = da * da - k * d.length_squared();
        // a < 0 here: the light's plane cuts the cone in an ellipse.
        assert!(a < 0.0);
        let root = b * b - a * c;
        if root > 0.0 {
            let (low, high) = ((-b + root.sqrt()) / a, (-b - root.sqrt()) / a);
            let (low, high) = (low.min(high).max(-half), low.max(high).min(half));
            dark += weight * (high - low).max(0.0);
        }
    }
    1.0 - dark / (PI * radius * radius)
}

#[test]
fn ball_blocks_a_disk() {
    let (ball_center, ball_radius) = (Vec3::new(0.05, 1.3, -0.05), 0.25_f32);
    let mut triangles = ground(20.0);
    triangles.extend(ball(ball_center, ball_radius, 200));
    let radius = 0.5_f32;
    let light = lamp(LightShape::Disk { radius }, Vec3::Y * LAMP_HEIGHT, 0.0);
    let frame = [light.center, light.axis_x, light.axis_y].map(Vec3::as_dvec3);
    Case {
        name: "ball blocks a disk",
        scene: scene(&triangles),
        light,
        half: 0.9,
        truth: Box::new(move |p| {
            let ball = ball_center.as_dvec3();
            disk_past_ball(p, frame, radius.into(), ball, ball_radius.into())
        }),
    }
    .check_both();
}

#[test]
fn ball_blocks_a_sphere_light() {
    let (ball_center, ball_radius) = (Vec3::new(0.05, 1.3, -0.05), 0.25_f32);
    let mut triangles = ground(20.0);
    triangles.extend(ball(ball_center, ball_radius, 200));
    let radius = 0.6_f32;
    let light = lamp(
        LightShape::Sphere { radius },
        Vec3::new(0.4, LAMP_HEIGHT, 0.2),
        0.0,
    );
    let sphere = light.center.as_dvec3();
    Case {
        name: "ball blocks a sphere light",
        scene: scene(&triangles),
        light,
        half: 0.9,
        truth: Box::new(move |p| {
            // The disk bounded by the outline, as the conventions give it.
            let to = sphere - p;
            let (d, r) = (to.length(), f64::from(radius));
            let center = p + to / d * (d - r * r / d);
            let outline = r * (1.0 - r * r / (d * d)).sqrt();
            let x = to.normalize().any_orthonormal_vector();
            let y = to.normalize().cross(x);
            let ball = ball_center.as_dvec3();
            disk_past_ball(p, [center, x, y], outline, ball, ball_radius.into())
        }),
    }
    .check_both();
}
