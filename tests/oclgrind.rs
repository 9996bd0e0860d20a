//! Kernels in Oclgrind, which simulates every work-item: there must be no data race, no access out of bounds, and no
//! read of memory that was never written. `make test` installs Oclgrind; without it, these tests fail.

use crate::binary::until;
use crate::common::apart::MARK;
use crate::common::cover::pairwise_cover;
use crate::common::{is_long, scene};
use raycl::program::Sources;
use raycl::strategy::{Copied, Culling, Intersector, PRESETS, Strategy, Traversal, Width, preset};
use std::cell::RefCell;
use std::path::Path;
use std::process::{Command, Stdio};

/// Kernels are compiled without optimisation, since Oclgrind 21.10 does not know an intrinsic that optimised code uses.
const OPTIONS: &str = "-cl-opt-disable";
/// With one of these two options, Oclgrind also looks for a kind of fault other than accesses out of bounds.
const RACES: &str = "--data-races";
const UNINITIALISED: &str = "--uninitialized";
/// The width and height of pictures in pixels, unless a test sets another width and height.
const SIZE: [&str; 2] = ["18", "11"];

fn spelled(strategy: &Strategy) -> String {
    strategy.axes().iter().map(|(axis, value)| format!("{axis}={value}")).collect::<Vec<_>>().join(",")
}

/// The path of a scene, relative to scenes/. The scene has more triangles than a tile of triangles in __local
/// memory holds, but __local memory as a whole has room for all of them.
const TILES: &str = "../tests/data/tiles.toml";

/// A picture of a scene cast under Oclgrind, and compared with the reference.
struct Simulation<'a> {
    size: [&'a str; 2],
    /// The path of the scene, relative to scenes/.
    scene: &'a str,
    strategy: &'a Strategy,
    local: &'a str,
    /// More arguments of `raycl render`.
    options: &'a [&'a str],
    plugin: &'a str,
    /// A folder of kernel files that replace built-in files.
    cl: Option<&'a Path>,
}

impl Simulation<'_> {
    /// Returns the command that casts the picture. The command writes the picture and Oclgrind's log to
    /// `folder`.
    fn command(&self, folder: &Path) -> Command {
        let [width, height] = self.size;
        let mut command = Command::new("oclgrind");
        command.env("OCLGRIND_BUILD_OPTIONS", OPTIONS).args([self.plugin, "--log"]).arg(folder.join("log"));
        command.arg(env!("CARGO_BIN_EXE_raycl")).arg("render");
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(self.scene));
        // In Oclgrind, a work-group that shares a tile must have 32 work-items, which exchange data by barriers.
        let local = if self.strategy.shares_tiles() { "32x1" } else { self.local };
        command.args(["--device", "oclgrind", "--width", width, "--height", height, "--quiet", "--verify"]);
        command.args(["--strategy", &spelled(self.strategy), "--local-size", local, "--output"]);
        command.arg(folder.join("picture.png")).args(self.options);
        if let Some(cl) = self.cl {
            command.arg("--cl-dir").arg(cl);
        }
        command
    }

    /// Returns all reports of Oclgrind, as `reports_of` does.
    fn reports(&self) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        reports_of(&mut self.command(folder.path()), folder.path())
    }

    /// Returns true if Oclgrind reports a race. Ends the simulation at the first report, since a kernel
    /// without one of its barriers may never end.
    fn has_race(&self) -> bool {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = self.command(folder.path());
        let command = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let simulated = RefCell::new(command.spawn().expect("oclgrind"));
        let log = folder.path().join("log");
        let reported = || std::fs::read_to_string(&log).is_ok_and(|log| log.contains("race"));
        until("a race is reported or the simulation has ended", || {
            reported() || simulated.borrow_mut().try_wait().expect("a process").is_some()
        });
        let mut simulated = simulated.into_inner();
        // The process may have ended already.
        let _ = simulated.kill();
        simulated.wait().expect("a process");
        reported()
    }
}

