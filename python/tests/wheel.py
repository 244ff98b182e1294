"""Tests all parts of an installed wheel, including its FMUs and worker program: `python wheel.py ROOT FOLDER`."""

import json
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet
from gymnasium.utils.env_checker import check_env

import chassis_fmu as cf

root, folder = (Path(argument) for argument in sys.argv[1:])
scenario = root / "scenarios" / "esp_car_braking.toml"
package = next(iter(cf.fmus().values())).parents[1]
assert "site-packages" in package.parts, package
# The bill of materials lists the crates of the command and of the native code, without paths of this machine.
(bom,) = package.parent.glob("chassis_fmu-*.dist-info/sboms/*.json")
assert {"chassis", "pyo3"} <= {part["name"] for part in json.loads(bom.read_text())["components"]}
assert str(root) not in bom.read_text()
loop = cf.Scenario(scenario, stop=2.0)
here = loop.run({"plant:body.mass": 1300.0})
(there,) = loop.run_many([{"plant:body.mass": 1300.0}], workers=1)
assert here == loop.numbers(there), (here, there)

model = cf.linearize(cf.fmus()["RescueVehicle"])
assert model.A.shape[0] == model.A.shape[1] > 0

short = cf.Scenario(root / "scenarios" / "rescue_vehicle_step_steer.toml", stop=0.3)
act = {"plant:steer.front": (-1.0, 1.0)}
env = cf.Env(short, act=act, observe=["body.roll"], reward="body.roll_acceleration", case="coordination")
check_env(env, skip_render_check=True)

study = folder / "study.toml"
study.write_text(
    f"""title = "Mass"
scenario = {json.dumps(str(scenario))}
method = "sample"
runs = 4
stop = 2.0
points = ["rough"]
[[vary]]
name = "mass"
variable = "plant:body.mass"
distribution = "uniform"
min = 1200.0
max = 1400.0
"""
)
# The command finds the FMUs and this Python without options.
chassis = Path(sys.executable).with_name("chassis")
subprocess.run([chassis, "study", study, "--out", folder, "--no-fail"], cwd="/", check=True)
rows = pyarrow.parquet.read_table(folder / "study" / "runs.parquet").to_pylist()
assert len(rows) >= 4
assert {row["status"] for row in rows} == {"ok"}, rows
assert (folder / "study" / "index.html").stat().st_size > 10_000
run: list[str | Path] = [
    chassis,
    "run",
    root / "scenarios" / "rescue_vehicle_step_steer.toml",
    "--stop",
    "0.3",
    "--seeds",
    "1",
]
for engine in ("native", "fmpy"):
    subprocess.run([*run, "--engine", engine, "--out", folder / engine], cwd="/", check=True)
    assert (folder / engine / "rescue_vehicle_step_steer" / "index.html").stat().st_size > 10_000
used = f"Scenario, workers, linearize, Env, runs by both masters and a study of {len(rows)} runs"
print(f"{len(cf.fmus())} FMUs in {package.name}: {used}")
