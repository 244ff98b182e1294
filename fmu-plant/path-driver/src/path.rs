//! The path: points with heading, curvature and station, and the projection of the vehicle onto them.
//!
//! | symbol | meaning |
//! |---|---|
//! | P, theta, kappa, s | a point with its heading, curvature and station (sum of chord lengths) |
//! | Q | position of the vehicle |
//! | j, q | segment from point j to j + 1; relative position of the foot of the perpendicular from Q on it |
//! | e, psi_e | deviation: distance of Q from the path, positive to the left; heading of the vehicle minus heading of the path |
//! | L_c, R | length of the clothoid and radius of the circle |
//! | o | overlap: length by which a transition extends into the coned sections |
//! | xi, sigma | relative length and relative offset in a transition or lane change |
//! | H, L_s | offset and length of the single lane change |

use std::f64::consts::TAU;

use chassis_vehicle::table::Columns;
use fmu::math;

use crate::tracks::{Section, iso_3888_1, iso_3888_2};
use crate::{Maneuver, PathDriver};

/// Spacing of the points of a path that is not a straight line or a table, m.
const SPACING: f64 = 0.1;

/// Maximum number of points with this spacing. Such a path is 100 km long and takes 40 MB.
const MOST_POINTS: f64 = 1e6;

/// Least and greatest distance between neighboring points in a table, m.
const DISTANCES: [f64; 2] = [1e-6, 1e9];

/// A point of the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) theta: f64,
    pub(crate) kappa: f64,
    pub(crate) s: f64,
}

/// Points in the order of their stations, at least two.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub(crate) points: Vec<Point>,
    /// Station at which the maneuver ends.
    pub(crate) end: f64,
}

/// Position of the vehicle on the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) s: f64,
    pub(crate) e: f64,
    /// Within +-pi.
    pub(crate) psi_e: f64,
}

impl Path {
    /// The path of a maneuver; the maneuver `table` needs the name and the columns x and y of its file.
    ///
    /// # Errors
    /// If a parameter or row is invalid.
    pub(crate) fn new(p: &PathDriver, table: Option<(&str, &Columns)>) -> Result<Self, String> {
        match p.maneuver {
            Maneuver::Straight | Maneuver::SlowlyIncreasingSteer | Maneuver::Fishhook => {
                let length = p.x_0 + p.run_out;
                if length < DISTANCES[0] {
                    return Err(format!(
                        "'path.start' and 'path.run_out' must make a path of at least {} m, got {length} m",
                        DISTANCES[0]
                    ));
                }
                Ok(Self::through(vec![[0.0; 3], [length, 0.0, 0.0]], None))
            }
            Maneuver::Circle => {
                let last = last_point(p.x_0 + p.l_c + p.arc, "'path.start', 'path.turn_in' and 'path.arc'")?;
                Ok(Self::through(circle(p, last).into_iter().map(|point| mirrored(p, point)).collect(), None))
            }
            Maneuver::DoubleLaneChange => Self::between_cones(p, iso_3888_1, "2 (double_lane_change)"),
            Maneuver::ObstacleAvoidance => Self::between_cones(p, iso_3888_2, "3 (obstacle_avoidance)"),
            Maneuver::SingleLaneChange => {
                let last =
                    last_point(p.x_0 + p.l_s + p.run_out, "'path.start', 'path.change_distance' and 'path.run_out'")?;
                let points = (0..=last).map(|i| mirrored(p, single_lane_change(p, i as f64 * SPACING)));
                Ok(Self::through(points.collect(), Some(nearest(p.x_0 + p.l_s).min(last))))
            }
            Maneuver::Table => {
                let (file, table) = table
                    .ok_or("'table.file' must be the path of a CSV file for 'maneuver' = 5 (table), it is empty")?;
                Ok(Self::through(table_points(file, table)?, None))
            }
        }
    }

    /// The path through the sections of a track of ISO 3888.
    fn between_cones(p: &PathDriver, track: fn(f64, f64) -> [Section; 3], maneuver: &str) -> Result<Self, String> {
        // Computed for a track that starts at 0, because this does not round any length.
        let [_, second, _] = track(0.0, p.w);
        let most = (second.end - second.begin) / 2.0;
        if p.o > most {
            return Err(format!(
                "'path.overlap' must be at most {most} m, half of the second lane, for 'maneuver' = {maneuver}, got {} m",
                p.o
            ));
        }
        let sections = track(p.x_0, p.w);
        let end = sections[2].end;
        let last = last_point(end + p.run_out, "'path.start' and 'path.run_out'")?;
        let points = (0..=last).map(|i| mirrored(p, lane_changes(p, &sections, i as f64 * SPACING)));
        Ok(Self::through(points.collect(), Some(nearest(end).min(last))))
    }

