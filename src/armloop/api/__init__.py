"""The package as Python: functions with the commands' defaults, and results that show themselves in a notebook.

Use them as ``armloop.reconstruct`` and so on; where they are kept may change.
"""
