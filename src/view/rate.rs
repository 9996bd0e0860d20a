//! Computes the numbers of frames and rays per second, and the median device time.

use crate::measure::median_of;
use std::time::{Duration, Instant};

/// The time after which the rates are computed again, and shown in the line of text beside the picture.
const PERIOD: Duration = Duration::from_millis(250);

/// Counts the frames since the start, and the frames since the rates were last computed ([`Rate::recent`]).
pub struct Rate {
    first: Option<Instant>,
    last: Instant,
    frames: u32,
    /// Device times of the frames that the device cast since the last switch (a change of the strategy, the local size,
    /// the device, the picture's size or the files).
    times_ms: Vec<f64>,
    /// The number of rays of the frames in `times_ms`.
    rays: f64,
    recent: Recent,
    /// Frames per second and rays per second, measured over the last complete period of at least `PERIOD`.
    shown: [f64; 2],
}

struct Recent {
    since: Instant,
    frames: u32,
    rays: f64,
    ms: f64,
}

impl Recent {
    fn now() -> Self {
        Self { since: Instant::now(), frames: 0, rays: 0.0, ms: 0.0 }
    }
}

/// The numbers that `raycl view` reports at its end. Device times and rays are counted only since the last
/// switch: a change of the strategy, the local size, the device, the picture's size or the files. The frames
/// of one strategy therefore do not count in the times of another strategy.
#[derive(Clone, Copy, Debug)]
pub struct Total {
    /// The number of frames that were shown from the start to the end of the view.
    pub frames: u32,
    /// The time from the first frame to the last.
    pub seconds: f64,
    /// The number of frames after the first, divided by `seconds`; `None` if `seconds` is 0.
    pub frames_per_s: Option<f64>,
    /// The number of frames that the device cast since the strategy, the local size, the device, the
    /// picture's size or a file last changed.
    pub timed_frames: usize,
    /// The median device time of the frames that `timed_frames` counts; `None` if there are none.
    pub frame_ms: Option<f64>,
    /// The number of primary and shadow rays of the frames that `timed_frames` counts, divided by the device time of
    /// these frames; `None` if this time is 0.
    pub rays_per_s: Option<f64>,
}

impl Rate {
    /// Makes a counter that has not counted any frame yet.
    pub fn new() -> Self {
        let recent = Recent::now();
        Self {
            first: None,
            last: recent.since,
            frames: 0,
            times_ms: Vec::new(),
            rays: 0.0,
            recent,
            shown: [0.0; 2],
        }
    }

    /// Counts a picture that was shown.
    pub fn count(&mut self) {
        self.last = Instant::now();
        self.first.get_or_insert(self.last);
        self.frames += 1;
        self.recent.frames += 1;
    }

    /// Counts the rays and the time of a frame that the device cast.
    pub fn count_rays(&mut self, rays: f64, ms: f64) {
        self.times_ms.push(ms);
        self.rays += rays;
        self.recent.rays += rays;
        self.recent.ms += ms;
    }

    /// Forgets the device times and the rays that were counted so far, because the next frames will have another
    /// strategy, local size, device or picture size, or because files have changed.
    pub fn switched(&mut self) {
        self.times_ms.clear();
        self.rays = 0.0;
        (self.recent.rays, self.recent.ms, self.shown[1]) = (0.0, 0.0, 0.0);
    }

    /// Returns the frames per second of elapsed time, and the rays per second of device time. The returned `bool` is
    /// true if this call has computed the rates, and false if it returns earlier rates.
    pub fn recent(&mut self) -> ([f64; 2], bool) {
        let elapsed = self.recent.since.elapsed();
        let is_over = elapsed >= PERIOD;
        if is_over {
            let Recent { frames, rays, ms, .. } = std::mem::replace(&mut self.recent, Recent::now());
            // If no frame was cast since the rates were last computed, the rate of rays per second keeps its
            // last value.
            let rays_per_s = if ms > 0.0 { rays / ms * 1e3 } else { self.shown[1] };
            self.shown = [f64::from(frames) / elapsed.as_secs_f64(), rays_per_s];
        }
        (self.shown, is_over)
    }

