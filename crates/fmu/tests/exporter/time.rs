//! Time: integration steps, samples, rejected steps, order of the integrator.

use fmu::testing::calls::Mode;

use crate::models::{CartPair, Fmu, Sampler, error_of, integration_steps};

#[test]
fn a_step_is_divided_into_the_fewest_equal_parts_not_longer_than_max_step() {
    // Each case: length h of the step, `max_step`, and the number of parts, max(1, ceil(h/max_step - 1e-6)).
    let cases = [
        (1e-3, 1e-3, 1),
        (1e-3, 0.25e-3, 4),
        (1e-3, 0.3e-3, 4),
        (1e-3, 1.0, 1),
        (1e-9, 1e-3, 1),
        (1e-3 * (1.0 + 0.9e-6), 1e-3, 1),
        (1e-3 * (1.0 + 1.1e-6), 1e-3, 2),
        (0.25 * (1.0 + 0.9e-7), 0.025, 10),
        (0.25 * (1.0 + 1.1e-7), 0.025, 11),
    ];
    for (step, max_step, parts) in cases {
        let mut fmu = Fmu::<CartPair>::starting(0.0, &[("max_step", max_step)]);
        integration_steps();
        fmu.step(step).unwrap();
        assert_eq!(integration_steps(), parts, "{step} s by {max_step} s");
    }
}

#[test]
fn a_step_computed_as_a_difference_of_times_gets_no_extra_part() {
    for start in [0.0, 1e4] {
        let mut fmu = Fmu::<CartPair>::starting(start, &[("max_step", 2.5e-4)]);
        integration_steps();
        let time = |k: u32| start + f64::from(k) * 1e-3;
        for k in 0..5000 {
            fmu.0.do_step(time(k), time(k + 1) - time(k)).unwrap();
            assert_eq!(integration_steps(), 4, "step {k} from {start} s");
        }
    }
}

#[test]
fn samples_are_due_at_multiples_of_the_sample_time_after_the_start() {
    // Steps of 3 ms, samples every 10 ms: in exact arithmetic, ceil(3k/10) samples are before t = 3k ms.
    for start in [0.0, 1e4, -7.5] {
        let mut fmu = Fmu::<Sampler>::starting(start, &[]);
        for k in 0..1000_u32 {
            fmu.0.do_step(start + f64::from(3 * k) * 1e-3, 3e-3).unwrap();
            let samples = (3 * (k + 1)).div_ceil(10);
            assert_eq!(fmu.get("filter_count"), f64::from(samples), "after {} ms from {start} s", 3 * (k + 1));
            assert_eq!(fmu.get("filter_time"), start + f64::from(samples - 1) * 0.01);
        }
    }
}

#[test]
fn a_long_step_takes_all_samples_that_are_due_with_the_same_inputs() {
    let mut fmu = Fmu::<Sampler>::ready();
    fmu.set("filter_input", 0.4).unwrap();
    fmu.step(0.095).unwrap();
    assert_eq!(fmu.get("filter_count"), 10.0);
    assert_eq!(fmu.get("filter_time"), 9.0 * 0.01);
    // Sum of 10 products 2*0.4*0.01, two past inputs times 0.05 s, and the offset 1, with a few roundings.
    assert!((fmu.get("filter_output") - (0.08 + 0.04 + 1.0)).abs() < 1e-15);
    // The next sample is due at 0.1 s. A step that ends there does not take it, but the following step does.
    fmu.step(0.005).unwrap();
    assert_eq!(fmu.get("filter_count"), 10.0);
    fmu.step(1e-6).unwrap();
    assert_eq!(fmu.get("filter_count"), 11.0);
}

#[test]
fn a_sample_within_the_slack_before_the_end_of_a_step_belongs_to_the_next_one() {
    // Tolerance: 1e-6 min(sample_time, h) = 1e-8 s.
    for (over, count) in [(0.9e-8, 1.0), (1.1e-8, 2.0)] {
        let mut fmu = Fmu::<Sampler>::ready();
        fmu.step(0.01 + over).unwrap();
        assert_eq!(fmu.get("filter_count"), count, "{over}");
        fmu.step(0.005).unwrap();
        assert_eq!(fmu.get("filter_count"), 2.0);
    }
}

#[test]
fn one_sample_per_step_over_a_long_run_whose_times_are_sums() {
    // 1e5 rounding errors in the master's sum are far less than the tolerance of 1e-9 s.
    let mut fmu = Fmu::<Sampler>::starting(0.0, &[("sample_time", 1e-3)]);
    let mut time = 0.0;
    for k in 1..=100_000 {
        fmu.0.do_step(time, 1e-3).unwrap();
        time += 1e-3;
        assert_eq!(fmu.get("filter_count"), f64::from(k));
    }
}

/// 1e7 s (about 116 days), and a Unix time in 2023. There, start + k h is rounded to 2e-9 and 2e-7 s.
const LARGE: [f64; 2] = [1e7, 1.7e9];

