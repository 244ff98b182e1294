"""`python -m chassis_fmu.execution BOARD FUNCTIONS`: a worker that executes runs by FMPy, for `chassis run`.

Requests and responses are those of the workers of the native master (`fmu_system::worker`): two lengths, a header in
JSON and a body of doubles. The process ends when the connection does.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import queue
import socket
import struct
import sys
import tempfile
import threading
import time
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import msgspec
import numpy as np

from ..files import results
from ..files.plan import Component, InputSeries, Run, Simulation
from . import calls, master
from .bus import Array

# Lengths of header and body.
PREFIX = struct.Struct("<IQ")


class File(msgspec.Struct):
    """A CSV file. It is written under the hidden name; the parent renames it when it is complete."""

    path: str
    hidden: str


class Request(msgspec.Struct):
    """A run; the times and values of its input series are in the body of the message."""

    simulation: Simulation
    run: Run
    series: list[tuple[int, int, str, bool]]
    csv: tuple[list[str], File] | None
    """Names of the columns, and the file to write them to instead of returning them."""
    is_repeated: bool


def connect() -> socket.socket:
    """Return the connection to the parent. Standard input becomes the null device, because FMUs could read it."""
    callback = os.environ.get("CHASSIS_FMU_WORKER")
    if callback is not None:
        # On systems where a process cannot inherit a socket, the variable contains a port and a secret.
        port, word = callback.split()
        connection = socket.create_connection(("127.0.0.1", int(port)))
        connection.sendall(word.encode())
        return connection
    connection = socket.socket(fileno=os.dup(0))
    with open(os.devnull) as nothing:  # noqa: PTH123, a descriptor
        os.dup2(nothing.fileno(), 0)
    return connection


def receive(connection: socket.socket, requests: queue.SimpleQueue[tuple[bytes, Array]]) -> None:
    """Queue the requests; when the connection closes, end the process at once, whatever an FMU is doing."""
    with contextlib.suppress(OSError), connection.makefile("rb") as file:
        while len(prefix := file.read(PREFIX.size)) == PREFIX.size:
            header, numbers = PREFIX.unpack(prefix)
            requests.put((file.read(header), np.frombuffer(file.read(8 * numbers))))
    os._exit(0)


def series_of(request: Request, body: Array) -> tuple[InputSeries, ...]:
    """Return the input series of a run, decoded from the body."""
    found: list[InputSeries] = []
    place = 0
    for slot, rows, interpolation, has_times_before in request.series:
        parts = [body[place + k * rows : place + (k + 1) * rows] for k in range(1 if has_times_before else 2)]
        place += len(parts) * rows
        times = found[-1].times if has_times_before else tuple(parts[0].tolist())
        values = tuple(parts[-1].tolist())
        found.append(InputSeries(slot, interpolation, times, values))  # type: ignore[arg-type]
    return tuple(found)


class Worker:
    """Executes runs. Each FMU is unpacked once, when a run first needs it."""

    def __init__(self, board: calls.Board) -> None:
        self._board = board
        self._folders: dict[Path, Path] = {}

    def _instance(self, component: Component) -> master.FmpyInstance:
        if component.fmu not in self._folders:
            folder = Path(tempfile.mkdtemp())
            try:
                _unpack(component.fmu, folder)
            except Exception as error:  # fmpy raises bare Exceptions for illegal archives
                text = f"{component.fmu}: {type(error).__name__}: {error}"
                raise master.RunError(component.name, "loading", None, text) from error
            self._folders[component.fmu] = folder
        return master.FmpyInstance(component, self._folders[component.fmu])

    def respond(self, request: Request, body: Array) -> tuple[dict[str, Any], Array]:
        """Execute a run and write its rows; returns header and body of the response."""
        run = msgspec.structs.replace(request.run, series=series_of(request, body))
        texts: dict[int, list[str]] = {}
        begin = time.perf_counter()
        try:
            simulation, repeated = request.simulation, request.is_repeated
            rows = master.simulate(
                run, simulation, self._instance, board=self._board, is_repeated=repeated, texts=texts
            )
            seconds = time.perf_counter() - begin
            size, body = self._rows(request, *rows, texts)
        except master.RunError as error:
            kind = "Terminated" if error.is_end else "Discarded" if error.is_discarded else "Error"
            kind = "Fatal" if error.fatal else kind
            where = None if error.component == "input file" else error.component
            failure = {"time": error.time, "component": where, "message": error.described(), "kind": kind}
            recorded: tuple[Any, Array] = None, np.empty(0)
            if error.recorded is not None:
                # If the rows cannot be written, the failure is still reported.
                with contextlib.suppress(OSError):
                    recorded = self._rows(request, *error.recorded, texts)
            return _failed(run.id, failure, *recorded)
        except Exception as error:
            failure = {"time": None, "component": None, "message": f"{type(error).__name__}: {error}", "kind": "Error"}
            return _failed(run.id, failure, None, np.empty(0))
        logged = [(name, {"status": "Warning", "category": "", "text": text}) for name, text in master.messages()]
        return {"Recorded": {**size, "recording": {"messages": logged, "seconds": seconds}}}, body

    @staticmethod
    def _rows(request: Request, times: Array, rows: Array, texts: dict[int, list[str]]) -> tuple[dict[str, Any], Array]:
        """Return the size and the numbers of the rows of a run; of rows that are written to a file, the last time."""
        if request.csv is None:
            columns = [slot is not None for slot in request.run.columns]
            return {"rows": len(times), "columns": columns}, np.concatenate([times, *rows.T])
        names, file = request.csv
        present = [name for name, slot in zip(names, request.run.columns, strict=True) if slot is not None]
        results.write_csv(Path(file.hidden), present, times, rows, texts)
        return {"rows": 1, "columns": []}, times[-1:]


def _failed(run: str, failure: dict[str, Any], size: Any, body: Array) -> tuple[dict[str, Any], Array]:
    return {"Failed": {"failure": {"run": run, "variable": None, **failure}, "rows": size}}, body


def _unpack(fmu: Path, folder: Path) -> None:
    """Extract an archive. Some tools separate folders by backslashes; fmpy rejects such archives."""
    with zipfile.ZipFile(fmu) as archive:
        if not any("\\" in entry.orig_filename for entry in archive.infolist()):
            fmpy.extract(str(fmu), str(folder))
            return
        for entry in archive.infolist():
            entry.filename = entry.orig_filename.replace("\\", "/")
            archive.extract(entry, folder)


def main(argv: list[str]) -> None:
    """Serve requests from the parent until the connection closes."""
    board, functions = argv
    connection = connect()
    calls.define(msgspec.json.decode(functions))
    with open(board, "r+b") as file:  # noqa: PTH123, a descriptor
        worker = Worker(calls.Board.from_buffer(mmap.mmap(file.fileno(), 0)))
    requests: queue.SimpleQueue[tuple[bytes, Array]] = queue.SimpleQueue()
    threading.Thread(target=receive, args=(connection, requests), daemon=True).start()
    while True:
        header, body = requests.get()
        ((kind, content),) = msgspec.json.decode(header, type=dict[str, msgspec.Raw]).items()
        # The other kind of request lists the FMUs, which only workers of the native master use. It needs no response.
        if kind == "Run":
            request = msgspec.json.decode(content, type=Request, dec_hook=lambda of, value: of(value))
            response, numbers = worker.respond(request, body)
            text = msgspec.json.encode(response)
            connection.sendall(PREFIX.pack(len(text), len(numbers)) + text + numbers.astype("<f8").tobytes())


if __name__ == "__main__":
    main(sys.argv[1:])
