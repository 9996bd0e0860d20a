//! Compares ICC profiles with sRGB (ICC.1:2022, "Image technology colour management").

/// For each of a profile's three primaries: the primary's tag, and X, Y and Z of the same primary of sRGB, adapted to
/// the white D50.
const PRIMARIES: [(&[u8], [f32; 3]); 3] = [
    (b"rXYZ", [0.4361, 0.2225, 0.0139]),
    (b"gXYZ", [0.3851, 0.7169, 0.0971]),
    (b"bXYZ", [0.1431, 0.0606, 0.7141]),
];
/// The tags of a profile's curves, which convert stored values to linear light.
const CURVES: [&[u8]; 3] = [b"rTRC", b"gTRC", b"bTRC"];
/// The linear light to which sRGB converts the stored value 0.5.
const MIDDLE: f32 = 0.2140;
/// raycl treats a number of a profile as equal to sRGB's number if the two numbers differ by at most `CLOSE`. The
/// compared numbers are the components of the primaries, and the linear light to which a curve converts the stored
/// value 0.5. If a curve is a pure power with the exponent 2.2, this linear light differs from sRGB's by 0.004.
const CLOSE: f32 = 0.01;

/// Returns true if a profile is known to describe sRGB, or shades of grey with sRGB's curve.
pub fn is_srgb(profile: &[u8]) -> bool {
    let has_curve = |name| {
        let light = tag(profile, name).and_then(light_of_middle);
        light.is_some_and(|light| (light - MIDDLE).abs() <= CLOSE)
    };
    let has_primary = |(name, usual): (_, [f32; 3])| {
        let stated = tag(profile, name).and_then(|tag| fixed::<3>(tag.get(8..)?));
        stated.is_some_and(|stated| {
            stated.iter().zip(usual).all(|(value, usual)| (value - usual).abs() <= CLOSE)
        })
    };
    has_curve(b"kTRC") || CURVES.into_iter().all(has_curve) && PRIMARIES.into_iter().all(has_primary)
}

/// Returns the data of the tag `name`: the tag's type, four unused bytes and the tag's values.
fn tag<'a>(profile: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let count = whole(profile, 128)?;
    let entry = profile.get(132..)?.chunks_exact(12).take(count).find(|entry| entry.starts_with(name))?;
    let (start, length) = (whole(entry, 4)?, whole(entry, 8)?);
    profile.get(start..start.saturating_add(length))
}

/// Returns the linear light to which a curve converts the stored value 0.5.
fn light_of_middle(curve: &[u8]) -> Option<f32> {
    const MIDDLE: f32 = 0.5;
    match curve.get(..4)? {
        b"curv" => {
            let count = whole(curve, 8)?;
            let entry = |index: usize| -> Option<u16> {
                Some(u16::from_be_bytes(*curve.get(12 + 2 * index..)?.first_chunk()?))
            };
            match count {
                0 => Some(MIDDLE),
                1 => Some(MIDDLE.powf(f32::from(entry(0)?) / 256.0)),
                // A table with an even number of entries has two entries beside its middle.
                _ => {
                    let [low, high] = [entry((count - 1) / 2)?, entry(count / 2)?].map(f32::from);
                    Some((low + high) / (2.0 * f32::from(u16::MAX)))
                }
            }
        }
        // The value 0.5 is assumed to be in the part of the curve that is a power, as it is in sRGB.
        b"para" => {
            let numbers = curve.get(12..)?;
            let [g, a, b, c] = match curve.get(8..10)? {
                [0, 0] => [fixed::<1>(numbers)?[0], 1.0, 0.0, 0.0],
                [0, 2] => fixed(numbers)?,
                [0, 1 | 3] => fixed::<3>(numbers).map(|[g, a, b]| [g, a, b, 0.0])?,
                [0, 4] => fixed::<7>(numbers).map(|[g, a, b, _, _, e, _]| [g, a, b, e])?,
                _ => return None,
            };
            Some((a * MIDDLE + b).powf(g) + c)
        }
        _ => None,
    }
}

