//! Answers queries for published run times: those in the student paper that raycl reproduces. A query is a text that
//! says from where a number in a document is taken.

use super::of_record::{Figure, Form};
use crate::report::paper::curve;

/// Returns the published time for "SCENE PRESET WxH", where WxH is the local size; `Nothing` if the paper's plot has no
/// point for this combination. Returns an error if the query has another form, or if no plot of the paper shows the
/// preset on the scene.
pub fn published(words: &[&str]) -> Result<Figure, String> {
    let [scene, preset, size] = words[..] else {
        return Err(format!(
            "'{}' does not name a point of the paper's plots; expected \"SCENE PRESET WxH\", such as \
             \"teapot naive 8x8\"",
            words.join(" ")
        ));
    };
    let (_, points) =
        curve(scene, preset).ok_or_else(|| format!("no plot of the paper shows {preset} on {scene}"))?;
    let block = |(block, _): &&(u32, f64)| format!("{block}x{block}") == size;
    let figure = points.iter().find(block).map(|(_, ms)| Figure::Number(*ms, Form::Count));
    Ok(figure.unwrap_or_else(|| Figure::Nothing("no point".into())))
}
