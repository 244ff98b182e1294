"""`python -m chassis_fmu.assess`: the command of `scripts/assess`."""

import sys

from .app import main

sys.exit(main())
