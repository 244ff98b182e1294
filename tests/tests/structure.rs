//! Compares the model structure and the directional derivatives of every plant with the actual changes in its outputs
//! and derivatives when an input or a state changes, and tests the order of the integrator.
//!
//! Reference: FMI 2.0.4, sections 2.1.9 (directional derivatives) and 2.2.8 (model structure), and difference quotients
//! through fmi2SetReal and fmi2GetReal.

use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, Initial, Unknown, Variable};
use fmu_import::loader::Instance;
use std::collections::{BTreeMap, BTreeSet};
use tests::signals::{Excitation, Random, is_magnitude, scale, start};
use tests::state_bytes::Place;
use tests::{Configuration, Fmu, all, ok, plants, reals};

/// Declared dependencies that are invisible if only one value changes: FMU, unknown, known, reason. A `*` at the end
/// stands for any text.
const UNSEEN: &[(&str, &str, &str, &str)] = &[];

/// A plant with its known variables (inputs, then states) and unknown ones (outputs, then derivatives).
struct Plant<'a> {
    fmu: &'a Fmu,
    known: Vec<&'a Variable>,
    unknown: Vec<(&'a Unknown, &'a Variable)>,
    known_references: Vec<Reference>,
    unknown_references: Vec<Reference>,
    /// Values of the known variables after initialization.
    base: Vec<f64>,
    /// Positions of the states in the saved bytes, if some of them cannot be set.
    place: Option<Place>,
}

impl<'a> Plant<'a> {
    fn of(fmu: &'a Fmu) -> Self {
        let variables = &fmu.description.variables;
        let mut known: Vec<_> = fmu.with(Causality::Input).filter(|v| v.base_type == BaseType::Real).collect();
        known.extend(fmu.states());
        let listed = fmu.description.outputs.iter().chain(&fmu.description.derivatives);
        let unknown: Vec<_> = listed.map(|unknown| (unknown, &variables[unknown.variable])).collect();
        let known_references: Vec<_> = known.iter().map(|variable| variable.reference).collect();
        let is_calculated = |variable: &&Variable| variable.initial == Some(Initial::Calculated);
        Self {
            fmu,
            base: reals(&mut fmu.started(), &known_references),
            place: known.iter().any(is_calculated).then(|| Place::of(&fmu.description.guid)),
            known_references,
            unknown_references: unknown.iter().map(|(_, variable)| variable.reference).collect(),
            known,
            unknown,
        }
    }

    /// An instance in which states can be changed: in Initialization Mode, or in Step Mode if some of them can be
    /// changed only in saved bytes. `vary` also changes the parameters, if the FMU accepts the new values.
    fn instance(&self, configuration: &Configuration, vary: Option<&mut Random>) -> Instance {
        let prepare = || {
            let mut instance = self.fmu.instance();
            ok(configuration.set(&mut instance));
            ok(instance.enter_initialization_mode());
            instance
        };
        let begin = |mut instance: Instance| {
            if self.place.is_some() {
                instance.exit_initialization_mode().ok()?;
            }
            let mut values = vec![0.0; self.unknown.len()];
            instance.get_real(&self.unknown_references, &mut values).ok()?;
            Some(instance)
        };
        let as_declared = || begin(prepare()).expect("the declared parameters have a design");
        let Some(random) = vary else { return as_declared() };
        let mut instance = prepare();
        for parameter in self.fmu.with(Causality::Parameter).filter(|v| v.base_type == BaseType::Real) {
            let value = match start(parameter) {
                0.0 => 0.1 * random.symmetric().abs(),
                start => start * (1.0 + 0.2 * random.symmetric()),
            };
            let value = value.clamp(parameter.min.unwrap_or(f64::MIN), parameter.max.unwrap_or(f64::MAX));
            ok(instance.set_real(&[parameter.reference], &[value]));
        }
        begin(instance).unwrap_or_else(as_declared)
    }

