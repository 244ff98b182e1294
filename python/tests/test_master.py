"""The master with mock FMUs: order of calls, values on the bus, errors."""

from __future__ import annotations

import ctypes
import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from chassis_fmu.execution import __main__ as worker
from chassis_fmu.execution import clocks, fmi3, master
from chassis_fmu.execution.calls import Board
from chassis_fmu.files import results
from chassis_fmu.files.plan import Component, InputSeries, Plan, Run, Setting, Solver, Wire

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4


class StandIn:
    """A mock FMU: `step` changes `values`, and every call is recorded in a shared list."""

    def __init__(self, name: str, calls: list[str], step: Callable[[dict[int, Any], float], int]) -> None:
        self.name = name
        self.calls = calls
        self.step = step
        self.values: dict[int, Any] = {}
        self.freed = False
        self.steps: list[tuple[float, float]] = []
        self.ends_at: float | None = None
        self.is_done = True
        self.reached: float | None = None
        self.functions: Any = self
        self.component = 1
        self.clocks = clocks.Description()

    def free(self) -> None:
        self.freed = True

    def _note(self, text: str) -> int:
        self.calls.append(f"{self.name} {text}")
        return OK

    def __getattr__(self, name: str) -> Callable[..., int]:
        action = name.removeprefix("fmi2")
        if action in ("GetRealStatus", "GetBooleanStatus"):
            return self._real_status if action == "GetRealStatus" else self._boolean_status
        if action.startswith("Set") and action != "SetupExperiment":
            return lambda _c, references, n, values: self._set(action, references, n, values)
        if action.startswith("Get"):
            return lambda _c, references, n, values: self._get(action, references, n, values)
        if action == "DoStep":
            return self._do_step
        return lambda *_arguments: self._note(action)

    def _set(self, action: str, references: Any, n: int, values: Any) -> int:
        for i in range(n):
            self.values[references[i]] = values[i]
            self._note(f"{action} {references[i]} = {values[i]}")
            if isinstance(values[i], float) and not np.isfinite(values[i]):
                return ERROR
        return OK

    def _get(self, action: str, references: Any, n: int, values: Any) -> int:
        for i in range(n):
            values[i] = self.values.get(references[i], 0)
        return self._note(action)

    def _real_status(self, _component: Any, kind: int, value: Any) -> int:
        assert kind == 2
        value._obj.value = self.reached
        return OK

    def _boolean_status(self, _component: Any, kind: int, value: Any) -> int:
        assert kind == 3
        value._obj.value = int(self.reached is not None)
        return OK

    def _do_step(self, _component: Any, time: float, step: float, no_set_state: int) -> int:
        assert no_set_state == 1
        self._note(f"DoStep {time:.9g}")
        self.steps.append((time, step))
        if self.ends_at is not None and time + step > self.ends_at:
            self.reached = time + step if self.is_done else time
            self.step(self.values, step)
            return DISCARD
        return self.step(self.values, step)


def count(values: dict[int, Any], _step: float) -> int:
    """Make a step of the source, a counter."""
    values[30] = values.get(30, 0) + 1
    return OK


def integrate(values: dict[int, Any], step: float) -> int:
    """Make a step of the plant, which integrates gain * (input + bias)."""
    values[13] = values.get(13, 0.0) + step * values[10] * (values[11] + values[12])
    return OK


class System:
    """Mocks of the fixture's two components; those in `ending` end the simulation at a given time."""

    def __init__(
        self,
        source: Any = count,
        plant: Any = integrate,
        ends_at: float | None = None,
        is_done: bool = True,
        ending: tuple[str, ...] = ("source",),
    ) -> None:
        self.ends_at, self.is_done, self.ending = ends_at, is_done, ending
        self.calls: list[str] = []
        self.components: dict[str, StandIn] = {}
        self.steps = {"source": source, "plant": plant}

    def __call__(self, component: Component) -> StandIn:
        self.calls.append(f"{component.name} Instantiate")
        made = StandIn(component.name, self.calls, self.steps[component.name])
        if component.name in self.ending:
            made.ends_at, made.is_done = self.ends_at, self.is_done
        self.components[component.name] = made
        return made


@pytest.fixture
def run(scenario: Plan) -> Run:
    return scenario.runs[0]


