"""Scenarios as gymnasium environments: an agent sets inputs of components."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _native
from .files import plan
from .scenario import RunError, Scenario, ScenarioError, Values, run_error

try:
    import gymnasium
except ImportError as error:
    raise ImportError("Env needs gymnasium; install it with `pip install gymnasium`") from error

Array: TypeAlias = NDArray[np.float64]
Signals: TypeAlias = Mapping[str, float]
"""Values of the observed signals by name, in their units."""

Reward: TypeAlias = Callable[[Signals, Array, Signals], float]
Limits: TypeAlias = Mapping[str, tuple[float, float]]


class Env(gymnasium.Env[Array, Array]):
    """A scenario whose inputs an agent sets.

    - `loop`: the scenario. `case`, `point` and `run_seed` choose one of its runs (default: the first). `values` changes
      parameters, as in `Scenario.run`.
    - `act`: inputs that the agent sets, each as `component:input`, in the units of the inputs. With a list, the limits
      come from the FMU; a dict states them: `{name: (low, high)}`. An action is held for a period and overrides the
      connection of the input. Actions beyond the limits are clipped. A Boolean input is true above 0.5.
    - `observe`: recorded signals of the scenario, each as `signal` or `component:signal`, in their units.
    - `reward`: a function of the signals before the step, the action and the signals after it; or the name of a
      recorded signal, whose value after the step is the reward. The function gets the signals of `observe` by name.
    - `period`: duration of an environment step (s), a multiple of the communication step (default: one communication
      step).
    - `terminate`: a function of the signals after a step; if it returns true, the episode is terminated.

    Spaces are boxes of float64: the action has the shape (number of inputs,), the observation (number of signals,).
    `gymnasium.wrappers.RescaleAction` maps actions to [-1, 1], the range that most algorithms need. An episode is
    truncated at the stop time of the scenario. `info` contains the time in s.

    The FMUs are instantiated and initialized once, in this process. `reset` restores their states, so an episode is
    bit-identical to the first episode of a new environment. The random numbers of a scenario come from its seeds, not
    from `reset`.

    Raises `ScenarioError` for unknown names and invalid limits, `RunError` if an FMU fails. An environment can be reset
    after a `RunError`.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as gymnasium declares it
    action_space: gymnasium.spaces.Box[np.float64]
    observation_space: gymnasium.spaces.Box[np.float64]

    def __init__(
        self,
        loop: Scenario,
        *,
        act: Sequence[str] | Limits,
        observe: Sequence[str],
        reward: Reward | str,
        case: str | None = None,
        point: str | None = None,
        run_seed: int | None = None,
        values: Values | None = None,
        period: float | None = None,
        terminate: Callable[[Signals], bool] | None = None,
    ) -> None:
        if not act or not observe:
            raise ScenarioError(f"`{'observe' if act else 'act'}` is empty; name at least one signal")
        index = loop.index(case, point, run_seed)
        self.observed = tuple(observe)
        self.acted = tuple(act)
        self._count = _steps(loop.plan.simulation, period)
        self._terminate = terminate
        self._reward = reward
        read = [*self.observed, reward] if isinstance(reward, str) else [*self.observed]
        columns = [_column(loop.plan, index, name) for name in read]
        self._session = loop.session(values, run=index, inputs=self.acted, columns=columns)
        limits = [_limits(loop, name, act[name] if isinstance(act, Mapping) else None) for name in self.acted]
        self._low, self._high = np.array(limits, dtype=np.float64).T.copy()
        shape = (len(self.observed),)
        self.action_space = gymnasium.spaces.Box(self._low, self._high, dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-math.inf, math.inf, shape, dtype=np.float64)
        try:
            self._start = self._session.save()
        except _native.RunFailedError as failure:
            raise ScenarioError(
                f"{loop.file}: {failure.args[1]}; `reset` needs FMUs that save and restore their states "
                "(canGetAndSetFMUstate)"
            ) from None
        self._names = read
        self._before: Array | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Go back to the start time.

        `seed` seeds `np_random`, which the scenario does not use; `options` is ignored.
        """
        super().reset(seed=seed, options=options)
        with run_error():
            self._session.restore(self._start)
        self._before = self._read()
        return self._observation(self._before), {"time": self._session.time}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold an action for a period.

        Returns the observation, the reward, whether the episode is terminated and truncated, and the time (s).
        """
        if self._before is None or self._session.is_over:
            raise gymnasium.error.ResetNeeded("the episode is over or has not started: call `reset` before `step`")
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._low.shape:
            raise ValueError(
                f"the action has the shape {given.shape}; give a number for each of {', '.join(self.acted)}"
            )
        if any(map(math.isnan, given)):
            unset = [name for name, value in zip(self.acted, given, strict=True) if math.isnan(value)]
            raise ValueError(f"the action is not a number (NaN) for {', '.join(unset)}")
        before, self._before = self._before, None
        with run_error():
            # Faster than numpy.clip for few numbers.
            self._session.step(self._count, np.minimum(np.maximum(given, self._low), self._high))
        after = self._before = self._read()
        signals = self._signals(after)
        if callable(self._reward):
            reward = float(self._reward(self._signals(before), given, signals))
        else:
            reward = float(after[-1])
        terminated = self._terminate is not None and bool(self._terminate(signals))
        return self._observation(after), reward, terminated, self._session.is_over, {"time": self._session.time}

    def _read(self) -> Array:
        values = self._session.read()
        bad = next((index for index, value in enumerate(values.tolist()) if not math.isfinite(value)), None)
        if bad is not None:
            raise RunError("diverged", self._session.time, f"`{self._names[bad]}` is {values[bad]}")
        return values

    def _observation(self, values: Array) -> Array:
        return values[: len(self.observed)].copy()

    def _signals(self, values: Array) -> dict[str, float]:
        # If the reward is a signal, `values` ends with it.
        return dict(zip(self.observed, values.tolist(), strict=False))


