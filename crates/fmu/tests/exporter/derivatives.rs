//! Directional derivatives and the model structure.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Protocol, Version};
use fmu::testing::instance::{CallError, Instance};
use fmu::testing::runner::{Context, Model};
use fmu::testing::variable::Role;

use crate::models::{CartPair, Fmu, Law, Sampler, error_of, reference};

type M = <CartPair as Export>::Model;

fn with_role(wanted: &[Role]) -> Vec<u32> {
    let description = CartPair::description();
    let variables = description.layout.variables.iter();
    variables.filter(|v| wanted.contains(&v.role)).map(|v| v.reference).collect()
}

fn slope(fmu: &mut Fmu<CartPair>, unknown: &str, known: &str) -> f64 {
    let mut slope = [f64::NAN];
    let (unknown, known) = (reference::<CartPair>(unknown), reference::<CartPair>(known));
    fmu.0.directional_derivative(&[unknown], &[known], &[1.0], &mut slope).unwrap();
    slope[0]
}

#[test]
fn derivatives_of_the_linear_carts_are_the_matrices_of_the_textbook() {
    let mut fmu = Fmu::<CartPair>::starting(0.0, &[("coupling.stiffness", 3.0)]);
    // x' = v; m v' = F - k x - c v - k_c (x - x_other). The derivatives are exact except for one rounding.
    for (unknown, known, expected) in [
        ("der(cart_position.l)", "cart_velocity.l", 1.0),
        ("der(cart_position.l)", "cart_position.l", 0.0),
        ("der(cart_velocity.l)", "cart_position.l", -(8.0 + 3.0) / 2.0),
        ("der(cart_velocity.r)", "cart_position.r", -(18.0 + 3.0) / 2.0),
        ("der(cart_velocity.l)", "cart_position.r", 3.0 / 2.0),
        ("der(cart_velocity.l)", "cart_velocity.l", -0.4 / 2.0),
        ("der(cart_velocity.l)", "cart_force.l", 1.0 / 2.0),
        ("der(cart_velocity.l)", "cart_force.r", 0.0),
        ("cart_acceleration.r", "cart_force.r", 1.0 / 2.0),
        ("cart_position.l", "cart_position.l", 1.0),
        ("cart_position.l", "cart_position.r", 0.0),
        ("pushed", "cart_position.l", 1.0),
        ("distance", "scale", -0.1),
    ] {
        assert_eq!(slope(&mut fmu, unknown, known), expected, "d {unknown} / d {known}");
    }
}

#[test]
fn derivatives_agree_with_central_differences() {
    // The instance is in Initialization Mode, so that the states can be set.
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    fmu.set_integer("spring.law", 2).unwrap();
    let knowns = with_role(&[Role::Input, Role::State]);
    let unknowns = with_role(&[Role::Output, Role::State, Role::Derivative]);
    let mut values = vec![0.0; knowns.len()];
    for (i, value) in values.iter_mut().enumerate() {
        *value = 0.3 + 0.17 * i as f64;
    }
    fmu.0.set_real(&knowns, &values).unwrap();
    let mut at = |values: &[f64]| {
        fmu.0.set_real(&knowns, values).unwrap();
        let mut results = vec![0.0; unknowns.len()];
        fmu.0.get_real(&unknowns, &mut results).unwrap();
        results
    };
    // With a step of 1e-5, the error of a difference quotient is about 1e-10. It comes from third derivatives, and from
    // the rounding of numbers up to 100.
    let step = 1e-5;
    let mut differences = Vec::new();
    for i in 0..knowns.len() {
        let (mut above, mut below) = (values.clone(), values.clone());
        above[i] += step;
        below[i] -= step;
        let pair = at(&above).into_iter().zip(at(&below));
        differences.push(pair.map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<_>>());
    }
    fmu.0.set_real(&knowns, &values).unwrap();
    let mut slopes = vec![0.0; unknowns.len()];
    for (i, known) in knowns.iter().enumerate() {
        fmu.0.directional_derivative(&unknowns, &[*known], &[1.0], &mut slopes).unwrap();
        for (j, (slope, difference)) in slopes.iter().zip(&differences[i]).enumerate() {
            assert!((slope - difference).abs() < 1e-8, "{i} {j}: {slope} against {difference}");
        }
    }
    // The derivative along a direction is the sum over its components. A known variable that occurs twice is added
    // twice.
    let seed: Vec<_> = (0..knowns.len()).map(|i| i as f64 - 2.0).collect();
    fmu.0.directional_derivative(&unknowns, &knowns, &seed, &mut slopes).unwrap();
    for (j, slope) in slopes.iter().enumerate() {
        let sum: f64 = seed.iter().zip(&differences).map(|(s, d)| s * d[j]).sum();
        assert!((slope - sum).abs() < 1e-7, "{j}: {slope} against {sum}");
    }
    let mut twice = [0.0];
    fmu.0.directional_derivative(&unknowns[..1], &[knowns[0]; 2], &[1.0, 2.0], &mut twice).unwrap();
    assert!((twice[0] - 3.0 * differences[0][0]).abs() < 1e-7);
}

