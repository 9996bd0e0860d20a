//! `raycl devices`: lists the OpenCL platforms, and the devices with their limits.

use serde::Serialize;

use super::choice::usual_device_index;
use crate::device::{self, DeviceInfo, Survey, common_name};
use crate::error::Result;
use crate::settings;
use crate::sources::Sources;

/// Arguments of `raycl devices`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl devices
  raycl devices --json | jq '.devices[].limits.local_bytes'

To select a device in other commands, give part of its name, platform or vendor, or its kind (cpu, gpu, accelerator): `raycl render SCENE --device pocl`. If several devices have the same name, the table shows a label for each of them, as `--device LABEL`. A complete label selects only the device that has this label.")]
pub struct Args {
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Lists the devices. Fails if there is no OpenCL platform.
pub fn run(args: Args) -> Result<()> {
    let Survey { devices, empty_platforms, failed_platforms } = device::survey(&Sources::Embedded)?;
    let infos: Vec<DeviceInfo> = devices.into_iter().map(|device| device.info).collect();
    let default = usual_device_index(&infos);
    let without_devices = [&empty_platforms[..], &failed_platforms[..]];
    if args.json {
        return super::print_json(&listing(&infos, without_devices, default.ok().flatten()));
    }
    super::print(text(&infos, without_devices) + &by_default(&infos, default, settings::device_origin()))
}

#[derive(Serialize)]
struct Listing<'a> {
    devices: Vec<Row<'a>>,
    empty_platforms: &'a [String],
    /// The platforms whose drivers failed to list their devices, each with the reason.
    failed_platforms: &'a [String],
    /// The slug (the name for use in file names) of the device on which commands cast if no option names a
    /// device. Null if there is no such device.
    default: Option<String>,
}

#[derive(Serialize)]
struct Row<'a> {
    slug: String,
    #[serde(flatten)]
    info: &'a DeviceInfo,
}

fn listing<'a>(
    infos: &'a [DeviceInfo],
    [empty_platforms, failed_platforms]: [&'a [String]; 2],
    default: Option<usize>,
) -> Listing<'a> {
    let devices = infos.iter().map(|info| Row { slug: info.slug(), info }).collect();
    let default = default.map(|index| infos[index].slug());
    Listing { devices, empty_platforms, failed_platforms, default }
}

const HEADER: [&str; 9] = [
    "device\nthe driver's name for it\nplatform, driver",
    "kind",
    "compute\nunits",
    "threads",
    "__local\nKiB",
    "__constant\nKiB",
    "global\nGiB",
    "work-group\nsize",
    "native\nvector\nwidth",
];

/// Returns the table of devices, and a line for each unusable device, each platform without devices, and each platform
/// whose driver failed to list its devices. If PoCL lists no device, the text may also give advice.
fn text(infos: &[DeviceInfo], [empty_platforms, failed_platforms]: [&[String]; 2]) -> String {
    let mut text = String::new();
    if !infos.is_empty() {
        let mut table = super::table(&HEADER, 2);
        for info in infos {
            table.add_row(cells(info));
        }
        text += &table.to_string();
    }
    for info in infos {
        if let Some(reason) = &info.unusable {
            text += &format!("\nUnusable: {} ({}): {reason}.", info.name, info.platform);
        }
    }
    for platform in empty_platforms {
        text += &format!("\nThis platform has no device: {platform}.");
    }
    for platform in failed_platforms {
        text += &format!("\nThe devices of this platform could not be listed: {platform}.");
    }
    if let Some(advice) = device::no_device_advice(empty_platforms) {
        text += &format!("\nNote: {advice}.");
    }
    text
}

/// Returns the line that says on which device commands cast if no option names a device, or why they cast on no device.
/// `origin` is the place where the user names the device for such commands: the environment variable `RAYCL_DEVICE` or
/// the settings file. `origin` is `None` if the user names no device there.
fn by_default(infos: &[DeviceInfo], default: Result<Option<usize>>, origin: Option<&str>) -> String {
    match default {
        Ok(Some(index)) => {
            let named = origin.map(|origin| format!(" (named by {origin})")).unwrap_or_default();
            format!("\nBy default, raycl casts on {}{named}.", infos[index].describe())
        }
        Err(error) if infos.iter().any(|info| info.unusable.is_none()) => {
            format!("\nWithout --device, raycl does not cast: {}.", error.in_a_line())
        }
        _ => "\nNo device on this machine can be used.".to_owned(),
    }
}

