//! Metrics and figures.

use super::findings;
use super::pattern::split_pattern;
use super::system::{Column, Resolver, System, context, near_outputs, outputs};
use crate::metrics::{self, Combine, Definition, Expression, Kind, Problem};
use crate::parameter;
use crate::report::Source;
use crate::spanned::Spanned;
use crate::{plan, report, scenario};
use fmu_import::description::{Causality, Initial, Value, Variability};
use fmu_import::names::suggestion;

impl Resolver<'_> {
    /// The column of a signal of numbers.
    fn column_index(&mut self, written: &Spanned<String>, systems: &[System<'_>], columns: &[Column]) -> Option<usize> {
        let index = self.any_column_index(written, systems, columns)?;
        if columns[index].plan.is_binary {
            let message = format!("`{}` is a Binary; metrics and figures need numbers", written.get_ref());
            self.problems.add(written.span(), message);
            return None;
        }
        Some(index)
    }

    fn any_column_index(
        &mut self,
        written: &Spanned<String>,
        systems: &[System<'_>],
        columns: &[Column],
    ) -> Option<usize> {
        let (component, name) = split_pattern(written.get_ref());
        if component.is_some() {
            self.component_and_name(written)?;
        }
        let candidates = outputs(systems, component);
        let owners: Vec<&str> =
            candidates.iter().filter(|(_, output)| *output == name).map(|(owner, _)| *owner).collect();
        match owners[..] {
            [] => {
                // The name may also be that of an input that the input file writes.
                let mut of_inputs = columns.iter().enumerate().filter(|(_, column)| {
                    column.variable == name && component.is_none_or(|component| component == column.component)
                });
                if let (Some((index, _)), None) = (of_inputs.next(), of_inputs.next()) {
                    return Some(index);
                }
                self.problems.add_with_help(
                    written.span(),
                    format!("there is no output `{}`", written.get_ref()),
                    Some(near_outputs(systems, component, name)),
                );
                None
            }
            [owner] => {
                let at = columns.iter().position(|c| c.component == owner && c.variable == name);
                if at.is_none() {
                    self.problems.add_with_help(
                        written.span(),
                        format!("`{}` is not recorded", written.get_ref()),
                        Some("add it to `signals` of [record]".to_string()),
                    );
                }
                at
            }
            [first, ..] => {
                self.problems.add_with_help(
                    written.span(),
                    format!("several components have an output `{name}`: {}", owners.join(", ")),
                    Some(format!("name one of them: \"{first}:{name}\"")),
                );
                None
            }
        }
    }

    fn conversion(&mut self, unit: Option<&Spanned<String>>, column: &plan::Column) -> Option<(f64, f64)> {
        let Some(unit) = unit else {
            return Some((1.0, 0.0));
        };
        let scale = parameter::scale(&column.name, column.unit.as_deref(), &column.units, unit.get_ref(), "shown");
        scale.map_err(|(message, help)| self.problems.add_with_help(unit.span(), message, help)).ok()
    }

    pub(super) fn metrics(&mut self, systems: &[System<'_>], columns: &[Column]) -> Vec<report::Metric> {
        let mut metrics = Vec::new();
        for (index, metric) in self.scenario.metrics.iter().enumerate() {
            let found = match &metric.value {
                Some(value) => self.expression(value, index).map(|source| {
                    let unit = metric.unit.as_ref().map(|unit| unit.get_ref().clone());
                    (source, unit)
                }),
                None => self.of_signals(metric, systems, columns),
            };
            let Some((source, unit)) = found else { continue };
            let changes = findings::paper_changes(metric, self.scenario, &mut self.problems);
            metrics.push(report::Metric {
                name: metric.name.get_ref().clone(),
                title: metric.title.clone(),
                source,
                unit,
                digits: metric.digits.as_ref().map(|d| *d.get_ref()),
                paper: metric.paper.as_ref().map(|paper| report::Paper {
                    table: paper.table.clone(),
                    values: paper.values.iter().map(|(key, value)| (key.get_ref().clone(), *value)).collect(),
                    changes,
                    calibrated: paper
                        .calibrated
                        .as_ref()
                        .map(|keys| keys.iter().map(|key| key.get_ref().clone()).collect()),
                }),
                requirement: self.requirement(metric),
            });
        }
        metrics
    }

    fn of_signals(
        &mut self,
        metric: &scenario::Metric,
        systems: &[System<'_>],
        columns: &[Column],
    ) -> Option<(Source, Option<String>)> {
        let indices: Vec<usize> = metric.all_signals().filter_map(|s| self.column_index(s, systems, columns)).collect();
        let first = *indices.first().filter(|_| indices.len() == metric.all_signals().count())?;
        let shown = &columns[first].plan;
        let (factor, offset) = self.conversion(metric.unit.as_ref(), shown)?;
        let combine = metric.combine.as_ref().map(|c| *c.get_ref());
        let is_squares = combine == Some(Combine::Squares);
        for signal in metric.signals.iter().filter(|_| !is_squares) {
            self.beside(Some(signal), &indices[..1], systems, columns);
        }
        let minus = self.beside(metric.minus.as_ref(), &indices, systems, columns);
        let until = metric.until.as_ref().and_then(|until| self.until(until.get_ref(), systems, columns));
        let unit = if is_squares {
            Some("1".to_string())
        } else {
            metric.unit.as_ref().map(|u| u.get_ref().clone()).or_else(|| shown.unit.clone())
        };
        // The checks of the scenario require it.
        let kind = metric.kind?;
        let definition = Definition {
            columns: indices,
            combine,
            weights: metric.weights.as_ref().map_or(Vec::new(), |w| w.get_ref().clone()),
            kind,
            window: metric.window.as_ref().map(|w| *w.get_ref()),
            until,
            minus,
            from_baseline: metric.from_baseline,
            band: metric.band.as_ref().map(|b| *b.get_ref()),
            threshold: metric.threshold.as_ref().map(|t| *t.get_ref()),
            factor,
            // A difference has no offset.
            offset: if minus.is_some() || metric.from_baseline { 0.0 } else { offset },
        };
        self.first_row(metric, &definition, systems, &columns[first]);
        Some((Source::Signals(definition), kind.unit(unit.as_deref())))
    }

    /// Warns if the first row alone, which holds the start value of a discrete-time model, violates the requirement.
    fn first_row(&mut self, metric: &scenario::Metric, of: &Definition, systems: &[System<'_>], column: &Column) {
        let is_plain = of.combine.is_none() && of.minus.is_none() && !of.from_baseline && !column.plan.from_file;
        let is_first_in = of.window.is_none_or(|[from, _]| from <= 0.0);
        let (Some(requirement), true) = (self.requirement(metric), is_plain && is_first_in) else { return };
        for system in systems.iter().filter(|system| requirement.cases.contains(system.case.name.get_ref())) {
            let outputs = system.member(&column.component).map(|m| system.members[m].all(Causality::Output));
            let Some((_, output)) = outputs.and_then(|mut all| all.find(|(_, v)| v.name == column.variable)) else {
                continue;
            };
            let holds_start = (output.variability, output.initial) == (Variability::Discrete, Some(Initial::Exact));
            let start = output.start.as_ref().filter(|_| holds_start);
            let Some(start) = start.and_then(Value::number) else { continue };
            let shown = of.factor * start + of.offset;
            let is_below = |limit: f64| shown < limit && of.kind == Kind::Min;
            let is_above =
                |limit: f64| (shown > limit && of.kind == Kind::Max) || (shown.abs() > limit && of.kind == Kind::Peak);
            if !requirement.min.is_some_and(is_below) && !requirement.max.is_some_and(is_above) {
                continue;
            }
            self.problems.set_context(Some(context(system.case, None)));
            let message = format!(
                "`{}` can never meet its limit: `{}` is already {shown} in the first row, where an output of a \
                 discrete-time model still has its start value",
                metric.name.get_ref(),
                column.plan.name
            );
            let help =
                "give the metric a `window` that begins after the first sample, or the output another start value";
            self.problems.warn(metric.name.span(), message, Some(help.to_string()));
        }
        self.problems.set_context(None);
    }

    /// Parses the formula of the metric with this index, which may use metrics above it.
    fn expression(&mut self, written: &Spanned<String>, index: usize) -> Option<Source> {
        let metrics = &self.scenario.metrics;
        let above = |name: &str| metrics[..index].iter().position(|metric| metric.name.get_ref() == name);
        let error = match Expression::parse(written.get_ref(), above) {
            Ok(value) => return Some(Source::Metrics { uses: value.metrics().collect(), value }),
            Err(error) => error,
        };
        // After the quote, if the file contains the string unescaped.
        let inside = written.span().start + 1;
        let rest = self.problems.text_from(inside);
        let is_plain = rest.is_some_and(|rest| rest.starts_with(written.as_str()));
        let place = if is_plain { inside + error.place.start..inside + error.place.end } else { written.span() };
        let (message, help) = match &error.problem {
            Problem::Unknown(name) if metrics[index].name.get_ref() == name => {
                ("a metric cannot be part of its own `value`".to_string(), None)
            }
            Problem::Unknown(name) if metrics.iter().any(|metric| metric.name.get_ref() == name) => {
                (format!("`{name}` is defined below; a `value` can only use metrics above it"), None)
            }
            Problem::Unknown(name) => {
                let above = metrics[..index].iter().map(|metric| metric.name.as_str());
                (error.problem.to_string(), suggestion(name, above))
            }
            _ => (error.problem.to_string(), None),
        };
        self.problems.add_with_help(place, message, help);
        None
    }

    fn requirement(&self, metric: &scenario::Metric) -> Option<report::Requirement> {
        let [min, max] = [&metric.min, &metric.max].map(|limit| limit.as_ref().map(|limit| *limit.get_ref()));
        let cases = self.scenario.cases.iter().map(|case| &case.name);
        let named = metric.required_of.as_ref().map(|names| names.get_ref());
        let is_required = |case: &&Spanned<String>| named.is_none_or(|names| names.iter().any(|name| name == *case));
        (min.is_some() || max.is_some()).then(|| report::Requirement {
            min,
            max,
            cases: cases.filter(is_required).map(|name| name.get_ref().clone()).collect(),
            share: metric.share.as_ref().map_or(1.0, |share| *share.get_ref()),
            source: metric.required_by.as_ref().map(|text| text.get_ref().clone()),
        })
    }

    /// Finds the column of a signal that is compared with other signals, and must therefore have the same unit of
    /// measure.
    fn beside(
        &mut self,
        signal: Option<&Spanned<String>>,
        others: &[usize],
        systems: &[System<'_>],
        columns: &[Column],
    ) -> Option<usize> {
        let signal = signal?;
        let index = self.column_index(signal, systems, columns)?;
        let unit = |index: usize| columns[index].plan.unit.as_deref().unwrap_or("no unit");
        if let Some(&other) = others.iter().find(|&&other| unit(other) != unit(index)) {
            let name = &columns[other].plan.name;
            let message = format!("`{}` is in {}, but `{name}` is in {}", signal.get_ref(), unit(index), unit(other));
            self.problems.add(signal.span(), message);
        }
        Some(index)
    }

    fn until(&mut self, until: &scenario::Until, systems: &[System<'_>], columns: &[Column]) -> Option<metrics::Until> {
        let column = self.column_index(&until.signal, systems, columns)?;
        let (factor, offset) = self.conversion(until.unit.as_ref(), &columns[column].plan)?;
        // The checks of the scenario require one of the two.
        let level = until.above.or(until.below)?;
        Some(metrics::Until { column, above: until.above.is_some(), level: (level - offset) / factor })
    }

    pub(super) fn figures(&mut self, systems: &[System<'_>], columns: &[Column]) -> Vec<report::Figure> {
        let mut figures = Vec::new();
        for figure in &self.scenario.figures {
            let mut indices = Vec::new();
            let mut scale = (1.0, 0.0);
            for signal in &figure.signals {
                if let Some(column) = self.column_index(signal, systems, columns) {
                    let shown = &columns[column].plan;
                    let own = self.conversion(figure.unit.as_ref(), shown);
                    scale = own.unwrap_or(scale);
                    indices.push(column);
                }
            }
            let against = self.beside(figure.against.as_ref(), &indices, systems, columns);
            let right = figure.right.as_ref().and_then(|signal| self.column_index(signal, systems, columns));
            let is_on = |option: &Option<Spanned<bool>>| option.as_ref().is_some_and(|option| *option.get_ref());
            let (same_scale, equal_axes) = (is_on(&figure.same_scale), is_on(&figure.equal_axes));
            for signal in figure.signals.iter().filter(|_| same_scale || equal_axes) {
                // Signals in different units cannot have a common scale.
                self.beside(Some(signal), &indices[..indices.len().min(1)], systems, columns);
            }
            let metric_index = |name: &Spanned<String>| {
                let metrics = &self.scenario.metrics;
                metrics.iter().position(|m| m.name == *name)
            };
            let over = match &figure.over {
                Some(name) if !figure.kind.is_of_signals() => metric_index(name),
                Some(signal) if equal_axes => self.beside(Some(signal), &indices, systems, columns),
                Some(signal) => self.column_index(signal, systems, columns),
                None => None,
            };
            figures.push(report::Figure {
                name: figure.name.get_ref().clone(),
                title: figure.title.clone(),
                kind: figure.kind,
                cases: match &figure.cases {
                    Some(cases) => cases.iter().map(|name| name.get_ref().clone()).collect(),
                    None => self.scenario.cases.iter().map(|case| case.name.get_ref().clone()).collect(),
                },
                separate: is_on(&figure.separate),
                columns: indices,
                against,
                right,
                over,
                same_scale,
                equal_axes,
                band: figure.band.as_ref().map(|band| *band.get_ref()),
                metrics: figure.metrics.iter().filter_map(metric_index).collect(),
                window: figure.window.as_ref().map(|w| *w.get_ref()),
                unit: figure.unit.as_ref().map(|u| u.get_ref().clone()),
                factor: scale.0,
                offset: scale.1,
                levels: figure.levels.iter().map(|level| level.get_ref().clone()).collect(),
                caption: figure
                    .caption
                    .as_ref()
                    .map(|caption| findings::text(caption, self.scenario, &mut self.problems)),
            });
        }
        figures
    }
}
