//! Casts frame after frame on one device. Buffers and programs are reused if they suit the next frame's scene too.

use super::super::Args;
use crate::device::Device;
use crate::image::Frame;
use crate::launch::{Caster, HostTree, LaunchError, Prepared, Queue, Refused, Session, ShowProgram};
use crate::program::{BuiltProgram, ProgramSpec, Sources};
use crate::scene::{Mesh, Sampling, Scene};
use crate::strategy::Strategy;
use std::sync::Arc;

/// A device, and the settings and objects with which it casts frames.
pub struct Stage<'a> {
    pub args: &'a Args,
    pub device: &'a Device,
    pub sources: &'a Sources,
    pub queue: Queue,
    pub strategy: Strategy,
    pub local_size: [u32; 2],
    pub sampling: Sampling,
    /// A built program, which `prepare` uses for the next scene if the program suits that scene. Before the first
    /// frame, this is the program that was built while the scene was loaded; later, it is the program that cast the
    /// previous frame. `None` while the field `ready` holds the program. Also `None` before the first frame, if no
    /// program was built early.
    pub program: Option<(ProgramSpec, BuiltProgram)>,
    /// The tree that was built while the device was opened, with its mesh and strategy. `None` if no tree was built
    /// early, or after the first frame.
    pub tree: Option<(Arc<Mesh>, (Strategy, HostTree))>,
    /// The program that converts frames to 8 bits on a device whose memory is separate from the host's; `None` if the
    /// host converts them.
    pub show: Option<ShowProgram>,
    /// The prepared scene and the caster of the last frame; `None` before the first frame.
    pub ready: Option<Ready>,
}

/// An uploaded scene with its program, and the caster of its frames. The buffers, the program and the caster
/// are kept until a frame's scene needs other buffers or kernels, for example because the scene has another
/// mesh.
type Ready = (Prepared, Caster);

impl Stage<'_> {
    /// Casts the frame of a scene; returns its image and the device's time in milliseconds. If the previous
    /// frame's buffers and kernels suit the scene, only values such as its lights are uploaded; otherwise the whole
    /// scene is uploaded.
    pub fn cast(&mut self, scene: &Arc<Scene>) -> Result<(Frame, f64), Refused> {
        let ready = match self.shown(scene)? {
            Some(ready) => ready,
            None => self.prepare(scene)?,
        };
        let (prepared, caster) = self.ready.insert(ready);
        let times =
            caster.cast_samples(&scene.camera, &prepared.sampling).map_err(Refused::at("the launch"))?;
        let frame = read(caster, scene, self.show.as_ref()).map_err(Refused::at("reading the image"))?;
        Ok((frame, times.frame_ms))
    }

    /// Uploads the lights, the sky and the background of `scene`, and returns the previous frame's program and buffers,
    /// which `scene` uses again. Returns `None` before the first frame. If the program or the buffers do not suit the
    /// scene, returns `None` and frees everything except the program, so that there is room for new buffers.
    fn shown(&mut self, scene: &Arc<Scene>) -> Result<Option<Ready>, Refused> {
        let Some((mut prepared, caster)) = self.ready.take() else { return Ok(None) };
        if prepared.show(scene, &caster).map_err(Refused::at("the next frame"))? {
            return Ok(Some((prepared, caster)));
        }
        self.program = Some((prepared.spec, prepared.program));
        Ok(None)
    }

    /// Uploads a scene with its tree. A program is built only if the program in the field `program` does not suit the
    /// scene.
    fn prepare(&mut self, scene: &Arc<Scene>) -> Result<Ready, Refused> {
        let session = Session::new(self.queue.clone(), &self.device.info, self.sources, Arc::clone(scene));
        let session = session.with_sampling(self.sampling).with_program(self.program.take());
        let of_mesh = self.tree.take().filter(|(mesh, _)| Arc::ptr_eq(mesh, &scene.mesh));
        let mut session = session.with_tree(of_mesh.map(|(_, tree)| tree)).rounding_stacks();
        let prepared = self.args.subject.prepare(&mut session, &self.strategy, self.local_size)?;
        let caster = prepared.caster()?;
        Ok((prepared, caster))
    }
}

/// Reads the frame that was cast last: in 8 bits or, if its background is transparent or a pixel is not finite, as
/// radiance.
fn read(caster: &Caster, scene: &Scene, show: Option<&ShowProgram>) -> Result<Frame, LaunchError> {
    let shown = if scene.transparent { None } else { caster.read_8_bits(show, scene.display)? };
    match shown {
        Some((picture, _)) => Ok(Frame::Shown(picture)),
        None => caster.read().map(|(image, _)| Frame::Radiance(image, scene.display)),
    }
}