    /// Returns the number of frames that were shown so far.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Returns the numbers that `raycl view` reports at its end.
    pub fn total(&self) -> Total {
        let seconds = self.first.map_or(0.0, |first| (self.last - first).as_secs_f64());
        let frames = self.frames();
        let per = |count: f64, seconds: f64| (seconds > 0.0).then(|| count / seconds);
        Total {
            frames,
            seconds,
            frames_per_s: per(f64::from(frames.saturating_sub(1)), seconds),
            timed_frames: self.times_ms.len(),
            frame_ms: median_of(&self.times_ms),
            rays_per_s: per(self.rays, self.times_ms.iter().sum::<f64>() / 1e3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_begins_the_time_and_is_not_counted_in_it() {
        let mut rate = Rate::new();
        assert_eq!(rate.total().frames_per_s, None);
        rate.count();
        assert_eq!((rate.total().frames, rate.total().frames_per_s), (1, None));
        let first = Instant::now().checked_sub(PERIOD).expect("the clock is older");
        rate.first = Some(first);
        rate.count();
        assert_eq!(rate.first, Some(first), "a later frame does not begin the time again");
        (0..3).for_each(|_| rate.count());
        rate.last = rate.first.expect("a frame") + Duration::from_secs(2);
        let total = rate.total();
        assert_eq!((total.frames, total.seconds, total.frames_per_s), (5, 2.0, Some(2.0)));
    }

    #[test]
    fn rays_are_counted_by_device_time() {
        let mut rate = Rate::new();
        assert_eq!((rate.total().frames, rate.total().rays_per_s), (0, None));
        for (rays, ms) in [(1e6, 2.0), (3e6, 6.0), (1e6, 2.0)] {
            rate.count_rays(rays, ms);
            rate.count();
        }
        let total = rate.total();
        assert_eq!((total.frames, total.timed_frames, total.frame_ms), (3, 3, Some(2.0)));
        assert!(total.rays_per_s.is_some_and(|rate| (rate - 5e8).abs() < 1.0), "{total:?}");
    }

    #[test]
    fn times_and_rays_before_a_switch_are_forgotten() {
        let mut rate = Rate::new();
        let cast = |rate: &mut Rate, rays, ms| {
            rate.count_rays(rays, ms);
            rate.count();
        };
        (0..5).for_each(|_| cast(&mut rate, 1e6, 100.0));
        rate.switched();
        let total = rate.total();
        assert_eq!((total.frames, total.timed_frames), (5, 0));
        assert_eq!((total.frame_ms, total.rays_per_s), (None, None));
        (0..2).for_each(|_| cast(&mut rate, 2e6, 2.0));
        let total = rate.total();
        assert_eq!((total.frames, total.timed_frames, total.frame_ms), (7, 2, Some(2.0)));
        assert!(total.rays_per_s.is_some_and(|rate| (rate - 1e9).abs() < 1.0), "{total:?}");
    }

    #[test]
    fn recent_rays_before_a_switch_are_forgotten_and_frames_are_not() {
        let mut rate = Rate::new();
        let shown_after_a_period = |rate: &mut Rate| {
            rate.recent.since = Instant::now().checked_sub(PERIOD).expect("the clock is older");
            rate.recent().0
        };
        rate.count_rays(1e6, 2.0);
        assert_eq!(shown_after_a_period(&mut rate)[1], 5e8);
        rate.count_rays(1e6, 2.0);
        rate.count();
        rate.switched();
        assert_eq!(rate.shown[1], 0.0, "no frame has been cast since the switch");
        rate.count_rays(2e6, 2.0);
        let [frames_per_s, rays_per_s] = shown_after_a_period(&mut rate);
        assert!(frames_per_s > 0.0);
        assert_eq!(rays_per_s, 1e9, "the frame before the switch does not count");
    }

    #[test]
    fn the_recent_rate_is_that_of_the_frames_since_the_last_one() {
        let mut rate = Rate::new();
        rate.count();
        assert_eq!(rate.recent(), ([0.0; 2], false), "too little time has passed");
        let mut after_a_period = |frames: &[(f64, f64)]| {
            for (rays, ms) in frames {
                rate.count_rays(*rays, *ms);
                rate.count();
            }
            rate.recent.since = Instant::now().checked_sub(PERIOD).expect("the clock is older");
            let ([frames_per_s, rays_per_s], is_new) = rate.recent();
            assert!(is_new);
            (frames_per_s > 0.0, rays_per_s)
        };
        assert_eq!(after_a_period(&[(1e6, 2.0), (3e6, 2.0)]), (true, 1e9));
        assert_eq!(after_a_period(&[(1e6, 2.0)]), (true, 5e8));
        // If no frame was cast in a period, rays per second keep their last value.
        assert_eq!(after_a_period(&[]), (false, 5e8));
    }
}
