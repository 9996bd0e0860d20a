//! A thread that reads a sensor repeatedly, and the mean readings of an interval.

use super::{Reading, Sensor, SensorReading};
use crate::threads::locked;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Pause between two readings of a sensor.
const PERIOD: Duration = Duration::from_millis(20);
/// Largest number of readings that are stored. At one reading per `PERIOD`, this number of readings covers
/// more than a minute.
const MOST_READINGS: usize = 4096;
/// Shortest interval over which the energy counter is used: some devices update the counter only about ten
/// times per second.
const COUNTER_SPAN: Duration = Duration::from_millis(500);

type Readings = VecDeque<(Instant, Reading)>;

/// A sensor that a thread reads. The thread ends when this value is dropped.
pub struct Watch {
    readings: Arc<Mutex<Readings>>,
    ended: Arc<AtomicBool>,
}

impl Watch {
    /// Starts reading the sensor that `find` returns, if any. Callers do not wait for the sensor: a library that lists
    /// all devices of a machine takes seconds to start. Until the library has started, there are no readings.
    pub fn start(find: impl FnOnce() -> Option<Box<dyn Sensor>> + Send + 'static) -> Self {
        let (readings, ended) = (Arc::default(), Arc::new(AtomicBool::new(false)));
        let (shared, end) = (Arc::clone(&readings), Arc::clone(&ended));
        let watch = move || {
            let Some(mut sensor) = find() else { return };
            while !end.load(Ordering::Relaxed) {
                append(&shared, (Instant::now(), sensor.read()));
                std::thread::sleep(PERIOD);
            }
        };
        // If no thread can be started, there are no readings.
        let _ = std::thread::Builder::new().spawn(watch);
        Self { readings, ended }
    }

