"""The commands, one file each: what it says of itself, its arguments, and what it does: read, call, write, print.

Nothing heavy is imported before a command runs, so that ``--help`` and wrong arguments answer at once.
"""
