"""The description of scenario files: fields with their units, ranges and defaults.

What must agree between fields, and with the arm, is checked in `scenarios`.
"""

from typing import Annotated

from msgspec import Meta, Struct, field

from armloop.schemas.types import MOST_JOINTS, Finite, Name, NotNegative, Positive, Vector3

Numbers = Annotated[list[Finite], Meta(max_length=MOST_JOINTS)]  # one per joint, or one for all
Above = Annotated[list[Positive], Meta(max_length=MOST_JOINTS)]
Seed = Annotated[int, Meta(ge=0, lt=1 << 62)]

PAPER = ("pid", "pid_step1", "pid_step3")
"""The controllers of Fig. 15."""


class FrictionData(Struct, forbid_unknown_fields=True):
    """Eq. (34) of one joint."""

    static: NotNegative = 0.0  # f_s, N*m (N for a prismatic joint)
    coulomb: NotNegative = 0.0  # f_c, N*m (N)
    stribeck_velocity: Annotated[float, Meta(ge=1e-6, le=100)] = 0.1  # v_s, rad/s (m/s)
    viscous: NotNegative = 0.0  # f_v, N*m*s/rad (N*s/m)


class RangesData(Struct, forbid_unknown_fields=True):
    """What the joints may do during a collection, one number per joint."""

    lower: Numbers = []  # rad (m)
    upper: Numbers = []  # rad (m)
    velocity: Above = []  # rad/s (m/s), both directions
    acceleration: Above = []  # rad/s^2 (m/s^2), both directions


class PlantData(Struct, forbid_unknown_fields=True):
    """A simulated arm."""

    arm: Name = ""  # built-in name, or the path of a URDF, from the scenario's folder; `--arm` replaces it
    lock: dict[
        str, Finite
    ] = {}  # positions, rad (m), of moving joints that are fixed there, such as a gripper's
    tip: Name = ""  # the arm's last link; moving joints off the way to it are fixed at zero
    friction: Annotated[
        list[FrictionData], Meta(max_length=MOST_JOINTS)
    ] = []  # one per joint, base to tip; of a usual size when empty
    rotor_inertia: Annotated[
        list[NotNegative], Meta(max_length=MOST_JOINTS)
    ] = []  # of each drive, kg*m^2 (kg) at its joint
    ranges: RangesData | None = None  # from the limits when absent
    time_step: Annotated[float, Meta(ge=1e-4, le=5e-3)] = 0.001  # s, of the plant and of the controllers
    encoder_counts: Annotated[int, Meta(ge=0, le=1 << 40)] = 524288  # per revolution; 0 for ideal encoders
    prismatic_lead: Annotated[float, Meta(gt=0, le=100)] = 0.02  # m per revolution of a sliding joint's screw
    torque_noise: Annotated[float, Meta(ge=0, le=100)] = (
        0.01  # standard deviation, as a part of each joint's RMS
    )


class PlanData(Struct, forbid_unknown_fields=True, frozen=True):
    """How much is collected: every segment settles, then is logged."""

    rate: Annotated[float, Meta(ge=10, le=1e4)] = 250.0  # Hz of the logs
    segment_time_step: Annotated[float, Meta(ge=1e-4, le=5e-3)] = (
        0.002  # s, of the plant during segments of constant velocity
    )
    dwell: bool = False  # stand still at the static poses instead of creeping; friction then hides up to f_s of the torque
    static_poses: Annotated[int, Meta(ge=0, le=10_000)] = (
        48  # creeping segments go through each in both directions
    )
    static_speed: Positive = 0.0017453292519943296  # rad/s: 0.1 deg/s, as in the paper
    static_speed_prismatic: Positive = 0.0001  # m/s
    static_settle: Annotated[float, Meta(ge=0, le=600)] = (
        0.09  # s before the log of a segment starts: long enough for the servo to take over the weight of a sliding joint
    )
    static_hold: Annotated[float, Meta(ge=0.02, le=600)] = 0.35  # s that are logged
    velocity_segments: Annotated[int, Meta(ge=0, le=10_000)] = (
        100  # from `slowest` to the range's largest speed
    )
    slowest: Positive = 0.01  # rad/s
    slowest_prismatic: Positive = 0.001  # m/s
    velocity_settle: Annotated[float, Meta(ge=0, le=600)] = 0.08  # s
    velocity_hold: Annotated[float, Meta(ge=0.02, le=600)] = 0.4  # s
    trajectories: Annotated[int, Meta(ge=0, le=1000)] = 3  # Fourier-series trajectories, Eq. (31)
    trajectory_duration: Annotated[float, Meta(ge=5, le=600)] = 20.0  # s each


