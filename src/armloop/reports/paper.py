"""The paper's own results that reports set beside ours."""

from __future__ import annotations

#: Mean absolute tracking error of the three joints, deg (the paper's text beside Fig. 15).
ETA_DEG: dict[str, tuple[float, ...]] = {
    "pid": (1.10, 1.21, 1.23),
    "pid_step1": (0.73, 0.50, 0.81),
    "pid_step3": (0.25, 0.25, 0.27),
}