def test_calls_are_those_of_the_algorithm(scenario: Plan, run: Run) -> None:
    system = System()
    one = replace(scenario.simulation, steps=1, stop=0.1)
    master.simulate(run, one, system)
    assert system.calls == [
        "source Instantiate",
        "plant Instantiate",
        "source SetupExperiment",
        "plant SetupExperiment",
        "source SetInteger 20 = 1",
        "plant SetReal 10 = 2.0",
        "plant SetBoolean 40 = 1",
        "plant SetString 50 = b'blue'",
        "source EnterInitializationMode",
        "plant EnterInitializationMode",
        "source GetInteger",
        "plant GetReal",
        "source GetInteger",
        "plant SetReal 12 = 0.5",
        "plant SetReal 11 = 0.0",
        "plant GetReal",
        "source ExitInitializationMode",
        "plant ExitInitializationMode",
        "source GetInteger",
        "plant GetReal",
        "source DoStep 0",
        "source GetInteger",
        "plant SetReal 11 = 1.0",
        "plant DoStep 0",
        "plant GetReal",
        "source Terminate",
        "plant Terminate",
    ]


def test_sequential_sees_fresh_outputs(scenario: Plan, run: Run) -> None:
    times, rows = master.simulate(run, scenario.simulation, System())
    assert times.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert rows[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    # Sum of step * 2 * (k + 0.5) for k = 1, 2, 3; exact up to rounding.
    assert rows[:, 1] == pytest.approx([0.0, 0.3, 0.8, 1.5], abs=1e-15)


def test_a_connection_converts_between_real_and_boolean(scenario: Plan, run: Run) -> None:
    def rise(values: dict[int, Any], _step: float) -> int:
        values[30] = values.get(30, 0.0) + 0.25
        return OK

    def follow(values: dict[int, Any], _step: float) -> int:
        values[13] = values[11]
        return OK

    source = replace(run.components[0], outputs=(replace(run.components[0].outputs[0], type="Real"),))
    wire, output = run.components[1].inputs[0], run.components[1].outputs[0]
    # The Boolean output of the plant is recorded as 0 or 1, the value that a Real input would get.
    wires = {"inputs": (replace(wire, type="Boolean"),), "outputs": (replace(output, type="Boolean"),)}
    plant = replace(run.components[1], **wires)
    converting = replace(run, components=(source, plant))
    _, rows = master.simulate(converting, replace(scenario.simulation, steps=4, stop=0.4), System(rise, follow))
    assert rows[:, 0].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert rows[:, 1].tolist() == [0.0, 0.0, 0.0, 1.0, 1.0]


def test_model_exchange_is_for_the_native_master(run: Run, tmp_path: Path) -> None:
    component = replace(run.components[0], integration=Solver("rosenbrock", 1e-6))
    with pytest.raises(master.RunError, match="only the native master integrates an FMU for model exchange"):
        master.FmpyInstance(component, tmp_path)


def test_jacobi_is_one_step_behind(scenario: Plan, run: Run) -> None:
    jacobi = replace(scenario.simulation, order="jacobi")
    _, rows = master.simulate(run, jacobi, System())
    # The same sum for k = 0, 1, 2.
    assert rows[:, 1] == pytest.approx([0.0, 0.1, 0.4, 0.9], abs=1e-15)


def test_every_records_every_nth_step(scenario: Plan, run: Run) -> None:
    sparse = replace(scenario.simulation, stop=0.5, steps=5, every=2)
    times, rows = master.simulate(run, sparse, System())
    assert times.tolist() == [0.0, 0.2, 0.4]
    assert rows[:, 0].tolist() == [0.0, 2.0, 4.0]


def test_columns_of_absent_components_are_left_out(scenario: Plan, run: Run) -> None:
    _, rows = master.simulate(replace(run, columns=(None, 1)), scenario.simulation, System())
    assert rows.shape == (4, 1)


def test_an_input_series_is_held_between_its_rows(scenario: Plan, run: Run) -> None:
    # The last row, at 3*0.1 = 0.30000000000000004, applies in the step that begins there.
    feed = InputSeries(2, "hold", (0.0, 0.1, 0.30000000000000004), (7.0, 8.0, 9.0))
    plant = replace(run.components[1], inputs=(replace(run.components[1].inputs[0], slot=2),))
    fed = replace(run, components=(run.components[0], plant), series=(feed,), slots=3, columns=(2, 1))
    longer = replace(scenario.simulation, steps=4, stop=0.4)
    _, rows = master.simulate(fed, longer, System())
    assert rows[:, 0].tolist() == [7.0, 7.0, 8.0, 8.0, 9.0]


def test_a_linear_input_series_has_its_value_in_the_middle_of_the_step(scenario: Plan, run: Run) -> None:
    # The signal rises from 0 to 1 in 0.2 s, jumps to 3 and falls to 1 at 0.4 s. Row 0 has its value at the start, each
    # other row its value in the middle of the step.
    feed = InputSeries(2, "linear", (0.0, 0.2, 0.2, 0.4), (0.0, 1.0, 3.0, 1.0))
    plant = replace(run.components[1], inputs=(replace(run.components[1].inputs[0], slot=2),))
    fed = replace(run, components=(run.components[0], plant), series=(feed,), slots=3, columns=(2, 1))
    longer = replace(scenario.simulation, steps=4, stop=0.4)
    _, rows = master.simulate(fed, longer, System())
    assert rows[:, 0] == pytest.approx([0.0, 0.25, 0.75, 2.5, 1.5], abs=1e-12)


def test_outputs_in_scattered_slots_arrive(scenario: Plan, run: Run) -> None:
    wires = run.components[1].outputs
    plant = replace(
        run.components[1],
        outputs=(replace(wires[0], slot=3), replace(wires[0], reference=10, slot=1)),
    )
    scattered = replace(run, components=(run.components[0], plant), slots=4, columns=(1, 3))
    _, rows = master.simulate(scattered, scenario.simulation, System())
    assert rows[:, 0].tolist() == [2.0] * 4
    assert rows[-1, 1] == pytest.approx(1.5, abs=1e-15)


def test_the_board_has_the_steps_that_are_done(scenario: Plan, run: Run) -> None:
    board, seen = Board(), []

    def look(values: dict[int, Any], step: float) -> int:
        seen.append((board.steps, board.time))
        return integrate(values, step)

    master.simulate(run, scenario.simulation, System(plant=look), board=board)
    assert seen == [(0, 0.0), (1, 0.1), (2, 0.2)]
    assert (board.steps, board.call) == (0, 0)


def test_a_warning_does_not_stop(scenario: Plan, run: Run) -> None:
    def warn(values: dict[int, Any], step: float) -> int:
        return integrate(values, step) or WARNING

    _, rows = master.simulate(run, scenario.simulation, System(plant=warn))
    assert rows[-1, 1] == pytest.approx(1.5, abs=1e-15)


def test_an_error_names_component_function_time_and_log(scenario: Plan, run: Run) -> None:
    def fail(values: dict[int, Any], step: float) -> int:
        if values[30] == 1:
            master._logger(None, b"source", ERROR, b"logStatusError", b"no more than ##1")
            return ERROR
        return count(values, step)

    def start(values: dict[int, Any], step: float) -> int:
        values.setdefault(30, 0)
        return fail(values, step)

    system = System(source=start)
    with pytest.raises(master.RunError) as caught:
        master.simulate(run, scenario.simulation, system)
    assert str(caught.value) == (
        "component source, fmi2DoStep at t = 0.1 s: status 3 (error)\n  log: [error, logStatusError] no more than #1"
    )
    assert all(component.freed for component in system.components.values())
    assert not any("Terminate" in call for call in system.calls)


def test_nothing_is_called_after_fatal(scenario: Plan, run: Run) -> None:
    system = System(plant=lambda _values, _step: FATAL)
    with pytest.raises(master.RunError, match="fatal"):
        master.simulate(run, scenario.simulation, system)
    assert system.calls[-1] == "plant DoStep 0"
    assert not any(component.freed for component in system.components.values())


def test_a_rejected_parameter_is_named(scenario: Plan, run: Run) -> None:
    component = run.components[1]
    bad = replace(component, parameters=(replace(component.parameters[0], value=float("inf")),))
    with pytest.raises(master.RunError, match=r"plant, fmi2SetReal at t = 0 s: status 3 \(error\), gain = inf"):
        master.simulate(replace(run, components=(run.components[0], bad)), scenario.simulation, System())


def test_a_value_that_is_not_finite_is_an_error(scenario: Plan, run: Run) -> None:
    def explode(values: dict[int, Any], _step: float) -> int:
        values[13] = float("nan")
        return OK

    with pytest.raises(master.RunError, match=r"plant, fmi2DoStep at t = 0\.1 s: output angle is nan") as caught:
        master.simulate(run, scenario.simulation, System(plant=explode))
    # The row of the start is kept.
    assert caught.value.recorded is not None
    assert caught.value.recorded[0].tolist() == [0.0]


def test_no_step_goes_beyond_the_declared_stop_time(scenario: Plan, run: Run) -> None:
    # 199 * 0.1 + 0.1 is 20.000000000000004 in double arithmetic, the only sum above 20.
    system = System()
    master.simulate(run, replace(scenario.simulation, stop=20.0, steps=200), system)
    for component in system.components.values():
        assert component.steps[:-1] == [(k * 0.1, 0.1) for k in range(199)]
        assert component.steps[-1] == (199 * 0.1, 20.0 - 199 * 0.1)
        assert all(time + step <= 20.0 for time, step in component.steps)


@pytest.mark.parametrize("order", ["sequential", "jacobi"])
@pytest.mark.parametrize(("is_done", "rows"), [(True, 3), (False, 2)])
def test_an_fmu_ends_the_simulation(scenario: Plan, run: Run, order: str, is_done: bool, rows: int) -> None:
    system = System(ends_at=0.15, is_done=is_done)
    with pytest.raises(master.RunError, match=r"source, fmi2DoStep at t = .*: the FMU ended the simulation") as caught:
        master.simulate(run, replace(scenario.simulation, order=order), system)
    assert caught.value.is_end
    assert caught.value.time == pytest.approx(0.1 * (rows - 1))
    assert caught.value.recorded is not None
    times, values = caught.value.recorded
    assert times.tolist() == [0.0, 0.1, 0.2][:rows]
    # The other component has already made the last of these steps.
    if order == "sequential":
        assert values[-1, 1] == pytest.approx(sum(0.2 * (k + 1 + 0.5) for k in range(rows - 1)))
    assert [call for call in system.calls if call.endswith("Terminate")] == ["source Terminate", "plant Terminate"]


@pytest.mark.parametrize("order", ["sequential", "jacobi"])
def test_the_first_of_two_components_that_end_in_one_step_is_named(scenario: Plan, run: Run, order: str) -> None:
    system = System(ends_at=0.15, ending=("source", "plant"))
    with pytest.raises(master.RunError, match="the FMU ended the simulation") as caught:
        master.simulate(run, replace(scenario.simulation, order=order), system)
    assert caught.value.component == "source"
    # The second component has made the step, too.
    assert [len(component.steps) for component in system.components.values()] == [2, 2]


def test_only_a_discarded_step_is_discarded(scenario: Plan, run: Run) -> None:
    with pytest.raises(master.RunError, match=r"plant, fmi2DoStep at t = 0 s: status 2 \(discard\)") as caught:
        master.simulate(run, scenario.simulation, System(plant=lambda _values, _step: DISCARD))
    assert caught.value.is_discarded
    assert not caught.value.is_end
    with pytest.raises(master.RunError, match="status 3") as caught:
        master.simulate(run, scenario.simulation, System(plant=lambda _values, _step: ERROR))
    assert not caught.value.is_discarded


def test_an_end_at_the_stop_time_is_a_whole_run(scenario: Plan, run: Run) -> None:
    times, _ = master.simulate(run, scenario.simulation, System(ends_at=0.25))
    assert len(times) == scenario.simulation.rows


def test_a_component_that_rejects_a_value_is_only_the_messenger(scenario: Plan, run: Run) -> None:
    def explode(values: dict[int, Any], _step: float) -> int:
        values[30] = float("inf")
        return OK

    real = replace(run.components[0], outputs=(replace(run.components[0].outputs[0], type="Real"),))
    system = System(source=explode)
    exploding = replace(run, components=(real, run.components[1]))
    with pytest.raises(master.RunError) as caught:
        master.simulate(exploding, scenario.simulation, system)
    assert caught.value.component == "plant"
    assert caught.value.messages == ("component source: output count is inf",)


def test_huge_finite_values_are_no_error(scenario: Plan, run: Run) -> None:
    def huge(values: dict[int, Any], _step: float) -> int:
        values[13] = values[14] = 1.7e308
        return OK

    wire = run.components[1].outputs[0]
    plant = replace(run.components[1], outputs=(wire, replace(wire, reference=14, slot=2, name="rate")))
    wide = replace(run, components=(run.components[0], plant), slots=3)
    _, rows = master.simulate(wide, scenario.simulation, System(plant=huge))
    assert rows[-1, 1] == 1.7e308


def test_an_integer_that_does_not_fit_is_an_error(scenario: Plan, run: Run) -> None:
    """Test a constant and a signal beyond 32 bits, which ctypes and NumPy would let overflow."""
    constant = Setting(name="mode", type="Integer", reference=40, value=2**31)
    constants = replace(run, components=(run.components[0], replace(run.components[1], constants=(constant,))))
    with pytest.raises(master.RunError, match=r"fmi2SetInteger.*mode = 2147483648"):
        master.simulate(constants, scenario.simulation, System())
    feed = InputSeries(slot=2, interpolation="hold", times=(0.0,), values=(2.0**31,))
    wire = Wire(reference=40, type="Integer", slot=2, name="mode")
    reader = replace(run.components[1], inputs=(*run.components[1].inputs, wire))
    fed = replace(run, components=(run.components[0], reader), series=(feed,), slots=3)
    with pytest.raises(master.RunError, match=r"fmi2SetInteger.*does not fit the type"):
        master.simulate(fed, scenario.simulation, System())


class WideLibrary:
    """A mock of an FMI 3.0 library with one Int64 variable."""

    def __init__(self) -> None:
        self.value = 0

    def __getitem__(self, name: str) -> Any:
        def access(_component: Any, _references: Any, _count: int, values: Any, _size: int) -> int:
            if name == "fmi3SetInt64":
                self.value = values[0]
            elif name == "fmi3GetInt64":
                values[0] = self.value
            return OK

        return access


def test_integers_of_64_bits_are_exact_up_to_two_to_53() -> None:
    functions = fmi3.Functions(WideLibrary(), {7: "Int64", 8: "Int32"})
    assert functions.wide == {7}
    reference = (ctypes.c_uint * 1)(7)
    for value, status in [(2**53, OK), (-(2**53), OK), (5_000_000_000, OK), (2**53 + 1, ERROR)]:
        assert functions.fmi2SetInteger(1, reference, 1, (ctypes.c_int64 * 1)(value)) == OK
        read = (ctypes.c_int64 * 1)()
        assert functions.fmi2GetInteger(1, reference, 1, read) == status
        assert status or read[0] == value


@pytest.mark.parametrize(
    ("early", "reached", "status"),
    [(False, 1.5, OK), (False, 1.49999, OK), (False, None, OK), (False, 1.2, DISCARD), (True, 1.5, DISCARD)],
)
def test_an_early_return_shows_in_its_flag_or_its_time(early: bool, reached: float | None, status: int) -> None:
    """FMI 3.0.2, section 4.2.1; an FMU that writes no time has made the step."""

    class Library:
        def __getitem__(self, _name: str) -> Any:
            def call(_component: Any, _time: float, _step: float, _final: bool, *results: Any) -> int:
                results[2]._obj.value = early
                if reached is not None:
                    results[3]._obj.value = reached
                return OK

            return call

    assert fmi3.Functions(Library(), {}).fmi2DoStep(1, 1.0, 0.5, 1) == status


def test_rows_that_cannot_be_written_fail_the_run(monkeypatch: pytest.MonkeyPatch, scenario: Plan) -> None:
    """Any exception in a run makes the run fail; it does not end the worker process."""
    run = replace(scenario.runs[0], series=())
    file = worker.File("rows.csv", ".rows.csv")
    request = worker.Request(scenario.simulation, run, [], ([column.name for column in scenario.columns], file), False)
    rows = np.zeros(4), np.zeros((4, 2))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(results, "write_csv", full)
    monkeypatch.setattr(master, "simulate", lambda *_, **__: rows)
    header, last = worker.Worker(Board()).respond(request, np.empty(0))
    assert header["Failed"]["failure"]["message"] == "OSError: [Errno 28] No space left on device"
    assert (header["Failed"]["failure"]["kind"], header["Failed"]["rows"], last.size) == ("Error", None, 0)

    def failing(*_: object, **__: object) -> None:
        error = master.RunError("plant", "fmi2DoStep", 0.1, "status 3 (error)")
        error.recorded = rows
        raise error

    monkeypatch.setattr(master, "simulate", failing)
    header, last = worker.Worker(Board()).respond(request, np.empty(0))
    assert header["Failed"]["failure"]["message"] == "component plant, fmi2DoStep: status 3 (error)"
    assert (header["Failed"]["failure"]["kind"], header["Failed"]["rows"], last.size) == ("Error", None, 0)

    def fatal(*_: object, **__: object) -> None:
        raise master.RunError("plant", "fmi2DoStep", 0.1, "status 4 (fatal)", fatal=True)

    monkeypatch.setattr(master, "simulate", fatal)
    header, _ = worker.Worker(Board()).respond(request, np.empty(0))
    assert header["Failed"]["failure"]["kind"] == "Fatal"
