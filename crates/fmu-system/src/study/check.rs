//! Checks that need no scenario.

use super::{Analysis, Correlation, Design, Distribution, Factor, Level, Method, Names, Scale, Search, Study};
use crate::problem::Collector;
use crate::report::word;
use crate::spanned::Spanned;
use fmu_import::names::{any_of, suggestion};
use std::fmt::Display;

/// Columns of the tables that are not factors.
const TAKEN: [&str; 10] =
    ["sample", "case", "point", "seed", "status", "time", "component", "variable", "message", "seconds"];
/// Samples of a study without `runs`.
const SAMPLES: i64 = 100;
/// The share of a distribution between its limits must be larger than this.
const SMALLEST_PART: f64 = 1e-9;

impl Method {
    fn designs(self) -> &'static [Design] {
        match self {
            Self::Sweep => &[Design::FullFactorial, Design::List, Design::OneAtATime],
            Self::Sample => &[Design::LatinHypercube, Design::Random, Design::Sobol],
            Self::Sensitivity | Self::WorstCase | Self::Optimize => &[],
        }
    }
}

impl Distribution {
    fn keys(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Uniform | Self::LogUniform => (&["min", "max"], &[]),
            Self::Normal => (&["mean", "deviation"], &["min", "max"]),
            Self::Lognormal => (&["median", "deviation"], &["min", "max"]),
            Self::Triangular => (&["min", "mode", "max"], &[]),
            Self::Grid => (&["min", "max", "count"], &["scale"]),
            Self::Seed => (&[], &[]),
        }
    }
}

fn value<T: Copy>(written: &Option<Spanned<T>>) -> Option<T> {
    written.as_ref().map(|value| *value.get_ref())
}

struct Checks<'a>(&'a mut Collector);

impl Checks<'_> {
    /// Reports a key that must be absent.
    fn absent<T>(&mut self, written: &Option<Spanned<T>>, message: impl Into<String>) {
        if let Some(written) = written {
            self.0.add(written.span(), message);
        }
    }

    /// Reports a number that breaks a rule.
    fn rule<T: Copy + Display>(
        &mut self,
        name: &str,
        number: &Option<Spanned<T>>,
        is_kept: impl Fn(T) -> bool,
        rule: impl Display,
    ) {
        if let Some(number) = number.as_ref().filter(|number| !is_kept(*number.get_ref())) {
            self.0.add(number.span(), format!("{name} is {}, expected {rule}", number.get_ref()));
        }
    }

    fn at_least(&mut self, name: &str, number: &Option<Spanned<i64>>, least: i64) {
        self.rule(name, number, |number| number >= least, format!("at least {least}"));
    }

    fn finite(&mut self, name: &str, number: &Option<Spanned<f64>>) {
        self.rule(name, number, f64::is_finite, "a finite number");
    }
}

impl Study {
    pub(super) fn check(&self, problems: &mut Collector) {
        let checks = &mut Checks(problems);
        let factors = self.vary.get_ref();
        if factors.is_empty() {
            checks.0.add(self.vary.span(), "nothing varies: expected at least one [[vary]]");
        }
        for (index, factor) in factors.iter().enumerate() {
            factor.check(checks);
            let name = factor.name.as_str();
            if factors[..index].iter().any(|other| other.name == factor.name) {
                checks.0.add(factor.name.span(), format!("two factors are named `{name}`"));
            }
            if TAKEN.contains(&name) || name.is_empty() {
                let message = format!("the tables have a column `{name}` already; choose another name");
                checks.0.add(factor.name.span(), message);
            }
        }
        for (key, names) in [("cases", &self.cases), ("points", &self.points)] {
            let empty = names.as_ref().filter(|names| names.is_empty()).cloned();
            checks.absent(&empty, format!("{key} is empty; without the key all {key} are run"));
        }
        checks.finite("stop", &self.stop);
        checks.at_least("runs", &self.runs, 1);
        // SALib and the samplers of Optuna accept only 32-bit seeds.
        let most = if *self.method.get_ref() == Method::Sample { i64::MAX } else { i64::from(u32::MAX) };
        checks.rule("seed", &self.seed, |seed| (0..=most).contains(&seed), format!("0 to {most}"));
        self.check_method(checks);
        self.check_correlations(checks);
        for requirement in &self.requirement {
            checks.finite("min", &requirement.min);
            checks.finite("max", &requirement.max);
            checks.rule("share", &requirement.share, |share| share > 0.0 && share <= 1.0, "above 0, up to 1");
            if requirement.min.is_none() && requirement.max.is_none() {
                checks.0.add(requirement.metric.span(), "a requirement needs `min`, `max` or both");
            }
        }
        if let Some(series) = &self.series {
            checks.at_least("worst", &series.worst, 0);
            checks.at_least("random", &series.random, 0);
        }
    }