/// Returns all reports of Oclgrind about a command that writes its log to `folder`, and the message of a command that
/// fails. A command also fails if its strategy does not fit on the simulated device (32 KiB of `__local` memory), or if
/// its program does not build. Such failures are reported, too, since `make test` casts many strategies nowhere else.
fn reports_of(command: &mut Command, folder: &Path) -> String {
    let output = crate::binary::run(command);
    // Oclgrind exits with the program's exit code, so only the log shows its reports.
    let logged = std::fs::read_to_string(folder.join("log")).unwrap_or_default();
    if output.status.success() {
        return logged;
    }
    format!("{logged}{}: {}", output.status, String::from_utf8_lossy(&output.stderr))
}

/// Casts a picture under Oclgrind with each strategy. Panics with a list of the strategies for which Oclgrind reports a
/// fault, or with which raycl casts no picture.
fn all_clean(scene: &str, strategies: &[Strategy], local: &str, plugin: &str) {
    all_clean_at(SIZE, scene, strategies, local, plugin);
}

/// Casts pictures under Oclgrind and reports faults, like `all_clean`, but with this width and height.
fn all_clean_at(size: [&str; 2], scene: &str, strategies: &[Strategy], local: &str, plugin: &str) {
    all_clean_with(&[], size, scene, strategies, local, plugin);
}

