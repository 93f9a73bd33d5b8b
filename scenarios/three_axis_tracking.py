"""Track the reference of Fig. 14 with PID, and with a reconstructed model in Eqs. (35) and (36).

    python scenarios/three_axis_tracking.py [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track three_axis_tracking`, whose help explains the options. Without a model it collects data
on the simulated arm and reconstructs one first.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "three_axis_tracking", *sys.argv[1:]]))
