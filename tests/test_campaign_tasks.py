"""The campaigns of tasks, and ``arm3dof sort``, from the command line."""

import json

import pytest


@pytest.mark.slow
def test_a_campaign_of_grasping(ask, run, tmp_path):
    words = ("campaign", "grasp", "--n", "1", "--seed", "5", "--workers", "1", "--out", tmp_path)
    code, answer = ask(*words)
    assert (code, answer["success_rate"], answer["failures"]) == (0, 1.0, [])
    assert {"success_rate", "successes", "n", "failures", "wall_s"} <= set(answer)
    assert answer["place_error_mm"]["max"] < 10
    assert answer["lift_mm"]["p50"] > 50
    assert (tmp_path / "grasp.jsonl").is_file()
    assert "taken from the journal" in run(*words)[1]  # nothing is run again


@pytest.mark.slow
def test_sorting_from_the_command_line(ask, tmp_path):
    code, answer = ask("sort", "--seed", "4", "--objects", "3", "--no-serve", "--out", tmp_path)
    assert (code, answer["outcome"], answer["objects_sorted"]) == (0, "sorted", 3)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["objects_fallen"] == 0
    assert "lifted" not in summary


def test_what_a_task_cannot_do_is_bad_input(refused):
    assert "no gripper" in refused("sort", "--robot", "ur5", "--no-serve")
    assert "pink" in refused("demo", "--target", "pink", "--no-serve")
