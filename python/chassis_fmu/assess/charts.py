"""The figures of an assessment, by group of maneuvers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation import metrics
from ..files.plan import Case, Conversion, Level
from ..files.results import Recording
from ..report.panels import Array, Axis, Chart, Line, Panel, PanelKind
from .assessment import Assessment, Folder, Run, Suite

DEGREES = Conversion("°", 180.0 / math.pi)
ANGLE = (DEGREES, Conversion("rad"))
RATE = (Conversion("°/s", 180.0 / math.pi), Conversion("rad/s"))
METERS = (Conversion("m"),)
TIME = Axis("Time", (Conversion("s"),))
ACCELERATION = (Conversion("m/s²"),)
LATERAL = Axis("Lateral acceleration", ACCELERATION)
NO_UNIT = (Conversion(""),)
KMH = (Conversion("km/h", 3.6), Conversion("m/s"))

GRAVITY = 9.81

# Time between two footprints, s.
FOOTPRINTS = 0.25

# Times of the marks in the figure of the sine with dwell, from the completion of steer, s.
AFTER = (0.0, 1.0, 1.75)


@dataclass(frozen=True)
class Source:
    """The data for the figures."""

    assessment: Assessment
    folder: Folder
    cases: tuple[Case, ...]
    """The systems."""

    def recordings(self, run: str) -> Iterator[tuple[Case, Recording]]:
        """Return the signals of a run for each system that recorded them.

        If only one of a maneuver's several runs is recorded, that run is returned.
        """
        for case in self.cases:
            names = [
                r.name for r in self.assessment.runs if r.system == case.name and f"{r.name}.".startswith(f"{run}.")
            ]
            found = [self.folder.recording(case.name, name) for name in names]
            recording = next((r for r in reversed(found) if r is not None and r.times.size > 1), None)
            if recording is not None:
                yield case, recording

    def runs(self, maneuver: str) -> Iterator[tuple[Case, list[Run]]]:
        """Return the runs of a maneuver, by system."""
        for case in self.cases:
            runs = self.assessment.runs_of(maneuver, case.name)
            if runs:
                yield case, runs


Make = Callable[[Source], "Chart | None"]


def _chart(name: str, title: str, kind: str, caption: str, panels: Sequence[Panel]) -> Chart | None:
    shown = [panel for panel in panels if panel.lines]
    return Chart(name, title, kind, caption, shown) if shown else None


def _speed(source: Source, maneuver: str) -> str:
    """Describe the initial speed of a maneuver, or the range of its runs."""
    parameters = [run.parameters for _, runs in source.runs(maneuver) for run in runs]
    speeds = [3.6 * known["speed"] for known in parameters if "speed" in known]
    if not speeds:
        return ""
    low, high = f"{min(speeds):.4g}", f"{max(speeds):.4g}"
    return f"At {low} km/h." if low == high else f"At {low} to {high} km/h."


def _over_time(source: Source, run: str, signals: Sequence[tuple[str, str, tuple[Conversion, ...]]]) -> list[Panel]:
    panels = []
    for signal, title, units in signals:
        lines = [
            Line("run", case.title, recording.times, recording.values[signal], case)
            for case, recording in source.recordings(run)
            if signal in recording.values
        ]
        panels.append(Panel(title, "", TIME, Axis(title.partition(",")[0], units), tuple(lines)))
    return panels


def slowly_increasing_steer(source: Source) -> Chart | None:
    """Show the steering wheel angle over lateral acceleration, and the handling diagram."""
    wheelbase = source.assessment.datum("wheelbase")
    steering: list[Line] = []
    regressions: list[Line] = []
    handling: list[Line] = []
    gradients: list[Line] = []
    for case in source.cases:
        for side, sign in (("left", 1.0), ("right", -1.0)):
            run = f"slowly_increasing_steer.{side}"
            recording = source.folder.recording(case.name, run)
            if recording is None:
                continue
            v = recording.values
            found = next((r.metrics for r in source.assessment.runs if (r.name, r.system) == (run, case.name)), {})
            title = case.title if side == "left" else ""
            across = sign * v["vehicle.lateral_acceleration"]
            if "driver.steering_wheel" in v:
                wheel = sign * v["driver.steering_wheel"]
                steering.append(Line("run", title, across, wheel, case, t=recording.times))
                fitted = _regression(across, wheel, found.get("A_raw"))
                if fitted is not None:
                    name = "" if regressions else "least-squares line, 0.1 g to 0.375 g"
                    regressions.append(Line("reference", name, *fitted, case))
            if wheelbase is None:
                continue
            up = sign * (v["driver.steer"] - wheelbase * v["vehicle.yaw_rate"] / v["vehicle.speed"])
            handling.append(Line("run", title, across, up, case, t=recording.times))
            gradient = found.get("understeer_gradient")
            # A regression line passes through the mean of its points.
            inside = (across >= 1.0) & (across <= 3.0)
            if gradient is not None and inside.any():
                ends = np.array([1.0, 3.0])
                line = float(up[inside].mean()) + gradient * (ends - float(across[inside].mean()))
                gradients.append(Line("reference", "" if gradients else "slope from 1 to 3 m/s²", ends, line, case))
    wheel_angle = Axis("Steering wheel angle", ANGLE)
    diagram = "Handling diagram: front-wheel angle minus wheelbase · yaw rate / speed"
    panels = [
        Panel(wheel_angle.title, "", LATERAL, wheel_angle, (*steering, *regressions), kind="curve"),
        Panel(diagram, "", LATERAL, Axis("Angle", ANGLE), (*handling, *gradients), kind="curve"),
    ]
    speed = _speed(source, "slowly_increasing_steer")
    caption = (
        f"{speed} Both directions. The least-squares line gives A at 0.3 g. The slope of the handling diagram is the "
        "understeer gradient."
    )
    return _chart("slowly_increasing_steer", "Slowly increasing steer", "xy", caption, panels)


def _regression(across: Array, wheel: Array, angle: float | None) -> tuple[Array, Array] | None:
    """Return the ends of the least-squares line that passes through `angle` (deg) at 0.3 g.

    The evaluator fits the line to filtered signals and returns its value at 0.3 g. The slope is computed here from the
    unfiltered signals of the figure, in the same window.
    """
    low, high = (share * GRAVITY for share in (0.1, 0.375))
    begin = int(np.argmax(across >= low))
    beyond = np.flatnonzero(across[begin:] > high)
    if angle is None or across[begin] < low or beyond.size == 0 or beyond[0] < 2:
        return None
    rows = slice(begin, begin + int(beyond[0]))
    slope = float(np.polyfit(across[rows], wheel[rows], 1)[0])
    ends = np.array([low, high])
    return ends, math.radians(angle) + slope * (ends - 0.3 * GRAVITY)


def _signals(
    maneuver: str, title: str, caption: str, signals: Sequence[tuple[str, str, tuple[Conversion, ...]]]
) -> Make:
    """Return the function that makes a figure of a maneuver's signals over time."""

    def make(source: Source) -> Chart | None:
        text = f"{_speed(source, maneuver)} {caption}"
        return _chart(maneuver, title, "time", text, _over_time(source, maneuver, signals))

    return make