#[test]
fn impossible_derivatives_are_rejected() {
    let mut fmu = Fmu::<CartPair>::ready();
    let [mass, force, acceleration, law] =
        ["cart.mass", "cart_force.l", "cart_acceleration.l", "spring.law"].map(reference::<CartPair>);
    let before = fmu.bytes();
    let mut of = |unknown: u32, known: u32, seed: f64| {
        let mut slope = [7.0];
        let message = error_of(fmu.0.directional_derivative(&[unknown], &[known], &[seed], &mut slope));
        assert_eq!(slope, [7.0]);
        message
    };
    for reference in [mass, acceleration, law, u32::MAX] {
        assert_eq!(
            of(acceleration, reference, 1.0),
            format!(
                "fmi2GetDirectionalDerivative: value reference {reference} is neither a real input nor a state (known)"
            )
        );
    }
    for reference in [mass, force, law, u32::MAX] {
        assert_eq!(
            of(reference, force, 1.0),
            format!(
                "fmi2GetDirectionalDerivative: value reference {reference} is neither a real output nor the derivative \
                 of a state (unknown)"
            )
        );
    }
    assert_eq!(
        of(acceleration, force, f64::NAN),
        "fmi2GetDirectionalDerivative: seed of 'cart_force.l' must be finite, got NaN"
    );
    assert_eq!(fmu.bytes(), before);
    fmu.set("scale", 0.0).unwrap();
    let (distance, scale) = (reference::<CartPair>("distance"), reference::<CartPair>("scale"));
    match fmu.0.directional_derivative(&[acceleration, distance], &[scale], &[1.0], &mut [0.0; 2]) {
        Err(CallError::Discard(message)) => {
            let start = "fmi2GetDirectionalDerivative: the derivative of 'distance' with respect to 'scale' is ";
            assert!(message.starts_with(start) && message.ends_with(" at 0 s, not a finite number"), "{message}");
        }
        other => panic!("fmi2Discard was expected, {other:?} found"),
    }
    fmu.0.directional_derivative(&[acceleration], &[scale], &[1.0], &mut [0.0]).unwrap();
    let mut sampler = Fmu::<Sampler>::ready();
    assert!(
        error_of(sampler.0.directional_derivative(&[], &[], &[], &mut []))
            .contains("only continuous-time models have derivatives"),
        "a discrete-time model has no derivatives"
    );
}

