"""The Python interface `chassis_fmu`: `Scenario`, `Env`, `trim` and `linearize`, with the FMUs of the library.

Runs that make the same calls are bit-identical, so most comparisons are exact.
"""

from __future__ import annotations

import csv
import json
import math
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import joblib
import numpy as np
import optuna
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

import chassis_fmu as cf
from chassis_fmu.scenario import worker_program
from tests.study_system import build, write

ROOT = Path(__file__).parents[2]
STEP_STEER = ROOT / "scenarios/rescue_vehicle_step_steer.toml"
BRAKING = ROOT / "scenarios/esp_car_braking.toml"

# Makes the driver steer within the short run.
STEERING = {"driver:steer.start": 0.1}
AXLES = {f"plant:steer.{axle}": (-1.0, 1.0) for axle in ("front", "middle", "rear")}
BODY = ("plant:vehicle.yaw_rate", "plant:vehicle.sideslip", "body.roll_acceleration")

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def steer() -> cf.Scenario:
    return cf.Scenario(STEP_STEER, stop=0.3)


@pytest.fixture(scope="module")
def brake() -> cf.Scenario:
    return cf.Scenario(BRAKING, stop=0.2)


@pytest.fixture(scope="module")
def plain(steer: cf.Scenario) -> dict[str, Array]:
    """Return the signals of the run without an agent."""
    table = steer.simulate(STEERING, case="coordination")
    return {name: table[name].to_numpy() for name in table.column_names}


def environment(loop: cf.Scenario, **options: Any) -> cf.Env:
    standard = {"act": AXLES, "observe": BODY, "reward": "body.roll_acceleration"}
    return cf.Env(loop, **{**standard, "case": "coordination", "values": STEERING, **options})


def wired(plain: dict[str, Array]) -> Array:
    """Return the steering angle for each step: it is in the next row, because the steering steps first."""
    return np.column_stack([plain[f"steer.{axle}"][1:] for axle in ("front", "middle", "rear")])


def observed(plain: dict[str, Array]) -> Array:
    return np.column_stack([plain[name.removeprefix("plant:")] for name in BODY])


def play(env: cf.Env, actions: Array) -> Array:
    """Return the observations of an episode, beginning with the observation before the first action."""
    observations = [env.reset()[0]]
    for number, action in enumerate(actions):
        observation, _, terminated, truncated, _ = env.step(action)
        observations.append(observation)
        assert not terminated
        assert truncated == (number == len(actions) - 1)
    return np.array(observations)


