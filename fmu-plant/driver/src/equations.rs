//! Equations of the driver: steering, speed and pedals as functions of time. The README lists the equations and their
//! sources.

use std::f64::consts::TAU;

use chassis_vehicle::table::Table;
use fmu::slack;

use crate::{D, Driver, Maneuver, Y};

/// Names of the columns of a table, in the order of [`Y`].
const COLUMNS: [&str; 4] = ["driver.steer", "driver.speed", "driver.throttle", "driver.brake"];

/// Fraction of a period by which rounding may shift the end of the sweep from a zero crossing.
const SLACK: f64 = 1e-6;

/// Returns true if an output can depend on a parameter. An output depends on the parameters with its prefix, and on the
/// parameters that select the maneuver and the file.
pub(crate) fn influence(output: &str, parameter: &str) -> bool {
    let subject = |name| output.strip_prefix("driver.") == Some(name);
    match parameter.split_once('.') {
        // In a slalom between cones, the steering depends on the prescribed speed.
        Some(("speed", _)) => subject("speed") || subject("steer"),
        Some(("table", _)) | None => true,
        Some((name, _)) => subject(name),
    }
}

/// Reads the table of maneuver 7: column `time` in s and any of [`COLUMNS`] in rad, m/s, 1, 1.
pub(crate) fn parse_table(text: &str, path: &str) -> Result<Table, String> {
    let table = Table::parse(text, path, "time", &COLUMNS)?;
    for (index, name) in COLUMNS.iter().enumerate().skip(2) {
        let outside = table.column(index).unwrap_or(&[]).iter().position(|value| !(0.0..=1.0).contains(value));
        if let Some(row) = outside {
            return Err(format!("{path}: column `{name}` must be between 0 and 1; data row {} is not", row + 1));
        }
    }
    Ok(table)
}

/// Checks the parameters that the maneuver uses. The maneuver `Table` needs the `table`.
pub(crate) fn derived(p: &Driver, table: Option<Table>) -> Result<D, String> {
    let positive = |name: &str, value: f64, reason: &str| {
        if value > 0.0 { Ok(()) } else { Err(format!("'{name}' must be positive for {reason}, got {value}")) }
    };
    match p.maneuver {
        Maneuver::Straight | Maneuver::RampStep | Maneuver::Fishhook => {}
        Maneuver::DoubleLaneChange => {
            positive("steer.period", p.period, "'maneuver' = 3 (double_lane_change)")?;
            let end = p.t_0 + p.period;
            if p.t_1 < end {
                return Err(format!(
                    "'steer.reversal_start' must be at least {end} s, where the first lane change ends, got {} s",
                    p.t_1
                ));
            }
        }
        Maneuver::Slalom => {
            if p.period == 0.0 {
                let reason = "'maneuver' = 4 (slalom) with 'steer.period' = 0";
                positive("steer.cone_distance", p.cone_distance, reason)?;
                positive("speed.initial", p.v_0.max(p.v_1), reason)?;
            }
        }
        Maneuver::SineWithDwell => positive("steer.frequency", p.f, "'maneuver' = 5 (sine_with_dwell)")?,
        Maneuver::SineSweep => {
            positive("steer.final_frequency", p.f_1, "'maneuver' = 6 (sine_sweep)")?;
            positive("steer.duration", p.duration, "'maneuver' = 6 (sine_sweep)")?;
        }
        Maneuver::Table if table.is_none() => {
            return Err(
                "'table.file' must be the path of a CSV file for 'maneuver' = 7 (table), it is empty".to_owned()
            );
        }
        Maneuver::Table => {}
    }
    Ok(D { table })
}

