"""Grasp a load mid-run, trace it in the log, and go on with the model that knows of it.

    python scenarios/payload_pickup.py [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track payload_pickup`, whose help explains the options.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "payload_pickup", *sys.argv[1:]]))
