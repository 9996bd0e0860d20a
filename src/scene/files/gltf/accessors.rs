//! Reads numbers from a glTF file's buffers.

use super::Parsed;
use super::buffers::Bytes;
use super::left_out::notes_on;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use std::collections::HashSet;

/// Largest number of elements of an accessor (in glTF, a list of numbers or vectors in a buffer). No scene
/// that raycl supports needs so many elements.
const MOST_ELEMENTS: u64 = 1 << 31;

/// The JSON and the buffers of a file, from which numbers are read.
#[derive(Clone, Copy)]
pub(super) struct Numbers<'a> {
    pub root: &'a Root,
    buffers: &'a [Bytes<'a>],
    /// An upper limit on the number of elements of an accessor, computed from the sizes of the buffers.
    most: usize,
}

/// The elements of an accessor (a list of numbers or vectors in a buffer). The elements are `stride` bytes
/// apart.
struct StridedView<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: ComponentType,
    normalised: bool,
}

impl StridedView<'_> {
    /// Returns the components of the element `number`; `None` if the element ends beyond the end of its
    /// buffer view (a part of a buffer). Padding after an accessor's last element may be missing.
    fn element<const N: usize>(&self, number: usize) -> Option<[f64; N]> {
        let size = bytes_of(self.component);
        let start = number.checked_mul(self.stride)?;
        let bytes = self.bytes.get(start..start.checked_add(size * N)?)?;
        let mut values = [0.0; N];
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(size)) {
            *value = self.component(bytes);
        }
        Some(values)
    }

    /// Converts the bytes of one component to a number. If the accessor is normalised, a whole number becomes
    /// a number from 0 to 1 or from -1 to 1 (glTF 2.0, 3.11).
    fn component(&self, bytes: &[u8]) -> f64 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, most) = match self.component {
            ComponentType::I8 => (f64::from(bytes[0] as i8), 127.0),
            ComponentType::U8 => (f64::from(bytes[0]), 255.0),
            ComponentType::I16 => (f64::from(i16::from_le_bytes(two())), 32_767.0),
            ComponentType::U16 => (f64::from(u16::from_le_bytes(two())), 65_535.0),
            ComponentType::U32 => (f64::from(u32::from_le_bytes(four())), f64::from(u32::MAX)),
            ComponentType::F32 => return f64::from(f32::from_le_bytes(four())),
        };
        if self.normalised { (value / most).max(-1.0) } else { value }
    }
}

