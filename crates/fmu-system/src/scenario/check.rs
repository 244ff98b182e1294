//! Checks that need no FMU.

use super::layout::{Figure, Metric, Scenario, Simulation};
use crate::metrics::{Combine, Kind};
use crate::problem::Collector;
use crate::report::{FigureKind, word};
use crate::spanned::Spanned;
use fmu_import::limits::{RUNS, STEPS};
use fmu_import::names::suggestion;
use std::collections::BTreeSet;
use std::ops::Range;

/// Returns the number of steps between two times. Fails if the number is not whole, within a relative 1e-9, or above
/// the limit.
pub(crate) fn whole_steps(start: f64, stop: f64, step: f64) -> Result<u64, String> {
    let ratio = (stop - start) / step;
    let steps = ratio.round();
    if steps > STEPS as f64 {
        return Err(format!(
            "from start {start} s to stop {stop} s are {ratio:.3e} steps of {step:?} s, the limit is {STEPS}"
        ));
    }
    if steps >= 1.0 && (ratio - steps).abs() <= 1e-9 * steps {
        // Whole and below 2^53.
        Ok(steps as u64)
    } else {
        Err(format!(
            "from start {start} s to stop {stop} s are {ratio} steps of {step:?} s, which must be a whole number above 0"
        ))
    }
}

/// Largest `every` and `substeps` of a component.
const MAX_RATE: i64 = 1_000_000;

impl Scenario {
    pub(crate) fn check(&self, problems: &mut Collector) {
        self.check_times(problems);
        self.check_coupling(problems);
        let components = names("component", self.components.iter().map(|u| &u.name), problems);
        let cases = names("case", self.cases.iter().map(|c| &c.name), problems);
        names("point", self.points.iter().map(|p| &p.name), problems);
        let metrics = names("metric", self.metrics.iter().map(|m| &m.name), problems);
        names("figure", self.figures.iter().map(|f| &f.name), problems);
        if self.components.is_empty() {
            problems.add(0..0, "a scenario needs at least one [[component]]");
        }
        if self.cases.is_empty() {
            let help = "add [[case]] with `name` and `title`: a variant of the system, also if it is the only one";
            problems.add_with_help(0..0, "a scenario needs at least one [[case]]", Some(help.to_owned()));
        }
        for (name, span) in self.fmus() {
            if name.trim_matches('.').is_empty() || name.contains(['/', '\\']) || name.ends_with(".fmu") {
                problems.add(span, "give the file stem of the FMU, without folder and extension");
            }
        }
        for case in &self.cases {
            let known = |name, problems: &mut Collector| known("component", name, &components, problems);
            for name in case.without.iter().chain(case.fmu.keys()) {
                known(name, problems);
            }
            for name in case.parameters.keys().chain(case.inputs.keys()) {
                if known(name, problems) && case.leaves_out(name.get_ref()) {
                    problems.add(name.span(), format!("this case leaves the component `{}` out", name.get_ref()));
                }
            }
            if let Some(baseline) = &case.baseline {
                self::known("case", baseline, &cases, problems);
            }
            if self.components.iter().all(|u| case.leaves_out(u.name.get_ref())) && !self.components.is_empty() {
                problems.add(case.name.span(), "this case leaves all components out");
            }
        }
        for point in &self.points {
            finite(&point.value, problems);
            if let Some(second) = &point.second {
                finite(second, problems);
            }
            for name in point.parameters.keys() {
                known("component", name, &components, problems);
            }
        }
        self.check_points(problems);
        if let Some(seeds) = &self.seeds {
            let mut seen = BTreeSet::new();
            for seed in seeds.values.get_ref() {
                if !seen.insert(*seed.get_ref()) {
                    problems.add(seed.span(), "this seed appears twice");
                }
            }
            if seen.is_empty() {
                problems.add(seeds.values.span(), "expected at least one seed");
            }
        }
        let seeds = self.seeds.as_ref().map_or(1, |seeds| seeds.values.len().max(1));
        let runs = self.cases.len().saturating_mul(self.points.len().max(1)).saturating_mul(seeds);
        if runs > RUNS {
            let message = format!(
                "{} cases, {} points and {seeds} seeds are {runs} runs, the limit is {RUNS}",
                self.cases.len(),
                self.points.len().max(1)
            );
            let place = self.seeds.as_ref().map(|seeds| seeds.values.span());
            problems.add(place.or_else(|| self.points.first().map(|p| p.name.span())).unwrap_or(0..0), message);
        }
        if let Some(every) = &self.record.every
            && *every.get_ref() < 1
        {
            problems.add(every.span(), format!("every is {}, expected at least 1", every.get_ref()));
        }
        for metric in &self.metrics {
            self.check_metric(metric, &cases, problems);
        }
        for figure in &self.figures {
            self.check_figure(figure, &metrics, &cases, problems);
        }
    }

