//! Steps that fail.

use fmu::testing::calls::{Function, Mode, Protocol, Version};

use crate::models::{CartPair, Fmu, Fragile, error_of};

#[test]
fn a_step_that_is_not_finite_restores_what_was_before() {
    let mut fmu = Fmu::<Fragile>::ready();
    fmu.set("dividend", 3.0).unwrap();
    fmu.step(0.1).unwrap();
    fmu.set("divisor", 0.0).unwrap();
    let (before, bits) = (fmu.0.snapshot().unwrap(), fmu.bits());
    assert_eq!(
        error_of(fmu.step(0.3)),
        "fmi2DoStep: 'quotient' became inf at 0.1 s; the state at 0.1 s was restored and the instance cannot continue"
    );
    assert_eq!(fmu.0.mode(), Mode::StepFailed);
    assert_eq!(fmu.0.time(), 0.1);
    assert_eq!(fmu.bits(), bits);
    assert!(error_of(fmu.step(0.1)).starts_with("fmi2DoStep called in Step Failed, allowed in Step Mode"));
    assert!(error_of(fmu.set("divisor", 1.0)).starts_with("fmi2SetReal called in Step Failed"));
    // A saved state repairs the instance, with the discrete state from before the failed step.
    fmu.0.restore(&before).unwrap();
    fmu.set("divisor", 2.0).unwrap();
    fmu.step(0.1).unwrap();
    assert_eq!((fmu.get("quotient"), fmu.get("sum_of_quotients")), (1.5, 4.5));
}

#[test]
fn a_later_sample_of_a_step_may_fail_and_all_of_them_are_undone() {
    // The product of dividends overflows in the fourth sample, at 0.3 s: 1e90^4 > 1.8e308.
    let mut fmu = Fmu::<Fragile>::ready();
    fmu.set("dividend", 1e90).unwrap();
    let (before, bits) = (fmu.bytes(), fmu.bits());
    assert_eq!(
        error_of(fmu.step(1.0)),
        "fmi2DoStep: 'product' became inf at 0.30000000000000004 s; the state at 0 s was restored and the instance \
         cannot continue"
    );
    assert_eq!(fmu.bits(), bits);
    let before = fmu.0.deserialize(&before).unwrap();
    fmu.0.restore(&before).unwrap();
    fmu.step(0.1).unwrap();
    assert_eq!(fmu.get("sum_of_quotients"), 1e90);
}

#[test]
fn a_model_may_reject_a_sample() {
    let mut fmu = Fmu::<Fragile>::ready();
    fmu.step(0.2).unwrap();
    fmu.set("divisor", -2.0).unwrap();
    let bits = fmu.bits();
    assert_eq!(
        error_of(fmu.step(0.1)),
        "fmi2DoStep: 'divisor' must be 0 or more, got -2 at 0.2 s; the state at 0.2 s was restored and the \
         instance cannot continue"
    );
    assert_eq!((fmu.0.mode(), fmu.bits()), (Mode::StepFailed, bits));
}

#[test]
fn a_continuous_model_that_overflows_restores_its_state() {
    let mut fmu = Fmu::<CartPair>::ready();
    fmu.step(0.5).unwrap();
    fmu.set("cart_force.l", f64::MAX).unwrap();
    let bits = fmu.bits();
    let message = error_of(fmu.step(1e3));
    assert!(message.starts_with("fmi2DoStep: 'cart_position.l' became "), "{message}");
    assert!(message.ends_with(" at 1000.5 s; the state at 0.5 s was restored and the instance cannot continue"));
    assert_eq!((fmu.0.mode(), fmu.bits(), fmu.0.time()), (Mode::StepFailed, bits, 0.5));
    fmu.0.terminate().unwrap();
    assert_eq!(fmu.0.mode(), Mode::Terminated);
    fmu.0.reset().unwrap();
    fmu.0.enter_initialization().unwrap();
    fmu.0.exit_initialization().unwrap();
    fmu.step(0.5).unwrap();
}

#[test]
fn after_a_failed_step_only_reading_restoring_and_ending_is_left() {
    use Function as F;
    let is_there = |function: &&Function| Mode::ALL.iter().any(|&mode| function.allowed(Protocol::CS2, mode));
    for &function in F::ALL.iter().filter(is_there) {
        let allowed = !matches!(
            function,
            F::SetupExperiment
                | F::EnterInitializationMode
                | F::ExitInitializationMode
                | F::SetReal
                | F::SetInteger
                | F::SetBoolean
                | F::SetString
                | F::SetRealInputDerivatives
                | F::GetFMUstate
                | F::DoStep
                | F::CancelStep
        );
        assert_eq!(function.allowed(Protocol::CS2, Mode::StepFailed), allowed, "{}", function.name(Version::Fmi2));
    }
}