fn bytes_of(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

impl<'a> Numbers<'a> {
    /// Makes the reader for a file's JSON and buffers.
    pub fn of_file(root: &'a Root, buffers: &'a [Bytes<'a>]) -> Self {
        // An element takes at least one byte of its buffer, so the size of the largest buffer limits the
        // number of elements. An accessor without data takes no bytes in the file; it may have 65,536
        // elements even if all buffers are smaller.
        let largest = buffers.iter().map(|bytes| bytes.len()).max().unwrap_or(0);
        Self { root, buffers, most: largest.max(1 << 16) }
    }

    /// Returns the number of an accessor's elements, but at most `most`; 0 if the accessor does not exist.
    pub fn count(&self, index: Index<Accessor>) -> u64 {
        self.root.get(index).map_or(0, |accessor| accessor.count.0.min(self.most as u64))
    }

    /// Returns the elements of an accessor (a list of numbers or vectors in a buffer). Each element must have
    /// `N` components.
    pub fn of<const N: usize>(&self, index: Index<Accessor>) -> Parsed<Vec<[f64; N]>> {
        let accessor = self.accessor(index)?;
        self.elements(accessor, accessor.normalized).map_err(within(index))
    }

    /// Returns the elements of a vertex attribute, such as positions. Returns an error for 32-bit whole numbers, which
    /// glTF allows only for indices: probably, the buffer holds floats.
    pub fn attribute<const N: usize>(&self, index: Index<Accessor>) -> Parsed<Vec<[f64; N]>> {
        self.refuse_unsigned_ints(index)?;
        self.of(index)
    }

    fn refuse_unsigned_ints(&self, index: Index<Accessor>) -> Parsed<()> {
        self.refuse(&[(ComponentType::U32, "5125 (unsigned int)")], index, "5126 (float) for vertices")
    }

    /// Returns the elements of a list of colours. glTF allows whole numbers for colours only if they are normalised, so
    /// whole numbers are read as if their accessor said that they are.
    pub fn colours<const N: usize>(&self, index: Index<Accessor>) -> Parsed<Vec<[f64; N]>> {
        self.refuse_unsigned_ints(index)?;
        self.elements(self.accessor(index)?, true).map_err(within(index))
    }

    /// Returns true if an accessor has whole numbers that are not normalised.
    pub fn is_whole(&self, index: Index<Accessor>) -> bool {
        let is_float = |accessor: &Accessor| matches!(&accessor.component_type, Checked::Valid(component) if component.0 == ComponentType::F32);
        self.root.get(index).is_some_and(|accessor| !accessor.normalized && !is_float(accessor))
    }

    /// Returns the elements of a list of indices, which glTF never normalises. Returns an error for floats and signed
    /// numbers, which glTF does not allow for indices.
    pub fn indices(&self, index: Index<Accessor>) -> Parsed<Vec<[f64; 1]>> {
        let wrong = [
            (ComponentType::F32, "5126 (float)"),
            (ComponentType::I8, "5120 (byte)"),
            (ComponentType::I16, "5122 (short)"),
        ];
        self.refuse(&wrong, index, "5121, 5123 or 5125 for indices")?;
        self.elements(self.accessor(index)?, false).map_err(within(index))
    }

    /// Returns true if an accessor asks for normalised numbers.
    pub fn is_normalised(&self, index: Index<Accessor>) -> bool {
        self.root.get(index).is_some_and(|accessor| accessor.normalized)
    }

    fn accessor(&self, index: Index<Accessor>) -> Parsed<&'a Accessor> {
        self.root.get(index).ok_or_else(|| within(index)("it does not exist".to_owned()))
    }

    /// Returns an error if the component type of an accessor is one of `wrong`, which has types with their names.
    fn refuse(&self, wrong: &[(ComponentType, &str)], index: Index<Accessor>, expected: &str) -> Parsed<()> {
        let Some(Checked::Valid(component)) = self.root.get(index).map(|accessor| &accessor.component_type)
        else {
            return Ok(());
        };
        let found = wrong.iter().find(|(wrong, _)| *wrong == component.0);
        found.map_or(Ok(()), |(_, name)| {
            Err(within(index)(format!("its componentType is {name}; expected {expected}")))
        })
    }

    /// Returns true if an accessor stores nothing, so that all its elements are zero.
    pub fn is_empty(&self, index: Index<Accessor>) -> bool {
        is_empty(self.root, index)
    }

    /// Returns the number of components of an accessor's elements; 0 if this number is unknown.
    pub fn components(&self, index: Index<Accessor>) -> usize {
        self.root.get(index).and_then(|accessor| components(accessor).ok()).unwrap_or(0)
    }

    fn elements<const N: usize>(&self, accessor: &Accessor, normalised: bool) -> Parsed<Vec<[f64; N]>> {
        if components(accessor)? != N {
            return Err(format!("its elements have {} numbers; expected {N}", components(accessor)?));
        }
        let Checked::Valid(component) = accessor.component_type else {
            return Err("an unknown component type".to_owned());
        };
        let component = component.0;
        let count = usize::try_from(accessor.count.0.min(MOST_ELEMENTS)).unwrap_or(usize::MAX);
        let mut values = match accessor.buffer_view {
            None => self.zeros(accessor, count)?,
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let elements = self.strided_view(view, offset, component, N, normalised)?;
                (0..count).map_while(|number| elements.element(number)).collect()
            }
        };
        if values.len() < accessor.count.0 as usize {
            return Err(format!(
                "it has {} elements, but its buffer view holds {}",
                accessor.count.0,
                values.len()
            ));
        }
        self.replace_sparse(accessor, (component, normalised), &mut values)?;
        Ok(values)
    }

    /// Returns `count` elements of zeros for an accessor without a buffer view (glTF 2.0, 3.6.2.3). If the accessor is
    /// sparse, some of the returned zeros are replaced later.
    fn zeros<const N: usize>(&self, accessor: &Accessor, count: usize) -> Parsed<Vec<[f64; N]>> {
        if count > self.most {
            return Err(format!("{} elements without data, more than raycl accepts", accessor.count.0));
        }
        Ok(vec![[0.0; N]; count])
    }

    /// Returns true if an accessor replaces one of its elements twice. The result is false if the indices of the
    /// replaced elements cannot be read.
    fn replaces_twice(&self, accessor: &Accessor) -> bool {
        let Some(sparse) = &accessor.sparse else { return false };
        let Checked::Valid(component) = sparse.indices.component_type else { return false };
        let offset = sparse.indices.byte_offset.0;
        let view = self.strided_view(sparse.indices.buffer_view, offset, component.0, 1, false);
        let mut known = HashSet::new();
        view.is_ok_and(|view| {
            let indices = (0..sparse.count.0 as usize).map_while(|number| view.element::<1>(number));
            indices.into_iter().any(|[index]| !known.insert(index as u64))
        })
    }

    fn replace_sparse<const N: usize>(
        &self,
        accessor: &Accessor,
        (component, normalised): (ComponentType, bool),
        values: &mut [[f64; N]],
    ) -> Parsed<()> {
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err("sparse indices of an unknown type".to_owned());
        };
        let offset = sparse.indices.byte_offset.0;
        let indices = self.strided_view(sparse.indices.buffer_view, offset, index_type.0, 1, false)?;
        let offset = sparse.values.byte_offset.0;
        let replacements = self.strided_view(sparse.values.buffer_view, offset, component, N, normalised)?;
        for number in 0..sparse.count.0 as usize {
            let ends = || "its buffers hold fewer sparse elements than it states".to_owned();
            let [index] = indices.element::<1>(number).ok_or_else(ends)?;
            let value = replacements.element(number).ok_or_else(ends)?;
            *values.get_mut(index as usize).ok_or("a sparse index is beyond the accessor's elements")? =
                value;
        }
        Ok(())
    }

    fn strided_view(
        &self,
        view: Index<View>,
        offset: u64,
        component: ComponentType,
        components: usize,
        normalised: bool,
    ) -> Parsed<StridedView<'a>> {
        let number = view.value();
        let view = self.root.get(view).ok_or_else(|| format!("buffer view {number} does not exist"))?;
        let buffer = self.buffers.get(view.buffer.value());
        let buffer = buffer.ok_or_else(|| format!("buffer {} does not exist", view.buffer.value()))?;
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.saturating_add(view.byte_length.0).min(buffer.len() as u64);
        let range = start.saturating_add(offset).min(end) as usize..end as usize;
        let size = bytes_of(component) * components;
        // In glTF 1.0, a stride of 0 means that elements follow each other without gaps. Some converters from
        // glTF 1.0 to glTF 2.0 keep a stride of 0.
        let stride = view.byte_stride.map(|stride| stride.0).filter(|stride| *stride > 0).unwrap_or(size);
        if stride < size {
            return Err(format!("a stride of {stride} bytes for elements of {size} bytes"));
        }
        Ok(StridedView { bytes: &buffer[range], stride, component, normalised })
    }
}

