//! Convergence: how the results of a scenario change as its communication step goes to 0.
//!
//! [`levels`] gives runs with the steps h, h/2 and h/4, and with the other order of the components. [`assess`] compares
//! their results on the *common rows*, those of the step h. Rows of the finer levels are never added: within a step, an
//! output that depends directly on held inputs differs from its values at the ends, which is not an error of the step.

use crate::fmus::Fmus;
use crate::master::Recording;
use crate::plan::{Origin, Plan};
use crate::requirements::{RunNumbers, Signals, numbers};
use crate::run::{Order, Run, Simulation};
use crate::scenario::whole_steps;
use crate::typography::{number, significant};
use fmu_import::description::{BaseType, Causality, Value, Variable};
use fmu_import::fmu::Fmu;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

const SAMPLE_TIME: &str = "sample_time";

/// Parameter of components with random signals, which depend on the sample time.
const SEED: &str = "seed";

/// Share of the largest value that counts as rounding.
const NOISE: f64 = 1e-10;

/// Orders of a regular sequence; beyond the largest, it has settled.
const ORDERS: std::ops::RangeInclusive<f64> = 0.5..=6.0;

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Class {
    Undefined,
    Independent,
    Settled,
    Irregular,
    Alternating,
    Regular,
}

/// Assessment of a number with the steps h, h/2 and h/4. The error is that of the step h.
#[derive(Debug, Clone, Copy, Serialize)]
struct Assessment {
    values: [Option<f64>; 3],
    class: Class,
    order: Option<f64>,
    limit: Option<f64>,
    error: Option<f64>,
    relative: Option<f64>,
}

impl Assessment {
    fn of(values: [Option<f64>; 3]) -> Self {
        let [Some(m1), Some(m2), Some(m4)] = values.map(|m| m.filter(|m| m.is_finite())) else {
            return Self { values, class: Class::Undefined, order: None, limit: None, error: None, relative: None };
        };
        let noise = NOISE * m1.abs().max(m2.abs()).max(m4.abs());
        let (d1, d2) = (m1 - m2, m2 - m4);
        let p = (d1 / d2).abs().log2();
        let [step, largest] = [(m1 - m4).abs(), d1.abs().max(d2.abs())];
        let (class, order, limit, error) = match () {
            () if largest <= noise => (Class::Independent, None, Some(m4), largest),
            () if d2.abs() <= noise => (Class::Settled, None, Some(m4), step),
            () if d1.abs() <= noise => (Class::Irregular, None, None, largest),
            () if d1 * d2 < 0.0 => (Class::Alternating, Some(p), None, largest.max(step)),
            () if p < *ORDERS.start() => (Class::Irregular, Some(p), None, largest.max(step)),
            () if p > *ORDERS.end() => (Class::Settled, None, Some(m4), step),
            () => {
                let limit = m4 - d2 / (p.exp2() - 1.0);
                (Class::Regular, Some(p), Some(limit), (m1 - limit).abs())
            }
        };
        Self { values, class, order, limit, error: Some(error), relative: (m1 != 0.0).then(|| error / m1.abs()) }
    }

    /// True if the error is larger than a share of the number.
    fn is_above(&self, share: f64) -> bool {
        self.error.is_some_and(|error| error > 0.0 && self.relative.is_none_or(|relative| relative > share))
    }

    /// The factor for the step with which the error of a regular number is this share of it, at most 1.
    fn step_factor(&self, share: f64) -> Option<f64> {
        let order = self.order.filter(|_| self.class == Class::Regular)?;
        Some((share / self.relative?).powf(order.recip()).min(1.0))
    }

    fn text(&self, name: &str) -> String {
        let change = self.relative.map_or_else(|| number(self.error.unwrap_or_default(), None), percent);
        match (self.class, self.order) {
            (Class::Undefined, _) => format!("{name} is not defined with each step"),
            (Class::Independent, _) => format!("{name} does not depend on the step"),
            (Class::Regular, order) => {
                let order = order.unwrap_or_default();
                format!("{name} changes by {change} as the step goes to 0 (order {order:.2})")
            }
            (Class::Settled, _) => format!("{name} changes by {change} as the step goes to 0; h/2 is small enough"),
            _ => format!("{name} changes by up to {change}, without a regular order"),
        }
    }

