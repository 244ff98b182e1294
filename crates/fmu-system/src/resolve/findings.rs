//! Findings: claims of a paper, the metrics of the runs that verify them, and texts with these numbers.
//!
//! A scenario refers to cells of the table of metrics as `metric.case`, or `metric.case@point` with a sweep; without
//! the point, it means all points. `/case`, `/case@point` or `/metric.case@point` after a cell names the cell to
//! compare with; the default is the baseline of the case. A text contains numbers as `{cell:format}`. Nothing is
//! computed here: the plan contains references, which the reader of the results resolves.

use crate::problem::Collector;
use crate::report::{Cell, Check, Expect, Finding, Format, Part, Text, word};
use crate::scenario::{self, Scenario, WrittenCheck, WrittenFinding, unknown};
use crate::spanned::Spanned;
use fmu_import::names::suggestion;
use std::collections::BTreeMap;
use std::ops::Range;

pub(super) fn findings(scenario: &Scenario, problems: &mut Collector) -> Vec<Finding> {
    let mut resolver = Resolver { scenario, problems };
    scenario.findings.iter().map(|finding| resolver.finding(finding)).collect()
}

/// Resolves a text outside of a finding.
pub(super) fn text(written: &Spanned<String>, scenario: &Scenario, problems: &mut Collector) -> Text {
    Resolver { scenario, problems }.text(written)
}

/// The keys of the changes that a paper gives, each as two complete cells of the metric: "case@point/case@point".
pub(super) fn paper_changes(
    metric: &scenario::Metric,
    scenario: &Scenario,
    problems: &mut Collector,
) -> BTreeMap<String, f64> {
    let Some(paper) = &metric.paper else { return BTreeMap::new() };
    let mut resolver = Resolver { scenario, problems };
    let own = scenario.metrics.iter().position(|m| m.name == metric.name).unwrap_or_default();
    let mut changes = BTreeMap::new();
    for (key, percent) in &paper.changes {
        let written = format!("{}.{}", metric.name.get_ref(), key.get_ref());
        let Some((cells, against)) = resolver.reference(&written, key.span(), true) else { continue };
        for (cell, other) in cells.iter().zip(&against) {
            if other.metric == own {
                changes.insert(change_key(cell, other), *percent);
            } else {
                resolver.problems.add(key.span(), "a change in the paper needs two cells of the same metric");
            }
        }
    }
    changes
}

fn change_key(cell: &Cell, against: &Cell) -> String {
    format!("{}/{}", cell.key(), against.key())
}

struct Resolver<'a> {
    scenario: &'a Scenario,
    problems: &'a mut Collector,
}

