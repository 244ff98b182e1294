//! Coned tracks: distances to the edges of the sections.

use super::steering_wheel::{OPTIONAL_RATIO, steering_wheel};
use super::{
    Column, Evaluator, LATERAL_ACCELERATION_PEAK, LOAD_TRANSFER_PEAK, ROLL_PEAK, SIDESLIP_PEAK, YAW_RATE_PEAK,
};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, at, largest_magnitude, no_rows, up};
use crate::options::{Fallback, Form, Lane, OptionRule, Options};
use fmu_math::sin_cos;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "cones",
    title: "Coned track",
    source: "ISO 3888-1, ISO 3888-2; the edges of a section are solid, which is stricter than single cones",
    columns: &[
        Column::needed("vehicle.position_x", "m"),
        Column::needed("vehicle.position_y", "m"),
        Column::needed("vehicle.yaw", "rad"),
        Column::optional("vehicle.speed", "m/s"),
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("vehicle.sideslip", "rad"),
        Column::optional("body.roll", "rad"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
        Column::optional("driver.steering_wheel", "rad"),
        Column::optional("driver.steer", "rad"),
        Column::optional("vehicle.load_transfer_ratio", "1"),
    ],
    options: &[
        OptionRule::new("vehicle.width", "m", Form::Positive, Fallback::Required)
            .is("width of the vehicle's footprint, which also sets the widths of the sections"),
        OptionRule::new("footprint.front", "m", Form::NotNegative, Fallback::Required)
            .is("distance from the reference point to the front end of the vehicle"),
        OptionRule::new("footprint.rear", "m", Form::NotNegative, Fallback::Required)
            .is("distance from the reference point to the rear end"),
        OptionRule::new("maneuver", "1", Form::Integer(&[2, 3]), Fallback::Number(2.0))
            .is("track: 2 is ISO 3888-1, 3 is ISO 3888-2"),
        OptionRule::new("path.start", "m", Form::Number, Fallback::Number(50.0))
            .is("x of the first cones"),
        OptionRule::new("path.mirror", "1", Form::Integer(&[0, 1]), Fallback::Number(0.0))
            .is("1 mirrors the track: the first lane change is to the right"),
        OptionRule::new("lanes", "m", Form::Lanes, Fallback::Absent)
            .is("another track, as a list of sections [x begin, x end, right edge, left edge]; `maneuver`, `path.start` and `path.mirror` then have no effect"),
        OPTIONAL_RATIO,
    ],
    metrics: &[
        Definition::neutral("margins", "Margins", "m")
            .is("For each section, the smallest distance, over all rows, between the part of the footprint inside the section and the edges; negative \
             beyond an edge. Null if the footprint is never inside."),
        Definition::higher("entry_speed", "Entry speed", "m/s")
            .is("Speed when the reference point passes the start of the first section."),
        Definition::neutral("exit_speed", "Exit speed", "m/s")
            .is("Speed when the reference point passes the end of the last section."),
        Definition::neutral("time", "Time", "s").is("Time between entry and exit."),
        Definition::neutral("passed", "Passed", "1")
            .is("True if no margin is negative and the reference point passes the end of the last section."),
        Definition::neutral("first_hit", "First hit", "s, 1")
            .is("Time of the first negative margin, and the number of its section, from 1. Null if there is none."),
        Definition::neutral("tightest", "Tightest place", "s, 1")
            .is("Time of the smallest margin in any section, and the number of that section, from 1."),
        LATERAL_ACCELERATION_PEAK,
        SIDESLIP_PEAK,
        ROLL_PEAK,
        YAW_RATE_PEAK,
        Definition::neutral("steering_wheel_peak", "Peak of the steering wheel angle", "rad")
            .is("Largest magnitude in the run."),
        LOAD_TRANSFER_PEAK,
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let wheel = steering_wheel(rows, options).and_then(|angle| largest_magnitude(&angle).ok_or_else(no_rows));
    results.set("steering_wheel_peak", wheel);

    let [x, y, yaw] = ["vehicle.position_x", "vehicle.position_y", "vehicle.yaw"].map(|column| rows.column(column));
    let (x, y, yaw) = (x?, y?, yaw?);
    let lanes = lanes(options);
    let (Some(first), Some(last)) = (lanes.first(), lanes.last()) else {
        return Err("the track has no section".to_owned());
    };
    let passes = |level: f64, what: &str| {
        let crossing = up(rows.times, x, level, 0).map(|crossing| crossing.time);
        crossing.ok_or_else(|| format!("the reference point does not pass {what} at {level} m"))
    };
    let (entry, exit) =
        (passes(first[0], "the start of the first section"), passes(last[1], "the end of the last section"));
    let speed = |time: &Result<f64, Reason>| {
        let (time, speed) = (time.clone()?, rows.column("vehicle.speed")?);
        at(rows.times, speed, time).ok_or_else(|| "the recording ends before that time".to_owned())
    };
    results.set("entry_speed", speed(&entry));
    results.set("exit_speed", speed(&exit));
    results.set("time", entry.and_then(|entry| Ok(exit? - entry)));

    let footprint = Footprint {
        half_width: 0.5 * options.number("vehicle.width"),
        front: options.number("footprint.front"),
        rear: options.number("footprint.rear"),
    };
    let mut margins = vec![None; lanes.len()];
    let mut hit = None;
    let mut tightest: Option<(f64, f64, usize)> = None;
    for row in 0..rows.times.len() {
        let corners = footprint.corners(x[row], y[row], yaw[row]);
        for (index, lane) in lanes.iter().enumerate() {
            let Some(margin) = margin(&corners, lane) else { continue };
            if margin < 0.0 && hit.is_none() {
                hit = Some((rows.times[row], index + 1));
            }
            if tightest.is_none_or(|(smallest, ..)| margin < smallest) {
                tightest = Some((margin, rows.times[row], index + 1));
            }
            let smallest: &mut Option<f64> = &mut margins[index];
            *smallest = Some(smallest.map_or(margin, |smallest| smallest.min(margin)));
        }
    }
    let is_finished = x.iter().any(|x| *x >= last[1]);
    let passed = if !is_finished || hit.is_some() {
        Ok(false)
    } else if margins.contains(&None) {
        Err("the vehicle is not inside at least one section in any row".to_owned())
    } else {
        Ok(true)
    };
    results.set("passed", passed);
    let hit = hit.map(|(time, section)| vec![time, section as f64]);
    results.set("first_hit", hit.ok_or_else(|| "no margin is negative".to_owned()));
    let tightest = tightest.map(|(_, time, section)| vec![time, section as f64]);
    results.set("tightest", tightest.ok_or_else(|| "the vehicle is not inside a section in any row".to_owned()));
    results.set("margins", margins);
    Ok(())
}

fn lanes(options: &Options) -> Vec<Lane> {
    if let Some(lanes) = options.lanes("lanes") {
        return lanes;
    }
    let is_mirrored = options.number("path.mirror") == 1.0;
    let part = if options.number("maneuver") == f64::from(Part::Two.option()) { Part::Two } else { Part::One };
    track(part, options.number("path.start"), options.number("vehicle.width"), is_mirrored).to_vec()
}

/// Parts of ISO 3888.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    One,
    Two,
}

