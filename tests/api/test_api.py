"""The package as Python: cheap to import, the commands' defaults, and results that show themselves."""

import inspect
import subprocess
import sys
from dataclasses import MISSING, fields, replace
from inspect import getattr_static

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

import armloop as al
from armloop.commands.diagnose import Diagnose
from armloop.commands.excite import Excite
from armloop.commands.options import Option
from armloop.commands.reconstruct import Reconstruct
from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.experiment.design import Settings
from armloop.identification.reconstruction import Options as ReconstructionOptions
from armloop.regression.sparse import Sparse
from armloop.util.errors import InputError, InputWarning, LogError

PUBLIC = (
    "MotionLog", "diagnose", "evaluate", "excite", "load_arm", "load_model", "read_log", "read_logs", "reconstruct", "track",
)  # fmt: skip


def run(seconds: float, seed: int, offset: float = 0.0) -> MotionLog:
    motion = fourier_motion(seconds, 200.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 1] += offset * motion.v[:, 1]
    return measured(motion, tau, seed, 0.005, f"run_{seed}")


@pytest.fixture(scope="module")
def model() -> "al.Model":
    return al.reconstruct(
        [run(25, 1), run(25, 2)],
        three_axis(),
        library="rigid-body",
        friction=["coulomb", "viscous", "stribeck"],
    )


@pytest.fixture(scope="module")
def found(model) -> "al.Diagnosis":
    return al.diagnose(model, run(25, 3, offset=0.8))


def test_every_public_name_loads_says_what_it_is_and_stands_in_the_documents(repository):
    document = (repository / "docs" / "api.md").read_text(encoding="utf-8")
    assert set(PUBLIC) < set(al.__all__)
    for name in al.__all__:
        assert name in dir(al)
        assert name == "__version__" or inspect.getdoc(getattr(al, name))
        assert f"`{name}" in document, name
    with pytest.raises(AttributeError, match="public are"):
        _ = al.bogus
    stubs = (repository / "src" / "armloop" / "__init__.pyi").read_text(encoding="utf-8")
    assert all(name in stubs for name in al.__all__)


def test_options_can_only_be_given_by_name():
    for function in (al.reconstruct, al.diagnose, al.track, al.excite, al.read_log, al.read_logs):
        parameters = inspect.signature(function).parameters.values()
        for parameter in parameters:
            if parameter.default is not inspect.Parameter.empty and parameter.name not in ("arm", "model"):
                assert parameter.kind is inspect.Parameter.KEYWORD_ONLY, (
                    f"{function.__name__}: {parameter.name}"
                )


@pytest.mark.parametrize(
    ("name", "options", "settings", "least"),
    [
        ("reconstruct", Reconstruct, (ReconstructionOptions, Sparse), 6),
        ("excite", Excite, (Settings,), 9),
        ("diagnose", Diagnose, (), 2),
    ],
)
def test_a_default_is_one_for_command_function_and_engine(name, options, settings, least):
    compared = 0
    for parameter in inspect.signature(getattr(al, name)).parameters.values():
        if (
            parameter.kind is inspect.Parameter.KEYWORD_ONLY
            and isinstance(getattr_static(options, parameter.name, None), Option)
            and parameter.name not in ("model", "held_out")  # an object here, a file there
        ):
            assert parameter.default == getattr(options, parameter.name), parameter.name
            compared += 1
    assert compared >= least
    for field in (field for kind in settings for field in fields(kind)):
        default = getattr(options, field.name, None)  # None: chosen by the arm or the data
        if default is not None and field.default is not MISSING:
            assert field.default == default, field.name


def test_a_model_scores_plots_and_shows_itself(model, tmp_path):
    test = run(20, 4)
    score = model.score(test)
    assert max(score.nrmse) < 0.1 and repr(score).count("\n") == 0 and "nRMSE" in str(score)
    assert len(model.plot(test).axes) == 6
    assert model.plot(test)._repr_png_().startswith(b"\x89PNG")  # what a notebook asks for
    assert repr(model).startswith("<armloop.Model of") and "\n" not in repr(model)
    assert "tau1 =" in str(model)
    held_out = [x for x in model.account.held_out.moving["nrmse"] if x is not None]
    assert f", held-out nRMSE {np.mean(held_out):.3g}>" in repr(model)
    model.save(tmp_path / "model.json")
    kept = [x for x in model.baseline["nrmse"] if x is not None]
    assert f", baseline nRMSE {np.mean(kept):.3g}>" in repr(al.load_model(tmp_path / "model.json"))
    assert "<img" in model._repr_html_() and "<pre" in score._repr_html_()
    assert model.report(tmp_path / "report.html").read_text().startswith("<!")
    model.save(tmp_path / "model.json")
    again = al.load_model(tmp_path / "model.json", "three_axis")
    assert again.score(test).nrmse == score.nrmse
    with pytest.raises(InputError, match="plot"):
        again.plot()
    with pytest.raises(InputError, match="report"):
        again.report(tmp_path / "other.html")
    assert again.export("c", tmp_path / "arm.c").files == [tmp_path / "arm.c"]


