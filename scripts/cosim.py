"""Runs a scenario and reports it: `scripts/cosim.py SCENARIO`, see `--help`."""

import sys

from chassis_fmu.app import main

if __name__ == "__main__":
    sys.exit(main())
