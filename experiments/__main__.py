"""``python -m experiments`` is the same as ``soft-jig``."""

import sys

from experiments.cli.main import main

sys.exit(main())
