//! Rules for setting and reading values, and the error messages.

use fmu::testing::calls::{Function, Mode, Protocol, Version};

use crate::models::{CartPair, Fmu, Fragile, Sampler, error_of, reference};

/// An instance in one of the modes that a master can reach.
fn in_mode(mode: Mode) -> Fmu<CartPair> {
    let mut fmu = Fmu::<CartPair>::new();
    if mode == Mode::Instantiated {
        return fmu;
    }
    fmu.0.enter_initialization().unwrap();
    if mode == Mode::Initialization {
        return fmu;
    }
    fmu.0.exit_initialization().unwrap();
    match mode {
        Mode::StepFailed => {
            fmu.set("cart_force.l", 1e308).unwrap();
            fmu.step(1e3).unwrap_err();
        }
        Mode::Terminated => fmu.0.terminate().unwrap(),
        _ => {}
    }
    assert_eq!(fmu.0.mode(), mode);
    fmu
}

const REACHABLE: [Mode; 5] = [Mode::Instantiated, Mode::Initialization, Mode::Step, Mode::StepFailed, Mode::Terminated];

#[test]
fn causality_variability_and_mode_decide_what_may_be_set() {
    use Mode::{Initialization, Instantiated, Step};
    let cases: [(&str, &[Mode], &str); 8] = [
        ("cart.mass", &[Instantiated, Initialization], "a fixed parameter, settable only in"),
        ("damper.damping", &[Instantiated, Initialization, Step], ""),
        ("spring.frequency.l", &[], "a calculated parameter, never settable"),
        ("cart_force.r", &[Instantiated, Initialization, Step], ""),
        ("cart_acceleration.l", &[], "an output, never settable"),
        ("cart_position.l", &[Instantiated, Initialization], "a continuous state, settable only in"),
        ("cart_velocity.r", &[Instantiated, Initialization], "a continuous state, settable only in"),
        ("der(cart_position.l)", &[], "the derivative of a state, never settable"),
    ];
    for (name, modes, what) in cases {
        for mode in REACHABLE {
            let mut fmu = in_mode(mode);
            let answer = fmu.set(name, 0.75);
            if modes.contains(&mode) {
                answer.unwrap();
                if mode != Instantiated {
                    assert_eq!(fmu.get(name), 0.75);
                }
            } else if Function::SetReal.allowed(Protocol::CS2, mode) {
                let message = error_of(answer);
                assert!(message.starts_with(&format!("fmi2SetReal: '{name}' is {what}")), "{message}");
                assert!(message.ends_with(&format!("; the instance is in {}", mode.name())), "{message}");
            } else {
                assert_eq!(
                    error_of(answer),
                    format!(
                        "fmi2SetReal called in {}, allowed in Instantiated, Initialization Mode, Step Mode",
                        mode.name()
                    )
                );
            }
        }
    }
}

#[test]
fn outputs_with_a_start_value_may_be_set_before_the_start() {
    // initial="exact": settable in Instantiated and Initialization Mode (FMI 2.0, section 2.1.7 and table of 4.2.4).
    let mut fmu = Fmu::<Sampler>::new();
    fmu.set("filter_time", -5.0).unwrap();
    fmu.0.enter_initialization().unwrap();
    fmu.set("filter_output", 0.75).unwrap();
    fmu.0.exit_initialization().unwrap();
    assert_eq!((fmu.get("filter_output"), fmu.get("filter_time")), (0.75, -5.0));
    assert_eq!(
        error_of(fmu.set("filter_output", 1.0)),
        "fmi2SetReal: 'filter_output' is an output with a start value, settable only in Instantiated and \
         Initialization Mode; the instance is in Step Mode"
    );
    fmu.0.reset().unwrap();
    fmu.0.enter_initialization().unwrap();
    assert_eq!(fmu.get("filter_output"), 0.5);
}

