"""Assesses a vehicle and makes its page: `scripts/assess.py PLANT`, see `--help`."""

import sys

from chassis_fmu.assess.app import main

if __name__ == "__main__":
    sys.exit(main())