#[test]
fn dependencies_hold_for_every_value_of_every_parameter() {
    // The expected dependencies follow from the equations, for both laws, with and without dampers and coupling.
    let xml = &CartPair::description().xml;
    let index = |name: &str| CartPair::description().layout.structure_index(reference::<CartPair>(name));
    let both = ["cart_force.", "ground.height", "cart_position.l", "cart_position.r", "cart_velocity."];
    for side in ["l", "r"] {
        let expected: Vec<_> = both
            .map(|name| index(&if name.ends_with('.') { format!("{name}{side}") } else { name.to_owned() }))
            .map(|index| index.to_string())
            .into();
        let expected = expected.join(" ");
        for name in [format!("cart_acceleration.{side}"), format!("der(cart_velocity.{side})")] {
            let entry = format!(r#"<Unknown index="{}" dependencies="{expected}"/>"#, index(&name));
            assert!(xml.contains(&entry), "{name}: {entry}");
        }
        let entry = format!(
            r#"<Unknown index="{}" dependencies="{}"/>"#,
            index(&format!("der(cart_position.{side})")),
            index(&format!("cart_velocity.{side}"))
        );
        assert!(xml.contains(&entry));
        // An output that is a state depends on this state.
        let state = index(&format!("cart_position.{side}"));
        assert!(xml.contains(&format!(r#"<Unknown index="{state}" dependencies="{state}"/>"#)));
    }
    // The union over both laws is needed, because the ground moves only the hardening spring.
    let layout = &CartPair::description().layout;
    let values = fmu::testing::store::ValueStore::start(layout);
    let none = std::path::Path::new("");
    let set = |law| {
        let p = CartPair { law, ..Default::default() };
        let derived = M::load(&p, none).unwrap();
        let ctx = Context { p: &p, derived: &derived, layout, time: 0.0 };
        let memory = M::init(ctx, none, &values).unwrap();
        M::dependencies(ctx, &memory, &values).unwrap().line(0).to_vec()
    };
    let ground = 2;
    assert!(!set(Law::Linear).contains(&ground));
    assert!(set(Law::HardeningSpring).contains(&ground));
}

#[derive(Parameters)]
struct Roots;

#[derive(State)]
struct Root<T> {
    /// Level (1)
    x: T,
}

#[derive(Inputs)]
struct Flow<T> {
    /// Inflow (1)
    u: T,
}

#[derive(Outputs)]
struct Rooted<T> {
    /// Outflow (1)
    y: T,
    /// Angle (1)
    angle: T,
}

/// Slopes that are infinite at the start
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Roots {
    type State<T: Scalar> = Root<T>;
    type Inputs<T: Scalar> = Flow<T>;
    type Outputs<T: Scalar> = Rooted<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Root<T> {
        Root { x: at.inputs.u - at.state.x.powf(0.5) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Rooted<T> {
        Rooted { y: at.state.x.sqrt() + at.inputs.u, angle: (at.inputs.u * 3.0 + 1.0).asin() }
    }
}

/// The derivatives of sqrt(x) and x^0.5 at 0 and of asin(z) at 1 are infinite. FMI 2.0.4, section 2.1.3: fmi2Discard.
#[test]
fn a_slope_that_is_not_finite_is_discarded_in_every_interface() {
    for protocol in Protocol::ALL {
        let mut instance = Instance::<<Roots as Export>::Model>::new(protocol, Roots::description(), PathBuf::new());
        instance.set_experiment(Function::SetupExperiment, 0.0, None, None).unwrap();
        instance.enter_initialization().unwrap();
        let [x, slope, u, y, angle] = ["x", "der(x)", "u", "y", "angle"].map(reference::<Roots>);
        for (unknown, of, known, to) in [(y, "y", x, "x"), (slope, "der(x)", x, "x"), (angle, "angle", u, "u")] {
            let mut results = vec![instance.directional_derivative(&[unknown], &[known], &[1.0], &mut [0.0])];
            if protocol.version == Version::Fmi3 {
                results.push(instance.adjoint_derivative(&[unknown], &[known], &[1.0], &mut [0.0]));
            }
            for result in results {
                let Err(CallError::Discard(message)) = result else { panic!("{result:?}") };
                let part = format!("the derivative of '{of}' with respect to '{to}' is ");
                assert!(message.contains(&part), "{message}");
            }
        }
        // In the direction of the input, the level does not change, so all derivatives are finite. The simulation can
        // continue.
        let mut result = [0.0; 2];
        instance.directional_derivative(&[y, slope], &[u], &[1.0], &mut result).unwrap();
        assert_eq!(result, [1.0, 1.0]);
        if protocol.version == Version::Fmi3 {
            instance.adjoint_derivative(&[y, slope, angle], &[u], &[1.0, 2.0, 0.0], &mut result[..1]).unwrap();
            assert_eq!(result[0], 3.0);
        }
        instance.exit_initialization().unwrap();
    }
}