    fn cells(&self, name: &str) -> Vec<String> {
        let [m1, m2, m4] = self.values.map(cell);
        let class = format!("{:?}", self.class).to_lowercase();
        vec![name.to_owned(), m1, m2, m4, class, cell(self.order), share(self.relative)]
    }
}

/// A share in percent.
pub fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 3))
}

fn cell(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| number(value, None))
}

fn share(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), percent)
}

/// Differences of a signal between h and h/2, and h/2 and h/4, and the estimated error with h: root mean squares.
#[derive(Debug, Clone, Copy, Serialize)]
struct Difference {
    d12: f64,
    d24: f64,
    order: Option<f64>,
    error: f64,
    /// The error relative to the range of the signal.
    relative: Option<f64>,
}

impl Difference {
    fn of([y1, y2, y4]: [&[f64]; 3]) -> Self {
        let peak = [y1, y2, y4].into_iter().flatten().fold(0.0_f64, |peak, y| peak.max(y.abs()));
        let rms = |a: &[f64], b: &[f64]| {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            Some((sum / a.len().max(1) as f64).sqrt()).filter(|rms| *rms > NOISE * peak).unwrap_or(0.0)
        };
        let (d12, d24) = (rms(y1, y2), rms(y2, y4));
        let order = (d12 > 0.0 && d24 > 0.0).then(|| (d12 / d24).log2());
        let error = order.filter(|p| ORDERS.contains(p)).map_or(d12 + d24, |p| d12 / (1.0 - (-p).exp2()));
        let range = y4.iter().fold(f64::NEG_INFINITY, |max, y| max.max(*y))
            - y4.iter().fold(f64::INFINITY, |min, y| min.min(*y));
        Self { d12, d24, order, error, relative: (range > 0.0).then(|| error / range) }
    }
}

/// The largest step that is not above `target`, is 1, 2 or 5 times a power of ten, and divides the time of the runs.
fn recommended_step(simulation: &Simulation, target: f64) -> Option<f64> {
    let first = target.log10().floor() as i32;
    let steps = (first - 6..=first).rev().flat_map(|power| [5, 2, 1].map(|digit| format!("{digit}e{power}")));
    let mut steps = steps.filter_map(|text| text.parse::<f64>().ok());
    steps.find(|step| *step <= target && whole_steps(simulation.start, simulation.stop, *step).is_ok())
}

/// The components of a run.
struct Graph<'p> {
    /// Those that take samples, with their sample times, s.
    times: BTreeMap<&'p str, Option<f64>>,
    /// The components that each component reads.
    sources: BTreeMap<&'p str, BTreeSet<&'p str>>,
    /// Number of communication steps in a step of each component.
    every: BTreeMap<&'p str, u64>,
    /// The components with random signals.
    random: BTreeSet<&'p str>,
}

impl<'p> Graph<'p> {
    fn of(plan: &'p Plan, run: &'p Run, fmus: &Fmus) -> Self {
        let wiring = plan.wiring.iter().find(|wiring| wiring.case == run.case);
        let (mut times, mut sources, mut random) = (BTreeMap::new(), BTreeMap::new(), BTreeSet::new());
        for own in &run.components {
            let inputs = wiring.into_iter().flat_map(|wiring| &wiring.inputs);
            let read = inputs.filter(|read| read.input.component == own.name).filter_map(|read| match &read.source {
                Origin::Output(signal) => Some(signal.component.as_str()),
                _ => None,
            });
            sources.insert(own.name.as_str(), read.collect());
            if wiring.is_some_and(|wiring| wiring.discrete.contains(&own.name)) {
                let is_time = |v: &&Variable| {
                    let kind = (v.base_type, v.causality, v.unit.as_deref());
                    v.name == SAMPLE_TIME && kind == (BaseType::Real, Causality::Parameter, Some("s"))
                };
                let set =
                    own.parameters.iter().find(|setting| setting.name == SAMPLE_TIME).map(|setting| &setting.value);
                let variables = fmus.get(own).ok().map(Fmu::description).map(|of| &of.variables);
                let variable = variables.and_then(|of| of.iter().find(is_time));
                random.extend(variables.filter(|of| of.iter().any(|v| v.name == SEED)).map(|_| own.name.as_str()));
                let time = variable.and_then(|variable| set.or(variable.start.as_ref())?.real());
                times.insert(own.name.as_str(), time);
            }
        }
        let every = run.components.iter().map(|own| (own.name.as_str(), own.every)).collect();
        Self { times, sources, every, random }
    }