/// The demands at the time `t` in s.
pub(crate) fn sample(p: &Driver, d: &D, t: f64) -> Y {
    let slack = slack(p.sample_time, t);
    let ramp = |start, rise_time| ramp(t, start, rise_time, slack);
    let mut y = Y {
        steer: 0.0,
        speed: p.v_0 + (p.v_1 - p.v_0) * ramp(p.t_v, p.d_v),
        throttle: p.a_throttle * ramp(p.t_throttle, p.d_throttle),
        brake: p.a_brake * ramp(p.t_brake, p.d_brake),
    };
    match p.maneuver {
        Maneuver::Straight => {}
        Maneuver::RampStep => y.steer = p.a * ramp(p.t_0, p.d),
        Maneuver::Fishhook => {
            y.steer = p.a * ramp(p.t_0, p.d) - (p.a + p.a_2) * ramp(p.t_1, p.d_2);
        }
        Maneuver::DoubleLaneChange => {
            y.steer = p.a * sine((t - p.t_0) / p.period, 1.0) - p.a * sine((t - p.t_1) / p.period, 1.0);
        }
        Maneuver::Slalom => {
            let end = if p.cycles == 0 { f64::INFINITY } else { f64::from(p.cycles) };
            y.steer = p.a * sine(slalom_periods(p, t), end);
        }
        Maneuver::SineWithDwell => {
            // The sine is held for `dwell` at its second peak, three quarters into the period.
            let peak = 0.75 / p.f;
            let running = t - p.t_0;
            let played = running.min(peak) + (running - peak - p.dwell).max(0.0);
            y.steer = p.a * sine(p.f * played, 1.0);
        }
        Maneuver::SineSweep => {
            let running = t - p.t_0;
            let rising = running.clamp(0.0, p.duration);
            let slope = (p.f_1 - p.f) / p.duration;
            let periods = p.f * rising + slope * rising * rising / 2.0 + p.f_1 * (running - rising);
            // Phase of the first zero crossing after the duration, in periods.
            let end = (p.duration * (p.f + p.f_1) - SLACK).ceil() / 2.0;
            y.steer = p.a * sine(periods, end);
        }
        Maneuver::Table => {
            let column = |index| d.table.as_ref().and_then(|table| table.at(index, t));
            y.steer = column(0).unwrap_or(0.0);
            y.speed = column(1).unwrap_or(y.speed);
            y.throttle = column(2).unwrap_or(y.throttle);
            y.brake = column(3).unwrap_or(y.brake);
        }
    }
    y
}

/// `clamp((t - start)/rise_time, 0, 1)`; with `rise_time = 0`, a step at `start - slack` (all in s).
fn ramp(t: f64, start: f64, rise_time: f64, slack: f64) -> f64 {
    if rise_time > 0.0 { ((t - start) / rise_time).clamp(0.0, 1.0) } else { f64::from(u8::from(t >= start - slack)) }
}

/// `sin(2 pi periods)` for `0 <= periods < end`, else 0.
fn sine(periods: f64, end: f64) -> f64 {
    if (0.0..end).contains(&periods) { fmu::math::sin(TAU * periods) } else { 0.0 }
}

/// Phase of the slalom in periods: from the time, or from the distance at the prescribed speed (two cones per period).
fn slalom_periods(p: &Driver, t: f64) -> f64 {
    if p.period > 0.0 {
        return (t - p.t_0) / p.period;
    }
    // Integral of the speed ramp up to the time `t`.
    let ramped = |t: f64| {
        let rising = (t - p.t_v).clamp(0.0, p.d_v);
        let share = if p.d_v > 0.0 { rising / p.d_v } else { 0.0 };
        rising * share / 2.0 + (t - p.t_v - p.d_v).max(0.0)
    };
    let distance = p.v_0 * (t - p.t_0) + (p.v_1 - p.v_0) * (ramped(t) - ramped(p.t_0));
    distance / (2.0 * p.cone_distance)
}

#[cfg(test)]
mod tests {
    use fmu::Enumeration as _;

    use super::*;

    const SERPENTINE_SPEED: f64 = 60.0 / 3.6;

    fn steer(p: &Driver, t: f64) -> f64 {
        sample(p, &derived(p, None).unwrap(), t).steer
    }

    fn error(p: &Driver) -> String {
        derived(p, None).unwrap_err()
    }

    /// The maneuvers whose steering angle is a formula, with the start values of their parameters.
    fn maneuvers() -> [Driver; 6] {
        [
            Maneuver::RampStep,
            Maneuver::Fishhook,
            Maneuver::DoubleLaneChange,
            Maneuver::Slalom,
            Maneuver::SineWithDwell,
            Maneuver::SineSweep,
        ]
        .map(|maneuver| Driver { maneuver, ..Driver::default() })
    }

