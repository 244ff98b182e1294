//! Steps that fail.

use fmi2::calls::{Function, Mode};

use crate::models::{CartPair, Fragile, Unit, refused};

#[test]
fn a_step_that_is_not_finite_restores_what_was_before() {
    let mut unit = Unit::<Fragile>::ready();
    unit.set("dividend", 3.0).unwrap();
    unit.step(0.1).unwrap();
    unit.set("divisor", 0.0).unwrap();
    let (before, bits) = (unit.0.snapshot().unwrap(), unit.bits());
    assert_eq!(
        refused(unit.step(0.3)),
        "fmi2DoStep: 'quotient' became inf at 0.1 s; the state at 0.1 s was restored and the instance cannot step on"
    );
    assert_eq!(unit.0.mode(), Mode::StepFailed);
    assert_eq!(unit.0.time(), 0.1);
    assert_eq!(unit.bits(), bits);
    assert!(refused(unit.step(0.1)).starts_with("fmi2DoStep called in Step Failed, allowed in Step Mode"));
    assert!(refused(unit.set("divisor", 1.0)).starts_with("fmi2SetReal called in Step Failed"));
    // A saved state brings it back, and nothing of the failed step is left in the memory.
    unit.0.restore(&before).unwrap();
    unit.set("divisor", 2.0).unwrap();
    unit.step(0.1).unwrap();
    assert_eq!((unit.get("quotient"), unit.get("sum_of_quotients")), (1.5, 4.5));
}

#[test]
fn a_later_sample_of_a_step_may_fail_and_all_of_them_are_undone() {
    // The product of dividends overflows in the fourth sample, at 0.3 s: 1e90^4 > 1.8e308.
    let mut unit = Unit::<Fragile>::ready();
    unit.set("dividend", 1e90).unwrap();
    let (before, bits) = (unit.bytes(), unit.bits());
    assert_eq!(
        refused(unit.step(1.0)),
        "fmi2DoStep: 'product' became inf at 0.30000000000000004 s; the state at 0 s was restored and the instance \
         cannot step on"
    );
    assert_eq!(unit.bits(), bits);
    let before = unit.0.deserialize(&before).unwrap();
    unit.0.restore(&before).unwrap();
    unit.step(0.1).unwrap();
    assert_eq!(unit.get("sum_of_quotients"), 1e90);
}

#[test]
fn a_unit_may_refuse_a_sample() {
    let mut unit = Unit::<Fragile>::ready();
    unit.step(0.2).unwrap();
    unit.set("divisor", -2.0).unwrap();
    let bits = unit.bits();
    assert_eq!(
        refused(unit.step(0.1)),
        "fmi2DoStep: 'divisor' = -2 at 0.2 s, 0 or more was expected; the state at 0.2 s was restored and the \
         instance cannot step on"
    );
    assert_eq!((unit.0.mode(), unit.bits()), (Mode::StepFailed, bits));
}

#[test]
fn a_plant_that_overflows_restores_its_state() {
    let mut unit = Unit::<CartPair>::ready();
    unit.step(0.5).unwrap();
    unit.set("cart_force.l", f64::MAX).unwrap();
    let bits = unit.bits();
    let message = refused(unit.step(1e3));
    assert!(message.starts_with("fmi2DoStep: 'cart_position.l' became "), "{message}");
    assert!(message.ends_with(" at 1000.5 s; the state at 0.5 s was restored and the instance cannot step on"));
    assert_eq!((unit.0.mode(), unit.bits(), unit.0.time()), (Mode::StepFailed, bits, 0.5));
    unit.0.terminate().unwrap();
    assert_eq!(unit.0.mode(), Mode::Terminated);
    unit.0.reset().unwrap();
    unit.0.enter_initialization().unwrap();
    unit.0.exit_initialization().unwrap();
    unit.step(0.5).unwrap();
}

#[test]
fn after_a_failed_step_only_reading_restoring_and_ending_is_left() {
    use Function as F;
    for &function in F::ALL {
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
        assert_eq!(function.allowed(Mode::StepFailed), allowed, "{}", function.name());
    }
}
