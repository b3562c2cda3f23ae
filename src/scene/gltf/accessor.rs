//! Typed reads from accessors. Every range is checked before anything is read or allocated.

use std::borrow::Cow;
use std::cell::Cell;

use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, buffer};

use super::{SceneError, Source, element};

/// The data behind a document's accessors.
pub(super) struct Accessors<'a> {
    pub(super) source: Source<'a>,
    pub(super) buffers: &'a [Cow<'a, [u8]>],
    /// Largest count of elements of one accessor.
    pub(super) limit: u64,
    /// Elements that may still be read in all: a file may name the same bytes many times.
    pub(super) left: Cell<u64>,
}

/// Equally spaced elements of `size` bytes.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Strided<'a> {
    /// `None` past the end.
    fn get(&self, index: usize) -> Option<&'a [u8]> {
        let start = index.checked_mul(self.stride)?;
        self.bytes.get(start..start.checked_add(self.size)?)
    }
}

impl Accessors<'_> {
    /// Reads an attribute of `N` components; integers are mapped to their range if the accessor is
    /// normalized. Values are not checked to be finite.
    pub(super) fn read_vectors<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let components = accessor.dimensions().multiplicity();
        if components != N || accessor.dimensions() == Dimensions::Mat2 {
            return Err(self.fault(accessor, format!("it must have {N} components")));
        }
        let (kind, normalized) = (accessor.data_type(), accessor.normalized());
        let decode = |bytes: &[u8]| {
            let mut vector = [0.0; N];
            for (value, bytes) in vector.iter_mut().zip(bytes.chunks_exact(kind.size())) {
                *value = component(kind, normalized, bytes);
            }
            vector
        };
        self.read(accessor, [0.0; N], decode)
    }

    /// Reads vertex indices of any integer type.
    pub(super) fn read_indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, SceneError> {
        let kind = accessor.data_type();
        let unsigned = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32);
        if accessor.dimensions() != Dimensions::Scalar || !unsigned {
            let reason = "indices must be unsigned integer scalars";
            return Err(self.fault(accessor, reason));
        }
        self.read(accessor, 0, unsigned_integer)
    }

    fn read<T: Clone>(
        &self,
        accessor: &Accessor<'_>,
        zero: T,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let (count, size) = (accessor.count(), accessor.size());
        let left = self.left.get().checked_sub(count as u64);
        let (true, Some(left)) = (count as u64 <= self.limit, left) else {
            return Err(SceneError::TooLarge {
                file: self.source.label(),
                element: element("accessor", accessor.index(), accessor.name()),
                limit: self.limit,
            });
        };
        self.left.set(left);
        let mut values = match accessor.view() {
            Some(view) => {
                let data = self.slice(accessor, &view, accessor.offset(), count, size)?;
                (0..count)
                    .filter_map(|i| data.get(i))
                    .map(&decode)
                    .collect()
            }
            None => vec![zero; count],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, replaced) = (sparse.indices(), sparse.count());
            if replaced > count {
                let reason = format!("it replaces {replaced} of {count} elements");
                return Err(self.fault(accessor, reason));
            }
            let width = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => 1,
                gltf::accessor::sparse::IndexType::U16 => 2,
                gltf::accessor::sparse::IndexType::U32 => 4,
            };
            let at = self.slice(accessor, &indices.view(), indices.offset(), replaced, width)?;
            let new = sparse.values();
            let new = self.slice(accessor, &new.view(), new.offset(), replaced, size)?;
            for i in 0..replaced {
                let (Some(at), Some(new)) = (at.get(i).map(unsigned_integer), new.get(i)) else {
                    break;
                };
                match values.get_mut(at as usize) {
                    Some(value) => *value = decode(new),
                    None => {
                        let reason = format!("sparse index {i} names element {at} of {count}");
                        return Err(self.fault(accessor, reason));
                    }
                }
            }
        }
        Ok(values)
    }

    /// `count` elements of `size` bytes from `offset` in `view`, all of which exist.
    fn slice(
        &self,
        accessor: &Accessor<'_>,
        view: &buffer::View<'_>,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Result<Strided<'_>, SceneError> {
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            let reason = format!(
                "its elements of {size} bytes overlap at byteStride {stride} of bufferView {}",
                view.index()
            );
            return Err(self.fault(accessor, reason));
        }
        let needed = match count {
            0 => Some(0),
            _ => (count - 1)
                .checked_mul(stride)
                .and_then(|n| n.checked_add(size)),
        };
        let whole = (self.buffers.get(view.buffer().index()))
            .and_then(|buffer| buffer.get(view.offset()..view.offset().checked_add(view.length())?))
            .ok_or_else(|| {
                self.fault(
                    accessor,
                    format!("bufferView {} reaches beyond its buffer", view.index()),
                )
            })?;
        let bytes = needed
            .and_then(|needed| whole.get(offset..offset.checked_add(needed)?))
            .ok_or_else(|| {
                self.fault(
                    accessor,
                    format!(
                        "{count} elements from byte {offset} on reach beyond bufferView {} of {} \
                         bytes",
                        view.index(),
                        view.length()
                    ),
                )
            })?;
        Ok(Strided {
            bytes,
            stride,
            size,
        })
    }

    pub(super) fn fault(&self, accessor: &Accessor<'_>, reason: impl Into<String>) -> SceneError {
        let element = element("accessor", accessor.index(), accessor.name());
        self.source.invalid(element, reason)
    }
}

/// Little-endian, 1 to 4 bytes.
fn unsigned_integer(bytes: &[u8]) -> u32 {
    bytes
        .iter()
        .rev()
        .fold(0, |value, &byte| value << 8 | u32::from(byte))
}

fn component(kind: DataType, normalized: bool, bytes: &[u8]) -> f32 {
    let raw = unsigned_integer(bytes);
    // The casts cut the value to the width it was read from.
    let (value, largest) = match kind {
        DataType::F32 => return f32::from_bits(raw),
        DataType::I8 => (f32::from(raw as i8), 127.0),
        DataType::U8 => (f32::from(raw as u8), 255.0),
        DataType::I16 => (f32::from(raw as i16), 32767.0),
        DataType::U16 => (f32::from(raw as u16), 65535.0),
        DataType::U32 => (raw as f32, u32::MAX as f32),
    };
    if normalized {
        (value / largest).max(-1.0)
    } else {
        value
    }
}
