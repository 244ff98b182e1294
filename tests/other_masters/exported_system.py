"""Run a system from `chassis export` in other tools (FMPy, Ecos and libcosim), or pack it into one FMU.

The functions take the folder and return the outputs that are connectors in the SSP file, named `component:signal`.
FMPy ignores the parameter sets in an SSP file, so this module reads the file and executes it in the master of
`chassis run --engine fmpy`. Ecos and libcosim read the files, or get the structure through calls to their libraries.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from fmpy import extract, read_model_description
from lxml import etree

from chassis_fmu.execution.bus import Array
from chassis_fmu.execution.master import FmpyInstance, simulate
from chassis_fmu.files.plan import BaseType, Component, Evaluation, Run, Setting, Simulation, Wire
from chassis_fmu.files.results import Recording, replacing

NAMESPACES = {
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}

# Name of the parameter sets in the SSP file; Ecos applies them only if it gets this name.
PARAMETERS = "parameters"

# Prefix of the names of a container's outputs.
OUT = "out."

Order = Literal["sequential", "jacobi"]


class StructureError(Exception):
    """A tool could not load or run a system."""


class NotLoadedError(Exception):
    """The Python package of a tool, or a library that it needs, is missing."""


@contextmanager
def _loading(what: str) -> Iterator[None]:
    try:
        yield
    except (ImportError, OSError) as error:
        raise NotLoadedError(f"{what} cannot be loaded: {error}") from error


def package(folder: Path) -> Path:
    found = sorted(folder.glob("*.ssp"))
    if len(found) != 1:
        raise StructureError(f"{folder} must contain one SSP file, found {len(found)}")
    return found[0]


class Structure:
    """The contents of an SSP file from `chassis export`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with zipfile.ZipFile(path) as archive:
            self._root = etree.fromstring(archive.read("SystemStructure.ssd"))
            sets = {n: etree.fromstring(archive.read(n)) for n in archive.namelist() if n.endswith(".ssv")}
        self.components = self._all("ssd:System/ssd:Elements/ssd:Component")
        self._sets = {
            c.get("name"): sets[b.get("source")]
            for c in self.components
            for b in c.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES)
        }
        experiment = self._all("ssd:DefaultExperiment")[0]
        self.start, self.stop = float(experiment.get("startTime")), float(experiment.get("stopTime"))
        self.step = float(self._all(".//oms:FixedStepMaster")[0].get("stepSize"))
        self.steps = round((self.stop - self.start) / self.step)
        # Component, name and type of each recorded output.
        self.outputs: list[tuple[str, str, BaseType]] = [
            (c.get("name"), name, kind) for c in self.components for name, kind in self.connectors(c, "output")
        ]

    def _all(self, path: str) -> list[Any]:
        return list(self._root.iterfind(path, NAMESPACES))

    def times(self) -> Array:
        """Return the times of the rows: the start of the run, and the end of every step."""
        return self.start + np.arange(self.steps + 1) * self.step

    def connectors(self, component: Any, kind: str) -> list[tuple[str, BaseType]]:
        """Return name and type of the inputs or outputs of a component that are connectors."""
        found = component.iterfind(f"ssd:Connectors/ssd:Connector[@kind='{kind}']", NAMESPACES)
        return [(connector.get("name"), _kind(connector, "ssc")[0]) for connector in found]

    def values(self, component: Any) -> list[tuple[str, BaseType, str]]:
        """Return name, type and value (as text) of the parameters of a component."""
        values = self._sets.get(component.get("name"))
        parameters = [] if values is None else values.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES)
        return [(p.get("name"), *_kind(p, "ssv")) for p in parameters]

    def writers(self) -> dict[tuple[str, str], tuple[str, str]]:
        """Return the output that each connected input reads: pairs (component, variable) by input."""
        return {
            (c.get("endElement"), c.get("endConnector")): (c.get("startElement"), c.get("startConnector"))
            for c in self._all("ssd:System/ssd:Connections/ssd:Connection")
        }

    def wires(self) -> Iterator[tuple[BaseType, tuple[str, str], tuple[str, str]]]:
        """Yield type, output and input of every connection; output and input are pairs (component, variable)."""
        writers = self.writers()
        for component in self.components:
            for name, kind in self.connectors(component, "input"):
                to = component.get("name"), name
                yield kind, writers[to], to

    def fmu(self, component: Any) -> Path:
        """Return the FMU of a component in the folder of the SSP file."""
        return self.path.parent / Path(component.get("source")).name


def _kind(element: Any, prefix: str) -> tuple[BaseType, str]:
    """Return the type of a connector or parameter, and its value, or an empty string if it has none."""
    for kind in get_args(BaseType):
        found = element.find(f"{prefix}:{kind}", NAMESPACES)
        if found is not None:
            return kind, found.get("value", "")
    raise StructureError(f"the type of {element.get('name')} must be one of {', '.join(get_args(BaseType))}")


