//! Runs an experiment and prints its fastest points:
//! `cargo run --example experiment -- configs/quick.toml results/first cpu`.

use miette::{Result, bail};
use raycl::{run_experiment, serve_if_worker};

fn main() -> Result<()> {
    // Separate processes, which also run this program, measure the points. In such a process,
    // `serve_if_worker` measures the points and does not return.
    serve_if_worker();
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [config, out, devices @ ..] = &words[..] else { bail!("usage: experiment CONFIG OUT [DEVICE]...") };
    let devices: Vec<&str> = devices.iter().map(String::as_str).collect();
    let records = run_experiment(config.as_ref(), out.as_ref(), &devices, false)?;

    let mut times: Vec<_> = records.iter().filter_map(|record| Some((record.median_ms?, record))).collect();
    times.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    for (median_ms, record) in times.iter().take(5) {
        println!("{median_ms:.3} ms: {} on {}, {}", record.name, record.device, record.scene);
    }
    println!("{} of {} points were measured", times.len(), records.len());
    Ok(())
}
