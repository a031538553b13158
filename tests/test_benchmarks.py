"""What benchmarks measure is what they say: the same arm, the same problem, the same states."""

import dataclasses
import json
import os

import numpy as np
import pinocchio as pin
import pytest

from arm3dof import JointState, MpcController, MpcSettings, PinocchioPlant, load_robot, run_loop
from arm3dof.control.formulation import Weights
from benchmarks import bench_control, bench_quality
from benchmarks.arms import arm_of, problem_of
from benchmarks.contestants import BareProxqp
from benchmarks.motions import random_pair, record_motions
from benchmarks.peers.pinocchio_arm import build_model
from benchmarks.peers.problem import Problem
from benchmarks.timing import Stopwatch, Timing, one_core, take_turns


@pytest.mark.parametrize("name", ["arm3dof", "ur5", "panda"])
def test_the_peers_are_given_the_same_arm(name):
    robot = load_robot(name)
    model = build_model(problem_of(robot, MpcSettings()))
    data = model.createData()
    rng = np.random.default_rng(0)
    for q, v, a in rng.uniform(-3, 3, (50, 3, robot.nv)):
        expected = pin.rnea(robot.model, robot.model.createData(), q, v, a)
        np.testing.assert_allclose(pin.rnea(model, data, q, v, a), expected, atol=1e-10)


def test_a_problem_survives_the_pipe():
    problem = problem_of(load_robot("ur5"), MpcSettings(horizon=7))
    copy = Problem.from_dict(json.loads(json.dumps(problem.to_dict())))
    for ours, theirs in ((problem, copy), (problem.arm, copy.arm)):
        for field in dataclasses.fields(ours):
            if field.name != "arm":
                np.testing.assert_array_equal(
                    getattr(ours, field.name), getattr(theirs, field.name)
                )


def test_a_sliding_joint_is_refused():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")

    class Sliding:
        def __init__(self):
            self.model, self.gravity_acceleration = model, np.zeros(3)

    with pytest.raises(ValueError, match="slides"):
        arm_of(Sliding())


def test_the_optimum_costs_in_the_problem_what_it_costs_in_the_qp():
    """The problem's matrices, rolled out, give the QP's cost up to its constant."""
    robot, settings = load_robot(), MpcSettings(horizon=6)
    problem, rng = problem_of(robot, settings), np.random.default_rng(1)
    state = JointState(0.0, [0.1, 0.2, 0.3], [0.5, -0.4, 0.3])
    target = np.array([0.4, 0.5, 0.1])
    qp = MpcController(robot, settings).optimise(state, target).quadratic_program()

    def rolled_out(w):
        x, cost = np.concatenate([target - state.q, state.v]), 0.0
        for u in w.reshape(-1, 3):
            cost += x @ problem.Q @ x + u @ problem.R @ u
            x = problem.A @ x + problem.B @ u
        return cost + x @ problem.P @ x

    apart = [rolled_out(w) - (w @ qp.H @ w / 2 + qp.g @ w) for w in rng.normal(size=(10, 18))]
    np.testing.assert_allclose(apart, apart[0], rtol=1e-8)


def test_random_pairs_stay_inside_the_limits():
    robot, rng = load_robot("ur5"), np.random.default_rng(0)
    for _ in range(200):
        for q in random_pair(robot, rng):
            assert (robot.limits.q_min <= q).all()
            assert (q <= robot.limits.q_max).all()


def test_bare_proxqp_gets_a_qp_for_every_state_and_solves_it():
    robot, settings = load_robot(), MpcSettings(horizon=5)
    motions = record_motions(robot, settings, 2, 0.5)
    bare = BareProxqp(robot, settings, motions)
    for motion, recorded in enumerate(motions):
        assert bare.times(motion).shape == (len(recorded.states),)
    assert bare.sizes[0] == 15


class Fake:
    def __init__(self, name, seconds, log):
        self._name, self._seconds, self._log = name, seconds, log

    def times(self, motion):
        self._log.append((self._name, motion))
        return np.array([9.0, self._seconds, 2 * self._seconds])


def test_what_is_timed_stays_on_one_core_where_that_can_be_asked(monkeypatch):
    asked = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 3}, raising=False)
    monkeypatch.setattr(os, "sched_setaffinity", lambda pid, cores: asked.append(cores), False)
    with one_core():
        assert asked == [{3}]
    assert asked == [{3}, {0, 3}]
    monkeypatch.delattr(os, "sched_setaffinity")
    with one_core():
        assert len(asked) == 2


