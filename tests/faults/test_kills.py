"""kill -9 at twenty random moments of every long command: outputs are whole or absent, and the next run makes them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from faults.conftest import contents

pytestmark = pytest.mark.long

KILLS = 20
WEAR = """plant: three_axis
reference: {kind: fourier, duration: 5.0}
score: [1.0, 5.0]
controllers: [pid]
wear: {samples: 6, spread: 0.3}
"""
COMMANDS = {
    "reconstruct": "reconstruct run.csv --arm arm.urdf --library rigid-body --out out/m.json --report out/m.html",
    "diagnose": "diagnose model.json run.csv --out out",
    "collect": "collect three_axis --plan quick --out out",
    "crossvalidate": "crossvalidate run.csv other.csv --arm arm.urdf --library rigid-body --out out",
    "track": "track scenario.yaml --out out",
    "track with wear": "track wear.yaml --out out",
    "reproduce": "reproduce fig1 fig5 --draws 1 --out out",
    "loop": "loop --out out",
    "loop --measured": "loop --measured --out out",
}
#: Commands that keep what they have finished.
KEEPING = ("crossvalidate", "track with wear", "reproduce")
#: What carries seconds, or pictures of them.
TIMED = ("loop.json", "loop.png", "report.html", "reproduction.json", "replay.html", ".armloop")
# What is imported is imported once, and each call is a fork of that, so that the kill falls into the work. No thread may
# run before a fork: that is why this is a process of its own.
DRIVER = """
import json, os, random, shutil, signal, sys, time
from pathlib import Path
import armloop.commands.shared, armloop.diagnosis, armloop.drake.experiments.scenarios, armloop.reports.diagnosis_report
import armloop.workflows, armloop.identification.reconstruction, matplotlib.figure
from armloop.cli import main
from armloop.util.checkpoints import FOLDER

kills, words, out = int(sys.argv[1]), sys.argv[2:], Path("out")

def begin():
    child = os.fork()
    if child == 0:
        os.setsid()
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os._exit(main(words))
    return child

def check():
    for path in out.rglob("*"):
        if path.is_symlink() or not path.is_file() or path.name.endswith(".part"):
            continue
        text = path.read_bytes().decode("utf-8", "replace")
        if path.suffix == ".json":
            json.loads(text)
        elif path.suffix == ".html":
            assert text.rstrip().endswith("</html>"), path
        elif path.suffix == ".csv":
            assert text.endswith("\\n") and len({line.count(",") for line in text.splitlines()}) == 1, path

def end(child):
    _, status = os.waitpid(child, 0)
    return status

began = time.monotonic()
assert end(begin()) == 0
takes = time.monotonic() - began
out.rename("whole")
rng, killed, kept = random.Random(0), 0, 0
while killed < kills:
    child = begin()
    time.sleep(rng.uniform(0.0, takes))
    os.kill(child, signal.SIGKILL)
    status = end(child)
    check()
    kept += (out / FOLDER).is_dir()
    if os.WIFSIGNALED(status):
        killed += 1
    elif status == 0:
        shutil.rmtree(out)  # it had come to its end: begin again
    else:
        sys.exit(f"status {status}")
assert end(begin()) == 0
check()
print(json.dumps({"killed": killed, "takes": takes, "kept": kept}))
"""


@pytest.mark.parametrize("name", COMMANDS)
def test_killed_at_random_moments(name: str, place: Path) -> None:
    (place / "wear.yaml").write_text(WEAR)
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, str(KILLS), *COMMANDS[name].split()],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout.splitlines()[-1])["killed"] == KILLS
    if name in KEEPING:
        assert json.loads(done.stdout.splitlines()[-1])["kept"] > 0
    whole, again = (contents(place / folder) for folder in ("whole", "out"))
    assert whole.keys() == again.keys()  # no draft, and nothing of what was kept, is left
    for path, content in whole.items():
        if not path.endswith(TIMED):
            assert again[path] == content, path
