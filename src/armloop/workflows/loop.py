"""The main job: measure → reconstruct → control → measure again → residual → effect → augmented model → control."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.regimes import sort_samples
from armloop.data.signals import as_torque, preprocess
from armloop.diagnosis import Diagnosis, diagnose
from armloop.drake.experiments.collection import collect, measure_run
from armloop.drake.experiments.scenarios import TrackingScenario, load_plan, load_tracking
from armloop.drake.experiments.tracking import track
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.view.replay import write_replay
from armloop.experiment.sampling import CONDITIONS
from armloop.identification.reconstruction import Reconstruction, reconstruct
from armloop.model import ReconstructedModel, load_model
from armloop.reports.loop_result import LoopResult
from armloop.robot.arm import Arm
from armloop.util.files import write_figure, write_json, write_text
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Pool
from armloop.workflows.measured import MEASURED_FILES, run_measured
from armloop.workflows.tracking import tracking_answer
from armloop.workflows.undeclared import draw

SCHEMA = "armloop/loop/1"
SCENARIO = "three_axis_tracking"
#: Folder of what is measured, beside what is simulated.
MEASURED = "measured"
#: What the loop writes, beside its logs.
LOOP_FILES = (
    *(f"logs/{name}.csv" for name in (*CONDITIONS, "second_run")),
    "model.json",
    "augmented.json",
    "diagnosis.json",
    "loop.json",
    "loop.png",
    "replay.html",
    "report.html",
    *(f"{MEASURED}/{name}" for name in MEASURED_FILES),
)


def run_loop(folder: Path, seed: int, progress: Progress) -> LoopResult:
    """Run the loop on the three-axis arm, print its tables and write its files into ``folder``; likewise on measured
    logs of a UR5 (:mod:`armloop.workflows.measured`), in a process of its own while this one diagnoses and draws.

    What the diagnosis is given of the second run are two files: the model and the log.
    """
    from armloop.reports.diagnosis_tables import diagnosis_table
    from armloop.reports.html import Section
    from armloop.reports.loop_report import loop_report
    from armloop.reports.loop_stages import loop_figure
    from armloop.reports.tables import eta_table, score_table, steps_table
    from armloop.reports.words import controller

    scenario = load_tracking(SCENARIO)
    plant = scenario.plant
    seconds: dict[str, float] = {}
    clock = partial(_clock, seconds)
    with clock("collect", "1/7 measure: collecting three logs on the simulated arm"):
        tell = paced(progress)
        logs = collect(
            plant.arm,
            plant.config,
            load_plan("paper"),
            seed,
            lambda name, share: tell(f"recorded {round(100 * share)} of 100 %"),
            processes=2,
        )
        for name, log in logs.items():
            write_log(folder / "logs" / f"{name}.csv", log)
    with Pool(2) as workers:  # two cores, no more
        with clock("reconstruct", "2/7 reconstruct: three steps, each inheriting the last"):
            sealed = workers.submit(_measure_with_effect, scenario, seed, folder / "logs" / "second_run.csv")
            one_shot = workers.submit(_reconstruct, list(logs.values()), plant.arm, "sindy")
            # it has a core while the main process regresses, diagnoses and draws
            pushed = workers.submit(_measured, folder / MEASURED)
            reconstruction = _reconstruct(list(logs.values()), plant.arm, "stepwise", progress)
            model = reconstruction.model
            model.save(folder / "model.json")
            samples = preprocess(list(logs.values()), model.conditioning)
            clusters = sort_samples(as_torque(samples).motion)
        print(steps_table(reconstruction.reports), end="\n\n")
        print(score_table(reconstruction.held_out, plant.arm), end="\n\n", flush=True)
        with clock("track", "3/7 control: tracking with three controllers"):
            undeclared = sealed.result()
            runs = [workers.submit(track, scenario, name, {"model": model}) for name in scenario.controllers]
            before_run = workers.submit(track, scenario, "pid_step3", {"model": model}, [undeclared])
            tracking = {name: run.result() for name, run in zip(scenario.controllers, runs, strict=True)}
            reference = one_shot.result()
        print(eta_table(tracking, paper=True), end="\n\n", flush=True)
        with clock("diagnose", "4/7 measured again: tracing the residual of the second run"):
            diagnosis = _diagnose(folder, progress)
        print(diagnosis_table(diagnosis), end="\n\n", flush=True)
        with clock("track_again", "5/7 control better: tracking with the augmented model"):
            after_run = workers.submit(
                track, scenario, "pid_augmented", {"augmented": diagnosis.model}, [undeclared]
            )
            labels = {name: controller(name) for name in tracking}
            write_replay(folder / "replay.html", plant.arm, tracking, labels=labels)
            before, after = before_run.result(), after_run.result()
        right = _is_right(diagnosis, undeclared)
        again = {"before (model as collected)": before, "after (augmented model)": after}
        print(eta_table(again, paper=False))
        print(
            f"undeclared effect: {_in_words(undeclared)}; the verdict was {'right' if right else 'WRONG'}\n"
        )
        with clock("measured", "6/7 the same on measured data: a UR5 that was pushed"):
            measured_words, measured_section = pushed.result()
        print(f"On measured data (currents as logged)\n\n{measured_words}\n", flush=True)
    result = LoopResult(
        seed=seed,
        arm=plant.arm,
        logs=logs,
        clusters=clusters,
        reconstruction=reconstruction,
        reference=reference,
        tracking=tracking,
        diagnosis=diagnosis,
        undeclared=_revealed(undeclared),
        right=right,
        tracking_before=before,
        tracking_after=after,
        seconds=seconds,
        notes=reconstruction.notes,
    )
    with clock("report", "7/7 writing the report"):
        write_json(folder / "loop.json", loop_answer(result, scenario))
        sections = [Section.from_dict(measured_section)]
        links = [("The pushed UR5", f"{MEASURED}/report.html")]
        write_text(folder / "report.html", loop_report(result, further=sections, links=links))
        write_figure(folder / "loop.png", loop_figure(result))
    print(f"open {folder}/report.html  ({sum(seconds.values()):.0f} s)")
    return result


def loop_answer(result: LoopResult, scenario: TrackingScenario) -> dict[str, Any]:
    """The content of ``loop.json``."""
    return {
        "schema": SCHEMA,
        "seed": result.seed,
        "reconstruct": result.reconstruction.to_dict(),
        "sindy": None if result.reference is None else result.reference.to_dict(),
        "tracking": tracking_answer(scenario, result.tracking),
        "diagnosis": result.diagnosis.to_dict(),
        "undeclared": result.undeclared,
        "right": result.right,
        "tracking_with_effect": {
            "before": {"eta_deg": result.tracking_before.eta.tolist()},
            "after": {"eta_deg": result.tracking_after.eta.tolist()},
        },
        "seconds": result.seconds,
    }


def _measure_with_effect(scenario: TrackingScenario, seed: int, path: Path) -> UndeclaredEffect:
    """Draw the effect, measure a run of the arm that has it, and write the log; the effect stays sealed."""
    effect = draw(scenario.plant.arm, seed)
    write_log(path, measure_run(scenario.plant.arm, scenario.plant.config, seed + 500, effects=[effect]))
    return effect


def _measured(folder: Path) -> tuple[str, dict[str, Any]]:
    """The measured part: its words for a terminal, and its section of the report, drawn."""
    from armloop.reports.measured_report import measured_section, measured_words

    folder.mkdir(exist_ok=True)
    found = run_measured(folder, silent)
    return measured_words(found), measured_section(found).to_dict()


def _reconstruct(logs: list[MotionLog], arm: Arm, method: str, progress: Progress = silent) -> Reconstruction:
    # The paper's own library: its three steps, and what each of them is worth to a controller, are what is shown.
    return reconstruct(logs, arm, method, "double-feature-set", progress=progress)


def _diagnose(folder: Path, progress: Progress) -> Diagnosis:
    """Diagnose from the two files a user would have, the model and the log."""
    model: ReconstructedModel = load_model(folder / "model.json")
    log = read_log(folder / "logs" / "second_run.csv", joints=model.arm.n)
    diagnosis = diagnose(model, [log], progress, jobs=1)  # the other core is at the measured logs
    write_json(folder / "diagnosis.json", diagnosis.to_dict())
    diagnosis.model.save(folder / "augmented.json")
    return diagnosis


def _is_right(diagnosis: Diagnosis, undeclared: UndeclaredEffect) -> bool:
    return diagnosis.named == [(undeclared.name, undeclared.joint)] and diagnosis.unlisted is None


def _revealed(undeclared: UndeclaredEffect) -> dict[str, Any]:
    parameters = {key: np.asarray(value).tolist() for key, value in undeclared.parameters.items()}
    return {"effect": undeclared.name, "joint": undeclared.joint, "parameters": parameters}


def _in_words(undeclared: UndeclaredEffect) -> str:
    numbers = ", ".join(f"{key} {np.round(value, 4)}" for key, value in undeclared.parameters.items())
    return f"{undeclared.build().label()} ({numbers})"


@contextmanager
def _clock(seconds: dict[str, float], stage: str, words: str) -> Iterator[None]:
    """Announce a stage, for what is printed in it, and keep its wall time."""
    print(words, flush=True)
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