    /// Adds stations and curvatures to points with headings. The maneuver ends at the point `last_of_maneuver`, or at
    /// the last point.
    fn through(points: Vec<[f64; 3]>, last_of_maneuver: Option<usize>) -> Self {
        let mut points: Vec<Point> =
            points.into_iter().map(|[x, y, theta]| Point { x, y, theta, kappa: 0.0, s: 0.0 }).collect();
        let last = points.len() - 1;
        for i in 1..=last {
            let (before, here) = (points[i - 1], points[i]);
            points[i].s = before.s + distance([before.x, before.y], [here.x, here.y]);
        }
        for i in 1..last {
            let (before, after) = (points[i - 1], points[i + 1]);
            points[i].kappa = (after.theta - before.theta) / (after.s - before.s);
        }
        let end = points[last_of_maneuver.unwrap_or(last)].s;
        Self { points, end }
    }

    /// Projects the position `x`, `y` of a vehicle with the heading `yaw` onto the path. The search starts at the segment of the
    /// last sample and updates it, which resolves paths that cross themselves.
    pub(crate) fn project(&self, segment: &mut u64, [x, y]: [f64; 2], yaw: f64) -> Place {
        let last = self.points.len() - 2;
        let foot = |j: usize| {
            let (p_0, p_1) = (&self.points[j], &self.points[j + 1]);
            let (dx, dy) = (p_1.x - p_0.x, p_1.y - p_0.y);
            ((x - p_0.x) * dx + (y - p_0.y) * dy) / (dx * dx + dy * dy)
        };
        // The segment may come from a deserialized state and can have any value. Each of the two loops moves in one
        // direction only, so both of them end.
        let mut j = usize::try_from(*segment).unwrap_or(last).min(last);
        while j < last && foot(j) >= 1.0 {
            j += 1;
        }
        while j > 0 && foot(j) < 0.0 {
            j -= 1;
        }
        *segment = j as u64;
        let mut q = foot(j);
        // The first and the last segment are extended as straight lines.
        if j > 0 {
            q = q.max(0.0);
        }
        if j < last {
            q = q.min(1.0);
        }
        let (p_0, p_1) = (&self.points[j], &self.points[j + 1]);
        let (dx, dy, length) = (p_1.x - p_0.x, p_1.y - p_0.y, p_1.s - p_0.s);
        let e = (dx * (y - p_0.y - q * dy) - dy * (x - p_0.x - q * dx)) / length;
        let theta = p_0.theta + q.clamp(0.0, 1.0) * (p_1.theta - p_0.theta);
        Place { s: p_0.s + q * length, e, psi_e: within_half_a_turn(yaw - theta) }
    }

    /// Curvature at a station, 1/m: linear between the points, 0 outside the path.
    pub(crate) fn curvature(&self, s: f64) -> f64 {
        let last = self.points.len() - 1;
        if !(s > 0.0 && s < self.points[last].s) {
            return 0.0;
        }
        let next = self.points.partition_point(|point| point.s <= s).clamp(1, last);
        let (p_0, p_1) = (&self.points[next - 1], &self.points[next]);
        p_0.kappa + (s - p_0.s) / (p_1.s - p_0.s) * (p_1.kappa - p_0.kappa)
    }
}

/// Mirrors a point about the line y = 0 if `path.mirror` is true.
fn mirrored(p: &PathDriver, [x, y, theta]: [f64; 3]) -> [f64; 3] {
    if p.mirror { [x, -y, -theta] } else { [x, y, theta] }
}

/// Index of the point nearest to `x` in m.
fn nearest(x: f64) -> usize {
    (x / SPACING + 0.5).floor() as usize
}

/// Index of the last point of a path with this length in m. The parameters `names` determine the length.
fn last_point(length: f64, names: &str) -> Result<usize, String> {
    let most = MOST_POINTS * SPACING;
    if length > most {
        return Err(format!("{names} must make a path of at most {most} m, got {length} m"));
    }
    match nearest(length) {
        0 => Err(format!("{names} must make a path of at least {SPACING} m, got {length} m")),
        last => Ok(last),
    }
}

fn distance([x, y]: [f64; 2], [x_2, y_2]: [f64; 2]) -> f64 {
    ((x_2 - x) * (x_2 - x) + (y_2 - y) * (y_2 - y)).sqrt()
}

