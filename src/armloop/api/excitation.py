"""An exciting reference, as an object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from armloop.api.reading import as_arm, require_model
from armloop.api.shown import displayed, page
from armloop.commands.excite import Excite as Command
from armloop.commands.excite import settings_for
from armloop.experiment.design import Excitation
from armloop.experiment.design import excite as run
from armloop.experiment.excitation import MotionRanges, ranges_with, write_reference
from armloop.model import ReconstructedModel
from armloop.reports.excitation_tables import measures_table, use_table
from armloop.robot.arm import Arm, load_arm
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.given import numbers_of, path_of, require
from armloop.util.progress import Progress, silent
from armloop.util.resources import urdf_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Reference:
    """An optimised exciting reference.

    Attributes:
        result: the account of it: limits used, measures of it and of random references, notes.
    """

    def __init__(self, result: Excitation) -> None:
        self.result = result

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.result.reference.duration

    def evaluate(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v, vdot, each (N, n), at the times ``t`` (N,): a motion that a simulated arm can follow."""
        return self.result.reference.evaluate(t)

    def save(self, path: str | Path, *, rate: float = Command.rate) -> int:
        """Write it as a table (CSV or Parquet) with so many rows per second; returns their number."""
        Command.checked(rate=rate)
        return write_reference(str(path_of(path)), self.result.reference, rate)

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``armloop excite --json``."""
        return self.result.to_dict()

    def plot(self) -> Figure:
        """Positions, velocities and accelerations over a period, a matplotlib figure."""
        from armloop.reports.plots.excitation import reference_figure

        return displayed(reference_figure(self.result))

    def report(self, path: str | Path) -> Path:
        """Write the page of ``armloop excite --report``, without a network."""
        from armloop.reports.excitation_report import excitation_report
        from armloop.util.files import write_text

        write_text(path, excitation_report(self.result, None))
        return Path(path)

    def __repr__(self) -> str:
        timing, found = self.result.timing, self.result.measure
        return f"<armloop.Reference of {self.result.arm.name}, {timing.duration:g} s, condition {found.condition:.3g}>"

    def __str__(self) -> str:
        notes = "".join(f"\nnote: {note}" for note in self.result.notes)
        return f"{measures_table(self.result)}\n\n{use_table(self.result)}{notes}"

    def _repr_html_(self) -> str:
        return page(str(self), self.plot())


def excite(
    arm: Arm | str | Path,
    *,
    library: str | None = Command.library,
    criterion: str = Command.criterion,
    duration: float | None = Command.duration,
    base_frequency: float | None = Command.base_frequency,
    harmonics: int | None = Command.harmonics,
    order: int = Command.order,
    lower: Sequence[float] | None = None,
    upper: Sequence[float] | None = None,
    velocity: Sequence[float] | None = None,
    acceleration: Sequence[float] | None = None,
    reserve: float = Command.reserve,
    model: ReconstructedModel | None = None,
    noise: Sequence[float] | None = None,
    starts: int | None = Command.starts,
    random: int = Command.random,
    seed: int = Command.seed,
    progress: Progress = silent,
) -> Reference:
    """Design an optimised exciting reference within an arm's limits; the options of ``armloop excite``.

    Args:
        library: what is to be regressed; by the number of joints if None.
        criterion: "variance" (of the coefficients), "logdet" (of the information) or "condition".
        duration: s; by the library if None.
        base_frequency: Hz.
        harmonics: how many of it.
        order: N1 of the double feature set's candidates.
        lower: (n,) rad (m); that of a built-in arm's plant, or nine tenths of the URDF's travel, if None.
        upper: likewise.
        velocity: (n,) rad/s (m/s); that of a built-in arm's plant, or half the URDF's, if None.
        acceleration: (n,) rad/s² (m/s²), likewise.
        reserve: part of the effort limits that is kept free.
        model: predicts the torque that must keep within the drives' limits; the URDF's inertias if None.
        noise: (n,) standard deviation of each joint's torque, N·m (N); the model's baseline error if None.
        starts: of the optimiser.
        random: how many references to compare with.
        seed: of both.

    Raises:
        InputError: settings out of range, or limits that exclude any motion.
    """
    chosen = {
        "library": library,
        "criterion": criterion,
        "duration": duration,
        "base_frequency": base_frequency,
        "harmonics": harmonics,
        "order": order,
        "reserve": reserve,
        "starts": starts,
        "random": random,
        "seed": seed,
    }
    Command.checked(**chosen)
    require("a function", progress=progress)
    if seed < 0:
        raise InputError(f"seed must not be negative; it is {seed}")
    arm = as_arm(arm)
    if model is not None:
        require_model(model)
        model.arm.require_same(arm, "the model")
    stated = {"lower": lower, "upper": upper, "velocity": velocity, "acceleration": acceleration}
    given = {
        name: None if values is None else tuple(numbers_of(values, (arm.n,), name).tolist())
        for name, values in ({"noise": noise} | stated).items()
    }
    settings = settings_for(arm, model, given.pop("noise"), chosen)
    ranges = ranges_with(arm, _plants(arm), **given)
    return Reference(run(arm, ranges, settings, model.of_the_drives().predict if model else None, progress))


def _plants(arm: Arm) -> MotionRanges | None:
    """The ranges of a built-in arm's plant; None for any other."""
    if arm.name not in urdf_names() or load_arm(arm.name).fingerprint() != arm.fingerprint():
        return None
    from armloop.drake.experiments.scenarios import load_plant

    return load_plant(arm.name).config.ranges