impl Part {
    pub(crate) const ALL: [Self; 2] = [Self::One, Self::Two];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::One => "iso3888_1",
            Self::Two => "iso3888_2",
        }
    }

    /// Name of the driver's maneuver.
    pub(crate) fn maneuver(self) -> &'static str {
        match self {
            Self::One => "double_lane_change",
            Self::Two => "obstacle_avoidance",
        }
    }

    /// Value for the evaluator's option `maneuver`.
    pub(crate) fn option(self) -> u8 {
        match self {
            Self::One => 2,
            Self::Two => 3,
        }
    }
}

/// The sections of a track for a vehicle of the given width, m.
pub(crate) fn track(part: Part, start: f64, width: f64, is_mirrored: bool) -> [Lane; 3] {
    let sections = match part {
        Part::One => moderate(width),
        Part::Two => severe(width),
    };
    sections.map(|[begin, end, right, left]| {
        // Mirroring turns the left edge into the right edge.
        let (right, left) = if is_mirrored { (-left, -right) } else { (right, left) };
        [start + begin, start + end, right, left]
    })
}

/// ISO 3888-1 for a vehicle of the given width, m: begin and end of each section relative to the start, right and left
/// edge. The right edges of the first and last section are in line.
fn moderate(width: f64) -> [[f64; 4]; 3] {
    let half = 0.5 * (1.1 * width + 0.25);
    [
        [0.0, 15.0, -half, half],
        [45.0, 70.0, -half + 3.5, -half + 3.5 + 1.2 * width + 0.25],
        [95.0, 125.0, -half, -half + 1.3 * width + 0.25],
    ]
}

