//! Metrics and figures.

use super::findings;
use super::pattern::split_pattern;
use super::system::{Column, Resolver, System, near_outputs, outputs};
use crate::metrics::{self, Combine, Definition};
use crate::{plan, report, scenario};
use fmu_import::names::{any_of, suggestion};
use serde_spanned::Spanned;

impl Resolver<'_> {
    /// Column of a signal named in a metric or a figure.
    fn column_index(&mut self, written: &Spanned<String>, systems: &[System<'_>], columns: &[Column]) -> Option<usize> {
        let (component, name) = split_pattern(written.get_ref());
        if component.is_some() {
            self.component_and_name(written)?;
        }
        let candidates = outputs(systems, component);
        let owners: Vec<&str> =
            candidates.iter().filter(|(_, output)| *output == name).map(|(owner, _)| *owner).collect();
        match owners[..] {
            [] => {
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

    /// Factor and offset of a unit to show a column in.
    fn conversion(&mut self, unit: Option<&Spanned<String>>, column: &plan::Column) -> Option<(f64, f64)> {
        let Some(unit) = unit else {
            return Some((1.0, 0.0));
        };
        let name = unit.get_ref();
        if column.unit.as_ref() == Some(name) {
            return Some((1.0, 0.0));
        }
        let found = column.units.iter().find(|u| u.name == *name);
        if found.is_none() {
            let own = column.unit.iter();
            let all: Vec<&str> = own.chain(column.units.iter().map(|u| &u.name)).map(String::as_str).collect();
            let help = suggestion(name, all.iter().copied());
            let message = format!("`{}` cannot be shown in `{name}`, expected {}", column.name, any_of(&all));
            self.problems.add_with_help(unit.span(), message, help);
        }
        found.map(|u| (u.factor, u.offset))
    }

    pub(super) fn metrics(&mut self, systems: &[System<'_>], columns: &[Column], text: &str) -> Vec<report::Metric> {
        let mut metrics = Vec::new();
        for metric in &self.scenario.metrics {
            let indices: Vec<usize> =
                metric.all_signals().filter_map(|s| self.column_index(s, systems, columns)).collect();
            let Some(&first) = indices.first().filter(|_| indices.len() == metric.all_signals().count()) else {
                continue;
            };
            let shown = &columns[first].plan;
            let Some((factor, offset)) = self.conversion(metric.unit.as_ref(), shown) else {
                continue;
            };
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
            let changes = findings::paper_changes(metric, self.scenario, text, &mut self.problems);
            metrics.push(report::Metric {
                name: metric.name.get_ref().clone(),
                title: metric.title.clone(),
                definition: Definition {
                    columns: indices,
                    combine,
                    weights: metric.weights.as_ref().map_or(Vec::new(), |w| w.get_ref().clone()),
                    kind: metric.kind,
                    window: metric.window.as_ref().map(|w| *w.get_ref()),
                    until,
                    minus,
                    from_baseline: metric.from_baseline,
                    band: metric.band.as_ref().map(|b| *b.get_ref()),
                    threshold: metric.threshold.as_ref().map(|t| *t.get_ref()),
                    factor,
                    // A difference has none.
                    offset: if minus.is_some() || metric.from_baseline { 0.0 } else { offset },
                },
                unit: metric.kind.unit(unit.as_deref()),
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
            });
        }
        metrics
    }

    /// Column of a signal that is compared with others, which have its unit of measure.
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
        // Checked to be one of the two.
        let level = until.above.or(until.below)?;
        Some(metrics::Until { column, above: until.above.is_some(), level: (level - offset) / factor })
    }

    pub(super) fn figures(&mut self, systems: &[System<'_>], columns: &[Column], text: &str) -> Vec<report::Figure> {
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
            let metric_index = |name: &Spanned<String>| {
                let metrics = &self.scenario.metrics;
                metrics.iter().position(|m| m.name == *name)
            };
            figures.push(report::Figure {
                name: figure.name.get_ref().clone(),
                title: figure.title.clone(),
                kind: figure.kind,
                cases: match &figure.cases {
                    Some(cases) => cases.get_ref().iter().map(|name| name.get_ref().clone()).collect(),
                    None => self.scenario.cases.iter().map(|case| case.name.get_ref().clone()).collect(),
                },
                separate: figure.separate.as_ref().is_some_and(|separate| *separate.get_ref()),
                columns: indices,
                against,
                metrics: figure.metrics.iter().filter_map(metric_index).collect(),
                window: figure.window.as_ref().map(|w| *w.get_ref()),
                unit: figure.unit.as_ref().map(|u| u.get_ref().clone()),
                factor: scale.0,
                offset: scale.1,
                levels: figure.levels.iter().map(|level| level.get_ref().clone()).collect(),
                caption: figure
                    .caption
                    .as_ref()
                    .map(|caption| findings::text(caption, self.scenario, text, &mut self.problems)),
            });
        }
        figures
    }
}
