"""How often the truth lies within one, two and three stated standard errors: mixed logs of random arms from MuJoCo.

Arms of two to six joints (those of `make long`), an engine, controller and noise that armloop has no part in. Friction is
each joint's Coulomb level and viscous coefficient; base parameters are those of the rigid-body library. A mean that is not
nearly nothing is a bias that the stated errors do not contain.

    python benchmarks/coverage_mixed_logs.py [--arms 10]

One minute. Of ten arms: 231 base parameters 79, 98 and 99 % within one, two and three; 40 Coulomb levels 60, 98 and 100 %,
mean +0.6; 40 viscous coefficients 52, 82 and 100 %, mean -0.8: half of that bias
comes of accelerations that are differentiated from v.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.stats import norm

from armloop.data.log import read_log
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import Options, reconstruct
from armloop.reports.tables import table
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from outside.test_mixed_logs import TEN, a_mixed_log


def off(seed: int, joints: int, folder: Path) -> dict[str, list[float]]:
    """Estimate minus truth, in stated standard errors, of one arm."""
    made, arm, log = a_mixed_log(seed, joints, 60.0, folder)
    model = reconstruct([read_log(log)], arm, library="rigid-body", options=Options(parts=False)).model
    true = nominal_parameters(load_arm(made.write_urdf(folder / "true.urdf")))
    base = BaseParameters.of_arm(arm, rotors=True)
    truth = base.from_full(np.append(true, [link.armature for link in made.links]))
    errors = model.uncertainty["shared"]
    known = [(name, x, t) for name, x, t in zip(base.names, model.components[0].values, truth, strict=True)]
    found = {"base parameters": [(x - t) / errors[n]["std_error"] for n, x, t in known if n in errors]}
    lines = list(zip(made.links, model.uncertainty["friction_line"], strict=True))
    for key, name in (("coulomb", "frictionloss"), ("viscous", "damping")):
        found[key] = [(s[key]["value"] - getattr(link, name)) / s[key]["std_error"] for link, s in lines]
    return found


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description="coverage of stated standard errors on mixed logs")
    parser.add_argument("--arms", type=int, default=len(TEN), help="the first so many (%(default)s)")
    total: dict[str, list[float]] = {}
    for seed, joints in TEN[: parser.parse_args().arms]:
        with tempfile.TemporaryDirectory() as folder:
            for kind, values in off(seed, joints, Path(folder)).items():
                total.setdefault(kind, []).extend(values)
    rows = [["a normal error", "", *(f"{1 - 2 * norm.sf(k):.1%}" for k in (1, 2, 3)), 0.0]]
    for kind, values in total.items():
        x = np.array(values)
        rows.append([kind, len(x), *(f"{np.mean(np.abs(x) < k):.1%}" for k in (1, 2, 3)), float(x.mean())])
    print(table(["", "number", "within 1", "within 2", "within 3 standard errors", "mean"], rows))


if __name__ == "__main__":
    main()
