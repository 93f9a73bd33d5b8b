"""Long commands go on where they were ended, and only with what still holds."""

import json
from pathlib import Path

import pytest
from faults.conftest import one_line

from armloop.cli import main
from armloop.reports.html import Picture, Section, render
from armloop.reports.tables import make_table
from armloop.util.checkpoints import FOLDER, Kept
from armloop.util.errors import InputError
from armloop_paper import Outcome


def test_items_are_kept_by_what_they_depend_on(tmp_path: Path) -> None:
    kept = Kept(tmp_path, {"draws": 3})
    assert kept.get("a") is None
    assert kept.once("a", lambda: [1.5, "x"]) == [1.5, "x"]
    assert Kept(tmp_path, {"draws": 3}).once("a", lambda: [2]) == [1.5, "x"]
    assert Kept(tmp_path, {"draws": 4}).get("a") is None
    assert Kept(tmp_path, {"draws": 3}).get("b") is None
    kept.clear()
    assert kept.get("a") is None and not (tmp_path / FOLDER).exists()


@pytest.mark.parametrize("content", [b"", b"{", b'{"value": NaN}', b"[]", b'{"other": 1}', b"\xff"])
def test_what_cannot_be_read_is_made_again(tmp_path: Path, content: bytes) -> None:
    kept = Kept(tmp_path, 1)
    kept.put("a", [1])
    (file,) = (tmp_path / FOLDER).glob("*.json")
    file.write_bytes(content)
    assert kept.once("a", lambda: [2]) == [2]
    assert kept.get("a") == [2]


def test_without_a_folder_nothing_is_kept() -> None:
    kept = Kept(None, 1)
    kept.put("a", [1])
    assert kept.get("a") is None
    kept.clear()


def test_what_was_kept_of_input_at_fault_is_forgotten_and_what_was_kept_before_stays(tmp_path: Path) -> None:
    Kept(tmp_path, 1).put("before", 1)
    kept = Kept(tmp_path, 1)
    with pytest.raises(InputError), kept.unless_at_fault():
        kept.put("now", 2)
        raise InputError("at fault")
    assert kept.get("before") == 1 and kept.get("now") is None


def test_a_cross_validation_of_input_at_fault_leaves_nothing(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def half(*_: object, kept: Kept, **how: object) -> None:
        kept.put("first fold", 1)
        raise InputError("the second fold's log is at fault")

    monkeypatch.setattr("armloop.identification.validation.crossvalidate", half)
    assert main("crossvalidate run.csv other.csv --arm arm.urdf --out x".split()) == 2
    one_line(capsys.readouterr().err, "the second fold's log is at fault")
    assert not (place / "x").exists()


def test_a_section_survives_with_its_pictures() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    figure.subplots().plot([0, 1], [1, 0])
    section = Section(
        "A",
        ["text"],
        [Picture(figure, "caption", "summary")],
        [make_table(["a", "b"], [["1", "2"]])],
        [("f", "g")],
        ["n"],
    )
    again = Section.from_dict(json.loads(json.dumps(section.to_dict())))
    assert again.tables == section.tables and again.formulas == section.formulas
    pages = []
    for each in (section, again):
        from armloop.reports.html import Report

        pages.append(render(Report("a", "b", [each])))
    assert pages[0] == pages[1]


def test_a_reproduction_goes_on_where_it_was_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = []

    def ended(name: str, context: object) -> Outcome:
        done.append(name)
        if name == "fig5" and len(done) == 2:
            raise KeyboardInterrupt
        return Outcome({"x": 1.0}, {"x": len(done)}, "agrees", name, Section(name, ["text"]))

    monkeypatch.setattr("armloop_paper.run_item", ended)
    command = ["reproduce", "table2", "fig5", "--out", str(tmp_path / "r"), "--json"]
    assert main(command) == 130
    assert not (tmp_path / "r" / "reproduction.json").exists()
    assert main(command) == 0
    assert done == ["table2", "fig5", "fig5"]
    assert not (tmp_path / "r" / FOLDER).exists()
    found = json.loads((tmp_path / "r" / "reproduction.json").read_text())
    assert [found[name]["ours"]["x"] for name in ("table2", "fig5")] == [1, 3]


WEAR = """plant: three_axis
reference: {kind: fourier, duration: 5.0}
score: [1.0, 5.0]
controllers: [pid]
wear: {samples: 2, spread: 0.3}
"""


def test_draws_of_the_friction_go_on_where_they_were_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from armloop.drake.experiments import wear
    from armloop.util.workers import Processes

    (tmp_path / "s.yaml").write_text(WEAR)
    command = ["track", str(tmp_path / "s.yaml"), "--out", str(tmp_path / "w"), "--json"]
    real, counted = wear.track, []

    def ended(*arguments: object) -> object:
        counted.append(1)
        if len(counted) == 2:
            raise KeyboardInterrupt
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(wear, "Processes", lambda processes: Processes(1))
    monkeypatch.setattr(wear, "track", ended)
    assert main(command) == 130
    assert len(list((tmp_path / "w" / FOLDER).glob("*.json"))) == 1
    capsys.readouterr()
    assert main(command) == 0
    assert len(counted) == 3
    resumed = json.loads(capsys.readouterr().out)
    assert not (tmp_path / "w" / FOLDER).exists()
    assert main(command) == 0  # from the beginning: the same to the bit
    assert json.loads(capsys.readouterr().out) == resumed
