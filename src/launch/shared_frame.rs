//! The kernels of a frame in which the work-items of a group share each tile. A group is a row of a work-group: 32
//! work-items. The frame's lights are processed in rounds, at most a fixed number of lights in each round. In each
//! round of lights, kernels cast the shadow rays to the lights of the round, and shade.

use super::frame::Pass;
use super::parts::Parts;
use super::setup::Setup;
use super::shared::Shared;
use super::steps::{Step, Steps};
use super::subpixels::most_bits;
use super::{LaunchError, arguments::Arguments};
use crate::manifest::Role;
use ocl::Buffer;
use ocl::prm::Float4;
use std::ops::Range;

/// Makes the steps (kernels and other commands) of a frame in which each tile is shared by a group of 32
/// work-items.
pub(super) struct SharedFrame<'p, 'a> {
    parts: &'p Parts<'a>,
    shared: &'a Shared,
    arguments: Arguments<'a>,
    /// True if the kernel for primary rays also casts the shadow rays of the first round (the rays to the
    /// first lights).
    fused: bool,
    /// True if the shading kernel also casts the leftover shadow rays. When a group of 32 work-items has cast all
    /// leftover shadow rays of a pixel, the same group shades and stores this pixel. At the same time, other groups of
    /// work-items shade the pixels without leftover shadow rays. `shades_leftover` is false if `fused` is false.
    /// `shades_leftover` is also false if frames cast several samples of a pixel: a pixel then has several primary
    /// rays.
    shades_leftover: bool,
}

impl<'p, 'a> SharedFrame<'p, 'a> {
    /// Collects the kernel arguments that are the same in all rounds (a round processes some of the lights).
    pub fn new(
        parts: &'p Parts<'a>,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
        shared: &'a Shared,
    ) -> Self {
        let arguments = parts.arguments.clone().with("image", image).with("nearest", nearest);
        let arguments = arguments.with("lit", &shared.lit).with("queue", &shared.queue);
        let arguments = arguments.with("queued", &shared.queued);
        let fused = parts.setup.strategy.fuses(parts.setup.workload);
        let shades_leftover = fused && most_bits(&parts.setup) == 0;
        Self { parts, shared, arguments, fused, shades_leftover }
    }

    /// Returns the steps of a frame. If `fused` is false, the first steps prepare the eye's planes (if the
    /// strategy uses planes) and cast the primary rays. Steps for each round of lights (a few lights that are
    /// processed together) follow. Each round, except perhaps the last, has the same number of lights
    /// ([`lights_of_round`](crate::strategy::Strategy::lights_of_round)). The steps of a round prepare planes
    /// of the lights (if the strategy uses planes), cast shadow rays, then cast the leftover shadow rays
    /// (each by a whole group of 32 work-items), and then shade. If `fused` is true, the steps of the first
    /// round also cast the primary rays. If `shades_leftover` is true, one kernel shades and also casts the
    /// leftover shadow rays. A frame without lights and without a sky has one round, which only shades.
    pub fn cast(&self) -> Result<Steps, LaunchError> {
        let sources = sources(&self.parts.setup);
        let mut steps = Steps::new();
        if !self.fused {
            steps.extend(self.prepare(0..1, 0, Pass::Primary)?);
            let kernel = self.parts.setup.kernel_for(Role::Primary)?;
            let kernel = self.parts.pixel_kernel(kernel, &self.arguments, None)?;
            steps.push((Pass::Primary, Step::Cast(kernel)));
        }
        for first_light in (0..sources.max(1)).step_by(self.parts.setup.strategy.lights_of_round()) {
            if sources > 0 {
                steps.extend(self.cast_shadow_rays(first_light)?);
            }
            steps.push(self.shade(first_light)?);
        }
        Ok(steps)
    }

