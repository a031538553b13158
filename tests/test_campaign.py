"""Campaigns with trials whose outcome is known, and the command that runs one."""

import contextlib
import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from arm3dof.cli import app
from arm3dof.errors import InputError, MissingExtra
from arm3dof.runtime.campaign import Outcome, run_campaign, trial_rng
from arm3dof.runtime.journal import Journal, code_fingerprint, fingerprint
from arm3dof.runtime.see_trial import SeeTrial, goals, judge, see_report
from arm3dof.vision.locate import View


@dataclass(frozen=True)
class Dice:
    """Fails when it throws too high; counts its throws in a file."""

    log: Path
    least: int = 0

    def __call__(self, rng):
        with self.log.open("a") as file:
            file.write("x")
        eyes = int(rng.integers(1, 7))
        if eyes == 6:
            raise InputError("six; throw again")
        figures = {"eyes": eyes, "both": [eyes, self.least]}
        return Outcome("" if eyes > self.least else f"{eyes} eyes", figures)


@pytest.fixture
def log(tmp_path):
    return tmp_path / "log"


def thrown(log):
    return len(log.read_text()) if log.exists() else 0


def expected(seed, number):
    return int(trial_rng(seed, number).integers(1, 7))


@pytest.mark.parametrize("workers", [1, 2])
def test_outcomes_depend_on_seed_and_number_alone(log, workers):
    done = run_campaign(Dice(log, 2), 12, 5, workers=workers)
    eyes = [expected(5, number) for number in range(12)]
    failed = [(k, it) for k, it in enumerate(eyes) if it <= 2 or it == 6]
    assert [number for number, _ in done.failures] == [number for number, _ in failed]
    reasons = ["six; throw again" if it == 6 else f"{it} eyes" for _, it in failed]
    assert [reason for _, reason in done.failures] == reasons
    assert done.successes == 12 - len(failed)
    assert done.column("eyes").tolist() == [it for it in eyes if it != 6]
    assert done.column("both").reshape(-1, 2)[:, 0].tolist() == [it for it in eyes if it != 6]
    assert done.column("nothing").shape == (0,)
    report = done.report()
    assert list(report) == ["success_rate", "successes", "n", "failures", "wall_s"]
    assert report["success_rate"] == report["successes"] / report["n"]
    only = run_campaign(Dice(log, 2), 12, 5, only=[7])
    assert only.outcomes == {7: done.outcomes[7]}


def test_a_campaign_goes_on_where_it_was(log, tmp_path):
    journal = tmp_path / "deep" / "dice.jsonl"
    first = run_campaign(Dice(log), 5, 1, journal=journal)
    told = []
    more = run_campaign(Dice(log), 9, 1, journal=journal, progress=lambda *it: told.append(it))
    assert thrown(log) == 9
    assert more.reused == 5
    assert told == [(k, 4) for k in range(1, 5)]
    assert {k: more.outcomes[k] for k in range(5)} == first.outcomes
    assert run_campaign(Dice(log), 9, 1).outcomes == more.outcomes
    # another seed, or another trial, is another campaign
    assert run_campaign(Dice(log), 9, 2, journal=journal).reused == 0
    assert run_campaign(Dice(log, 3), 9, 1, journal=journal).reused == 0


def test_a_torn_line_is_forgotten_and_its_trial_made_again(log, tmp_path):
    path = tmp_path / "dice.jsonl"
    run_campaign(Dice(log), 4, 1, journal=path)
    text = path.read_text()
    path.write_text(text[:-9])
    assert run_campaign(Dice(log), 4, 1, journal=path).reused == 3
    assert run_campaign(Dice(log), 4, 1, journal=path).reused == 4


@pytest.mark.parametrize("text", ["hello\nworld\n", '{"trial": 1}\n', "3\n", "\x80\x81\n"])
def test_other_files_are_no_journals(tmp_path, text):
    path = tmp_path / "it.jsonl"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="not a journal of results; move it away"):
        Journal(path)


def test_a_journal_that_cannot_be_written_says_so(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        Journal(tmp_path / "file" / "it.jsonl").add("a", {})


@pytest.mark.parametrize(
    ("change", "message"),
    [({"n": 0}, "n is 0"), ({"seed": -1}, "seed is -1"), ({"only": [3]}, "no trial 3; .* 0 to 2")],
)
def test_numbers_out_of_range_are_refused(log, change, message):
    with pytest.raises(InputError, match=message):
        run_campaign(Dice(log), **({"n": 3, "seed": 0} | change))


def test_fingerprints_tell_work_apart():
    assert fingerprint(1, "a") == fingerprint(1, "a") != fingerprint(1, "b")
    assert code_fingerprint() == code_fingerprint()
    assert len(code_fingerprint()) == 16


# ---- seeing -------------------------------------------------------------------------------------


def test_a_blind_eye_is_found_out():
    table = SeeTrial().scene(np.random.default_rng(0))
    outcome = judge(table, View((), ()))
    assert outcome.figures["found"] == 0
    assert outcome.reason.count("not seen") == len(table.placed)
    with pytest.raises(InputError, match="no renderer 'oil'; give one of: drawn, physics"):
        SeeTrial("oil")


def test_without_mujoco_its_renderer_names_the_extra(monkeypatch):
    monkeypatch.setattr("arm3dof.runtime.see_trial.find_spec", lambda _: None)
    SeeTrial("drawn")
    with pytest.raises(MissingExtra, match="'physics' needs the extra 'physics'"):
        SeeTrial("physics")


@pytest.mark.slow
def test_mujoco_s_pictures_are_seen_as_well():
    report = see_report(run_campaign(SeeTrial("physics"), 8, 3))
    assert report["recall"] >= 0.97
    assert report["false_objects"] == 0
    assert report["median_error_m"] < 0.003


@pytest.mark.slow
def test_the_command_counts_and_resumes(tmp_path):
    def run(*words):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            code = app.main(["campaign", "see", "--out", str(tmp_path), *words])
        return code, said.getvalue()

    _, text = run("--n", "6", "--workers", "1", "--json")
    report = json.loads(text)
    assert report["n"] == 6
    assert report["objects"] >= 6
    assert set(report["goals"]) == set(goals(report))
    done = run_campaign(SeeTrial(), 6, 0)
    assert {**see_report(done), "wall_s": 0, "goals": 0} == {**report, "wall_s": 0, "goals": 0}
    _, text = run("--n", "6", "--workers", "1")
    assert "6 of them taken from the journal" in text
    code, text = run("--n", "6", "--trial", "2", "--json")
    alone = json.loads(text)
    assert code == (0 if done.outcomes[2].success else 1)
    assert Path(alone["files"][0]).is_file()
