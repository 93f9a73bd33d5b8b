"""Follow a random trajectory with a six-joint arm whose URDF you give.

    python scenarios/ur10e_tracking.py --arm ur10e.urdf [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track ur10e_tracking`, whose help explains the options.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "ur10e_tracking", *sys.argv[1:]]))