    fn plants(&self) -> impl Iterator<Item = (&'p str, &BTreeSet<&'p str>)> {
        self.sources.iter().map(|(name, read)| (*name, read)).filter(|(name, _)| !self.times.contains_key(name))
    }

    /// True for a component that reads or writes a plant, unless it reads nothing (a driver), or has random signals and
    /// nothing that it reads comes from a plant, also by other components (a road).
    fn is_controller(&self, name: &str) -> bool {
        let (mut seen, mut open) = (BTreeSet::new(), vec![name]);
        while let Some(reader) = open.pop() {
            open.extend(self.sources[reader].iter().filter(|source| seen.insert(**source)));
        }
        let is_beside =
            |(plant, read): (&str, &BTreeSet<&str>)| read.contains(name) || self.sources[name].contains(plant);
        let depends_on_plant = self.plants().any(|(plant, _)| seen.contains(plant));
        let is_source = seen.is_empty() || (self.random.contains(name) && !depends_on_plant);
        !is_source && self.plants().any(is_beside)
    }

    /// Explains for each component whether its sample time limits the effect of the step.
    fn notes(&self, step: f64, metrics: &[MetricReport]) -> Vec<String> {
        let is_longer = |name: &str, time: f64| step * self.every[name] as f64 > time * (1.0 + 1e-9);
        let list = |names: &[&str]| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        // Components with the same sample time share a note.
        let mut alike: BTreeMap<Option<u64>, Vec<&str>> = BTreeMap::new();
        for (name, time) in &self.times {
            if time.map_or(self.every[name] == 1, |time| is_longer(name, time)) {
                alike.entry(time.map(f64::to_bits)).or_default().push(name);
            }
        }
        let note = |(time, names): (Option<u64>, Vec<&str>)| match (time, list(&names), names.len()) {
            (None, names, n) => {
                let verb = if n == 1 { "updates" } else { "update" };
                format!("{names} {verb} once per communication step, so the systems with h, h/2 and h/4 differ")
            }
            (Some(time), names, n) => {
                let (verb, its) = if n == 1 { ("takes", "its") } else { ("take", "their") };
                let time = significant(f64::from_bits(time), 6);
                let rest = format!("the result differs for h below {its} sample_time, {time} s");
                format!("{names} {verb} several samples per step with the same inputs; {rest}")
            }
        };
        let mut notes: Vec<String> = alike.into_iter().map(note).collect();
        let mut classes =
            metrics.iter().map(|metric| metric.own.class).filter(|class| *class != Class::Undefined).peekable();
        if classes.peek().is_some() && classes.all(|class| class == Class::Independent) {
            let is_sampled = |source: &&str| {
                let time = self.times.get(source);
                time.is_some_and(|time| time.map_or(self.every[source] > 1, |time| !is_longer(source, time)))
            };
            for (plant, sources) in self.plants().filter(|(_, read)| !read.is_empty() && read.iter().all(is_sampled)) {
                let names: Vec<&str> = sources.iter().copied().collect();
                let fixed = format!("the exchange is fixed by the sample times of {}", list(&names));
                notes.push(format!("`{plant}`: {fixed}: a smaller step changes nothing"));
            }
        }
        notes
    }
}

/// The runs of a plan with other times and order, and with other sample times.
pub type Level = (Simulation, Vec<Run>);

/// Checks that the communication step of a plan can be changed.
///
/// # Errors
/// The steps are chosen by their error.
pub fn check(plan: &Plan) -> Result<(), String> {
    match plan.simulation.error_control {
        Some(_) => Err("`error_control` chooses the communication step; compare runs with other tolerances".to_owned()),
        None => Ok(()),
    }
}

