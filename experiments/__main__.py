"""``python -m experiments`` is the same as ``soft-jig``."""

import sys

from experiments.cli import main

sys.exit(main())
