"""`python -m chassis_fmu.study`: the command of `scripts/study`."""

import sys

from .app import main

sys.exit(main())