#[test]
fn every_function_follows_the_table_of_calls() {
    for mode in REACHABLE {
        // A call that the mode allows succeeds, or fails for another reason. A call that the mode forbids reports the
        // rule.
        type Call = (Function, fn(&mut Fmu<CartPair>) -> Result<(), fmu::testing::instance::CallError>);
        let calls: [Call; 12] = [
            (Function::SetupExperiment, |u| u.0.setup_experiment(0.0, None)),
            (Function::EnterInitializationMode, |u| u.0.enter_initialization()),
            (Function::ExitInitializationMode, |u| u.0.exit_initialization()),
            (Function::Terminate, |u| u.0.terminate()),
            (Function::Reset, |u| u.0.reset()),
            (Function::GetReal, |u| u.0.get_real(&[], &mut [])),
            (Function::GetInteger, |u| u.0.get_integer(reference::<CartPair>("spring.law")).map(drop)),
            (Function::GetBoolean, |u| u.0.get_boolean(reference::<CartPair>("damper.on")).map(drop)),
            (Function::SetReal, |u| u.0.set_real(&[], &[])),
            (Function::GetFMUstate, |u| u.0.snapshot().map(drop)),
            (Function::GetDirectionalDerivative, |u| u.0.directional_derivative(&[], &[], &[], &mut [])),
            (Function::DoStep, |u| u.step(0.01)),
        ];
        for (function, call) in calls {
            let mut fmu = in_mode(mode);
            let answer = call(&mut fmu);
            if function.allowed(Protocol::CS2, mode) {
                answer.unwrap_or_else(|e| panic!("{} in {}: {e:?}", function.name(Version::Fmi2), mode.name()));
            } else {
                let message = error_of(answer);
                let expected = format!("{} called in {}, allowed in ", function.name(Version::Fmi2), mode.name());
                assert!(message.starts_with(&expected), "{message}");
                assert_eq!(fmu.0.mode(), mode);
            }
        }
    }
}

#[test]
fn limits_and_numbers_that_are_not_finite_are_rejected() {
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    let before = fmu.bytes();
    for (name, value, message) in [
        ("damper.damping", -0.1, "'damper.damping' must be in [0, 50], got -0.1 N.s/m"),
        ("damper.damping", 50.1, "'damper.damping' must be in [0, 50], got 50.1 N.s/m"),
        ("cart.mass", -1.0, "'cart.mass' must be in [0.000001, inf], got -1 kg"),
        ("cart_force.l", f64::NAN, "'cart_force.l' must be finite, got NaN"),
        ("cart_force.l", f64::INFINITY, "'cart_force.l' must be finite, got inf"),
        ("cart_position.l", f64::NEG_INFINITY, "'cart_position.l' must be finite, got -inf"),
    ] {
        assert_eq!(error_of(fmu.set(name, value)), format!("fmi2SetReal: {message}"));
    }
    assert_eq!(fmu.bytes(), before);
    for value in [0.0, 50.0] {
        fmu.set("damper.damping", value).unwrap();
    }
    // Inputs may have any finite value.
    fmu.set("cart_force.l", -f64::MAX).unwrap();
}

#[test]
fn one_rejected_value_keeps_all_values() {
    let mut fmu = Fmu::<CartPair>::ready();
    let references = ["cart_force.l", "damper.damping", "cart.mass"].map(reference::<CartPair>);
    let before = fmu.bytes();
    error_of(fmu.0.set_real(&references, &[1.0, 2.0, 3.0]));
    error_of(fmu.0.set_real(&[references[0], 999], &[1.0, 2.0]));
    error_of(fmu.0.set_real(&references[..2], &[1.0, -2.0]));
    assert_eq!(fmu.bytes(), before);

    let mut fmu = Fmu::<Sampler>::ready();
    let before = fmu.bytes();
    let (offset, order) = (reference::<Sampler>("filter.offset"), reference::<Sampler>("filter.order"));
    error_of(fmu.0.set_integer(&[offset, order], &[2, 2]));
    error_of(fmu.0.set_integer(&[offset, offset], &[2, 6]));
    assert_eq!(fmu.bytes(), before);
    fmu.0.set_integer(&[offset, offset], &[2, -3]).unwrap();
    assert_eq!(fmu.0.get_integer(offset), Ok(-3));
}

