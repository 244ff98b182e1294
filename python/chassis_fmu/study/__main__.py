"""`python -m chassis_fmu.study`, which `chassis study` calls."""

import sys

from .app import main

sys.exit(main())
