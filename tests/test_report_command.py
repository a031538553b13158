"""``arm3dof report``: which files it writes, and what it says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from runs import smooth_run

from arm3dof.cli.app import main as program
from arm3dof.model.library import load_robot


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return smooth_run(load_robot(), duration=0.1).save(tmp_path / "run.npz")


def answer(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = program(["report", *map(str, words)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_page_goes_beside_the_recording(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = answer(capsys, run)
    assert code == 0
    assert err == ""
    assert "report.html" in out
    assert (run.parent / "report.html").stat().st_size < 5_000_000


@pytest.mark.slow
def test_every_kind_of_file_is_written_and_listed(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = ("--mp4", out / "a.mp4", "--mcap", out / "a.mcap", "--png", out / "png", "--json")
    code, said, _ = answer(capsys, run, *words)
    assert code == 0
    files = [Path(name) for name in json.loads(said)["files"]]
    names = ["error", "velocity", "controller", "torque", "overview", "start", "end"]
    assert [file.name for file in files] == [*(f"{name}.png" for name in names), "a.mcap", "a.mp4"]
    assert all(file.stat().st_size > 1000 for file in files)
    assert not (run.parent / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["none.npz"], "none.npz: no such recording"),
        (["{run}", "--picture", "none.png"], "none.png: no such picture"),
        (["{run}", "--picture", "{run}"], "is no PNG, JPEG or WebP file"),
        (["{run}", "--mp4", "a.mp4", "--picture", "{run}"], "give --out or --mcap too"),
        (["{run}", "--out", "{run}/report.html"], "cannot be written"),
    ],
)
def test_bad_input_is_one_line(
    run: Path, words: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = answer(capsys, *(word.replace("{run}", str(run)) for word in words))
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert reason in err
