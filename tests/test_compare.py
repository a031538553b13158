"""The comparison: the same scenarios for all, honest sums, clean processes."""

import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from arm3dof.cli import app
from arm3dof.control import baselines
from arm3dof.errors import ArmError, InputError
from arm3dof.model.library import load_robot
from arm3dof.runtime import compare as module
from arm3dof.runtime.compare import Comparison, compare, overshoot, run_scenario
from arm3dof.runtime.parallel import PackedRobot, core_count, run_all
from arm3dof.runtime.scenarios import CONDITIONS, DURATION, Scenario, scenario_set
from arm3dof.ui.compare_plots import plot_comparison
from arm3dof.ui.plots import png
from tests.runs import smooth_run

FAST = ["computed-torque", "pd-gravity"]


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


@pytest.fixture(scope="module")
def paper_moves(robot):
    """The paper's move under each condition."""
    return [scenario_set(robot)[4 * k] for k in range(len(CONDITIONS))]


@pytest.fixture(scope="module")
def comparison(robot, paper_moves):
    return compare(robot, paper_moves, ["mpc-tracking", *FAST])


# ---- scenarios ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "moves"), [("quick", 4), ("full", 16)])
def test_every_condition_gets_the_same_moves_inside_the_ranges(robot, size, moves):
    scenarios = scenario_set(robot, size, seed=3)
    assert len(scenarios) == moves * len(CONDITIONS)
    limits = robot.limits
    for k, scenario in enumerate(scenarios):
        first = scenarios[k % moves]
        assert scenario.condition == CONDITIONS[k // moves]
        np.testing.assert_array_equal(scenario.start, first.start)
        np.testing.assert_array_equal(scenario.target, first.target)
        for q in (scenario.start, scenario.target):
            assert (q >= limits.q_min).all()
            assert (q <= limits.q_max).all()
        assert np.abs(scenario.target - scenario.start).max() <= 1.5 + 1e-12
    np.testing.assert_array_equal(scenarios[0].target, np.deg2rad([28.1, 67.8, 53.8]))


def test_seeds_decide_and_only_seeds(robot):
    again = zip(scenario_set(robot, seed=1), scenario_set(robot, seed=1), strict=True)
    for one, other in again:
        np.testing.assert_array_equal(one.start, other.start)
        assert one.seed == other.seed
    other = scenario_set(robot, seed=2)
    assert not np.array_equal(scenario_set(robot, seed=1)[1].start, other[1].start)


def test_joints_without_limits_move_too():
    turning = load_robot("arm3dof", overrides={"joint1.lower": -1e9, "joint1.upper": 1e9})
    limits = replace(turning.limits, q_min=[-np.inf, -1, -1], q_max=[np.inf, 1, 1])
    turning.limits = limits
    for scenario in scenario_set(turning):
        assert np.isfinite([scenario.start, scenario.target]).all()


def test_each_condition_does_what_its_name_says(robot, paper_moves):
    nominal, payload, wrong, push, noise = (move.plant(robot, 0.05) for move in paper_moves)
    start = paper_moves[0].start
    assert 0.05 / nominal.dt == pytest.approx(round(0.05 / nominal.dt))
    np.testing.assert_array_equal(nominal.robot.gravity(start), robot.gravity(start))
    np.testing.assert_allclose(
        payload.robot.gravity(start), robot.with_payload(0.1).gravity(start), atol=1e-12
    )
    assert not np.allclose(wrong.robot.gravity(start), robot.gravity(start), rtol=1e-3)
    assert not np.array_equal(noise.measure().q, noise.state.q)
    before = push.state.q
    for _ in range(round(2.0 / push.dt)):
        push.plant.reset(push.plant.state)  # at rest, so that only the push moves it
        push.step(push.robot.gravity(push.state.q))
    moved = np.abs(push.state.q - before)
    assert np.sort(moved)[-1] == pytest.approx(np.deg2rad(10), abs=1e-3)


def test_an_unknown_set_is_refused_by_name(robot):
    with pytest.raises(InputError, match="scenarios is 'huge'; give one of: quick, full"):
        scenario_set(robot, "huge")


# ---- figures of merit --------------------------------------------------------------------------


def test_overshoot_is_how_far_a_joint_went_past_its_target(robot):
    recording = smooth_run(robot)
    e = np.array(recording.e)
    assert overshoot(recording, 10.0) == 0.0
    e[700, 1], e[900, 2] = -0.2, -0.3
    e[:, 0] = 0.0
    e[300:, 0] = 0.7  # a joint that was to stand still has no direction to overshoot in
    past = replace(recording, e=e)
    assert overshoot(past, 10.0) == pytest.approx(0.3)
    assert overshoot(past, float(recording.t[800])) == pytest.approx(0.2)


def test_settling_counts_from_the_push_on(robot, paper_moves):
    controller = baselines.computed_torque(robot)
    nominal = run_scenario(robot, controller, "x", paper_moves[0])
    pushed = run_scenario(robot, controller, "x", paper_moves[3])
    assert pushed.metrics.settling_time > 2.0
    assert pushed.settling_time == pytest.approx(pushed.metrics.settling_time - 2.0)
    assert nominal.settling_time == nominal.metrics.settling_time
    assert pushed.overshoot == nominal.overshoot
    assert nominal.t.shape == nominal.error.shape == nominal.step_time.shape == (80,)


def test_rows_sum_up_their_runs(comparison):
    assert comparison.controllers == ("mpc-tracking", *FAST)
    assert comparison.conditions == tuple(condition.name for condition in CONDITIONS)
    for row in comparison.table():
        runs = comparison.select(row.controller)
        assert row.runs == len(runs) == len(CONDITIONS)
        rms = np.concatenate([[run.metrics.rms_error] for run in runs])
        assert row.rms_error == pytest.approx(np.sqrt(np.mean(rms**2)))
        assert row.energy == pytest.approx(np.mean([run.metrics.energy for run in runs]))
        assert row.worst_final_error == max(run.metrics.final_error for run in runs)
        assert row.settled == np.mean([run.metrics.settled for run in runs])
        assert 0 < row.step_time_p50 <= row.step_time_p99
        assert row.torque_violations == 0
    for condition in comparison.conditions:
        assert [row.runs for row in comparison.table(condition)] == [1, 1, 1]


def test_a_median_run_that_did_not_settle_has_no_settling_time(comparison):
    run = comparison.runs[0]
    unsettled = replace(run, settling_time=None)
    for settled, lost in ((1, 2), (1, 1)):
        runs = (run,) * settled + (unsettled,) * lost
        assert Comparison(runs, {}).table()[0].settling_time is None
    mostly = Comparison((run, run, unsettled), {}).table()[0]
    assert mostly.settling_time == run.settling_time


def test_mpc_has_the_least_error_and_breaks_limits_least(comparison):
    mpc, *others = comparison.table()
    for other in others:
        assert mpc.rms_error < other.rms_error
        assert mpc.worst_final_error < other.worst_final_error
        assert mpc.settled >= other.settled
        broken = [row.velocity_violations + row.position_violations for row in (mpc, other)]
        assert broken[0] <= broken[1]
        assert other.step_time_p50 < mpc.step_time_p50  # what the simple ones are better at


def test_what_cannot_be_compared_is_refused_by_name(robot, comparison, paper_moves):
    with pytest.raises(InputError, match="no controller 'lqr'; give one of: mpc-tracking"):
        compare(robot, paper_moves, ["lqr"])
    with pytest.raises(InputError, match="nothing to compare"):
        compare(robot, [])
    with pytest.raises(InputError, match="condition is 'storm'; give one of: all, nominal"):
        comparison.table("storm")


def test_the_figure_draws_any_number_of_conditions(comparison, robot):
    assert png(plot_comparison(comparison)).startswith(b"\x89PNG")
    one = Comparison(comparison.select("pd-gravity", "nominal"), {})
    axes = plot_comparison(one).axes
    assert [it.get_title(loc="left") for it in axes if it.lines][:2] == ["nominal", "RMS error"]


# ---- processes ---------------------------------------------------------------------------------


def square(x):
    return x * x


def fail(x):
    raise InputError(f"cannot do {x}")


def die(_):
    os._exit(3)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_every_task_is_done_once_and_reported(workers):
    told = []
    results = dict(run_all(square, range(6), workers=workers, progress=lambda *at: told.append(at)))
    assert results == {k: k * k for k in range(6)}
    assert told == [(k, 6) for k in range(1, 7)]
    assert dict(run_all(square, [], workers=workers)) == {}


@pytest.mark.slow
def test_errors_of_workers_are_the_callers():
    for workers in (1, 2):
        with pytest.raises(InputError, match="cannot do"):
            list(run_all(fail, [1, 2], workers=workers))
    with pytest.raises(ArmError, match="ended from outside"):
        list(run_all(die, [1, 2], workers=2))
    with pytest.raises(InputError, match="workers is 0"):
        list(run_all(square, [1], workers=0))
    assert core_count() >= 1


def test_a_packed_robot_is_the_robot_and_is_built_once(robot):
    packed = PackedRobot.of(robot.with_payload(0.2))
    q = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(
        packed.unpack().gravity(q), robot.with_payload(0.2).gravity(q), atol=1e-12
    )
    assert packed.unpack() is packed.unpack()


@pytest.mark.slow
def test_processes_change_no_figure_but_step_times(robot, paper_moves, comparison):
    shared = compare(robot, paper_moves, FAST, workers=2)
    for row, expected in zip(shared.table(), comparison.table()[1:], strict=True):
        same = replace(row, step_time_p50=expected.step_time_p50, step_time_p99=0)
        assert same == replace(expected, step_time_p99=0)


# ---- the command -------------------------------------------------------------------------------


@pytest.fixture
def few(monkeypatch):
    """Let the command run two scenarios in this process."""
    whole = scenario_set

    def two(robot, size, seed):
        return whole(robot, size, seed)[:8:4]

    monkeypatch.setattr("arm3dof.cli.compare.scenario_set", two)
    monkeypatch.setattr("arm3dof.cli.compare.core_count", lambda: 1)


@pytest.mark.slow
def test_the_command_prints_a_table_and_writes_it(few, capsys, tmp_path):
    words = ["compare", "--controller", "computed-torque", "--controller", "mpc-tracking"]
    assert app.main([*words, "--out", str(tmp_path / "new")]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for text in ("computed torque", "MPC", "RMS error", "payload 0.1 kg", "compare.png"):
        assert text in out
    report = json.loads((tmp_path / "new" / "compare.json").read_text())
    assert len(report["rows"]) == 2 * 3
    assert {row["condition"] for row in report["rows"]} == {"all", "nominal", "payload 0.1 kg"}
    assert app.main([*words, "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["rows"][0]["controller"] == "computed-torque"
    assert json.loads(out)["files"] == []
    assert err == ""


def test_the_command_says_no_more_than_one_line_about_bad_input(capsys):
    for words in (["--scenarios", "huge"], ["--controller", "lqr"], ["--workers", "0"]):
        assert app.main(["compare", *words]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1


def has_children(pid, count):
    children = Path(f"/proc/{pid}/task/{pid}/children")
    return len(children.read_text().split()) >= count


@pytest.mark.slow
def test_ctrl_c_stops_every_process_with_one_word(tmp_path):
    program = [sys.executable, "-c", "import arm3dof.cli as c, sys; sys.exit(c.main())"]
    words = ["compare", "--controller", "computed-torque", "--scenarios", "full", "--workers", "2"]
    with subprocess.Popen(
        [*program, *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        pause = threading.Event()
        while not has_children(process.pid, 3):  # two workers, and what cleans up behind them
            pause.wait(0.02)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=20)  # ends when no process holds the pipes
    assert (process.returncode, out, err) == (130, "", "stopped\n")


@pytest.mark.slow
def test_workers_end_when_the_command_is_killed(tmp_path):
    program = [sys.executable, "-c", "import arm3dof.cli as c, sys; sys.exit(c.main())"]
    words = ["compare", "--controller", "computed-torque", "--scenarios", "full", "--workers", "2"]
    with subprocess.Popen(
        [*program, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as process:
        pause = threading.Event()
        while not has_children(process.pid, 3):
            pause.wait(0.02)
        left = psutil.Process(process.pid).children()
        process.kill()
        process.communicate(timeout=20)  # ends when no process holds the pipe
    assert psutil.wait_procs(left, timeout=20)[1] == []


def test_tuned_controllers_say_their_gains(robot, comparison):
    assert set(comparison.gains) == {"pd-gravity"}
    with pytest.raises(InputError, match="mpc-paper has no gains"):
        module._tune((PackedRobot.of(robot), "mpc-paper"))


def test_a_scenario_lasts_as_long_as_it_says(robot, paper_moves):
    scenario = paper_moves[0]
    assert isinstance(scenario, Scenario)
    run = run_scenario(robot, baselines.computed_torque(robot), "x", scenario)
    assert run.t[-1] == pytest.approx(DURATION - 0.05)