    /// A random point near the start values. Its deviation from them is `size` times the usual deviation.
    fn point(&self, random: &mut Random, size: f64) -> Vec<f64> {
        let deviation = |variable: &Variable, base: f64, random: &mut Random| {
            let value = base + size * scale(variable) * random.symmetric();
            if is_magnitude(variable) { value.abs() } else { value }
        };
        self.known.iter().zip(&self.base).map(|(variable, &base)| deviation(variable, base, random)).collect()
    }

    /// The unknown values at a point.
    fn evaluate(&self, instance: &mut Instance, point: &[f64]) -> Vec<f64> {
        match self.place {
            None => ok(instance.set_real(&self.known_references, point)),
            Some(place) => place.change(instance, &self.known_references, point),
        }
        reals(instance, &self.unknown_references)
    }
}

#[test]
fn directional_derivatives_are_the_slopes_of_outputs_and_derivatives() {
    // Central differences with widths h and h/2, where h is 1e-3 of the usual deviation, give the slope with an error
    // of order h^4 (Richardson), and an estimate of this error. The remaining error is rounding: a few units in the
    // last place of the value, divided by h. Errors are relative to the largest effect on the same unknown.
    const WIDTH: f64 = 1e-3;
    for fmu in plants() {
        let plant = Plant::of(&fmu);
        let (mut entries, mut kinks) = (0, 0);
        for configuration in fmu.configurations() {
            let mut random = Random(41);
            for size in [0.2, 1.0, 1.0] {
                let mut instance = plant.instance(&configuration, None);
                let point = plant.point(&mut random, size);
                let values = plant.evaluate(&mut instance, &point);
                let columns: Vec<_> = (0..plant.known.len())
                    .map(|j| {
                        let unit = scale(plant.known[j]);
                        let mut quotient = |width: f64| {
                            let mut side = |sign: f64| {
                                let mut moved = point.clone();
                                moved[j] += sign * width * unit;
                                plant.evaluate(&mut instance, &moved)
                            };
                            let (above, below) = (side(1.0), side(-1.0));
                            above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * width)).collect::<Vec<_>>()
                        };
                        let (wide, narrow) = (quotient(WIDTH), quotient(WIDTH / 2.0));
                        let _ = plant.evaluate(&mut instance, &point);
                        let mut slopes = vec![f64::NAN; plant.unknown.len()];
                        let known = [plant.known_references[j]];
                        ok(instance.get_directional_derivative(
                            &plant.unknown_references,
                            &known,
                            &[unit],
                            &mut slopes,
                        ));
                        (wide, narrow, slopes)
                    })
                    .collect();
                for (i, (_, unknown)) in plant.unknown.iter().enumerate() {
                    let largest = columns.iter().fold(0.0_f64, |most, (_, _, slopes)| most.max(slopes[i].abs()));
                    for ((wide, narrow, slopes), known) in columns.iter().zip(&plant.known) {
                        let rounding = 16.0 * f64::EPSILON * (values[i].abs() + largest) / WIDTH;
                        let estimate = (narrow[i] - wide[i]).abs();
                        let expected = (4.0 * narrow[i] - wide[i]) / 3.0;
                        entries += 1;
                        if estimate > 1e-4 * largest + rounding {
                            kinks += 1; // a kink within the width; there is no slope to compare with
                            continue;
                        }
                        let error = (slopes[i] - expected).abs();
                        assert!(
                            error <= 1e-7 * largest + rounding + estimate,
                            "{}{}: d({})/d({}): {} instead of {expected} per {} of the known",
                            fmu.name,
                            configuration.name,
                            unknown.name,
                            known.name,
                            slopes[i],
                            scale(known),
                        );
                    }
                }
            }
        }
        println!("{}: {entries} slopes, {kinks} at kinks", fmu.name);
        assert!(kinks * 100 <= entries, "{}: {kinks} of {entries} slopes are at kinks", fmu.name);
    }
}

