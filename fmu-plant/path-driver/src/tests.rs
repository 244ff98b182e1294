//! Reference values, closed forms and invariants.
//!
//! "Reference values" are those of the model's specification, computed by an independent implementation; they are
//! compared to their last printed digit.

use std::sync::Arc;

use bicycle_car::BicycleCar;
use fmu::Variables;
use fmu::simulation::{ContinuousSimulation, DiscreteSimulation};
use fmu::testing::calls::Protocol;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::{CallError, Instance};
use fmu::testing::runner::DiscreteModel;
use proptest::prelude::*;

use super::*;
use crate::path::{Point, within_half_a_turn};
use crate::steering::Phase;

/// Asserts that `found` rounds to `printed`, whose last digit has the place value `last`.
#[track_caller]
fn assert_printed(found: f64, printed: f64, last: f64) {
    assert!((found - printed).abs() <= 0.5000001 * last, "{found} is not {printed}");
}

fn driver(maneuver: Maneuver) -> PathDriver {
    PathDriver { maneuver, ..PathDriver::default() }
}

/// A driver without delay, lag and limits.
fn immediate(maneuver: Maneuver) -> PathDriver {
    PathDriver { t_d: 0.0, t_r: 0.0, angle_limit: 1e9, rate_limit: 1e9, ..driver(maneuver) }
}

fn path(p: &PathDriver) -> Path {
    p.derived().unwrap().path
}

fn largest_curvature(path: &Path) -> f64 {
    path.points.iter().fold(0.0, |largest, point| largest.max(point.kappa.abs()))
}

/// The path for a table given as text.
fn path_of(text: &str) -> Result<Path, String> {
    let points = Columns::parse(text, "a.csv", &["x", "y"])?;
    Path::new(&driver(Maneuver::Table), Some(("a.csv", &points)))
}

fn at(x: f64, y: f64, yaw: f64, v: f64) -> U {
    U { x, y, yaw, v, roll_rate: 0.0 }
}

fn bits(y: &Y) -> Vec<u64> {
    let Y { steer, speed, throttle, brake, steering_wheel, e, psi_e, s, finished, lost } = *y;
    let reals = [steer, speed, throttle, brake, steering_wheel, e, psi_e, s];
    reals.into_iter().map(f64::to_bits).chain([finished, lost].map(u64::from)).collect()
}

// The path.

#[test]
fn paths_have_the_reference_values() {
    let p = PathDriver { o: 8.0, cut: 0.0, ..driver(Maneuver::DoubleLaneChange) };
    let double = path(&p);
    assert_eq!(double.points.len(), 2751);
    assert_printed(double.points[2750].s, 275.40109289, 1e-8);
    assert_printed(largest_curvature(&double), 0.01166078, 1e-8);
    let Point { x, y, theta, .. } = double.points[850];
    assert!((x - 85.0).abs() < 1e-12);
    assert_printed(y, 2.497306827, 1e-9);
    assert_printed(theta, 0.131708972, 1e-9);
    assert_eq!(double.end, double.points[1750].s);

    let avoidance = path(&PathDriver { o: 4.0, maneuver: Maneuver::ObstacleAvoidance, ..p });
    assert_eq!(avoidance.points.len(), 2111);
    assert_printed(avoidance.points[2110].s, 211.85347285, 1e-8);
    assert_printed(largest_curvature(&avoidance), 0.05059347, 1e-8);
    assert_eq!(avoidance.end, avoidance.points[1110].s);

    let single = path(&driver(Maneuver::SingleLaneChange));
    let Point { x, y, .. } = *single.points.last().unwrap();
    assert!((x - 211.1).abs() < 1e-9 && (y - 1.4637).abs() < 1e-12, "{x}, {y}");
    assert_printed(largest_curvature(&single), 0.00246041, 1e-8);
    assert_eq!(single.end, single.points[1111].s);

    let circle = path(&driver(Maneuver::Circle));
    let Point { x, y, .. } = circle.points[6800];
    assert_printed(x, 51.7095656, 1e-7);
    assert_printed(y, 1.2603007, 1e-7);
    assert_eq!((circle.points.len(), circle.end), (6801, circle.points[6800].s));
}

/// Closed form: the curvature rises linearly along the clothoid and is 1/R on the circle. Headings are exact, so the
/// difference quotient is also exact, except at the two corners.
#[test]
fn the_clothoid_has_a_linear_curvature() {
    let p = driver(Maneuver::Circle);
    let circle = path(&p);
    for s in [10.05, 49.0, 51.0, 62.35, 79.0, 81.0, 400.0, 679.0] {
        let expected = ((s - 50.0) / 30.0_f64).clamp(0.0, 1.0) / 100.0;
        assert!((circle.curvature(s) - expected).abs() < 1e-12, "{s}: {}", circle.curvature(s));
    }
    for s in [-1.0, 0.0, circle.end, 700.0, f64::NAN, f64::INFINITY] {
        assert_eq!(circle.curvature(s), 0.0, "{s}");
    }
    // Without a clothoid, the curvature jumps.
    let jump = path(&PathDriver { l_c: 0.0, ..p });
    assert_eq!(jump.curvature(49.8), 0.0);
    assert!((jump.curvature(50.2) - 0.01).abs() < 1e-12);
}

/// Outside the overlap, the path follows the middle of the lanes, minus the cut.
#[test]
fn lane_changes_pass_the_middle_of_the_lanes() {
    for (maneuver, track, o) in [
        (Maneuver::DoubleLaneChange, tracks::iso_3888_1 as fn(f64, f64) -> [tracks::Section; 3], 6.0),
        (Maneuver::ObstacleAvoidance, tracks::iso_3888_2, 2.5),
    ] {
        let p = PathDriver { o, ..driver(maneuver) };
        let points = path(&p).points;
        let [a, b, c] = track(p.x_0, p.w);
        for point in &points {
            let middle =
                [(0.0, a.end - o, 0.0), (b.begin + o, b.end - o, b.middle() - p.cut), (c.begin + o, 1e9, c.middle())];
            for (_, _, y) in middle.into_iter().filter(|(from, to, _)| (*from + 0.05..=*to - 0.05).contains(&point.x)) {
                assert_eq!((point.y, point.theta), (y, 0.0), "{point:?}");
            }
            // The path stays between the cones.
            for section in [a, b, c].iter().filter(|section| (section.begin..=section.end).contains(&point.x)) {
                assert!(section.right < point.y && point.y < section.left, "{point:?}");
            }
        }
        let headings_are_slopes = points.windows(3).all(|around| {
            let slope = (around[2].y - around[0].y) / (around[2].x - around[0].x);
            // The error of the central difference is h^2/6 times the third derivative, at most 60 y/length^3 = 0.02
            // 1/m2.
            (around[1].theta.tan() - slope).abs() < 1e-4
        });
        assert!(headings_are_slopes);
    }
}

