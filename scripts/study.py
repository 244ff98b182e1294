"""Carries out a study and reports it: `scripts/study.py STUDY`, see `--help`."""

import sys

from chassis_fmu.study.app import main

if __name__ == "__main__":
    sys.exit(main())
