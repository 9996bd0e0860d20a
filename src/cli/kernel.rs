//! `raycl kernel`: prints the program of a strategy as the compiler sees it.

mod title;

use super::choice::{StrategyText, one_device, parse_size, parse_strategy};
use crate::device::{Builtins, Device};
use crate::error::Result;
use crate::launch::{Queue, Refused, preprocess_for, stack_size};
use crate::manifest::GROUP_LANES;
use crate::program::preprocess::{Preprocessed, canonical, preprocess, read};
use crate::program::{ProgramSpec, Sources, frame_kernels};
use crate::scene::load_scene;
use crate::strategy::{Requirements, Strategy, Workload};
use std::collections::BTreeMap;
use std::path::PathBuf;
use title::{Title, foot};

/// Arguments of `raycl kernel`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl kernel naive | less
  raycl kernel deferred,width=4 --local-size 16x4
  raycl kernel tile --device cpu --scene scenes/teapot.toml
  raycl kernel naive --cl-dir my-cl --canonical > edited.txt

The output is OpenCL C without #if conditions and without the macros of the kernel files. The compiler makes the same program from this output as from the text that raycl compiles. If a number in the output has a name in the kernel files, a comment beside the number states this name. A device's compiler also defines macros of its own. If an #if condition uses such a macro, raycl asks the compiler of --device for the macro's value; without --device, the macro is treated as undefined.")]
pub struct Args {
    /// The strategy: a preset (naive), values of axes (width=4), or both (deferred,width=4)
    #[arg(value_parser = StrategyText, hide_possible_values = true)]
    strategy: String,
    /// Local size: work-items per work-group, across and down; 8 stands for 8x8 [default: 8x8, or fewer work-items if
    /// the device of --device does not allow 8x8. For strategies in which 32 work-items cast a tile of rays together:
    /// 32x4 if --device names a device whose work-items can exchange values without barriers; otherwise, 32x1]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    local_size: Option<[u32; 2]>,
    /// Print the program as the compiler of this device sees it. DEVICE is part of the device's name, platform or
    /// vendor; its label in `raycl devices`; or its kind (cpu, gpu, accelerator). If several devices match, raycl uses
    /// the first usable one in the order of `raycl devices` [default: no particular device]
    #[arg(long)]
    device: Option<String>,
    /// The scene: a scene file (TOML) or a bare mesh (a mesh file). The scene's features, such as textures and a sky,
    /// determine which parts of the kernels are compiled. The scene's mesh and materials determine the sizes of stacks
    /// and of some __local arrays. For a bare mesh, the kernels are compiled as for `raycl render --plain --samples 1`
    /// [default: a small scene]
    #[arg(long, value_name = "FILE")]
    pub(super) scene: Option<PathBuf>,
    /// Also print the functions, types and variables that the kernels of a frame with one sample per pixel do not need
    #[arg(long)]
    all: bool,
    /// Print only the text that affects compilation: comments are removed, macros are replaced by their
    /// expansions, and white space is made uniform. Two sources give the same output if they differ only in
    /// comments, in white space, or in macros that expand to the same text. Not with --all
    #[arg(long, conflicts_with = "all")]
    canonical: bool,
    /// Use the kernel files in this folder instead of the built-in files of the same names. A file with a new name in
    /// the folder of an axis of strategies, such as cast/vectors/, adds a value to this axis
    #[arg(long, value_name = "DIR")]
    pub(super) cl_dir: Option<PathBuf>,
}

impl Args {
    /// Returns true if the command starts a device's driver.
    pub(super) fn asks_a_device(&self) -> bool {
        self.device.is_some()
    }
}

/// Prints a strategy's program as the compiler sees it. Leaves out the lines that the kernels of a frame do not need,
/// unless `--all` is given. With `--canonical`, prints the whole program in canonical form instead (without comments,
/// with one statement per line).
pub fn run(args: Args) -> Result<()> {
    let sources = Sources::of(args.cl_dir.clone())?;
    let strategy = parse_strategy(&args.strategy)?;
    strategy.check()?;
    let device = args.device.as_deref().map(|pattern| one_device(Some(pattern), &sources)).transpose()?;
    let builtins = device.as_ref().map_or_else(Builtins::default, |device| device.info.builtins());
    let workload = workload(&args, &strategy, device.as_ref())?;
    let spec = ProgramSpec::unchecked(&sources, &strategy, &workload, builtins)?;
    let program = match &device {
        Some(device) => on_device(device, &strategy, &workload, &spec),
        None => preprocess(&spec.source, &spec.options, &BTreeMap::new()),
    };
    let program = program.map_err(|error| sources.with_path(error, &spec.files))?;
    if args.canonical {
        return super::print(canonical(&program.text()).trim_end());
    }
    let kernels = frame_kernels(&strategy, &workload);
    let reading = read(&program.lines, (!args.all).then_some(&kernels[..]));
    let title = Title { args: &args, strategy, workload, builtins, device, options: &spec.options };
    let (head, foot) = (title.head(&program, &kernels), foot(&program, reading.left_out));
    super::print(format!("{head}{}{foot}", reading.text).trim_end())
}

/// The remedy if the device does not support the strategy with the chosen local size and scene.
const OTHERS: &str = "choose another strategy, --local-size or --scene";

/// Returns the program as the device's compiler sees it. Returns an error if the device does not support the
/// strategy with this workload.
fn on_device(
    device: &Device,
    strategy: &Strategy,
    workload: &Workload,
    spec: &ProgramSpec,
) -> Result<Preprocessed> {
    Requirements::check(strategy, workload, &device.info.limits).map_err(|infeasible| {
        let refused = Refused::Device(infeasible).into_error(&device.info);
        refused.with_help(OTHERS)
    })?;
    preprocess_for(&Queue::open(device)?, spec)
}

/// Returns the properties of the scene and the work-group on which the program depends. Without `--scene`, the
/// scene is a small cube.
fn workload(args: &Args, strategy: &Strategy, device: Option<&Device>) -> Result<Workload> {
    const USUAL: [u32; 2] = [8, 8];
    let usual = match device {
        Some(device) => strategy.local_size(&device.info.limits, USUAL),
        None if strategy.shares_tiles() => [GROUP_LANES, 1],
        None => USUAL,
    };
    let local_size = args.local_size.unwrap_or(usual);
    let Some(path) = &args.scene else { return Ok(Workload { local_size, ..Workload::CUBE }) };
    let scene = load_scene(path)?.scene;
    let refused =
        |refused: Refused| refused.into_host_error().with_help("choose another strategy or --scene");
    let stack_size = stack_size(&scene.mesh, strategy).map_err(refused)?;
    Ok(Workload { stack_size, ..Workload::of(&scene, Workload::CUBE.image_size, local_size) })
}