#[test]
fn a_table_turns_without_jumps() {
    // A path of 10 points that goes two and a half times around a square centered on the origin.
    let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
    let mut text = "x,y\n".to_owned();
    for i in 0..10 {
        let [x, y] = corners[i % 4];
        text += &format!("{x},{y}\n");
    }
    let square = path_of(&text).unwrap();
    // The heading begins at pi. It turns by a quarter turn from point to point, but only by an eighth of a turn at both
    // ends of the path.
    for (i, point) in square.points.iter().enumerate() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let expected = 2.0 * quarter
            + (i as f64
                - if i == 0 {
                    0.0
                } else if i == 9 {
                    1.0
                } else {
                    0.5
                })
                * quarter;
        assert!((point.theta - expected).abs() < 1e-12, "{i}: {point:?}");
        assert_eq!(point.s, 2.0 * i as f64);
    }
}

#[test]
fn a_table_has_no_mirror() {
    let points = Columns::parse("x,y\n0,0\n10,5\n20,0\n", "a.csv", &["x", "y"]).unwrap();
    let p = PathDriver { mirror: true, ..driver(Maneuver::Table) };
    let path = Path::new(&p, Some(("a.csv", &points))).unwrap();
    assert_eq!(path.points[1].y, 5.0);
    // Curvature from its definition: the change of direction over both segments; 0 at the ends.
    let slope = 0.5_f64.atan();
    assert!((path.points[1].kappa + 2.0 * slope / (2.0 * 125.0_f64.sqrt())).abs() < 1e-15);
    assert_eq!((path.points[0].kappa, path.points[2].kappa), (0.0, 0.0));
}

#[test]
fn a_table_without_a_path_is_rejected() {
    let messages = [
        ("x,y\n0,0\n", "'table.file': a.csv:2: a path needs at least 2 points, this is the only one"),
        (
            "# two equal points\nx,y\n0,0\n\n1,1\n1,1\n",
            "'table.file': a.csv:6: a point must be 0.000001 m to 1000000000 m away from the one before, this is 0 m",
        ),
        (
            "x,y\n0,0\n1e300,0\n",
            "'table.file': a.csv:3: a point must be 0.000001 m to 1000000000 m away from the one before, this is inf m",
        ),
        ("x,y\n0,0\n1\n", "a.csv:3: 1 fields, expected 2 as in the first line"),
        ("x,z\n0,0\n", "a.csv:1: the name of column 2 is unknown, expected `x`, `y`"),
    ];
    for (text, message) in messages {
        assert_eq!(path_of(text).unwrap_err(), message);
    }
    assert!(path_of("x,y\n0,0\n0,0.000001\n").is_ok());
    assert!(path_of("x,y\n0,0\n0,0.00000099\n").is_err());
}

/// Reference: the IEEE 754 remainder of the division by a whole turn; both are exact.
#[test]
fn angles_lose_whole_turns() {
    use std::f64::consts::{PI, TAU};
    for (angle, expected) in [(0.0, 0.0), (3.0, 3.0), (-3.0, -3.0), (PI, PI), (-PI, -PI), (TAU, 0.0), (1.5 * TAU, -PI)]
    {
        assert_eq!(within_half_a_turn(angle), expected, "{angle}");
    }
    assert_eq!(within_half_a_turn(4.0), 4.0 - TAU);
    assert_eq!(within_half_a_turn(-4.0), TAU - 4.0);
    assert_eq!(within_half_a_turn(2.5 * TAU), PI);
    assert!((within_half_a_turn(1000.0) - (1000.0 - 159.0 * TAU)).abs() < 1e-12);
    assert!(within_half_a_turn(f64::INFINITY).is_nan());
}

// The projection.

/// The vehicle is in the middle of a transition in the first sample.
#[test]
fn one_sample_has_the_reference_values() {
    let p = PathDriver { o: 8.0, cut: 0.0, ..immediate(Maneuver::DoubleLaneChange) };
    let path = path(&p);
    assert_printed(path.curvature(75.0), 0.0051669999, 1e-10);
    let mut run = DiscreteSimulation::new(p).unwrap();
    let y = run.sample(&at(80.03, 1.2, 0.1, 20.0)).unwrap();
    assert_printed(y.s, 80.04359223, 1e-8);
    assert_printed(y.e, -0.5883951165, 1e-10);
    assert_printed(y.psi_e, -0.0449181761, 1e-10);
    assert_printed(path.curvature(y.s + 2.0), -0.0020447366, 1e-10);
    assert_printed(y.steer, 0.0191060633, 1e-10);
    assert_eq!(y.steering_wheel, 16.0 * y.steer);
}

#[test]
fn the_first_and_the_last_segment_are_extended() {
    let path = path_of("x,y\n0,0\n10,0\n10,10\n").unwrap();
    let project = |x, y| path.project(&mut 0, [x, y], 0.0);
    let before = project(-5.0, 2.0);
    assert_eq!((before.s, before.e), (-5.0, 2.0));
    let mut segment = 1;
    let after = path.project(&mut segment, [8.0, 25.0], 0.0);
    assert_eq!((after.s, after.e, segment), (35.0, 2.0, 1));
    // The heading at the corner is the mean of both segments.
    let corner = path.project(&mut 0, [10.0, 0.0], 0.0);
    assert_eq!(corner.s, 10.0);
    assert!((corner.psi_e + std::f64::consts::FRAC_PI_4).abs() < 1e-15);
}

/// On a closed path, the same point has a different station in each round. The polyline with chords of 0.1 m is up to
/// 25 um inside the circle of 50 m.
#[test]
fn rounds_of_a_circle_have_different_stations() {
    let p = PathDriver { x_0: 0.0, l_c: 0.0, r: 50.0, arc: 900.0, ..driver(Maneuver::Circle) };
    let circle = path(&p);
    let mut segment = 0;
    for k in 0..8800 {
        let s = f64::from(k) * 0.1;
        let angle = s / 50.0;
        let place = circle.project(&mut segment, [49.0 * angle.sin(), 50.0 - 49.0 * angle.cos()], angle);
        assert!((place.s - s).abs() < 0.01, "{s}: {place:?}");
        assert!((place.e - 1.0).abs() < 1e-4 && place.psi_e.abs() < 1e-3, "{s}: {place:?}");
    }
    // And in reverse.
    for k in (100..8800).rev() {
        let s = f64::from(k) * 0.1;
        let angle = s / 50.0;
        let place = circle.project(&mut segment, [51.0 * angle.sin(), 50.0 - 51.0 * angle.cos()], angle);
        assert!((place.s - s).abs() < 0.01 && (place.e + 1.0).abs() < 1e-4, "{s}: {place:?}");
    }
}