def test_a_log_is_compared_sample_by_sample_as_it_is_scored(model):
    logs = [run(20, 4), run(15, 5)]
    seen = model.compare(logs)
    N = len(seen.time)
    for each in (seen.q, seen.v, seen.vdot, seen.measured, seen.predicted, seen.residual, seen.moving):
        assert each.shape == (N, 3)
    np.testing.assert_array_equal(seen.residual, seen.measured - seen.predicted)
    assert len(seen.starts) == 2 and repr(seen) == f"<armloop.Comparison of {N} samples of 3 joints, 2 runs>"
    squares = np.where(seen.moving, seen.residual**2, 0.0).sum(axis=0) / seen.moving.sum(axis=0)
    assert np.sqrt(squares) == pytest.approx(model.score(logs).rmse, rel=1e-9)
    # at the log's own times: what was measured there, but for the filter
    own = slice(*seen.starts)
    tau = np.interp(seen.time[own], logs[0].time, logs[0].tau[:, 1])
    assert np.corrcoef(tau, seen.measured[own, 1])[0, 1] > 0.99
    # the motion is that of a Motion: what is predicted of it is the same before the filter
    motion = Motion(seen.time, seen.q, seen.v, seen.vdot, seen.starts)
    assert np.corrcoef(model.predict(motion)[:, 1], seen.predicted[:, 1])[0, 1] > 0.99


def test_what_is_in_amperes_is_said_to_be(model, tmp_path):
    log = run(20, 4)
    current = MotionLog(log.time, log.q, log.v, log.tau, name="current", tau_unit="A")
    drives = replace(model, recorded={"unit": "A", "drive_gains": None}, logs=())
    score = drives.score(current)
    page = score.report(tmp_path / "score.html").read_text()
    axes = [one.get_ylabel() for one in drives.plot(current).axes]
    assert "N·m" not in str(score) and "N·m" not in page and axes[0] == "current [A]"
    assert "N·m" in str(model.score(log)) and str(score).count(" A ") == 3


def test_a_model_of_currents_says_at_once_what_it_is_no_use_for():
    log = run(10, 4)
    current = MotionLog(log.time, log.q, log.v, log.tau, tau_unit="A")
    models = [al.reconstruct(each, "three_axis", library="rigid-body") for each in (log, current)]
    said = [[note for note in each.history["notes"] if "--drive-gains" in note] for each in models]
    assert said[0] == [] and len(said[1]) == 1 and "diagnose" in said[1][0]


def test_a_diagnosis_has_the_laws_of_no_catalogue(model):
    log = run(40, 6)
    more = 1.5 * np.cos(2 * log.q[:, 0]) * log.v[:, 1]
    seen = MotionLog(log.time, log.q, log.v, log.tau + np.outer(more, [0.0, 1.0, 0.0]), name="seen")
    found = al.diagnose(model, seen)
    assert found.verdict == "unlisted_effect" and not found.effects and not found.model.effects
    (law,) = found.laws
    assert law.effect.joint == 2 and law.parameters["cos(2*q1)*v2"].value == pytest.approx(1.5, abs=0.1)
    assert "a law of joint 2" in repr(found) and repr(law).startswith("<unlisted at joint 2: ")
    adopted = al.diagnose(model, seen, adopt=True)
    assert [one.effect.place for one in adopted.effects] == [law.effect.place]


def test_a_diagnosis_has_objects_for_effects(model, found, tmp_path):
    assert found.verdict == "effects_found"
    (added,) = found.effects
    assert (added.effect.name, added.effect.joint) == ("viscous_friction", 2)
    assert added.parameters["coefficient"].value == pytest.approx(0.8, abs=0.08)
    assert found.error["after"][1] < 0.5 * found.error["before"][1] and found.laws == []
    assert repr(added).startswith("<viscous_friction at joint 2: coefficient 0.") and "at 0x" not in repr(
        added
    )
    assert isinstance(found.model, al.Model) and len(found.model.effects) == 1
    assert ", 1 effect added" in repr(found.model)
    assert found.model.score(run(20, 5, 0.8)).rmse[1] < model.score(run(20, 5, 0.8)).rmse[1]
    assert "\n" not in repr(found) and "viscous_friction at joint 2" in repr(found)
    assert "viscous" in str(found) and "<img" in found._repr_html_() and found.plot().axes
    assert "viscous" in found.report(tmp_path / "page.html").read_text()
    assert sorted(p.name for p in found.save(tmp_path / "out").iterdir()) == [
        "diagnosis.json",
        "model.json",
        "report.html",
    ]