def _value(kind: BaseType, text: str) -> float | int | bool | str:
    if kind == "Boolean":
        return text in ("true", "1")
    convert: dict[str, Callable[[str], float | int | str]] = {"Real": float, "Integer": int, "String": str}
    return convert[kind](text)


def _recording(structure: Structure, times: Array, rows: Array) -> Recording:
    return Recording(times, {f"{owner}:{name}": rows[:, i] for i, (owner, name, _) in enumerate(structure.outputs)})


def with_fmpy(folder: Path, order: Order = "sequential", fresh: bool = False) -> Recording:
    """Run the SSP file through FMPy, stepping the components in their order (sequential) or all at once (jacobi).

    With `fresh`, outputs are read as in Ecos: see `master.simulate`.
    """
    structure = Structure(package(folder))
    writers = structure.writers()
    slots = {output[:2]: slot for slot, output in enumerate(structure.outputs)}
    with tempfile.TemporaryDirectory(prefix="system-") as temporary:
        with zipfile.ZipFile(structure.path) as archive:
            archive.extractall(temporary)
        components, folders = [], {}
        for component in structure.components:
            name, fmu = component.get("name"), Path(temporary) / component.get("source")
            folders[name] = Path(extract(str(fmu), str(Path(temporary) / name)))
            description = read_model_description(str(folders[name]))
            variables = {v.name: v for v in description.modelVariables}
            settings = [
                Setting(key, kind, variables[key].valueReference, _value(kind, text))
                for key, kind, text in structure.values(component)
            ]
            components.append(
                Component(
                    name=name,
                    fmu=fmu,
                    fmi="2.0",
                    model_identifier=description.coSimulation.modelIdentifier,
                    guid=description.guid,
                    parameters=tuple(s for s in settings if variables[s.name].causality != "input"),
                    constants=tuple(s for s in settings if variables[s.name].causality == "input"),
                    inputs=tuple(
                        Wire(v, variables[v].valueReference, kind, slots[writers[name, v]])
                        for v, kind in structure.connectors(component, "input")
                    ),
                    outputs=tuple(
                        Wire(v, variables[v].valueReference, kind, slots[name, v])
                        for v, kind in structure.connectors(component, "output")
                    ),
                )
            )
        columns = tuple(range(len(slots)))
        # As many passes as components, as in other masters: values reach the end of every chain.
        initialization = tuple(Evaluation((index,)) for _ in components for index in range(len(components)))
        run = Run(structure.path.stem, "", None, None, tuple(components), initialization, (), len(slots), columns)
        simulation = Simulation(structure.start, structure.stop, structure.step, structure.steps, order, 1)
        times, rows = simulate(
            run, simulation, lambda component: FmpyInstance(component, folders[component.name]), fresh=fresh
        )
    return _recording(structure, times, rows)


def with_ecos(folder: Path, calls: bool = False) -> Recording:
    """Run the SSP file, or the same structure built with calls, in Ecos, which steps all components at once."""
    structure = Structure(package(folder))
    rows = np.empty((structure.steps + 1, len(structure.outputs)))
    with _loading("ecospy (it needs the library libtbb.so.12, Debian's libtbb12)"):
        from ecospy import EcosSimulation
    with ExitStack() as stack:
        try:
            source = {"structure": _ecos_structure(structure, stack)} if calls else {"ssp_path": str(structure.path)}
            simulation = stack.enter_context(EcosSimulation(step_size=structure.step, **source))
        # ecospy raises no more specific exception.
        except Exception as error:
            raise StructureError(f"{structure.path}: Ecos: {error}") from error
        read = {"Real": simulation.get_real, "Integer": simulation.get_integer, "Boolean": simulation.get_bool}
        names = [(f"{owner}::{name}", read[kind]) for owner, name, kind in structure.outputs]
        if not simulation.init(start_time=structure.start, parameter_set=PARAMETERS):
            raise StructureError(f"{structure.path}: Ecos could not initialize the system")
        for k in range(structure.steps + 1):
            if k:
                simulation.step()
            rows[k] = [get(name) for name, get in names]
        simulation.terminate()
    return _recording(structure, structure.times(), rows)


def _ecos_structure(structure: Structure, stack: ExitStack) -> Any:
    from ecospy import EcosSimulationStructure

    system = stack.enter_context(EcosSimulationStructure())
    values = {}
    for component in structure.components:
        owner = component.get("name")
        system.add_model(owner, str(structure.fmu(component)))
        values.update({f"{owner}::{name}": _value(kind, text) for name, kind, text in structure.values(component)})
    system.add_parameter_set(PARAMETERS, values)
    connect = {
        "Real": system.make_real_connection,
        "Integer": system.make_int_connection,
        "Boolean": system.make_bool_connection,
        "String": system.make_string_connection,
    }
    for kind, written, read in structure.wires():
        connect[kind]("::".join(written), "::".join(read))
    return system