/// Standing still changes nothing, and driving back gives the same values except near corners of the polyline: inside a
/// bend, both segments contain a foot of the perpendicular, and the search keeps the segment it comes from. The path
/// turns by 0.1 m times 0.012 1/m at each corner, and the vehicle is 2.5 m away from it. The difference is then 3 mm in
/// the station, 2e-6 m in the deviation, 4e-5 rad in the heading and thus 6e-5 rad in the steering angle.
#[test]
fn standstill_and_driving_back_give_the_same_values() {
    let p = PathDriver { k_i: 0.3, ..immediate(Maneuver::DoubleLaneChange) };
    let place = |k: i32| at(f64::from(k) * 0.07, 1.0, 0.02, 0.0);
    let mut run = DiscreteSimulation::new(p).unwrap();
    let way: Vec<_> = (0..2000).map(|k| run.sample(&place(k)).unwrap()).collect();
    for _ in 0..5 {
        assert_eq!(bits(&run.sample(&place(1999)).unwrap()), bits(&way[1999]));
    }
    for k in (0..1999).rev() {
        let (found, expected) = (run.sample(&place(k)).unwrap(), &way[k as usize]);
        assert!(
            (found.s - expected.s).abs() < 4e-3 && (found.e - expected.e).abs() < 3e-6,
            "{k}: {found:?}, {expected:?}"
        );
        assert!((found.steer - expected.steer).abs() < 1e-4, "{k}: {found:?}, {expected:?}");
    }
    // At rest, the integral of the deviation is held, too.
    assert_eq!(run.state().integral, 0.0);
}

// Steering along a path.

/// Closed form for an ideal vehicle (yaw rate = v steer/M) and small angles: e'' + 2 (v/Lp) e' + 2 (v/Lp)^2 e = 0. The
/// driver holds its angle for a sample of 0.1 ms, so it is 50 us late on average, less than 1e-4 of the time constant
/// Lp/v.
#[test]
fn an_ideal_vehicle_returns_to_the_path_with_the_damping_of_the_law() {
    let (v, h) = (20.0, 1e-4);
    let p = PathDriver { sample_time: h, k: 0.002, ..immediate(Maneuver::Straight) };
    let m = p.l + p.k * v * v;
    let rate = v / (p.t_p * v);
    let mut run = DiscreteSimulation::new(p).unwrap();
    let [mut x, mut y, mut yaw] = [0.0, 0.01, 0.0_f64];
    for k in 0..40_000 {
        let t = f64::from(k) * h;
        let expected = 0.01 * (-rate * t).exp() * ((rate * t).cos() + (rate * t).sin());
        let sample = run.sample(&at(x, y, yaw, v)).unwrap();
        assert!((sample.e - expected).abs() < 2e-4 * 0.01, "{t} s: {} instead of {expected}", sample.e);
        let turned = v * sample.steer / m * h;
        // Along the chord of the arc.
        x += v * h * (yaw + turned / 2.0).cos();
        y += v * h * (yaw + turned / 2.0).sin();
        yaw += turned;
    }
}

/// On a straight path, the steering angle is -M g 2/Lp^2 (e + Lp sin(heading error)), with M = L + K v^2.
#[test]
fn the_law_of_the_deviation() {
    let p = PathDriver { k: 0.004, g: 1.2, t_p: 0.5, ..immediate(Maneuver::Straight) };
    for (v, l_p) in [(20.0, 10.0), (4.0, 3.0), (0.0, 3.0), (-7.0, 3.0)] {
        let v_0 = f64::max(v, 0.0);
        let expected = -(2.34 + 0.004 * v_0 * v_0) * 1.2 * 2.0 / (l_p * l_p) * (0.7 + l_p * 0.1_f64.sin());
        let y = DiscreteSimulation::new(p.clone()).unwrap().sample(&at(30.0, 0.7, 0.1, v)).unwrap();
        assert!((y.steer - expected).abs() < 1e-14, "{v} m/s: {} instead of {expected}", y.steer);
        assert_eq!((y.e, y.psi_e, y.s), (0.7, 0.1, 30.0));
    }
}

/// The feedforward looks ahead by the total delay of driver and vehicle. A negative time constant acts like 0.
#[test]
fn the_feedforward_leads() {
    for (delay, lag, lead) in [(0.0, 0.0, 0.3), (0.2, 0.0, 0.5), (0.2, 0.4, 0.9), (0.2, -0.4, 0.5)] {
        let p = PathDriver {
            g: 0.0,
            g_ff: 0.8,
            t_ff: 0.3,
            t_d: delay,
            t_r: lag,
            sample_time: 0.01,
            rate_limit: 1e9,
            ..driver(Maneuver::Circle)
        };
        let path = path(&p);
        let mut run = DiscreteSimulation::new(p).unwrap();
        // After 30 s, delay and lag have died out to e^-75.
        let y = (0..3000).map(|_| run.sample(&at(60.0, 0.0, 0.0, 10.0)).unwrap()).last().unwrap();
        let expected = 2.34 * 0.8 * path.curvature(y.s + lead * 10.0);
        assert!(expected > 0.0 && (y.steer - expected).abs() < 1e-14, "{} instead of {expected}", y.steer);
    }
}

/// The law is evaluated before the integral adds the deviation of the same sample.
#[test]
fn the_integral_acts_one_sample_later_and_not_at_rest() {
    for (v, rate) in [(0.499, 0.0), (0.5, 0.4)] {
        let p = PathDriver { k_i: 0.4, sample_time: 0.01, ..immediate(Maneuver::Straight) };
        let mut run = DiscreteSimulation::new(p).unwrap();
        let [first, second] = [0; 2].map(|_| run.sample(&at(0.0, 0.5, 0.0, v)).unwrap().steer);
        let factor = -2.34 * 2.0 / 9.0;
        assert!((first - factor * 0.5).abs() < 1e-15 && (second - factor * (0.5 + rate * 0.5 * 0.01)).abs() < 1e-15);
        assert_eq!(run.state().integral, 2.0 * rate * 0.5 * 0.01);
    }
}

#[test]
fn the_delay_is_a_whole_number_of_samples() {
    for (delay, samples) in [(0.0, 0), (0.0049, 0), (0.0051, 1), (0.13, 13), (5.0, 500)] {
        let p = PathDriver { g_ff: 0.0, sample_time: 0.01, ..immediate(Maneuver::Straight) };
        let signal: Vec<U> = (0..1300).map(|k| at(0.0, (f64::from(k) * 0.37).sin(), 0.0, 10.0)).collect();
        let steer = |p: PathDriver| -> Vec<f64> {
            let mut run = DiscreteSimulation::new(p).unwrap();
            signal.iter().map(|u| run.sample(u).unwrap().steer).collect()
        };
        let (immediate, delayed) = (steer(p.clone()), steer(PathDriver { t_d: delay, ..p }));
        for (k, found) in delayed.into_iter().enumerate() {
            // The steering angle is a sum of changes, so it is rounded.
            let expected = if k < samples { 0.0 } else { immediate[k - samples] };
            assert!((found - expected).abs() < 1e-15, "{delay} s, sample {k}: {found} instead of {expected}");
        }
    }
}

/// Closed form of a first-order lag after a step. The samples differ from it only by the rounding of 400 additions.
#[test]
fn the_lag_is_exact_at_the_samples() {
    let p = PathDriver { t_r: 0.2, sample_time: 0.01, ..immediate(Maneuver::Straight) };
    let raw = DiscreteSimulation::new(PathDriver { t_r: 0.0, ..p.clone() }).unwrap().sample(&at(0.0, 0.3, 0.0, 10.0));
    let raw = raw.unwrap().steer;
    let mut run = DiscreteSimulation::new(p).unwrap();
    for k in 1..400 {
        let expected = raw * (1.0 - (-f64::from(k) * 0.01 / 0.2).exp());
        let found = run.sample(&at(0.0, 0.3, 0.0, 10.0)).unwrap().steer;
        assert!((found - expected).abs() < 1e-14, "sample {k}: {found} instead of {expected}");
    }
}

