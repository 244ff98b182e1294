"""`python -m chassis_fmu`: the command `chassis`."""

import sys

from .command import main

sys.exit(main())
