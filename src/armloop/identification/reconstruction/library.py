"""Interface of a library of candidate functions; whoever chooses among libraries asks it, not its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from armloop.data.pieces import LogSource
from armloop.data.signals import Conditioning
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.options import Options
from armloop.robot.arm import Arm
from armloop.util.progress import Progress

#: The reference method, there to be beaten: it needs all samples in memory, and nothing beyond its terms is looked for.
REFERENCE = "sindy"
#: Ways of regressing a library, the default first.
METHODS = ("stepwise", REFERENCE)

Find = Callable[[Arm, Data, Options, Progress], Found]


class Library:
    """A library of candidate functions, and how a model is found among them.

    Class attributes:
        name: of the option ``--library``.
        methods: how it is regressed, by the names of :data:`METHODS`.
        conditioning: filter that suits it.
        shared: whether its coefficients serve all joints.
        own_friction: what friction it has of its own, where friction laws cannot be chosen; empty where they can.
    """

    name: ClassVar[str]
    methods: ClassVar[Mapping[str, Find]]
    conditioning: ClassVar[Conditioning]
    shared: ClassVar[bool] = True
    own_friction: ClassVar[str] = ""

    def suits(self, arm: Arm) -> bool:
        """Whether it is compared with others for an arm, where the user names none."""
        return True

    def asked(self, options: Options) -> bool:
        """Whether an option is set that only this library knows."""
        return False

    def undetermined(self, arm: Arm, logs: Sequence[LogSource], cutoff_hz: float) -> str:
        """Why its candidates cannot be told apart by the logs; empty where they may be."""
        return ""
