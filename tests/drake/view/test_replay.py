"""The replay is one file that needs nothing else."""

import dataclasses
import logging
import re
from types import SimpleNamespace

import numpy as np
import pytest

from armloop.drake.experiments.tracking import TrackingResult
from armloop.drake.view.replay import write_replay
from armloop.robot.arm import Arm, load_arm


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
    assert not re.search(r"<(script|link|img|iframe)[^>]*\s(src|href)=", html.split("<script", 1)[0])
    assert not re.search(r"<script[^>]*\ssrc=", html) and "@import" not in html
    # Meshcat's library, then the page's own script: what it loads stands in the page, and it connects to nobody.
    own = max(re.findall(r"<script\b[^>]*>(.*?)</script>", html, re.DOTALL)[1:], key=len)
    loaded = re.findall(r"fetch\((.{5})", own)
    assert len(loaded) > 10 and set(loaded) == {'"data'}
    assert "connect(" not in own and "new WebSocket" not in own
    assert [p.name for p in tmp_path.iterdir()] == ["replay.html"]
    assert path.stat().st_size < 10e6
    assert "pid_step3" in html[html.index('<div id="legend"') :] and "grey: the reference" in html


def test_an_arm_with_meshes_is_drawn_as_sticks(tmp_path):
    arm = load_arm("three_axis")
    urdf = arm.urdf.replace('<cylinder radius="0.03" length="0.2"/>', '<mesh filename="nowhere.obj"/>', 1)
    arm = dataclasses.replace(arm, urdf=urdf)
    write_replay(tmp_path / "replay.html", arm, {"pid": result("pid", 3)})
    assert (tmp_path / "replay.html").is_file()


class Rows:
    """Positions of which it is asked which rows are shown."""

    def __init__(self):
        self.asked = []

    def __getitem__(self, row):
        self.asked.append(row)
        return np.zeros(3)


@pytest.mark.parametrize(("of", "every"), [({}, 1024 / 25), ({"frames_per_second": 32.0}, 32)])
def test_as_many_frames_a_second_as_asked_for_from_the_first_sample_to_the_last(of, every, tmp_path):
    """25 a second by default; of 1024 samples a second, whose times are exact, each frame shows the next one."""
    run = SimpleNamespace(time=2.0 + np.arange(401) / 1024, q=Rows(), q_ref=Rows())
    write_replay(tmp_path / "replay.html", load_arm("three_axis"), {"pid": run}, **of)
    assert run.q.asked == run.q_ref.asked == np.ceil(np.arange(0, 400, every)).tolist()