    fn check_metric(&self, metric: &Metric, cases: &BTreeSet<&str>, problems: &mut Collector) {
        self.check_window(metric.window.as_ref(), problems);
        metric.check_source(problems);
        if let Some(digits) = &metric.digits
            && *digits.get_ref() > 15
        {
            problems.add(digits.span(), "expected at most 15 decimal places");
        }
        let has_threshold = metric.kind.is_some_and(Kind::has_threshold);
        match &metric.threshold {
            Some(threshold) if !has_threshold => {
                problems.add(threshold.span(), "a metric of this kind has no `threshold`");
            }
            Some(threshold) => {
                finite(threshold, problems);
            }
            None if has_threshold => {
                problems.add(metric.name.span(), "a metric of this kind needs a `threshold`");
            }
            None => (),
        }
        if let Some(until) = &metric.until {
            match (until.above, until.below) {
                (Some(level), None) | (None, Some(level)) if level.is_finite() => (),
                (Some(_), None) | (None, Some(_)) => problems.add(until.span(), "expected a finite number"),
                _ => problems.add(until.span(), "expected either `above` or `below`"),
            }
        }
        if let Some(paper) = &metric.paper {
            for key in paper.values.keys() {
                self.check_paper_key(key, cases, problems);
            }
            let numbers = paper.values.keys().chain(paper.changes.keys());
            let numbers: BTreeSet<&str> = numbers.map(|key| key.as_str()).collect();
            for key in paper.calibrated.iter().flatten() {
                known("value of the paper", key, &numbers, problems);
            }
        }
        metric.check_requirement(cases, problems);
    }

