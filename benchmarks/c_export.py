"""One torque of a six-joint arm: the exported C file against the model's own feedforward in Python, and Pinocchio.

Pinocchio's RNEA (links alone, no friction) is measured only where the package `pin` can be imported. The rival is
named in each line; only the ratios carry from one machine to another.
"""

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from armloop.export.c_code import c_source
from armloop.export.expressible import said
from armloop.export.reading_c import FLAGS, compiler
from armloop.export.robot_xml import urdf_text
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm, Joint
from armloop.robot.kinematics import nominal_parameters

LOOP = """
#include <time.h>
double armloop_bench(long calls, const double *q, const double *v, const double *vdot, long states)
{
    struct timespec a, b;
    double tau[6], sum = 0.0;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (long k = 0; k < calls; ++k) {
        long s = 6 * (k % states);
        armloop_torque(q + s, v + s, vdot + s, tau);
        sum += tau[0];
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    return 1e9 * (b.tv_sec - a.tv_sec) + (b.tv_nsec - a.tv_nsec) + 0.0 * sum;
}
"""
FRICTION = (
    FrictionTerm("sign", 3.0),
    FrictionTerm("stribeck", -0.8, 0.1),
    FrictionTerm("viscous", 5.0),
    FrictionTerm("load_sign", 0.04),
)


def arm() -> Arm:
    """A six-joint arm with the proportions of a UR: parallel shoulder, elbow and wrist axes, then two crossing."""
    half = np.pi / 2
    rotations = [(0, 0), (half, 0), (0, 0), (0, 0), (half, 0), (-half, 0)]
    offsets = [(0, 0, 0.18), (0, 0, 0), (-0.61, 0, 0), (-0.57, 0, 0.17), (0, -0.12, 0), (0, 0.11, 0)]
    X = np.tile(np.eye(4), (6, 1, 1))
    for i, ((roll, _), offset) in enumerate(zip(rotations, offsets, strict=True)):
        c, s = np.cos(roll), np.sin(roll)
        X[i, :3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
        X[i, :3, 3] = offset
    mass = np.array([7.8, 12.9, 3.9, 2.0, 2.0, 0.2])
    com = np.array(
        [[0, -0.02, 0.03], [-0.3, 0, 0.16], [-0.28, 0, 0.04], [0, 0, 0.01], [0, 0, 0.01], [0, 0, -0.02]]
    )
    inertia = np.array(
        [m * ((0.004 + c @ c) * np.eye(3) - np.outer(c, c)) for m, c in zip(mass, com, strict=True)]
    )
    joints = tuple(Joint(f"joint_{k}", "revolute", -6.2, 6.2, 3.0, 300.0) for k in range(1, 7))
    return Arm("six_joints", joints, X, np.tile([0.0, 0.0, 1.0], (6, 1)), mass, com, inertia)


def main() -> None:
    """Print nanoseconds a call and their ratios."""
    six = arm()
    body = RigidBody(np.append(nominal_parameters(six), np.full(6, 0.2)), ("m1",), np.ones(1))
    model = ReconstructedModel(six, (body,), FrictionLaw((FRICTION,) * 6))
    rng = np.random.default_rng(0)
    states = [np.ascontiguousarray(x) for x in rng.uniform(-2, 2, (3, 256, 6))]
    drive = model.drive()
    python = _python(lambda k: drive(states[0][k], states[1][k], states[2][k]))
    print(f"model.feedforward in Python   {python:10.0f} ns a call")
    program = compiler()
    if program is None:
        print("no C compiler is at hand (cc, gcc, clang): the exported file cannot be measured")
        return
    for flags in ("-O2", "-O3 -march=native"):
        compiled = _compiled(program, c_source(model)[0], states, flags)
        print(f"exported C, {flags:18s}{compiled:10.0f} ns a call, 1/{python / compiled:.0f} of Python's")
    try:
        import pinocchio as pin
    except ImportError:
        print("Pinocchio is not installed (pip install pin): its RNEA is not measured")
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf_text(said(model)))
        other = pin.buildModelFromUrdf(str(path))
    data = other.createData()
    rnea = _python(lambda k: pin.rnea(other, data, states[0][k], states[1][k], states[2][k]))
    print(
        f"pinocchio.rnea from Python    {rnea:10.0f} ns a call (links alone), exported C 1/{rnea / compiled:.0f} of it"
    )


def _python(call, calls: int = 500) -> float:
    call(0)
    best = np.inf
    for _ in range(20):
        begin = time.perf_counter()
        for k in range(calls):
            call(k % 256)
        best = min(best, (time.perf_counter() - begin) / calls)
    return 1e9 * best


def _compiled(program: str, source: str, states: list, flags: str, calls: int = 4000) -> float:
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder) / "arm.c", Path(folder) / "arm.so"
        file.write_text(source + LOOP)
        kept = [flag for flag in FLAGS if flag not in ("-std=c99", "-O2")]
        line = [
            program,
            "-std=gnu99",
            *kept,
            *flags.split(),
            "-shared",
            "-fPIC",
            "-o",
            str(library),
            str(file),
            "-lm",
        ]
        subprocess.run(line, check=True)
        bench = ctypes.CDLL(str(library)).armloop_bench
    bench.restype = ctypes.c_double
    pointer = ctypes.POINTER(ctypes.c_double)
    arguments = [x.ctypes.data_as(pointer) for x in states]
    return min(bench(ctypes.c_long(calls), *arguments, ctypes.c_long(256)) for _ in range(300)) / calls


if __name__ == "__main__":
    main()
