//! Parameters that a technique's shaders read.

use crate::graph::{Access, BufferDesc, BufferId, Graph, PassKind};
use bytemuck::Pod;

/// Declares a uniform buffer that holds a block, and the pass that writes it; both get the name.
pub(super) fn add_uniform<T: Pod>(graph: &mut Graph<'_>, name: String, block: T) -> BufferId {
    let size = size_of::<T>() as u64;
    let buffer = graph.create_buffer(name.clone(), BufferDesc { size });
    let mut pass = graph.pass(name, PassKind::Transfer);
    let buffer = pass.overwrite(buffer, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(buffer, 0, bytemuck::bytes_of(&block)));
    buffer
}
