"""Import of motion logs from other programs' formats: ROS bags, RTDE, libfranka, LeRobot, MATLAB, NumPy, any table.

Each reader gives named columns and says what its format fixes about them (:class:`Recording`); a map
(:class:`Mapping`) says the rest; :func:`convert` turns both into a log in SI units, base to tip. What a source does
not say is asked for, never guessed.
"""

from armloop.convert.assemble import Answers
from armloop.convert.convert import Converted, convert, read_sources
from armloop.convert.mapping import Mapping, QuantityMap, TimeMap, read_map
from armloop.convert.recording import Recording
from armloop.convert.suggest import doubts, suggested, written

__all__ = [
    "Answers",
    "Converted",
    "Mapping",
    "QuantityMap",
    "Recording",
    "TimeMap",
    "convert",
    "doubts",
    "read_map",
    "read_sources",
    "suggested",
    "written",
]