def test_what_is_said_of_other_logs_is_a_diagnosis_of_its_own(model, found):
    inner = found._found
    beside = al.Diagnosis(inner.beside([replace(inner, logs=("other",))]), model, found._compensation)
    (other,) = beside.apart
    assert (other.logs, other.verdict, other.apart) == (["other"], "effects_found", [])
    assert other.error == found.error and other.effects[0].effect.name == "viscous_friction"
    assert beside.logs == found.logs == list(inner.logs) and found.apart == []
    assert "other, judged apart: effects found" in str(beside)


def test_a_score_and_a_log_show_themselves(model, tmp_path):
    log = run(5, 6)
    score = al.evaluate(model, log)
    assert score.plot().axes and "<img" in score._repr_html_()
    assert "Prediction error" in score.report(tmp_path / "score.html").read_text()
    assert str(log).count("\n") == 4 and "<pre>" in log._repr_html_()


def test_a_joint_that_never_moves_is_said(model):
    log = run(5, 6)
    dead = MotionLog(log.time, log.q * [1, 1, 0], log.v * [1, 1, 0], log.tau, name="run")
    with pytest.warns(
        InputWarning, match=r"run: column q3 is 0 in every row: if \w+ moved, its encoder is dead"
    ):
        al.evaluate(model, dead)


def test_currents_and_torques_do_not_mix(model):
    log = run(10, 6)
    amperes = MotionLog(log.time, log.q, log.v, log.tau, tau_unit="A")
    with pytest.raises(InputError, match="drive_gains"):
        model.score(amperes)
    with pytest.raises(InputError, match="all of them"):
        al.reconstruct([log, amperes], "three_axis")
    with pytest.raises(InputError, match="joints"):
        model.score(MotionLog(log.time, log.q[:, :2], log.v[:, :2], log.tau[:, :2]))


def test_a_score_says_what_is_wrong_with_a_log_as_the_command_does(model):
    log = run(10, 6)
    gains = [10.0, 20.0, 5.0]
    currents = MotionLog(log.time, log.q, log.v, log.tau / gains, name="run")
    of_currents = replace(model, recorded={"unit": "A", "drive_gains": gains})
    for ask in (of_currents.score, of_currents.compare):
        with pytest.warns(InputWarning, match="run: tau seems to be motor current"):
            ask(currents)
    with pytest.warns(InputWarning, match="run: tau2 has the other sign"):
        al.evaluate(model, MotionLog(log.time, log.q, log.v, log.tau * [1, -1, 1], name="run"))
    with pytest.raises(InputError, match="run: every tau is zero"):
        model.score(MotionLog(log.time, log.q, log.v, 0 * log.tau, name="run"))


def test_logs_are_read_by_pattern(tmp_path):
    for k in (2, 1):
        al.write_log(tmp_path / f"run_{k}.csv", run(5, k))
    logs = al.read_logs(str(tmp_path / "run_*.csv"), "three_axis")
    assert [log.name for log in logs] == ["run_1", "run_2"]
    assert al.read_log(tmp_path / "run_1.csv", drive_gains=[2, 2, 2]).tau[0, 0] == 2 * logs[0].tau[0, 0]
    with pytest.raises(LogError, match="matches no file"):
        al.read_logs(str(tmp_path / "no_*.csv"))
    with pytest.raises(LogError, match="joints"):
        al.read_log(tmp_path / "run_1.csv", "scara")


class Frame:
    """What pandas and polars have in common: names of columns, and columns that are arrays."""

    def __init__(self, columns):
        self.columns, self._cells = list(columns), columns

    def __getitem__(self, name):
        return self._cells[name]


def test_a_log_of_a_data_frame():
    import pyarrow as pa

    log = run(5, 1)
    cells = {"time": log.time, "temperature": log.time + 30}
    for kind in ("q", "v", "tau"):
        cells |= {f"{kind}{j + 1}": getattr(log, kind)[:, j] for j in range(3)}
    for frame in (Frame(cells), pa.table(cells), cells):
        found = MotionLog.from_frame(frame, joints=3)
        np.testing.assert_array_equal(found.tau, log.tau)
    with pytest.raises(LogError, match=r"ndarray has no columns by name; .*from_arrays"):
        MotionLog.from_frame(log.q)
    with pytest.raises(LogError, match="the header lacks"):
        MotionLog.from_frame({"time": log.time})
    with pytest.raises(TypeError, match="positional"):  # a file's order would give v for tau
        MotionLog.from_arrays(log.time, log.q, log.v, log.tau)  # type: ignore[misc]
    del cells["v1"], cells["v2"], cells["v3"]
    assert MotionLog.from_frame(Frame(cells)).v_derived
    with pytest.raises(LogError, match="tau1"):
        MotionLog.from_frame(Frame({"time": log.time, "q1": log.q[:, 0]}))
    with pytest.raises(LogError, match="joints"):
        MotionLog.from_frame(Frame(cells), joints=4)


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_a_log_of_pandas_or_polars(package):
    library = pytest.importorskip(package)
    log = run(5, 1)
    cells = {"time": log.time} | {
        f"{kind}{j + 1}": getattr(log, kind)[:, j] for kind in ("q", "v", "tau") for j in range(3)
    }
    np.testing.assert_array_equal(MotionLog.from_frame(library.DataFrame(cells)).q, log.q)