    /// Reference: Chen et al., Mathematics 2022, 10, 3562: step of pi/6 rad at 5 s; double lane change of 0.064 rad
    /// with periods of 4 s, starting at 1 s and 6 s. The tolerance is a few roundings.
    #[test]
    fn rescue_vehicle_maneuvers() {
        let step = Driver { a: std::f64::consts::FRAC_PI_6, t_0: 5.0, d: 0.0, ..Driver::default() };
        assert_eq!([steer(&step, 4.999), steer(&step, 5.0)], [0.0, step.a]);
        let lane_change = Driver { maneuver: Maneuver::DoubleLaneChange, a: 0.064, ..Driver::default() };
        for n in 0..12_000 {
            let t = f64::from(n) * 0.001;
            let expected = if (1.0..5.0).contains(&t) {
                0.064 * (TAU * (t - 1.0) / 4.0).sin()
            } else if (6.0..10.0).contains(&t) {
                -0.064 * (TAU * (t - 6.0) / 4.0).sin()
            } else {
                0.0
            };
            assert!((steer(&lane_change, t) - expected).abs() < 1e-15);
        }
    }

    /// Reference: "Multiobjective Synchronous Control of Heavy-Duty Vehicles" (2022): angle step of 0.1 rad in 0.2 s at
    /// 1 s; serpentine 0.1 sin(2 pi (u/100)(t - 1)) between cones 50 m apart. The rounding error of the phase (a few
    /// times 2 pi) is below 1e-14.
    #[test]
    fn heavy_vehicle_maneuvers() {
        let step = Driver::default();
        assert_eq!(steer(&step, 1.0), 0.0);
        assert!((steer(&step, 1.1) - 0.05).abs() < 1e-15);
        assert!((steer(&step, 1.2) - 0.1).abs() < 1e-15);
        assert_eq!(steer(&step, 2.0), 0.1);
        let serpentine = Driver { maneuver: Maneuver::Slalom, period: 0.0, ..Driver::default() };
        for n in 0..13_000 {
            let t = f64::from(n) * 0.001;
            let expected = 0.1 * (TAU * SERPENTINE_SPEED / 100.0 * (t - 1.0).max(0.0)).sin();
            assert!((steer(&serpentine, t) - expected).abs() < 1e-14);
        }
    }

    /// Reference: states 2, 3 and 5 of the car with electronic stability program: throttle to 1 within 0.2 s from 1 s,
    /// brake to 1 within 0.15 s from 1.14 s, steering to 0.0579 rad within 0.1 s from 1 s.
    #[test]
    fn esp_car_maneuvers() {
        let p = Driver { a: 0.0579, d: 0.1, a_throttle: 1.0, a_brake: 1.0, t_brake: 1.14, ..Driver::default() };
        let d = derived(&p, None).unwrap();
        let at = |t| sample(&p, &d, t);
        assert_eq!(at(1.0), Y { speed: SERPENTINE_SPEED, ..Y::default() });
        let y = at(1.05);
        assert!((y.steer - 0.0579 / 2.0).abs() < 1e-15);
        assert!((y.throttle - 0.25).abs() < 1e-14);
        assert_eq!(at(1.14).brake, 0.0);
        assert!((at(1.215).brake - 0.5).abs() < 1e-14);
        let y = at(2.0);
        assert_eq!([y.steer, y.throttle, y.brake], [0.0579, 1.0, 1.0]);
    }

    /// Reference: Applied Sciences 2020, 10, 1852: J-turn ramp(5, 2.0) 0.1 rad; fishhook ramp(5, 0.8) 0.1 rad -
    /// ramp(9, 0.4) 0.2 rad.
    #[test]
    fn hydro_pneumatic_maneuvers() {
        let turn = Driver { t_0: 5.0, d: 2.0, ..Driver::default() };
        assert_eq!([5.0, 6.0, 7.0, 9.0].map(|t| steer(&turn, t)), [0.0, 0.05, 0.1, 0.1]);
        let fishhook = Driver { maneuver: Maneuver::Fishhook, t_0: 5.0, d: 0.8, t_1: 9.0, ..Driver::default() };
        for (t, expected) in [(5.0, 0.0), (5.4, 0.05), (6.0, 0.1), (9.0, 0.1), (9.2, 0.0), (9.4, -0.1), (20.0, -0.1)] {
            assert!((steer(&fishhook, t) - expected).abs() < 1e-15);
        }
    }

