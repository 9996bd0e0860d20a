//! The frame of a JPEG (its size and colour components) and the headers of its scans (ITU-T T.81, annex B). They
//! determine which blocks a scan has, and in which order.

/// The second bytes of the markers of frames with Huffman coding: baseline, extended and progressive.
const SEQUENTIAL: [u8; 2] = [0xc0, 0xc1];
const PROGRESSIVE: u8 = 0xc2;
/// Largest number of components of a frame or scan.
const MOST_COMPONENTS: usize = 4;
/// Largest number of pixels of a picture that is checked.
const MOST_PIXELS: usize = 1 << 28;

/// The size of a picture, and its components.
pub(super) struct Frame {
    is_progressive: bool,
    /// Width and height in pixels.
    size: [usize; 2],
    components: Vec<Component>,
}

struct Component {
    name: u8,
    /// The component's number of blocks in a group of blocks, across and down.
    sampling: [usize; 2],
    /// For each block of a progressive picture, a word with one bit per coefficient: the bit is set if one of the scans
    /// that were skipped so far makes the coefficient nonzero. Empty before the component's first scan with
    /// coefficients other than the first.
    nonzero: Vec<u64>,
}

/// The header of a scan.
pub(super) struct Scan {
    /// Number of groups of blocks. A group contains, for one small part of the picture, the blocks of all components of
    /// the scan.
    pub groups: usize,
    pub parts: Vec<Part>,
    /// The part of each block that a scan of a progressive picture contains; `None` if the scan contains whole blocks.
    pub layer: Option<Layer>,
}

/// The blocks of a component in each group of a scan.
pub(super) struct Part {
    /// The index of the component in [`Frame::components`].
    pub component: usize,
    pub blocks: usize,
    /// The tables of codes of a block's first coefficient and of its other coefficients.
    pub tables: [usize; 2],
}

/// The part of each block that a scan of a progressive picture contains: some bits of a range of coefficients.
#[derive(Clone, Copy)]
pub(super) struct Layer {
    /// The scan contains bits of the coefficients from `first` to `last`.
    pub first: u32,
    pub last: u32,
    /// True if the scan contains one further bit of coefficients whose upper bits an earlier scan contains.
    pub is_refinement: bool,
}

impl Frame {
    /// Reads the segment of a frame, whose marker has the second byte `kind`. Returns `None` if the frame is not valid
    /// or of another kind, or if the picture is too large.
    pub fn of_segment(kind: u8, data: &[u8]) -> Option<Self> {
        let is_progressive = kind == PROGRESSIVE;
        let size = [number(data, 3)?, number(data, 1)?].map(usize::from);
        let count = usize::from(*data.get(5)?);
        let components: Vec<Component> =
            data.get(6..6 + 3 * count)?.chunks_exact(3).map(Component::of_bytes).collect::<Option<_>>()?;
        let is_known = is_progressive || SEQUENTIAL.contains(&kind);
        let has_blocks = (1..=MOST_PIXELS).contains(&(size[0] * size[1]));
        (is_known && has_blocks && (1..=MOST_COMPONENTS).contains(&count)).then_some(Self {
            is_progressive,
            size,
            components,
        })
    }

    /// Reads the header of a scan; returns `None` if the header is not valid.
    pub fn scan(&self, data: &[u8]) -> Option<Scan> {
        let count = usize::from(*data.first()?);
        let parts = data.get(1..1 + 2 * count)?.chunks_exact(2);
        let parts: Vec<Part> = parts.map(|part| self.part(part, count)).collect::<Option<_>>()?;
        let [first, last, bits] = *data.get(1 + 2 * count..)?.first_chunk()?;
        let (first, last) = (u32::from(first), u32::from(last));
        let layer = self.is_progressive.then_some(Layer { first, last, is_refinement: bits >> 4 > 0 });
        let is_valid = match (self.is_progressive, first) {
            (false, _) => true,
            (true, 0) => last == 0,
            (true, _) => (first..64).contains(&last) && count == 1,
        };
        let groups = self.groups(parts.first()?.component, count);
        is_valid.then_some(Scan { groups, parts, layer })
    }

