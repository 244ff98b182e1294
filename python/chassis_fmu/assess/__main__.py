"""`python -m chassis_fmu.assess FOLDER COMMAND`, which `chassis bench run` calls."""

import sys

from .app import main

sys.exit(main())
