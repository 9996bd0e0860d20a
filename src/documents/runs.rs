//! Generates a table that shows where the stored records come from: each folder's device, date, program and
//! command.

use super::sheet::line;
use super::sources::Sources;
use crate::device::common_name;
use serde_json::Value;

/// Returns the lines of a Markdown table about folders of records: the heading, then one row per folder.
pub fn runs(sources: &Sources, names: &[String]) -> Result<Vec<String>, String> {
    let heads = ["records", "device, driver", "begun (UTC)", "program", "command"];
    let mut lines = vec![line(heads.into_iter()), format!("|{}", "---|".repeat(heads.len()))];
    for name in names {
        let environment = sources.folder(name)?.environment;
        let text = |key: &str| environment[key].as_str().unwrap_or("not recorded").to_owned();
        let started = text("started");
        let begun = started.get(..16).unwrap_or(&started).replace('T', " ");
        let (name, command) = (format!("`{name}`"), command(&environment));
        let cells = [name, devices(&environment), begun, text("git_revision"), command];
        lines.push(line(cells.iter().map(String::as_str)));
    }
    Ok(lines)
}

fn devices(environment: &Value) -> String {
    let devices = environment["devices"].as_array().map_or(&[][..], Vec::as_slice);
    let described = |device: &Value| {
        let [name, driver] = ["device", "driver"].map(|key| device[key].as_str().unwrap_or("?").to_owned());
        format!("{}, driver {driver}", common_name(&name))
    };
    devices.iter().map(described).collect::<Vec<_>>().join("; ")
}

/// Returns the command line without the program's own path, which depends on the machine.
fn command(environment: &Value) -> String {
    let words = environment["command_line"].as_array().map_or(&[][..], Vec::as_slice);
    let words = words.iter().skip(1).filter_map(Value::as_str).map(crate::words::quote);
    format!("`raycl {}`", words.collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_command_has_no_path_of_the_program_and_is_quoted_for_a_shell() {
        let environment = json!({ "command_line": ["/home/me/raycl", "run", "my configs/a.toml"] });
        assert_eq!(command(&environment), "`raycl run 'my configs/a.toml'`");
    }
}
