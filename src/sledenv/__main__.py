"""The command ``sledenv``, by ``python -m sledenv``."""

import sys

from sledenv_cli import main

sys.exit(main())
