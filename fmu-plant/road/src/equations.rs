//! Equations of the road: height and friction under each wheel, as functions of the distance traveled.
//!
//! | symbol | meaning |
//! |---|---|
//! | s, u, Ts | distance of the front axle, speed, sample time |
//! | l | distance of an axle behind the front axle |
//! | z, mu | height of the road, factor on the tire friction |
//! | x_0, x_l, A | start, length and height of the obstacle |
//! | Gd, n00, ds | roughness coefficient, cutoff and grid of shaped noise |
//!
//! ```text
//! z of a wheel = profile of its side at (s - l) + A obstacle((s - l or t) - x_0)
//! s <- s + u Ts                                  (after the heights: forward Euler)
//! ```
//!
//! The front axle starts at distance 0, the axles behind it start at negative distances. Flat road, harmonics and table
//! are defined for every distance, so they are also correct for a vehicle that rolls back. Shaped noise is generated
//! only in the forward direction, and the last [`HISTORY`] grid points up to the farthest position of the front axle
//! are kept (10.2 m with a spacing of 1 cm). A vehicle that rolls back within this distance gets bit-identical heights;
//! an axle that is farther back gets the oldest height.

use chassis_vehicle::positions::{RearAxles, Sides, SixWheels, axle_of};
use chassis_vehicle::random::Normals;
use chassis_vehicle::road::{AllPass, Harmonics, Mixture, ShapedNoise, bump, class_coefficient, trapezoid};
use chassis_vehicle::table::Table;
use fmu::slack;

use crate::{D, ObstacleShape, Profile, Road, RoughnessStart, Tracks, U, X, Y};

/// Number of grid points of shaped noise that are stored for the axles behind the front axle; a power of two.
pub(crate) const HISTORY: usize = 1024;

/// Position of grid point 0 in units of `roughness.spacing`: the first [`HISTORY`] points then end at 1, the far end of
/// the cell in which the front axle starts.
const FIRST: f64 = 2.0 - HISTORY as f64;

/// Maximum number of grid points of shaped noise per sample (50 ms of computation). A speed that needs more is a
/// mistake.
const MOST_POINTS: f64 = 1e6;

/// Largest standard deviation of stationary shaped noise in m. Class H, the worst of ISO 8608, has 0.61 m with the
/// cutoff of the standard. Above 1 m, the heights, up to three times the standard deviation, are unrealistic.
const HIGHEST: f64 = 1.0;

/// Tolerance for rounding, as a fraction of a cell.
const SLACK: f64 = 1e-6;

/// Returns true if an output can depend on a parameter. The distance depends only on the sample time. Friction depends
/// on `friction.*` and on the offset of its axle, height on all parameters except `friction.*`. Neither depends on
/// parameters of the other side.
pub(crate) fn influence(output: &str, parameter: &str) -> bool {
    let Some((signal, place)) = output.split_once('.').filter(|(signal, _)| *signal != "road") else {
        return parameter == "sample_time";
    };
    let (axle, is_left) = (place.strip_suffix(['l', 'r']).unwrap_or_default(), place.ends_with('l'));
    let is_own_side = match parameter.rsplit(['.', '_']).next() {
        Some("left") => is_left,
        Some("right") => !is_left,
        _ => true,
    };
    is_own_side
        && match parameter.split('.').next() {
            Some("friction") => signal == "road_friction",
            Some("geometry") if signal == "road_friction" => match parameter.rsplit('.').next() {
                Some("middle") => axle == "m",
                Some("rear") => axle == "r",
                _ => false,
            },
            Some("sample_time") => true,
            // the track width determines the delay of the right side
            _ => signal == "road_height" && (parameter != "geometry.track" || !is_left),
        }
}

impl Default for X {
    fn default() -> Self {
        Self {
            s: 0.0,
            s_excess: 0.0,
            points: 0,
            noise: [0.0; 2],
            all_pass: [0.0; 2],
            changed: false,
            left: Box::new([0.0; HISTORY]),
            right: Box::new([0.0; HISTORY]),
        }
    }
}

/// The profile with its precomputed data.
#[derive(Clone, Debug)]
pub(crate) enum Surface {
    Flat,
    Noise(Noise),
    Harmonics { left: Harmonics, right: Harmonics },
    Table(Heights),
}

/// Computation of the right track from the profiles.
#[derive(Clone, Copy, Debug)]
enum Pair {
    Same,
    Independent,
    Mixed(Mixture),
    Delayed(AllPass),
}