#[test]
fn unknown_references_and_wrong_types_are_named() {
    let mut fmu = Fmu::<Sampler>::initializing(0.0);
    let before = fmu.bytes();
    let [gain, offset, on, label] =
        ["filter.gain", "filter.offset", "filter.on", "filter.label"].map(reference::<Sampler>);
    let end = label + 1;
    let wrong = |function: &str, reference: u32, what: &str, expected: &str| {
        format!("{function}: value reference {reference} must be a variable of type {expected}, it is {what}")
    };
    let mut value = [0.0];
    for (reference, what) in [
        (offset, "'filter.offset' of type Integer"),
        (on, "'filter.on' of type Boolean"),
        (label, "'filter.label' of type String"),
        (end, "no variable"),
        (u32::MAX, "no variable"),
    ] {
        assert_eq!(
            error_of(fmu.0.get_real(&[gain, reference], &mut [0.0, 0.0])),
            wrong("fmi2GetReal", reference, what, "Real")
        );
        assert_eq!(error_of(fmu.0.get_real(&[reference], &mut value)), wrong("fmi2GetReal", reference, what, "Real"));
        assert_eq!(error_of(fmu.0.set_real(&[reference], &[1.0])), wrong("fmi2SetReal", reference, what, "Real"));
    }
    for (reference, what) in
        [(gain, "'filter.gain' of type Real"), (on, "'filter.on' of type Boolean"), (end, "no variable")]
    {
        assert_eq!(error_of(fmu.0.get_integer(reference)), wrong("fmi2GetInteger", reference, what, "Integer"));
        assert_eq!(
            error_of(fmu.0.set_integer(&[reference], &[1])),
            wrong("fmi2SetInteger", reference, what, "Integer")
        );
    }
    for (reference, what) in [(offset, "'filter.offset' of type Integer"), (u32::MAX, "no variable")] {
        assert_eq!(error_of(fmu.0.get_boolean(reference)), wrong("fmi2GetBoolean", reference, what, "Boolean"));
        assert_eq!(
            error_of(fmu.0.set_boolean(&[reference], &[true])),
            wrong("fmi2SetBoolean", reference, what, "Boolean")
        );
        assert_eq!(error_of(fmu.0.get_string(reference)), wrong("fmi2GetString", reference, what, "String"));
        assert_eq!(
            error_of(fmu.0.set_string(&[reference], &["x".to_owned()])),
            wrong("fmi2SetString", reference, what, "String")
        );
    }
    assert_eq!(fmu.bytes(), before);
}

#[test]
fn enumerations_take_their_values_only() {
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    for value in [-1, 1, 3, i32::MIN, i32::MAX] {
        assert_eq!(
            error_of(fmu.set_integer("spring.law", value)),
            format!("fmi2SetInteger: 'spring.law' must be 0 (linear) or 2 (hardening_spring), got {value}")
        );
    }
    fmu.set_integer("spring.law", 2).unwrap();
    let mut fmu = Fmu::<Sampler>::initializing(0.0);
    assert_eq!(
        error_of(fmu.set_integer("filter.offset", 6)),
        "fmi2SetInteger: 'filter.offset' must be in [-5, 5], got 6"
    );
    assert_eq!(
        error_of(fmu.set_string("filter.label", "a\0b")),
        "fmi2SetString: 'filter.label' must not contain a zero byte"
    );
}

#[test]
fn fixed_integers_booleans_and_strings_are_fixed_from_the_start() {
    let mut fmu = Fmu::<Sampler>::initializing(0.0);
    fmu.set_integer("filter.order", 3).unwrap();
    fmu.set_boolean("filter.on", false).unwrap();
    fmu.set_string("filter.label", "abc").unwrap();
    fmu.0.exit_initialization().unwrap();
    fmu.step(0.01).unwrap();
    assert_eq!(fmu.get("filter_label_length"), 3.0);
    let before = fmu.bytes();
    let fixed = "is a fixed parameter, settable only in Instantiated and Initialization Mode; \
                 the instance is in Step Mode";
    assert_eq!(error_of(fmu.set_integer("filter.order", 1)), format!("fmi2SetInteger: 'filter.order' {fixed}"));
    assert_eq!(error_of(fmu.set_boolean("filter.on", true)), format!("fmi2SetBoolean: 'filter.on' {fixed}"));
    assert_eq!(error_of(fmu.set_string("filter.label", "")), format!("fmi2SetString: 'filter.label' {fixed}"));
    assert_eq!(fmu.bytes(), before);
}

