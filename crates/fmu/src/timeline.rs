//! The time of an instance: comparison with the master's times, and samples that are due.

use crate::calls::Interface;

/// Two times are treated as the same instant if they differ by at most this fraction of a step or sample time.
const SLACK: f64 = 1e-6;

/// Two times are also treated as the same instant if they differ by at most this many units in the last place. A
/// master's t0 + k h contains two rounding errors, the end of the step adds one, and the instant of a sample adds one.
const ROUNDINGS: f64 = 4.0;

/// Number of samples above which a counter is no longer exact as a real number.
const MOST_SAMPLES: u64 = 1 << 53;

/// Position of an instance in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeline {
    /// Start of the experiment in s.
    pub start: f64,
    /// End of the experiment in s, if it is defined.
    pub stop: Option<f64>,
    /// Present time in s.
    pub time: f64,
    /// Number of the next sample; 0 in a continuous-time model.
    pub sample: u64,
}

/// Distance from `time` to the next number of greater magnitude.
#[inline]
fn ulp(time: f64) -> f64 {
    let magnitude = time.abs().min(f64::MAX.next_down());
    // Like `next_up`, but without branches: the bits of non-negative numbers, read as integers, have the same order as
    // the numbers.
    f64::from_bits(magnitude.to_bits() + 1) - magnitude
}

/// Returns true if two times that differ by `difference` are the same instant. The tolerance is a millionth of `step`,
/// or four units in the last place of `time`, which is near both times. All times are in s.
#[inline]
pub(crate) fn is_within_tolerance(difference: f64, time: f64, step: f64) -> bool {
    difference <= SLACK * step || difference <= ROUNDINGS * ulp(time)
}

/// Like [`f64::ceil`], which on x86-64 without SSE4.1 is a call of 20 instructions.
#[inline]
pub(crate) fn ceil(x: f64) -> f64 {
    let truncated = x as i64 as f64;
    if x.abs() < (1_i64 << 52) as f64 {
        truncated + f64::from(u8::from(truncated < x))
    } else {
        x // already an integer, or NaN
    }
}

/// Returns the tolerance for rounding errors of the time `t`: a millionth of a `part` (a step or sample time) plus four
/// units in the last place of `t`. All times are in s.
#[inline]
#[must_use]
pub fn slack(part: f64, t: f64) -> f64 {
    SLACK * part + ROUNDINGS * ulp(t)
}

/// Number of samples due before `end`, the end of a step of `step` s. Sample n is due at `start + n sample_time`. A
/// sample due at `end`, within the tolerance, is not counted.
#[inline]
pub(crate) fn samples_before(end: f64, start: f64, sample_time: f64, step: f64) -> f64 {
    let part = if sample_time < step { sample_time } else { step };
    let samples = ceil((end - start - slack(part, end)) / sample_time);
    if samples > 0.0 { samples } else { 0.0 }
}

/// Number of samples due before `end` from number `sample` on: [`samples_before`] minus `sample`. Fast path: no
/// division if it is clear that no sample or one sample is due.
#[inline]
pub(crate) fn samples_due(end: f64, start: f64, sample_time: f64, step: f64, sample: u64) -> f64 {
    let sample = sample as i64 as f64; // faster than from u64; fits, being at most MOST_SAMPLES
    let next = start + sample * sample_time;
    let slack = slack(if sample_time < step { sample_time } else { step }, end);
    let (early, late) = (end - 2.0 * slack, end - 0.5 * slack);
    if next >= late {
        return 0.0;
    }
    if next <= early && next + sample_time >= late {
        return 1.0;
    }
    let due = samples_before(end, start, sample_time, step) - sample;
    if due > 0.0 { due } else { 0.0 }
}

impl Timeline {
    pub(crate) const ZERO: Self = Self { start: 0.0, stop: None, time: 0.0, sample: 0 };

