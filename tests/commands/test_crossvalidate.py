"""What armloop crossvalidate makes of its options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import write_log
from armloop.identification import validation


class Enough(Exception):
    """What the fits are asked for is known."""


def test_friction_laws_and_a_lag_are_those_of_every_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[Any]()

    def crossvalidate(logs: Any, arm: Any, **how: Any) -> Any:
        asked.append(how["options"])
        raise Enough

    monkeypatch.setattr(validation, "crossvalidate", crossvalidate)
    motion = fourier_motion(5.0, 100.0, 1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    log = tmp_path / "run.csv"
    write_log(log, measured(motion, tau, 1))
    given = ["crossvalidate", str(log), "--arm", "three_axis"]
    for more in ([], ["--friction", "coulomb, viscous,", "--torque-lag", "0.005"]):
        with pytest.raises(Enough):
            main([*given, *more])
    plain, own = asked
    assert plain.friction is None and plain.torque_lag is None
    assert own.friction == ("coulomb", "viscous") and own.torque_lag == 0.005
