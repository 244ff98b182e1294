//! The file given with `--inputs`: the signals that its columns write, and their values.

use crate::data::unit::Target;
use crate::data::{Channel, Clock, DataError, Duplicates, Format, Mistake, Signal, Table, TimeColumn};
use crate::parameter;
use crate::run::{Interpolation, Simulation};
use fmu_import::description::{BaseType, Causality, Variable};
use fmu_import::names::suggestion;
use std::collections::BTreeSet;
use std::mem;
use std::path::Path;

/// Value of a signal after its last sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum AfterEnd {
    /// No value: a file that ends before the run is a mistake.
    #[default]
    Error,
    /// Its last value.
    Hold,
}

/// The file and the signals made from its columns.
pub(super) struct Inputs {
    table: Table,
    clock: Clock,
    simulation: Simulation,
    after_end: AfterEnd,
    pub(super) feeds: Vec<Feed>,
    /// Columns that write an input in some case.
    used: BTreeSet<usize>,
    /// Outputs that columns replace.
    replacements: Vec<Replacement>,
    /// Columns without a unit, each with the unit that is assumed for its values.
    without_unit: Vec<(String, String)>,
    mistakes: Vec<Mistake>,
    warnings: Vec<String>,
}

/// A column as a signal.
pub(super) struct Feed {
    pub(super) column: usize,
    pub(super) interpolation: Interpolation,
    pub(super) unit: Option<String>,
    pub(super) signal: Signal,
}

/// A column that writes inputs instead of an output.
struct Replacement {
    column: usize,
    /// The output, as component:variable.
    output: String,
    /// The inputs, in the same form.
    inputs: Vec<String>,
}

/// Minimum number of samples for the check for gaps. Fewer samples are probably a handwritten profile with uneven
/// spacing.
const SAMPLED: usize = 20;
/// Samples that are further apart than this many usual intervals have a gap between them. The 1e-6 allows for rounding.
const GAP: f64 = 5.0 + 1e-6;

impl Inputs {
    /// Reads the file. Rows with equal times are a jump.
    pub(super) fn read(path: &Path, simulation: Simulation, after_end: AfterEnd) -> Result<Self, DataError> {
        let table = Table::read(path, &Format::default())?;
        let clock = table.times(&TimeColumn { duplicates: Duplicates::Jump, ..TimeColumn::default() })?;
        let mut warnings = Vec::new();
        if let Some(triple) = clock.times().windows(3).find(|times| times[0] == times[2]) {
            warnings.push(format!(
                "{}: several rows are at {} s; the first is the value before the jump, the last the one after it, those \
                 between are ignored",
                table.file(),
                triple[0]
            ));
        }
        Ok(Self {
            table,
            clock,
            simulation,
            after_end,
            feeds: Vec::new(),
            used: BTreeSet::new(),
            replacements: Vec::new(),
            without_unit: Vec::new(),
            mistakes: Vec::new(),
            warnings,
        })
    }

    /// Column for a signal of any component, or of the given component.
    pub(super) fn column(&self, component: Option<&str>, signal: &str) -> Option<usize> {
        let is_name = |name: &str| match component {
            None => name == signal,
            Some(component) => name.split_once(':') == Some((component, signal)),
        };
        let found = self.table.columns().iter().position(|column| is_name(&column.name));
        found.filter(|column| *column != self.clock.column)
    }

    pub(super) fn name(&self, column: usize) -> &str {
        &self.table.columns()[column].name
    }

    /// Converts the column to a signal in a unit. `None`: a mistake was reported.
    pub(super) fn feed(&mut self, column: usize, target: &Target, interpolation: Interpolation) -> Option<usize> {
        self.used.insert(column);
        let is_same =
            |feed: &Feed| feed.column == column && feed.interpolation == interpolation && feed.unit == target.name;
        if let Some(known) = self.feeds.iter().position(is_same) {
            return Some(known);
        }
        let name = self.name(column).to_owned();
        match self.table.signal(&self.clock, &Channel::new(&name), target) {
            Ok(signal) => {
                self.check_span(&name, &signal, interpolation);
                if interpolation == Interpolation::Linear {
                    self.check_gaps(&name, &signal);
                }
                if let Some(unit) = target.name.clone().filter(|unit| unit != "1" && self.unit(column).is_none())
                    && !self.without_unit.contains(&(name.clone(), unit.clone()))
                {
                    self.without_unit.push((name, unit));
                }
                self.feeds.push(Feed { column, interpolation, unit: target.name.clone(), signal });
                Some(self.feeds.len() - 1)
            }
            Err(error) => {
                error.mistakes.into_iter().for_each(|mistake| self.add(mistake));
                None
            }
        }
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.table.columns()[column].unit.as_deref()
    }

