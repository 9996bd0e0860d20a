//! `raycl compile`: builds a scene's kernels and saves the compiler's output.

use super::choice::{StrategyText, one_device, parse_size, parse_strategy};
use crate::device::{Device, both_names, is_pocl};
use crate::error::{Error, Result};
use crate::existing;
use crate::launch::{Refused, Session};
use crate::microscope::{Microscope, binary_of_frame};
use crate::output::{Choice, OutFolder};
use crate::printer;
use crate::program::compiled::is_ptx;
use crate::program::{CACHE_DISABLE, CompiledKernel, ProgramCache, Sources};
use crate::report::{MICROSCOPE, microscope_page};
use crate::scene::load_scene;
use crate::strategy::{Requirements, Strategy};
use crate::words::{counted_of_were, few};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arguments of `raycl compile`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl compile scenes/teapot.toml --strategy naive --out made
  raycl compile scenes/teapot.toml --strategy naive --strategy local-vectors --out made
  raycl compile scenes/teapot.toml --strategy deferred,width=4 --local-size 64x1 --json

Each strategy gets a folder inside the folder of --out, with these files: source.cl (the whole source as one text), options.txt (the compiler's options), build.log (the compiler's messages), binary.ptx (the program's binary if it is PTX text) or binary.bin (any other binary), made.json and microscope.html. For each kernel, made.json contains the numbers of registers, bytes of memory and memory instructions, and the predicted occupancy. For each source line, made.json contains the numbers of instructions. The page microscope.html shows each source line beside its instructions, and counts the instructions of each kind, such as loads from global memory. PoCL, a driver for CPUs, compiles a kernel for its local size only when the kernel is launched. With PoCL and --out or --json, raycl therefore casts a frame of one pixel; with other drivers, it casts no ray.

The compiler's line table assigns instructions to source lines. If there is no line table, raycl counts the instructions of each part of the kernel instead. In PTX and SASS, a part is the code from one label to the next; on a CPU, a part is a function. The instructions are PTX, or the CPU's instructions as objdump (package binutils) prints them. If NVIDIA's assembler ptxas and disassembler nvdisasm are on PATH, microscope.html also shows the machine code (SASS) that ptxas generates; the GPU's driver may generate different machine code. The table that `raycl compile` prints shows the number of registers only if the compiler prints it, and the number of memory instructions only if the program's binary is PTX.")]
pub struct Args {
    /// The scene: a scene file (TOML) or a bare mesh (a mesh file). The scene's features, such as textures and a sky,
    /// determine which parts of the kernels are compiled. The scene's mesh and materials determine the sizes of stacks
    /// and of some __local arrays. For a bare mesh, the kernels are compiled as for `raycl render --plain --samples 1`
    pub(super) scene: PathBuf,
    /// The strategy: a preset (naive), values of axes (width=4), or both (deferred,width=4). The option may
    /// be given several times. If one strategy's program cannot be built, raycl still builds the others
    #[arg(long, required = true, value_parser = StrategyText, hide_possible_values = true)]
    strategy: Vec<String>,
    /// Local size: work-items per work-group, across and down; 8 stands for 8x8 [default: 8x8. For strategies in which
    /// 32 work-items cast a tile of rays together: 32x4 if work-items of the device can exchange values without
    /// barriers, else 32x1]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    local_size: Option<[u32; 2]>,
    /// The device: part of its name, platform or vendor; its label in `raycl devices`; or its kind (cpu, gpu,
    /// accelerator). If several devices match, raycl uses the first of them in the order of `raycl devices` [default:
    /// the device in RAYCL_DEVICE or your settings, else the most capable device]
    #[arg(long)]
    device: Option<String>,
    /// Write the source, the build log, the binary, and the numbers of registers and instructions to this folder
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files in the folder of --out even if they were not written by raycl, or were changed after raycl wrote
    /// them
    #[arg(long, requires = "out")]
    force: bool,
    /// Print one JSON object per strategy instead of a table
    #[arg(long)]
    json: bool,
    /// Use the kernel files in this folder instead of the built-in files of the same names. A file with a new name in
    /// the folder of an axis of strategies, such as cast/vectors/, adds a value to this axis
    #[arg(long, value_name = "DIR")]
    pub(super) cl_dir: Option<PathBuf>,
}

/// The compiled program of a strategy.
#[derive(Debug, Serialize)]
struct Compilation {
    device: String,
    strategy: String,
    local_size: [u32; 2],
    program_hash: String,
    build_ms: f64,
    binary_is_ptx: bool,
    /// The folder of `--cl-dir` (the user's kernel files). Only the page [`MICROSCOPE`] names this folder;
    /// made.json leaves it out.
    #[serde(skip)]
    cl_dir: Option<PathBuf>,
    /// False if the driver does not report the kernels' `__local` memory. made.json has the driver's numbers as they
    /// are.
    #[serde(skip)]
    reports_local: bool,
    kernels: Vec<CompiledKernel>,
    /// The instructions (PTX, SASS or the CPU's) that the compiler generated for each line of the source; `None` if
    /// neither --out nor --json is given.
    microscope: Option<Microscope>,
}

impl Compilation {
    /// Returns the kernels as the table and the page show them: without the bytes of `__local` memory if the driver
    /// does not report them.
    fn shown_kernels(&self) -> Vec<CompiledKernel> {
        let shown = |kernel: &CompiledKernel| CompiledKernel {
            local_bytes: kernel.local_bytes.filter(|_| self.reports_local),
            ..kernel.clone()
        };
        self.kernels.iter().map(shown).collect()
    }
}

/// The image size for which the kernels are prepared. The compiled code does not depend on the image size.
/// PoCL compiles a kernel for its local size only when a frame is cast, and a frame of one pixel takes little
/// time even in a large scene.
const IMAGE_SIZE: [u32; 2] = [1, 1];

/// Builds the program of every strategy. Prints the numbers of registers and instructions, and writes the
/// compiler's output to the folder of `--out`. If one of several programs cannot be built, prints the error
/// and continues with the other strategies. After the last strategy, returns an error if a program could not
/// be built.
pub fn run(args: Args) -> Result<()> {
    disable_caches();
    let scene = load_scene(&args.scene)?.scene;
    let sources = Sources::of(args.cl_dir.clone())?;
    let strategies: Vec<Strategy> =
        args.strategy.iter().map(|text| parse_strategy(text)).collect::<Result<_>>()?;
    strategies.iter().try_for_each(|strategy| strategy.check())?;
    let mut out = args.out.as_ref().map(|path| out_folder(&args, path)).transpose()?;
    let device = one_device(args.device.as_deref(), &sources)?;
    let mut session = Session::open(&device, &sources, Arc::new(scene))?.with_cache(ProgramCache::default());
    let mut failed = Vec::new();
    for (text, strategy) in args.strategy.iter().zip(&strategies) {
        let (made, files) = match compile(&args, &device, &mut session, strategy) {
            Ok(compiled) => compiled,
            Err(error) if strategies.len() == 1 => return Err(error),
            Err(error) => {
                failed.push((text.as_str(), error.exit_code()));
                printer::tell(format!("{}:\n{:?}", printer::plain(text), miette::Report::new(error)));
                continue;
            }
        };
        let told = args.out.as_deref().filter(|_| !args.json).and_then(|out| replaced(out, text, &made));
        if let Some(out) = &mut out {
            keep(out, text, &made, files)?;
        }
        match args.json {
            true => super::print_json(&made)?,
            false => super::print(text_of(text, &made))?,
        }
        if let Some(line) = told {
            super::print(line)?;
        }
    }
    if let Some(line) = written(args.out.as_deref(), args.json, strategies.len() - failed.len()) {
        super::print(line)?;
    }
    refuse_not_compiled(&failed, strategies.len())
}

/// Returns the line that names the folder of `--out`; `None` without `--out`, with `--json`, or if none of
/// the programs could be compiled. `made` is the number of programs that were compiled.
fn written(out: Option<&Path>, as_json: bool, made: usize) -> Option<String> {
    out.filter(|_| !as_json && made > 0).map(|out| format!("Written to {}", out.display()))
}

/// Returns the line which says that the new files replace files of another program, or of a program for another device,
/// in the strategy's folder. Returns `None` if the folder has no such files, or if its `made.json` cannot be read. The
/// strategy's folder is a subfolder of `out`, and must not contain the new program's files yet.
fn replaced(out: &Path, strategy: &str, made: &Compilation) -> Option<String> {
    let folder = out.join(folder_name(strategy));
    let earlier = existing::bytes(&folder.join("made.json")).ok()??;
    let earlier: serde_json::Value = serde_json::from_slice(&earlier).ok()?;
    let is_same = earlier["program_hash"] == made.program_hash && earlier["device"] == made.device;
    (!is_same).then(|| format!("Replaced the files of another program in {}", folder.display()))
}

/// Returns an error if `failed` is not empty. For each program that could not be compiled, `failed` has the
/// name of its strategy and the exit code of its error, which has been printed. `all` is the number of all
/// programs.
fn refuse_not_compiled(failed: &[(&str, u8)], all: usize) -> Result<()> {
    if failed.is_empty() {
        return Ok(());
    }
    let names: Vec<_> = failed.iter().map(|(name, _)| *name).collect();
    let count = counted_of_were(failed.len(), all, "program");
    let message = format!("{count} not compiled: {}", few(&names));
    let are_mistakes = failed.iter().all(|(_, code)| *code == 2);
    let error = if are_mistakes { Error::input(message) } else { Error::run(message) };
    Err(error.with_help("the messages above give the reasons"))
}

/// The names of all files that a strategy's folder may contain.
const FILES: [&str; 7] =
    [MICROSCOPE, "source.cl", "options.txt", "build.log", "binary.ptx", "binary.bin", "made.json"];

/// Returns the folder of `--out`. Unless `--force` is given, returns an error if a file that would be
/// replaced was not written by raycl, or was changed later.
fn out_folder(args: &Args, path: &Path) -> Result<OutFolder> {
    let out = OutFolder::open(path, Choice::new(args.force, "--out DIR"))?;
    for strategy in &args.strategy {
        let names = FILES.map(|name| format!("{}/{name}", folder_name(strategy)));
        out.check(names.iter().map(String::as_str))?;
    }
    Ok(out)
}

/// Turns off the cache of NVIDIA's compiler, since this compiler prints the number of registers only when it compiles a
/// program, not when it takes the program from its cache. Leaves the cache unchanged if the user has set the
/// environment variable that controls it.
fn disable_caches() {
    if std::env::var_os(CACHE_DISABLE).is_none() {
        // SAFETY: no driver is loaded yet. The only other threads are rayon's, which wait for work and do not read the
        // environment.
        unsafe { std::env::set_var(CACHE_DISABLE, "1") };
    }
}

/// The names and contents of the files of a strategy's folder, except `made.json` and the page [`MICROSCOPE`].
type Files = Vec<(&'static str, Vec<u8>)>;

fn compile(
    args: &Args,
    device: &Device,
    session: &mut Session,
    strategy: &Strategy,
) -> Result<(Compilation, Files)> {
    let refused = |refused: Refused| refused.into_error(&device.info);
    let usual = strategy.local_size(&device.info.limits, [8, 8]);
    let prepared = match args.local_size {
        Some(local_size) => session.prepare(strategy, IMAGE_SIZE, local_size),
        None => session.prepare_fitting(strategy, IMAGE_SIZE, usual),
    };
    let prepared = prepared.map_err(refused)?;
    let caster = prepared.caster().map_err(refused)?;
    let (spec, program) = (&prepared.spec, &prepared.program);
    let (log, ptx) = (program.log(), program.ptx());
    let kernels = prepared.made(&caster, &log, &ptx);
    let needs = Requirements::of(strategy, &prepared.workload, session.builtins().lanes);
    let looks = args.out.is_some() || args.json;
    let binary = match looks {
        false => Vec::new(),
        true if is_pocl(&device.info.platform) => binary_of_frame(program, &caster),
        true => program.binary(),
    };
    let microscope = looks.then(|| Microscope::of(&prepared, &caster, &binary, &kernels));
    let binary_is_ptx = !ptx.is_empty() || is_ptx(&binary);
    let made = Compilation {
        device: device.info.label.clone(),
        strategy: strategy.to_string(),
        local_size: prepared.workload.local_size,
        program_hash: spec.hash(),
        build_ms: program.build_ms,
        binary_is_ptx,
        cl_dir: args.cl_dir.clone(),
        reports_local: reports_local(&kernels, needs.local_bytes),
        kernels,
        microscope,
    };
    let files = vec![
        ("source.cl", spec.source.clone().into_bytes()),
        ("options.txt", format!("{}\n", spec.options).into_bytes()),
        ("build.log", format!("{log}\n").into_bytes()),
        (binary_name(binary_is_ptx), binary),
    ];
    Ok((made, files))
}

/// Returns false if the strategy needs `__local` memory (`needed_bytes` bytes), but the driver reports 0 bytes, or no
/// number, for every kernel. Some versions of PoCL, such as 6.0, report 0 bytes for every kernel.
fn reports_local(kernels: &[CompiledKernel], needed_bytes: u64) -> bool {
    needed_bytes == 0 || kernels.iter().any(|kernel| kernel.group_local_bytes() > 0)
}

/// Returns the name of the file of a program's binary.
fn binary_name(is_ptx: bool) -> &'static str {
    if is_ptx { "binary.ptx" } else { "binary.bin" }
}

/// Writes the files of a strategy's folder. After writing, removes the files of an earlier program from the
/// strategy's folder if the new program does not have such files. For example, a program has only one of the
/// files `binary.ptx` and `binary.bin`.
fn keep(out: &mut OutFolder, strategy: &str, made: &Compilation, mut files: Files) -> Result<()> {
    let text = serde_json::to_string_pretty(made).map_err(|error| Error::fault(error.to_string()))?;
    files.push(("made.json", format!("{text}\n").into_bytes()));
    files.extend(page(strategy, made)?.map(|page| (MICROSCOPE, page.into_bytes())));
    let folder = folder_name(strategy);
    let path = |name: &str| format!("{folder}/{name}");
    let files: Vec<_> = files.into_iter().map(|(name, bytes)| (path(name), bytes)).collect();
    out.write(&files)?;
    let is_written = |name: &str| files.iter().any(|(written, _)| written == name);
    out.remove_listed(|name| FILES.iter().any(|file| path(file) == name) && !is_written(name))
}

/// Returns the page that shows the source beside the instructions. Returns `None` if `made.microscope` is
/// `None`.
fn page(strategy: &str, made: &Compilation) -> Result<Option<String>> {
    let Some(microscope) = &made.microscope else { return Ok(None) };
    let [x, y] = made.local_size;
    let own = made.cl_dir.as_ref().map_or(String::new(), |folder| {
        format!(" Kernel files in {} replace built-in files of the same names.", folder.display())
    });
    let about = format!(
        "The program was compiled for work-groups of {x} x {y} work-items on the device {}. The strategy is {}.{own}",
        both_names(&made.device),
        made.strategy
    );
    microscope_page(strategy, &about, microscope, &made.shown_kernels()).map(Some)
}

/// Returns the name of a strategy's folder: "deferred-width-4" for "deferred,width=4".
fn folder_name(strategy: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    strategy.trim().chars().map(allowed).collect()
}

fn text_of(name: &str, made: &Compilation) -> String {
    let header =
        ["kernel", "registers", "spills B", "__local B", "largest group", "occupancy", "memory instructions"];
    let mut table = super::table(&header, 1);
    let number = |value: Option<u64>| value.map_or("-".to_owned(), |value| value.to_string());
    for kernel in made.shown_kernels() {
        table.add_row([
            kernel.name.clone(),
            number(kernel.resources.registers.map(u64::from)),
            number(kernel.resources.spill_store_bytes),
            number(kernel.known_local_bytes()),
            number(kernel.work_group_size),
            kernel.occupancy.map_or("-".to_owned(), |part| format!("{:.0}%", 100.0 * part)),
            kernel.instruction_counts.as_ref().map_or("not PTX".to_owned(), |counts| counts.to_string()),
        ]);
    }
    let [x, y] = made.local_size;
    let notes = made.microscope.iter().flat_map(|microscope| &microscope.notes);
    let notes: String = notes.map(|note| format!("\nNote: {note}")).collect();
    format!(
        "{name} at local size {x} x {y} on {}, built in {:.0} ms\n{table}{notes}",
        both_names(&made.device),
        made.build_ms
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::compiled::Resources;

    #[test]
    fn programs_that_fail_are_named_and_only_mistakes_count_as_the_users() {
        assert!(refuse_not_compiled(&[], 2).is_ok());
        for (failed, code, message) in [
            (&[("naive", 2)][..], 2, "1 of 3 programs was not compiled: naive"),
            (&[("naive", 2), ("bvh", 1)], 1, "2 of 3 programs were not compiled: naive, bvh"),
        ] {
            let error = refuse_not_compiled(failed, 3).unwrap_err();
            assert_eq!((error.exit_code(), error.to_string().as_str()), (code, message));
        }
    }

    fn compilation(device: &str) -> Compilation {
        Compilation {
            device: device.to_owned(),
            strategy: "a strategy".to_owned(),
            local_size: [8, 8],
            program_hash: String::new(),
            build_ms: 1.0,
            binary_is_ptx: false,
            cl_dir: None,
            reports_local: true,
            kernels: Vec::new(),
            microscope: None,
        }
    }

    #[test]
    fn the_table_names_the_device_so_that_it_differs_from_others_of_its_common_name() {
        let table = text_of("naive", &compilation("basic-Intel(R) Xeon(R) Processor"));
        let head = "naive at local size 8 x 8 on Intel Xeon, PoCL (basic-Intel(R) Xeon(R) Processor), built";
        assert!(table.starts_with(head), "{table}");
        let table = text_of("naive", &compilation("NVIDIA H200"));
        assert!(table.starts_with("naive at local size 8 x 8 on NVIDIA H200, built"), "{table}");
    }

    #[test]
    fn the_row_of_a_kernel_has_its_resources_in_their_columns() {
        let resources = Resources {
            registers: Some(40),
            spill_store_bytes: Some(12),
            spill_load_bytes: Some(16),
            ..Resources::default()
        };
        let kernel = CompiledKernel {
            name: "k".into(),
            work_group_size: Some(256),
            local_bytes: Some(64),
            resources,
            occupancy: Some(0.5),
            ..CompiledKernel::default()
        };
        let cells = |reports_local| {
            let kernels = vec![kernel.clone()];
            let table = text_of("naive", &Compilation { kernels, reports_local, ..compilation("a device") });
            let row = table.lines().find(|line| line.starts_with("│ k ")).unwrap_or_default();
            let cells = row.split(['│', '┆']).map(str::trim).filter(|cell| !cell.is_empty());
            cells.map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(cells(true), ["k", "40", "12", "64", "256", "50%", "not PTX"]);
        assert_eq!(cells(false), ["k", "40", "12", "-", "256", "50%", "not PTX"]);
    }

    #[test]
    fn a_driver_that_says_0_of_all_kernels_of_a_strategy_with_local_memory_does_not_report_it() {
        let kernels = |bytes: [Option<u64>; 2]| {
            bytes.map(|local_bytes| CompiledKernel { local_bytes, ..CompiledKernel::default() })
        };
        for (bytes, needed_bytes, expected) in [
            ([Some(0), Some(0)], 6912, false),
            ([Some(0), None], 6912, false),
            ([Some(0), Some(6912)], 6912, true),
            ([Some(0), Some(0)], 0, true),
        ] {
            assert_eq!(reports_local(&kernels(bytes), needed_bytes), expected, "{bytes:?} {needed_bytes}");
        }
    }

    #[test]
    fn the_name_of_a_strategys_folder_looks_like_no_option() {
        for strategy in ["deferred,width=4", " deferred,width=4", "deferred,width=4 "] {
            assert_eq!(folder_name(strategy), "deferred-width-4", "{strategy:?}");
        }
    }

    #[test]
    fn a_folder_has_the_binary_of_its_latest_program_only() {
        let folder = tempfile::tempdir().unwrap();
        let made = compilation("a device");
        let keep_with = |strategy: &str, binary: &'static str| {
            let mut out = OutFolder::open(folder.path(), Choice::new(false, "--out DIR")).unwrap();
            keep(&mut out, strategy, &made, vec![(binary, b"a program".to_vec())]).unwrap();
        };
        keep_with("naive", "binary.ptx");
        keep_with("deferred", "binary.ptx");
        std::fs::write(folder.path().join("naive/notes.txt"), "mine").unwrap();
        keep_with("naive", "binary.bin");
        let is_there = |name: &str| folder.path().join(name).is_file();
        assert!(is_there("naive/binary.bin") && !is_there("naive/binary.ptx"));
        for file in ["naive/made.json", "naive/notes.txt", "deferred/binary.ptx"] {
            assert!(is_there(file), "{file}");
        }
    }

    #[test]
    fn only_files_of_another_program_or_device_are_said_to_be_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let of =
            |hash: &str, device: &str| Compilation { program_hash: hash.to_owned(), ..compilation(device) };
        let told = |strategy: &str, made: &Compilation| replaced(folder.path(), strategy, made);
        let first = of("a", "a device");
        assert_eq!(told("naive", &first), None);
        let mut out = OutFolder::open(folder.path(), Choice::new(false, "--out DIR")).unwrap();
        keep(&mut out, "naive", &first, Vec::new()).unwrap();
        assert_eq!(told("naive", &first), None);
        let naive = folder.path().join("naive");
        let line = format!("Replaced the files of another program in {}", naive.display());
        for other in [of("b", "a device"), of("a", "another device")] {
            assert_eq!(told("naive", &other).as_ref(), Some(&line));
            assert_eq!(told("deferred", &other), None);
        }
    }

    #[test]
    fn the_page_names_the_folder_of_ones_own_kernels() {
        let page_of = |cl_dir: Option<&str>| {
            let microscope = Some(Microscope::default());
            let made =
                Compilation { microscope, cl_dir: cl_dir.map(PathBuf::from), ..compilation("a device") };
            page("naive", &made).unwrap().unwrap()
        };
        let said =
            "The strategy is a strategy. Kernel files in mine replace built-in files of the same names.";
        assert!(page_of(Some("mine")).contains(said));
        assert!(page_of(None).contains("The strategy is a strategy.</p>"));
    }

    #[test]
    fn the_name_of_a_binary_says_whether_it_is_ptx_and_is_one_of_the_folders_names() {
        let names = [true, false].map(binary_name);
        assert_eq!(names, ["binary.ptx", "binary.bin"]);
        assert!(names.iter().all(|name| FILES.contains(name)));
    }

    #[test]
    fn the_folder_is_named_only_if_a_program_was_written_and_no_json_is_printed() {
        let out = Some(Path::new("made"));
        assert_eq!(written(out, false, 1).as_deref(), Some("Written to made"));
        assert_eq!(
            [written(out, false, 0), written(out, true, 1), written(None, false, 1)],
            [None, None, None]
        );
    }
}
