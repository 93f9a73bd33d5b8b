"""Motions that make an arm show its dynamics: poses, constant velocities, Fourier-series trajectories, tables.

Plain arrays, no simulator. A reference is anything with `evaluate(t) -> q, v, vdot` and a `duration`.
"""

from armloop.experiment.excitation.fourier import FourierReference, fourier_reference, paper_reference
from armloop.experiment.excitation.places import places_reference
from armloop.experiment.excitation.ranges import MotionRanges, ranges_with, speeds
from armloop.experiment.excitation.reference import Reference, within
from armloop.experiment.excitation.segments import (
    Segment,
    constant_velocity_segments,
    static_poses,
    static_segments,
)
from armloop.experiment.excitation.table import TableReference, read_reference, write_reference

__all__ = [
    "FourierReference",
    "MotionRanges",
    "Reference",
    "Segment",
    "TableReference",
    "constant_velocity_segments",
    "fourier_reference",
    "paper_reference",
    "places_reference",
    "ranges_with",
    "read_reference",
    "speeds",
    "static_poses",
    "static_segments",
    "within",
    "write_reference",
]