    /// Reference: UN Regulation No. 140, a sine of 0.7 Hz that is held at its second peak for half a second. The
    /// expected angle is a piecewise closed form; the tolerance covers the rounding of the time.
    #[test]
    fn sine_with_dwell_is_the_test_of_the_regulation() {
        let p = Driver { maneuver: Maneuver::SineWithDwell, ..Driver::default() };
        let (period, peak) = (1.0 / 0.7, 0.75 / 0.7);
        for n in 0..4000 {
            let t = f64::from(n) * 0.001;
            let running = t - 1.0;
            let expected = if running < 0.0 || running >= period + 0.5 {
                0.0
            } else if running < peak {
                (TAU * 0.7 * running).sin()
            } else if running < peak + 0.5 {
                -1.0
            } else {
                (TAU * 0.7 * (running - 0.5)).sin()
            };
            assert!((steer(&p, t) - 0.1 * expected).abs() < 1e-15);
        }
        assert!((steer(&p, 1.0 + 0.25 / 0.7) - 0.1).abs() < 1e-15);
    }

    /// The phase of the sweep is the integral of its frequency, computed here by Simpson's rule, which is exact for a
    /// linear frequency. 20,000 additions of at most 50 periods have a rounding error of at most 1e-9.
    #[test]
    fn sweep_phase_is_the_integral_of_its_frequency() {
        let p = Driver { maneuver: Maneuver::SineSweep, f: 0.2, f_1: 5.0, duration: 20.0, ..Driver::default() };
        let frequency = |running: f64| 0.2 + (5.0 - 0.2) * running / 20.0;
        let h = 0.001;
        let mut periods = 0.0;
        for n in 0..20_000 {
            let running = f64::from(n) * h;
            let expected = 0.1 * (TAU * periods).sin();
            assert!((steer(&p, 1.0 + running) - expected).abs() < 1e-9);
            periods += h / 6.0 * (frequency(running) + 4.0 * frequency(running + h / 2.0) + frequency(running + h));
        }
    }

    /// The sweep does not steer before its start, although its phase, a parabola in time, is also positive long before
    /// the start.
    #[test]
    fn sweep_does_not_steer_before_its_start() {
        let p = Driver { maneuver: Maneuver::SineSweep, t_0: 10.0, ..Driver::default() };
        for n in 0..=10_000 {
            assert_eq!(steer(&p, f64::from(n) * 0.001), 0.0, "{n}");
        }
        assert!(steer(&p, 10.1) > 0.0);
    }

    /// Times may be Unix times, whose last binary digit is 0.24 us. A step then still begins in its intended sample,
    /// not in an earlier one.
    #[test]
    fn steps_begin_in_their_sample_at_large_times() {
        for begin in [1e7, 1e9, 1.7e9] {
            for n in 1..3000_i32 {
                let start: f64 = format!("{}.{:03}", begin as i64 + i64::from(n / 1000), n % 1000).parse().unwrap();
                let p = Driver { t_0: start, d: 0.0, ..Driver::default() };
                assert_eq!(steer(&p, begin + f64::from(n) * 0.001), p.a, "{start}");
                assert_eq!(steer(&p, begin + f64::from(n - 1) * 0.001), 0.0, "{start}");
            }
        }
    }

    /// After its duration, the sweep continues with the last frequency to the next zero crossing. 20 s from 0.2 to 5.02
    /// Hz are 52.2 periods, so 0.3 periods of 5.02 Hz remain.
    #[test]
    fn sweep_ends_at_a_zero_crossing() {
        let p = Driver { maneuver: Maneuver::SineSweep, f: 0.2, f_1: 5.02, ..Driver::default() };
        let end = 21.0 + 0.3 / 5.02;
        assert!((steer(&p, 21.0) - 0.1 * (TAU * 0.2).sin()).abs() < 1e-12);
        assert!((steer(&p, end - 0.01) - 0.1 * (TAU * (0.5 - 0.01 * 5.02)).sin()).abs() < 1e-12);
        assert_eq!(steer(&p, end + 1e-9), 0.0);
        assert_eq!(steer(&p, 100.0), 0.0);
        // This sweep ends after a whole number of half periods, so it does not continue.
        let p = Driver { f: 0.5, f_1: 1.0, ..p };
        assert_eq!(steer(&p, 21.0 + 1e-9), 0.0);
    }