    /// For a scan with coefficients other than the first, returns a word for each block: the bits of the coefficients
    /// that are nonzero after the earlier scans are set. Returns an empty slice for other scans.
    pub fn nonzero(&mut self, scan: &Scan) -> &mut [u64] {
        match (&scan.layer, scan.parts.first()) {
            (Some(Layer { first: 1.., .. }), Some(part)) => {
                let nonzero = &mut self.components[part.component].nonzero;
                nonzero.resize(scan.groups, 0);
                nonzero
            }
            _ => &mut [],
        }
    }

    /// Reads a component of a scan of `count` components: its identifier, and the numbers of its tables.
    fn part(&self, bytes: &[u8], count: usize) -> Option<Part> {
        let component = self.components.iter().position(|component| component.name == bytes[0])?;
        let [across, down] = self.components[component].sampling;
        // If a scan has a single component, each block is a group of its own.
        let blocks = if count == 1 { 1 } else { across * down };
        let tables = [usize::from(bytes[1] >> 4 & 3), 4 + usize::from(bytes[1] & 3)];
        Some(Part { component, blocks, tables })
    }

    /// Returns the number of groups of a scan with `count` components, one of which is `component`.
    fn groups(&self, component: usize, count: usize) -> usize {
        let of_direction = |direction: usize| {
            let most = self.components.iter().map(|other| other.sampling[direction]).max().unwrap_or(1);
            let own = self.components[component].sampling[direction];
            match count {
                1 => (self.size[direction] * own).div_ceil(most).div_ceil(8),
                _ => self.size[direction].div_ceil(8 * most),
            }
        };
        of_direction(0) * of_direction(1)
    }
}

impl Component {
    /// Reads a component's identifier and sampling; returns `None` if the component has no blocks.
    fn of_bytes(bytes: &[u8]) -> Option<Self> {
        let sampling = [bytes[1] >> 4, bytes[1] & 15].map(usize::from);
        (!sampling.contains(&0)).then_some(Self { name: bytes[0], sampling, nonzero: Vec::new() })
    }
}

impl Scan {
    /// Returns the numbers of the tables of codes that the scan needs.
    pub fn tables(&self) -> impl Iterator<Item = usize> {
        let used = match self.layer {
            None => 0..2,
            Some(Layer { first: 0, is_refinement: false, .. }) => 0..1,
            Some(Layer { first: 0, .. }) => 0..0,
            Some(_) => 1..2,
        };
        self.parts.iter().flat_map(move |part| part.tables[used.clone()].iter().copied())
    }
}

/// Reads a number of 16 bits at a position of a segment.
pub(super) fn number(data: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(*data.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the frame of a progressive picture with two components, the first with this sampling.
    fn frame(height: [u8; 2], width: [u8; 2], sampling: u8) -> Option<Frame> {
        let size = [height, width].concat();
        Frame::of_segment(PROGRESSIVE, &[&[8], &size[..], &[2, 1, sampling, 0, 2, 0x11, 0]].concat())
    }

    #[test]
    fn a_frame_has_pixels_but_not_too_many_and_every_component_has_blocks() {
        assert!(frame([0, 8], [0, 8], 0x21).is_some() && frame([0x40, 0], [0x40, 0], 0x11).is_some());
        for size in [[[0, 0], [0, 8]], [[0, 8], [0, 0]], [[0x40, 0], [0x40, 1]], [[0xff, 0xff]; 2]] {
            assert!(frame(size[0], size[1], 0x11).is_none(), "{size:?}");
        }
        assert!([0x01, 0x10, 0].iter().all(|sampling| frame([0, 8], [0, 8], *sampling).is_none()));
    }

    #[test]
    fn a_scan_of_a_progressive_picture_has_the_first_coefficient_or_later_ones_of_one_component() {
        let Some(frame) = frame([0, 8], [0, 8], 0x11) else { unreachable!("the frame is valid") };
        let one = |first: u8, last: u8| frame.scan(&[1, 2, 0, first, last, 0]).is_some();
        assert!(one(0, 0) && one(1, 63) && one(5, 5) && !one(0, 1) && !one(1, 64) && !one(5, 4));
        let both = |first: u8, last: u8| frame.scan(&[2, 1, 0, 2, 0, first, last, 0]).is_some();
        assert!(both(0, 0) && !both(1, 63));
        assert!(frame.scan(&[1, 3, 0, 0, 0, 0]).is_none(), "no such component");
    }
}
