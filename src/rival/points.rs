//! The surface points of a picture, in the order in which rays are cast from them.

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use crate::reference::{Reference, Surface};
use crate::scene::{Scene, SceneCamera};

/// Side of a tile in pixels.
pub(super) const TILE: usize = 8;
/// Pixels of a tile.
pub(super) const TILE_PIXELS: usize = TILE * TILE;

/// Where rays start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    /// Above the surface, by so much that its rounding does not hide it from itself.
    pub(super) origin: Vec3,
    /// Unit normal of the triangle, turned to the camera.
    pub(super) normal: Vec3,
    /// Height of `origin` above the surface, metres.
    pub(super) lift: f32,
    /// How exactly the point is known, metres.
    pub(super) error: f32,
    /// False where the camera sees nothing.
    pub(super) is_hit: bool,
}

/// The points of a picture, tile by tile, in a tile by Morton order; tiles that reach beyond the
/// picture are filled with points that are not hit.
pub(super) struct Points {
    pub(super) size: [u32; 2],
    /// Tiles in a row.
    pub(super) columns: usize,
    pub(super) list: Vec<Point>,
}

impl Points {
    pub(super) fn new(
        scene: &Scene,
        reference: &Reference<'_>,
        camera: &SceneCamera,
        size: [u32; 2],
    ) -> Self {
        let [width, height] = size.map(|side| side as usize);
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let mut list = vec![Point::default(); columns * rows * TILE_PIXELS];
        list.par_chunks_mut(TILE_PIXELS)
            .enumerate()
            .for_each(|(tile, points)| {
                for (at, point) in points.iter_mut().enumerate() {
                    let [x, y] = pixel_of(columns, tile, at);
                    if x < width && y < height {
                        let pixel = UVec2::new(x as u32, y as u32);
                        if let Some(surface) = reference.surface(camera, size, pixel) {
                            *point = Point::new(scene, &surface);
                        }
                    }
                }
            });
        Self {
            size,
            columns,
            list,
        }
    }
}

impl Point {
    fn new(scene: &Scene, surface: &Surface) -> Self {
        // The largest number that enters the tracer's arithmetic on this triangle.
        let largest = scene
            .primitives
            .get(surface.primitive)
            .map_or(0.0, |primitive| {
                let corners = primitive.indices.iter().skip(3 * surface.triangle).take(3);
                let places = corners.filter_map(|&corner| primitive.positions.get(corner as usize));
                places.fold(
                    surface.position.abs().max_element() as f32,
                    |most, place| most.max(place.abs().max_element()),
                )
            });
        let error = f32::EPSILON * largest;
        let lift = 16.0 * error;
        let origin = (surface.position + f64::from(lift) * surface.normal).as_vec3();
        Self {
            origin,
            normal: surface.normal.as_vec3(),
            lift,
            error,
            is_hit: true,
        }
    }
}

/// Column and row of pixel `at` of a tile.
#[inline]
pub(super) fn pixel_of(columns: usize, tile: usize, at: usize) -> [usize; 2] {
    let every_other = |v: usize| (v & 1) | (v >> 1 & 2) | (v >> 2 & 4);
    [
        tile % columns * TILE + every_other(at),
        tile / columns * TILE + every_other(at >> 1),
    ]
}

/// Index into [`Points::list`] of a pixel.
#[inline]
pub(super) fn place_of(columns: usize, x: usize, y: usize) -> usize {
    let spread = |v: usize| (v & 1) | (v & 2) << 1 | (v & 4) << 2;
    let tile = y / TILE * columns + x / TILE;
    tile * TILE_PIXELS + (spread(x % TILE) | spread(y % TILE) << 1)
}
