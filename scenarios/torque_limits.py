"""Sort faster than the drives can, clipped and within their limits.

    python scenarios/torque_limits.py [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track torque_limits`, whose help explains the options.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "torque_limits", *sys.argv[1:]]))
