"""`python -m sand` is the command `sand`."""

import sys

from .cli.main import main

sys.exit(main())