/// The runs to compare: with the steps h, h/2 and h/4, and with the other order of the components. With
/// `has_sample_times`, runs with the steps h/2 and h/4 follow in which the sample times of controllers are divided, too.
///
/// # Errors
/// The plan cannot be compared ([`check`]), or a controller rejects the sample time.
pub fn levels(plan: &Plan, fmus: &Fmus, has_sample_times: bool) -> Result<Vec<Level>, String> {
    let own = plan.simulation;
    let divided = |n: u32, every: u64| {
        let steps = own.steps * u64::from(n);
        Simulation { step: own.step / f64::from(n), steps, every: own.every * every, ..own }
    };
    check(plan)?;
    // Components with a rate keep their period.
    let runs = |n: u64| {
        let mut runs = plan.runs.clone();
        let components = runs.iter_mut().flat_map(|run| &mut run.components);
        components.filter(|own| own.every > 1).for_each(|own| own.every *= n);
        runs
    };
    let order = if own.order == Order::Jacobi { Order::Sequential } else { Order::Jacobi };
    // The finest level records all its rows, to show the effect of recording.
    // Only sequential steps can be iterated.
    let other = Simulation { order, iterate: own.iterate.filter(|_| order != Order::Jacobi), ..own };
    let mut levels = vec![(own, runs(1)), (divided(2, 2), runs(2)), (divided(4, 1), runs(4)), (other, runs(1))];
    for n in [2_u32, 4].into_iter().filter(|_| has_sample_times) {
        let mut runs = runs(n.into());
        for (run, own) in runs.iter_mut().zip(&plan.runs) {
            let graph = Graph::of(plan, own, fmus);
            for (name, time) in graph.times.iter().filter(|(name, _)| graph.is_controller(name)) {
                if let Some(time) = time {
                    run.set_parameter(fmus, name, SAMPLE_TIME, Value::Real(time / f64::from(n)))?;
                }
            }
        }
        levels.push((divided(n, n.into()), runs));
    }
    Ok(levels)
}

#[derive(Debug, Clone, Serialize)]
struct MetricReport {
    metric: String,
    #[serde(flatten)]
    own: Assessment,
    verdict: String,
    /// True if the error is larger than accepted.
    above_limit: bool,
    recommended_step: Option<f64>,
    /// Relative change by the rows between the common rows, with the step h/4.
    recording: Option<f64>,
    other_order: Option<f64>,
    order_change: Option<f64>,
    /// True if the other order changes the metric by more than twice the error.
    order_matters: bool,
    sample_times: Option<Assessment>,
}

/// Results for a run.
#[derive(Debug, Clone, Serialize)]
pub struct RunReport {
    /// Id of the run.
    pub run: String,
    metrics: Vec<MetricReport>,
    signals: Vec<(String, Difference)>,
    sample_times: BTreeMap<String, Option<f64>>,
    /// Effects of the sample times on the results, one sentence each.
    pub notes: Vec<String>,
}

impl RunReport {
    /// The metrics whose error is larger than accepted.
    pub fn above(&self) -> impl Iterator<Item = String> {
        let above = self.metrics.iter().filter(|metric| metric.above_limit);
        above.map(|metric| format!("{} of run {}", metric.metric, self.run))
    }