def test_the_package_loads_nothing_before_it_is_used() -> None:
    code = (
        "import sys, chassis_fmu; print([n for n in ('numpy', 'pyarrow', 'gymnasium', 'control') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "python", capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert set(cf.__all__) <= set(dir(cf))
    with pytest.raises(AttributeError, match="Environment"):
        cf.Environment  # noqa: B018


def test_the_fmus_of_the_library_are_found() -> None:
    found = cf.fmus()
    assert {"RescueVehicle", "EspCar"} <= set(found)
    assert all(path.is_file() for path in found.values())


def test_signals_are_those_of_the_command(steer: cf.Scenario, plain: dict[str, Array], tmp_path: Path) -> None:
    """Reference: the CSV file of `chassis run` for a scenario with the values in it; its numbers have all digits."""
    text = STEP_STEER.read_text(encoding="utf-8").replace('"steer.start" = 5.0', '"steer.start" = 0.1')
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(text, encoding="utf-8")
    folder = next(iter(cf.fmus().values())).parent
    out = tmp_path / "out"
    options: list[str | Path] = ["--stop", "0.3", "--seeds", "1", "--fmus", folder, "--out", out]
    command: list[str | Path] = [worker_program(), "run", scenario, "--no-page", *options]
    subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    file = next(out.rglob("coordination*.csv"))
    names = file.read_text(encoding="utf-8").splitlines()[0].split(",")
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    for index, name in enumerate(names):
        np.testing.assert_array_equal(rows[:, index], plain[name])
    assert steer.simulate(STEERING, case="coordination").schema.field("body.roll").metadata == {b"unit": b"rad"}


def test_metrics_are_those_of_the_recording(steer: cf.Scenario, plain: dict[str, Array]) -> None:
    """Reference: the root mean square in numpy, whose sum of 301 squares is rounded 301 times: 301 * 2^-53 < 1e-13."""
    numbers = steer.run(STEERING, case="coordination")
    for metric in ("roll", "roll_acceleration", "heave_acceleration"):
        expected = math.sqrt(np.mean(plain[f"body.{metric}"] ** 2))
        assert numbers[f"{metric}_rms"] == pytest.approx(expected, rel=1e-13)


def test_processes_and_pickles_do_not_change_the_bits(steer: cf.Scenario) -> None:
    values = [{"driver:steer.start": start} for start in (0.0, 0.1, 0.2)]
    here = steer.run_many(values, case="coordination", seed=2)
    there = steer.run_many(values, case="coordination", seed=2, workers=2)
    copied = pickle.loads(pickle.dumps(steer)).run_many(values, case="coordination", seed=2)
    numbers = [[outcome.numbers for outcome in outcomes] for outcomes in (here, there, copied)]
    assert numbers[0] == numbers[1] == numbers[2]
    assert None not in numbers[0][0]
    assert len(set(numbers[0])) == 3
    assert [outcome.sample for outcome in there] == [0, 1, 2]


@pytest.mark.parametrize("workers", [None, 2])
def test_progress_is_the_number_of_finished_runs(steer: cf.Scenario, workers: int | None) -> None:
    told: list[int] = []
    steer.run_many([STEERING] * 3, workers=workers, progress=told.append)
    assert told == [1, 2, 3]


@pytest.mark.parametrize("workers", [None, 1])
def test_an_exception_of_progress_ends_the_runs(steer: cf.Scenario, workers: int | None) -> None:
    told: list[int] = []

    def progress(count: int) -> None:
        told.append(count)
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        steer.run_many([STEERING] * 20, workers=workers, progress=progress)
    assert told == [1]


def test_another_thread_goes_on_during_a_run(tmp_path: Path) -> None:
    inside, go = tmp_path / "inside", tmp_path / "go"
    # A step that waits for a file, which another thread of this process writes after the step has begun. If the step
    # held Python's lock, the thread could not run, and the step would fail after a minute.
    waits = f'for (int n = 0; access("{go}", 0); n++) {{ if (n > 60000) return 3; usleep(1000); }}'
    build(tmp_path, before=f'FILE *f = fopen("{inside}", "w"); if (f) fclose(f); {waits}')
    write(tmp_path, "")
    loop = cf.Scenario(tmp_path / "function.toml", fmus=[tmp_path / "fmus"])

    def answer() -> None:
        while not inside.exists():
            time.sleep(0.001)
        go.touch()

    other = threading.Thread(target=answer, daemon=True)
    other.start()
    assert loop.run()["y"] == 1.0 + 20.0 + 300.0
    other.join()


class Objective:
    """The objective that Optuna minimizes; it can be pickled for other processes."""

    def __init__(self, loop: cf.Scenario) -> None:
        self.loop = loop

    def __call__(self, trial: Any) -> float:
        start = trial.suggest_float("start", 0.0, 0.2)
        return self.loop.run({"driver:steer.start": start}, case="coordination")["roll_rms"] or math.nan


def test_joblib_and_optuna_can_send_a_scenario_to_other_processes(steer: cf.Scenario) -> None:
    values = [{"driver:steer.start": start} for start in (0.0, 0.1, 0.2)]
    here = [steer.run(v, case="coordination") for v in values]
    there = joblib.Parallel(n_jobs=2)(joblib.delayed(steer.run)(v, case="coordination") for v in values)
    assert there == here
    found = []
    for objective in (Objective(steer), pickle.loads(pickle.dumps(Objective(steer)))):
        study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=1))
        study.optimize(objective, n_trials=3)
        found.append([trial.value for trial in study.trials])
    assert found[0] == found[1]