def test_tracking_and_excitation_show_themselves(model, tmp_path):
    # a scenario of its own: the built-in ones reconstruct a model first, which the README's commands are run for
    (tmp_path / "short.yaml").write_text(
        "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\nscore: [1.0, 5.0]\n"
        "controllers: [pid, pid_step3]\n"
    )
    tracked = al.track(tmp_path / "short.yaml", model, out=tmp_path / "track")
    assert set(tracked.eta) == {"pid", "pid_step3"} and (tmp_path / "track" / "tracking.json").exists()
    assert max(tracked.eta["pid_step3"]) < 0.5 * max(tracked.eta["pid"])
    assert "\n" not in repr(tracked) and "η" in str(tracked) and tracked.plot().axes
    assert tracked.to_dict()["not_run"] == [] and "not run" not in str(tracked)
    half = al.track(tmp_path / "short.yaml", {"mine": model})
    assert half.to_dict()["not_run"] == ["pid_step3"]
    assert "not run: pid_step3, for want of a model; one named as its controller (pid_step3) serves" in str(
        half
    )
    assert al.track(tmp_path / "short.yaml", {"pid_step3": model}).to_dict()["not_run"] == []
    assert "<img" in tracked.report(tmp_path / "page.html").read_text()
    reference = al.excite("three_axis", library="rigid-body", duration=10, starts=1, random=4)
    assert reference.save(tmp_path / "ref.csv") > 1000 and reference.plot().axes
    assert "condition" in repr(reference) and str(reference)
    with pytest.raises(InputError, match="armloop track"):
        al.track("payload_pickup")


def test_a_simulated_arm_follows_an_exciting_reference() -> None:
    from pydrake.systems.framework import DiagramBuilder

    from armloop.drake import PidGains, add_arm_with_controller

    reference = al.excite("three_axis", library="rigid-body", duration=10, starts=1, random=3)
    arm = add_arm_with_controller(DiagramBuilder(), "three_axis", PidGains.paper(3), reference)
    assert reference.duration == 10.0
    np.testing.assert_array_equal(arm.reference.tables[0][[0, -1]], reference.evaluate([0.0, 10.0])[0])


def test_the_bare_import_is_cheap():
    program = "import armloop, sys; dir(armloop); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"numpy", "pydrake", "matplotlib", "scipy"} & set(done.stdout.split())


def test_what_is_no_log_and_no_model_is_said(model) -> None:
    run = model.logs[0]
    for logs in ("run.csv", None, [run, "other.csv"], run.q, 3):
        for given in (
            lambda logs=logs: al.reconstruct(logs, "three_axis"),
            lambda logs=logs: al.evaluate(model, logs),
            lambda logs=logs: al.diagnose(model, logs),
        ):
            with pytest.raises(InputError, match="a log must be a MotionLog"):
                given()
    with pytest.raises(InputError, match="a model must be one"):
        al.evaluate("model.json", run)
    for what in (al.evaluate, al.diagnose):
        with pytest.raises(InputError, match="there is no log"):
            what(model, [])
        with pytest.raises(InputError, match="once more"):
            what(model, [run, run])


def test_a_run_that_is_fitted_is_not_held_out(model) -> None:
    run = model.logs[0]
    with pytest.raises(InputError, match="is one of the logs diagnosed"):
        al.diagnose(model, run, held_out=run)
    with pytest.raises(InputError, match="jobs 0: give 1 or more"):
        al.diagnose(model, run, jobs=0)


def test_masked_samples_are_no_samples(model) -> None:
    run = model.logs[0]
    masked = np.ma.masked_greater(run.q, np.quantile(run.q, 0.9))
    with pytest.raises(InputError, match="some are masked"):
        al.MotionLog(run.time, masked, run.v, run.tau)
    assert al.MotionLog(run.time, np.ma.array(run.q), run.v, run.tau).samples == run.samples