def _steps(simulation: plan.Simulation, period: float | None) -> int:
    """Return the number of communication steps in a period."""
    if period is None:
        return 1
    count = round(period / simulation.step) if math.isfinite(period) else 0
    if count < 1 or not math.isclose(count * simulation.step, period, rel_tol=1e-9):
        raise ScenarioError(
            f"`period` is {period} s; it must be a positive multiple of the communication step, {simulation.step} s"
        )
    return count


def _limits(loop: Scenario, name: str, given: tuple[float, float] | None) -> tuple[float, float]:
    variable = loop.variable(name)
    low, high = given if given is not None else (variable.min, variable.max)
    if given is None and variable.base_type == "Boolean":
        low, high = 0.0, 1.0
    if low is None or high is None:
        raise ScenarioError(
            f"{loop.file}: the FMU declares no limits for the input `{name}`; give them: "
            f'act={{"{name}": (low, high)}}' + (f", in {variable.unit}" if variable.unit else "")
        )
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ScenarioError(f"the limits of `{name}` are ({low}, {high}); they must be finite, the lower one first")
    return low, high


def _column(whole: plan.Plan, run: int, name: str) -> int:
    """Return the index of the column of a recorded signal."""
    chosen = whole.runs[run]
    component, colon, signal = name.rpartition(":")
    of = next((c for c in chosen.components if c.name == component), None) if colon else None
    for index, column in enumerate(whole.columns):
        slot = chosen.columns[index]
        if slot is None:
            continue
        if column.name == name or (
            of is not None and column.name == signal and any(wire.slot == slot for wire in of.outputs)
        ):
            return index
    recorded = ", ".join(c.name for c, slot in zip(whole.columns, chosen.columns, strict=True) if slot is not None)
    raise ScenarioError(
        f"{whole.file}: the case `{chosen.case}` records no signal `{name}`; add it to [record] of the "
        f"scenario, or use one of {recorded}"
    )
