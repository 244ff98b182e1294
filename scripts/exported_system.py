"""Runs what `chassis export` wrote in other tools: FMPy, Ecos and libcosim; packs it into one FMU.

Every function takes the folder and returns the outputs that are connectors of the SSP file, named `component:signal`.
FMPy applies no parameter sets of an SSP file, so the file is read here and executed by the master that
`chassis run --engine fmpy` uses; Ecos and libcosim read the files by themselves, or are given the structure by calls.
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
from chassis_fmu.files.plan import BaseType, Component, Run, Setting, Simulation, Wire
from chassis_fmu.files.results import Recording, replacing

NAMESPACES = {
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}

# Name of the parameter sets in the SSP file; Ecos wants to be told.
PARAMETERS = "parameters"

# What the names of the outputs of a container begin with.
OUT = "out."

Order = Literal["sequential", "jacobi"]

# Component, name and type of a recorded output.
Output = tuple[str, str, BaseType]


class StructureError(Exception):
    """A system that a tool could not load or run."""


class NotLoadedError(Exception):
    """A tool whose Python package, or a library that it needs, is not there."""


@contextmanager
def _loading(what: str) -> Iterator[None]:
    try:
        yield
    except (ImportError, OSError) as error:
        raise NotLoadedError(f"{what} cannot be loaded: {error}") from error


def package(folder: Path) -> Path:
    """Return the SSP file of a folder."""
    found = sorted(folder.glob("*.ssp"))
    if len(found) != 1:
        raise StructureError(f"{folder}: {len(found)} SSP files, expected one")
    return found[0]


class Structure:
    """An SSP file as `chassis export` writes it."""

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
        self.outputs: list[Output] = [
            (c.get("name"), name, kind) for c in self.components for name, kind in self.connectors(c, "output")
        ]

    def _all(self, path: str) -> list[Any]:
        return list(self._root.iterfind(path, NAMESPACES))

    def times(self) -> Array:
        """Return the times of the rows: the start and the end of every step."""
        return self.start + np.arange(self.steps + 1) * self.step

    def connectors(self, component: Any, kind: str) -> list[tuple[str, BaseType]]:
        """Name and type of the inputs or outputs of a component that are connectors."""
        found = component.iterfind(f"ssd:Connectors/ssd:Connector[@kind='{kind}']", NAMESPACES)
        return [(connector.get("name"), _kind(connector, "ssc")[0]) for connector in found]

    def values(self, component: Any) -> list[tuple[str, BaseType, str]]:
        """Name, type and text of the values of a component."""
        values = self._sets.get(component.get("name"))
        parameters = [] if values is None else values.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES)
        return [(p.get("name"), *_kind(p, "ssv")) for p in parameters]

    def writers(self) -> dict[tuple[str, str], tuple[str, str]]:
        """Return what writes each input that is written, as pairs of component and variable."""
        return {
            (c.get("endElement"), c.get("endConnector")): (c.get("startElement"), c.get("startConnector"))
            for c in self._all("ssd:System/ssd:Connections/ssd:Connection")
        }

    def wires(self) -> Iterator[tuple[BaseType, tuple[str, str], tuple[str, str]]]:
        """Type, output and input of every connection; the latter two are pairs of component and variable."""
        writers = self.writers()
        for component in self.components:
            for name, kind in self.connectors(component, "input"):
                to = component.get("name"), name
                yield kind, writers[to], to

    def fmu(self, component: Any) -> Path:
        """Return the FMU of a component, as it lies beside the SSP file."""
        return self.path.parent / Path(component.get("source")).name


def _kind(element: Any, prefix: str) -> tuple[BaseType, str]:
    """Type of a connector or parameter, and its value if it has one."""
    for kind in get_args(BaseType):
        found = element.find(f"{prefix}:{kind}", NAMESPACES)
        if found is not None:
            return kind, found.get("value", "")
    raise StructureError(f"{element.get('name')} has no type that this version reads")


def _value(kind: BaseType, text: str) -> float | int | bool | str:
    if kind == "Boolean":
        return text in ("true", "1")
    convert: dict[str, Callable[[str], float | int | str]] = {"Real": float, "Integer": int, "String": str}
    return convert[kind](text)


def _recording(structure: Structure, times: Array, rows: Array) -> Recording:
    return Recording(times, {f"{owner}:{name}": rows[:, i] for i, (owner, name, _) in enumerate(structure.outputs)})


def with_fmpy(folder: Path, order: Order = "sequential", fresh: bool = False) -> Recording:
    """Run the SSP file through FMPy, in the order of the components (sequential) or all at once (jacobi).

    With `fresh` the rows are those that Ecos gives: see `master.simulate`.
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
        run = Run(structure.path.stem, "", None, None, tuple(components), (), len(slots), columns)
        simulation = Simulation(structure.start, structure.stop, structure.step, structure.steps, order, 1)
        times, rows = simulate(
            run, simulation, lambda component: FmpyInstance(component, folders[component.name]), fresh=fresh
        )
    return _recording(structure, times, rows)