#[derive(Clone, Debug)]
pub(crate) struct Noise {
    pair: Pair,
    process: ShapedNoise,
    changed: ShapedNoise,
    /// Number of the last grid point with height 0; `None`: stationary from the first point on
    last_zero: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Heights {
    table: Table,
    pair: Pair,
    /// All-pass state at every row, for delayed tracks
    all_pass: Vec<[f64; 2]>,
}

/// Reads the profile table: columns `distance`, `height_left`, `height_right` in m.
pub(crate) fn parse_table(text: &str, path: &str) -> Result<Table, String> {
    let names = ["height_left", "height_right"];
    let table = Table::parse(text, path, "distance", &names)?;
    match (0..names.len()).find(|index| table.column(*index).is_none()) {
        Some(missing) => {
            Err(format!("{path}: column `{}` is missing, expected distance, height_left, height_right", names[missing]))
        }
        None => Ok(table),
    }
}

/// Computes the constant data of a run; the profile `Table` needs the `table`.
pub(crate) fn derived(p: &Road, table: Option<Table>) -> Result<D, String> {
    let coefficient = class_coefficient(p.class).unwrap_or(p.g_d);
    let pair = match p.tracks {
        Tracks::Same => Pair::Same,
        Tracks::Independent => Pair::Independent,
        Tracks::Mixed => Pair::Mixed(Mixture::new(p.rho)),
        Tracks::Delayed => Pair::Delayed(AllPass::new(p.t_track)),
    };
    if matches!(p.obstacle, ObstacleShape::Bump | ObstacleShape::Trapezoid) && p.x_l <= 0.0 {
        return Err(format!("'obstacle.length' must be positive for a bump or trapezoid, got {}", p.x_l));
    }
    let surface = match p.profile {
        Profile::Flat => Surface::Flat,
        Profile::ShapedNoise => Surface::Noise(noise(p, coefficient, pair)?),
        Profile::Harmonics => harmonics(p, coefficient, pair),
        Profile::Table => Surface::Table(heights(
            table.ok_or("'table.file' must be the path of a CSV file for 'profile' = 3 (table), it is empty")?,
            pair,
        )),
    };
    Ok(D { surface })
}

fn noise(p: &Road, coefficient: f64, pair: Pair) -> Result<Noise, String> {
    let changed = class_coefficient(p.class_change).unwrap_or(coefficient);
    let process = ShapedNoise::new(coefficient, p.n_00, p.ds);
    let changed = ShapedNoise::new(changed, p.n_00, p.ds);
    let changes = p.t_change > 0.0;
    let deviation = if changes { process.deviation.max(changed.deviation) } else { process.deviation };
    if deviation > HIGHEST {
        let reason = if changes { " ('roughness.change_class' included)" } else { "" };
        return Err(format!(
            "'roughness.cutoff' = {} 1/m: the heights of this roughness{reason} would have a standard deviation of \
             {deviation:.3} m, at most {HIGHEST} m is allowed; use a cutoff of {:.3e} 1/m or more",
            p.n_00,
            p.n_00 * (deviation / HIGHEST).powi(2)
        ));
    }
    // The stored points span one cell more than this: the front axle can be just before the far end of its cell.
    let longest = (HISTORY - 3) as f64 * p.ds;
    for (place, offset) in RearAxles::<f64>::ELEMENTS.iter().zip(*p.l) {
        if offset > longest {
            return Err(format!(
                "'geometry.axle_offset.{}' = {offset} m must be at most {longest} m, over which shaped noise is kept \
                 with 'roughness.spacing' = {} m; use a larger spacing",
                place.name, p.ds
            ));
        }
    }
    Ok(Noise {
        pair,
        process,
        changed,
        last_zero: match p.start {
            RoughnessStart::Stationary => None,
            RoughnessStart::ZeroUpToFrontAxle => Some(-FIRST),
            // the grid point at the rear axle, or the first one before it
            RoughnessStart::ZeroUpToRearAxle => Some(-FIRST - (p.l[0].max(p.l[1]) / p.ds).floor()),
        },
    })
}

/// Both tracks as sums of cosines: mixing and delaying act on the complex amplitudes.
fn harmonics(p: &Road, coefficient: f64, pair: Pair) -> Surface {
    let seed = u64::from(p.seed.unsigned_abs());
    let first = Harmonics::amplitudes(coefficient, seed);
    let second = || Harmonics::amplitudes(coefficient, seed + 1_000_003);
    let (left, right) = match pair {
        Pair::Same => (first.clone(), first),
        Pair::Independent => (first, second()),
        Pair::Mixed(mixture) => first
            .iter()
            .zip(&second())
            .map(|(a, b)| {
                let [re_l, re_r] = mixture.tracks([a[0], b[0]]);
                let [im_l, im_r] = mixture.tracks([a[1], b[1]]);
                ([re_l, im_l], [re_r, im_r])
            })
            .unzip(),
        Pair::Delayed(filter) => {
            let delayed = (0..Harmonics::COUNT)
                .zip(&first)
                .map(|(k, a)| {
                    let h = filter.response(Harmonics::wavenumber(k));
                    [a[0] * h[0] - a[1] * h[1], a[0] * h[1] + a[1] * h[0]]
                })
                .collect();
            (first, delayed)
        }
    };
    Surface::Harmonics { left: Harmonics::new(&left), right: Harmonics::new(&right) }
}

fn heights(table: Table, pair: Pair) -> Heights {
    let mut all_pass = Vec::new();
    if let (Pair::Delayed(filter), Some(z)) = (pair, table.column(0)) {
        let mut x = filter.steady(z[0]);
        all_pass.push(x);
        for (z, s) in z.windows(2).zip(table.abscissa().windows(2)) {
            x = filter.advance(x, z[0], z[1], s[1] - s[0]);
            all_pass.push(x);
        }
    }
    Heights { table, pair, all_pass }
}

/// Rejects a speed that makes the distance infinite or passes too many grid points of shaped noise in one sample.
pub(crate) fn check(p: &Road, d: &D, x: &X, u: &U) -> Result<(), String> {
    let next = x.s + u.u * p.sample_time;
    if !next.is_finite() {
        return Err(format!(
            "'vehicle.speed' = {} m/s leads from 'road.distance' = {} m to {next} m; the distance must stay finite",
            u.u, x.s
        ));
    }
    if let Surface::Noise(_) = d.surface {
        let here = points_up_to(p, x.s);
        let points = x.points as f64;
        let most = (here - points).max(points_up_to(p, next) - here.max(points));
        if most > MOST_POINTS {
            return Err(format!(
                "'vehicle.speed' = {} m/s at 'road.distance' = {} m passes over {most:e} grid points of \
                 'roughness.spacing' = {} m in one sample; at most {MOST_POINTS:e} are possible",
                u.u, x.s, p.ds
            ));
        }
    }
    Ok(())
}

/// One sample at the time `t`: returns the outputs at the distance reached, and updates the distance.
pub(crate) fn sample(p: &Road, d: &D, x: &mut X, u: &U, t: f64) -> Y {
    let s = x.s;
    if let Surface::Noise(noise) = &d.surface {
        noise.generate(p, x);
        // The class changes only after the points up to here have been generated. It thus changes at the same point for
        // any sample time.
        x.changed |= p.t_change > 0.0 && t >= p.t_change - slack(p.sample_time, t);
    }

    let axles = [0.0, p.l[0], p.l[1]].map(|l| {
        let place = s - l;
        let [z_l, z_r] = d.surface.heights(p, x, place);
        let obstacle = if p.obstacle_in_time {
            p.obstacle.height(t - p.x_0, p.x_l, slack(p.sample_time, t))
        } else {
            p.obstacle.height(place - p.x_0, p.x_l, 0.0)
        };
        let z = [z_l + p.a_left * obstacle, z_r + p.a_right * obstacle];
        let changed = p.x_mu > 0.0 && place >= p.x_mu;
        let mu = if changed { [p.mu_changed_left, p.mu_changed_right] } else { [p.mu_left, p.mu_right] };
        (z, mu)
    });

    // Kahan summation: the rounding error of this sum is subtracted from the next step.
    let step = u.u * p.sample_time - x.s_excess;
    x.s = s + step;
    x.s_excess = (x.s - s) - step;

    let (z_front, mu_front) = axles[0];
    Y {
        z: SixWheels::from_fn(|i| axles[axle_of(i)].0[i % 2]),
        z_side: Sides(z_front),
        mu: SixWheels::from_fn(|i| axles[axle_of(i)].1[i % 2]),
        mu_side: Sides(mu_front),
        s,
    }
}

impl ObstacleShape {
    /// Height at `x` after the start of the obstacle, relative to its height.
    fn height(self, x: f64, length: f64, slack: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Bump => bump(x, length),
            Self::Trapezoid => trapezoid(x, length),
            Self::Step => f64::from(u8::from(x >= -slack)),
        }
    }
}

