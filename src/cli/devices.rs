//! `raycl devices`: lists every OpenCL platform and device, with its limits.

use serde::Serialize;

use crate::device::{self, Device, DeviceInfo, Survey};
use crate::error::Result;
use crate::sources::Sources;

/// Arguments of `raycl devices`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl devices
  raycl devices --json | jq '.devices[].limits.local_bytes'

To select a device in other commands, give part of its name, platform or vendor, or its kind (cpu, gpu): `raycl render SCENE --device pocl`.")]
pub struct Args {
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Lists the devices. It is an error if there is no platform.
pub fn run(args: Args) -> Result<()> {
    let Survey { devices, empty_platforms } = device::survey(&Sources::Embedded)?;
    let default = device::pick_default(&devices).map(|device| device.info.slug());
    let infos: Vec<_> = devices.iter().map(|Device { info, .. }| info).collect();
    if args.json {
        return super::print_json(&listing(&infos, &empty_platforms, default));
    }
    super::print(text(&infos, &empty_platforms, default.as_deref()))
}

#[derive(Serialize)]
struct Listing<'a> {
    devices: Vec<Row<'a>>,
    empty_platforms: &'a [String],
    default: Option<String>,
}

#[derive(Serialize)]
struct Row<'a> {
    slug: String,
    #[serde(flatten)]
    info: &'a DeviceInfo,
}

fn listing<'a>(
    infos: &[&'a DeviceInfo],
    empty_platforms: &'a [String],
    default: Option<String>,
) -> Listing<'a> {
    let devices = infos.iter().map(|&info| Row { slug: info.slug(), info }).collect();
    Listing { devices, empty_platforms, default }
}

const HEADER: [&str; 9] = [
    "device\nplatform, driver",
    "kind",
    "compute\nunits",
    "threads",
    "__local\nKiB",
    "__constant\nKiB",
    "global\nGiB",
    "work-group\nsize",
    "native\nvector\nwidth",
];

fn text(infos: &[&DeviceInfo], empty_platforms: &[String], default: Option<&str>) -> String {
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
    if let Some(advice) = device::cache_advice().filter(|_| !empty_platforms.is_empty()) {
        text += &format!("\nNote: {advice}.");
    }
    text + &match infos.iter().find(|info| Some(info.slug().as_str()) == default) {
        Some(info) => format!("\nBy default, raycl casts on {}.", info.describe()),
        None => "\nNo device on this machine can be used.".to_owned(),
    }
}

fn cells(info: &DeviceInfo) -> Vec<String> {
    let limits = &info.limits;
    let mark = if info.unusable.is_some() { " (unusable)" } else { "" };
    vec![
        format!("{}{mark}\n{}, {}", info.name, info.platform, info.driver),
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

    #[test]
    fn an_unusable_device_is_listed_with_its_reason() {
        let mut relic = example("Old Platform", "relic", DeviceKind::Other, 1);
        relic.unusable = Some("its driver has no compiler for OpenCL C".into());
        let cpu = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let slug = cpu.slug();
        let text = text(&[&cpu, &relic], &["Hollow".into()], Some(&slug));
        for part in ["relic (unusable)", "no compiler", "This platform has no device: Hollow", "casts on cpu"]
        {
            assert!(text.contains(part), "{text}");
        }
        assert!(text.contains("       2 "), "the number of compute units is not right-aligned: {text}");
    }

    #[test]
    fn local_and_constant_memory_have_columns_of_their_own() {
        let cells = cells(&example("PoCL", "cpu", DeviceKind::Cpu, 2));
        assert_eq!(cells[4..6], ["48", "64"]);
    }

    #[test]
    fn json_names_units_and_limits() {
        let cpu = example("PoCL", "cpu", DeviceKind::Cpu, 2);
        let json = serde_json::to_value(listing(&[&cpu], &[], Some(cpu.slug()))).unwrap();
        assert_eq!(json["devices"][0]["limits"]["local_bytes"], 49152);
        assert_eq!(json["devices"][0]["kind"], "cpu");
        assert_eq!(json["default"], json["devices"][0]["slug"]);
        assert!(json["devices"][0]["unusable"].is_null());
    }
}
