"""Seconds of the day that begin anew at midnight go on; other falls of a clock are left to be refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armloop.cli import main
from armloop.convert.clocks import DAY, through_midnight
from armloop.data.log import read_log


def test_a_clock_that_begins_anew_each_day_goes_on() -> None:
    time = 86399.0 + 0.002 * np.arange(1000)
    np.testing.assert_allclose(through_midnight(time % DAY, DAY), time, atol=1e-9)
    np.testing.assert_allclose(through_midnight(1e3 * (time % DAY), 1e3 * DAY), 1e3 * time, atol=1e-6)
    two_days = np.arange(0.0, 2.5 * DAY, 600.0) + 7.0
    np.testing.assert_allclose(through_midnight(two_days % DAY, DAY), two_days)


@pytest.mark.parametrize("fall", [-5.0, -DAY + 60.0, -DAY - 1.0])
def test_another_fall_is_none_of_midnight(fall: float) -> None:
    time = 80000.0 + 0.002 * np.arange(1000)
    time[500:] += fall
    assert through_midnight(time, DAY) is time
    rising = np.arange(5.0)
    assert through_midnight(rising, DAY) is rising or (through_midnight(rising, DAY) == rising).all()


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1), ("ms", 1000)])
def test_a_log_of_seconds_of_the_day_is_converted(unit: str, per_second: int, tmp_path: Path) -> None:
    time = 86398.0 + 0.004 * np.arange(1500)
    angle = np.sin(time - time[0])
    rows = [f"{per_second * (t % DAY):.3f},{q:.6f},{2 * q:.6f}" for t, q in zip(time, angle, strict=True)]
    source, mapping, out = (tmp_path / name for name in ("night.csv", "map.yaml", "log.parquet"))
    source.write_text("\n".join(["clock,angle,torque", *rows]))
    mapping.write_text(
        f"schema: armloop/map/1\ntime: {{column: clock, unit: {unit}}}\nq: {{columns: [angle], unit: rad}}\n"
        "tau: {columns: [torque], unit: N*m}\n"
    )
    assert main(["convert", str(source), "--map", str(mapping), "--out", str(out)]) == 0
    log = read_log(out)
    assert log.samples == 1500 and log.time[-1] - log.time[0] == pytest.approx(time[-1] - time[0])