impl Surface {
    /// Left and right height at a distance.
    fn heights(&self, p: &Road, x: &X, place: f64) -> [f64; 2] {
        match self {
            Self::Flat => [0.0; 2],
            Self::Noise(_) => x.heights(place / p.ds),
            Self::Harmonics { left, right } => [left.height(place), right.height(place)],
            Self::Table(heights) => heights.at(place),
        }
    }

    /// Hash of the file; 0 if there is no file.
    pub(crate) fn content_hash(&self) -> u64 {
        match self {
            Self::Table(heights) => heights.table.content_hash(),
            _ => 0,
        }
    }
}

/// Number of grid points up to the far end of the cell that contains a distance. If the distance is just before the
/// next cell, the next cell is included, so rounding has no effect.
fn points_up_to(p: &Road, s: f64) -> f64 {
    (s / p.ds + SLACK).floor() + 2.0 - FIRST
}

impl Noise {
    /// Generates the grid points up to the far end of the front axle's cell.
    fn generate(&self, p: &Road, x: &mut X) {
        let missing = points_up_to(p, x.s) - x.points as f64;
        if missing <= 0.0 {
            return;
        }
        let seed = u64::from(p.seed.unsigned_abs());
        let two = matches!(self.pair, Pair::Independent | Pair::Mixed(_));
        let mut normals = [0, 1].map(|stream| Normals::new(seed, stream, x.points));
        let process = if x.changed { &self.changed } else { &self.process };
        for _ in 0..missing as u64 {
            let last = x.noise[0];
            let zero = self.last_zero.is_some_and(|last| x.points as f64 <= last);
            let count = if two { 2 } else { 1 };
            for (z, normals) in x.noise.iter_mut().zip(&mut normals).take(count) {
                let normal = normals.draw();
                *z = if zero {
                    0.0
                } else if x.points == 0 {
                    process.deviation * normal
                } else {
                    process.next(*z, normal)
                };
            }
            let z = x.noise[0];
            let [left, right] = match self.pair {
                Pair::Same => [z, z],
                Pair::Independent => x.noise,
                Pair::Mixed(mixture) => mixture.tracks(x.noise),
                Pair::Delayed(filter) => {
                    x.all_pass =
                        if x.points == 0 { filter.steady(z) } else { filter.advance(x.all_pass, last, z, p.ds) };
                    [z, filter.output(x.all_pass, z)]
                }
            };
            let place = (x.points % HISTORY as u64) as usize;
            x.left[place] = left;
            x.right[place] = right;
            x.points += 1;
        }
    }
}

impl X {
    /// Heights of both tracks at a distance in grid spacings: interpolated linearly between the stored points; before
    /// them, the oldest height is held.
    fn heights(&self, place: f64) -> [f64; 2] {
        let number = place - FIRST;
        let newest = self.points.saturating_sub(1);
        let oldest = self.points.saturating_sub(HISTORY as u64);
        let cell = number.floor().clamp(oldest as f64, newest.saturating_sub(1) as f64);
        let share = (number - cell).clamp(0.0, 1.0);
        let a = (cell as u64 % HISTORY as u64) as usize;
        let b = (a + 1) % HISTORY;
        [&self.left, &self.right].map(|z| z[a] + (z[b] - z[a]) * share)
    }
}