    fn check_method(&self, checks: &mut Checks<'_>) {
        let method = *self.method.get_ref();
        let name = word(method);
        let known: Vec<String> = method.designs().iter().map(word).collect();
        let known = any_of(&if known.is_empty() { vec!["none"] } else { known.iter().map(String::as_str).collect() });
        let other = self.design.clone().filter(|design| !method.designs().contains(design.get_ref()));
        checks.absent(&other, format!("expected {known} for method {name}"));
        let (searches, is_sensitivity) =
            (matches!(method, Method::WorstCase | Method::Optimize), method == Method::Sensitivity);
        if !is_sensitivity {
            checks.absent(&self.analysis, format!("method {name} has no `analysis`; only sensitivity has one"));
        } else if self.analysis.is_none() {
            checks.0.add(self.method.span(), "method sensitivity needs analysis = \"morris\" or \"sobol\"");
        }
        match &self.search {
            search if !searches => {
                checks.absent(search, format!("method {name} has no [search]; only worst_case and optimize have one"));
            }
            Some(search) => search.check(checks),
            None => checks.0.add(self.method.span(), format!("method {name} needs a table [search]")),
        }
        if method == Method::Sweep {
            checks.absent(&self.runs, "the values of a sweep determine the number of samples: remove `runs`");
            let mut sizes = self.vary.iter().map(Factor::size);
            let first = sizes.next();
            if value(&self.design) == Some(Design::List) && sizes.any(|size| Some(size) != first) {
                checks.absent(&self.design, "design list needs the same number of values for every factor");
            }
        }
        for factor in self.vary.get_ref() {
            let distribution = value(&factor.distribution);
            if method == Method::Sweep && distribution.is_some_and(|d| d != Distribution::Grid) {
                checks.absent(&factor.distribution, "a sweep needs values or distribution grid");
            }
            if is_sensitivity && (factor.fmu.is_some() || distribution == Some(Distribution::Seed)) {
                checks.0.add(factor.name.span(), "sensitivities need a factor with a distribution, not FMUs or seeds");
            }
        }
        let runs = value(&self.runs).unwrap_or(SAMPLES);
        if is_sensitivity && value(&self.analysis) == Some(Analysis::Sobol) && runs > 0 && runs.count_ones() > 1 {
            let below = 1_i64 << runs.ilog2();
            let given = if self.runs.is_some() { format!("runs is {runs}") } else { "runs is missing".to_owned() };
            let rule = format!("a power of two for Sobol indices, such as {below} or {}", below.saturating_mul(2));
            let place = self.runs.as_ref().map_or(self.method.span(), Spanned::span);
            checks.0.add(place, format!("{given}, expected {rule}"));
        }
    }

    fn check_correlations(&self, checks: &mut Checks<'_>) {
        let Some(first) = self.correlation.first() else { return };
        if *self.method.get_ref() != Method::Sample {
            checks.0.add(first.between.span(), "correlations belong to method sample");
        }
        let count = self.vary.len();
        let mut matrix = vec![vec![0.0; count]; count];
        (0..count).for_each(|i| matrix[i][i] = 1.0);
        let mut are_valid = true;
        for correlation in &self.correlation {
            let Some([i, j]) = self.pair(correlation, checks) else {
                are_valid = false;
                continue;
            };
            matrix[i][j] = *correlation.coefficient.get_ref();
            matrix[j][i] = matrix[i][j];
        }
        if are_valid && !is_positive_definite(matrix) {
            let message = "the correlations contradict each other: their matrix is not positive definite";
            checks.0.add(first.between.span(), message);
        }
    }

    /// Indices of the factors of a correlation; `None` if it is not valid.
    fn pair(&self, correlation: &Correlation, checks: &mut Checks<'_>) -> Option<[usize; 2]> {
        let factors = self.vary.get_ref();
        let between = &correlation.between;
        let mut found = Vec::new();
        for name in between.get_ref() {
            let names = factors.iter().map(|factor| factor.name.as_str());
            let Some(index) = factors.iter().position(|factor| factor.name == *name) else {
                let message = format!("no factor is named `{}`", name.get_ref());
                checks.0.add_with_help(name.span(), message, suggestion(name.get_ref(), names));
                continue;
            };
            let factor = &factors[index];
            let is_normal = value(&factor.distribution) == Some(Distribution::Normal);
            if is_normal && factor.min.is_none() && factor.max.is_none() {
                found.push(index);
            } else {
                checks.0.add(name.span(), format!("`{}` is not normal without limits", name.get_ref()));
            }
        }
        let coefficient = *correlation.coefficient.get_ref();
        let is_valid = coefficient > -1.0 && coefficient < 1.0;
        if !is_valid {
            let message = format!("coefficient is {coefficient}, expected between -1 and 1");
            checks.0.add(correlation.coefficient.span(), message);
        }
        match (between.len(), found.as_slice()) {
            (2, [i, j]) if i != j => is_valid.then_some([*i, *j]),
            (2, [_] | []) => None,
            _ => {
                checks.0.add(between.span(), "expected the names of two factors");
                None
            }
        }
    }
}

