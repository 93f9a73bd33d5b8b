"""The measured data that come with the project; that the loop finds the pushes in them, tests/fresh/test_readme.py says."""

from armloop.util.resources import measured_folder


def test_the_measured_logs_come_with_licence_and_source():
    folder = measured_folder("ur5")
    assert "Apache License" in (folder / "LICENSE.txt").read_text()
    assert "kkufieta/ur5_modeling_force_estimate" in (folder / "README.md").read_text()
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2e6