/// Returns the whole number, of 32 bits, at the offset `at`.
fn whole(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?) as usize)
}

/// Returns the first `N` numbers of a list. Each has 16 bits before the binary point and 16 bits after it.
fn fixed<const N: usize>(bytes: &[u8]) -> Option<[f32; N]> {
    let mut numbers = [0.0; N];
    for (number, bytes) in numbers.iter_mut().zip(bytes.get(..4 * N)?.chunks_exact(4)) {
        *number = i32::from_be_bytes(*bytes.first_chunk()?) as f32 / 65536.0;
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a profile with these tags.
    fn profile(tags: &[(&[u8], Vec<u8>)]) -> Vec<u8> {
        let mut bytes = [vec![0; 128], (tags.len() as u32).to_be_bytes().to_vec()].concat();
        let mut start = bytes.len() + 12 * tags.len();
        for (name, data) in tags {
            let place = [start as u32, data.len() as u32].map(u32::to_be_bytes).concat();
            bytes.extend([*name, &place].concat());
            start += data.len();
        }
        tags.iter().for_each(|(_, data)| bytes.extend(data));
        bytes
    }

    fn numbers(list: &[f32]) -> Vec<u8> {
        list.iter().flat_map(|number| ((number * 65536.0).round() as i32).to_be_bytes()).collect()
    }

    fn parametric(kind: u8, list: &[f32]) -> Vec<u8> {
        [&b"para\0\0\0\0\0"[..], &[kind, 0, 0], &numbers(list)].concat()
    }

    fn table(entries: &[u16]) -> Vec<u8> {
        let count = (entries.len() as u32).to_be_bytes();
        let entries: Vec<u8> = entries.iter().flat_map(|entry| entry.to_be_bytes()).collect();
        [&b"curv\0\0\0\0"[..], &count, &entries].concat()
    }

    fn colours(curve: &[u8], red: [f32; 3]) -> Vec<u8> {
        let primary = |list: &[f32]| [&b"XYZ \0\0\0\0"[..], &numbers(list)].concat();
        let mut tags: Vec<(&[u8], Vec<u8>)> = CURVES.map(|name| (name, curve.to_vec())).into();
        tags.extend(PRIMARIES.map(|(name, usual)| (name, primary(&usual))));
        tags[3].1 = primary(&red);
        profile(&tags)
    }

    #[test]
    fn a_profile_is_that_of_srgb_if_its_curves_and_primaries_are() {
        let (red, adobe) = (PRIMARIES[0].1, [0.6097, 0.3111, 0.0195]);
        let usual = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045];
        let all: Vec<u16> =
            (0..1024).map(|index| ((index as f32 / 1023.0).powf(2.2) * 65535.0) as u16).collect();
        let few: Vec<u16> = (0..20).map(|index| ((index as f32 / 19.0).powf(2.2) * 65535.0) as u16).collect();
        for (curve, red, expected) in [
            (parametric(3, &usual), red, true),
            (parametric(4, &[&usual[..], &[0.0, 0.0]].concat()), red, true),
            (parametric(0, &[2.2]), red, true),
            (table(&[563]), red, true),
            (table(&all), red, true),
            (table(&few), red, true),
            (parametric(3, &usual), adobe, false),
            (table(&[]), red, false),
            (table(&[256]), red, false),
            (parametric(0, &[1.8]), red, false),
            (parametric(9, &usual), red, false),
            (table(&all)[..20].to_vec(), red, false),
        ] {
            assert_eq!(is_srgb(&colours(&curve, red)), expected, "{curve:?} {red:?}");
        }
        let grey = |gamma: f32| profile(&[(b"kTRC", parametric(0, &[gamma]))]);
        assert_eq!([is_srgb(&grey(2.2)), is_srgb(&grey(1.8))], [true, false]);
        let whole = colours(&table(&[563]), red);
        assert!((0..whole.len() - 1).all(|end| !is_srgb(&whole[..end])), "a profile that is cut off");
    }
}