#[test]
fn a_direction_of_several_knowns_adds_up() {
    // The derivative along a sum of directions is the sum of the derivatives, except for rounding.
    for fmu in plants() {
        let plant = Plant::of(&fmu);
        let mut instance = plant.instance(&Configuration::default(), None);
        let mut random = Random(43);
        let point = plant.point(&mut random, 1.0);
        let _ = plant.evaluate(&mut instance, &point);
        let seed: Vec<_> = plant.known.iter().map(|known| scale(known) * random.symmetric()).collect();
        let mut together = vec![0.0; plant.unknown.len()];
        let unknown = &plant.unknown_references;
        ok(instance.get_directional_derivative(unknown, &plant.known_references, &seed, &mut together));
        let mut sum = vec![0.0; unknown.len()];
        let mut size = vec![0.0; unknown.len()];
        for (known, seed) in plant.known_references.iter().zip(&seed) {
            let mut one = vec![0.0; unknown.len()];
            ok(instance.get_directional_derivative(unknown, &[*known], &[*seed], &mut one));
            for i in 0..unknown.len() {
                sum[i] += one[i];
                size[i] += one[i].abs();
            }
        }
        for i in 0..unknown.len() {
            let error = (together[i] - sum[i]).abs();
            assert!(error <= 1e-13 * size[i], "{}: {}", fmu.name, plant.unknown[i].1.name);
        }
    }
}

#[test]
fn declared_dependencies_are_the_real_ones() {
    for fmu in plants() {
        let plant = Plant::of(&fmu);
        let variables = &fmu.description.variables;
        let declared: Vec<BTreeSet<&str>> = plant
            .unknown
            .iter()
            .map(|(unknown, _)| {
                let list = unknown.dependencies.as_ref().expect("every unknown lists its dependencies");
                list.iter().map(|&index| variables[index].name.as_str()).collect()
            })
            .collect();
        // Observes dependencies at points near the start values and far from them, where tires saturate or lift off and
        // limits act, with declared and with varied parameters, in all configurations.
        let mut seen = vec![BTreeSet::new(); plant.unknown.len()];
        for configuration in fmu.configurations() {
            let mut random = Random(47);
            for size in [0.0, 0.1, 1.0, 10.0, 100.0, 1000.0] {
                for vary in [false, true, false, true] {
                    let parameters = if vary { Some(&mut random) } else { None };
                    let mut instance = plant.instance(&configuration, parameters);
                    let point = plant.point(&mut random, size);
                    let values = plant.evaluate(&mut instance, &point);
                    for (j, known) in plant.known.iter().enumerate() {
                        for change in [1e-3, -1.0, 30.0, -300.0] {
                            let mut moved = point.clone();
                            moved[j] += change * scale(known);
                            let reaction = plant.evaluate(&mut instance, &moved);
                            for (i, (_, unknown)) in plant.unknown.iter().enumerate() {
                                // An output that is a state is also a known variable.
                                if reaction[i] == values[i] || unknown.reference == known.reference {
                                    continue;
                                }
                                assert!(
                                    declared[i].contains(known.name.as_str()),
                                    "{}{}: {} reacts to {}, which is not declared",
                                    fmu.name,
                                    configuration.name,
                                    unknown.name,
                                    known.name
                                );
                                seen[i].insert(known.name.as_str());
                            }
                        }
                    }
                }
            }
        }
        let mut missing: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        let mut count = 0;
        for ((declared, seen), (_, unknown)) in declared.iter().zip(&seen).zip(&plant.unknown) {
            count += declared.len();
            // An output that is a state depends on itself.
            for known in declared.difference(seen).filter(|known| **known != unknown.name) {
                let is_listed = UNSEEN.iter().any(|(name, u, k, reason)| {
                    assert!(!reason.is_empty(), "every exception has a reason");
                    *name == fmu.name && fits(&unknown.name, u) && fits(known, k)
                });
                if !is_listed {
                    missing.entry(&unknown.name).or_default().push(known);
                }
            }
        }
        println!("{}: {count} dependencies of {} unknowns", fmu.name, plant.unknown.len());
        assert!(missing.is_empty(), "{}: declared, but nothing reacts: {missing:#?}", fmu.name);
    }
}