impl Heights {
    fn at(&self, place: f64) -> [f64; 2] {
        // `parse_table` has checked both columns
        let column = |index| self.table.at(index, place).unwrap_or(0.0);
        let z = column(0);
        match self.pair {
            Pair::Same => [z, z],
            Pair::Independent => [z, column(1)],
            Pair::Mixed(mixture) => mixture.tracks([z, column(1)]),
            Pair::Delayed(filter) => {
                let Some(row) = self.table.next_row(place).checked_sub(1) else {
                    return [z, z];
                };
                let start = self.table.abscissa()[row];
                let at_row = self.table.at(0, start).unwrap_or(0.0);
                let x = if place > start {
                    filter.advance(self.all_pass[row], at_row, z, place - start)
                } else {
                    self.all_pass[row]
                };
                [z, filter.output(x, z)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chassis_vehicle::road::{REFERENCE_WAVENUMBER, fourier_sum};
    use fmu::Enumeration as _;

    const CLASS_C: f64 = 256e-6;

    /// A road and its discrete state during a drive.
    #[derive(Clone)]
    struct Drive {
        p: Road,
        d: D,
        x: X,
        sample: u64,
    }

    impl Drive {
        fn new(p: Road) -> Self {
            Self::with_table(p, None)
        }

        fn with_table(p: Road, table: Option<Table>) -> Self {
            let d = derived(&p, table).unwrap();
            Self { p, d, x: X::default(), sample: 0 }
        }

        fn step(&mut self, speed: f64) -> Y {
            let t = self.sample as f64 * self.p.sample_time;
            self.sample += 1;
            let u = U { u: speed };
            check(&self.p, &self.d, &self.x, &u).unwrap();
            sample(&self.p, &self.d, &mut self.x, &u, t)
        }

        /// Left and right height of the front axle at every sample.
        fn tracks(&mut self, speed: f64, samples: usize) -> [Vec<f64>; 2] {
            let outputs: Vec<Y> = (0..samples).map(|_| self.step(speed)).collect();
            [0, 1].map(|side| outputs.iter().map(|y| y.z[side]).collect())
        }
    }

    fn table() -> Table {
        parse_table("distance,height_left,height_right\n1,0,0.5\n2,0.1,0\n4,-0.1,0.2\n4.5,0.3,0.1\n", "a.csv").unwrap()
    }

    /// All combinations of profiles and relations between the tracks.
    fn roads() -> impl Iterator<Item = Drive> {
        (0..16).map(|i| {
            let p = Road {
                profile: Profile::from_value(i / 4).unwrap(),
                tracks: Tracks::from_value(i % 4).unwrap(),
                rho: 0.6,
                l: RearAxles([2.95, 4.6]),
                ..Road::default()
            };
            Drive::with_table(p, Some(table()))
        })
    }

    /// Mean spectra over half-overlapping Hann windows (Welch 1967): one-sided PSDs of both tracks, their cross
    /// spectrum, the distance between bins in 1/m and the number of windows.
    struct Spectra {
        left: Vec<f64>,
        right: Vec<f64>,
        cross: Vec<[f64; 2]>,
        resolution: f64,
        windows: f64,
    }

    fn welch([left, right]: &[Vec<f64>; 2], ds: f64, length: usize) -> Spectra {
        let window: Vec<f64> =
            (0..length).map(|i| (1.0 - (std::f64::consts::TAU * i as f64 / length as f64).cos()) / 2.0).collect();
        let scale = 2.0 * ds / window.iter().map(|w| w * w).sum::<f64>();
        let spectrum = |part: &[f64]| {
            let mut x: Vec<[f64; 2]> = part.iter().zip(&window).map(|(z, w)| [z * w, 0.0]).collect();
            fourier_sum(&mut x);
            x
        };
        let mut s = Spectra {
            left: vec![0.0; length / 2],
            right: vec![0.0; length / 2],
            cross: vec![[0.0; 2]; length / 2],
            resolution: 1.0 / (ds * length as f64),
            windows: 0.0,
        };
        let mut start = 0;
        while start + length <= left.len() {
            let l = spectrum(&left[start..start + length]);
            let r = spectrum(&right[start..start + length]);
            for k in 0..length / 2 {
                s.left[k] += scale * (l[k][0].powi(2) + l[k][1].powi(2));
                s.right[k] += scale * (r[k][0].powi(2) + r[k][1].powi(2));
                s.cross[k][0] += scale * (l[k][0] * r[k][0] + l[k][1] * r[k][1]);
                s.cross[k][1] += scale * (l[k][0] * r[k][1] - l[k][1] * r[k][0]);
            }
            s.windows += 1.0;
            start += length / 2;
        }
        for k in 0..length / 2 {
            s.left[k] /= s.windows;
            s.right[k] /= s.windows;
            s.cross[k] = s.cross[k].map(|value| value / s.windows);
        }
        s
    }

    /// Heights every 1 cm.
    fn long_road(p: Road, points: usize) -> [Vec<f64>; 2] {
        Drive::new(p).tracks(10.0, points)
    }

    /// Reference: the one-sided PSD Gd n0^2/(n^2 + n00^2) of first-order shaped noise, which approaches Gd (n/n0)^-2
    /// (ISO 8608) above n00. In third-octave bands from 0.02 to 5 1/m, the mean of estimate/reference over m bins and K
    /// windows must be 1. The tolerance is four standard errors sqrt(1.94 * 1.06/(m K)): neighboring bins of a Hann
    /// window are correlated by (2/3)^2 and (1/6)^2 (factor 1.94), half-overlapping windows by (1/6)^2 (factor 1.06). 1
    /// % is added for aliasing by the grid (0.8 % at 5 1/m) and for leakage.
    #[test]
    fn psd_follows_iso_8608() {
        let p = Road { seed: 5, ..Road::default() };
        let tracks = long_road(p, 1 << 20);
        let s = welch(&tracks, 0.01, 1 << 15);
        for side in [&s.left, &s.right] {
            let mut lower = 0.02;
            while lower < 5.0 {
                let upper = f64::min(5.0, lower * 2.0_f64.cbrt());
                let bins = (lower / s.resolution).ceil() as usize..(upper / s.resolution).ceil() as usize;
                let count = bins.len() as f64;
                let mean = bins
                    .map(|k| {
                        let n = k as f64 * s.resolution;
                        let density = CLASS_C * REFERENCE_WAVENUMBER.powi(2) / (n * n + 0.011 * 0.011);
                        side[k] / density / count
                    })
                    .sum::<f64>();
                let error = (1.94 * 1.06 / (count * s.windows)).sqrt();
                assert!((mean - 1.0).abs() < 4.0 * error + 0.01, "{lower} to {upper} 1/m: {mean}");
                lower = upper;
            }
        }
        // ISO 8608 itself from 0.1 1/m on, where (n00/n)^2 is at most 1.2 %
        let k = (0.1 / s.resolution) as usize..(5.0 / s.resolution) as usize;
        let count = k.len() as f64;
        let mean = k.map(|k| s.left[k] / (CLASS_C * (k as f64 * s.resolution / 0.1).powi(-2)) / count).sum::<f64>();
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    /// Reference: stationary RMS of class C with n00 = 0.011 1/m: n0 sqrt(pi Gd/(2 n00)) = 0.0191 m, from the start on
    /// and under every axle. The tolerance is four standard errors 1/sqrt(8000) = 1.1 % of 4000 independent roads.
    #[test]
    fn stationary_deviation_from_the_start_on() {
        let mut squares = [0.0; 6];
        let roads = 4000;
        for seed in 0..roads {
            let y = Drive::new(Road { seed, l: RearAxles([2.95, 10.2]), ..Road::default() }).step(0.0);
            for (square, z) in squares.iter_mut().zip(*y.z) {
                *square += z * z / f64::from(roads);
            }
        }
        for square in squares {
            assert!((square.sqrt() / 0.0191 - 1.0).abs() < 0.045, "{}", square.sqrt());
        }
    }

    /// Means from 0.1 to 5 1/m: real part of the cross spectrum divided by the PSD (the correlation of the tracks), and
    /// magnitude-squared coherence.
    fn correlation(p: Road) -> [f64; 2] {
        let s = welch(&long_road(p, 1 << 19), 0.01, 1 << 12);
        let bins = (0.1 / s.resolution) as usize..(5.0 / s.resolution) as usize;
        let count = bins.len() as f64;
        let mut mean = [0.0; 2];
        for k in bins {
            let size = (s.left[k] * s.right[k]).sqrt();
            mean[0] += s.cross[k][0] / size / count;
            mean[1] += (s.cross[k][0].powi(2) + s.cross[k][1].powi(2)) / size.powi(2) / count;
        }
        mean
    }

    /// Reference: the mixture's cross spectrum is rho times the PSD, and its magnitude-squared coherence is rho^2. 255
    /// half-overlapping windows are equivalent to K = 241 independent windows, and 200 bins to 103 independent bins
    /// (see the PSD test). Standard errors of the means: real part at most 1/sqrt(2 K 103) = 0.0045; squared coherence
    /// sqrt(2) rho (1 - rho^2)/sqrt(K 103) <= 0.0035, with a bias of at most 1/K = 0.0041. The tolerance is four
    /// standard errors plus the bias.
    #[test]
    fn tracks_have_the_given_coherence() {
        let p = |tracks, rho| Road { tracks, rho, ..Road::default() };
        for (parameters, expected) in [
            (p(Tracks::Same, 0.5), 1.0),
            (p(Tracks::Independent, 0.5), 0.0),
            (p(Tracks::Mixed, 0.0), 0.0),
            (p(Tracks::Mixed, 0.6), 0.6),
            (p(Tracks::Mixed, 0.995), 0.995),
            (p(Tracks::Mixed, 1.0), 1.0),
        ] {
            let [mean, squared] = correlation(parameters);
            assert!((mean - expected).abs() < 0.018, "{mean} for {expected}");
            assert!((squared - expected * expected).abs() < 0.018, "{squared} for {expected}");
        }
    }

    /// Reference: the frequency response of the all-pass, which has magnitude 1. The tolerances cover window leakage.
    #[test]
    fn delayed_track_is_the_left_track_through_the_all_pass() {
        let p = Road { tracks: Tracks::Delayed, ..Road::default() };
        let filter = AllPass::new(p.t_track);
        let s = welch(&long_road(p, 1 << 19), 0.01, 1 << 15);
        for k in 8..(1.0 / s.resolution) as usize {
            let [re, im] = s.cross[k];
            let coherence = (re * re + im * im) / (s.left[k] * s.right[k]);
            assert!(coherence > 0.99, "{k}: {coherence}");
            let h = filter.response(k as f64 * s.resolution);
            // the Fourier sum has the opposite sign in its exponent
            let angle = f64::atan2(re * h[1] + im * h[0], re * h[0] - im * h[1]);
            assert!(angle.abs() < 0.05, "{k}: {angle}");
        }
    }

    /// The rear and middle wheels follow the front wheels after exactly offset/speed on every road: after 460 and 295
    /// samples of 1 cm, at 10 m/s and 1 ms. Distances have a rounding error of 1e-14 m, and slopes stay below 10.
    #[test]
    fn rear_wheels_follow_exactly() {
        for mut drive in roads() {
            let outputs: Vec<Y> = (0..3000).map(|_| drive.step(10.0)).collect();
            for (n, y) in outputs.iter().enumerate() {
                for (axle, delay) in [(1, 295), (2, 460)] {
                    if let Some(front) = n.checked_sub(delay).map(|n| &outputs[n]) {
                        for side in 0..2 {
                            assert!((y.z[2 * axle + side] - front.z[side]).abs() < 1e-12);
                        }
                    }
                }
            }
        }
    }

    /// At constant speed, heights at common times do not depend on the sample time, even if the class changes or the
    /// steps are not binary fractions.
    #[test]
    fn heights_do_not_depend_on_the_sample_time() {
        for drive in roads() {
            for t_change in [0.0, 3.0] {
                for speed in [35.0 / 3.6, 20.0] {
                    let with = |sample_time| {
                        let mut drive = drive.clone();
                        drive.p.sample_time = sample_time;
                        drive.p.t_change = t_change;
                        drive
                    };
                    let (mut fine, mut coarse) = (with(0.001), with(0.003));
                    for _ in 0..6000 {
                        let a = fine.step(speed);
                        fine.step(speed);
                        fine.step(speed);
                        let b = coarse.step(speed);
                        assert!((a.s - b.s).abs() < 1e-12);
                        for (a, b) in a.z.iter().zip(*b.z) {
                            assert!((a - b).abs() < 1e-12, "{a} {b} at {} m", fine.x.s);
                        }
                    }
                }
            }
        }
    }

    /// Reference: a separate program in Python (ChaCha8, Box-Muller and the recursion from their definitions), seed
    /// 1, class C, at 0 and 5 m. The rounding error of each of the 1500 steps of the recursion is 1e-16.
    #[test]
    fn road_follows_the_definition() {
        let mut drive = Drive::new(Road::default());
        let start = drive.step(5000.0);
        let later = drive.step(0.0);
        for (found, expected) in [
            (start.z[0], 0.001_917_593_504_810_065),
            (start.z[1], 0.007_823_482_516_940_093),
            (later.z[0], 0.003_719_705_827_176_047),
            (later.z[1], -0.014_821_597_784_314_312),
        ] {
            assert!((found - expected).abs() < 1e-13);
        }
    }

    /// Reference: the heavy vehicle's road, q(25 m) and q(100 m) for seed 1, class B, given to 1e-8 m. The right track
    /// is mixed with the profile of seed 1000004, with rho = 0.995.
    #[test]
    fn harmonics_give_the_reference_heights() {
        let p = Road { profile: Profile::Harmonics, class: 2, tracks: Tracks::Same, ..Road::default() };
        let mut drive = Drive::new(p.clone());
        drive.step(25_000.0);
        let y = drive.step(75_000.0);
        assert!((y.z[0] - -0.001_879_93).abs() < 1e-8 && y.z[0] == y.z[1]);
        assert!((drive.step(0.0).z[0] - 0.004_244_32).abs() < 1e-8);

        let second = Harmonics::new(&Harmonics::amplitudes(64e-6, 1_000_004)).height(25.0);
        let mut drive = Drive::new(Road { tracks: Tracks::Mixed, ..p });
        drive.step(25_000.0);
        let z = drive.step(0.0).z;
        let [left, right] = Mixture::new(0.995).tracks([y.z[0], second]);
        assert!((z[0] - left).abs() < 1e-15 && (z[1] - right).abs() < 1e-15);
    }

    /// The correlation of 100 roads at 20 places 50 m apart (the correlation length is 14 m) is 0 within four standard
    /// errors 1/sqrt(2000).
    #[test]
    fn seeds_and_tracks_are_uncorrelated() {
        let heights = |seed| {
            let mut drive = Drive::new(Road { seed, ds: 0.5, ..Road::default() });
            (0..20).map(|_| *drive.step(50_000.0).z).collect::<Vec<_>>()
        };
        let mut sums = [0.0; 2];
        for seed in 0..100 {
            for (a, b) in heights(seed).iter().zip(heights(seed + 1)) {
                let variance = 0.0191_f64.powi(2) * 2000.0;
                sums[0] += a[0] * a[1] / variance;
                sums[1] += a[0] * b[0] / variance;
            }
        }
        assert!(sums.iter().all(|sum| sum.abs() < 4.0 / 2000.0_f64.sqrt()), "{sums:?}");
    }

    /// The height is 0 up to the front axle, or only up to the rear axle, depending on `start`.
    #[test]
    fn starts_from_zero() {
        let p = Road { start: RoughnessStart::ZeroUpToFrontAxle, l: RearAxles([2.955, 4.605]), ..Road::default() };
        let mut drive = Drive::new(p.clone());
        assert_eq!(*drive.step(10.0).z, [0.0; 6]);
        let z = drive.step(10.0).z;
        assert!(z[0] != 0.0 && z[1] != 0.0);
        assert_eq!(z[2..], [0.0; 4]);

        let mut drive = Drive::new(Road { start: RoughnessStart::ZeroUpToRearAxle, ..p });
        let z = drive.step(10.0).z;
        assert!(z[..4].iter().all(|z| *z != 0.0));
        assert_eq!(z[4..], [0.0; 2]);
        let z = drive.step(10.0).z;
        assert!(z[4..].iter().all(|z| *z != 0.0));
    }

    /// Reference: Applied Sciences 2020, 10, 1852: class C until 3 s, then F. After the distance reached at 3 s (60 m,
    /// or one cell more), each innovation z[k+1] - alpha z[k] is sqrt(64) = 8 times the innovation without the change,
    /// except for the rounding of alpha z.
    #[test]
    fn a_class_change_scales_the_innovations() {
        let p = |t_change| Road { t_change, ..Road::default() };
        let [changed, plain] = [p(3.0), p(0.0)].map(|p| {
            // one grid point per sample
            Drive::new(Road { sample_time: 0.0005, ..p }).tracks(20.0, 8000)
        });
        let alpha = ShapedNoise::new(CLASS_C, 0.011, 0.01).memory;
        for (changed, plain) in changed.iter().zip(&plain) {
            assert_eq!(changed[..=6001], plain[..=6001]);
            for k in 6001..7999 {
                let [a, b] = [changed, plain].map(|z| z[k + 1] - alpha * z[k]);
                assert!((a - 8.0 * b).abs() < 1e-13, "{k}: {a} {b}");
            }
        }
    }

    /// With class 0, the roughness coefficient is a parameter. The profile is proportional to the square root of the
    /// coefficient.
    #[test]
    fn coefficient_scales_the_road() {
        for profile in [Profile::ShapedNoise, Profile::Harmonics] {
            let p = |class, g_d| Road { profile, class, g_d, ..Road::default() };
            let run = |p| Drive::new(p).tracks(20.0, 2000);
            let c = run(p(3, 0.0));
            assert_eq!(c, run(p(0, CLASS_C)));
            let d = run(p(4, 0.0));
            for (c, d) in c.iter().flatten().zip(d.iter().flatten()) {
                assert!((2.0 * c - d).abs() < 1e-13);
            }
        }
    }

    /// Reference: linear interpolation, and the formulas of mixed and delayed tracks.
    #[test]
    fn table_profile() {
        let at = |tracks, distance: f64| {
            let p = Road { profile: Profile::Table, tracks, rho: 0.28, ..Road::default() };
            let mut drive = Drive::with_table(p, Some(table()));
            drive.step(distance * 1000.0);
            let z = drive.step(0.0).z;
            [z[0], z[1]]
        };
        let near = |found: [f64; 2], expected: [f64; 2]| {
            assert!(
                (found[0] - expected[0]).abs() < 1e-12 && (found[1] - expected[1]).abs() < 1e-12,
                "{found:?} {expected:?}"
            );
        };
        near(at(Tracks::Independent, 0.0), [0.0, 0.5]);
        near(at(Tracks::Independent, 1.5), [0.05, 0.25]);
        near(at(Tracks::Independent, 4.25), [0.1, 0.15]);
        near(at(Tracks::Independent, 99.0), [0.3, 0.1]);
        near(at(Tracks::Same, 1.5), [0.05, 0.05]);
        near(at(Tracks::Mixed, 1.5), [0.8 * 0.05 + 0.6 * 0.25, 0.8 * 0.05 - 0.6 * 0.25]);
        near(at(Tracks::Delayed, 0.0), [0.0, 0.0]);
        // 100 m after the last row, the all-pass has settled: exp(-3 * 100/1.56)
        near(at(Tracks::Delayed, 104.5), [0.3, 0.3]);
        // between the rows: the all-pass, advanced in steps of 1 mm
        let filter = AllPass::new(1.56);
        let mut x = filter.steady(0.0);
        let table = table();
        for k in 0..5500 {
            let [a, b] = [k, k + 1].map(|k| table.at(0, 0.001 * f64::from(k)).unwrap());
            if k % 500 == 250 {
                near(at(Tracks::Delayed, 0.001 * f64::from(k)), [a, filter.output(x, a)]);
            }
            x = filter.advance(x, a, b, 0.001);
        }
    }

    /// Closed form: bump of the hydro-pneumatic half car, (A/2)(1 - cos(2 pi (t - 2)/0.5)) for 2 < t < 2.5 s with A =
    /// 0.03 m on the left. An obstacle in time acts under all axles at once, an obstacle in distance under one axle
    /// after the other.
    #[test]
    fn obstacles_in_time_and_distance() {
        let p = Road {
            profile: Profile::Flat,
            obstacle: ObstacleShape::Bump,
            obstacle_in_time: true,
            x_0: 2.0,
            x_l: 0.5,
            a_right: -0.01,
            l: RearAxles([2.0, 3.0]),
            ..Road::default()
        };
        let mut drive = Drive::new(p.clone());
        for n in 0..3000 {
            let z = drive.step(20.0).z;
            let t = f64::from(n) * 0.001;
            let shape =
                if t > 2.0 && t < 2.5 { (1.0 - (std::f64::consts::TAU * (t - 2.0) / 0.5).cos()) / 2.0 } else { 0.0 };
            for (side, height) in [0.03, -0.01].iter().enumerate() {
                for axle in 0..3 {
                    assert!((z[2 * axle + side] - height * shape).abs() < 1e-14);
                }
            }
        }
        for (obstacle, expected) in [
            (ObstacleShape::Bump, [1.0, 0.5, 0.0]),
            (ObstacleShape::Trapezoid, [1.0, 1.0, 0.0]),
            (ObstacleShape::Step, [1.0, 1.0, 0.0]),
        ] {
            let p = Road { obstacle, obstacle_in_time: false, x_0: 10.0, x_l: 4.0, ..p.clone() };
            let mut drive = Drive::new(Road { l: RearAxles([1.0, 3.0]), ..p });
            drive.step(12_000.0);
            let z = drive.step(0.0).z;
            for (axle, expected) in expected.iter().enumerate() {
                assert!((z[2 * axle] - 0.03 * expected).abs() < 1e-14, "{obstacle:?} {axle}");
            }
        }
        // A step in time begins in its intended sample, although 1.001 s may be rounded down.
        let p = Road { obstacle: ObstacleShape::Step, x_0: 1.001, ..p };
        let mut drive = Drive::new(p);
        let heights: Vec<f64> = (0..1002).map(|_| drive.step(0.0).z[0]).collect();
        assert_eq!(heights[1000..], [0.0, 0.03]);
    }

    /// Split friction from the start, changed friction for each axle from 10 m on.
    #[test]
    fn friction_changes_with_distance() {
        let p = Road {
            profile: Profile::Flat,
            mu_right: 0.3,
            x_mu: 10.0,
            mu_changed_left: 0.2,
            l: RearAxles([1.0, 3.0]),
            ..Road::default()
        };
        let mut drive = Drive::new(p.clone());
        assert_eq!(*drive.step(12_000.0).mu, [1.0, 0.3, 1.0, 0.3, 1.0, 0.3]);
        assert_eq!(*drive.step(1_000.0).mu, [0.2, 1.0, 0.2, 1.0, 1.0, 0.3]);
        assert_eq!(*drive.step(0.0).mu, [0.2, 1.0, 0.2, 1.0, 0.2, 1.0]);
        let mut drive = Drive::new(Road { x_mu: 0.0, ..p });
        drive.step(12_000.0);
        assert_eq!(drive.step(0.0).mu[..2], [1.0, 0.3]);
    }

    /// Driving back gives bit-identical heights at the same distance. Farther back than the history (10.2 m), the
    /// oldest height is held. When the vehicle drives forward again, the road continues as if it had not driven back.
    #[test]
    fn drives_backward() {
        // 1/64 m per sample: all distances are exact
        let speed = 1000.0 / 64.0;
        for drive in roads() {
            let mut drive = drive;
            drive.p.sample_time = 1.0 / 1024.0;
            let speed = speed * 1.024;
            let forwards: Vec<Y> = (0..2000).map(|_| drive.step(speed)).collect();
            let kept = drive.clone();
            drive.step(-speed);
            for back in 1..300 {
                let y = drive.step(-speed);
                assert_eq!(y, forwards[2000 - back], "{back}");
            }
            let far = (0..3000).map(|_| drive.step(-speed)).last().unwrap();
            assert!(far.z.iter().all(|z| z.is_finite()));
            if drive.p.profile == Profile::ShapedNoise {
                let oldest = (drive.x.points % HISTORY as u64) as usize;
                assert_eq!(far.z[4], drive.x.left[oldest]);
            }
            while drive.x.s < kept.x.s {
                drive.step(speed);
            }
            let mut kept = kept;
            for _ in 0..100 {
                assert_eq!(drive.step(speed), kept.step(speed));
            }
        }
    }

    /// At standstill, the heights are constant. A speed that passes many cells at once gives the same road.
    #[test]
    fn standstill_and_jumps() {
        for drive in roads() {
            let mut slow = drive.clone();
            let first = slow.step(0.0);
            assert_eq!(slow.step(0.0), first);
            for _ in 0..5000 {
                slow.step(10.0);
            }
            let mut fast = drive;
            fast.step(50_000.0);
            let (a, b) = (slow.step(0.0), fast.step(0.0));
            for (a, b) in a.z.iter().zip(*b.z) {
                assert!((a - b).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn rejects_what_makes_no_sense() {
        let p = Road::default;
        for (parameters, message) in [
            (
                Road { obstacle: ObstacleShape::Bump, x_l: 0.0, ..p() },
                "'obstacle.length' must be positive for a bump or trapezoid, got 0",
            ),
            (
                Road { profile: Profile::Table, ..p() },
                "'table.file' must be the path of a CSV file for 'profile' = 3 (table), it is empty",
            ),
            (
                Road { l: RearAxles([0.0, 10.3]), ..p() },
                "'geometry.axle_offset.rear' = 10.3 m must be at most 10.21 m, over which shaped noise is kept with \
                 'roughness.spacing' = 0.01 m; use a larger spacing",
            ),
            (
                // sigma^2 = pi 0.01 256e-6/(2e-6) m2 = (2.005 m)^2
                Road { n_00: 1e-6, ..p() },
                "'roughness.cutoff' = 0.000001 1/m: the heights of this roughness would have a standard deviation of \
                 2.005 m, at most 1 m is allowed; use a cutoff of 4.021e-6 1/m or more",
            ),
            (
                // class 6 has 64 times the density of class 3
                Road { n_00: 1e-4, t_change: 3.0, ..p() },
                "'roughness.cutoff' = 0.0001 1/m: the heights of this roughness ('roughness.change_class' included) \
                 would have a standard deviation of 1.604 m, at most 1 m is allowed; use a cutoff of 2.574e-4 1/m or \
                 more",
            ),
        ] {
            assert_eq!(derived(&parameters, None).unwrap_err(), message);
        }
        // The worst class is accepted with the cutoff of the standard, and class C with the cutoff that the message
        // recommends.
        assert!(derived(&Road { class: 8, ..p() }, None).is_ok());
        assert!(derived(&Road { n_00: 4.022e-6, ..p() }, None).is_ok());
        assert_eq!(
            parse_table("distance,height_left\n0,0\n", "a.csv").unwrap_err(),
            "a.csv: column `height_right` is missing, expected distance, height_left, height_right"
        );
    }

    #[test]
    fn rejects_an_impossible_speed() {
        let rejected = |p, u| {
            let mut drive = Drive::new(p);
            drive.step(1000.0);
            check(&drive.p, &drive.d, &drive.x, &U { u }).unwrap_err()
        };
        assert_eq!(
            rejected(Road::default(), 1e9),
            "'vehicle.speed' = 1000000000 m/s at 'road.distance' = 1 m passes over 1e8 grid points of \
             'roughness.spacing' = 0.01 m in one sample; at most 1e6 are possible"
        );
        let flat = Road { profile: Profile::Flat, sample_time: 10.0, ..Road::default() };
        let message = rejected(flat, 1e308);
        assert!(
            message.ends_with("leads from 'road.distance' = 10000 m to inf m; the distance must stay finite"),
            "{message}"
        );
    }

    proptest::proptest! {
        /// A run restored from a state saved at any sample continues bit-identically, at any speed, on every road.
        #[test]
        fn saved_state_continues(road in 0..16_usize, speeds in proptest::collection::vec(-30.0..300.0_f64, 2..200), cut in 0.0..1.0_f64) {
            let mut drive = roads().nth(road).unwrap();
            drive.p.t_change = 0.05;
            let cut = (cut * speeds.len() as f64) as usize;
            for speed in &speeds[..cut] {
                drive.step(*speed);
            }
            let saved = (drive.x.clone(), drive.sample);
            let first: Vec<Y> = speeds[cut..].iter().map(|speed| drive.step(*speed)).collect();
            (drive.x, drive.sample) = saved;
            for (speed, first) in speeds[cut..].iter().zip(first) {
                let again = drive.step(*speed);
                proptest::prop_assert_eq!(again.z.map(f64::to_bits), first.z.map(f64::to_bits));
                proptest::prop_assert_eq!(again, first);
            }
        }

        /// Any speed gives heights or a message, never a panic.
        #[test]
        fn never_panics(road in 0..16_usize, speeds in proptest::collection::vec(proptest::num::f64::ANY, 1..20)) {
            let mut drive = roads().nth(road).unwrap();
            for (n, u) in speeds.into_iter().enumerate() {
                let t = n as f64 * 0.001;
                if check(&drive.p, &drive.d, &drive.x, &U { u }).is_err() {
                    break;
                }
                sample(&drive.p, &drive.d, &mut drive.x, &U { u }, t);
            }
        }
    }
}