def test_errors_say_what_and_where(steer: cf.Scenario, tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text(STEP_STEER.read_text(encoding="utf-8").replace("stop = 20.0", 'stop = "late"'), encoding="utf-8")
    with pytest.raises(cf.ScenarioError, match=r"broken\.toml:11:8: `stop` must be a number"):
        cf.Scenario(file)
    with pytest.raises(cf.ScenarioError, match="unknown case 'best', expected one of 'individual', 'coordination'"):
        steer.run(case="best")
    with pytest.raises(cf.ScenarioError, match=r'"steer\.start", expected "component:variable"'):
        steer.run({"steer.start": 1.0})
    with pytest.raises(cf.ScenarioError, match=r"unknown component `drver`, .* did you mean `driver`"):
        steer.run({"drver:steer.start": 1.0})
    other: Any = (100, "km/h")
    executions: list[Callable[[dict[str, Any]], object]] = [steer.run, steer.simulate, steer.session]
    executions.append(lambda values: steer.run_many([values], workers=1))
    for execute in executions:
        with pytest.raises(cf.ScenarioError, match=r"no parameter `steer\.strat`; did you mean `steer\.start`"):
            execute({"driver:steer.strat": 1.0})
        with pytest.raises(
            TypeError, match=r"`driver:speed\.initial` must be a number in the unit .* got \(100, 'km/h'\)"
        ):
            execute({"driver:speed.initial": other})
    with pytest.raises(cf.ScenarioError, match="point is 'x', but the scenario has no points: leave it out"):
        steer.run(point="x")
    with pytest.raises(cf.ScenarioError, match="unknown seed 77, expected one of 1"):
        steer.run(seed=77)
    with pytest.raises(cf.RunError, match=r"rejected: .*`speed\.initial`") as caught:
        steer.run({"driver:speed.initial": -1e9})
    assert (caught.value.status, caught.value.time) == ("rejected", None)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.status) == (str(caught.value), "rejected")


def test_a_scenario_without_seeds_takes_none(tmp_path: Path) -> None:
    build(tmp_path)
    write(tmp_path, "")
    scenario = cf.Scenario(tmp_path / "function.toml", fmus=[tmp_path / "fmus"])
    with pytest.raises(cf.ScenarioError, match="seed is 3, but the scenario has no seeds: leave it out"):
        scenario.run(seed=3)
    assert scenario.run()["y"] is not None


@pytest.mark.filterwarnings("ignore:.*A Box observation space m:UserWarning")
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized space:UserWarning")
@pytest.mark.filterwarnings("ignore:.*alternative render modes:UserWarning")
def test_gymnasium_accepts_the_environment(steer: cf.Scenario) -> None:
    """Ignores warnings, which recommend registered environments, and normalized spaces instead of physical units."""
    check_env(environment(steer, act={"plant:steer.front": (-0.1, 0.2)}))


def test_actions_of_the_wires_give_the_plain_run(steer: cf.Scenario, plain: dict[str, Array]) -> None:
    env = environment(steer)
    np.testing.assert_array_equal(play(env, wired(plain)), observed(plain))
    # Different actions give a different run.
    other = play(env, 0.5 * wired(plain))
    assert not np.array_equal(other, observed(plain))
    # After a reset, instances behave bit-identically to new ones, whatever happened before.
    np.testing.assert_array_equal(play(env, wired(plain)), observed(plain))
    env.reset()
    env.step(np.ones(3))
    np.testing.assert_array_equal(play(env, 0.5 * wired(plain)), other)
    np.testing.assert_array_equal(play(environment(steer), 0.5 * wired(plain)), other)


def test_a_constant_action_of_the_wire_gives_the_plain_run(steer: cf.Scenario, plain: dict[str, Array]) -> None:
    """Uses the speed, which is constant in this maneuver."""
    speed = steer.variable("driver:speed.initial").value
    assert isinstance(speed, float)
    env = environment(steer, act={"plant:driver.speed": (0.0, 50.0)})
    np.testing.assert_array_equal(play(env, np.full((300, 1), speed)), observed(plain))


