"""Every example runs, without a warning, and stays small enough to read at once."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 5
    numbers = [int(path.stem[:2]) for path in EXAMPLES]
    assert numbers == list(range(1, len(EXAMPLES) + 1))


SLOW = {  # seconds each: physics, many runs, files for sharing
    "07_look_at_it",
    "12_sweep_the_weights",
    "13_compare",
    "16_physics_world",
    "17_grasp",
    "18_sort",
    "19_share_a_run",
}


SAYS = {"18_sort": "9 of 9 objects are in their bins"}


def marked(path):
    marks = [pytest.mark.slow] if path.stem in SLOW else []
    return pytest.param(path, marks=marks, id=path.stem)


@pytest.mark.parametrize("path", [marked(path) for path in EXAMPLES])
def test_example(path, tmp_path, monkeypatch, capfd):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 80
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")  # warnings are errors
    out, err = capfd.readouterr()
    assert out
    assert SAYS.get(path.stem, "") in out
    assert not err


def test_an_example_runs_as_a_program(tmp_path):
    run = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLES[0])],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (run.returncode, run.stderr) == (0, "")