    /// With the start values, no maneuver makes the steering angle jump. The largest slope is (A + A2)/D2 = 0.5 rad/s
    /// in the fishhook and 2 pi 4 Hz A = 2.5 rad/s in the sweep.
    #[test]
    fn maneuvers_are_continuous() {
        for p in maneuvers() {
            let h = 1e-4;
            let limit = h * if p.maneuver == Maneuver::SineSweep { TAU * 4.0 * 0.1 } else { 0.5 };
            let mut last = steer(&p, 0.0);
            assert_eq!(last, 0.0);
            for n in 1..300_000 {
                let next = steer(&p, f64::from(n) * h);
                assert!((next - last).abs() <= limit + 1e-12, "{:?} at {n}", p.maneuver);
                last = next;
            }
        }
    }

    /// A maneuver does not steer before its start, and the opposite amplitude gives the mirror image.
    #[test]
    fn maneuvers_mirror() {
        for p in maneuvers() {
            let mirrored = Driver { a: -p.a, a_2: -p.a_2, ..p.clone() };
            for n in 0..3000 {
                let t = f64::from(n) * 0.01 - 2.0;
                assert_eq!(steer(&p, t), -steer(&mirrored, t));
                if t <= p.t_0 {
                    assert_eq!(steer(&p, t), 0.0);
                }
            }
        }
        let straight = Driver { maneuver: Maneuver::Straight, ..Driver::default() };
        assert_eq!(steer(&straight, 3.0), 0.0);
    }

    /// A step begins in its intended sample even if its time is not a binary fraction and n * 0.001 is rounded down.
    #[test]
    fn steps_begin_in_their_sample() {
        for n in 1..5000_i32 {
            // rounded like a number in a file
            let start: f64 = format!("{}.{:03}", n / 1000, n % 1000).parse().unwrap();
            for t in [f64::from(n) * 0.001, start, start - 1e-12] {
                assert_eq!(ramp(t, start, 0.0, 1e-9), 1.0);
            }
            assert_eq!(ramp(f64::from(n - 1) * 0.001, start, 0.0, 1e-9), 0.0);
        }
    }

    /// A slalom ends after its number of periods. Between cones, the angle crosses zero every 50 m, even if the speed
    /// changes: s = 10 t + t^2 from 10 m/s with 2 m/s2, starting at 1 s.
    #[test]
    fn slalom_follows_the_cones() {
        let p = Driver { maneuver: Maneuver::Slalom, cycles: 2, ..Driver::default() };
        assert!(steer(&p, 8.9).abs() > 0.01);
        assert_eq!(steer(&p, 9.1), 0.0);
        let p = Driver {
            maneuver: Maneuver::Slalom,
            period: 0.0,
            v_0: 10.0,
            v_1: 30.0,
            t_v: 1.0,
            d_v: 10.0,
            ..Driver::default()
        };
        for cone in 0..4 {
            let time = -5.0 + (25.0 + 50.0 * f64::from(cone)).sqrt();
            // slope 2 pi A v/100 m < 0.2 rad/s
            assert!(steer(&p, 1.0 + time).abs() < 1e-13);
            let half_way = -5.0 + (50.0 + 50.0 * f64::from(cone)).sqrt();
            let side = if cone % 2 == 0 { 0.1 } else { -0.1 };
            assert!((steer(&p, 1.0 + half_way) - side).abs() < 1e-13);
        }
    }

    #[test]
    fn speed_ramps() {
        let p = Driver { v_0: 10.0, v_1: 20.0, t_v: 2.0, d_v: 4.0, ..Driver::default() };
        let d = derived(&p, None).unwrap();
        assert_eq!([0.0, 2.0, 3.0, 6.0, 9.0].map(|t| sample(&p, &d, t).speed), [10.0, 10.0, 12.5, 20.0, 20.0]);
        let p = Driver { d_v: 0.0, ..p };
        assert_eq!([1.999, 2.0].map(|t| sample(&p, &d, t).speed), [10.0, 20.0]);
    }

