"""The replay is one file that needs nothing else."""

import dataclasses
import logging
import re

import numpy as np
import pytest

from armloop.arm import Arm, load_arm
from armloop.drake_systems.replay import write_replay
from armloop.drake_systems.tracking import TrackingResult


def result(controller, n):
    time = np.arange(0.0, 0.4, 1e-3)
    q = 0.05 + 0.1 * np.sin(time)[:, None] * np.ones(n)
    zero = np.zeros(n)
    return TrackingResult(controller, time, q, q + 0.01, q, slice(0, 10), zero, zero, zero, ("deg",) * n)


@pytest.mark.parametrize("arm", ["three_axis", "scara", "without shapes"])
def test_one_offline_html_file(arm, tmp_path, caplog):
    caplog.set_level(logging.INFO)
    level = logging.getLogger("drake").level
    if arm == "without shapes":
        arm = Arm.from_dict(load_arm("three_axis").to_dict())
    else:
        arm = load_arm(arm)
    path = tmp_path / "replay.html"
    write_replay(path, arm, {name: result(name, arm.n) for name in ("pid", "pid_step3")})
    assert logging.getLogger("drake").level == level
    assert not caplog.records  # no word of an address that is already gone
    html = path.read_text(encoding="utf-8")
    assert html.lstrip().lower().startswith("<!doctype html")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=.https?:", html)
    assert [p.name for p in tmp_path.iterdir()] == ["replay.html"]
    assert path.stat().st_size < 10e6


def test_an_arm_with_meshes_is_drawn_as_sticks(tmp_path):
    arm = load_arm("three_axis")
    urdf = arm.urdf.replace('<cylinder radius="0.03" length="0.2"/>', '<mesh filename="nowhere.obj"/>', 1)
    arm = dataclasses.replace(arm, urdf=urdf)
    write_replay(tmp_path / "replay.html", arm, {"pid": result("pid", 3)})
    assert (tmp_path / "replay.html").is_file()