step_steer = _signals(
    "step_steer",
    "Step steer",
    "The steering angle is chosen to give both systems the same steady lateral acceleration.",
    (
        ("vehicle.yaw_rate", "Yaw rate", RATE),
        ("vehicle.lateral_acceleration", "Lateral acceleration", ACCELERATION),
        ("body.roll", "Roll angle", ANGLE),
        ("vehicle.sideslip", "Sideslip angle", ANGLE),
    ),
)


def frequency_response(source: Source) -> Chart | None:
    """Show gain and phase of yaw rate and lateral acceleration."""
    hertz = Axis("Frequency", (Conversion("Hz"),), log=True)
    panels = []
    for group, title, unit in (
        ("yaw_rate", "yaw rate", (Conversion("1/s"),)),
        ("lateral_acceleration", "lateral acceleration", (Conversion("m/(s²·rad)"),)),
    ):
        gains, phases = [], []
        for case, runs in source.runs("frequency_response"):
            found = runs[0].metrics
            response = found.get(group) or {}
            frequency, gain, phase = map(_array, (found.get("frequency"), response.get("gain"), response.get("phase")))
            if frequency is None:
                continue
            if gain is not None:
                gains.append(Line("run", case.title, frequency, gain, case))
            if phase is not None:
                phases.append(Line("run", case.title, frequency, phase, case))
        panels.append(Panel(f"Gain of the {title}", "", hertz, Axis("Gain", unit), tuple(gains)))
        panels.append(Panel(f"Phase of the {title}", "", hertz, Axis("Phase", (DEGREES,)), tuple(phases)))
    caption = (
        f"{_speed(source, 'frequency_response')} Response to the front-wheel angle, at the frequencies of the steering "
        "input, a sum of sines."
    )
    return _chart("frequency_response", "Frequency response", "transfer", caption, panels)