/// ISO 3888-2. The left edges of the first and last section are in line.
fn severe(width: f64) -> [[f64; 4]; 3] {
    let half = 0.5 * (1.1 * width + 0.25);
    [
        [0.0, 12.0, -half, half],
        [25.5, 36.5, half + 1.0, half + 1.0 + width + 1.0],
        [49.0, 61.0, half - (1.3 * width + 0.25).max(3.0), half],
    ]
}

/// Outline of the vehicle on the road, a rectangle, m.
struct Footprint {
    half_width: f64,
    front: f64,
    rear: f64,
}

impl Footprint {
    /// Corners in the order around the rectangle.
    fn corners(&self, x: f64, y: f64, yaw: f64) -> [[f64; 2]; 4] {
        let (sin, cos) = sin_cos(yaw);
        let (front, rear, side) = (self.front, -self.rear, self.half_width);
        [[front, side], [front, -side], [rear, -side], [rear, side]]
            .map(|[ahead, left]| [x + ahead * cos - left * sin, y + ahead * sin + left * cos])
    }
}

/// Smallest distance from the edges of a section to the part of a rectangle that is inside the section; `None` if no
/// part is inside.
fn margin(corners: &[[f64; 2]; 4], [begin, end, right, left]: &Lane) -> Option<f64> {
    let inside = corners.iter().filter(|[x, _]| (begin..=end).contains(&x)).map(|[_, y]| *y);
    let cut = (0..corners.len()).flat_map(|index| {
        let ([ax, ay], [bx, by]) = (corners[index], corners[(index + 1) % corners.len()]);
        [*begin, *end].map(|x| {
            let crosses = (ax < x && x < bx) || (bx < x && x < ax);
            crosses.then(|| ay + (x - ax) / (bx - ax) * (by - ay))
        })
    });
    let distances = inside.chain(cut.flatten()).map(|y| (left - y).min(y - right));
    distances.reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_edges(track: [[f64; 4]; 3], expected: [[f64; 2]; 3]) {
        for ([_, _, right, left], [expected_right, expected_left]) in track.into_iter().zip(expected) {
            assert!((right - expected_right).abs() < 1e-12 && (left - expected_left).abs() < 1e-12, "{right} {left}");
        }
    }

    /// In the mirror image, left and right edges are exchanged.
    #[test]
    fn a_mirror_swaps_the_edges() {
        for part in [Part::One, Part::Two] {
            let track_of = |is_mirrored| track(part, 10.0, 2.0, is_mirrored);
            for ([begin, end, right, left], mirrored) in track_of(false).into_iter().zip(track_of(true)) {
                assert_eq!(mirrored, [begin, end, -left, -right]);
            }
        }
    }

    /// Check numbers for a width of 1.61 m.
    #[test]
    fn sections_of_both_tracks() {
        assert_edges(moderate(1.61), [[-1.0105, 1.0105], [2.4895, 4.6715], [-1.0105, 1.3325]]);
        assert_edges(severe(1.61), [[-1.0105, 1.0105], [2.0105, 4.6205], [-1.9895, 1.0105]]);
    }

    /// A rectangle of 4 m by 2 m in a lane 3 m wide. Distances computed by hand.
    #[test]
    fn margins_of_a_rectangle() {
        let lane = [0.0, 10.0, -1.5, 1.5];
        let footprint = Footprint { half_width: 1.0, front: 2.0, rear: 2.0 };
        let margin = |x, y, yaw| margin(&footprint.corners(x, y, yaw), &lane);
        assert_eq!(margin(5.0, 0.0, 0.0), Some(0.5));
        assert_eq!(margin(5.0, 0.25, 0.0), Some(0.25));
        assert_eq!(margin(5.0, -0.75, 0.0), Some(-0.25));
        // Only the half inside the lane is evaluated.
        assert_eq!(margin(0.0, 0.25, 0.0), Some(0.25));
        assert_eq!(margin(-2.5, 0.0, 0.0), None);
        assert_eq!(margin(12.5, 0.0, 0.0), None);
        // Across the lane, the front end is half a meter beyond the left edge.
        let across = margin(5.0, 0.0, std::f64::consts::FRAC_PI_2).unwrap();
        assert!((across + 0.5).abs() < 1e-15);
        // The rectangle extends beyond both ends of the section.
        let short = [4.9, 5.1, -1.5, 1.5];
        assert_eq!(super::margin(&footprint.corners(5.0, 0.25, 0.0), &short), Some(0.25));
    }
}
