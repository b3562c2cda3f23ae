//! A light as one point sees it, in `f32`: what turns table samples into directions of rays.

use glam::{DVec3, Vec2, Vec3};

use crate::light::{AreaLight, LightShape};

/// Numbers of a light that do not depend on the point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitter {
    kind: Kind,
    center: DVec3,
    /// From the centre to (1, 0) and (0, 1); of a sphere and a sun unit vectors.
    x: DVec3,
    y: DVec3,
    /// How exactly the light's place is known in `f32`, metres.
    error: f32,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Point,
    Rect,
    Disk,
    Line,
    Sphere { radius: f64 },
    Sun { rise: f32 },
}

/// How the light looks from a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// From the point to the light's middle; of a sun a unit vector.
    pub(super) center: Vec3,
    pub(super) x: Vec3,
    pub(super) y: Vec3,
    pub(super) bend: Bend,
    /// Where rays end, as a part of their length.
    pub(super) end: f32,
}

/// How samples are laid out about the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bend {
    /// In a plane.
    Flat,
    /// On a cap of the unit sphere; 1 - cosine of half its angle.
    Cap(f32),
    /// On a whole sphere.
    Around,
}

/// Which samples a light takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Domain {
    /// One, at its middle.
    Point,
    /// Those of the square from -1 to 1.
    Square,
    /// Those of the unit disk.
    Disk,
}

impl Emitter {
    pub(super) fn new(light: &AreaLight) -> Self {
        let [x, y] = [light.axis_x, light.axis_y].map(|axis| axis.as_dvec3().normalize());
        let center = light.center.as_dvec3();
        let size = f64::from(light.shape.bounding_radius());
        let error = f32::EPSILON * (center.abs().max_element() + size) as f32;
        let (kind, center, x, y) = match light.shape {
            LightShape::Point => (Kind::Point, center, DVec3::ZERO, DVec3::ZERO),
            LightShape::Disk { radius } => {
                let radius = f64::from(radius);
                (Kind::Disk, center, x * radius, y * radius)
            }
            LightShape::Rect { width, height } => {
                let [width, height] = [width, height].map(|side| 0.5 * f64::from(side));
                (Kind::Rect, center, x * width, y * height)
            }
            LightShape::Line { length } => (
                Kind::Line,
                center,
                x * (0.5 * f64::from(length)),
                DVec3::ZERO,
            ),
            LightShape::Sphere { radius } => {
                let radius = f64::from(radius);
                (Kind::Sphere { radius }, center, x, y)
            }
            LightShape::Sun { angular_diameter } => {
                let towards = -light.direction.as_dvec3().normalize();
                let sin = (0.25 * f64::from(angular_diameter)).sin();
                let rise = (2.0 * sin * sin) as f32;
                let (x, y) = across(towards, x, y);
                (Kind::Sun { rise }, towards, x, y)
            }
        };
        Self {
            kind,
            center,
            x,
            y,
            error,
        }
    }

    pub(super) fn domain(&self) -> Domain {
        match self.kind {
            Kind::Point => Domain::Point,
            Kind::Sun { rise } if rise <= 0.0 => Domain::Point,
            Kind::Rect | Kind::Line => Domain::Square,
            Kind::Disk | Kind::Sphere { .. } | Kind::Sun { .. } => Domain::Disk,
        }
    }

    /// The light from a point whose own place is known to within `error` metres.
    #[inline]
    pub(super) fn seen_from(&self, origin: Vec3, error: f32) -> Seen {
        let center = self.center - origin.as_dvec3();
        let (center, x, y, bend) = match self.kind {
            Kind::Sun { rise } => {
                return Seen {
                    center: self.center.as_vec3(),
                    x: self.x.as_vec3(),
                    y: self.y.as_vec3(),
                    bend: Bend::Cap(rise),
                    end: f32::INFINITY,
                };
            }
            Kind::Sphere { radius } => {
                let square = center.length_squared();
                let ratio = radius * radius / square;
                if square <= radius * radius || !ratio.is_finite() {
                    (center, self.x * radius, self.y * radius, Bend::Around)
                } else {
                    let (x, y) = across(center / square.sqrt(), self.x, self.y);
                    let outline = radius * (1.0 - ratio).sqrt();
                    (center * (1.0 - ratio), x * outline, y * outline, Bend::Flat)
                }
            }
            _ => (center, self.x, self.y, Bend::Flat),
        };
        let center = center.as_vec3();
        // A triangle in which the light lies does not block it.
        let slack = 8.0 * (self.error + error) / center.length();
        Seen {
            center,
            x: x.as_vec3(),
            y: y.as_vec3(),
            bend,
            end: if slack < 0.5 { 1.0 - slack } else { 0.5 },
        }
    }
}

impl Seen {
    /// True if all of the light is above the plane through the point across `normal`.
    #[inline]
    pub(super) fn is_above(&self, normal: Vec3) -> bool {
        let reach = normal.dot(self.x).abs() + normal.dot(self.y).abs();
        match self.bend {
            Bend::Flat => normal.dot(self.center) > reach,
            // The cap lies within its rim's ring about the centre, lowered by its rise.
            Bend::Cap(rise) => normal.dot(self.center) > rise + (2.0 * rise).sqrt() * reach,
            Bend::Around => false,
        }
    }

    /// From the point to a sample.
    #[inline(always)]
    pub(super) fn towards(&self, p: Vec2) -> Vec3 {
        match self.bend {
            Bend::Flat => self.center + p.x * self.x + p.y * self.y,
            Bend::Cap(rise) => {
                // Equal areas of a sphere are equal heights (Archimedes).
                let height = rise * p.length_squared().min(1.0);
                let ring = (rise * (2.0 - height)).max(0.0).sqrt();
                (1.0 - height) * self.center + ring * (p.x * self.x + p.y * self.y)
            }
            Bend::Around => {
                // The unit disk as heights and turns of a sphere.
                let height = 1.0 - 2.0 * p.length_squared().min(1.0);
                let ring = (1.0 - height * height).max(0.0).sqrt();
                let turn = p.normalize_or_zero();
                let radius = self.x.length();
                let z = self.x.cross(self.y) / radius;
                self.center + ring * (turn.x * self.x + turn.y * self.y) + height * z
            }
        }
    }
}

/// Two unit vectors across the unit vector `along`, the first as near to `x` as can be, else `y`.
fn across(along: DVec3, x: DVec3, y: DVec3) -> (DVec3, DVec3) {
    let near = if along.dot(x).abs() < 0.9 { x } else { y };
    let x = (near - along * near.dot(along)).normalize();
    (x, along.cross(x))
}