impl Resolver<'_> {
    fn finding(&mut self, written: &WrittenFinding) -> Finding {
        let mut checks = Vec::new();
        for check in written.checks.get_ref() {
            self.check(check, written.own, &mut checks);
        }
        if written.checks.is_empty() {
            self.problems.add(written.checks.span(), "a finding needs at least one check");
        }
        Finding {
            claim: self.text(&written.claim),
            explanation: self.text(&written.explanation),
            own: written.own,
            checks,
        }
    }

    fn check(&mut self, written: &WrittenCheck, own: bool, checks: &mut Vec<Check>) {
        let expect = written.expect.as_ref().map(|e| *e.get_ref());
        let needs_level = matches!(expect, Some(Expect::Below | Expect::Above));
        match &written.level {
            Some(level) if !needs_level => {
                self.problems.add(level.span(), "only \"below\" and \"above\" have a `level`");
            }
            Some(level) if !level.is_finite() => {
                self.problems.add(level.span(), "expected a finite number");
            }
            None if needs_level => {
                self.problems.add(written.cells.span(), "\"below\" and \"above\" need a `level`");
            }
            _ => (),
        }
        if let (true, Some(span)) = (own, written.expect.as_ref().filter(|e| e.is_of_paper()).map(|e| e.span())) {
            self.problems.add(span, "a finding with `own = true` has no number in the paper");
        }
        if written.cells.is_empty() {
            self.problems.add(written.cells.span(), "expected at least one cell, \"metric.case\"");
        }
        for cell in written.cells.get_ref() {
            let compares = matches!(
                expect,
                Some(Expect::PaperChange | Expect::Lower | Expect::Higher | Expect::Unchanged | Expect::FallsMore)
            );
            let Some((cells, against)) = self.reference(cell.get_ref(), cell.span(), compares) else { continue };
            for (index, of) in cells.into_iter().enumerate() {
                let other = against.get(index).cloned();
                let Some(expect) = expect.or_else(|| self.expect_of_paper(&of, other.as_ref(), own)) else {
                    self.problems.add_with_help(
                        cell.span(),
                        format!("the paper gives no number for `{}` of `{}`", of.key(), self.name(of.metric)),
                        Some("set `expect` to lower, higher, unchanged, below, above or never".to_string()),
                    );
                    continue;
                };
                if expect == Expect::FallsMore {
                    for one in std::iter::once(&of).chain(&other) {
                        if self.baseline(&one.case).is_none() {
                            let message = format!("\"falls_more\" needs a baseline of the case `{}`", one.case);
                            self.problems.add(cell.span(), message);
                        }
                    }
                }
                let against = match expect {
                    Expect::PaperValue | Expect::Below | Expect::Above | Expect::Never => None,
                    _ => other,
                };
                checks.push(Check { cell: of, against, expect, level: written.level.as_ref().map(|l| *l.get_ref()) });
            }
        }
    }

    /// Returns the paper's number for a cell: a change, otherwise a value.
    fn expect_of_paper(&self, cell: &Cell, against: Option<&Cell>, own: bool) -> Option<Expect> {
        let paper = self.scenario.metrics[cell.metric].paper.as_ref().filter(|_| !own)?;
        let has = |cell: &Cell| paper.values.keys().any(|key| *key.get_ref() == cell.key());
        if let Some(against) = against
            && against.metric == cell.metric
        {
            // A change in the file names the cell to compare with; otherwise, it is a change from the baseline.
            let written = |key: &str| {
                key == cell.key()
                    || key == change_key(cell, against)
                    || cell.case == key
                    || key == format!("{}/{}", cell.case, against.case)
            };
            if paper.changes.keys().any(|key| written(key.get_ref())) || (has(cell) && has(against)) {
                return Some(Expect::PaperChange);
            }
        }
        has(cell).then_some(Expect::PaperValue)
    }

    fn baseline(&self, case: &str) -> Option<String> {
        let case = self.scenario.cases.iter().find(|c| c.name.get_ref() == case)?;
        case.baseline.as_ref().map(|baseline| baseline.get_ref().clone())
    }

    fn name(&self, metric: usize) -> &str {
        self.scenario.metrics[metric].name.get_ref()
    }

    /// Returns the cells of `metric.case@point/case@point`, and the cells to compare them with, if any; `compares`
    /// requires them. `None`: a mistake was reported.
    fn reference(&mut self, written: &str, span: Range<usize>, compares: bool) -> Option<(Vec<Cell>, Vec<Cell>)> {
        let (cell, other) = match written.split_once('/') {
            Some((cell, other)) => (cell, Some(other)),
            None => (written, None),
        };
        let Some((metric, rest)) = cell.split_once('.') else {
            self.problems.add(span, format!("`{written}`: expected \"metric.case\" or \"metric.case@point\""));
            return None;
        };
        let metric = self.metric(metric, &span)?;
        let cells = self.cells(metric, rest, None, &span)?;
        let mut against = Vec::new();
        for cell in &cells {
            match other {
                Some(other) => {
                    let (metric, rest) = match other.split_once('.') {
                        Some((name, rest)) => (self.metric(name, &span)?, rest),
                        None => (cell.metric, other),
                    };
                    against.extend(self.cells(metric, rest, cell.point.as_deref(), &span)?);
                }
                None => match self.baseline(&cell.case) {
                    Some(baseline) => against.push(Cell { case: baseline, ..cell.clone() }),
                    None if compares => {
                        self.problems.add_with_help(
                            span,
                            format!("`{written}`: the case `{}` has no baseline to compare with", cell.case),
                            Some(format!("name the other case: \"{written}/case\"")),
                        );
                        return None;
                    }
                    None => (),
                },
            }
        }
        Some((cells, against))
    }

    fn metric(&mut self, name: &str, span: &Range<usize>) -> Option<usize> {
        let metrics = &self.scenario.metrics;
        let found = metrics.iter().position(|m| m.name.get_ref() == name);
        if found.is_none() {
            let names = metrics.iter().map(|m| m.name.as_str());
            unknown("metric", name, span.clone(), names, self.problems);
        }
        found
    }

    /// Returns the cell for `case@point`. For `case` alone, returns the cell at the point `here`, or the cells at all
    /// points if `here` is `None`.
    fn cells(&mut self, metric: usize, rest: &str, here: Option<&str>, span: &Range<usize>) -> Option<Vec<Cell>> {
        let scenario = self.scenario;
        let (case, point) = match rest.split_once('@') {
            Some((case, point)) => (case, Some(point)),
            None => (rest, here),
        };
        let cases = || scenario.cases.iter().map(|c| c.name.as_str());
        if !cases().any(|name| name == case) {
            unknown("case", case, span.clone(), cases(), self.problems);
            return None;
        }
        let points: Vec<&str> = scenario.points.iter().map(|p| p.name.as_str()).collect();
        let cell = |point: Option<&str>| Cell { metric, case: case.to_string(), point: point.map(str::to_string) };
        match point {
            Some(point) if !points.contains(&point) => {
                unknown("point", point, span.clone(), points, self.problems);
                None
            }
            Some(point) => Some(vec![cell(Some(point))]),
            None if points.is_empty() => Some(vec![cell(None)]),
            None => Some(points.into_iter().map(|point| cell(Some(point))).collect()),
        }
    }

    fn text(&mut self, written: &Spanned<String>) -> Text {
        let mut parts = Vec::new();
        let mut rest = written.as_str();
        let mut from = written.span().start;
        while let Some((words, behind)) = rest.split_once('{') {
            if !words.is_empty() {
                parts.push(Part::Words(words.to_string()));
            }
            let Some((inside, behind)) = behind.split_once('}') else {
                self.problems.add(written.span(), "a `{` without a `}`");
                return parts;
            };
            rest = behind;
            // Find the text in the file: escapes and line breaks make it differ from the string.
            let raw = format!("{{{inside}}}");
            let length = written.span().end - from;
            let rest = self.problems.text_from(from).and_then(|rest| rest.get(..length));
            let within = rest.and_then(|text| text.find(&raw));
            let span = match within {
                Some(at) => {
                    from += at + raw.len();
                    from - raw.len()..from
                }
                None => written.span(),
            };
            parts.extend(self.number(inside, span));
        }
        if !rest.is_empty() {
            parts.push(Part::Words(rest.to_string()));
        }
        parts
    }

    fn number(&mut self, inside: &str, span: Range<usize>) -> Option<Part> {
        let (of, name) = inside.split_once(':').unwrap_or((inside, "value"));
        let Some(format) = Format::parse(name) else {
            let names = Format::ALL.map(word);
            let message = format!("unknown format `{name}`, expected one of {}", names.join(", "));
            self.problems.add_with_help(span, message, suggestion(name, names.iter().map(String::as_str)));
            return None;
        };
        if format.is_of_metric() {
            let metric = self.metric(of, &span)?;
            let written = &self.scenario.metrics[metric];
            let (key, has) = match format {
                Format::Threshold => ("threshold", written.threshold.is_some()),
                Format::Band => ("band", written.band.is_some()),
                _ => ("window", written.window.is_some()),
            };
            if !has {
                self.problems.add(span, format!("the metric `{of}` has no `{key}`"));
                return None;
            }
            return Some(Part::Number { format, metric, cells: Vec::new(), against: Vec::new() });
        }
        let (cells, against) = self.reference(of, span.clone(), format.compares())?;
        let metric = cells.first()?.metric;
        let paper = self.scenario.metrics[metric].paper.is_some();
        if matches!(format, Format::Paper | Format::PaperChange | Format::PaperBy) {
            let wanted = |index: usize, cell: &Cell| match format {
                Format::Paper => self.expect_of_paper(cell, None, false) == Some(Expect::PaperValue),
                _ => self.expect_of_paper(cell, against.get(index), false) == Some(Expect::PaperChange),
            };
            if !paper || !cells.iter().enumerate().all(|(index, cell)| wanted(index, cell)) {
                let what = if matches!(format, Format::Paper) { "value" } else { "change" };
                self.problems.add(span, format!("the paper gives no {what} for `{of}`"));
                return None;
            }
        }
        let against = if format.compares() { against } else { Vec::new() };
        Some(Part::Number { format, metric, cells, against })
    }
}