    /// A table of the metrics, and the results in words.
    pub fn text(&self) -> String {
        let title = ["metric", "h", "h/2", "h/4", "class", "order", "error", "recording", "other order"];
        let mut rows = vec![title.map(str::to_owned).to_vec()];
        let mut lines = Vec::new();
        for metric in &self.metrics {
            let more = [share(metric.recording), share(metric.order_change)];
            rows.push([metric.own.cells(&metric.metric), more.to_vec()].concat());
            rows.extend(metric.sample_times.map(|found| found.cells("  effect of the controllers' sample times")));
            lines.push(metric.verdict.clone());
            lines.extend(metric.recommended_step.map(|step| format!("  recommended step: {} s", significant(step, 6))));
        }
        let matters = self.metrics.iter().filter(|metric| metric.order_matters);
        let matters: Vec<_> =
            matters.map(|metric| format!("{} {}", metric.metric, share(metric.order_change))).collect();
        if !matters.is_empty() {
            lines.push(format!("the order of the components matters: {}", matters.join(", ")));
        }
        let largest = self
            .signals
            .iter()
            .filter(|(_, found)| found.relative > Some(0.0))
            .max_by(|(_, a), (_, b)| a.relative.unwrap_or(0.0).total_cmp(&b.relative.unwrap_or(0.0)));
        lines.extend(largest.map(|(name, found)| {
            let error = share(found.relative);
            format!("the largest error of {} signals: {name}, {error} of its range (RMS)", self.signals.len())
        }));
        let width = |at: usize| rows.iter().filter_map(|row| Some(row.get(at)?.chars().count())).max().unwrap_or(0);
        let widths: Vec<usize> = (0..title.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let others = row.iter().zip(&widths).skip(1).map(|(text, width)| format!("  {text:>width$}"));
            format!("{:1$}{2}", row[0], widths[0], others.collect::<String>())
        };
        rows.iter().map(line).chain(lines).fold(self.run.clone(), |text, line| text + "\n" + &line)
    }
}

/// Every n-th row of a recording.
fn rows(recording: &Recording, n: usize) -> Signals {
    let every = |values: &Vec<f64>| values.iter().copied().step_by(n).collect::<Vec<f64>>();
    let columns = recording.columns.iter().enumerate();
    let columns = columns.filter_map(|(index, column)| Some((index, every(column.as_ref()?)))).collect();
    Signals { times: every(&recording.time), columns }
}