def with_ecos(folder: Path, calls: bool = False) -> Recording:
    """Run the SSP file, or the same structure built by calls, through Ecos, which steps all components at once."""
    structure = Structure(package(folder))
    rows = np.empty((structure.steps + 1, len(structure.outputs)))
    with _loading("ecospy (it needs the library libtbb.so.12, Debian's libtbb12)"):
        from ecospy import EcosSimulation
    with ExitStack() as stack:
        try:
            source = {"structure": _ecos_structure(structure, stack)} if calls else {"ssp_path": str(structure.path)}
            simulation = stack.enter_context(EcosSimulation(step_size=structure.step, **source))
        # ecospy raises nothing more special.
        except Exception as error:
            raise StructureError(f"{structure.path}: Ecos: {error}") from error
        read = {"Real": simulation.get_real, "Integer": simulation.get_integer, "Boolean": simulation.get_bool}
        names = [(f"{owner}::{name}", read[kind]) for owner, name, kind in structure.outputs]
        if not simulation.init(start_time=structure.start, parameter_set=PARAMETERS):
            raise StructureError(f"{structure.path}: Ecos could not initialize it")
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
    """Run OspSystemStructure.xml, the SSP file or the same structure built by calls through libcosim (all at once).

    There is no row of the start: libcosim initializes in its first step, and its observer hears of nothing before.
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
    # One call for the outputs of a component and type.
    groups: dict[tuple[str, BaseType], list[tuple[int, str]]] = {}
    for column, (owner, name, kind) in enumerate(structure.outputs):
        groups.setdefault((owner, kind), []).append((column, name))
    reads = []
    for (owner, kind), members in groups.items():
        index = execution.slave_index_from_instance_name(owner)
        references = _libcosim_references(execution, index)
        read = getattr(observer, f"last_{kind.lower()}_values")
        reads.append((read, index, [references[n] for _, n in members], [c for c, _ in members]))
    rows = np.empty((structure.steps, len(structure.outputs)))
    for k in range(structure.steps):
        if not execution.step():
            raise StructureError(f"{folder}: libcosim failed in step {k}")
        for get, index, wanted, columns in reads:
            rows[k, columns] = get(index, wanted)
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
        raise StructureError(f"{structure.path}: libcosim's calls begin at 0, not at {structure.start}")
    execution = CosimExecution.from_step_size(round(structure.step * 1e9))
    slaves = {}
    for component in structure.components:
        owner, fmu = component.get("name"), structure.fmu(component)
        slave = CosimLocalSlave(str(fmu), owner)
        # libcosimpy passes on a null pointer, which ends the process.
        if not slave.ptr():
            raise StructureError(f"{fmu}: libcosim cannot load it")
        index = execution.add_local_slave(slave)
        slaves[owner] = index, _libcosim_references(execution, index)
        for name, kind, text in structure.values(component):
            start = getattr(execution, f"{kind.lower()}_initial_value")
            if not start(index, slaves[owner][1][name], _value(kind, text)):
                raise StructureError(f"{owner}:{name}: libcosim does not take the start value {text}")
    for kind, *ends in structure.wires():
        numbers = [number for owner, name in ends for number in (slaves[owner][0], slaves[owner][1][name])]
        connect = getattr(execution, f"connect_{kind.lower()}_variables")
        if connect(*numbers) != CosimConstants.success:
            raise StructureError(f"{':'.join(ends[0])} and {':'.join(ends[1])}: libcosim does not connect them")
    return execution


def container(folder: Path, out: Path, order: Order = "sequential") -> None:
    """Pack the whole system into one FMU by fmucontainer of the FMU manipulation toolbox.

    Its outputs are named `out.component.signal`: the toolbox uses `component.signal` for the signals between the
    components. The order is that of the components (sequential) or all at once (jacobi).
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
        # A file for each component: the toolbox tells components apart by their files.
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