    fn check_figure(
        &self,
        figure: &Figure,
        metrics: &BTreeSet<&str>,
        cases: &BTreeSet<&str>,
        problems: &mut Collector,
    ) {
        use FigureKind::{HeatMap, Running, Scatter, Spectrum, Sweep, Time, Transfer, Xy};
        self.check_window(figure.window.as_ref(), problems);
        for name in &figure.metrics {
            known("metric", name, metrics, problems);
        }
        if let Some(shown) = &figure.cases {
            for name in shown.get_ref() {
                known("case", name, cases, problems);
            }
            if shown.is_empty() {
                problems.add(shown.span(), "expected at least one case");
            }
        }
        let kind = figure.kind;
        let mut only = |name: &str, span: Option<Range<usize>>, kinds: &[FigureKind]| {
            if let Some(span) = span.filter(|_| !kinds.contains(&kind)) {
                let kinds: Vec<String> = kinds.iter().map(|kind| format!("\"{}\"", word(kind))).collect();
                problems.add(span, format!("only a figure of kind {} has `{name}`", kinds.join(" or ")));
            }
        };
        only("against", figure.against.as_ref().map(Spanned::span), &[Time]);
        only("separate", figure.separate.as_ref().map(Spanned::span), &[Time]);
        only("right", figure.right.as_ref().map(Spanned::span), &[Time]);
        only("levels", figure.levels.first().map(Spanned::span), &[Time]);
        only("same_scale", figure.same_scale.as_ref().map(Spanned::span), &[Time, Spectrum, Xy]);
        only("over", figure.over.as_ref().map(Spanned::span), &[Xy, Transfer, Scatter]);
        only("equal_axes", figure.equal_axes.as_ref().map(Spanned::span), &[Xy]);
        only("band", figure.band.as_ref().map(Spanned::span), &[Spectrum, Transfer]);
        only("unit", figure.unit.as_ref().map(Spanned::span), &[Time, Spectrum, Xy, Transfer]);
        for level in &figure.levels {
            if !level.value.is_finite() {
                problems.add(level.span(), "expected a finite number");
            }
        }
        if let Some(band) = &figure.band {
            check_band(band, problems);
        }
        let at = figure.name.span();
        let name = word(kind);
        if figure.over.is_none() && matches!(kind, Xy | Transfer | Scatter) {
            let what = if kind == Scatter { "metric" } else { "signal" };
            problems.add(at.clone(), format!("a figure of kind \"{name}\" needs `over`, the {what} on the abscissa"));
        }
        if let Some(over) = figure.over.as_ref().filter(|_| kind == Scatter) {
            known("metric", over, metrics, problems);
        }
        let (no_signals, no_metrics) = (figure.signals.is_empty(), figure.metrics.is_empty());
        if kind.is_of_signals() && (no_signals || !no_metrics) {
            problems.add(at, format!("a figure of kind \"{name}\" takes `signals`, not `metrics`"));
        } else if !kind.is_of_signals() && (no_metrics || !no_signals) {
            problems.add(at, format!("a figure of kind \"{name}\" takes `metrics`, not `signals`"));
        } else if matches!(kind, Sweep | HeatMap) && self.points.is_empty() {
            problems.add(at, format!("a figure of kind \"{name}\" needs a [sweep]"));
        } else if kind == HeatMap && self.sweep.as_ref().is_some_and(|sweep| sweep.second.is_none()) {
            problems.add(at, "a figure of kind \"heat_map\" needs a [sweep] with a `second` axis");
        } else if kind == Sweep && self.sweep.as_ref().is_some_and(|sweep| sweep.second.is_some()) {
            problems.add(at, "a [sweep] of two axes is shown by a figure of kind \"heat_map\"");
        } else if !kind.is_of_signals() && figure.window.is_some() {
            problems.add(at, "a figure of metrics has no `window`: each metric has its own");
        }
        for name in figure.metrics.iter().filter(|_| kind == Running) {
            let metric = self.metrics.iter().find(|m| m.name == *name);
            let grows = |metric: &Metric| {
                metric.kind.is_some_and(Kind::has_running_values) && metric.until.is_none() && !metric.from_baseline
            };
            if metric.is_some_and(|metric| !grows(metric)) {
                problems.add(
                    name.span(),
                    "only a mean, an RMS or an integral over a plain window can be drawn as it grows",
                );
            }
        }
    }

    fn check_times(&self, problems: &mut Collector) {
        let Simulation { stop, step, .. } = &self.simulation;
        let mut all_finite = finite(stop, problems) && finite(step, problems);
        if let Some(start) = &self.simulation.start {
            all_finite &= finite(start, problems);
        }
        if !all_finite {
            return;
        }
        let start = self.start();
        if *step.get_ref() <= 0.0 {
            problems.add(step.span(), format!("step is {}, expected more than 0", step.get_ref()));
        } else if *stop.get_ref() <= start {
            problems.add(stop.span(), format!("stop is {}, expected more than start {start}", stop.get_ref()));
        } else if let Err(message) = whole_steps(start, *stop.get_ref(), *step.get_ref()) {
            problems.add_at(&[stop.span(), step.span()], message, None);
        }
    }

    /// Checks rates of components, iteration and error control.
    fn check_coupling(&self, problems: &mut Collector) {
        for component in &self.components {
            for (key, rate) in [("every", &component.every), ("substeps", &component.substeps)] {
                if let Some(rate) = rate.as_ref().filter(|rate| !(1..=MAX_RATE).contains(rate.get_ref())) {
                    problems.add(rate.span(), format!("`{key}` must be from 1 to {MAX_RATE}, got {}", rate.get_ref()));
                }
            }
            if let (Some(substeps), true) = (&component.substeps, component.rates().iter().all(|rate| *rate > 1)) {
                let message = "a component has either `every` or `substeps` above 1";
                problems.add(substeps.span(), message);
            }
        }
        let Simulation { step, iterate, error_control, .. } = &self.simulation;
        let step = *step.get_ref();
        let mut check = |span: Range<usize>, key: &str, value: f64, least: f64, most: f64| {
            if !(least <= value && value <= most) {
                problems.add(span, format!("`{key}` must be from {least:?} to {most:?}, got {value:?}"));
            }
        };
        if let Some(key) = iterate {
            check(key.span(), "tolerance", key.tolerance, 1e-14, 1.0);
        }
        if let Some(key) = error_control {
            check(key.span(), "tolerance", key.tolerance, 1e-14, 1.0);
            for (name, size) in [("min_step", key.min_step), ("initial_step", key.initial_step)] {
                check(key.span(), name, size.unwrap_or(step), 1e-6 * step, step);
            }
        }
        if let Some(key) = iterate.as_ref().filter(|key| key.limit < 2) {
            problems.add(key.span(), format!("`limit` must be at least 2, got {}", key.limit));
        }
    }