/// Compares the recordings of all runs on all [`levels`]; `None` for a run that failed. `limit` is the error that is
/// accepted, relative to each metric.
///
/// # Errors
/// A metric has no number.
pub fn assess(
    plan: &Plan,
    fmus: &Fmus,
    recordings: &[Vec<Option<Recording>>],
    limit: f64,
) -> Result<Vec<RunReport>, String> {
    let reduced = |level: usize, n: usize| -> Vec<Option<Signals>> {
        recordings[level].iter().map(|recording| recording.as_ref().map(|recording| rows(recording, n))).collect()
    };
    let common: Vec<_> = (0..recordings.len()).map(|level| reduced(level, if level == 2 { 4 } else { 1 })).collect();
    let numbers = |signals: &Vec<Option<Signals>>| {
        let at = |run: &Run| plan.runs.iter().position(|other| other.id == run.id);
        numbers(plan, false, &|run, _| signals[at(run)?].clone().map(Ok))
    };
    let finest = numbers(&reduced(2, 1))?;
    let levels = common.iter().map(numbers).collect::<Result<Vec<_>, String>>()?;
    let report = |(at, run): (usize, &Run)| {
        let metric = |(index, metric): (usize, &crate::report::Metric)| {
            let of = |numbers: &RunNumbers<'_>| numbers.get(run.id.as_str()).and_then(|found| found[index]);
            let value = |level: usize| levels.get(level).and_then(of);
            let own = Assessment::of([0, 1, 2].map(value));
            let change = |value: Option<f64>, from: Option<f64>| {
                Some((value? - from?) / own.values[0]?.abs()).filter(|change| change.is_finite())
            };
            let above_limit = own.is_above(limit);
            let factor = own.step_factor(limit).filter(|_| above_limit);
            let order_change = change(value(3), own.values[0]);
            MetricReport {
                verdict: own.text(&metric.name),
                metric: metric.name.clone(),
                recommended_step: factor.and_then(|x| recommended_step(&plan.simulation, plan.simulation.step * x)),
                recording: change(of(&finest), own.values[2]),
                other_order: value(3),
                order_matters: order_change
                    .zip(own.relative)
                    .is_some_and(|(change, error)| change.abs() > NOISE.max(2.0 * error)),
                order_change,
                above_limit,
                sample_times: (levels.len() > 4).then(|| Assessment::of([0, 4, 5].map(value))),
                own,
            }
        };
        let metrics: Vec<MetricReport> = plan.metrics.iter().enumerate().map(metric).collect();
        let signals = plan.columns.iter().enumerate().filter(|(_, column)| !column.is_binary);
        let signals = signals.filter_map(|(index, column)| {
            let of = |level: usize| common[level][at].as_ref()?.columns.get(&index).map(Vec::as_slice);
            Some((column.name.clone(), Difference::of([of(0)?, of(1)?, of(2)?])))
        });
        let graph = Graph::of(plan, run, fmus);
        RunReport {
            run: run.id.clone(),
            signals: signals.collect(),
            notes: graph.notes(plan.simulation.step, &metrics),
            metrics,
            sample_times: graph.times.into_iter().map(|(name, time)| (name.to_owned(), time)).collect(),
        }
    };
    Ok(plan.runs.iter().enumerate().map(report).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use Class::{Alternating, Independent, Irregular, Regular, Settled, Undefined};

    #[track_caller]
    fn assert_near(found: Option<f64>, expected: Option<f64>) {
        let is_near = match (found, expected) {
            (Some(found), Some(expected)) => (found - expected).abs() <= 1e-9 * expected.abs() + 1e-15,
            (found, expected) => found == expected,
        };
        assert!(is_near, "{found:?}, expected {expected:?}");
    }

    /// Reference: an independent program, for a triple of each class and for metrics of an oscillator of two components
    /// that are integrated exactly, with steps of 4, 2 and 1 ms.
    #[test]
    fn each_class_has_its_order_limit_and_error() {
        let no = None;
        for (m, class, order, limit, error, relative, factor) in [
            ([1.0, 1.0, 1.0], Independent, no, Some(1.0), 0.0, Some(0.0), no),
            ([1.2, 1.1, 1.05], Regular, Some(1.0), Some(1.0), 0.2, Some(1.0 / 6.0), Some(0.06)),
            ([1.16, 1.04, 1.01], Regular, Some(2.0), Some(1.0), 0.16, Some(4.0 / 29.0), Some(0.269_258_240_356_725)),
            ([1.1, 1.0, 1.0], Settled, no, Some(1.0), 0.1, Some(1.0 / 11.0), no),
            ([1.0, 1.0, 1.02], Irregular, no, no, 0.02, Some(0.02), no),
            ([1.05, 0.98, 1.01], Alternating, Some(1.222_392_421_336_448), no, 0.07, Some(1.0 / 15.0), no),
            ([1.0, 1.1, 1.3], Irregular, Some(-1.0), no, 0.3, Some(0.3), no),
            ([0.0, 0.0, 0.0], Independent, no, Some(0.0), 0.0, no, no),
            ([0.002, 0.001, 0.0005], Regular, Some(1.0), Some(0.0), 0.002, Some(1.0), Some(0.01)),
            ([2.0, 1.0, 0.99], Settled, no, Some(0.99), 1.01, Some(0.505), no),
            (
                [0.046_785_507_241_968_29, 0.043_267_947_308_925_17, 0.041_710_640_198_068_68],
                Regular,
                Some(1.175_521_523_558_599_6),
                Some(0.040_473_450_071_328_33),
                0.006_312_057_170_639_956,
                Some(0.134_914_796_113_994_32),
                Some(0.109_313_512_450_698_47),
            ),
            (
                [0.079_060_743_573_695_2, 0.067_795_347_931_357, 0.063_697_749_967_328_56],
                Regular,
                Some(1.459_047_635_793_735_9),
                Some(0.061_355_285_820_270_035),
                0.017_705_457_753_425_17,
                Some(0.223_947_523_803_913_03),
                Some(0.118_751_380_554_537_77),
            ),
        ] {
            let found = Assessment::of(m.map(Some));
            assert_eq!(found.class, class, "{m:?}");
            assert_near(found.order, order);
            assert_near(found.limit, limit);
            assert_near(found.error, Some(error));
            assert_near(found.relative, relative);
            assert_near(found.step_factor(0.01), factor);
            assert_eq!(found.is_above(0.01), error > 0.0, "{m:?}");
            assert!(!found.is_above(2.0), "{m:?}");
        }
        for missing in [None, Some(f64::NAN), Some(f64::INFINITY)] {
            let found = Assessment::of([missing, Some(1.0), Some(1.0)]);
            assert_eq!((found.class, found.error, found.is_above(0.0)), (Undefined, None, false));
        }
        assert!(Assessment::of([0.0, 1.0, 1.0].map(Some)).is_above(1e9), "no number is a share of 0");
    }

    #[test]
    fn results_in_words() {
        for (m, text) in [
            ([0.206_986_672, 0.191_958_335, 0.185_585_318], "x changes by 12.6 % as the step goes to 0 (order 1.24)"),
            ([1.05, 0.98, 1.01], "x changes by up to 6.67 %, without a regular order"),
            ([1.1, 1.0, 1.0], "x changes by 9.09 % as the step goes to 0; h/2 is small enough"),
            ([0.0, 1.0, 1.0], "x changes by 1.000 as the step goes to 0; h/2 is small enough"),
            ([1.0, 1.0, 1.0], "x does not depend on the step"),
            ([f64::NAN, 1.0, 1.0], "x is not defined with each step"),
        ] {
            assert_eq!(Assessment::of(m.map(Some)).text("x"), text);
        }
    }

    /// Closed form: a signal with the error e h^p, whose root mean square is that of e.
    #[test]
    fn differences_of_signals_give_order_and_error() {
        let row = |i: u32| (f64::from(i) * 0.1).sin();
        let level = |factor: f64| (0..200).map(|i| row(i) + factor * 0.01 * row(3 * i)).collect::<Vec<f64>>();
        let rms = (level(1.0).iter().zip(level(0.0)).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 200.0).sqrt();
        let found = Difference::of([&level(1.0), &level(0.125), &level(1.0 / 64.0)]);
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
        near(found.d12, 0.875 * rms);
        near(found.d24, 0.875 * rms / 8.0);
        near(found.order.unwrap(), 3.0);
        near(found.error, rms);
        // A difference of rounding has no order, and one that grows no limit.
        let found = Difference::of([&level(1.0), &level(0.0), &level(1e-12)]);
        assert_eq!((found.d24, found.order), (0.0, None));
        near(found.error, rms);
        near(Difference::of([&level(0.0), &level(1.0), &level(3.0)]).error, 3.0 * rms);
        let constant = Difference::of([&[1.0], &[1.0], &[1.0]]);
        assert_eq!((constant.error, constant.relative), (0.0, None));
    }

    /// Specification of the master, section 4: discrete components that read or feed a continuous one are controllers,
    /// except for sources, among them a random road that reads the speed of the driver only.
    #[test]
    fn controllers_may_depend_on_the_driver_only() {
        let read = [
            ("driver", &[][..]),
            ("road", &["driver"]),
            ("feedforward", &["driver"]),
            ("feedback", &["plant"]),
            ("sensor", &["plant"]),
            ("display", &["driver"]),
            ("plant", &["road", "feedforward", "feedback"]),
        ];
        let graph = Graph {
            times: read[..6].iter().map(|(name, _)| (*name, Some(0.001))).collect(),
            sources: read.iter().map(|(name, read)| (*name, read.iter().copied().collect())).collect(),
            every: BTreeMap::new(),
            random: ["road", "sensor"].into(),
        };
        let found = read[..6].iter().map(|(name, _)| *name).filter(|name| graph.is_controller(name));
        assert_eq!(found.collect::<Vec<_>>(), ["feedforward", "feedback", "sensor"]);
    }

    #[test]
    fn recommended_steps_are_round_and_divide_the_time() {
        let (start, steps, every, order) = (0.0, 1, 1, Order::Auto);
        let of = |stop: f64| Simulation { start, stop, step: stop, steps, every, order, ..Simulation::default() };
        assert_eq!(recommended_step(&of(20.0), 0.000_516), Some(0.0005));
        assert_eq!(recommended_step(&of(20.0), 0.001), Some(0.001));
        assert_eq!(recommended_step(&of(20.0), 0.000_99), Some(0.0005));
        assert_eq!(recommended_step(&of(0.3), 0.06), Some(0.05));
        assert_eq!(recommended_step(&of(0.3), 0.25), Some(0.1), "0.2 does not divide 0.3");
        assert_eq!(recommended_step(&of(1.0 / 3.0), 0.1), None);
    }
}
