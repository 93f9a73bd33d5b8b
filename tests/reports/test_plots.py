"""Figures show every joint and every controller, and thin lines without losing their extremes."""

import itertools
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from synthetic import friction

from armloop.data.motion import Motion
from armloop.data.signals import smooth
from armloop.diagnosis import Diagnosis, close
from armloop.reports import plots, words
from armloop.reports.html import Picture, svg
from armloop.reports.plots import style
from armloop.reports.plots.narrow import stack
from armloop.reports.plots.style import thin, with_gaps
from armloop.reports.plots.watch import NARROW, heat_figure, trend_figure
from armloop.reports.residuals import held_out_residuals, joint_load, time_axis
from armloop.util.files import write_figure


def drawn(figure: Figure) -> Figure:
    figure.canvas.draw()
    return figure


def labels(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_tracking_has_a_column_per_joint_and_a_line_per_controller(loop: SimpleNamespace) -> None:
    figure = drawn(plots.tracking_figure(loop.tracking))
    assert len(figure.axes) == 6
    assert labels(figure) == {"reference", "PID", "PID + Step I", "PID + Step III"}


def test_many_controllers_have_a_legend_of_rows_above_the_titles_and_lines_of_their_own(
    loop: SimpleNamespace,
) -> None:
    names = [
        "pid",
        "pid_step1",
        "pid_step2",
        "pid_step3",
        "computed_torque",
        "exact",
        "pid_mine",
        "pid_other",
    ]
    run = next(iter(loop.tracking.values()))
    figure = plots.tracking_figure(dict.fromkeys(names, run))
    figure.draw_without_rendering()
    looks = {(line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert len(looks) == len(names) + 1
    (legend,) = figure.legends
    read = sorted(
        ((-round(box.y1), box.x0), text.get_text())
        for text in legend.get_texts()
        for box in [text.get_window_extent()]
    )
    rows = {y for (y, _), _ in read}
    assert len(rows) == 2 and [label for _, label in read][:4] == [
        "reference",
        "PID",
        "PID + Step I",
        "PID + Step II",
    ]
    frame, top = legend.get_window_extent(), figure.axes[0]._left_title.get_window_extent().y1  # type: ignore[attr-defined]
    assert frame.y0 > top and frame.x1 < figure.bbox.x1
    assert stack(figure)
    order = [text.get_text() for text in drawn(figure).legends[0].get_texts()]
    assert order[:3] == ["reference", "PID", "PID + Step I"]  # one column on a narrow page


def test_bars_of_one_colour_are_hatched(loop: SimpleNamespace) -> None:
    names = ["pid", "pid_step1", "pid_step2", "pid_step3", "computed_torque", "exact", "pid_mine"]
    run = next(iter(loop.tracking.values()))
    axes = drawn(plots.eta_figure(dict.fromkeys(names, run))).axes[0]
    assert len({(bar.get_facecolor(), bar.get_hatch()) for bar in axes.patches}) == len(names)


def test_joints_of_different_units_get_axes_of_their_own(loop: SimpleNamespace) -> None:
    mixed = {name: replace(run, unit=("deg", "mm", "deg")) for name, run in loop.tracking.items()}
    assert len(drawn(plots.eta_figure(mixed)).axes) == 2


def test_eta_bars_are_the_etas(loop: SimpleNamespace) -> None:
    axes = drawn(plots.eta_figure(loop.tracking, paper=True)).axes[0]
    heights = [patch.get_height() for patch in axes.patches]
    assert heights[:3] == pytest.approx(loop.tracking["pid"].eta)
    assert heights[3:6] == [1.10, 1.21, 1.23]


def test_reconstruction_figures(loop: SimpleNamespace) -> None:
    assert len(drawn(plots.clusters_figure(loop.clusters)).axes) == 2
    assert plots.has_trials(loop.reconstruction.reports)
    drawn(plots.orders_figure(loop.reconstruction.reports, loop.reference.reports))


def test_friction_laws_tried_are_drawn_with_what_they_led_to() -> None:
    rungs = [
        {"rung": "Coulomb and viscous", "before": 0.7, "after": 0.02, "refused": None, "joints": [1, 2]},
        {"rung": "Stribeck", "before": 0.02, "after": 0.02, "refused": 0.021, "joints": []},
    ]
    axes = drawn(plots.ladder_figure(rungs)).axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["Coulomb and viscous", "Stribeck"]
    assert [text.get_text() for text in axes.texts] == ["2.0 %   joints 1, 2", "2.1 %"]


@pytest.mark.parametrize("taken", [[1, 2, 3, 4, 5, 6, 7], [1, 3, 5, 7, 9, 11, 13, 15]])
def test_what_stands_beside_a_friction_law_lies_within_the_panel(taken: list[int]) -> None:
    rungs = [{"rung": "Coulomb and viscous", "before": 0.7, "after": 0.03, "refused": None, "joints": taken}]
    figure = drawn(plots.ladder_figure(rungs))
    (axes,) = figure.axes
    (text,) = axes.texts
    assert text.get_text() == f"3.0 %   {words.joints(taken)}"
    assert text.get_window_extent().x1 < axes.get_window_extent().x1 + 1
    sizes = {t.label1.get_fontsize() for t in axes.xaxis.get_major_ticks() + axes.xaxis.get_minor_ticks()}
    assert len(sizes) == 1


def test_errors_that_are_far_apart_are_drawn_over_decades(loop: SimpleNamespace) -> None:
    run = next(iter(loop.tracking.values()))
    near = replace(run, eta=run.eta / 10, q=run.q_ref + (run.q - run.q_ref) / 10)
    far = replace(run, eta=run.eta / 1000, q=run.q_ref + (run.q - run.q_ref) / 1000)
    linear, decades = (drawn(plots.tracking_figure({"pid": run, "exact": x})).axes for x in (near, far))
    for axes in linear[3:]:
        assert axes.get_yscale() == "linear" and axes.get_ylabel() == "error [deg]"
    for axes in decades[3:]:
        assert axes.get_yscale() == "log" and axes.get_ylabel() == "|error| [deg]"
        low, high = axes.get_ylim()
        pid, exact = (np.asarray(line.get_ydata(), dtype=float) for line in axes.lines)
        seen = exact > 2e-6
        np.testing.assert_allclose(pid[seen] / exact[seen], 1000.0, rtol=1e-6)
        assert pid.max() <= high and (exact >= low).mean() > 0.9
    scored = np.abs(run.q_ref - run.q)[run.scored, 0]
    assert np.max(decades[3].lines[0].get_ydata()) == pytest.approx(np.rad2deg(scored.max()))


def test_a_residual_lies_under_every_torque(loop: SimpleNamespace) -> None:
    model, samples = loop.reconstruction.model, loop.diagnosis.samples
    figure = drawn(plots.torque_figure(model, samples))
    assert len(figure.axes) == 6
    for j in range(3):
        torque, below = figure.axes[2 * j : 2 * j + 2]
        measured = max((line for line in torque.lines), key=lambda line: line.get_linewidth())
        left = next(line for line in below.lines if "residual" in str(line.get_label()))
        whole = samples.tau[:, j] - smooth(samples, model.predict(samples.motion))[:, j]
        shown = samples.motion.time <= samples.motion.time[0] + 20
        assert np.ptp(left.get_ydata()) == pytest.approx(np.ptp(whole[shown]), rel=0.05)
        assert np.ptp(measured.get_ydata()) == pytest.approx(np.ptp(samples.tau[shown, j]), rel=0.05)


def test_friction_lies_among_the_points_of_the_data(loop: SimpleNamespace) -> None:
    """The model is exact but for a spring on joint 2, so the dots of the others scatter about its curve by noise."""
    model, samples = loop.reconstruction.model, loop.diagnosis.samples
    figure = drawn(plots.friction_figure(model, samples))
    assert len(figure.axes) == 3
    for j, axes in enumerate(figure.axes):
        backward, forward = axes.lines
        for line in (backward, forward):
            np.testing.assert_allclose(line.get_ydata(), friction(line.get_xdata()[:, None])[:, j], rtol=1e-9)
        v, dots = np.asarray(axes.collections[0].get_offsets()).T
        fast = np.abs(v) > 0.3
        off = dots[fast] - friction(v[fast, None])[:, j]
        level = 0.05 * np.sqrt(np.mean(samples.tau[:, j] ** 2))
        assert (np.sqrt(np.mean(off**2)) < level) == (j != 1)


def test_diagnosis_figures(loop: SimpleNamespace, clean: Diagnosis) -> None:
    assert len(drawn(plots.residual_time_figure(loop.diagnosis)).axes) == 3
    assert len(drawn(plots.residual_shape_figure(loop.diagnosis)).axes) == 12
    assert labels(plots.residual_time_figure(clean)) == {"residual", "baseline level (±2 RMS)"}
    ticks = drawn(plots.shares_figure(loop.diagnosis)).axes[0].get_yticklabels()
    assert ticks[0].get_text() == "joint spring, joint 2"


def test_a_residual_is_drawn_against_position_velocity_load_and_its_spectrum(loop: SimpleNamespace) -> None:
    figure = drawn(plots.residual_shape_figure(loop.diagnosis))
    last = [axes.get_xlabel() for axes in figure.axes[-4:]]
    assert last == ["position [rad]", "velocity [rad/s]", "load [N·m]", "frequency [Hz]"]
    assert labels(figure) == {"baseline level (±2 RMS)", "before", "after, on blocks not fitted"}
    titles = [axes.get_title("left") for axes in figure.axes[::4]]
    assert titles == ["Joint 1: unchanged", "Joint 2", "Joint 3: unchanged"]
    load = joint_load(loop.diagnosis)
    low, high = figure.axes[6].get_xlim()
    assert low <= load[:, 1].min() and load[:, 1].max() <= high
    left = drawn(plots.residual_shape_figure(loop.diagnosis, what_is_left=True))
    assert labels(left) == {"baseline level (±2 RMS)", "after, on blocks not fitted"}
    # the spring is gone: what is left needs a much finer scale
    assert np.ptp(left.axes[4].get_ylim()) < 0.3 * np.ptp(figure.axes[4].get_ylim())


def test_a_joint_at_rest_has_a_residual_in_time_alone(loop: SimpleNamespace) -> None:
    evidence = loop.diagnosis.evidence
    rows = evidence.rows.copy()
    rows[:, 0] = False
    keep = np.ones(evidence.rows.sum(), dtype=bool)
    keep[loop.diagnosis.outcome.before.stacked.joint == 0] = False
    before, after = (
        replace(
            fit,
            outside=fit.outside[:, keep],
            stacked=replace(
                fit.stacked,
                **{key: getattr(fit.stacked, key)[keep] for key in ("X", "y", "joint", "fold", "block")},
            ),
        )
        for fit in (loop.diagnosis.outcome.before, loop.diagnosis.outcome.after)
    )
    outcome = replace(loop.diagnosis.outcome, before=before, after=after)
    still = replace(loop.diagnosis, evidence=replace(evidence, rows=rows), outcome=outcome)
    figure = drawn(plots.residual_time_figure(still))
    assert figure.axes[0].get_title("left") == "Joint 1: at rest"
    assert len(drawn(plots.residual_shape_figure(still)).axes) == 8


def test_what_the_controller_adds_is_drawn_where_it_adds_something(loop: SimpleNamespace) -> None:
    model = loop.reconstruction.model
    closing = close(model, loop.diagnosis.model, loop.diagnosis.samples)
    (axes,) = drawn(plots.feedforward_figure(loop.diagnosis, closing)).axes
    assert axes.get_title("left").startswith("Joint 2: ")


def test_runs_of_several_logs_are_laid_end_to_end() -> None:
    once = np.arange(0, 10, 0.1)
    zeros = np.zeros((100, 1))
    one = Motion(once, zeros, zeros, zeros, np.array([0]))
    assert time_axis(one)[0] is one.time
    two = Motion(np.tile(once, 2), *[np.zeros((200, 1))] * 3, np.array([0, 100]))
    shown, words = time_axis(two)
    assert (np.diff(shown) > 0).all() and shown[-1] < 21 and "end to end" in words


def test_residuals_are_those_behind_the_errors(loop: SimpleNamespace) -> None:
    shown = held_out_residuals(loop.diagnosis)
    for key, residual in (("before", shown.before), ("after", shown.after)):
        rmse = np.sqrt(np.nanmean(residual**2, axis=0))
        assert rmse == pytest.approx(loop.diagnosis.errors()[key])


def test_the_ring_has_eight_stages() -> None:
    with pytest.raises(ValueError, match="8 stages, there are 0"):
        plots.ring_figure([], "", "")


def test_a_picture_is_opaque_and_a_figure_in_a_page_is_not(tmp_path: Path) -> None:
    figure = style.figure(4.0, 3.0)
    style.panels(figure, 1, 1)
    write_figure(tmp_path / "a.png", figure)
    assert (imread(tmp_path / "a.png")[..., 3] == 1).all()
    assert "#ffffff" not in svg(figure)


def test_a_narrow_page_has_the_panels_one_below_the_other(loop: SimpleNamespace) -> None:
    figure = plots.residual_shape_figure(loop.diagnosis)
    before = figure.get_figwidth()
    page = svg(figure)
    assert page.count('<svg class="wide"') == page.count('<svg class="narrow"') == 1
    assert figure.get_figwidth() == before and svg(figure) == page  # the figure itself stays as it is
    assert stack(figure)
    boxes = [axes.get_position() for axes in figure.axes]
    assert figure.get_figwidth() == 4.0
    assert all(above.y0 > below.y1 for above, below in itertools.pairwise(boxes))
    assert all(axes.get_xlabel() for axes in figure.axes)
    assert all(axes.get_ylabel() or "[" in axes.get_title(loc="left") for axes in figure.axes)


def test_joints_in_columns_stay_together_on_a_narrow_page(loop: SimpleNamespace) -> None:
    figure = plots.tracking_figure(loop.tracking)
    follow, error = figure.axes[: len(figure.axes) // 2], figure.axes[len(figure.axes) // 2 :]
    assert stack(figure)
    tops = [axes.get_position().y1 for pair in zip(follow, error, strict=True) for axes in pair]
    assert tops == sorted(tops, reverse=True)


def test_long_names_before_a_panel_stand_above_its_rows_on_a_narrow_page() -> None:
    rungs = [
        {"rung": "presliding by load", "before": 0.1, "after": 0.1, "refused": 0.2, "joints": []},
        {"rung": "Coulomb", "before": 0.4, "after": 0.1, "refused": None, "joints": [1, 2]},
    ]
    figure = plots.ladder_figure(rungs)
    assert 'class="narrow"' in svg(figure)
    assert stack(figure) and figure.get_figwidth() == 4.0
    (axes,) = figure.axes
    said = [text.get_text() for text in axes.texts]
    assert said == ["presliding by load: 20 %", "Coulomb: 10 %   joints 1, 2"]
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert all(box.x1 < figure.bbox.x1 and box.y1 < figure.bbox.y1 for box in boxes)


def test_the_ring_is_a_column_on_a_narrow_page() -> None:
    stage = plots.Stage("Measure", "1 run", "of one", lambda axes: None)
    told = ([stage] * 8, "A headline that is longer than a phone is wide", "a line")
    page = Picture(plots.ring_figure(*told), narrow=plots.column_figure(*told)).svg()
    assert page.count("<svg ") == 2 and "--width:25.6rem" in page
    cards = plots.column_figure(*told).axes[1:]
    assert len(cards) == 8
    assert all(a.get_position().y0 > b.get_position().y1 for a, b in itertools.pairwise(cards))


def test_a_fleets_effects_are_parted_into_blocks_on_a_narrow_page() -> None:
    places = [f"effect {k}" for k in range(25)]
    evidence = np.outer([1.0, 2.0], np.arange(25.0))
    data = (["a", "b"], places, evidence, np.array([20.0, 20.0]), evidence > 40)
    whole, narrow = heat_figure(*data), heat_figure(*data, NARROW)
    assert len(whole.axes) == 2 and narrow.get_figwidth() == NARROW
    blocks = [
        axes for axes in narrow.axes if [text.get_text() for text in axes.get_yticklabels()] == ["a", "b"]
    ]
    assert [label.get_text() for axes in blocks for label in axes.get_xticklabels()] == places
    drawn = np.hstack([axes.images[0].get_array() for axes in blocks])
    np.testing.assert_allclose(drawn, np.clip(evidence / 20.0, 0, 1))


def test_thinning_keeps_spikes_and_gaps() -> None:
    x = np.arange(100_000.0)
    y = np.zeros_like(x)
    y[54_321] = 9.0
    y[20_000:30_000] = np.nan
    few_x, few_y = thin(x, y, 1000)
    assert len(few_x) <= 1002 and np.nanmax(few_y) == 9.0 and np.isnan(few_y).any()
    assert (np.diff(few_x) >= 0).all()


def test_runs_are_not_joined() -> None:
    time = np.array([0, 1, 2, 3, 50, 51, 52, 53.0])
    assert np.flatnonzero(np.isnan(with_gaps(time, np.ones(8))[1])).tolist() == [4]


def test_logs_copied_together_stand_in_their_order() -> None:
    """All have the date of the copy: an axis of time would show one line of dots, and alarms beside it."""
    logs = [f"log{k}" for k in range(10)]
    alarm = {"since": 1e9, "when": 1e9 + 60.0, "since_log": "log4", "log": "log6"}
    values = np.arange(10.0)
    made = trend_figure(np.full(10, 1e9), logs, [("friction", values, values)], 5.0, [alarm])
    places = {str(line.get_label()): np.asarray(line.get_xdata()) for line in made.axes[0].lines}
    np.testing.assert_array_equal(places["one log"], np.arange(1, 11))
    assert (places["change began"][0], places["alarm"][0]) == (5, 7)
    band = made.axes[0].patches[0].get_extents().transformed(made.axes[0].transData.inverted())
    np.testing.assert_allclose((band.y0, band.y1), np.quantile(values[:4], [0.05, 0.95]))
    apart = trend_figure(1e9 + 3600.0 * values, logs, [("friction", values, values)], 5.0, [alarm])
    assert np.asarray(apart.axes[0].lines[0].get_xdata()).dtype == np.dtype("datetime64[us]")