    /// Returns the mean of the readings from `start` to `end`. If there are no readings from `start` to
    /// `end`, returns the last reading before `start`. If there is no reading before `start` either, returns
    /// `None`. The energy is the mean power times `frame_ms`, the device time of a frame.
    pub fn sense(&self, start: Instant, end: Instant, frame_ms: f64) -> Option<SensorReading> {
        sense(&locked(&self.readings), start, end, frame_ms)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

fn append(readings: &Mutex<Readings>, reading: (Instant, Reading)) {
    let mut latest = locked(readings);
    latest.push_back(reading);
    if latest.len() > MOST_READINGS {
        latest.pop_front();
    }
}

fn sense(readings: &Readings, start: Instant, end: Instant, frame_ms: f64) -> Option<SensorReading> {
    let between: Vec<&(Instant, Reading)> =
        readings.iter().filter(|(at, _)| (start..=end).contains(at)).collect();
    let before = readings.iter().rev().find(|(at, _)| *at < start);
    let seen: Vec<&(Instant, Reading)> =
        if between.is_empty() { before.into_iter().collect() } else { between };
    let mut mean = SensorReading::mean(seen.iter().map(|(_, reading)| &reading.shown))?;
    mean.power_w = counted_power_w(&seen).or(mean.power_w);
    // Watts times milliseconds give millijoules.
    mean.energy_mj = mean.power_w.map(|power_w| power_w * frame_ms);
    Some(mean)
}

/// Returns the power from the energy counter; `None` if the interval is too short, or if the counter is
/// missing or has not increased.
fn counted_power_w(seen: &[&(Instant, Reading)]) -> Option<f64> {
    let ((from, first), (to, last)) = (seen.first()?, seen.last()?);
    let span = to.duration_since(*from);
    let energy_mj = last.energy_counter_mj? - first.energy_counter_mj?;
    (span >= COUNTER_SPAN && energy_mj > 0.0).then(|| energy_mj * 1e-3 / span.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor for tests: its first reading has a clock of 1 MHz, its second reading a clock of 2 MHz, and
    /// so on.
    struct Counting(f64);

    impl Sensor for Counting {
        fn read(&mut self) -> Reading {
            self.0 += 1.0;
            let shown =
                SensorReading { clock_mhz: Some(self.0), power_w: Some(200.0), ..SensorReading::default() };
            Reading { shown, energy_counter_mj: None }
        }
    }

    fn at(start: Instant, ms: u64) -> Instant {
        start + Duration::from_millis(ms)
    }

    fn readings(start: Instant, throttled_at: u64) -> Readings {
        let shown = |ms: u64| SensorReading {
            clock_mhz: Some(1000.0 + ms as f64),
            power_w: Some(100.0),
            throttled: ms == throttled_at,
            ..SensorReading::default()
        };
        let reading = |ms| Reading { shown: shown(ms), energy_counter_mj: Some(300.0 * ms as f64) };
        (0..100).map(|i| (at(start, 20 * i), reading(20 * i))).collect()
    }

    #[test]
    fn a_short_frame_has_the_last_reading_before_it() {
        let start = Instant::now();
        let sensed = sense(&readings(start, 40), at(start, 45), at(start, 46), 0.5).expect("a reading");
        assert_eq!((sensed.clock_mhz, sensed.throttled), (Some(1040.0), true));
        assert_eq!(sensed.energy_mj, Some(50.0), "100 W for half a millisecond");
    }

    #[test]
    fn a_long_frame_has_the_mean_and_the_counted_energy() {
        let start = Instant::now();
        let sensed = sense(&readings(start, 60), at(start, 100), at(start, 1100), 1000.0).expect("readings");
        assert_eq!((sensed.clock_mhz, sensed.throttled), (Some(1600.0), false));
        // The energy counter increases by 300 mJ per millisecond, which is 300 W.
        let power_w = sensed.power_w.expect("power");
        assert!((power_w - 300.0).abs() < 1e-6 && (sensed.energy_mj.expect("energy") - 3e5).abs() < 1.0);
        let sensed = sense(&readings(start, 120), at(start, 100), at(start, 200), 100.0).expect("readings");
        assert_eq!((sensed.power_w, sensed.throttled), (Some(100.0), true), "too short to count");
    }

    #[test]
    fn before_the_first_reading_nothing_is_known() {
        let start = Instant::now() + Duration::from_secs(1);
        assert_eq!(sense(&readings(start, 0), at(start, 0) - PERIOD, at(start, 0) - PERIOD / 2, 1.0), None);
    }

    #[test]
    fn a_watch_goes_on_reading_and_ends() {
        let watch = Watch::start(|| Some(Box::new(Counting(0.0))));
        let deadline = Instant::now() + Duration::from_secs(120);
        while locked(&watch.readings).len() < 3 && Instant::now() < deadline {
            std::thread::sleep(PERIOD);
        }
        let sensed = watch.sense(Instant::now(), Instant::now(), 2.0).expect("a reading");
        assert!(sensed.clock_mhz >= Some(3.0) && sensed.energy_mj == Some(400.0), "{sensed:?}");
    }

    #[test]
    fn nobody_waits_for_a_sensor_that_is_found_late_or_never() {
        let (hold, wait) = std::sync::mpsc::channel::<()>();
        let late = Watch::start(move || {
            wait.recv().ok()?;
            Some(Box::new(Counting(0.0)))
        });
        assert_eq!(late.sense(Instant::now(), Instant::now(), 1.0), None);
        drop(hold);
        assert_eq!(Watch::start(|| None).sense(Instant::now(), Instant::now(), 1.0), None);
    }

    #[test]
    fn the_oldest_readings_are_forgotten() {
        let readings = Mutex::new(Readings::default());
        let start = Instant::now();
        for n in 0..MOST_READINGS as u64 + 2 {
            append(&readings, (at(start, n), Reading::default()));
        }
        let latest = locked(&readings);
        assert_eq!((latest.len(), latest[0].0), (MOST_READINGS, at(start, 2)));
    }

    #[test]
    fn a_counter_that_stands_still_or_covers_too_little_time_yields_no_power() {
        let start = Instant::now();
        let power_w = |end: u64, counters: [Option<f64>; 2]| {
            let reading = |energy_counter_mj| Reading { shown: SensorReading::default(), energy_counter_mj };
            let readings: Readings =
                [(start, reading(counters[0])), (at(start, end), reading(counters[1]))].into_iter().collect();
            sense(&readings, start, at(start, end), 1.0).and_then(|sensed| sensed.power_w)
        };
        assert_eq!(power_w(500, [Some(1e5), Some(1.5e5)]), Some(100.0), "50 J in half a second");
        assert_eq!(power_w(499, [Some(1e5), Some(1.5e5)]), None);
        assert_eq!(power_w(500, [Some(1e5), Some(1e5)]), None);
        assert_eq!(power_w(500, [None, Some(1e5)]), None);
    }
}