#[test]
fn steps_and_samples_are_counted_at_large_times_too() {
    // Steps and sample times in units of 0.1 ms: equal, shorter, longer, not multiples of each other.
    for (step, sample) in [(10, 10), (10, 100), (30, 100), (7, 10), (100, 10), (13, 7)] {
        for start in LARGE {
            let mut fmu = Fmu::<Sampler>::starting(start, &[("sample_time", f64::from(sample) * 1e-4)]);
            let h = f64::from(step) * 1e-4;
            for k in 0..5000_u32 {
                fmu.0.do_step(start + f64::from(k) * h, h).unwrap();
                let samples = ((k + 1) * step).div_ceil(sample);
                assert_eq!(fmu.get("filter_count"), f64::from(samples), "step {k} of {h} s from {start} s");
            }
        }
    }
}

#[test]
fn large_times_are_those_of_the_instance_within_four_units_in_the_last_place() {
    for start in LARGE {
        let ulp = start.next_up() - start;
        for (offset, is_accepted) in [(4.0, true), (-4.0, true), (5.0, false), (-5.0, false)] {
            let mut fmu = Fmu::<CartPair>::starting(start, &[]);
            // With this step, 1e-6 of the step is less than a unit in the last place of the time.
            let result = fmu.0.do_step(start + offset * ulp, 1e-4);
            assert_eq!(result.is_ok(), is_accepted, "{offset} units at {start} s");
        }
        // Steps reach the stop time in spite of rounding errors; a further step is rejected.
        let mut fmu = Fmu::<Sampler>::new();
        fmu.0.setup_experiment(start, Some(start + 1.0)).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu.0.exit_initialization().unwrap();
        for k in 0..1000 {
            fmu.0.do_step(start + f64::from(k) * 1e-3, 1e-3).unwrap();
        }
        assert!(error_of(fmu.0.do_step(start + 1.0, 1e-3)).contains("goes past stopTime"));
    }
}

#[test]
fn steps_shorter_than_the_rounding_of_the_time_are_rejected() {
    let mut fmu = Fmu::<CartPair>::starting(1.7e9, &[]);
    let ulp = 2.0_f64.powi(-22);
    fmu.0.do_step(1.7e9, 2.0 * ulp).unwrap();
    let before = fmu.bytes();
    assert!(error_of(fmu.0.do_step(1.7e9, ulp)).contains("does not advance the time"));
    assert_eq!(fmu.bytes(), before);
}

#[test]
fn outputs_hold_their_start_values_until_the_first_sample() {
    let mut fmu = Fmu::<Sampler>::initializing(0.0);
    assert_eq!(fmu.get("filter_output"), 0.5);
    fmu.0.exit_initialization().unwrap();
    assert_eq!((fmu.get("filter_output"), fmu.get("filter_time")), (0.5, -1.0));
    fmu.set("filter_input", 3.0).unwrap();
    assert_eq!(fmu.get("filter_output"), 0.5);
    fmu.step(0.001).unwrap();
    assert_eq!((fmu.get("filter_count"), fmu.get("filter_time")), (1.0, 0.0));
    let held = fmu.get("filter_output");
    assert_ne!(held, 0.5);
    // Outputs are held between samples, even if an input changes.
    fmu.set("filter_input", -3.0).unwrap();
    fmu.step(0.005).unwrap();
    assert_eq!(fmu.get("filter_output"), held);
}

#[test]
fn impossible_steps_are_rejected_and_change_nothing() {
    for step in [0.0, -0.0, -1e-3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut fmu = Fmu::<CartPair>::ready();
        fmu.step(0.01).unwrap();
        let before = fmu.bytes();
        let message = error_of(fmu.step(step));
        assert_eq!(message, format!("fmi2DoStep: communicationStepSize must be finite and above 0, got {step} s"));
        assert_eq!(fmu.bytes(), before);
        assert_eq!(fmu.0.mode(), Mode::Step);
        fmu.step(0.01).unwrap();
    }
    let mut fmu = Fmu::<Sampler>::starting(1e4, &[]);
    let before = fmu.bytes();
    assert_eq!(
        error_of(fmu.step(1e-13)),
        "fmi2DoStep: a step of 0.0000000000001 s at 10000 s does not advance the time"
    );
    assert_eq!(fmu.bytes(), before);
}

#[test]
fn the_communication_point_is_that_of_the_instance_within_a_millionth_of_the_step() {
    let at = |offset: f64| {
        let mut fmu = Fmu::<CartPair>::starting(2.0, &[]);
        let before = fmu.bytes();
        let answer = fmu.0.do_step(2.0 + offset, 0.5);
        if answer.is_err() {
            assert_eq!(fmu.bytes(), before);
            assert_eq!(fmu.0.mode(), Mode::Step);
        }
        (answer, fmu.0.time())
    };
    for offset in [0.4e-6, -0.4e-6] {
        // The instance adopts the master's time.
        assert_eq!(at(offset), (Ok(()), 2.0 + offset + 0.5));
    }
    for offset in [0.6e-6, -0.6e-6, 0.5, -0.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        let message = error_of(at(offset).0);
        assert!(message.starts_with("fmi2DoStep: currentCommunicationPoint = "), "{message}");
        let rule =
            "the instance is at 2 s; the difference must not exceed 1e-6 of the step or 4 units in the last place";
        assert!(message.contains(rule), "{message}");
    }
}