#[test]
fn rate_and_angle_of_the_steering_wheel_are_limited() {
    let p = PathDriver { angle_limit: 0.8, rate_limit: 2.0, sample_time: 0.01, ..immediate(Maneuver::Straight) };
    let mut run = DiscreteSimulation::new(p).unwrap();
    for k in 1..100 {
        // The vehicle is far to the right, so the driver turns the steering wheel to the left, at 2 rad/s up to 0.8
        // rad. The tolerance covers the rounding of 40 additions.
        let wheel = run.sample(&at(0.0, -5.0, 0.0, 10.0)).unwrap().steering_wheel;
        assert!((wheel - (0.02 * f64::from(k)).min(0.8)).abs() < 1e-13, "{k}: {wheel}");
    }
    let back = run.sample(&at(0.0, 5.0, 0.0, 10.0)).unwrap().steering_wheel;
    assert!((back - 0.78).abs() < 1e-13);
}

#[test]
fn the_steering_angle_is_held_from_a_time_on() {
    let p = PathDriver { hold_start: 0.07, k_i: 0.5, sample_time: 0.01, ..immediate(Maneuver::Straight) };
    let mut run = DiscreteSimulation::new(p).unwrap();
    let y: Vec<_> = (0..20).map(|k| run.sample(&at(0.0, f64::from(k), 0.0, 10.0)).unwrap().steer).collect();
    assert!(y[..7].windows(2).all(|pair| pair[1] < pair[0]));
    assert!(y[7..].iter().all(|steer| *steer == y[6]), "{y:?}");
    // The integral is held, too: it is the sum of 0.5 k 0.01 for k < 7. Because of rounding, 7 times 0.01 exceeds 0.07.
    assert!((run.state().integral - 0.5 * 0.01 * 21.0).abs() < 1e-15, "{}", run.state().integral);
}

#[test]
fn a_lost_path_keeps_the_steering_angle() {
    let p = PathDriver { lost_distance: 2.0, speed_control: true, k_i: 0.1, ..immediate(Maneuver::Straight) };
    let mut run = DiscreteSimulation::new(p).unwrap();
    let near = run.sample(&at(0.0, 2.0, 0.0, 10.0)).unwrap();
    assert!(!near.lost);
    let integral = run.state().integral;
    // Beginning with the sample in which the path is lost, the steering angle is held. The position on the path and the
    // pedals are still updated.
    for (y, v) in [(2.1, 10.0), (0.0, 12.0), (-1.0, 20.0)] {
        let sample = run.sample(&at(1.0, y, 0.1, v)).unwrap();
        assert!(sample.lost && !sample.finished);
        assert_eq!((sample.steer, sample.e, sample.s), (near.steer, y, 1.0));
        assert_eq!(run.state().integral, integral);
        assert_eq!(sample.throttle > 0.0, v < 16.0);
        assert_eq!(sample.brake > 0.0, v > 17.0);
    }
    // The end of the path is still detected.
    assert!(run.sample(&at(200.0, 9.0, 0.0, 10.0)).unwrap().finished);
}

#[test]
fn finished_becomes_true_at_the_end_of_the_maneuver_and_stays_true() {
    let ends = [
        (Maneuver::Straight, 150.0),
        (Maneuver::Circle, path(&driver(Maneuver::Circle)).end),
        (Maneuver::DoubleLaneChange, path(&driver(Maneuver::DoubleLaneChange)).points[1750].s),
        (Maneuver::SingleLaneChange, path(&driver(Maneuver::SingleLaneChange)).points[1111].s),
    ];
    for (maneuver, end) in ends {
        let p = driver(maneuver);
        let points = path(&p).points;
        let mut run = DiscreteSimulation::new(p).unwrap();
        let mut first = None;
        for pair in points.windows(2).flat_map(|pair| [0.0, 0.25, 0.5, 0.75].map(|share| (pair, share))) {
            let (a, b, share) = (pair.0[0], pair.0[1], pair.1);
            let y = run.sample(&at(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.theta, 10.0)).unwrap();
            // `finished` may stay false here, because this loop never reaches the last point and the position is
            // rounded.
            if y.finished && first.is_none() {
                first = Some(y.s);
            }
            assert_eq!(y.finished, first.is_some());
            assert!(!y.lost);
        }
        let b = points.last().unwrap();
        let y = run.sample(&at(b.x + 1e-6 * b.theta.cos(), b.y + 1e-6 * b.theta.sin(), 0.0, 10.0)).unwrap();
        assert!(y.finished);
        // The tolerance is slightly more than the 25 mm between two samples.
        assert!((first.unwrap_or(y.s) - end).abs() < 0.03, "{maneuver:?}: {first:?} instead of {end}");
        // `finished` stays true.
        assert!(run.sample(&at(0.0, 0.0, 0.0, 10.0)).unwrap().finished);
    }
}

// Steering by time.

/// Closed form: 13.5 deg/s from 1 s on, to the right, up to 0.5 rad.
#[test]
fn slowly_increasing_steer_is_a_ramp() {
    let p = PathDriver { a: -0.5, ..driver(Maneuver::SlowlyIncreasingSteer) };
    let mut run = DiscreteSimulation::new(p).unwrap();
    for k in 0..5000 {
        let t = f64::from(k) * 1e-3;
        // The vehicle is already beyond the end of the line, but this does not end the maneuver.
        let y = run.sample(&at(1e3, 25.0, 0.3, 20.0)).unwrap();
        let ramp = 13.5_f64.to_radians() * (t - 1.0).max(0.0);
        assert!((y.steering_wheel + ramp.min(0.5)).abs() < 1e-14, "{t} s: {}", y.steering_wheel);
        assert_eq!(y.finished, ramp >= 0.5);
        // There is no path to lose.
        assert_eq!((y.e, y.psi_e, y.lost), (25.0, 0.3, false));
    }
}

/// The ramp ends exactly at the amplitude; all numbers are exact in binary.
#[test]
fn slowly_increasing_steer_ends_with_its_amplitude() {
    let p = PathDriver { t_0: 0.0, omega: 1.0, a: 0.5, sample_time: 0.25, ..driver(Maneuver::SlowlyIncreasingSteer) };
    let mut run = DiscreteSimulation::new(p).unwrap();
    let y = [0; 4].map(|_| run.sample(&at(0.0, 0.0, 0.0, 20.0)).unwrap());
    assert_eq!(y.each_ref().map(|y| y.steering_wheel), [0.0, 0.25, 0.5, 0.5]);
    assert_eq!(y.map(|y| y.finished), [false, false, true, true]);
}

