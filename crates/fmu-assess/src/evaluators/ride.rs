//! Ride comfort: weighted vibrations, suspension travel and dynamic tire loads.

use super::weighting::Weighting;
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, largest, mean, smallest, standard_deviation};
use crate::options::{Fallback, Form, OptionRule, Options};

/// A direction of vibration: prefix of its metrics, column, weighting, factor.
const VIBRATIONS: [(&str, &str, Weighting, f64); 3] = [
    ("heave", "body.heave_acceleration", Weighting::Vertical, 1.0),
    ("roll", "body.roll_acceleration", Weighting::Angular, 0.63),
    ("pitch", "body.pitch_acceleration", Weighting::Angular, 0.4),
];

/// Comfort classes of ISO 2631-1, each with the total vibration below which it applies, m/s2. The ranges in the
/// standard overlap; each value is the lower end of the next class.
const COMFORT: [(f64, &str); 5] = [
    (0.315, "not uncomfortable"),
    (0.5, "a little uncomfortable"),
    (0.8, "fairly uncomfortable"),
    (1.25, "uncomfortable"),
    (2.0, "very uncomfortable"),
];

/// Comfort class of ISO 2631-1 for a total vibration, m/s2.
pub(crate) fn comfort(total: f64) -> &'static str {
    COMFORT.iter().find(|(limit, _)| total < *limit).map_or("extremely uncomfortable", |(_, words)| words)
}

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "ride",
    title: "Ride comfort",
    source: "ISO 2631-1, at the center of mass and without a seat",
    columns: &[
        Column::optional("body.heave_acceleration", "m/s2"),
        Column::optional("body.roll_acceleration", "rad/s2"),
        Column::optional("body.pitch_acceleration", "rad/s2"),
        Column::optional("suspension_deflection.*", "m"),
        Column::optional("tire_load.*", "N"),
    ],
    options: &[OptionRule::new("begin", "s", Form::NotNegative, Fallback::Number(2.0))
        .is("time at which the evaluation begins")],
    metrics: &[
        Definition::neutral("heave_rms", "Heave acceleration", "m/s2")
            .is("Standard deviation of the heave acceleration."),
        Definition::lower("heave_weighted", "Heave acceleration, weighted", "m/s2")
            .is("Root mean square of the heave acceleration without its mean, weighted by W_k in the frequency \
                 domain."),
        Definition::neutral("roll_rms", "Roll acceleration", "rad/s2")
            .is("Standard deviation of the roll acceleration."),
        Definition::lower("roll_weighted", "Roll acceleration, weighted", "m/s2")
            .is("As `heave_weighted`, but weighted by W_e and multiplied by 0.63 m/rad."),
        Definition::neutral("pitch_rms", "Pitch acceleration", "rad/s2")
            .is("Standard deviation of the pitch acceleration."),
        Definition::lower("pitch_weighted", "Pitch acceleration, weighted", "m/s2")
            .is("As `heave_weighted`, but weighted by W_e and multiplied by 0.4 m/rad."),
        Definition::lower("vibration_total", "Vibration total", "m/s2")
            .is("Root of the sum of squares of the three weighted values. Comfort class of \
             ISO 2631-1: not uncomfortable below 0.315 m/s2, a little uncomfortable below 0.5, fairly uncomfortable below 0.8, uncomfortable below \
             1.25, very uncomfortable below 2, otherwise extremely uncomfortable."),
        Definition::neutral("suspension_travel_rms", "Suspension travel", "m").each("suspension_deflection")
            .is("Standard deviation of the deflection of each strut."),
        Definition::neutral("suspension_travel_range", "Range of the suspension travel", "m")
            .each("suspension_deflection")
            .is("Largest minus smallest deflection of each strut."),
        Definition::lower("dynamic_load_coefficient", "Dynamic load coefficient", "1").each("tire_load")
            .is("Standard deviation of the load of each tire, divided by its mean."),
        Definition::neutral("load_minimum_share", "Smallest load", "1").each("tire_load")
            .is("Smallest load of each tire, divided by its mean."),
        Definition::neutral("lift_share", "Time without load", "1").each("tire_load")
            .is("Share of the rows in which a tire has no load."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let begin = options.number("begin");
    let first = rows.first_from(begin);
    let late = || format!("the recording ends before {begin} s, where the evaluation begins");
    let column = |name: &str| rows.column(name).map(|values| &values[first..]);
    let mut total = Ok(0.0);
    for (name, signal, weighting, factor) in VIBRATIONS {
        let rms = |weighting: Weighting| weighting.rms(column(signal)?, rows.rate).ok_or_else(late);
        let weighted = rms(weighting).map(|rms| factor * rms);
        results.set(&format!("{name}_rms"), rms(Weighting::None));
        results.set(&format!("{name}_weighted"), weighted.clone());
        total = total.and_then(|total| weighted.map(|weighted| total + weighted * weighted));
    }
    results.set("vibration_total", total.map(f64::sqrt));
    for (name, of) in [
        ("suspension_travel_rms", standard_deviation as fn(&[f64]) -> Option<f64>),
        ("suspension_travel_range", |travel| Some(largest(travel)? - smallest(travel)?)),
    ] {
        each(rows, "suspension_deflection", results, name, |name| of(column(name)?).ok_or_else(late));
    }
    for (name, of) in [
        (
            "dynamic_load_coefficient",
            (|load| Some(standard_deviation(load)? / mean(load)?)) as fn(&[f64]) -> Option<f64>,
        ),
        ("load_minimum_share", |load| Some(smallest(load)? / mean(load)?)),
        ("lift_share", |load| {
            let lifted = load.iter().filter(|load| **load <= 0.0).count();
            (!load.is_empty()).then(|| lifted as f64 / load.len() as f64)
        }),
    ] {
        each(rows, "tire_load", results, name, |name| of(column(name)?).ok_or_else(late));
    }
    Ok(())
}

/// Sets a metric for each column of a group.
fn each(
    rows: &Rows<'_>,
    group: &str,
    results: &mut Results,
    metric: &str,
    value: impl Fn(&str) -> Result<f64, Reason>,
) {
    let places = rows.places(group);
    for (place, name) in &places {
        results.set_at(metric, place, value(name));
    }
    if places.is_empty() {
        results.set(metric, Err::<f64, _>(format!("the recording has no column `{group}.*`")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the lower ends of the ranges in ISO 2631-1, C.2.3.
    #[test]
    fn totals_have_the_words_of_the_standard() {
        for (total, words) in [
            (0.0, "not uncomfortable"),
            (0.3149, "not uncomfortable"),
            (0.315, "a little uncomfortable"),
            (0.5, "fairly uncomfortable"),
            (0.8, "uncomfortable"),
            (1.25, "very uncomfortable"),
            (2.0, "extremely uncomfortable"),
        ] {
            assert_eq!(comfort(total), words, "{total}");
        }
    }
}