#[test]
fn no_step_goes_past_the_stop_time() {
    let ready = |stop| {
        let mut fmu = Fmu::<Sampler>::new();
        fmu.0.setup_experiment(0.0, stop).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu.0.exit_initialization().unwrap();
        fmu
    };
    let mut fmu = ready(Some(1.0));
    fmu.step(0.5).unwrap();
    let before = fmu.bytes();
    let message = error_of(fmu.step(0.5 * (1.0 + 2e-6)));
    assert!(message.starts_with("fmi2DoStep: the step from 0.5 s to 1.000001"), "{message}");
    assert!(message.ends_with(" s goes past stopTime = 1 s"), "{message}");
    assert_eq!(fmu.bytes(), before);
    fmu.step(0.5 * (1.0 + 0.9e-6)).unwrap();
    error_of(fmu.step(0.1));
    ready(None).step(1e3).unwrap();
    ready(Some(f64::INFINITY)).step(1e3).unwrap();
}

#[test]
fn more_than_a_million_parts_are_rejected() {
    let mut carts = Fmu::<CartPair>::starting(0.0, &[("max_step", 1e-3)]);
    integration_steps();
    carts.step(1e3).unwrap();
    assert_eq!(integration_steps(), 1_000_000);
    let before = carts.bytes();
    assert_eq!(
        error_of(carts.step(1000.001)),
        "fmi2DoStep: a step of 1000.001 s needs 1000001 integration steps or samples; at most 1000000 are possible"
    );
    assert!(error_of(carts.step(1e300)).contains("at most 1000000"));
    assert_eq!(carts.bytes(), before);
    assert_eq!(integration_steps(), 0);

    let mut sampler = Fmu::<Sampler>::starting(0.0, &[("sample_time", 1e-3)]);
    assert!(error_of(sampler.step(1000.001)).contains("needs 1000001 "));
    sampler.step(1e3).unwrap();
    assert_eq!(sampler.get("filter_count"), 1e6);
}

#[test]
fn an_impossible_experiment_is_rejected() {
    let mut fmu = Fmu::<Sampler>::new();
    let before = fmu.bytes();
    for start in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(
            error_of(fmu.0.setup_experiment(start, None)),
            format!("fmi2SetupExperiment: startTime must be finite, got {start}")
        );
    }
    for stop in [f64::NAN, 0.9, f64::NEG_INFINITY] {
        assert_eq!(
            error_of(fmu.0.setup_experiment(1.0, Some(stop))),
            format!("fmi2SetupExperiment: stopTime must not be before startTime = 1, got {stop}")
        );
    }
    assert_eq!(fmu.bytes(), before);
    // Only the last call has an effect. The stop time may equal the start time.
    fmu.0.setup_experiment(1.0, Some(1.0)).unwrap();
    fmu.0.setup_experiment(3.0, None).unwrap();
    assert_eq!(fmu.0.time(), 3.0);
}

/// Position of the left cart at 1 s: m x'' + c x' + k x = F from rest at x(0), in closed form.
fn closed_form(m: f64, c: f64, k: f64, force: f64, x0: f64) -> f64 {
    let decay = c / (2.0 * m);
    let omega = (k / m - decay * decay).sqrt();
    let a = x0 - force / k;
    force / k + (-decay).exp() * (a * omega.cos() + a * decay / omega * omega.sin())
}

fn position_after_one_second(max_step: f64) -> f64 {
    let mut fmu = Fmu::<CartPair>::starting(0.0, &[("max_step", max_step), ("cart_position.l", 0.3)]);
    fmu.set("cart_force.l", 1.5).unwrap();
    fmu.step(1.0).unwrap();
    fmu.get("cart_position.l")
}

#[test]
fn the_integrator_has_order_four() {
    // Halving the step divides the error by 16; terms of higher order change this factor by at most 10 %.
    let exact = closed_form(2.0, 0.4, 8.0, 1.5, 0.3);
    let errors = [0.1, 0.05, 0.025].map(|step| (position_after_one_second(step) - exact).abs());
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((ratio - 16.0).abs() < 1.6, "{ratio} of {errors:?}");
    }
    // 1000 steps: the error of the method is below 1e-13, the rounding error about 1000 * 1e-16.
    assert!((position_after_one_second(1e-3) - exact).abs() < 5e-13);
}

#[test]
fn communication_steps_of_a_continuous_model_do_not_matter_where_the_integration_steps_are_the_same() {
    // 1/128 s is exact in binary, so the integration steps and their rounding errors are the same.
    let run = |steps: u32| {
        let mut fmu = Fmu::<CartPair>::starting(0.0, &[("max_step", 1.0 / 128.0)]);
        for _ in 0..steps {
            fmu.step(1.0 / f64::from(steps)).unwrap();
        }
        fmu.bits()
    };
    assert_eq!(run(1), run(128));
    assert_eq!(run(4), run(32));
}