#[test]
fn tunable_parameters_act_from_the_next_step_on() {
    let mut fmu = Fmu::<Sampler>::ready();
    fmu.set("filter_input", 0.5).unwrap();
    fmu.step(0.01).unwrap();
    // 2*0.5*0.01 + 0.5*0.05 + 1.
    assert!((fmu.get("filter_output") - 1.035).abs() < 1e-15);
    fmu.set("filter.gain", 4.0).unwrap();
    fmu.set_integer("filter.offset", -2).unwrap();
    assert!((fmu.get("filter_output") - 1.035).abs() < 1e-15);
    fmu.step(0.01).unwrap();
    // 0.01 + 4*0.5*0.01 + (0.5 + 0.5)*0.05 - 2.
    assert!((fmu.get("filter_output") + 1.92).abs() < 1e-15);

    // In a continuous-time model, outputs change immediately with parameters and inputs.
    let mut carts = Fmu::<CartPair>::starting(0.0, &[("cart_velocity.l", 1.0)]);
    assert_eq!(carts.get("cart_acceleration.l"), (-0.8 - 0.4) / 2.0);
    carts.set("damper.damping", 2.4).unwrap();
    assert_eq!(carts.get("cart_acceleration.l"), (-0.8 - 2.4) / 2.0);
    carts.set_boolean("damper.on", false).unwrap();
    assert_eq!(carts.get("cart_acceleration.l"), -0.8 / 2.0);
    carts.set("cart_force.l", 3.0).unwrap();
    assert_eq!(carts.get("cart_acceleration.l"), (3.0 - 0.8) / 2.0);
    assert_eq!(carts.get("der(cart_velocity.l)"), (3.0 - 0.8) / 2.0);
}

#[test]
fn calculated_parameters_follow_the_fixed_ones_in_initialization() {
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    assert_eq!((fmu.get("spring.frequency.l"), fmu.get("spring.frequency.r")), (2.0, 3.0));
    fmu.set("cart.mass", 0.5).unwrap();
    assert_eq!((fmu.get("spring.frequency.l"), fmu.get("spring.frequency.r")), (4.0, 6.0));
    fmu.0.exit_initialization().unwrap();
    assert_eq!(fmu.get("spring.frequency.r"), 6.0);
    let mut fmu = Fmu::<Sampler>::initializing(0.0);
    fmu.set("sample_time", 0.25).unwrap();
    assert_eq!(fmu.get("filter.rate"), 4.0);
}

#[test]
fn the_end_of_initialization_rejects_parameters_without_derived_ones() {
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    fmu.set("spring.stiffness.l", 2e6).unwrap();
    let before = fmu.bytes();
    let message = "CartPair: 'spring.stiffness.l' must be at most 1e6 N/m, got 2000000 N/m";
    assert_eq!(error_of(fmu.0.exit_initialization()), message);
    assert_eq!(error_of(fmu.try_get("spring.frequency.l")), message);
    assert_eq!(error_of(fmu.try_get("cart_acceleration.l")), message);
    assert_eq!(fmu.0.mode(), Mode::Initialization);
    assert_eq!(fmu.bytes(), before);
    fmu.set("spring.stiffness.l", 1.0).unwrap();
    // A calculated parameter overflows.
    fmu.set("cart.mass", 1e-3).unwrap();
    fmu.set("spring.stiffness.r", 1e308).unwrap();
    assert_eq!(
        error_of(fmu.0.exit_initialization()),
        "CartPair: calculated parameter 'spring.frequency.r' must be finite, got inf; check the parameters"
    );
    fmu.set("cart.mass", 2.0).unwrap();
    fmu.0.exit_initialization().unwrap();
    // The same applies to an initial discrete state that is not finite.
    let mut fmu = Fmu::<Fragile>::initializing(0.0);
    fmu.set("product.scale", 0.0).unwrap();
    let before = fmu.bits();
    assert_eq!(
        error_of(fmu.0.exit_initialization()),
        "Fragile: start of 'product' must be finite, got inf; check the parameters"
    );
    assert_eq!((fmu.0.mode(), fmu.bits()), (Mode::Initialization, before));
    fmu.set("product.scale", 2.0).unwrap();
    fmu.0.exit_initialization().unwrap();
}

#[test]
fn what_must_be_positive_is_at_least_a_millionth_at_any_time() {
    let mut fmu = Fmu::<Sampler>::new();
    let expected = "fmi2SetReal: 'filter.length' must be in [0.000001, inf], got 0 s";
    assert_eq!(error_of(fmu.set("filter.length", 0.0)), expected);
    fmu.0.enter_initialization().unwrap();
    assert_eq!(error_of(fmu.set("filter.length", 0.0)), expected);
    // The sample time also has this limit; a step of 1 s therefore has at most a million samples.
    assert!(error_of(fmu.set("sample_time", 0.9e-6)).contains("[0.000001, inf]"));
    fmu.set("sample_time", 1e-6).unwrap();
    fmu.0.exit_initialization().unwrap();
    // Tunable parameters keep the limit after the start.
    assert_eq!(error_of(fmu.set("filter.length", 0.0)), expected);
    fmu.step(1.0).unwrap();
    assert_eq!(fmu.get("filter_count"), 1e6);
    let mut carts = Fmu::<CartPair>::initializing(0.0);
    assert!(error_of(carts.set("max_step", 0.0)).contains("[0.000001, inf]"));
    carts.set("max_step", 1e-6).unwrap();
    carts.0.exit_initialization().unwrap();
    carts.step(1.0).unwrap();
}

