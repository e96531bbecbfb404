"""What ``python -m sledenv`` runs: the command ``sledenv``."""

import sys

from sledenv_cli import main

sys.exit(main())
