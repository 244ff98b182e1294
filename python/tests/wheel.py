"""Runs a scenario with the FMUs and the worker program of an installed wheel: `python wheel.py SCENARIO`."""

import sys

import chassis_fmu as cf

package = next(iter(cf.fmus().values())).parents[1]
assert "site-packages" in package.parts, package
loop = cf.Scenario(sys.argv[1], stop=2.0)
here = loop.run({"plant:body.mass": 1300.0})
(there,) = loop.run_many([{"plant:body.mass": 1300.0}], workers=1)
assert here == loop.numbers(there), (here, there)
print(f"{len(cf.fmus())} FMUs in {package.name}, the worker program gives the same numbers")