    /// Checks a timeline from a deserialized state. Fails if no sequence of steps can lead to it.
    pub(crate) fn check(
        &self,
        interface: Interface,
        has_stepped: bool,
        sample_time: Option<f64>,
    ) -> Result<(), String> {
        let is_exchange = interface == Interface::ModelExchange;
        let Self { start, stop, time, sample } = *self;
        if !(start.is_finite() && time.is_finite()) {
            return Err(format!("start = {start} s and time = {time} s must be finite numbers"));
        }
        if let Some(stop) = stop.filter(|stop| stop.is_nan() || *stop < start) {
            return Err(format!("stop time = {stop} s is before the start at {start} s"));
        }
        if time < start || (!has_stepped && time > start) {
            return Err(format!("time = {time} s is not possible with a start at {start} s"));
        }
        // In model exchange, a solver may evaluate the equations after the end.
        if let Some(stop) = stop.filter(|_| !is_exchange)
            && !is_within_tolerance(time - stop, time, time - start)
        {
            return Err(format!("time = {time} s is past the stop time, {stop} s"));
        }
        // Whether a sample at the present time has been taken depends on the tolerance, which depends on the unknown
        // length of the last step. Both counts are possible.
        let (least, most) = match sample_time {
            // A solver can go back in time, and the sample that is due at this time may have been taken.
            Some(_) if is_exchange => (0.0, MOST_SAMPLES as f64),
            Some(sample_time) if time > start => {
                (samples_before(time, start, sample_time, sample_time), ((time - start) / sample_time).ceil())
            }
            _ => (0.0, 0.0),
        };
        if sample > MOST_SAMPLES || !(least..=most).contains(&(sample as f64)) {
            let samples = if least == most { format!("{least}") } else { format!("{least} to {most}") };
            return Err(format!(
                "the sample counter is {sample}, but from {start} s to {time} s there are {samples} samples"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tolerance_is_a_millionth_of_the_step_or_four_units_in_the_last_place() {
        // One unit in the last place is 2^-29 s at 1e7 s and 2^-22 s at 1.7e9 s.
        for (time, tolerance) in [(0.0, 1e-9), (100.0, 1e-9), (1e7, 2.0_f64.powi(-27)), (-1.7e9, 2.0_f64.powi(-20))] {
            assert!(is_within_tolerance(tolerance, time, 1e-3), "{time}");
            assert!(!is_within_tolerance(tolerance.next_up(), time, 1e-3), "{time}");
            assert!(!is_within_tolerance(f64::NAN, time, 1e-3), "{time}");
        }
        assert!(!is_within_tolerance(f64::INFINITY, f64::MAX, 1e-3));
    }

    #[test]
    fn ceil_and_ulp_agree_with_the_standard_library() {
        let special =
            [0.0, 5e-324, 0.5, 1.0, 1.5, 2.0, 1e15, 4503599627370495.5, 4503599627370496.0, 1e16, 1e300, f64::MAX];
        for magnitude in special.into_iter().flat_map(|x: f64| [x.next_down().max(0.0), x, x.next_up()]) {
            for x in [magnitude, -magnitude] {
                assert_eq!(ceil(x), x.ceil(), "{x:e}");
            }
            if magnitude < f64::MAX {
                assert_eq!(ulp(magnitude), magnitude.next_up() - magnitude, "{magnitude:e}");
            }
        }
        assert!(ceil(f64::NAN).is_nan());
        assert_eq!([ceil(f64::INFINITY), ceil(f64::NEG_INFINITY)], [f64::INFINITY, f64::NEG_INFINITY]);
    }

    /// In exact arithmetic there are ceil(k h / sample_time) samples before the end of step k. The times contain the
    /// rounding errors of a master, which computes t0 + k h and adds the step.
    #[test]
    fn samples_are_counted_as_in_exact_arithmetic() {
        // Step and sample time in units of 0.1 ms.
        for (step, sample) in [(10, 10), (10, 100), (30, 100), (7, 10), (100, 10), (13, 7), (1, 10), (10, 3)] {
            let (h, sample_time) = (f64::from(step) * 1e-4, f64::from(sample) * 1e-4);
            for start in [0.0, -7.5, 1e4, 1e7, 1.7e9, -1.7e9] {
                for k in (0..20_000_u64).chain((1..20_000).map(|i| i * 49_999)) {
                    let end = start + k as f64 * h + h;
                    let counted = samples_before(end, start, sample_time, h);
                    let samples = ((k + 1) * step as u64).div_ceil(sample as u64);
                    assert_eq!(
                        counted, samples as f64,
                        "step {k} of {h} s from {start} s, sample time {sample_time} s"
                    );
                }
            }
        }
    }

    /// Compares the fast path with the general formula: at sample instants, inside and outside the tolerance, and
    /// between samples.
    #[test]
    fn due_samples_agree_with_the_general_formula() {
        for (step, sample_time) in
            [(1e-3, 1e-3), (1e-3, 0.01), (0.003, 0.01), (0.01, 1e-3), (0.1, 0.3), (1.0, f64::INFINITY)]
        {
            for start in [0.0, -7.5, 1e7, 1.7e9] {
                for sample in (0..2_000_u64).chain([1 << 33]) {
                    let at = start + sample as f64 * f64::min(sample_time, 1e9);
                    let slack = slack(f64::min(sample_time, step), at);
                    let beside =
                        [-3.0, -2.0, -1.0, -0.5, -0.1, 0.0, 0.1, 0.5, 1.0, 2.0, 3.0].map(|part| at + part * slack);
                    for end in beside.into_iter().flat_map(|end| [end.next_down(), end, end + 0.4 * step, end + step]) {
                        let expected = (samples_before(end, start, sample_time, step) - sample as f64).max(0.0);
                        let due = samples_due(end, start, sample_time, step, sample);
                        assert_eq!(
                            due, expected,
                            "{sample} samples of {sample_time} s from {start} s, step of {step} s to {end} s"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_timeline_agrees_with_its_samples() {
        let timeline = |start: f64, time, sample| Timeline { start, stop: None, time, sample };
        let check = |timeline: Timeline| timeline.check(Interface::CoSimulation, true, Some(0.01));
        for start in [0.0, 1e7, 1.7e9] {
            assert_eq!(check(timeline(start, start, 0)), Ok(()));
            assert_eq!(check(timeline(start, start + 0.095, 10)), Ok(()));
            // The sample at this instant is not taken yet.
            assert_eq!(check(timeline(start, start + 0.1, 10)), Ok(()));
            for sample in [0, 9, 12, u64::MAX] {
                let message = check(timeline(start, start + 0.1, sample)).unwrap_err();
                assert!(message.starts_with(&format!("the sample counter is {sample}, but from ")), "{message}");
            }
            assert!(check(timeline(start, start, 1)).is_err());
        }
        // At 2^64 sample times of 0.01 s, a counter of 2^64 - 1 would be correct, but is too large to be exact.
        assert!(check(timeline(0.0, 2.0_f64.powi(64) * 0.01, u64::MAX)).is_err());
        // Without samples, as in a continuous-time model.
        assert_eq!(timeline(0.0, 1.0, 0).check(Interface::CoSimulation, true, None), Ok(()));
        assert!(timeline(0.0, 1.0, 1).check(Interface::CoSimulation, true, None).is_err());
    }

    #[test]
    fn impossible_times_are_rejected() {
        let timeline = |start, stop, time| Timeline { start, stop, time, sample: 0 };
        for impossible in [
            timeline(f64::NAN, None, 0.0),
            timeline(0.0, None, f64::INFINITY),
            timeline(1.0, None, 0.5),
            timeline(1.0, Some(0.5), 1.0),
            timeline(0.0, Some(f64::NAN), 0.0),
            timeline(0.0, Some(1.0), 1.1),
        ] {
            assert!(impossible.check(Interface::CoSimulation, true, None).is_err(), "{impossible:?}");
        }
        assert!(
            timeline(0.0, None, 1.0).check(Interface::CoSimulation, false, None).is_err(),
            "a step before the end of initialization"
        );
        assert_eq!(timeline(0.0, Some(1.0), 1.0 + 0.9e-6).check(Interface::CoSimulation, true, None), Ok(()));
        assert_eq!(timeline(0.0, Some(f64::INFINITY), 1.0).check(Interface::CoSimulation, true, None), Ok(()));
    }
}