/// Closed form: the phases are 0.5 s straight ahead, 0.1 s of ramp to 0.4 rad at 4 rad/s, the dwell, 0.2 s of reversal,
/// 0.3 s of hold and 0.25 s of return.
#[test]
fn the_fishhook_waits_for_the_roll_rate() {
    let p = PathDriver {
        a: 0.4,
        omega: 4.0,
        t_0: 0.5,
        maximum_dwell: 0.7,
        hold_time: 0.3,
        return_time: 0.25,
        ..driver(Maneuver::Fishhook)
    };
    // The roll rate falls below the threshold 0.15 s after the ramp in the first case, and never in the second.
    for (falls, dwell) in [(0.75, 0.15), (9.0, 0.7)] {
        for (side, a) in [(1.0, 0.4), (-1.0, -0.4)] {
            let mut run = DiscreteSimulation::new(PathDriver { a, ..p.clone() }).unwrap();
            for k in 0..2500 {
                let t = f64::from(k) * 1e-3;
                let roll_rate = if f64::from(k) >= falls * 1e3 { -0.026 } else { [0.027, -0.027][k as usize % 2] };
                let y = run.sample(&U { roll_rate, ..at(0.0, 0.0, 0.0, 20.0) }).unwrap();
                let tau = t - 0.6 - dwell;
                let expected = if t < 0.5 {
                    0.0
                } else if t < 0.6 {
                    4.0 * (t - 0.5)
                } else if tau < 0.0 {
                    0.4
                } else if tau < 0.2 {
                    0.4 - 4.0 * tau
                } else if tau < 0.5 {
                    -0.4
                } else if tau < 0.75 {
                    -0.4 * (1.0 - (tau - 0.5) / 0.25)
                } else {
                    0.0
                };
                // At 4 rad/s, the rounding of the times is 1e-14 rad.
                assert!((y.steering_wheel - side * expected).abs() < 1e-13, "{t} s: {}", y.steering_wheel);
                assert_eq!(y.finished, tau > 0.7495, "{t} s");
            }
        }
    }
}

/// A threshold below 0 is never reached, so the dwell takes 0.25 s. Phases without duration begin and end in the same
/// sample.
#[test]
fn phases_of_the_fishhook_may_have_no_duration() {
    let p = PathDriver {
        omega: 1e9,
        t_0: 0.01,
        maximum_dwell: 0.25,
        roll_rate_threshold: -1.0,
        hold_time: 0.0,
        return_time: 0.0,
        ..driver(Maneuver::Fishhook)
    };
    let mut run = DiscreteSimulation::new(p.clone()).unwrap();
    let y: Vec<_> = (0..300).map(|_| run.sample(&at(0.0, 0.0, 0.0, 20.0)).unwrap()).collect();
    for (k, y) in y.iter().enumerate() {
        // The ramp takes 5 ns. It ends in the sample after the one in which it begins, and so does the reversal.
        let expected = if (11..261).contains(&k) { p.a } else { 0.0 };
        assert!((y.steering_wheel - expected).abs() < 1e-12 || k == 261, "{k}: {}", y.steering_wheel);
        assert_eq!(y.finished, k >= 262, "{k}");
    }
    assert_eq!(run.state().phase, Phase::End);
    // All phases pass in the first sample.
    let at_once = PathDriver { t_0: 0.0, maximum_dwell: 0.0, omega: 1e300, ..p };
    let mut run = DiscreteSimulation::new(at_once).unwrap();
    assert!(run.sample(&at(0.0, 0.0, 0.0, 20.0)).unwrap().finished);
}

/// The rate limit and the delay have no effect on maneuvers that steer by time.
#[test]
fn angle_limit_and_hold_act_on_steering_by_time() {
    let p = PathDriver {
        angle_limit: 0.3,
        rate_limit: 0.1,
        omega: 1e3,
        t_0: 0.0,
        ..driver(Maneuver::SlowlyIncreasingSteer)
    };
    let mut run = DiscreteSimulation::new(PathDriver { hold_start: 0.1, ..p.clone() }).unwrap();
    let wheel: Vec<_> = (0..3).map(|_| run.sample(&at(0.0, 0.0, 0.0, 9.0)).unwrap().steering_wheel).collect();
    assert!(wheel[0] == 0.0 && (wheel[1] - 0.3).abs() < 1e-15 && wheel[2] == wheel[1], "{wheel:?}");
    let mut run = DiscreteSimulation::new(PathDriver { hold_start: 0.0, ..p }).unwrap();
    assert!((0..9).all(|_| run.sample(&at(0.0, 0.0, 0.0, 9.0)).unwrap().steer == 0.0));
}

// Speed.

#[test]
fn the_reference_speed_is_a_ramp_or_a_step() {
    let p = PathDriver { v_0: 10.0, v_1: 16.0, t_v: 0.3, d_v: 0.4, sample_time: 0.1, ..driver(Maneuver::Straight) };
    let speeds = |p: PathDriver| {
        let mut run = DiscreteSimulation::new(p).unwrap();
        (0..10).map(|_| run.sample(&at(0.0, 0.0, 0.0, 9.0)).unwrap()).collect::<Vec<_>>()
    };
    for (k, y) in speeds(p.clone()).into_iter().enumerate() {
        let expected = 10.0 + 6.0 * ((k as f64 - 3.0) / 4.0).clamp(0.0, 1.0);
        assert!((y.speed - expected).abs() < 1e-14, "{k}: {}", y.speed);
        assert_eq!((y.throttle, y.brake), (0.0, 0.0));
    }
    for (k, y) in speeds(PathDriver { d_v: 0.0, ..p }).into_iter().enumerate() {
        assert_eq!(y.speed, if k >= 3 { 16.0 } else { 10.0 }, "{k}");
    }
}

/// In each sample, a = feedforward + k_p error + z. Then z is updated, unless the pedal is saturated and the error has
/// the same sign as a.
#[test]
fn the_pedals_follow_the_law() {
    let p = PathDriver {
        speed_control: true,
        v_0: 10.0,
        v_1: 11.0,
        t_v: 0.2,
        d_v: 0.1,
        sample_time: 0.1,
        ..driver(Maneuver::Straight)
    };
    let mut run = DiscreteSimulation::new(p).unwrap();
    let mut sample = |v: f64| {
        let y = run.sample(&at(0.0, 0.0, 0.0, v)).unwrap();
        ([y.throttle, y.brake], run.state().z)
    };
    let assert_pedals = |found: ([f64; 2], f64), pedals: [f64; 2], z: f64| {
        let ([throttle, brake], found_z) = found;
        assert!((throttle - pedals[0]).abs() < 1e-14 && (brake - pedals[1]).abs() < 1e-14, "{found:?}, {pedals:?}");
        assert!((found_z - z).abs() < 1e-14, "{found:?}, {z}");
    };
    // error 1: a = 1.5; then z = 0.5 * 1 * 0.1
    assert_pedals(sample(9.0), [1.5 / 2.5, 0.0], 0.05);
    // error 2: a = 3.05, saturated: z does not change
    assert_pedals(sample(8.0), [1.0, 0.0], 0.05);
    // the ramp: 10 m/s2 of feedforward; error -1: a = 10 - 1.5 + 0.05, saturated, but the error has the opposite sign
    assert_pedals(sample(11.0), [1.0, 0.0], 0.0);
    // after the ramp, 11 m/s; error -0.2: a = -0.3, not below the deadband
    assert_pedals(sample(11.2), [0.0, 0.0], -0.01);
    // error -1: a = -1.51
    assert_pedals(sample(12.0), [0.0, 1.51 / 8.0], -0.06);
    // error -9: a = -13.56, saturated: z does not change
    assert_pedals(sample(20.0), [0.0, 1.0], -0.06);
    // driving backward is treated as standstill: error 11
    assert_pedals(sample(-3.0), [1.0, 0.0], -0.06);
}