def _array(values: Any) -> Array | None:
    return None if values is None else np.array(values, np.float64)


def _path(recording: Recording) -> tuple[Array, Array] | None:
    """Return, for each row, the point nearest to the vehicle on the path that the driver follows."""
    v = recording.values
    needed = ("vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "path.lateral_deviation", "path.heading_error")
    if any(name not in v for name in needed):
        return None
    x, y, yaw, deviation, error = (v[name] for name in needed)
    heading = yaw - error
    return x + deviation * np.sin(heading), y - deviation * np.cos(heading)


def _tracks(source: Source, run: str) -> list[Line]:
    """Return the path of each system in a run."""
    return [
        Line("run", case.title, v["vehicle.position_x"], v["vehicle.position_y"], case, t=recording.times)
        for case, recording in source.recordings(run)
        for v in (recording.values,)
    ]


def _above_panel(title: str, note: str, lines: Sequence[Line], *, to_scale: bool = False) -> Panel:
    kind: PanelKind = "map" if to_scale else "curve"
    return Panel(title, note, Axis("x", METERS), Axis("y", METERS), tuple(lines), kind=kind)


def single_lane_change(source: Source) -> Chart | None:
    """Show the lane change from above, and the lateral acceleration."""
    lines = _tracks(source, "single_lane_change")
    paths = (_path(recording) for _, recording in source.recordings("single_lane_change"))
    if (path := next(paths, None)) is not None:
        lines.insert(0, Line("reference", "path", *path))
    above = _above_panel("Seen from above", "", lines)
    signals = (("vehicle.lateral_acceleration", "Lateral acceleration", ACCELERATION),)
    panels = [above, *_over_time(source, "single_lane_change", signals)]
    caption = f"{_speed(source, 'single_lane_change')} The axes have different scales."
    return _chart("single_lane_change", "Single lane change", "xy", caption, panels)


def _mirrored(run: Run, values: Array) -> Array:
    """Return the values of a run, mirrored if it goes to the right."""
    return -values if run.name.split(".")[1] == "right" else values


def sine_with_dwell(source: Source) -> Chart | None:
    """Show the yaw rates and the steering of all runs, with marks at the times of the criteria."""
    panels = []
    for case, runs in source.runs("sine_with_dwell"):
        lines: list[Line] = []
        marks: list[tuple[Array, Array]] = []
        for run in runs:
            recording = source.folder.recording(case.name, run.name)
            if recording is None or "vehicle.yaw_rate" not in recording.values:
                continue
            rate = _mirrored(run, recording.values["vehicle.yaw_rate"])
            lines.append(Line("run", "" if lines else case.title, recording.times, rate, case))
            completed = run.metrics.get("cos")
            if completed is not None:
                at = np.array([completed + after for after in AFTER])
                at = at[at <= recording.times[-1]]
                marks.append((at, np.interp(at, recording.times, rate)))
        if not lines:
            continue
        last = max(runs, key=lambda run: run.parameters["amplitude"])
        recording = source.folder.recording(case.name, last.name)
        right = None
        if recording is not None and "driver.steering_wheel" in recording.values:
            right = Axis("Steering wheel angle", ANGLE)
            wheel = _mirrored(last, recording.values["driver.steering_wheel"])
            lines.append(Line("reference", "largest steering wheel angle", recording.times, wheel, right=True))
        if marks:
            x, y = (np.concatenate(part) for part in zip(*marks, strict=True))
            order = np.argsort(x, kind="stable")
            lines.append(
                Line("reference", "end of steering, 1 s, 1.75 s later", x[order], y[order], marks=True, apart=True)
            )
        panels.append(Panel("Yaw rate", case.title, TIME, Axis("Yaw rate", RATE), tuple(lines), right=right))
    caption = f"{_speed(source, 'sine_with_dwell')} All amplitudes; runs to the right are mirrored."
    return _chart("sine_with_dwell", "Sine with dwell", "time", caption, panels)


def sine_with_dwell_amplitudes(source: Source) -> Chart | None:
    """Show the criteria of sine with dwell over the amplitude."""
    amplitude = Axis("Largest steering wheel angle", (Conversion("°"),))
    panels = []
    row = source.assessment.by_name.get("sine_with_dwell.lateral_displacement")
    least = None if row is None or row.limit is None else row.limit.get("min")
    share = Axis("Share of the peak", NO_UNIT, zero=True)
    displacement = Axis("Displacement", METERS, zero=True)
    for metric, title, axis, limit in (
        ("yaw_rate_ratio_1s", "Yaw rate 1 s after the steering, relative to its second peak", share, 0.35),
        ("yaw_rate_ratio_1_75s", "Yaw rate 1.75 s after the steering, relative to its second peak", share, 0.20),
        ("lateral_displacement", "Lateral displacement 1.07 s after the start of steering", displacement, least),
    ):
        lines = []
        for case, runs in source.runs("sine_with_dwell"):
            for side in ("left", "right"):
                own = [run for run in runs if run.name.split(".")[1] == side]
                known = [(run.parameters["amplitude"], run.metrics.get(metric)) for run in own]
                lines += _marked([pair for pair in known if pair[1] is not None], case, is_named=side == "left")
        levels = () if limit is None else (Level(limit, "limit"),)
        panels.append(Panel(title, "", amplitude, axis, tuple(lines), levels))
    caption = (
        f"{_speed(source, 'sine_with_dwell')} Limits of FMVSS 126 and UN R140. Runs to both sides. The limit on the "
        "displacement applies from five times the amplitude A."
    )
    return _chart("sine_with_dwell_limits", "Sine with dwell over the amplitude", "sweep", caption, panels)


def _marked(pairs: Sequence[tuple[float, Any]], case: Case, *, is_named: bool = True) -> list[Line]:
    """Return a line through the points that have a value, if there are any."""
    if not pairs:
        return []
    x, y = np.array(sorted(pairs), np.float64).T
    return [Line("run", case.title if is_named else "", x, y, case, marks=True)]


def _corners(assessment: Assessment, x: Array, y: Array, yaw: Array) -> tuple[Array, Array]:
    """Return the outlines of the vehicle at several positions as one line with gaps."""
    front, rear, width = (assessment.datum(name) or 0.0 for name in ("front", "rear", "width"))
    ahead = np.array([front, front, -rear, -rear, front])
    left = 0.5 * width * np.array([1.0, -1.0, -1.0, 1.0, 1.0])
    xs = x[:, None] + np.cos(yaw)[:, None] * ahead - np.sin(yaw)[:, None] * left
    ys = y[:, None] + np.sin(yaw)[:, None] * ahead + np.cos(yaw)[:, None] * left
    gap = np.full((len(x), 1), math.nan)
    return np.hstack([xs, gap]).ravel(), np.hstack([ys, gap]).ravel()


def _cones(track: Sequence[tuple[float, float, float, float]]) -> Line:
    parts = [(x, y) for begin, end, right, left in track for y in (right, left) for x in (begin, end, math.nan)]
    xs, ys = np.array(parts, np.float64).T
    return Line("reference", "cones", xs, ys)


def _hit(track: Sequence[tuple[float, float, float, float]], section: int, xs: Array, ys: Array) -> Line:
    """Return a cross at the edge of a track section, where the corners of a footprint exceed it most."""
    begin, end, right, left = track[section - 1]
    inside = np.flatnonzero((xs >= begin) & (xs <= end))
    rows = inside if inside.size else np.flatnonzero(np.isfinite(xs))
    beyond = np.maximum(ys[rows] - left, right - ys[rows])
    row = rows[int(beyond.argmax())]
    y = left if ys[row] - left > right - ys[row] else right
    place = (np.array([np.clip(xs[row], begin, end)]), np.array([y]))
    return Line("reference", "first cone hit", *place, marks=True, apart=True, crosses=True)


def _above(source: Source, maneuver: str, case: Case, run: Run, what: str) -> Panel | None:
    """Return the panel of a double lane change seen from above, to scale."""
    recording = source.folder.recording(case.name, run.name)
    if recording is None:
        return None
    v, times = recording.values, recording.times
    x, y, yaw = (v[name] for name in ("vehicle.position_x", "vehicle.position_y", "vehicle.yaw"))
    track = source.assessment.tracks[maneuver]
    near = (x >= track[0][0] - 10.0) & (x <= track[-1][1] + 10.0)
    if not near.any():
        return None
    step = max(1, round(FOOTPRINTS / float(times[1] - times[0])))
    rows = np.flatnonzero(near)[::step]
    lines = [_cones(track)]
    path = _path(recording)
    if path is not None:
        lines.append(Line("reference", "path", path[0][near], path[1][near]))
    lines.append(Line("run", case.title, x[near], y[near], case, t=times[near]))
    lines.append(Line("run", "footprint", *_corners(source.assessment, x[rows], y[rows], yaw[rows]), case))
    for metric in ("tightest", "first_hit"):
        if (found := run.metrics.get(metric)) is not None:
            row = np.array([int(np.abs(times - found[0]).argmin())])
            corners = _corners(source.assessment, x[row], y[row], yaw[row])
            if metric == "first_hit":
                lines.append(_hit(track, int(found[1]), *corners))
            else:
                lines.append(Line("reference", "tightest place", *corners))
    speed = float(run.name.split(".", 1)[1])
    return _above_panel(what, f"{speed:.1f} km/h, {case.title}", lines, to_scale=True)


def double_lane_change(maneuver: str, title: str) -> Make:
    """Return the function that makes the figure of a coned track: the highest passed and the lowest failed speed."""

    def make(source: Source) -> Chart | None:
        if maneuver not in source.assessment.tracks:
            return None
        panels = []
        for case, runs in source.runs(maneuver):
            recorded = [run for run in runs if source.folder.recording(case.name, run.name) is not None]
            for run in sorted(recorded, key=lambda run: run.metrics.get("passed") is not True):
                what = "Highest speed passed" if run.metrics.get("passed") is True else "Lowest speed failed"
                panel = _above(source, maneuver, case, run, what)
                if panel is not None:
                    panels.append(panel)
        caption = (
            f"{_speed(source, maneuver)} The vehicle's footprint every {FOOTPRINTS} s, dark where the margin is "
            "smallest; a cross at the first cone hit. To scale."
        )
        return _chart(maneuver, title, "xy", caption, panels)

    return make


def margins(source: Source) -> Chart | None:
    """Show the smallest distance from the cones over the entry speed."""
    panels = []
    for maneuver, title in (("iso3888_1", "ISO 3888-1"), ("iso3888_2", "ISO 3888-2")):
        lines = []
        for case, runs in source.runs(maneuver):
            known = []
            for run in runs:
                values = [m for m in run.metrics.get("margins") or () if m is not None]
                if values:
                    known.append((float(run.name.split(".", 1)[1]), min(values)))
            lines += _marked(known, case)
        speed = Axis("Entry speed", (Conversion("km/h"),))
        panels.append(Panel(title, "", speed, Axis("Distance", METERS), tuple(lines), (Level(0.0, "cone"),)))
    first, second = (_speed(source, maneuver).replace("At", "at") for maneuver in ("iso3888_1", "iso3888_2"))
    caption = (
        f"ISO 3888-1 {first} ISO 3888-2 {second} Smallest distance between footprint and cones; negative where a cone "
        "is hit."
    )
    return _chart("margins", "Margins to the cones", "sweep", caption, panels)


ROLLOVER = (
    ("driver.steering_wheel", "Steering wheel angle", ANGLE),
    ("body.roll_rate", "Roll rate", RATE),
    ("body.roll", "Roll angle", ANGLE),
    ("vehicle.load_transfer_ratio", "Load transfer ratio", NO_UNIT),
)


def _rollover(maneuver: str, title: str) -> Make:
    def make(source: Source) -> Chart | None:
        speeds = [{run.name for run in runs if ".left." in run.name} for _, runs in source.runs(maneuver)]
        common = set.intersection(*speeds) if speeds else set()
        if not common:
            return None
        run = max(common, key=lambda name: float(name.split(".", 2)[2]))
        speed = run.split(".", 2)[2]
        both = " that both systems drove" if len(source.cases) > 1 else ""
        caption = f"To the left at {speed} mph, the highest speed of the series{both}."
        return _chart(maneuver, title, "time", caption, _over_time(source, run, ROLLOVER))

    return make


def braking(source: Source) -> Chart | None:
    """Show the speed over the distance while braking."""
    lines = []
    for case, recording in source.recordings("braking"):
        v = recording.values
        begin = int(np.argmax(v["driver.brake"] > 0.0)) if "driver.brake" in v else 0
        way = v["vehicle.position_x"] - v["vehicle.position_x"][begin]
        lines.append(Line("run", case.title, way[begin:], v["vehicle.speed"][begin:], case, t=recording.times[begin:]))
    caption = f"{_speed(source, 'braking')} Distance from the start of braking."
    panel = Panel("Speed", "", Axis("Distance", METERS), Axis("Speed", KMH, zero=True), tuple(lines), kind="curve")
    return _chart("braking", "Straight braking", "xy", caption, [panel])


def split_friction(source: Source) -> Chart | None:
    """Show paths and steering on a road that is slippery on one side."""
    panels = [
        _above_panel(f"Path, slippery on the {side}", "", _tracks(source, f"split_friction.{side}"))
        for side in ("left", "right")
    ]
    for side in ("left", "right"):
        signals = (("driver.steering_wheel", f"Steering wheel, slippery on the {side}", ANGLE),)
        panels += _over_time(source, f"split_friction.{side}", signals)
    caption = f"{_speed(source, 'split_friction')} The axes of the paths have different scales."
    return _chart("split_friction", "Braking on split friction", "xy", caption, panels)


brake_in_turn = _signals(
    "brake_in_turn",
    "Braking in a turn",
    "The steering is held when braking begins, at 16 s.",
    (
        ("vehicle.speed", "Speed", KMH),
        ("vehicle.yaw_rate", "Yaw rate", RATE),
        ("vehicle.sideslip", "Sideslip angle", ANGLE),
    ),
)


def ride(source: Source) -> Chart | None:
    """Show spectra of the heave acceleration, with the weighting from ISO 2631-1."""
    weighting = source.assessment.weighting
    if weighting is None:
        return None
    hertz = Axis("Frequency", (Conversion("Hz"),), log=True, range=(0.2, 100.0))
    frequencies, gains = (np.array(part) for part in weighting)
    plain, weighted = [], []
    highest, least = 0.0, math.inf
    for case, recording in source.recordings("ride.c.1"):
        signal = recording.values.get("body.heave_acceleration")
        if signal is None:
            continue
        rows = recording.times >= 2.0
        f, density = metrics.spectrum(recording.times[rows], signal[rows])
        shown = (f >= 0.2) & (f <= 100.0)
        f, density = f[shown], density[shown]
        gain = np.interp(np.log(f), np.log(frequencies), gains)
        highest = max(highest, float(density.max()))
        least = min(least, float((density * np.minimum(gain, 1.0) ** 2).min()))
        plain.append(Line("run", case.title, f, density, case))
        weighted.append(Line("run", case.title, f, density * gain**2, case))
    # Show at most six decades; smaller values are rounding errors.
    ends = max(0.5 * least, 2e-6 * highest), 2.0 * highest
    axis = Axis("Density", (Conversion("(m/s²)²/Hz"),), log=True, range=ends)
    inside = (frequencies >= 0.2) & (frequencies <= 100.0)
    curve = Line("reference", "gain of W_k", frequencies[inside], gains[inside], right=True)
    right, lines = Axis("Gain of W_k", NO_UNIT), (*weighted, curve) if weighted else ()
    panels = [
        Panel("Heave acceleration", "", hertz, axis, tuple(plain)),
        Panel("Heave acceleration, weighted by W_k", "", hertz, axis, lines, right=right),
    ]
    caption = f"{_speed(source, 'ride')} Power spectral densities on a road of class C (ISO 8608), first seed."
    return _chart("ride", "Ride", "spectrum", caption, panels)


CHARTS: dict[Suite, tuple[Make, ...]] = {
    "handling": (slowly_increasing_steer, step_steer, frequency_response, single_lane_change),
    "stability": (
        sine_with_dwell,
        sine_with_dwell_amplitudes,
        double_lane_change("iso3888_1", "Double lane change of ISO 3888-1"),
        double_lane_change("iso3888_2", "Double lane change of ISO 3888-2"),
        margins,
    ),
    "rollover": (_rollover("fishhook", "Fishhook"), _rollover("j_turn", "J-turn")),
    "braking": (braking, split_friction, brake_in_turn),
    "ride": (ride,),
}
"""The figures, by group of maneuvers."""