def test_a_period_holds_the_action(steer: cf.Scenario) -> None:
    actions = np.array([[0.1], [-0.05], [0.2]])
    act = {"plant:steer.front": (-1.0, 1.0)}
    coarse = environment(steer, act=act, period=0.1)
    fine = environment(steer, act=act)
    np.testing.assert_array_equal(play(coarse, actions), play(fine, np.repeat(actions, 100, axis=0))[::100])
    assert coarse.reset()[1] == {"time": 0.0}
    assert coarse.step(actions[0])[4] == {"time": 0.1}
    with pytest.raises(cf.ScenarioError, match=r"0\.00015 s; it must be a positive multiple .* 0\.001 s"):
        environment(steer, period=0.00015)


def test_actions_are_clipped_to_the_limits(steer: cf.Scenario) -> None:
    env = environment(steer, act={"plant:steer.front": (-0.1, 0.1)})
    clipped = play(env, np.full((300, 1), 0.1))
    np.testing.assert_array_equal(play(env, np.full((300, 1), np.inf)), clipped)


def test_a_boolean_input_is_true_above_one_half() -> None:
    """In the case `individual` the yaw control is always on."""
    loop = cf.Scenario(ROOT / "scenarios/esp_car_step_steer.toml", stop=0.3)
    plain = loop.simulate(STEERING, case="individual")["vehicle.yaw_rate"].to_numpy()
    options: dict[str, Any] = {"act": ["yaw_control:enable.yaw_control"], "observe": ["vehicle.yaw_rate"]}
    env = environment(loop, **options, reward="vehicle.yaw_rate", case="individual")
    assert (env.action_space.low.item(), env.action_space.high.item()) == (0.0, 1.0)
    np.testing.assert_array_equal(play(env, np.full((300, 1), 0.6))[:, 0], plain)
    assert not np.array_equal(play(env, np.full((300, 1), 0.5))[:, 0], plain)


def test_rewards_and_ends_are_those_asked_for(steer: cf.Scenario, plain: dict[str, Array]) -> None:
    actions = wired(plain)
    env = environment(steer)
    env.reset()
    rewards = [float(env.step(action)[1]) for action in actions]
    assert rewards == plain["body.roll_acceleration"][1:].tolist()

    def reward(before: cf.env.Signals, action: Array, after: cf.env.Signals) -> float:
        return after["body.roll_acceleration"] - before["body.roll_acceleration"] + float(action[0])

    rate = float(plain["vehicle.yaw_rate"][-50])
    env = environment(steer, reward=reward, terminate=lambda signals: signals["plant:vehicle.yaw_rate"] == rate)
    env.reset()
    done = [env.step(action) for action in actions]
    acceleration = plain["body.roll_acceleration"]
    assert [step[1] for step in done] == (acceleration[1:] - acceleration[:-1] + actions[:, 0]).tolist()
    assert [number for number, step in enumerate(done) if step[2]] == [len(actions) - 50]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(actions[0])


def test_an_environment_goes_on_after_a_failure(steer: cf.Scenario, plain: dict[str, Array]) -> None:
    act = {"plant:suspension_force.fl": (-1e308, 1e308)}
    env = environment(steer, act=act)
    first, _ = env.reset()
    env.step(np.array([0.0]))
    with pytest.raises(cf.RunError, match=r"diverged at 0\.001 s: .*plant") as caught:
        env.step(np.array([1e308]))
    assert caught.value.status == "diverged"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.array([0.0]))
    again, _ = env.reset()
    np.testing.assert_array_equal(first, again)
    forces = plain["suspension_force.fl"][1:, None]
    np.testing.assert_array_equal(play(env, forces), observed(plain))