#[test]
fn pedals_stay_released_until_the_brake_ramp() {
    let p = PathDriver {
        speed_control: true,
        release: 20.0,
        brake: 0.6,
        t_brake: 0.5,
        d_brake: 0.2,
        sample_time: 0.1,
        ..driver(Maneuver::Straight)
    };
    for (speed_control, release) in [(true, 20.0), (true, -1.0), (false, -1.0)] {
        let mut run = DiscreteSimulation::new(PathDriver { speed_control, release, ..p.clone() }).unwrap();
        // The vehicle passes station 20 m in the third sample, then moves back.
        for (k, x) in [0.0, 19.9, 20.1, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0].into_iter().enumerate() {
            let z = run.state().z;
            let y = run.sample(&at(x, 0.0, 0.0, 16.0)).unwrap();
            let is_controlled = speed_control && k < 5 && !(release > 0.0 && k >= 2);
            assert_eq!(y.throttle > 0.0, is_controlled, "{k}");
            assert_eq!(run.state().z > z, is_controlled, "{k}");
            let brake = 0.6 * ((k as f64 - 5.0) / 2.0).clamp(0.0, 1.0);
            assert!((y.brake - brake).abs() < 1e-14, "{k}: {}", y.brake);
        }
    }
    // Release at station 0, and a ramp without duration.
    let mut run = DiscreteSimulation::new(PathDriver { release: 0.0, d_brake: 0.0, ..p }).unwrap();
    let y: Vec<_> = (0..7).map(|_| run.sample(&at(0.0, 0.0, 0.0, 16.0)).unwrap()).collect();
    assert!(y.iter().all(|y| y.throttle == 0.0));
    assert_eq!(y.iter().map(|y| y.brake).collect::<Vec<_>>(), [0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.6]);
}

// With a vehicle.

/// A [`BicycleCar`] whose variables can be accessed by name.
struct Car {
    run: ContinuousSimulation<BicycleCar>,
    inputs: bicycle_car::U<f64>,
}

impl Car {
    fn new(speed: f64) -> Self {
        let mut car =
            Self { run: ContinuousSimulation::new(BicycleCar::default()).unwrap(), inputs: Default::default() };
        car.set([speed, 0.0]);
        car
    }

    fn set(&mut self, [speed, steer]: [f64; 2]) {
        self.inputs = named(&[("driver.speed", speed), ("steer.front", steer), ("road_friction.fl", 1.0)]);
    }

    /// Inputs of the driver.
    fn seen(&self) -> U {
        let state = self.run.state();
        let [x, y, yaw, roll_rate] = ["vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "body.roll_rate"]
            .map(|name| value(&state, name));
        U { x, y, yaw, v: value(&self.inputs, "driver.speed"), roll_rate }
    }
}

fn names<B: Variables<f64>>() -> Vec<String> {
    B::declarations().into_iter().map(|declaration| declaration.name).collect()
}

fn value<B: Variables<f64>>(block: &B, name: &str) -> f64 {
    block.reals()[names::<B>().iter().position(|other| other == name).unwrap()]
}

fn named<B: Variables<f64>>(values: &[(&str, f64)]) -> B {
    let of = |name: &String| values.iter().find(|(other, _)| other == name).unwrap().1;
    B::from_reals(&names::<B>().iter().map(of).collect::<Vec<_>>())
}

/// Outputs of a driver that drives the car, in steps of 1 ms.
fn driven(p: PathDriver, speed: f64, time: f64) -> Vec<Y> {
    let mut car = Car::new(speed);
    let mut run = DiscreteSimulation::new(p).unwrap();
    let mut samples = Vec::new();
    for _ in 0..(time * 1e3) as usize {
        let y = run.sample(&car.seen()).unwrap();
        car.set([speed, y.steer]);
        car.run.step(&car.inputs, 1e-3).unwrap();
        samples.push(y);
    }
    samples
}

/// A driver with the wheelbase and the understeer gradient of the car.
fn of_the_car(maneuver: Maneuver) -> PathDriver {
    PathDriver { l: 2.7, k: 0.003198653, v_0: 18.0, ..driver(maneuver) }
}

/// A circle of 100 m at 18 m/s, with limits from the model's specification.
#[test]
fn the_integral_brings_the_car_onto_the_circle() {
    let y = driven(PathDriver { k_i: 0.3, ..of_the_car(Maneuver::Circle) }, 18.0, 36.0);
    let deviation = y.iter().fold(0.0, |largest: f64, y| largest.max(y.e.abs()));
    let last = y.last().unwrap();
    println!("largest deviation {deviation}, at the end {}", last.e);
    assert!(deviation < 0.07, "{deviation}");
    assert!(last.e.abs() < 5e-6, "{}", last.e);
    assert!(!last.lost && !last.finished);
    // a_y = v^2/R requires the angle (L + K v^2)/R.
    assert!((last.steer - (2.7 + 0.003198653 * 324.0) / 100.0).abs() < 1e-5, "{}", last.steer);
}

/// Closed form: without the integral, the deviation is Lp sin(beta) = -0.066 m, with the car's sideslip angle
/// beta = (b - m a v^2/(C_r L))/R. The curvature of the driven circle differs by e/R^2, which changes the deviation by
/// Lp^2/2 e/R^2 = 7e-4 m.
#[test]
fn without_the_integral_the_sideslip_angle_is_left() {
    let y = driven(of_the_car(Maneuver::Circle), 18.0, 30.0);
    let beta = (1.5 - 1500.0 * 1.2 * 324.0 / (110e3 * 2.7)) / 100.0;
    let (e, l_p) = (y.last().unwrap().e, 0.8 * 18.0);
    println!("{e}, {}", l_p * beta);
    assert!((e - l_p * beta).abs() < 1.2e-3, "{e} instead of {}", l_p * beta);
    assert_printed(e, -0.066, 1e-3);
}

/// With a mirrored path and a mirrored vehicle, the results are mirrored bit for bit, because all operations are odd or
/// even functions.
#[test]
fn mirrored_path_and_vehicle_are_mirrored() {
    for maneuver in
        [Maneuver::Circle, Maneuver::DoubleLaneChange, Maneuver::ObstacleAvoidance, Maneuver::SingleLaneChange]
    {
        let p = PathDriver { o: 2.5, k_i: 0.1, ..of_the_car(maneuver) };
        let [left, right] = [false, true].map(|mirror| driven(PathDriver { mirror, ..p.clone() }, 18.0, 9.0));
        let steered = left.iter().any(|y| y.steer > 5e-3);
        assert!(steered, "{maneuver:?}");
        for (y, mirrored) in left.iter().zip(&right) {
            let expected =
                Y { steer: -y.steer, steering_wheel: -y.steering_wheel, e: -y.e, psi_e: -y.psi_e, ..y.clone() };
            assert_eq!(*mirrored, expected, "{maneuver:?}");
        }
    }
}

/// The car drives the whole track, its center stays within the lanes, and the maneuver finishes.
#[test]
fn the_car_drives_the_double_lane_change() {
    let p = of_the_car(Maneuver::DoubleLaneChange);
    let sections = tracks::iso_3888_1(p.x_0, p.w);
    let mut car = Car::new(18.0);
    let mut run = DiscreteSimulation::new(p).unwrap();
    let mut seen = [0; 3];
    let mut finished = 0;
    for _ in 0..12_000 {
        let u = car.seen();
        let y = run.sample(&u).unwrap();
        assert!(!y.lost && y.e.abs() < 0.4, "{y:?}");
        for (section, seen) in sections.iter().zip(&mut seen) {
            if (section.begin..=section.end).contains(&u.x) {
                *seen += 1;
                assert!(section.right + 0.5 < u.y && u.y < section.left - 0.5, "{section:?}: {}", u.y);
            }
        }
        finished += i32::from(y.finished);
        car.set([18.0, y.steer]);
        car.run.step(&car.inputs, 1e-3).unwrap();
    }
    assert!(seen.iter().all(|seen| *seen > 600), "{seen:?}");
    // The straight line takes 175 m / (18 m/s); the detour through the second lane adds to it.
    assert!((2000..2280).contains(&finished), "{finished}");
}

// Arbitrary inputs.

proptest! {
    /// No input causes a panic or an endless search along the path.
    #[test]
    fn no_input_stops_the_driver(
        maneuver in 0..8_i32, k in 1..50_usize,
        values in proptest::collection::vec(prop_oneof![
            -300.0..300.0_f64, proptest::num::f64::ANY, Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e308)
        ], 250)
    ) {
        use fmu::Enumeration as _;
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("path.csv"), "x,y\n0,0\n10,0\n10,10\n0,10\n0,-20\n").unwrap();
        let p = PathDriver {
            o: 2.5, table_file: "path.csv".to_owned(), k_i: 1.0, speed_control: true,
            ..driver(Maneuver::from_value(maneuver).unwrap())
        };
        let mut run = DiscreteSimulation::with_resources(p, folder.path()).unwrap();
        for u in values.chunks_exact(5).take(k) {
            let y = run.sample(&U { x: u[0], y: u[1], yaw: u[2], v: u[3], roll_rate: u[4] }).unwrap();
            prop_assert!((0.0..=1.0).contains(&y.throttle) || y.throttle.is_nan());
        }
    }
}