    pub(super) fn has_unit(&self, column: usize) -> bool {
        self.unit(column).is_some()
    }

    fn note(&mut self, message: String, help: Option<String>) {
        self.add(Mistake { line: None, message, help });
    }

    fn add(&mut self, mistake: Mistake) {
        if !self.mistakes.contains(&mistake) {
            self.mistakes.push(mistake);
        }
    }

    fn warn(&mut self, warning: String) {
        let warning = format!("{}: {warning}", self.table.file());
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    /// Checks that a signal has values for the whole run. A held signal has values until the last row.
    fn check_span(&mut self, name: &str, signal: &Signal, interpolation: Interpolation) {
        let Simulation { start, stop, step, .. } = self.simulation;
        // Tolerance, because times are rounded.
        let slack = |time: f64| (1e-9 * step).max(4.0 * f64::EPSILON * time.abs());
        let first = signal.times[0];
        if first > start + slack(start) {
            let message =
                format!("`{name}` begins at {first} s, after the start: from {start} s to {first} s it has no value");
            let help = Some(format!(
                "set `start` of [simulation] to {first}, or subtract {} from the times of the file",
                plain(first - start)
            ));
            self.note(message, help);
        }
        let last = match interpolation {
            Interpolation::Linear => signal.times.last(),
            Interpolation::Hold => self.clock.times().last(),
        };
        let Some(last) = last.copied().filter(|last| *last < stop - slack(stop)) else { return };
        match self.after_end {
            AfterEnd::Hold => self.warn(format!("`{name}` ends at {last} s; its last value holds until {stop} s")),
            AfterEnd::Error => {
                let message =
                    format!("`{name}` ends at {last} s, before the stop: from {last} s to {stop} s it has no value");
                // A run has whole steps.
                let steps = ((last - start) / step + 1e-6).floor();
                let end = plain(start + steps * step);
                let hold = "`--after-end hold` keeps the last value";
                let help =
                    if steps > 0.0 { format!("`--stop {end}` ends the run earlier; {hold}") } else { hold.to_owned() };
                self.note(message, Some(help));
            }
        }
    }

    /// Warns of gaps between the samples of a signal, within the run.
    fn check_gaps(&mut self, name: &str, signal: &Signal) {
        let Simulation { start, stop, .. } = self.simulation;
        let distance = |pair: &[f64]| pair[1] - pair[0];
        let mut distances: Vec<f64> =
            signal.times.windows(2).map(distance).filter(|distance| *distance > 0.0).collect();
        if distances.len() < SAMPLED {
            return;
        }
        distances.sort_by(f64::total_cmp);
        let usual = distances[distances.len() / 2];
        let is_gap = |pair: &&[f64]| distance(pair) > GAP * usual && pair[1] > start && pair[0] < stop;
        let gaps: Vec<&[f64]> = signal.times.windows(2).filter(is_gap).collect();
        let Some(longest) = gaps.iter().copied().max_by(|a, b| distance(a).total_cmp(&distance(b))) else { return };
        let more = match gaps.len() - 1 {
            0 => String::new(),
            1 => ", and one shorter gap".to_owned(),
            more => format!(", and {more} shorter gaps"),
        };
        self.warn(format!(
            "`{name}` has no samples from {} s to {} s{more} (they are usually {} s apart); it is interpolated linearly there",
            longest[0],
            longest[1],
            plain(usual)
        ));
    }

    pub(super) fn replace(&mut self, column: usize, output: String, input: String) {
        let is_same = |known: &&mut Replacement| known.column == column && known.output == output;
        match self.replacements.iter_mut().find(is_same) {
            Some(known) if known.inputs.contains(&input) => (),
            Some(known) => known.inputs.push(input),
            None => self.replacements.push(Replacement { column, output, inputs: vec![input] }),
        }
    }

    pub(super) fn check_values(&mut self, feed: usize, of: &str, variable: &Variable) {
        let Feed { column, signal, .. } = &self.feeds[feed];
        let role = if variable.causality == Causality::Output { "output" } else { "input" };
        let name = self.name(*column);
        let whole = |value: f64| {
            // From 2^53 on, a number in the file may have been rounded to an integer.
            let is_whole = value.fract() == 0.0 && value.abs() < (1_u64 << f64::MANTISSA_DIGITS) as f64;
            Some(value as i128).filter(|whole| is_whole && variable.integers().contains(whole))
        };
        let misfit = |(time, value): (&f64, &f64)| {
            let rule = match variable.base_type {
                BaseType::Integer => match whole(*value) {
                    None if variable.integers().contains(&(i128::from(i32::MAX) + 1)) => {
                        format!("is {}, which takes only whole numbers below 2^53 from a file", variable.data_type)
                    }
                    None => format!("is {}", variable.base_type),
                    Some(number) => format!("is an enumeration: {}", parameter::check_item(variable, number).err()?),
                },
                BaseType::Boolean if *value != 0.0 && *value != 1.0 => format!("is {}", variable.base_type),
                _ => return None,
            };
            Some(format!(
                "`{name}` has the value {value} at {time} s, but the {role} `{}` of `{of}` {rule}",
                variable.name
            ))
        };
        let misfit = signal.times.iter().zip(&*signal.values).find_map(misfit);
        let is_outside =
            |value: f64| variable.min.is_some_and(|min| value < min) || variable.max.is_some_and(|max| value > max);
        let mut outside = signal.times.iter().zip(&*signal.values).filter(|(_, value)| is_outside(**value));
        let outside = outside.next().map(|(time, value)| {
            let limits = [("at least", variable.min), ("at most", variable.max)];
            let limits: Vec<String> =
                limits.iter().filter_map(|(words, limit)| limit.map(|limit| format!("{words} {limit}"))).collect();
            let more = 1 + outside.count();
            format!(
                "{more} values of `{name}` are outside the limits of `{}` of `{of}`, {}: the first is {value} at {time} s",
                variable.name,
                limits.join(" and ")
            )
        });
        if let Some(message) = misfit {
            let help = Some(format!(
                "correct the value, or name the column `COMPONENT:{}` to write only the input of another component",
                variable.name
            ));
            self.note(message, help);
        } else if let Some(outside) = outside {
            self.warn(outside);
        }
    }

    /// Reports the mistakes in the file. Columns that write nothing are ignored, unless their name is the name of an
    /// input or resembles the name of a signal.
    pub(super) fn finish(
        mut self,
        inputs: &[String],
        outputs: &[String],
        components: &[&str],
    ) -> Result<Vec<String>, DataError> {
        let mut ignored = Vec::new();
        for column in 0..self.table.columns().len() {
            let name = self.name(column).to_owned();
            // A delimiter at the end of the header makes a column without a name.
            if column == self.clock.column || self.used.contains(&column) || name.is_empty() {
                continue;
            }
            if outputs.contains(&name) {
                ignored.push(format!("`{name}`"));
                continue;
            }
            let known = inputs.iter().chain(outputs).map(String::as_str);
            let help = if inputs.contains(&name) {
                Some("a connection or another column writes the input; name the column `component:input`".to_owned())
            } else {
                suggestion(&name, known)
            };
            let is_of_component = name.split_once(':').is_some_and(|(component, _)| components.contains(&component));
            if help.is_some() || is_of_component {
                self.note(format!("no input takes the signal `{name}`"), help);
            } else {
                ignored.push(format!("`{name}`"));
            }
        }
        if self.used.is_empty() && self.mistakes.is_empty() {
            let message = format!("no input takes any of the signals {}", ignored.join(", "));
            let help = Some("name columns like signals, or component:signal".to_owned());
            self.note(message, help);
        }
        if !self.mistakes.is_empty() {
            return Err(DataError { file: self.table.file().to_owned(), mistakes: self.mistakes });
        }
        for Replacement { column, output, inputs } in mem::take(&mut self.replacements) {
            let name = self.name(column).to_owned();
            self.warn(format!("`{name}` replaces the output {output} at {}", inputs.join(", ")));
        }
        if !self.without_unit.is_empty() {
            let columns: Vec<String> =
                self.without_unit.iter().map(|(name, unit)| format!("`{name}` in {unit}")).collect();
            self.warn(format!(
                "columns without a unit are assumed to have that of the variable: {}",
                columns.join(", ")
            ));
        }
        if !ignored.is_empty() {
            self.warn(format!("no input takes the columns {}; they are ignored", ignored.join(", ")));
        }
        Ok(self.warnings)
    }
}

/// Returns a time for a message, without the rounding errors of sums and differences.
fn plain(time: f64) -> f64 {
    (time * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(text: &str, after_end: AfterEnd) -> Result<Inputs, DataError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.csv");
        std::fs::write(&path, text).unwrap();
        let simulation = Simulation { start: 0.0, stop: 1.0, step: 0.1, steps: 10, every: 1, ..Simulation::default() };
        Inputs::read(&path, simulation, after_end)
    }

    fn mistake(text: &str, interpolation: Interpolation) -> String {
        let mut inputs = inputs(text, AfterEnd::Error).unwrap();
        let column = inputs.column(None, "a").unwrap();
        inputs.feed(column, &Target::default(), interpolation);
        inputs
            .finish(&["a".to_owned()], &[], &[])
            .err()
            .map_or(String::new(), |error| error.mistakes[0].message.clone())
    }

    /// The message contains the interval without a value. A held signal keeps its last value until the last row.
    #[test]
    fn a_signal_covers_the_run() {
        let (linear, hold) = (Interpolation::Linear, Interpolation::Hold);
        assert_eq!(mistake("time,a\n0,1\n1,2\n", linear), "");
        assert_eq!(mistake("time,a\n-1,1\n2,2\n", linear), "");
        assert_eq!(
            mistake("time,a\n0.5,1\n1,2\n", linear),
            "`a` begins at 0.5 s, after the start: from 0 s to 0.5 s it has no value"
        );
        for (text, interpolation) in [("time,a\n0,1\n0.25,2\n", linear), ("time,a\n0,1\n0.25,2\n", hold)] {
            assert_eq!(
                mistake(text, interpolation),
                "`a` ends at 0.25 s, before the stop: from 0.25 s to 1 s it has no value"
            );
        }
        let missing = "time,a\n0,1\n0.25,2\n1,\n";
        assert!(mistake(missing, linear).starts_with("`a` ends at 0.25 s"));
        assert_eq!(mistake(missing, hold), "");

        let mut held = inputs("time,a\n0,1\n0.25,2\n", AfterEnd::Hold).unwrap();
        held.feed(1, &Target::default(), linear);
        let warnings = held.finish(&[], &[], &[]).unwrap();
        assert!(warnings[0].ends_with("in.csv: `a` ends at 0.25 s; its last value holds until 1 s"), "{warnings:?}");
    }

    /// A gap is a distance of more than five usual intervals between samples that are interpolated.
    #[test]
    fn gaps_between_samples_are_reported() {
        let warnings = |times: &mut dyn Iterator<Item = f64>, interpolation: Interpolation| {
            let rows: String = times.map(|time| format!("{time},1\n")).collect();
            let mut inputs = inputs(&format!("time,a\n{rows}"), AfterEnd::Error).unwrap();
            inputs.feed(1, &Target::default(), interpolation);
            inputs.finish(&[], &[], &[]).unwrap()
        };
        // Times every 0.01 s, with gaps between two rows.
        let grid = |gaps: &'static [(u32, u32)]| {
            (0..=200).filter(|k| !gaps.iter().any(|(a, b)| (a..b).contains(&k) && a != k)).map(|k| f64::from(k) / 100.0)
        };
        let (linear, hold) = (Interpolation::Linear, Interpolation::Hold);
        assert_eq!(warnings(&mut grid(&[]), linear), [""; 0]);
        // Four missing rows make a distance of five intervals, which is not yet a gap.
        assert_eq!(warnings(&mut grid(&[(10, 15)]), linear), [""; 0]);
        let found = warnings(&mut grid(&[(10, 20), (30, 80)]), linear);
        let expected = "in.csv: `a` has no samples from 0.3 s to 0.8 s, and one shorter gap (they are usually 0.01 s apart); \
                        it is interpolated linearly there";
        assert!(matches!(&found[..], [warning] if warning.ends_with(expected)), "{found:?}");
        // No warnings for a gap after the end of the run at 1 s, for a held signal, and for a few points, which are a
        // profile.
        assert_eq!(warnings(&mut grid(&[(130, 180)]), linear), [""; 0]);
        assert_eq!(warnings(&mut grid(&[(30, 80)]), hold), [""; 0]);
        assert_eq!(warnings(&mut [0.0, 0.1, 0.2, 0.3, 2.0].into_iter(), linear), [""; 0]);
    }

    #[test]
    fn columns_that_nothing_takes_are_ignored_unless_they_are_slips() {
        let unused = |text: &str| {
            let mut inputs = inputs(text, AfterEnd::Error).unwrap();
            inputs.feed(1, &Target::default(), Interpolation::Linear);
            let takes = ["a", "steer.front"].map(str::to_owned);
            let has = ["driver.steer", "driver:driver.steer"].map(str::to_owned);
            inputs.finish(&takes, &has, &["driver"]).map_err(|error| error.mistakes[0].message.clone())
        };
        let warnings = unused("time,a,Marker,driver.steer\n0,0,start,1\n1,0,end,1\n").unwrap();
        assert!(warnings[0].ends_with("no input takes the columns `Marker`, `driver.steer`; they are ignored"));
        for slip in ["driver.stear", "driver:speed", "steer.front"] {
            let error = unused(&format!("time,a,{slip}\n0,0,1\n1,0,1\n")).unwrap_err();
            assert_eq!(error, format!("no input takes the signal `{slip}`"));
        }
    }
}