/// Casts pictures under Oclgrind and reports faults, like `all_clean_at`, but with more arguments of the
/// command `raycl render`.
fn all_clean_with(
    options: &[&str],
    size: [&str; 2],
    scene: &str,
    strategies: &[Strategy],
    local: &str,
    plugin: &str,
) {
    assert!(!strategies.is_empty(), "no strategy for {scene}");
    let mut wrong = Vec::new();
    for strategy in strategies {
        let report = Simulation { size, scene, strategy, local, options, plugin, cl: None }.reports();
        if !report.is_empty() {
            let start: String = report.chars().take(600).collect();
            wrong.push(format!("{strategy} at {local}: {start}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), strategies.len(), wrong.join("\n"));
    eprintln!("{} strategies with {plugin}: 0 reports", strategies.len());
}

fn presets() -> Vec<Strategy> {
    PRESETS.iter().map(|preset| preset.strategy).collect()
}

#[test]
fn presets_have_no_race_and_stay_in_bounds() {
    // The work-groups have 3 x 2 work-items, and their height does not divide the image's height.
    all_clean("pyramid-lower.toml", &presets(), "3x2", RACES);
}

/// `make test` runs only the presets that hold triangles in __local memory.
#[test]
fn presets_have_no_race_with_more_triangles_than_a_tile_holds() {
    let triangles = scene(TILES).mesh.triangles.len();
    assert!((257..=275).contains(&triangles), "{triangles}");
    let all: Vec<_> =
        presets().into_iter().filter(|s| is_long() || s.triangles.copied() != Copied::Nothing).collect();
    all_clean_at(["9", "6"], TILES, &all, "4x4", RACES);
}

/// The work-groups of this picture have no work-item outside the picture. In the heap (the buffer from which
/// work-items allocate working vectors), each vector therefore belongs to a pixel, even the last one.
#[test]
fn the_last_vector_in_the_heap_has_memory_of_its_own() {
    let naive = preset("naive").expect("a preset").strategy;
    all_clean_at(["18", "12"], "pyramid-lower.toml", &[naive], "3x2", RACES);
}

/// Returns the presets whose work-items share tiles.
fn presets_that_share_tiles() -> Vec<Strategy> {
    let shared: Vec<_> = presets().into_iter().filter(Strategy::shares_tiles).collect();
    assert_eq!(shared.len(), 2);
    shared
}

/// PoCL takes half a minute to compile each of these strategies, so that only `make test-long` casts this scene on PoCL
/// with them (tests/near.rs).
#[test]
fn tiles_that_work_items_share_show_nothing_nearer_than_the_near_plane() {
    all_clean("../tests/data/near.toml", &presets_that_share_tiles(), "32x1", RACES);
}

/// In this scene, a light is nearer to a wall than the shadow bias, so it does not reach the nearest part of
/// the wall. One pixel of the picture shows a point that is nearer to the light than half the bias. The
/// reference is therefore certain that this pixel is dark.
#[test]
fn tiles_that_work_items_share_leave_dark_what_is_nearer_to_a_light_than_the_bias() {
    all_clean_at(["19", "10"], "../tests/data/lights.toml", &presets_that_share_tiles(), "32x1", RACES);
}

/// Tiles test a shadow ray from the light to the hit. With culling, however, a triangle blocks the light only
/// if a ray from the hit to the light would meet the triangle's front. Tiles that work-items share cast some
/// of the shadow rays of this scene one by one.
#[test]
fn backs_stop_no_shadow_rays_of_tiles_if_backs_are_culled() {
    let culled = [
        ("tile", Intersector::WATERTIGHT),
        ("tile-group", Intersector::WATERTIGHT),
        ("tile-group", Intersector::EDGE_PLANES),
        ("tile-group", Intersector::COMMON_ORIGIN),
    ];
    let culled = culled.map(|(name, intersector)| {
        let usual = preset(name).expect("a preset").strategy;
        Strategy { intersector, culling: Culling::Back, ..usual }
    });
    all_clean("../tests/data/blinds.toml", &culled, "1x1", RACES);
}

/// Neighbouring triangles overlap by about a rounding error, so that no ray slips between them. Such an
/// overlap of triangles must not lengthen a needle (a long, narrow triangle) beyond its short edge. In the
/// picture of this test, the centre of a pixel is a third of a pixel beyond the needle's short edge.
#[test]
fn tiles_that_work_items_share_make_a_needle_no_longer() {
    let usual = preset("tile-group").expect("a preset").strategy;
    let planes = Strategy { intersector: Intersector::EDGE_PLANES, ..usual };
    all_clean_at(["61", "43"], "../tests/data/needle.toml", &[planes], "32x1", RACES);
}

/// In a picture whose width is a multiple of four pixels, `tile` stores four pixels of a row at a time. The last blocks
/// of this picture extend below it, where nothing may be stored.
#[test]
fn tiles_store_nothing_below_a_picture_whose_rows_are_whole_blocks() {
    let tile = preset("tile").expect("a preset").strategy;
    all_clean_at(["16", "11"], "pyramid-lower.toml", &[tile], "1x1", RACES);
}

/// The scenes of all other tests in this file need no code for soft light, several samples, pictures of skies
/// or textures. Blocks of samples fit exactly into the first picture of this test, and extend beyond the
/// second picture. Soft light at half resolution is left out: the compiler makes its kernels call a function of LLVM
/// that Oclgrind does not have.
#[test]
fn code_that_plain_scenes_do_not_need_has_no_race_and_stays_in_bounds() {
    let adaptive = ["--samples", "4", "--adaptive", "--set", "light.0.radius=0.5"];
    // With this narrow field of view, pixels are so small that most of them are shaded once for all of their samples.
    // Some of these pixels are partly in shadow.
    let once = ["--samples", "13", "--set", "camera.fov_x_degrees=1"];
    for (name, scene, size, options) in [
        ("tile", "pyramid-lower.toml", ["16", "12"], &adaptive[..]),
        ("tile", "pyramid-lower.toml", ["15", "11"], &adaptive[..]),
        ("tile", "pyramid-lower.toml", ["9", "5"], &once[..]),
        ("bvh", "../tests/data/mirrors.toml", ["9", "6"], &["--samples", "2"][..]),
        ("tile", "../tests/data/stripes.toml", ["9", "6"], &[][..]),
    ] {
        let strategy = preset(name).expect("a preset").strategy;
        all_clean_with(options, size, scene, &[strategy], "1x1", RACES);
    }
}

/// No command of the binary casts rays from a buffer, so Oclgrind runs a test of tests/watertight.rs that casts such
/// rays. Some work-items of this test have no ray, and must not write behind the results.
#[test]
fn rays_from_a_buffer_stay_in_bounds() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let mut command = Command::new("oclgrind");
    command.args(["--build-options", OPTIONS, RACES, "--log"]).arg(&log);
    command.arg(std::env::current_exe().expect("the path of this program"));
    command.args(["watertight::rays_beside_an_edge_miss", "--exact"]).env(MARK, "1");
    command.env("RAYCL_TEST_DEVICE", "oclgrind").env("RAYCL_CACHE_MIB", "0");
    let output = crate::binary::run(&mut command);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("test result: ok. 1 passed"), "{said}");
    assert_eq!(std::fs::read_to_string(&log).unwrap_or_default(), "");
}

#[test]
fn presets_of_one_ray_read_nothing_unwritten() {
    // When Oclgrind looks for memory that was never written, it crashes on wide vectors. Oclgrind also
    // reports values that clEnqueueFillBuffer wrote, such as the rasteriser's depths, as unwritten.
    let checkable = |s: &Strategy| s.width == Width::W1 && s.traversal != Traversal::Raster;
    let narrow: Vec<_> = presets().into_iter().filter(checkable).collect();
    all_clean("pyramid-lower.toml", &narrow, "4x2", UNINITIALISED);
}

#[test]
fn a_pairwise_cover_has_no_race_and_stays_in_bounds() {
    let cover: Vec<_> =
        pairwise_cover().into_iter().enumerate().filter(in_this_run).map(|(_, s)| s).collect();
    all_clean("figure-4.toml", &cover, "4x2", RACES);
}

/// Returns true if this run tests `row`, a strategy of the pairwise cover (see [`pairwise_cover`]). `make test-long`
/// tests all rows. `make test` tests every row in which work-items share tiles, and the two thirds of all rows that
/// tests/kernels.rs does not verify with PoCL.
fn in_this_run((row, strategy): &(usize, Strategy)) -> bool {
    is_long() || row % 3 != 0 || strategy.shares_tiles()
}

/// Returns a copy of `cl/` in which `to` replaces `from`; at least one file must contain `from`.
fn spoiled(from: &str, to: &str) -> tempfile::TempDir {
    fn copy(source: &Path, target: &Path, from: &str, to: &str) -> usize {
        std::fs::create_dir_all(target).expect("a folder");
        let mut changed = 0;
        for entry in std::fs::read_dir(source).expect("kernels").flatten() {
            let (path, target) = (entry.path(), target.join(entry.file_name()));
            if path.is_dir() {
                changed += copy(&path, &target, from, to);
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("a kernel");
            changed += text.matches(from).count();
            std::fs::write(target, text.replace(from, to)).expect("a copy");
        }
        changed
    }
    let folder = tempfile::tempdir().expect("a folder");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("cl");
    assert!(copy(&source, folder.path(), from, to) > 0, "no kernel has '{from}'");
    folder
}

/// Returns a simulation of `strategy` with the kernel files of the folder `cl`, or with the built-in ones.
fn simulation<'a>(strategy: &'a Strategy, cl: Option<&'a Path>) -> Simulation<'a> {
    let (scene, local) = ("pyramid-lower.toml", "4x4");
    Simulation { size: SIZE, scene, strategy, local, options: &[], plugin: RACES, cl }
}

#[test]
fn a_kernel_without_its_barriers_is_reported() {
    let cl = spoiled("barrier(CLK_LOCAL_MEM_FENCE)", "(void)0");
    let tiled = preset("tiled").expect("a preset").strategy;
    let report = simulation(&tiled, Some(cl.path())).reports();
    assert!(report.contains("race"), "{report}");
}

/// A definition in the build options spoils the built-in kernels.
#[test]
fn a_program_that_does_not_build_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let naive = preset("naive").expect("a preset").strategy;
    let mut command = simulation(&naive, None).command(folder.path());
    command.env("OCLGRIND_BUILD_OPTIONS", format!("{OPTIONS} -Dfloat=unknown"));
    let report = reports_of(&mut command, folder.path());
    assert!(report.contains("the build of the kernels failed"), "{report}");
}

/// Returns every barrier of the kernels that presets use: the file, the position and the text of the call.
fn barriers() -> Vec<(&'static str, usize, &'static str)> {
    let of = |file: &'static str| {
        let text = Sources::Embedded.read(file).expect("a kernel");
        let calls = ["barrier(CLK_LOCAL_MEM_FENCE)", "lane_sync(group)"];
        let all = calls.into_iter().flat_map(|call| {
            let positions: Vec<usize> = text.match_indices(call).map(|(at, _)| at).collect();
            positions.into_iter().map(move |at| (at, call))
        });
        // Barriers of sub-groups are left out, since Oclgrind has no sub-groups.
        let known: Vec<_> = all.filter(|(at, _)| !text[..*at].ends_with("sub_group_")).collect();
        known.into_iter().map(move |(at, call)| (file, at, call))
    };
    // No preset uses the kernels of `peak`, the probe of lane operations, or the display transform. The
    // display transform is for devices with separate memory, which Oclgrind does not have.
    let of_presets =
        |file: &&str| !["peak/", "probe/", "display/"].iter().any(|folder| file.starts_with(folder));
    Sources::names().into_iter().filter(of_presets).flat_map(of).collect()
}

/// Returns a folder of kernels in which one of the barriers is missing.
fn without((file, at, call): (&str, usize, &str)) -> tempfile::TempDir {
    let mut text = Sources::Embedded.read(file).expect("a kernel");
    text.replace_range(at..at + call.len(), "(void)0");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(file);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    std::fs::write(path, text).expect("a copy");
    folder
}

/// Synchronisations of a tile's lanes that are needed, although Oclgrind does not show a race without them.
/// Each synchronisation is given by its file and the text that follows its call in the file. Oclgrind has no
/// sub-groups. In Oclgrind, lane operations therefore use `__local` memory, and the barriers inside these
/// operations order all other accesses, too. The lane operations of sub-groups exchange registers, and do not
/// order accesses to memory. Devices with sub-groups therefore need the synchronisations of this list.
const ORDERED_BY_LANE_OPERATIONS: [(&str, &str); 5] = [
    // After each of the synchronisations in this list, another synchronisation follows before the same
    // `__local` memory is used again.
    ("tile_gpu/soft.cl", "; // the stack has been read by all lanes\n    return stopped"),
    ("tile_gpu/walk.cl", ";\n    const uint nearest = lane_ballot"),
    ("tile_gpu/walk.cl", "; // all lanes have tested the previous leaf's triangles"),
    ("tile_gpu/walk.cl", "; // the stack has been read\n    return enough"),
    ("tile_gpu/walk.cl", "; // the stack has been read\n    return blocked"),
];

/// One of the barriers precedes the filling of a tile of triangles. This barrier has an effect only from the
/// second tile on, so only a scene with more triangles than a tile holds shows that the barrier is needed.
/// `make test` does not test the barriers of tiles that work-items share.
#[test]
fn each_barrier_is_needed() {
    let (mut removed, mut hidden) = (0, 0);
    for barrier in barriers() {
        let (file, at, call) = barrier;
        let text = Sources::Embedded.read(file).expect("a kernel");
        let after = &text[at + call.len()..];
        let ordered =
            ORDERED_BY_LANE_OPERATIONS.iter().any(|(of, next)| *of == file && after.starts_with(next));
        let name = match file {
            "cast/parts.cl" => "local-triangles",
            "cast/scene.cl" => "tiled",
            _ => "tile-group",
        };
        let strategy = preset(name).expect("a preset").strategy;
        if strategy.shares_tiles() && !is_long() {
            continue;
        }
        let cl = without(barrier);
        let simulation = Simulation {
            size: ["8", "4"],
            scene: TILES,
            strategy: &strategy,
            local: "4x4",
            options: &[],
            plugin: RACES,
            cl: Some(cl.path()),
        };
        assert_eq!(simulation.has_race(), !ordered, "{name} without the barrier at {at} of {file}");
        removed += usize::from(!ordered);
        hidden += usize::from(ordered);
    }
    eprintln!("{removed} barriers, each removed in turn: all reported; {hidden} hidden by lane operations");
    assert!(removed >= 3, "{removed}");
    assert!(!is_long() || hidden == ORDERED_BY_LANE_OPERATIONS.len(), "{hidden}");
}
