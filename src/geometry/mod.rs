//! The scene on the device, and the surface that each pixel of a picture sees: what shadow
//! techniques and shading both work on.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `gbuffer.ids` | vertices, indices, textures of masked triangles | triangle ids, depth |
//! | `gbuffer.surface` | ids, triangles | view depth, geometric and shading normal |
//! | `gbuffer.tiles` | view depth, geometric normal | bounds of each tile's surfaces |

mod adjacency;
mod camera;
mod convex;
mod cover;
mod draw;
mod footprints;
mod gbuffer;
mod hierarchy;
mod neighbours;
mod scene_buffers;
mod scene_layout;
mod tight_box;
mod tiles;
mod uploads;
mod visible;

pub use camera::{PixelCamera, frustum_sees};
pub use convex::{HalfSpace, box_faces, clip};
pub use cover::Cover;
pub use draw::{DrawTarget, SceneShaders, draw_part, draw_part_with, draw_scene, read_for_draw};
pub use gbuffer::{GBuffer, add_gbuffer, add_triangle_ids};
pub use scene_buffers::{Draw, SceneBuffers, SceneIds, UploadError};
pub use scene_layout::image_place;
pub use tight_box::tight_box;
pub use tiles::{TILE_SIZE, TileList, add_tile_bounds, tile_counts};
pub use visible::visible_hulls;