    /// A table replaces the outputs for which it has a column; the other outputs keep their ramps.
    #[test]
    fn table_replaces_what_it_has() {
        let table = parse_table("time,driver.steer,driver.brake\n0,0,0\n2,0.2,1\n", "a.csv").unwrap();
        let p = Driver { maneuver: Maneuver::Table, a_throttle: 0.5, a_brake: 0.3, ..Driver::default() };
        let d = derived(&p, Some(table)).unwrap();
        assert_eq!(
            sample(&p, &d, 1.5),
            Y { steer: 0.15000000000000002, speed: SERPENTINE_SPEED, throttle: 0.5, brake: 0.75 }
        );
        assert_eq!(sample(&p, &d, 9.0).steer, 0.2);
        assert_eq!(sample(&p, &d, -9.0).steer, 0.0);
    }

    #[test]
    fn rejects_what_makes_no_sense() {
        let p = Driver::default;
        for (parameters, message) in [
            (
                Driver { maneuver: Maneuver::DoubleLaneChange, period: 0.0, ..p() },
                "'steer.period' must be positive for 'maneuver' = 3 (double_lane_change), got 0",
            ),
            (
                Driver { maneuver: Maneuver::DoubleLaneChange, t_1: 4.0, ..p() },
                "'steer.reversal_start' must be at least 5 s, where the first lane change ends, got 4 s",
            ),
            (
                Driver { maneuver: Maneuver::Slalom, period: 0.0, cone_distance: 0.0, ..p() },
                "'steer.cone_distance' must be positive for 'maneuver' = 4 (slalom) with 'steer.period' = 0, got 0",
            ),
            (
                Driver { maneuver: Maneuver::Slalom, period: 0.0, v_0: 0.0, ..p() },
                "'speed.initial' must be positive for 'maneuver' = 4 (slalom) with 'steer.period' = 0, got 0",
            ),
            (
                Driver { maneuver: Maneuver::SineWithDwell, f: 0.0, ..p() },
                "'steer.frequency' must be positive for 'maneuver' = 5 (sine_with_dwell), got 0",
            ),
            (
                Driver { maneuver: Maneuver::SineSweep, f_1: 0.0, ..p() },
                "'steer.final_frequency' must be positive for 'maneuver' = 6 (sine_sweep), got 0",
            ),
            (
                Driver { maneuver: Maneuver::SineSweep, duration: 0.0, ..p() },
                "'steer.duration' must be positive for 'maneuver' = 6 (sine_sweep), got 0",
            ),
            (
                Driver { maneuver: Maneuver::Table, ..p() },
                "'table.file' must be the path of a CSV file for 'maneuver' = 7 (table), it is empty",
            ),
        ] {
            assert_eq!(error(&parameters), message);
        }
        assert_eq!(
            parse_table("time,driver.brake\n0,0\n1,2\n", "a.csv").unwrap_err(),
            "a.csv: column `driver.brake` must be between 0 and 1; data row 2 is not"
        );
        assert!(
            parse_table("time,brake\n0,0\n", "a.csv")
                .unwrap_err()
                .starts_with("a.csv:1: the name of column 2 is unknown")
        );
    }

    proptest::proptest! {
        /// Any parameters and any time give finite demands or a message, never a panic.
        #[test]
        fn never_panics(maneuver in 0..8_i32, numbers in proptest::collection::vec(0.0..1e3_f64, 8), t in proptest::num::f64::ANY) {
            let p = Driver {
                maneuver: Maneuver::from_value(maneuver).unwrap(), a: numbers[0], t_0: numbers[1], d: numbers[2], t_1: numbers[3], period: numbers[4], f: numbers[5],
                dwell: numbers[6], t_v: numbers[7], ..Driver::default()
            };
            if let Ok(d) = derived(&p, None) {
                let y = sample(&p, &d, t);
                proptest::prop_assert!(y.steer.abs() <= p.a.abs() + p.a_2.abs() || t.is_nan());
            }
        }
    }
}
