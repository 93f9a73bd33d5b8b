"""Draw the friction of the joints many times over and look at the spread of the tracking errors.

    python scenarios/friction_wear.py [--model NAME=MODEL.json]... [--out DIR]

The same as `armloop track friction_wear`, whose help explains the options.
"""

import sys

from armloop.cli import main

if __name__ == "__main__":
    sys.exit(main(["track", "friction_wear", *sys.argv[1:]]))