fn cells(info: &DeviceInfo) -> Vec<String> {
    let limits = &info.limits;
    let mark = if info.unusable.is_some() { " (unusable)" } else { "" };
    let label = info.own_label().map(|label| format!("\n--device {label}")).unwrap_or_default();
    let of_driver =
        if common_name(&info.name) == info.name { String::new() } else { format!("\n{}", info.name) };
    vec![
        format!("{}{mark}{of_driver}\n{}, {}{label}", common_name(&info.name), info.platform, info.driver),
        info.kind.name().to_owned(),
        limits.compute_units.to_string(),
        info.threads.map_or(String::new(), |threads| threads.to_string()),
        (limits.local_bytes / 1024).to_string(),
        (limits.constant_bytes / 1024).to_string(),
        format!("{:.1}", limits.global_bytes as f64 / f64::from(1 << 30)),
        limits.work_group_size.to_string(),
        limits.native_width.to_string(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::DeviceKind;
    use crate::device::tests::example;
    use crate::error::Error;

    #[test]
    fn an_unusable_device_is_listed_with_its_reason() {
        let mut relic = example("Old Platform", "relic", DeviceKind::Other, 1);
        relic.unusable = Some("its driver has no compiler for OpenCL C".into());
        let cpu = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let broken = ["Broken: clGetDeviceIDs returned CL_OUT_OF_HOST_MEMORY (-6)".to_owned()];
        let text = text(&[cpu, relic], [&["Hollow".into()], &broken]);
        let hollow = "This platform has no device: Hollow";
        let could_not = "could not be listed: Broken: clGetDeviceIDs returned CL_OUT_OF_HOST_MEMORY (-6).";
        for part in ["relic (unusable)", "no compiler", hollow, could_not] {
            assert!(text.contains(part), "{text}");
        }
        assert!(text.contains("       2 "), "the number of compute units is not right-aligned: {text}");
    }

    #[test]
    fn the_default_is_reported_with_what_names_it_or_why_there_is_none() {
        let mut infos = [example("PoCL", "cpu", DeviceKind::Cpu, 2)];
        let casts = |origin| by_default(&infos, Ok(Some(0)), origin);
        assert!(casts(None).starts_with("\nBy default, raycl casts on cpu (PoCL, "), "{}", casts(None));
        assert!(casts(Some("RAYCL_DEVICE")).ends_with(" KiB __local (named by RAYCL_DEVICE)."));
        let refused = || Err(Error::input("no device matches 'x'"));
        assert!(by_default(&infos, refused(), None).ends_with("does not cast: no device matches 'x'."));
        infos[0].unusable = Some("its driver is old".into());
        for default in [Ok(None), refused()] {
            assert_eq!(by_default(&infos, default, None), "\nNo device on this machine can be used.");
        }
    }

    #[test]
    fn equal_devices_have_labels_that_tell_them_apart() {
        let mut twin = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        assert_eq!(cells(&twin)[0], "cpu\nPoCL, 3.1");
        twin.label = "pocl-cpu-2".into();
        assert_eq!(cells(&twin)[0], "cpu\nPoCL, 3.1\n--device pocl-cpu-2");
    }

    #[test]
    fn local_and_constant_memory_have_columns_of_their_own() {
        let cells = cells(&example("PoCL", "cpu", DeviceKind::Cpu, 2));
        assert_eq!(cells[4..6], ["48", "64"]);
    }

    #[test]
    fn the_largest_work_group_and_the_width_of_vectors_have_columns_of_their_own() {
        let cells = cells(&example("PoCL", "cpu", DeviceKind::Cpu, 2));
        assert_eq!(cells[7..], ["1024", "1"]);
    }

    #[test]
    fn global_memory_is_in_gib() {
        let cpu = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        assert_eq!(cpu.limits.global_bytes, 1 << 33);
        assert_eq!(cells(&cpu)[6], "8.0");
    }

    #[test]
    fn json_names_units_and_limits() {
        let cpu = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let json = serde_json::to_value(listing(&[cpu], [&[], &[]], Some(0))).unwrap();
        assert_eq!(json["devices"][0]["limits"]["local_bytes"], 49152);
        assert_eq!(json["devices"][0]["kind"], "cpu");
        assert_eq!(json["default"], json["devices"][0]["slug"]);
        assert!(json["devices"][0]["unusable"].is_null());
    }

    #[test]
    fn json_tells_platforms_without_devices_from_those_that_failed() {
        let [empty, failed] = ["Hollow", "Broken: a reason"].map(|platform| [platform.to_owned()]);
        let json = serde_json::to_value(listing(&[], [&empty, &failed], None)).unwrap();
        assert_eq!(json["empty_platforms"], serde_json::json!(empty));
        assert_eq!(json["failed_platforms"], serde_json::json!(failed));
        assert!(json["default"].is_null());
    }
}