fn fits(name: &str, pattern: &str) -> bool {
    pattern.strip_suffix('*').map_or(name == pattern, |start| name.starts_with(start))
}

#[test]
fn held_outputs_depend_on_nothing_between_steps() {
    for fmu in all().iter().filter(|fmu| !fmu.is_plant()) {
        for unknown in &fmu.description.outputs {
            let name = &fmu.description.variables[unknown.variable].name;
            assert_eq!(unknown.dependencies.as_deref(), Some(&[][..]), "{}: dependencies of {name}", fmu.name);
        }
        let first = Excitation::of(fmu, 53);
        let mut values = vec![0.0; first.references.len()];
        let mut instance = fmu.instance();
        ok(instance.enter_initialization_mode());
        let mut check = |instance: &mut Instance, place: &str| {
            let held = fmu.outputs(instance);
            for time in [0.3, 0.7] {
                first.values(time, &mut values);
                ok(instance.set_real(&first.references, &values));
                assert_eq!(fmu.outputs(instance), held, "{}: an output reacts {place}", fmu.name);
            }
        };
        // In Initialization Mode, an output can depend directly on an input, if the description declares the
        // dependency.
        let follows = |index: &usize| fmu.description.variables[*index].causality == Causality::Input;
        if !fmu.description.initial_unknowns.iter().any(|unknown| unknown.dependencies.iter().flatten().any(follows)) {
            check(&mut instance, "in Initialization Mode");
        }
        ok(instance.exit_initialization_mode());
        check(&mut instance, "before the first step");
        for k in 0..5 {
            ok(instance.do_step(f64::from(k) * 0.001, 0.001));
            check(&mut instance, "between steps");
        }
    }
}

#[test]
fn plants_are_integrated_with_order_four() {
    // The inputs make a step and stay constant during one communication step, whose longest substep is H. Halving H
    // reduces the error of a method of order p by 2^p; RK4 has p = 4. H is twice the step that the model is designed
    // for, so the neglected higher terms, which are of the order of H times the fastest pole, are some percent. The
    // solution with H/16 is used as the exact one; its error is (1/16)^4 of the error with H.
    const SPAN: f64 = 0.2;
    for fmu in plants() {
        // A plant that is solved exactly has no `max_step`.
        let Some(max_step) = fmu.description.variable("max_step") else { continue };
        let states: Vec<_> = fmu.states().iter().map(|state| state.reference).collect();
        let excitation = Excitation::of(&fmu, 59);
        let mut inputs = vec![0.0; excitation.references.len()];
        excitation.values(0.0, &mut inputs);
        let run = |longest: f64| {
            let mut instance = fmu.instance();
            ok(instance.set_real(&[max_step.reference], &[longest]));
            ok(instance.set_real(&excitation.references, &inputs));
            ok(instance.enter_initialization_mode());
            ok(instance.exit_initialization_mode());
            ok(instance.do_step(0.0, SPAN));
            reals(&mut instance, &states)
        };
        let coarse = 2.0 * start(max_step);
        let exact = run(coarse / 16.0);
        let error = |longest: f64| {
            let found = run(longest);
            let errors = found.iter().zip(&exact).map(|(a, b)| if *b == 0.0 { 0.0 } else { ((a - b) / b).abs() });
            errors.fold(0.0, f64::max)
        };
        let errors = [error(coarse), error(coarse / 2.0)];
        let order = (errors[0] / errors[1]).log2();
        println!("{}: errors {:.1e} and {:.1e}, order {order:.2}", fmu.name, errors[0], errors[1]);
        assert!((order - 4.0).abs() < 0.25, "{}: order {order}", fmu.name);
    }
}