def test_names_of_an_environment_are_checked(steer: cf.Scenario) -> None:
    for options, message in (
        ({"act": ["plant:steer.front"]}, r"no limits for the input `plant:steer\.front`; give them: .*, in rad"),
        ({"act": {"plant:steer.front": (1.0, 1.0)}}, r"limits of `plant:steer\.front` are \(1\.0, 1\.0\)"),
        ({"act": {"plant:steer.frnt": (0.0, 1.0)}}, r"RescueVehicle has no input `steer\.frnt`"),
        ({"act": {"truck:steer.front": (0.0, 1.0)}}, "no component `truck`"),
        ({"act": {"driver:steer.start": (0.0, 1.0)}}, r"`steer\.start` is a parameter; only inputs"),
        ({"act": {}}, "`act` is empty"),
        ({"observe": []}, "`observe` is empty"),
        ({"observe": ["plant:body.pitch"]}, r"records no signal `plant:body\.pitch`; add it to \[record\]"),
        ({"reward": "road:body.roll"}, r"records no signal `road:body\.roll`"),
    ):
        with pytest.raises(cf.ScenarioError, match=message):
            environment(steer, **options)
    env = environment(steer)
    env.reset()
    with pytest.raises(ValueError, match=r"the shape \(2,\); give a number for each of plant:steer"):
        env.step(np.zeros(2))


def test_a_session_goes_back_to_any_step(brake: cf.Scenario) -> None:
    """Reference: the run without going back. The random numbers of its road are part of the state."""
    run = brake.index("coordination", "rough", 3)
    columns = [i for i, slot in enumerate(brake.plan.runs[run].columns) if slot is not None]
    times, expected = brake.record((), run)
    session = brake.session(run=run, columns=columns)
    rows = [session.read()]
    keys = [session.save()]
    while not session.is_over:
        session.step()
        rows.append(session.read())
        if session.steps == 50:
            keys.append(session.save())
    np.testing.assert_array_equal(np.array(rows).T, [expected[i] for i in columns])
    for key, number in zip(reversed(keys), (50, 0), strict=True):
        session.restore(key)
        assert (session.steps, session.time) == (number, times[number])
        session.step(30)
        np.testing.assert_array_equal(session.read(), rows[number + 30])
    session.free(keys[0])
    with pytest.raises(cf.ScenarioError, match="no saved state 0"):
        session.restore(keys[0])


@pytest.mark.parametrize("values", [{}, {"driver.speed": 9.7}])
def test_linear_models_are_those_of_the_command(values: dict[str, float]) -> None:
    """Reference: the JSON of `cargo fmu linearize`, whose numbers have all digits."""
    fmu = cf.fmus()["RescueVehicle"]
    settings = [f"--set={name}={value}" for name, value in values.items()]
    command: list[str | Path] = [worker_program(), "linearize", fmu, "--json", *settings]
    model = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    for given in ("RescueVehicle", fmu):
        system = cf.linearize(given, values)
        for name in "ABCD":
            np.testing.assert_array_equal(getattr(system, name), np.array(model[name]))
        for kind in ("state", "input", "output"):
            names = [name.replace(".", "_") for name in model[f"{kind}s"]]
            assert getattr(system, f"{kind}_labels") == names
    assert system.name == "RescueVehicle"


def test_errors_of_linearizations_say_what_to_do() -> None:
    with pytest.raises(cf.ScenarioError, match=r"Truck: neither a file nor one of the FMUs of the library \(.*EspCar"):
        cf.linearize("Truck")
    with pytest.raises(cf.ScenarioError, match=r"RescueVehicle\.fmu: .*driver\.sped"):
        cf.linearize("RescueVehicle", {"driver.sped": 1.0})


def test_steady_states_are_equilibria_of_linear_models() -> None:
    """Reference: the yaw gain in closed form, u/(L + K u^2), with the values in the car's README."""
    steady = cf.trim("BicycleCar", {"steer.front": 0.02})
    assert steady.states["vehicle.yaw_rate"] == pytest.approx(0.02 * 5.192615, rel=1e-6)
    assert steady.drifting == ("vehicle.yaw", "vehicle.position_x", "vehicle.position_y")
    assert steady.held == steady.undetermined == ()
    assert steady.residual <= 1e-10
    assert steady.growth is not None
    assert steady.growth < 0.0
    assert steady.inputs == {}
    assert steady.starts["steer.front"] == 0.02