/// Points on a straight line, a clothoid and a circle. Each step has the heading at its middle.
fn circle(p: &PathDriver, last: usize) -> Vec<[f64; 3]> {
    let heading = |s: f64| {
        let turned = s - p.x_0;
        if turned <= 0.0 {
            0.0
        } else if turned <= p.l_c {
            turned * turned / (2.0 * p.l_c * p.r)
        } else {
            p.l_c / (2.0 * p.r) + (turned - p.l_c) / p.r
        }
    };
    let mut points = Vec::with_capacity(last + 1);
    let (mut x, mut y) = (0.0, 0.0);
    for i in 0..=last {
        points.push([x, y, heading(i as f64 * SPACING)]);
        let (sin, cos) = math::sin_cos(heading((i as f64 + 0.5) * SPACING));
        x += SPACING * cos;
        y += SPACING * sin;
    }
    points
}

/// The point at `x` on the path through the three lanes. The transitions follow sigma = xi^3 (10 - 15 xi + 6 xi^2),
/// whose slope and curvature are 0 at both ends.
fn lane_changes(p: &PathDriver, [first, second, third]: &[Section; 3], x: f64) -> [f64; 3] {
    let (y_second, y_third, o) = (second.middle() - p.cut, third.middle(), p.o);
    // y and its slope on a transition from y_1 to y_2, which extends into both sections
    let transition = |y_1: f64, y_2: f64, from: f64, to: f64| {
        let length = to - from + 2.0 * o;
        let xi = (x - (from - o)) / length;
        let sigma = xi * xi * xi * (10.0 - 15.0 * xi + 6.0 * xi * xi);
        let slope = 30.0 * xi * xi * (1.0 - xi) * (1.0 - xi) / length;
        [y_1 + (y_2 - y_1) * sigma, (y_2 - y_1) * slope]
    };
    let [y, slope] = if x <= first.end - o {
        [0.0, 0.0]
    } else if x < second.begin + o {
        transition(0.0, y_second, first.end, second.begin)
    } else if x <= second.end - o {
        [y_second, 0.0]
    } else if x < third.begin + o {
        transition(y_second, y_third, second.end, third.begin)
    } else {
        [y_third, 0.0]
    };
    [x, y, math::atan(slope)]
}

/// The point at `x` on the single lane change, whose lateral acceleration is one sine period.
fn single_lane_change(p: &PathDriver, x: f64) -> [f64; 3] {
    let xi = ((x - p.x_0) / p.l_s).clamp(0.0, 1.0);
    let (sin, cos) = math::sin_cos(TAU * xi);
    [x, p.h * (xi - sin / TAU), math::atan(p.h / p.l_s * (1.0 - cos))]
}

/// The points of a table. The heading of a point is the direction between its neighbors, without jumps by whole turns.
fn table_points(file: &str, table: &Columns) -> Result<Vec<[f64; 3]>, String> {
    let points: Vec<[f64; 2]> = table.column(0).iter().zip(table.column(1)).map(|(&x, &y)| [x, y]).collect();
    let [least, most] = DISTANCES;
    let last = points.len() - 1;
    if last == 0 {
        return Err(format!(
            "'table.file': {file}:{}: a path needs at least 2 points, this is the only one",
            table.line(0)
        ));
    }
    for i in 1..=last {
        let apart = distance(points[i - 1], points[i]);
        if !(least..=most).contains(&apart) {
            return Err(format!(
                "'table.file': {file}:{}: a point must be {least} m to {most} m away from the one before, this is {apart} m",
                table.line(i)
            ));
        }
    }
    let mut turns = 0.0;
    let mut before = None;
    let headings = (0..=last).map(|i| {
        let ([x, y], [x_2, y_2]) = (points[i.saturating_sub(1)], points[(i + 1).min(last)]);
        let direction = math::atan2(y_2 - y, x_2 - x);
        if let Some(before) = before.replace(direction) {
            let step = direction - before;
            turns += within_half_a_turn(step) - step;
        }
        direction + turns
    });
    let headings: Vec<f64> = headings.collect();
    Ok(points.into_iter().zip(headings).map(|([x, y], theta)| [x, y, theta]).collect())
}

/// The angle without whole turns, within +-pi: the remainder of IEEE 754, which is exact.
pub(crate) fn within_half_a_turn(angle: f64) -> f64 {
    let mut rest = (angle % (2.0 * TAU)).abs();
    if rest > TAU / 2.0 {
        rest -= TAU;
        if rest >= TAU / 2.0 {
            rest -= TAU;
        }
    }
    if angle < 0.0 { -rest } else { rest }
}
