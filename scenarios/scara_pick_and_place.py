"""Take parts from a belt and put them into two trays with the SCARA arm, with and without models.

    python scenarios/scara_pick_and_place.py [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track scara_pick_and_place`, whose help explains the options.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "scara_pick_and_place", *sys.argv[1:]]))