impl Search {
    fn check(&self, checks: &mut Checks<'_>) {
        checks.at_least("batch", &self.batch, 1);
        let is_valid = |value: &toml::Value| match value {
            toml::Value::Float(number) => number.is_finite(),
            value => !value.is_datetime(),
        };
        for (name, _) in self.options.iter().filter(|(_, value)| !is_valid(value)) {
            let message = format!("`{name}` must be a finite number, a string, true, false, a list or a table");
            checks.0.add(self.options.span(), message);
        }
    }
}

impl Factor {
    /// Returns true if the communication step varies.
    pub(super) fn is_step(&self) -> bool {
        matches!(self.variable.as_ref().map(Spanned::get_ref), Some(Names::One(name)) if name == "simulation:step")
    }

    fn size(&self) -> Option<usize> {
        let values = self.values.as_ref().map(|values| values.len());
        values.or_else(|| usize::try_from(value(&self.count)?).ok())
    }

    fn check(&self, checks: &mut Checks<'_>) {
        let at = self.name.span();
        let is_empty =
            matches!(self.variable.as_ref().map(Spanned::get_ref), Some(Names::Several(all)) if all.is_empty());
        if self.variable.is_some() == self.fmu.is_some() || is_empty {
            checks.0.add(at.clone(), "expected either variable = \"component:variable\" or fmu = \"component\"");
        }
        if self.distribution.is_some() == self.values.is_some() {
            checks.0.add(at, "expected either values or a distribution");
            return;
        }
        match &self.values {
            Some(values) => self.check_values(values, checks),
            None => checks.absent(&self.weights, "weights belong to a list of values"),
        }
        let distribution = value(&self.distribution);
        let is_seed = distribution == Some(Distribution::Seed);
        if self.fmu.is_some() {
            checks.absent(&self.distribution, "expected values with the names of FMUs");
        }
        for (is_wrong, message) in [
            (
                self.fmu.is_some() && (self.unit.is_some() || self.relative),
                "`unit` and `relative` do not apply to an FMU: remove them",
            ),
            (self.fmu.is_none() && self.keep_parameters, "`keep_parameters` belongs to `fmu`"),
            (
                self.is_step() && (self.unit.is_some() || self.relative || self.distribution.is_some()),
                "the communication step needs `values` in s, without `unit` and `relative`",
            ),
            (
                is_seed && (self.unit.is_some() || self.relative),
                "`unit` and `relative` do not apply to a seed: remove them",
            ),
            (
                self.relative && self.unit.is_some(),
                "relative values are multiples of the scenario's own, without a unit",
            ),
        ] {
            if is_wrong {
                checks.0.add(at.clone(), message);
            }
        }
        self.check_numbers(distribution, checks);
    }

    fn check_values(&self, values: &Spanned<Vec<Spanned<Level>>>, checks: &mut Checks<'_>) {
        let levels = values.get_ref();
        if levels.is_empty() {
            checks.0.add(values.span(), "values is empty");
        }
        let kind = |level: &Spanned<Level>| match level.get_ref() {
            Level::Text(_) => 0,
            Level::Boolean(_) => 1,
            Level::Integer(_) | Level::Number(_) => 2,
        };
        for (index, level) in levels.iter().enumerate() {
            let is_same = |other: &Spanned<Level>| match (other.get_ref(), level.get_ref()) {
                (Level::Integer(a), Level::Number(b)) | (Level::Number(b), Level::Integer(a)) => *a as f64 == *b,
                (a, b) => a == b,
            };
            for (is_wrong, message) in [
                (levels[..index].iter().any(is_same), "this value appears twice; weights make a value more frequent"),
                (kind(level) != kind(&levels[0]), "values must be all numbers, all strings, or true and false"),
                (matches!(level.get_ref(), Level::Number(n) if !n.is_finite()), "expected a finite number"),
                (self.fmu.is_some() && kind(level) != 0, "expected values with the names of FMUs"),
                (
                    self.is_step() && level.get_ref().number().is_none_or(|step| step <= 0.0),
                    "a communication step must be a number above 0 s",
                ),
            ] {
                if is_wrong {
                    checks.0.add(level.span(), message);
                }
            }
        }
        let is_valid = |all: &[f64]| {
            all.len() == levels.len() && all.iter().all(|w| w.is_finite() && *w >= 0.0) && all.iter().any(|w| *w > 0.0)
        };
        let wrong = self.weights.clone().filter(|weights| !is_valid(weights.get_ref()));
        checks.absent(&wrong, format!("expected {} weights of at least 0, one of them above 0", levels.len()));
    }