def test_contestants_take_turns():
    log = []
    contestants = {"a": Fake("a", 1.0, log), "b": Fake("b", 2.0, log)}
    found = take_turns(contestants, motions=2, most=3, budget=75.0)
    assert log[:2] == [("a", 0), ("b", 0)]
    assert log[2:6] == [("b", 0), ("a", 0), ("a", 1), ("b", 1)]
    assert log[6:] == [("a", 0), ("b", 0), ("b", 1), ("a", 1), ("a", 0), ("a", 1)]
    assert found["a"].times.shape == (3, 4)
    assert found["a"].p50 == 1.5
    assert found["a"].ratio(found["b"]) == 0.5


def test_the_best_round_leaves_a_disturbance_out():
    times = np.ones((3, 100))
    times[1, :5] = 50.0
    timing = Timing(times)
    assert timing.p99 == 50.0
    assert timing.calm_p99 == timing.calm_p50 == 1.0


def test_a_change_of_the_machines_pace_does_not_widen_the_spread_of_a_round():
    steps = np.tile([1.0, 2.0], (5, 50))
    steps[:, :2] = 3.0
    slow = np.array([1.0, 1.0, 1.0, 2.0, 2.0])[:, np.newaxis]
    assert Timing(steps).spread == Timing(slow * steps).spread
    assert (
        Timing(slow * steps).p99 / Timing(slow * steps).p50 > Timing(steps).p99 / Timing(steps).p50
    )


def test_a_stopwatch_leaves_methods_as_they_were():
    class Work:
        def do(self):
            return 42

    method = Work.do
    watch = Stopwatch({"work": (Work, "do")})
    with watch.running():
        assert Work().do() == 42
    assert Work.do is method
    assert watch.lap()["work"] > 0
    assert watch.lap()["work"] == 0


def test_the_shares_of_a_step_add_up():
    robot, settings = load_robot(), MpcSettings(horizon=5)
    shares = bench_control.shares(robot, settings, record_motions(robot, settings, 1, 0.5))
    assert sum(shares.values()) == pytest.approx(1.0)
    assert min(shares.values()) >= 0


def test_every_goal_is_judged():
    names = (bench_control.OURS, bench_control.PROXQP, *bench_control.PEERS)
    cases = [
        bench_control.Case(
            robot,
            3,
            horizon,
            {name: Timing(np.full((2, 10), (i + 1) * horizon)) for i, name in enumerate(names)},
            {"rest": 1.0},
            {},
        )
        for robot in bench_control.ROBOTS
        for horizon in bench_control.HORIZONS
    ]
    goals = bench_control.judge(cases)
    assert [goal["figure"] for goal in goals] == [
        0.3333,
        0.2,
        0.1667,
        0.5,
        1.0,
        1.0,
        1.0,
        0.3333,
        1.0,
    ]
    assert [goal["met"] for goal in goals] == [True, False, False, *[True] * 6]
    for table in (*bench_control.tables(cases), bench_control.goal_table(goals)):
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert json.dumps([case.to_dict() for case in cases])


def test_the_cost_of_standing_still_is_that_of_its_error():
    robot = load_robot(overrides={"gravity.z": 0.0})
    settings = MpcSettings()
    plant = PinocchioPlant(robot)
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))

    class Idle:
        dt = settings.dt

        def reset(self):
            pass

        def step(self, state, target):
            return dataclasses.replace(answer, tau=np.zeros(3))

    answer = MpcController(robot, settings).step(plant.state, np.zeros(3))
    target = np.array([0.1, -0.2, 0.3])
    recording = run_loop(plant, Idle(), target, 10 * settings.dt + plant.dt)
    weights = Weights(settings, 3)
    x = np.concatenate([target, np.zeros(3)])
    expected = 10 * x @ weights.Q @ x + x @ weights.P @ x
    assert bench_quality.closed_loop_cost(recording, settings) == pytest.approx(expected)


def test_quality_without_the_peers_gives_costs_and_no_ratios():
    found = bench_quality.compare(1, ("tracking",), workers=1, with_nmpc=False)
    assert found["controllers"]["tracking"]["mean_cost"] > 0
    assert "ratio" not in found["controllers"]["tracking"]
    table = bench_quality.table(found)
    assert all(len(row) == len(table.columns) for row in table.rows)