// The FMU.

type Component = Instance<DiscreteModel<PathDriver>>;

/// An instance with its value references by name.
struct Fmu {
    instance: Component,
    description: Arc<Description>,
}

impl Fmu {
    fn new(resources: &FilePath) -> Self {
        let description = Arc::new(Description::of::<DiscreteModel<PathDriver>>(Format::FMI2, FilePath::new("")));
        let instance = Component::new(Protocol::CS2, Arc::clone(&description), resources.to_owned());
        Self { instance, description }
    }

    fn reference(&self, name: &str) -> u32 {
        let variable = self.description.layout.variables.iter().find(|v| v.declaration.name == name);
        variable.unwrap_or_else(|| panic!("no variable '{name}'")).reference
    }

    fn set(&mut self, name: &str, value: f64) -> Result<(), String> {
        self.instance.set_real(&[self.reference(name)], &[value]).map_err(message)
    }

    fn choose(&mut self, maneuver: Maneuver) {
        self.instance.set_integer(&[self.reference("maneuver")], &[maneuver as i32]).unwrap();
    }

    fn set_file(&mut self, path: &str) {
        self.instance.set_string(&[self.reference("table.file")], &[path.to_owned()]).unwrap();
    }

    fn initialize(&mut self) -> Result<(), String> {
        self.instance.setup_experiment(0.0, None).unwrap();
        self.instance.enter_initialization().unwrap();
        self.instance.exit_initialization().map_err(message)
    }

    /// Simulates step `k` with a moving vehicle, and returns the bits of all outputs.
    fn step(&mut self, k: u32) -> Vec<u64> {
        let w = f64::from(k) * 0.001;
        let inputs = [
            ("vehicle.position_x", 18.0 * w),
            ("vehicle.position_y", 2.0 * w.sin()),
            ("vehicle.yaw", 0.1 * w.cos()),
            ("vehicle.speed", 15.0 + 3.0 * (2.0 * w).sin()),
            ("body.roll_rate", 0.05 * (5.0 * w).cos()),
        ];
        for (name, value) in inputs {
            self.set(name, value).unwrap();
        }
        self.instance.do_step(w, 0.001).unwrap();
        let reals = [
            "driver.steer",
            "driver.speed",
            "driver.throttle",
            "driver.brake",
            "driver.steering_wheel",
            "path.lateral_deviation",
            "path.heading_error",
            "path.distance",
        ];
        let mut values = [0.0; 8];
        self.instance.get_real(&reals.map(|name| self.reference(name)), &mut values).unwrap();
        let flags = ["path.finished", "path.lost"].map(|name| self.instance.get_boolean(self.reference(name)).unwrap());
        values.into_iter().map(f64::to_bits).chain(flags.map(u64::from)).collect()
    }
}

fn message(error: CallError) -> String {
    match error {
        CallError::Error(message) | CallError::Discard(message) => message,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// A state saved at any time continues bit-identically: in the same instance and, after serialization, in another.
    #[test]
    fn a_saved_state_continues_with_the_same_bits(maneuver in 0..8_i32, before in 1..4000_u32, delay in 0.0..0.9_f64) {
        use fmu::Enumeration as _;
        let maneuver = Maneuver::from_value(maneuver).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("path.csv"), "x,y\n0,0\n10,0\n30,1\n60,-1\n").unwrap();
        let start = || {
            let mut fmu = Fmu::new(folder.path());
            fmu.choose(maneuver);
            fmu.set_file("path.csv");
            for (name, value) in [
                ("response.delay", delay), ("lateral.integral_gain", 0.2), ("path.overlap", 2.5), ("path.lost_distance", 1.9),
                ("release.distance", 50.0), ("steer.wheel_rate", 4.0), ("steer.maximum_dwell", 0.4),
                ("steer.hold_time", 0.5), ("steer.return_time", 0.3), ("path.start", 20.0), ("path.run_out", 5.0)
            ] {
                fmu.set(name, value).unwrap();
            }
            let control = fmu.reference("speed.control");
            fmu.instance.set_boolean(&[control], &[true]).unwrap();
            fmu.initialize().unwrap();
            fmu
        };
        let mut fmu = start();
        for k in 0..before {
            fmu.step(k);
        }
        let saved = fmu.instance.snapshot().unwrap();
        let bytes = fmu.instance.serialize(&saved).unwrap();
        let run = |fmu: &mut Fmu| (before..before + 2000).map(|k| fmu.step(k)).collect::<Vec<_>>();
        let expected = run(&mut fmu);
        fmu.instance.restore(&saved).unwrap();
        prop_assert_eq!(&run(&mut fmu), &expected);
        let mut other = start();
        let read = other.instance.deserialize(&bytes).unwrap();
        other.instance.restore(&read).unwrap();
        prop_assert_eq!(&run(&mut other), &expected);
    }
}

