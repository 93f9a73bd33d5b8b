"""Everything that runs in Drake: the plant with friction, data collection, controllers, tracking, replay.

The only room that imports pydrake's systems. Each module is imported by its own name, so that a command which
needs no simulation does not wait for Drake.
"""
