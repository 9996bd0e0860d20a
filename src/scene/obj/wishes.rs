//! Counts statements of OBJ and MTL that raycl does not support. Statements that affect no picture, such as
//! names and groups (`o`, `g`, `mg`), are not counted. Some statements have an effect only together with a
//! second statement. Of two such statements, only the second statement is counted. Texture coordinates (`vt`)
//! need a texture, parameters of a free-form shape (`cstype`, `deg`, `parm`, ...) need the shape, and the
//! refractive index (`Ni`) needs a refracting material. The roughness of a coat (`Pcr`) needs a coat (`Pc`), and the
//! direction of anisotropy (`anisor`) needs anisotropy (`aniso`).

use super::asked::{Asked, Wish};
use super::text::{number, tokens};

/// Counts a line of an OBJ file if it asks for something that raycl does not support. `rest` is the line
/// after the keyword. The function is not called for `v`, `vn`, `vt`, `f`, `fo`, `s`, `usemtl` and `mtllib`,
/// which other modules read.
pub(super) fn of_line(asked: &mut Asked, keyword: &[u8], rest: &[u8]) {
    let off = || matches!(tokens(rest).next(), None | Some(b"off" | b"0"));
    let wish = match keyword {
        // ZBrush writes the colours of vertices into comments.
        b"#MRGB" => Wish::Paint,
        [b'#', ..] | b"" | b"vt" | b"o" | b"g" | b"mg" | b"vp" => return,
        b"cstype" | b"deg" | b"bmat" | b"step" | b"parm" | b"trim" | b"hole" | b"scrv" | b"sp" | b"end"
        | b"con" | b"maplib" => return,
        b"l" => Wish::Lines,
        b"p" => Wish::Points,
        b"curv" | b"curv2" | b"surf" | b"bsp" | b"bzp" | b"cdc" | b"cdp" | b"res" => Wish::FreeForm,
        b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"usemap" if off() => return,
        b"usemap" => Wish::Texture,
        b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"ctech"
        | b"stech" => Wish::Attribute,
        b"call" | b"csh" => Wish::OtherFile,
        _ => Wish::Unknown,
    };
    asked.add(wish, keyword);
}

/// Counts a line of a material if it asks for something that raycl does not support. `rest` is the line after
/// the keyword. The function is not called for `newmtl`, `Kd`, `Ks`, `Ke`, `Ns`, `illum`, `map_Kd`, `map_d`
/// and `map_Ke`, which other modules read.
pub(super) fn of_material(asked: &mut Asked, keyword: &[u8], rest: &[u8]) {
    let lower = keyword.to_ascii_lowercase();
    // Numbers after those that the keyword takes do not count.
    let most = of_numbers(&lower).map_or(usize::MAX, |(_, most)| most);
    let values = || tokens(rest).filter_map(number).take(most);
    let any = |holds: fn(f32) -> bool| values().any(holds);
    // Some exporters write the keyword of a texture map without the name of a file.
    let has_value = || tokens(rest).next().is_some();
    let not_zero = || any(|value| value != 0.0);
    // MTL also allows the colours `spectral FILE FACTOR` and `xyz X Y Z`.
    let has_form = || matches!(tokens(rest).next(), Some(b"spectral" | b"xyz"));
    let (wish, asks) = match &lower[..] {
        [b'#', ..] | b"" | b"illum" | b"ni" | b"pcr" | b"anisor" | b"sharpness" | b"map_aat" => return,
        _ if names_picture(&lower) => (Wish::Texture, has_value()),
        b"d" => (Wish::Transparency, any(|value| value < 1.0)),
        b"tr" => (Wish::Transparency, any(|value| value > 0.0)),
        b"tf" => (Wish::Transparency, has_form() || any(|value| value != 1.0)),
        b"ka" => (Wish::Ambient, has_form() || not_zero()),
        // A roughness of 0 asks for a smooth surface; other numbers that are 0 ask for nothing. A surface of roughness 1
        // is matt, as raycl shows it.
        b"pr" => (Wish::Physical, has_value() && !any(|value| value == 1.0)),
        b"pm" | b"ps" | b"pc" | b"aniso" => (Wish::Physical, not_zero()),
        _ => (Wish::Unknown, true),
    };
    if asks {
        asked.add(wish, keyword);
    }
}

/// Returns true if the lines with this keyword in an MTL file name a picture.
pub(super) fn names_picture(keyword: &[u8]) -> bool {
    match &keyword.to_ascii_lowercase()[..] {
        b"bump" | b"disp" | b"decal" | b"norm" | b"refl" => true,
        lower => lower.starts_with(b"map_") && lower != b"map_aat",
    }
}

/// Returns the unsupported feature that a keyword asks for, and how many numbers may follow the keyword. Returns `None`
/// if the keyword asks for no such feature, or if the keyword takes no numbers.
pub(super) fn of_numbers(keyword: &[u8]) -> Option<(Wish, usize)> {
    match &keyword.to_ascii_lowercase()[..] {
        b"d" | b"tr" => Some((Wish::Transparency, 1)),
        b"tf" => Some((Wish::Transparency, 3)),
        b"ka" => Some((Wish::Ambient, 3)),
        b"pr" | b"pm" | b"ps" | b"pc" | b"pcr" | b"aniso" | b"anisor" => Some((Wish::Physical, 1)),
        _ => None,
    }
}

/// Counts a material's illumination model (the value of `illum`) if raycl does not support it. Model 2 is
/// supported. Model 1, which means no highlight, is supported if the material has no highlight.
pub(super) fn of_model(asked: &mut Asked, model: Option<&[u8]>, has_highlight: bool) {
    let Some(model) = model else { return };
    let wish = match model {
        b"2" => return,
        b"1" if !has_highlight => return,
        b"0" => Wish::Unlit,
        b"1" => Wish::NoHighlight,
        b"3" | b"5" | b"8" => Wish::Reflection,
        b"4" | b"6" | b"7" | b"9" => Wish::Refraction,
        b"10" => Wish::ShadowCatcher,
        _ => Wish::UnknownModel,
    };
    asked.add(wish, &[b"illum ", model].concat());
}