/// Returns a note on accessors that replace one of their elements twice.
pub(super) fn notes(numbers: Numbers<'_>) -> impl Iterator<Item = String> {
    let twice = numbers.root.accessors.iter().filter(|accessor| numbers.replaces_twice(accessor));
    let what = "sparse accessor with an index that occurs twice";
    notes_on([(twice.count(), what, "read with the index's last value")])
}

/// Returns a function that puts the name of an accessor before a message about it.
fn within(index: Index<Accessor>) -> impl Fn(String) -> String {
    move |what| format!("accessor {}: {what}", index.value())
}

/// Returns true if an accessor stores nothing, so that all its elements are zero.
pub(super) fn is_empty(root: &Root, index: Index<Accessor>) -> bool {
    let accessor = root.get(index);
    accessor.is_some_and(|accessor| accessor.buffer_view.is_none() && accessor.sparse.is_none())
}

fn components(accessor: &Accessor) -> Parsed<usize> {
    match accessor.type_ {
        Checked::Valid(Type::Scalar) => Ok(1),
        Checked::Valid(Type::Vec2) => Ok(2),
        Checked::Valid(Type::Vec3) => Ok(3),
        Checked::Valid(Type::Vec4) => Ok(4),
        Checked::Valid(Type::Mat4) => Ok(16),
        _ => Err("an element type that meshes do not use".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An accessor without data may have at most 65,536 elements. If the file's largest buffer has more than
    /// 65,536 bytes, the accessor may have one element per byte of this buffer.
    #[test]
    fn elements_without_data_are_zeros_and_a_small_file_has_not_too_many() {
        let zeros = |count: usize, held: usize| {
            let text = format!(
                r#"{{"asset": {{"version": "2.0"}},
"accessors": [{{"componentType": 5126, "count": {count}, "type": "SCALAR"}}]}}"#
            );
            let root: Root = serde_json::from_str(&text).unwrap();
            let buffers = [Bytes::new(vec![7; held].into())];
            let numbers = Numbers::of_file(&root, &buffers);
            numbers
                .of::<1>(Index::new(0))
                .map(|values| values.iter().filter(|value| **value == [0.0]).count())
        };
        let refused =
            |count: usize| Err(format!("accessor 0: {count} elements without data, more than raycl accepts"));
        assert_eq!([zeros(3, 4), zeros(65_536, 4)], [Ok(3), Ok(65_536)]);
        assert_eq!([zeros(65_537, 4), zeros(70_001, 70_000)], [refused(65_537), refused(70_001)]);
        assert_eq!(zeros(70_000, 70_000), Ok(70_000));
    }
}