#[test]
fn reading_a_non_finite_output_fails() {
    let mut fmu = Fmu::<CartPair>::ready();
    fmu.set("scale", 0.0).unwrap();
    let references = ["cart_position.l", "distance"].map(reference::<CartPair>);
    let mut values = [7.0, 7.0];
    assert_eq!(
        error_of(fmu.0.get_real(&references, &mut values)),
        "fmi2GetReal: 'distance' = inf at time 0 s, not a finite number"
    );
    assert_eq!(values, [7.0, 7.0]);
    // Other variables are not affected.
    assert_eq!(fmu.get("cart_position.l"), 0.1);
    fmu.step(0.01).unwrap();
    fmu.set("scale", 2.0).unwrap();
    assert!(fmu.get("distance").is_finite());
}

#[test]
fn a_reset_instance_behaves_like_a_new_one() {
    fn run<E: fmu::testing::abi::Export>(fmu: &mut Fmu<E>, input: &str) -> Vec<u8> {
        fmu.0.setup_experiment(0.5, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu.0.exit_initialization().unwrap();
        fmu.set(input, 0.8).unwrap();
        for _ in 0..20 {
            fmu.step(0.013).unwrap();
        }
        fmu.bytes()
    }
    fn check<E: fmu::testing::abi::Export>(input: &str, spoil: impl Fn(&mut Fmu<E>)) {
        let fresh = Fmu::<E>::new().bytes();
        let expected = run(&mut Fmu::<E>::new(), input);
        let mut fmu = Fmu::<E>::new();
        fmu.0.enter_initialization().unwrap();
        spoil(&mut fmu);
        fmu.0.exit_initialization().unwrap();
        fmu.set(input, -3.0).unwrap();
        fmu.step(0.25).unwrap();
        fmu.0.reset().unwrap();
        assert_eq!(fmu.0.mode(), Mode::Instantiated);
        assert_eq!(fmu.bytes(), fresh);
        assert_eq!(run(&mut fmu, input), expected);
    }
    check::<CartPair>("cart_force.l", |fmu| {
        fmu.set("cart.mass", 1.0).unwrap();
        fmu.set_integer("spring.law", 2).unwrap();
        fmu.set_boolean("damper.on", false).unwrap();
    });
    check::<Sampler>("filter_input", |fmu| {
        fmu.set_integer("filter.order", 4).unwrap();
        fmu.set_string("filter.label", "other").unwrap();
    });
    check::<Fragile>("dividend", |_| {});
}

mod starting {
    use fmu::prelude::*;

    use crate::models::CartPair;

    #[derive(Parameters)]
    pub(super) struct Starting {
        #[var(flatten)]
        carts: CartPair,
    }

    #[derive(State)]
    pub(super) struct X<T> {
        /// Position (m)
        #[var(calculated)]
        x: T,
    }

    /// Starts at the reciprocal of a parameter
    #[fmu::model(stop_time = 1.0, step_size = 0.1)]
    impl Continuous for Starting {
        type State<T: Scalar> = X<T>;
        fn initialize(&self, (): &(), state: &mut X<f64>) {
            state.x = 1.0 / self.carts.k_c;
        }
        fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
            X { x: at.state.x }
        }
    }
}

#[test]
fn a_state_that_does_not_start_finite_is_rejected() {
    let mut fmu = Fmu::<starting::Starting>::initializing(0.0);
    let before = fmu.bytes();
    assert_eq!(
        error_of(fmu.0.exit_initialization()),
        "Starting: start of 'x' must be finite, got inf; check the parameters"
    );
    assert_eq!((fmu.0.mode(), fmu.bytes()), (Mode::Initialization, before));
    fmu.set("coupling.stiffness", 4.0).unwrap();
    fmu.0.exit_initialization().unwrap();
    assert_eq!(fmu.get("x"), 0.25);
}
