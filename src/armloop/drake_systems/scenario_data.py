"""The fields of scenario files, with their units and defaults: plain data, as `pydrake.common.yaml` reads it.

Checks are in `scenarios`. No postponed annotations here: the reader looks at the types themselves, and it
knows `Optional[X]`, not `X | None`.
"""

from dataclasses import dataclass, field
from typing import Optional

CONTROLLERS = ("pid", "pid_step1", "pid_step2", "pid_step3", "computed_torque", "bounded", "exact")
"""PID without a model and with 1, 2 or 3 steps of one, Eqs. (35) and (36); computed torque with a model; PID with Step III
on the motion nearest to the reference that keeps the limits; PID with the simulated arm's own inverse dynamics,
which no reconstruction can reach."""
PAPER = ("pid", "pid_step1", "pid_step3")
"""The controllers of Fig. 15."""


@dataclass
class FrictionData:
    """Eq. (34) of one joint."""

    static: float = 0.0  # f_s, N*m (N for a prismatic joint)
    coulomb: float = 0.0  # f_c, N*m (N)
    stribeck_velocity: float = 0.1  # v_s, rad/s (m/s)
    viscous: float = 0.0  # f_v, N*m*s/rad (N*s/m)


@dataclass
class RangesData:
    """What the joints may do during a collection, one number per joint."""

    lower: list[float] = field(default_factory=list)  # rad (m)
    upper: list[float] = field(default_factory=list)  # rad (m)
    velocity: list[float] = field(default_factory=list)  # rad/s (m/s), both directions
    acceleration: list[float] = field(default_factory=list)  # rad/s^2 (m/s^2), both directions


@dataclass
class PlantData:
    """A simulated arm."""

    arm: str = ""  # built-in name, or the path of a URDF, from the scenario's folder; `--arm` replaces it
    friction: list[FrictionData] = field(default_factory=list)  # one per joint, base to tip
    ranges: Optional[RangesData] = None  # from the limits when absent
    time_step: float = 0.001  # s, of the plant and of the controllers
    encoder_counts: int = 524288  # per revolution; 0 for ideal encoders
    prismatic_lead: float = 0.02  # m per revolution of a sliding joint's screw
    torque_noise: float = 0.01  # standard deviation, as a part of each joint's RMS


@dataclass
class PlanData:
    """How much is collected; see `CollectionPlan`."""

    rate: float = 250.0  # Hz of the logs
    segment_time_step: float = 0.002  # s, of the plant during segments of constant velocity
    dwell: bool = False  # stand still at the static poses instead of creeping
    static_poses: int = 48  # each in both directions
    static_speed: float = 0.0017453292519943296  # rad/s (0.1 deg/s)
    static_speed_prismatic: float = 0.0001  # m/s
    static_settle: float = 0.09  # s before the log of a segment starts
    static_hold: float = 0.35  # s that are logged
    velocity_segments: int = 100
    slowest: float = 0.01  # rad/s
    slowest_prismatic: float = 0.001  # m/s
    velocity_settle: float = 0.08  # s
    velocity_hold: float = 0.4  # s
    trajectories: int = 3  # Fourier-series trajectories
    trajectory_duration: float = 20.0  # s each


@dataclass
class ReferenceData:
    """What to track."""

    # paper: Fig. 14, three joints; fourier: random within the ranges; places: from place to place; csv: of `file`
    kind: str = "paper"
    file: str = ""  # of a csv one, as `armloop excite` writes it; its path from the scenario's folder
    unit: float = 0.1  # rad, of the paper's k
    periods: int = 2  # of 20 s, of the paper's
    duration: float = 40.0  # s, of a fourier one
    places: list[list[float]] = field(default_factory=list)  # rad (m), one row per place
    dwell: float = 0.8  # s of rest at each place
    pace: float = 1.0  # share of the ranges' velocities between places; squared, of the accelerations


@dataclass
class PickupData:
    """A load that is grasped mid-run; the run is by PID with Step III."""

    at: float = 20.0  # s
    diagnose_at: float = 40.0  # s, when the log since the grasp is diagnosed and the feedforward swapped
    mass: float = 0.5  # kg
    com: list[float] = field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # m, in the frame of the link `tool`, else the last


@dataclass
class WearData:
    """Friction that is drawn many times over; the model stays."""

    samples: int = 24
    spread: float = 0.3  # standard deviation of the logarithm of each friction parameter


@dataclass
class LimitsData:
    """What the drives can do, where it is less than the URDF says."""

    effort: list[float] = field(default_factory=list)  # N*m (N), one per joint; the URDF's when empty
    rate: list[float] = field(
        default_factory=list
    )  # N*m/s (N/s), how fast a torque may change; any when empty
    used: float = 0.95  # share of effort and rate that `bounded` plans with; the rest is left to the feedback


@dataclass
class TrackingData:
    """A tracking experiment."""

    plant: str = ""  # a plant of plants.yaml, or empty when `own_plant` is given
    own_plant: Optional[PlantData] = None
    kp: list[float] = field(default_factory=lambda: [80.0])  # N*m/rad (N/m); one number, or one per joint
    ki: list[float] = field(default_factory=lambda: [8.0])  # N*m/(rad s)
    kd: list[float] = field(default_factory=lambda: [2.0])  # N*m*s/rad
    reference: ReferenceData = field(default_factory=ReferenceData)
    score: list[float] = field(default_factory=lambda: [20.0, 40.0])  # s, start and end; []: the whole run
    controllers: list[str] = field(default_factory=lambda: list(PAPER))
    bandwidth: float = 20.0  # rad/s, of computed torque: errors decay critically damped
    random_seed: int = 0
    limits: Optional[LimitsData] = None
    pickup: Optional[PickupData] = None
    wear: Optional[WearData] = None