/// A value outside the limits of its parameter is rejected when it is set.
#[test]
fn rejects_numbers_outside_their_limits() {
    let mut fmu = Fmu::new(FilePath::new(""));
    for (name, value) in [
        ("path.radius", 0.0),
        ("path.start", -1.0),
        ("path.turn_in", -1e-9),
        ("path.arc", -1.0),
        ("path.run_out", -1.0),
        ("path.vehicle_width", -0.1),
        ("path.overlap", -0.1),
        ("path.change_distance", 0.0),
        ("preview.minimum_distance", 0.0),
        ("response.delay", -0.1),
        ("steer.ratio", 0.0),
        ("geometry.wheelbase", -2.0),
        ("throttle.full_acceleration", 0.0),
        ("brake.full_deceleration", 0.0),
        ("brake.amplitude", 1.1),
        ("path.cut", f64::NAN),
    ] {
        let message = fmu.set(name, value).unwrap_err();
        assert!(message.contains(&format!("'{name}' must be ")), "{message}");
    }
    fmu.set("path.turn_in", 0.0).unwrap();
    fmu.set("response.time_constant", -1.0).unwrap();
    for maneuver in [-1, 8] {
        assert!(fmu.instance.set_integer(&[fmu.reference("maneuver")], &[maneuver]).is_err());
    }
}

/// Inconsistent parameters are rejected at the end of initialization, if the maneuver uses them.
#[test]
fn rejects_what_makes_no_sense() {
    let error = |p: &PathDriver| p.derived().unwrap_err();
    for (maneuver, message) in [
        (
            Maneuver::SlowlyIncreasingSteer,
            "'steer.wheel_amplitude' must not be 0 for 'maneuver' = 6 (slowly_increasing_steer), got 0 rad",
        ),
        (Maneuver::Fishhook, "'steer.wheel_amplitude' must not be 0 for 'maneuver' = 7 (fishhook), got 0 rad"),
    ] {
        assert_eq!(error(&PathDriver { a: 0.0, ..driver(maneuver) }), message);
    }
    assert!(PathDriver { a: 0.0, ..driver(Maneuver::Straight) }.derived().is_ok());
    let overlap = |maneuver, o| PathDriver { o, x_0: 0.1, ..driver(maneuver) };
    assert_eq!(
        error(&overlap(Maneuver::ObstacleAvoidance, 6.0)),
        "'path.overlap' must be at most 5.5 m, half of the second lane, for 'maneuver' = 3 (obstacle_avoidance), got 6 m"
    );
    assert_eq!(
        error(&overlap(Maneuver::DoubleLaneChange, 12.6)),
        "'path.overlap' must be at most 12.5 m, half of the second lane, for 'maneuver' = 2 (double_lane_change), got 12.6 m"
    );
    assert!(overlap(Maneuver::ObstacleAvoidance, 5.5).derived().is_ok());
    assert!(overlap(Maneuver::DoubleLaneChange, 12.5).derived().is_ok());
    assert!(overlap(Maneuver::Circle, 99.0).derived().is_ok());

    let delay = |delay, sample_time| PathDriver { t_d: delay, sample_time, ..PathDriver::default() };
    assert_eq!(
        error(&delay(10.001, 0.001)),
        "'response.delay' = 10.001 s is 10001 samples of 'sample_time' = 0.001 s; it must be at most 10000 samples: use a \
         shorter delay or a longer sample time"
    );
    assert!(delay(10.0004, 0.001).derived().is_ok());
    assert!(error(&delay(1e300, 0.001)).contains("at most 10000 samples"));

    let nowhere = |maneuver| PathDriver { x_0: 0.0, run_out: 0.0, l_c: 0.0, arc: 0.0, l_s: 1e-3, ..driver(maneuver) };
    assert_eq!(
        error(&nowhere(Maneuver::Straight)),
        "'path.start' and 'path.run_out' must make a path of at least 0.000001 m, got 0 m"
    );
    assert_eq!(
        error(&nowhere(Maneuver::Circle)),
        "'path.start', 'path.turn_in' and 'path.arc' must make a path of at least 0.1 m, got 0 m"
    );
    assert_eq!(
        error(&nowhere(Maneuver::SingleLaneChange)),
        "'path.start', 'path.change_distance' and 'path.run_out' must make a path of at least 0.1 m, got 0.001 m"
    );
    let endless = |maneuver| PathDriver { run_out: 1e6, arc: 1e6, ..driver(maneuver) };
    assert_eq!(
        error(&endless(Maneuver::DoubleLaneChange)),
        "'path.start' and 'path.run_out' must make a path of at most 100000 m, got 1000175 m"
    );
    assert!(error(&endless(Maneuver::Circle)).contains("must make a path of at most 100000 m, got 1000080 m"));
    assert_eq!(
        error(&driver(Maneuver::Table)),
        "'table.file' must be the path of a CSV file for 'maneuver' = 5 (table), it is empty"
    );
}

#[test]
fn the_table_comes_from_a_file() {
    const TABLE: &str = "x,y\n0,0\n100,0\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.csv");
    std::fs::write(&file, TABLE).unwrap();
    let mut fmu = Fmu::new(folder.path());
    fmu.choose(Maneuver::Table);
    assert_eq!(fmu.initialize().unwrap_err(), "PathDriver: 'table.file' must be the path of a CSV file, it is empty");
    fmu.set_file("no.csv");
    assert!(
        message(fmu.instance.exit_initialization().unwrap_err()).starts_with("PathDriver: 'table.file' = no.csv: ")
    );
    std::fs::write(&file, "x,y\n0,0\n0,0\n").unwrap();
    fmu.set_file("path.csv");
    let error = message(fmu.instance.exit_initialization().unwrap_err());
    assert!(
        error.starts_with("PathDriver: 'table.file': ") && error.contains("path.csv:3: a point must be "),
        "{error}"
    );
    std::fs::write(&file, TABLE).unwrap();
    fmu.instance.exit_initialization().unwrap();
    let outputs = fmu.step(0);
    assert_eq!(f64::from_bits(outputs[7]), 0.0);

    // A saved state is accepted only with the same points.
    let saved = fmu.instance.snapshot().unwrap();
    let bytes = fmu.instance.serialize(&saved).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_ok());
    std::fs::write(&file, TABLE.replace("100", "101")).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_err());
}

/// Before the first sample, the speed is the initial speed, and all other outputs are 0.
#[test]
fn the_speed_is_valid_from_the_start() {
    let mut fmu = Fmu::new(FilePath::new(""));
    fmu.initialize().unwrap();
    let mut values = [1.0; 2];
    let references = ["driver.speed", "driver.steer"].map(|name| fmu.reference(name));
    fmu.instance.get_real(&references, &mut values).unwrap();
    assert_eq!(values, [60.0 / 3.6, 0.0]);
}