def with_libcosim(folder: Path, source: Literal["osp", "ssp", "calls"] = "osp") -> Recording:
    """Run OspSystemStructure.xml, the SSP file, or the same structure built with calls, in libcosim (all at once).

    There is no row for the start of the run: libcosim initializes in its first step, and its observer starts after it.
    """
    with _loading("libcosimpy (it needs Python 3.11 to 3.14)"):
        from libcosimpy.CosimEnums import CosimErrorCode
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    structure = Structure(package(folder))
    try:
        if source == "calls":
            execution = _libcosim_execution(structure)
        elif source == "ssp":
            execution = CosimExecution.from_ssp_file(str(structure.path))
        else:
            execution = CosimExecution.from_osp_config_file(str(folder))
    except AssertionError as error:
        raise StructureError(f"{folder}: {error}") from error
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    reads = []
    for owner, name, kind in structure.outputs:
        index = execution.slave_index_from_instance_name(owner)
        reference = _libcosim_references(execution, index)[name]
        reads.append((getattr(observer, f"last_{kind.lower()}_values"), index, [reference]))
    rows = np.empty((structure.steps, len(structure.outputs)))
    for k in range(structure.steps):
        if not execution.step():
            raise StructureError(f"{folder}: libcosim failed in step {k}")
        rows[k] = [get(index, reference)[0] for get, index, reference in reads]
    if execution.status().error_code != CosimErrorCode.SUCCESS.value:
        raise StructureError(f"{folder}: libcosim: error {execution.status().error_code}")
    return _recording(structure, structure.times()[1:], rows)


def _libcosim_references(execution: Any, index: int) -> dict[str, int]:
    return {v.name.decode(): v.reference for v in execution.slave_variables(index)}


def _libcosim_execution(structure: Structure) -> Any:
    from libcosimpy import CosimConstants
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimSlave import CosimLocalSlave

    if structure.start != 0.0:
        raise StructureError(
            f"{structure.path}: the start time must be 0 with the tool libcosim-calls, got {structure.start}"
        )
    execution = CosimExecution.from_step_size(round(structure.step * 1e9))
    slaves = {}
    for component in structure.components:
        owner, fmu = component.get("name"), structure.fmu(component)
        slave = CosimLocalSlave(str(fmu), owner)
        # libcosimpy would pass on a null pointer, which crashes the process.
        if not slave.ptr():
            raise StructureError(f"{fmu}: libcosim cannot load the FMU")
        index = execution.add_local_slave(slave)
        slaves[owner] = index, _libcosim_references(execution, index)
        for name, kind, text in structure.values(component):
            start = getattr(execution, f"{kind.lower()}_initial_value")
            if not start(index, slaves[owner][1][name], _value(kind, text)):
                raise StructureError(f"{owner}:{name}: libcosim rejects the start value {text}")
    for kind, *ends in structure.wires():
        numbers = [number for owner, name in ends for number in (slaves[owner][0], slaves[owner][1][name])]
        connect = getattr(execution, f"connect_{kind.lower()}_variables")
        if connect(*numbers) != CosimConstants.success:
            raise StructureError(f"libcosim cannot connect {':'.join(ends[0])} to {':'.join(ends[1])}")
    return execution


def container(folder: Path, out: Path, order: Order = "sequential") -> None:
    """Pack the system into one FMU, with fmucontainer from the FMU manipulation toolbox.

    The outputs are named `out.component.signal`, because the toolbox uses `component.signal` for the signals between
    the components. The components step in their order (sequential) or all at once (jacobi).
    """
    structure = Structure(package(folder))
    fmus = {c.get("name"): f"{c.get('name')}.fmu" for c in structure.components}
    assembly = {
        "name": out.name,
        "step_size": structure.step,
        "sequential": order == "sequential",
        "mt": False,
        "profiling": False,
        **dict.fromkeys(("auto_link", "auto_input", "auto_output", "auto_parameter", "auto_local"), False),
        "fmu": list(fmus.values()),
        "link": [[fmus[a], b, fmus[c], d] for (c, d), (a, b) in structure.writers().items()],
        "start": [
            [fmus[c.get("name")], name, text] for c in structure.components for name, _, text in structure.values(c)
        ],
        "output": [[fmus[owner], name, f"{OUT}{owner}.{name}"] for owner, name, _ in structure.outputs],
    }
    tool = Path(sys.executable).with_name("fmucontainer")
    with tempfile.TemporaryDirectory(prefix="container-") as temporary, zipfile.ZipFile(structure.path) as archive:
        # A file for each component, because the toolbox identifies components by their files.
        for component in structure.components:
            Path(temporary, fmus[component.get("name")]).write_bytes(archive.read(component.get("source")))
        Path(temporary, "system.json").write_text(json.dumps(assembly), encoding="utf-8")
        command = [str(tool), "-container", "system.json", "-fmu-directory", temporary]
        with _loading("fmucontainer"):
            done = subprocess.run(
                command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False
            )
        made = Path(temporary, out.name)
        if done.returncode != 0 or not made.is_file():
            raise StructureError(f"fmucontainer failed:\n{done.stdout}")
        with replacing(out) as part:
            shutil.copyfile(made, part)