    fn shade(&self, first_light: usize) -> Result<(Pass, Step), LaunchError> {
        let queue_rows = if self.shades_leftover { self.queue_rows() } else { 0 };
        let [across, down] = self.parts.pixel_items();
        let queue_items = queue_rows * self.parts.setup.workload.local_size[1] as usize;
        let arguments = self.arguments.clone().with("first_light", first_light as i32);
        let arguments = arguments.with("queue_rows", queue_rows as i32);
        let items = Some([across, down + queue_items]);
        let kernel = self.parts.setup.kernel_for(Role::Shade)?;
        let kernel = self.parts.pixel_kernel(kernel, &arguments, items)?;
        Ok((Pass::Shade, Step::Run(kernel)))
    }

    /// Returns the steps before shading in a round of lights, which begins with the light source
    /// `first_light`. The first step empties the queue of leftover shadow rays and, if the strategy uses
    /// planes, prepares the planes of the round's lights. The next step casts the shadow rays. The last step
    /// casts the leftover shadow rays; this step is missing if `shades_leftover` is true. If `fused` is true,
    /// the steps of the first round also prepare the eye's planes (if the strategy uses planes) and cast the
    /// primary rays.
    fn cast_shadow_rays(&self, first_light: usize) -> Result<Steps, LaunchError> {
        let first = self.fused && first_light == 0;
        let pass = if self.fused { Pass::Whole } else { Pass::Shadow };
        let setup = &self.parts.setup;
        // The sky is the last light source. Shadow rays of the sky have no common origin, so the sky needs no planes.
        let left = setup.uploaded.light_count.saturating_sub(first_light);
        let lights = left.min(setup.strategy.lights_of_round());
        let origins = if first { 0 } else { 1 }..1 + lights;
        let arguments = self.arguments.clone().with("first_light", first_light as i32);
        let cast = |role, items| self.parts.pixel_kernel(setup.kernel_for(role)?, &arguments, items);
        let emptied = (pass, Step::Fill(self.shared.queued.clone(), 0));
        let mut steps = vec![self.prepare(origins, first_light, pass)?.unwrap_or(emptied)];
        let role = if first { Role::Frame } else { Role::Shadow };
        steps.push((pass, Step::Cast(cast(role, None)?)));
        if !self.shades_leftover {
            let [across, down] = setup.workload.local_size.map(|n| n as usize);
            let groups = [across * self.shared.groups.div_ceil(down), down];
            steps.push((pass, Step::Run(cast(Role::Leftover, Some(groups))?)));
        }
        Ok(steps)
    }

    /// Returns how many rows of work-groups contain enough groups of 32 work-items for the leftover shadow rays. Each
    /// row of work-groups is as wide as the image.
    fn queue_rows(&self) -> usize {
        let [across, down] = self.parts.setup.workload.local_size.map(|n| n as usize);
        self.shared.groups.div_ceil(down * (self.parts.pixel_items()[0] / across))
    }

    /// Returns the step that prepares the planes of a tree's triangles for the ray origins `origins` of a
    /// round. Origin 0 is the eye, and origin 1 is the first light of the round of lights. The step that
    /// prepares planes also empties the queue of leftover shadow rays. Returns `None` if the strategy uses no
    /// planes, or if there are no triangles or no origins.
    fn prepare(
        &self,
        origins: Range<usize>,
        first_light: usize,
        pass: Pass,
    ) -> Result<Option<(Pass, Step)>, LaunchError> {
        let setup = &self.parts.setup;
        let triangles = setup.uploaded.triangle_count;
        if self.parts.prepared.is_none() || triangles == 0 || origins.is_empty() {
            return Ok(None);
        }
        let arguments = self.arguments.clone().with("count", triangles as i32);
        let arguments = arguments.with("first_origin", origins.start as i32);
        let arguments = arguments.with("first_light", first_light as i32);
        let kernel = setup.kernel_for(Role::Prepare)?;
        let kernel = setup.row_kernel(kernel, &arguments, [triangles, origins.len()])?;
        Ok(Some((pass, Step::Run(kernel))))
    }
}

/// Returns the number of light sources, including the sky.
fn sources(setup: &Setup<'_>) -> usize {
    setup.uploaded.light_count + usize::from(setup.workload.sky)
}
