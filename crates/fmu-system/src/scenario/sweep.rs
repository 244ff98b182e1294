//! Sweeps: generates points from the values of one or two parameters, and checks points.

use super::layout::{Given, Point, Scenario, Sweep, Values, ValuesByComponent};
use crate::problem::Collector;
use crate::spanned::Spanned;

/// Returns the axis of a sweep with these keys; `None` if points are written one by one.
fn generated<'a>(
    title: &'a str,
    unit: &'a str,
    parameter: &'a Option<Spanned<String>>,
    values: &'a Option<Spanned<Vec<f64>>>,
    problems: &mut Collector,
) -> Option<Generated<'a>> {
    match (parameter, values) {
        (None, None) => None,
        (Some(parameter), None) => {
            problems.add(parameter.span(), "a sweep of a `parameter` needs its `values`");
            None
        }
        (None, Some(values)) => {
            problems.add(values.span(), "the `values` of a sweep need the `parameter` that takes them");
            None
        }
        (Some(parameter), Some(values)) => {
            let Some((component, name)) = parameter.split_once(':') else {
                let text = format!("`{}`, expected \"component:parameter\"", parameter.get_ref());
                problems.add(parameter.span(), text);
                return None;
            };
            if values.is_empty() {
                problems.add(values.span(), "expected at least one value");
            }
            Some(Generated { title, unit, component, name, parameter, values })
        }
    }
}

/// An axis whose values are listed.
struct Generated<'a> {
    title: &'a str,
    unit: &'a str,
    component: &'a str,
    name: &'a str,
    parameter: &'a Spanned<String>,
    values: &'a Spanned<Vec<f64>>,
}

impl Generated<'_> {
    /// Part of the name of a point, such as `speed_12p5`.
    fn name_of(&self, value: f64) -> String {
        let letters = self.title.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' });
        let title: String = letters.collect();
        let title = title.trim_start_matches(|c: char| !c.is_ascii_lowercase()).trim_end_matches('_');
        let title = if title.is_empty() { "value" } else { title };
        format!("{title}_{}", value.to_string().replace('.', "p").replace('-', "m"))
    }

    fn title_of(&self, value: f64) -> String {
        if self.unit == "1" { format!("{} {value}", self.title) } else { format!("{value} {}", self.unit) }
    }

    fn set(&self, value: f64, parameters: &mut ValuesByComponent) {
        let spanned = |text: &str| Spanned::new(self.parameter.span(), text.to_owned());
        let written = if self.unit == "1" {
            value.into()
        } else {
            toml::Table::from_iter([("value".to_owned(), value.into()), ("unit".to_owned(), self.unit.into())]).into()
        };
        let values: &mut Values = parameters.entry(spanned(self.component)).or_default();
        values.insert(spanned(self.name), Spanned::new(self.values.span(), Given(written)));
    }
}

/// Generates the points of a sweep whose values are listed: for two parameters, all pairs.
pub(super) fn points(sweep: Option<&Spanned<Sweep>>, written: &[Point], problems: &mut Collector) -> Vec<Point> {
    let Some(sweep) = sweep.map(Spanned::get_ref) else { return Vec::new() };
    let first = generated(&sweep.title, &sweep.unit, &sweep.parameter, &sweep.values, problems);
    let second = sweep.second.as_ref();
    let other = second.and_then(|axis| generated(&axis.title, &axis.unit, &axis.parameter, &axis.values, problems));
    let Some(first) = first else {
        if let Some(other) = other {
            problems.add(other.values.span(), "the first axis of the sweep needs a `parameter` and `values`, too");
        }
        return Vec::new();
    };
    if let Some(point) = written.first() {
        problems.add(point.name.span(), "the sweep has `values`, which generate its points: remove this [[point]]");
        return Vec::new();
    }
    let at = first.values.span();
    let point = |value: f64, beside: Option<(&Generated<'_>, f64)>| {
        let mut parameters = ValuesByComponent::new();
        first.set(value, &mut parameters);
        let (mut name, mut title) = (first.name_of(value), first.title_of(value));
        if let Some((other, value)) = beside {
            other.set(value, &mut parameters);
            name = format!("{name}_{}", other.name_of(value));
            title = format!("{title}, {}", other.title_of(value));
        }
        Point {
            name: Spanned::new(at.clone(), name),
            title,
            value: Spanned::new(at.clone(), value),
            second: beside.map(|(other, value)| Spanned::new(other.values.span(), value)),
            parameters,
        }
    };
    match (second, other) {
        (None, _) => first.values.iter().map(|value| point(*value, None)).collect(),
        (Some(_), Some(other)) => {
            let pairs = first.values.iter();
            let pairs = pairs.flat_map(|value| other.values.iter().map(move |second| (*value, *second)));
            pairs.map(|(value, second)| point(value, Some((&other, second)))).collect()
        }
        (Some(second), None) => {
            problems.add(second.span(), "the second axis of the sweep needs a `parameter` and `values`, too");
            Vec::new()
        }
    }
}

impl Scenario {
    /// Checks that the points have a place on each axis of the sweep.
    pub(super) fn check_points(&self, problems: &mut Collector) {
        match (&self.sweep, self.points.first()) {
            (Some(sweep), None) if problems.is_empty() => {
                problems.add(sweep.span(), "a [sweep] needs `parameter` and `values`, or at least one [[point]]");
            }
            (None, Some(point)) => {
                problems.add(point.name.span(), "points need a [sweep] with the title and the unit of their values")
            }
            _ => (),
        }
        let has_second = self.sweep.as_ref().is_some_and(|sweep| sweep.second.is_some());
        for (i, point) in self.points.iter().enumerate() {
            match &point.second {
                None if has_second => {
                    problems.add(point.name.span(), "the sweep has a `second` axis: the point needs a `second` value");
                }
                Some(second) if !has_second => {
                    problems.add(second.span(), "a `second` value needs `second` in the [sweep], with title and unit");
                }
                Some(second) => {
                    let place = |other: &Point| (*other.value.get_ref(), other.second.as_ref().map(|s| *s.get_ref()));
                    if self.points[..i].iter().any(|other| place(other) == place(point)) {
                        problems.add(second.span(), "two points have the same values on the axes of the sweep");
                    }
                }
                None => (),
            }
        }
    }
}
