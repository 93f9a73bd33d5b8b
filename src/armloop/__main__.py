"""``python -m armloop``."""

import sys

from armloop.cli import main

sys.exit(main())
