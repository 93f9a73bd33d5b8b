"""The files that armloop reads and writes, each described once: types, units, ranges, sizes, what must agree.

msgspec checks what is read against these descriptions and makes the JSON schemas of ``docs/schemas`` from them.
"""