def test_free_inputs_hold_a_speed() -> None:
    steady = cf.trim("EspCar", {"driver.speed": 20.0, "steer.front": 0.05})
    (torque,) = set(steady.inputs.values())
    assert list(steady.inputs) == [f"drive_torque.{wheel}" for wheel in ("fl", "fr", "rl", "rr")]
    assert steady.held == ("vehicle.speed",)
    assert torque > 1.0
    rear = cf.trim("EspCar", {"driver.speed": 20.0, "steer.front": 0.05}, free=["drive_torque.rl", "drive_torque.rr"])
    assert list(rear.inputs) == ["drive_torque.rl", "drive_torque.rr"]
    assert 1.5 * torque < rear.inputs["drive_torque.rl"] < 2.5 * torque
    model = cf.linearize("EspCar", {"driver.speed": 20.0, "steer.front": 0.05}, trim=True)
    start = cf.linearize("EspCar", steady.starts)
    np.testing.assert_array_equal(model.A, start.A)


def test_errors_of_trims_name_the_state() -> None:
    with pytest.raises(cf.ScenarioError, match=r"EspCar\.fmu: [^`]*`vehicle\.speed` cannot rest"):
        cf.trim("EspCar", {"brake_torque.fl": 100.0, "drive_torque.fl": 0.0})
    with pytest.raises(ValueError, match="`free` needs `trim=True`"):
        cf.linearize("EspCar", free=["drive_torque.fl"])


def test_masters_and_other_values_start_steady(
    tmp_path: Path, run_by_both_masters: Callable[[Path, Path], Path]
) -> None:
    """Both masters start in bit-identical steady states.

    A run with a changed value starts in a steady state for this value.
    """
    file = tmp_path / "turn.toml"
    file.write_text(STEADY, encoding="utf-8")
    with run_by_both_masters(file, cf.fmus()["RescueVehicle"].parent).open(encoding="utf-8") as text:
        rolls = [float(row["body.roll"]) for row in csv.DictReader(text)]
    assert rolls[0] > 0.01
    np.testing.assert_allclose(rolls, rolls[0], rtol=0.0, atol=1e-10)
    speed = {"driver:speed.initial": 10.0}
    outcome = cf.Scenario(file, fmus=[cf.fmus()["RescueVehicle"].parent]).simulate(speed)
    slower = np.asarray(outcome["body.roll"])
    steady = cf.trim("RescueVehicle", {"driver.speed": 10.0, "steer.front": 0.02})
    np.testing.assert_allclose(slower, steady.states["body.roll"], rtol=0.0, atol=1e-10)
    assert slower[0] < rolls[0]


def test_a_steady_state_is_that_of_the_converted_inputs(tmp_path: Path) -> None:
    """A connection with a factor gives the steering angle; the reference is the steady state for the angle itself."""
    file = tmp_path / "turn.toml"
    connection = """[[connection]]
from = "driver:driver.speed"
to = "plant:steer.front"
factor = 0.001
convert = false
[[case]]"""
    file.write_text(STEADY.replace('"steer.front" = 0.02\n', "").replace("[[case]]", connection), encoding="utf-8")
    rolls = np.asarray(cf.Scenario(file, fmus=[cf.fmus()["RescueVehicle"].parent]).simulate()["body.roll"])
    steady = cf.trim("RescueVehicle", {"driver.speed": 14.0, "steer.front": 0.014})
    np.testing.assert_allclose(rolls, steady.states["body.roll"], rtol=0.0, atol=1e-10)


STEADY = """
title = "Turn"
reference = "None: a test."
[simulation]
stop = 0.5
step = 0.001
[[component]]
name = "driver"
fmu = "Driver"
parameters = { "speed.initial" = 14.0 }
[[component]]
name = "plant"
fmu = "RescueVehicle"
start = "steady"
[component.inputs]
"steer.front" = 0.02
"steer.middle" = 0.0
"steer.rear" = 0.0
"road_height.*" = 0.0
"road_friction.*" = 1.0
"suspension_force.*" = 0.0
[[case]]
name = "only"
title = "Turn"
[record]
signals = ["body.roll", "vehicle.yaw_rate"]
"""