    fn check_window(&self, window: Option<&Spanned<[f64; 2]>>, problems: &mut Collector) {
        let Some(window) = window else { return };
        let [from, to] = *window.get_ref();
        let (start, stop) = (self.start(), *self.simulation.stop.get_ref());
        // Written so that a NaN fails as well.
        if !(from < to && from >= start && to <= stop) {
            problems.add(window.span(), format!("expected a window [from, to] with {start} <= from < to <= {stop}"));
        }
    }

    fn check_paper_key(&self, key: &Spanned<String>, cases: &BTreeSet<&str>, problems: &mut Collector) {
        let (case, point) = match key.split_once('@') {
            Some((case, point)) => (case, Some(point)),
            None => (key.as_str(), None),
        };
        if !cases.contains(case) {
            unknown("case", case, key.span(), cases.iter().copied(), problems);
        }
        let points = || self.points.iter().map(|p| p.name.as_str());
        match point {
            Some(point) if !points().any(|p| p == point) => {
                unknown("point", point, key.span(), points(), problems);
            }
            None if !self.points.is_empty() => {
                problems.add(key.span(), "with a sweep the paper's values are named \"case@point\"")
            }
            _ => (),
        }
    }
}

impl Metric {
    fn check_source(&self, problems: &mut Collector) {
        let at = self.name.span();
        if let Some(value) = &self.value {
            let others = [
                ("signal", self.signal.as_ref().map(Spanned::span)),
                ("signals", self.signals.first().map(Spanned::span)),
                ("kind", self.kind.map(|_| value.span())),
                ("combine", self.combine.as_ref().map(Spanned::span)),
                ("weights", self.weights.as_ref().map(Spanned::span)),
                ("band", self.band.as_ref().map(Spanned::span)),
                ("threshold", self.threshold.as_ref().map(Spanned::span)),
                ("window", self.window.as_ref().map(Spanned::span)),
                ("until", self.until.as_ref().map(Spanned::span)),
                ("minus", self.minus.as_ref().map(Spanned::span)),
                ("from_baseline", self.from_baseline.then(|| value.span())),
            ];
            for (name, span) in others {
                if let Some(span) = span {
                    problems.add(
                        span,
                        format!(
                            "a metric with a `value` cannot have `{name}`: set `{name}` in the metrics that the \
                             `value` uses"
                        ),
                    );
                }
            }
            return;
        }
        if self.kind.is_none() {
            problems.add(at.clone(), "a metric needs a `kind` and a `signal`, or a `value` made of other metrics");
        }
        self.check_signals(problems);
    }

    fn check_requirement(&self, cases: &BTreeSet<&str>, problems: &mut Collector) {
        let mut are_finite = true;
        for limit in self.min.iter().chain(&self.max) {
            are_finite &= finite(limit, problems);
        }
        if let (Some(min), Some(max)) = (&self.min, &self.max)
            && are_finite
            && min.get_ref() > max.get_ref()
        {
            problems.add(min.span(), format!("min is {}, above max, {}", min.get_ref(), max.get_ref()));
        }
        if let Some(share) = self.share.as_ref().filter(|share| !(0.0 < *share.get_ref() && *share.get_ref() <= 1.0)) {
            problems.add(share.span(), format!("share is {}, expected above 0, up to 1", share.get_ref()));
        }
        for name in self.required_of.iter().flat_map(|names| names.get_ref()) {
            known("case", name, cases, problems);
        }
        if let Some(names) = &self.required_of
            && names.is_empty()
        {
            problems.add(names.span(), "expected at least one case");
        }
        if self.min.is_none() && self.max.is_none() {
            let of = self.required_of.as_ref().map(|names| ("required_of", names.span()));
            let by = self.required_by.as_ref().map(|text| ("required_by", text.span()));
            let share = self.share.as_ref().map(|share| ("share", share.span()));
            for (name, span) in of.into_iter().chain(by).chain(share) {
                problems.add(span, format!("`{name}` belongs to a `min` or a `max`"));
            }
        }
    }