class ReferenceData(Struct, forbid_unknown_fields=True):
    """What to track."""

    # paper: Fig. 14, three joints; fourier: random within the ranges; places: from place to place; csv: of `file`

    kind: Name = "paper"
    file: Name = ""  # of a csv one, as `armloop excite` writes it; its path from the scenario's folder
    unit: Annotated[float, Meta(gt=0, le=1)] = 0.1  # rad, of the paper's k
    periods: Annotated[int, Meta(ge=1, le=30)] = 2  # of 20 s, of the paper's
    duration: Annotated[float, Meta(ge=5, le=600)] = 40.0  # s, of a fourier one
    places: Annotated[list[Numbers], Meta(max_length=1000)] = []  # rad (m), one row per place
    dwell: Annotated[float, Meta(ge=0.01, le=60)] = 0.8  # s of rest at each place
    pace: Annotated[float, Meta(ge=0.01, le=10)] = (
        1.0  # share of the ranges' velocities between places; squared, of the accelerations
    )


class PlantEffectData(Struct, forbid_unknown_fields=True):
    """An effect that the simulated arm has and no model is told of."""

    effect: Name  # as a diagnosis names it
    joint: Annotated[int, Meta(ge=1, le=MOST_JOINTS)] | None = (
        None  # from 1; none for what is of the whole arm
    )
    other_joint: Annotated[int, Meta(ge=1, le=MOST_JOINTS)] | None = None  # of a pair
    parameters: Annotated[
        dict[str, Finite | Vector3], Meta(max_length=100)
    ] = {}  # in SI units, as in docs/effects.md


class PickupData(Struct, forbid_unknown_fields=True):
    """A load that is grasped mid-run; the run is by PID with Step III."""

    at: Annotated[float, Meta(gt=0, le=600)] = 20.0  # s
    diagnose_at: Annotated[float, Meta(gt=0, le=600)] = (
        40.0  # s, when the log since the grasp is diagnosed and the feedforward swapped
    )
    mass: Annotated[float, Meta(gt=0, le=1e4)] = 0.5  # kg
    com: Vector3 = field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # m, in the frame of the link `tool`, else the last


class WearData(Struct, forbid_unknown_fields=True, frozen=True):
    """Friction that is drawn many times over; the model stays."""

    samples: Annotated[int, Meta(ge=2, le=10_000)] = 24
    spread: Annotated[float, Meta(gt=0, le=1)] = (
        0.3  # standard deviation of the logarithm of each friction parameter
    )


class LimitsData(Struct, forbid_unknown_fields=True):
    """What the drives can do, where it is less than the URDF says."""

    effort: Above = []  # N*m (N), one per joint; the URDF's when empty
    rate: Above = field(default_factory=list)  # N*m/s (N/s), how fast a torque may change; any when empty
    used: Annotated[float, Meta(ge=0.1, le=1)] = (
        0.95  # share of effort and rate that `bounded` plans with; the rest is left to the feedback
    )


class TrackingData(Struct, forbid_unknown_fields=True):
    """A tracking experiment."""

    plant: Name = ""  # a plant of plants.yaml, or empty when `own_plant` is given
    own_plant: PlantData | None = None
    kp: Numbers = field(default_factory=lambda: [80.0])  # N*m/rad (N/m); one number, or one per joint
    ki: Numbers = field(default_factory=lambda: [8.0])  # N*m/(rad s)
    kd: Numbers = field(default_factory=lambda: [2.0])  # N*m*s/rad
    reference: ReferenceData = field(default_factory=ReferenceData)
    score: Numbers | None = None  # s, start and end; []: the whole run; its second half when absent
    controllers: Annotated[list[Name], Meta(max_length=100)] = field(default_factory=lambda: list(PAPER))
    # rad/s, of computed torque, whose errors decay critically damped; by default each joint's is such that it is as stiff

    # as kp makes it where the reference begins, but at most a tenth of the sampling rate
    bandwidth: Positive | None = None
    random_seed: Seed = 0
    limits: LimitsData | None = None
    # what has changed about the arm; where a model is reconstructed first, it is of the arm without them
    effects: Annotated[list[PlantEffectData], Meta(max_length=100)] = []
    pickup: PickupData | None = None
    wear: WearData | None = None