    /// Checks that a distribution has the keys that it needs, and no other keys.
    fn check_numbers(&self, distribution: Option<Distribution>, checks: &mut Checks<'_>) {
        let what = distribution.map_or("a list of values".to_owned(), |d| format!("distribution {}", word(d)));
        let (needed, allowed) = distribution.map_or((&[] as &[_], &[] as &[_]), Distribution::keys);
        let mut key = |name: &'static str, span: Option<std::ops::Range<usize>>| match span {
            None if needed.contains(&name) => {
                checks.absent(&self.distribution, format!("{what} needs the key `{name}`"));
            }
            Some(span) if !needed.contains(&name) && !allowed.contains(&name) => {
                checks.0.add(span, format!("{what} has no key `{name}`"));
            }
            _ => (),
        };
        let numbers = [
            ("min", &self.min),
            ("max", &self.max),
            ("mean", &self.mean),
            ("deviation", &self.deviation),
            ("median", &self.median),
            ("mode", &self.mode),
        ];
        numbers.iter().for_each(|(name, number)| key(name, number.as_ref().map(Spanned::span)));
        key("count", self.count.as_ref().map(Spanned::span));
        key("scale", self.scale.as_ref().map(Spanned::span));
        numbers.iter().for_each(|(name, number)| checks.finite(name, number));

        checks.rule("deviation", &self.deviation, |number| number > 0.0, "more than 0");
        checks.rule("median", &self.median, |number| number > 0.0, "more than 0");
        checks.at_least("count", &self.count, 2);
        let (low, high) = (value(&self.min), value(&self.max));
        if let (Some(low), Some(high)) = (low, high) {
            checks.rule("max", &self.max, |max| max > low, format!("more than min, {low}"));
            checks.rule("mode", &self.mode, |mode| (low..=high).contains(&mode), format!("{low} to {high}"));
        }
        if distribution == Some(Distribution::LogUniform) || value(&self.scale) == Some(Scale::Log) {
            checks.rule("min", &self.min, |min| min > 0.0, "more than 0 for a logarithmic scale");
        }
        if distribution == Some(Distribution::Lognormal) {
            checks.rule("min", &self.min, |min| min >= 0.0, "at least 0: a lognormal value is not negative");
        }
        if self.part().is_some_and(|part| part <= SMALLEST_PART) {
            checks.absent(&self.distribution, "min and max leave next to nothing of the distribution");
        }
    }

    /// Part of a normal or lognormal distribution between its limits; `None` for other distributions, and if keys are
    /// missing.
    fn part(&self) -> Option<f64> {
        let deviation = value(&self.deviation).filter(|deviation| *deviation > 0.0)?;
        let below = |limit: f64| match value(&self.distribution)? {
            Distribution::Normal => Some((limit - value(&self.mean)?) / deviation),
            // The logarithm of 0 is minus infinity, which is right here.
            Distribution::Lognormal => Some(libm::log(limit.max(0.0) / value(&self.median)?) / deviation),
            _ => None,
        };
        let share = |limit: f64| Some(0.5 * libm::erfc(-below(limit)? * std::f64::consts::FRAC_1_SQRT_2));
        let low = value(&self.min).map_or(Some(0.0), share)?;
        let high = value(&self.max).map_or(Some(1.0), share)?;
        Some(high - low)
    }
}

/// Returns true if all pivots of a symmetric matrix are positive.
fn is_positive_definite(mut matrix: Vec<Vec<f64>>) -> bool {
    for pivot in 0..matrix.len() {
        let row = matrix[pivot].clone();
        if row[pivot] <= 0.0 {
            return false;
        }
        for other in &mut matrix[pivot + 1..] {
            let factor = other[pivot] / row[pivot];
            other.iter_mut().zip(&row).for_each(|(value, above)| *value -= factor * above);
        }
    }
    true
}