    fn check_signals(&self, problems: &mut Collector) {
        let at = self.name.span();
        match (&self.signal, self.signals.len(), &self.combine) {
            (Some(_), 0, None) => (),
            (Some(_), 0, Some(combine)) => problems.add(combine.span(), "`combine` needs several `signals`"),
            (Some(_), _, _) => problems.add(at.clone(), "a metric has either a `signal` or `signals`"),
            (None, 0, _) => problems.add(at.clone(), "a metric needs a `signal` or `signals`"),
            (None, _, None) => {
                problems.add(at.clone(), "several `signals` need a `combine`: min, max, norm or squares")
            }
            (None, _, Some(_)) => (),
        }
        let is_squares = self.combine.as_ref().is_some_and(|combine| *combine.get_ref() == Combine::Squares);
        match &self.weights {
            Some(weights) if !is_squares => problems.add(weights.span(), "only `combine = \"squares\"` has `weights`"),
            Some(weights) if weights.len() != self.signals.len() => {
                problems.add(weights.span(), format!("expected {} weights, one per signal", self.signals.len()));
            }
            Some(weights) if weights.iter().any(|w| !w.is_finite()) => {
                problems.add(weights.span(), "expected finite numbers");
            }
            None if is_squares => problems.add(at.clone(), "`combine = \"squares\"` needs `weights`"),
            _ => (),
        }
        if let (true, Some(unit)) = (is_squares, &self.unit) {
            problems.add(
                unit.span(),
                "a weighted sum of squares has no `unit`: the weights belong to the units of the signals",
            );
        }
        match &self.band {
            Some(band) if self.kind != Some(Kind::BandPower) => {
                problems.add(band.span(), "only a metric of kind \"band_power\" has a `band`");
            }
            Some(band) => check_band(band, problems),
            None if self.kind == Some(Kind::BandPower) => {
                problems.add(at, "a metric of kind \"band_power\" needs a `band`");
            }
            None => (),
        }
    }
}

fn check_band(band: &Spanned<[f64; 2]>, problems: &mut Collector) {
    let [from, to] = *band.get_ref();
    // Written so that a NaN fails as well.
    if !(from >= 0.0 && from < to && to.is_finite()) {
        problems.add(band.span(), "expected a band [from, to] with 0 <= from < to, Hz");
    }
}

/// Checks names: lower_snake, each once.
fn names<'a>(
    what: &str,
    all: impl Iterator<Item = &'a Spanned<String>>,
    problems: &mut Collector,
) -> BTreeSet<&'a str> {
    let mut seen = BTreeSet::new();
    for name in all {
        let text = name.as_str();
        let plain = text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        if !plain || !text.starts_with(|c: char| c.is_ascii_lowercase()) {
            problems.add(
                name.span(),
                format!("the name of a {what} must consist of a-z, 0-9 and _ and start with a letter"),
            );
        }
        if !seen.insert(text) {
            problems.add(name.span(), format!("the {what} `{text}` appears twice"));
        }
    }
    seen
}

fn known(what: &str, name: &Spanned<String>, all: &BTreeSet<&str>, problems: &mut Collector) -> bool {
    let found = all.contains(name.as_str());
    if !found {
        unknown(what, name.get_ref(), name.span(), all.iter().copied(), problems);
    }
    found
}

pub(crate) fn unknown<'a>(
    what: &str,
    name: &str,
    span: Range<usize>,
    all: impl IntoIterator<Item = &'a str>,
    problems: &mut Collector,
) {
    problems.add_with_help(span, format!("unknown {what} `{name}`"), suggestion(name, all));
}

fn finite(value: &Spanned<f64>, problems: &mut Collector) -> bool {
    let fine = value.is_finite();
    if !fine {
        problems.add(value.span(), "expected a finite number");
    }
    fine
}
