"""The loop on a measured arm: a model of free motion, a run in which something undeclared happened, what it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.log import read_log
from armloop.data.motion import Samples
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, close, diagnose
from armloop.identification.reconstruction import reconstruct
from armloop.identification.scoring import residual, score
from armloop.laws.effects.events import ends
from armloop.model import ReconstructedModel
from armloop.reports.loop_result import MeasuredResult
from armloop.robot.arm import load_arm
from armloop.util.files import write_json, write_text
from armloop.util.progress import Progress
from armloop.util.resources import measured_folder

#: What the measured loop writes.
MEASURED_FILES = ("measured.json", "model.json", "report.html")
_GAINS = [12.5, 12.5, 12.5, 9.2, 9.2, 9.2]  # N·m/A
_TRAINED_ON = ("no1", "no2", "no8_singularity_free_1")
_FREE, _PUSHED = "no9_singularity_free_nodist", "no9_singularity_free_wdist"
#: What those who measured say of a further run of the pushed motion, with a force sensor at the tool: the record itself
#: is not published with these logs. Smallest and largest, s and N.
FORCE_RECORD = {"seconds": (0.4, 1.4), "force": (18.0, 51.0)}
SCHEMA = "armloop/measured/1"


def run_measured(folder: Path, progress: Progress) -> MeasuredResult:
    """Reconstruct a UR5 from free motion, then diagnose a run in which it was pushed; write what was found."""
    data = measured_folder("ur5")
    arm = load_arm(data / "ur5.urdf")

    def log(name: str) -> Any:
        path = data / f"{name}.parquet"
        return read_log(path, joints=arm.n, tau_unit="A", drive_gains=_GAINS, quiet=True)

    progress("1/3 a model of the measured arm from three runs of free motion")
    model = reconstruct(
        [log(name) for name in _TRAINED_ON],
        arm,
        library="rigid-body",  # there is a URDF, and comparing libraries takes as long again
        recorded={"unit": "A", "drive_gains": _GAINS},
    ).model
    progress("2/3 a free run that the model was not made of")
    free = score(model, preprocess([log(_FREE)], model.conditioning))
    progress("3/3 the same motion, in which something happened that nobody declared")
    pushed = log(_PUSHED)
    diagnosis = diagnose(model, [pushed], progress)
    result = MeasuredResult(model, free, diagnosis, _during(model, diagnosis), FORCE_RECORD)
    from armloop.reports.diagnosis_report import diagnosis_report

    model.save(folder / "model.json")
    compensation = close(model, diagnosis.model, diagnosis.samples)
    write_text(folder / "report.html", diagnosis_report(diagnosis, model, compensation))
    answer = {
        "schema": SCHEMA,
        "data": "UR5, Kufieta 2014, Apache-2.0",
        "free_run": free.to_dict(),
        "diagnosis": diagnosis.to_dict(),
        "rmse_while_pushed": result.during,
    }
    write_json(folder / "measured.json", answer)
    return result


def _during(model: ReconstructedModel, diagnosis: Diagnosis) -> dict[str, list[float]]:
    """RMSE per joint in the intervals of the contacts, with the model before and after."""
    samples: Samples = diagnosis.samples
    rows = np.zeros(samples.motion.samples, dtype=bool)
    for contact in diagnosis.contacts:
        start, end = ends(contact.added.parameters)
        rows |= (samples.motion.time >= start) & (samples.motion.time <= end)
    if not rows.any():
        return {"before": [np.nan] * model.arm.n, "after": [np.nan] * model.arm.n}
    errors = [np.sqrt(np.mean(residual(m, samples)[rows] ** 2, axis=0)) for m in (model, diagnosis.model)]
    return {key: error.tolist() for key, error in zip(("before", "after"), errors, strict=True)}
