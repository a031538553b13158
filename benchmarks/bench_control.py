"""What one control step costs beside ProxQP alone, Crocoddyl and IPOPT, and where the time goes.

All answer the same states along the same closed loops, in turns, one thread each.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from arm3dof import MpcController, MpcSettings, load_robot
from arm3dof.control import solver
from arm3dof.control.observer import Observer
from arm3dof.control.solver import ProgramSolver
from arm3dof.model.robot import Robot
from benchmarks.arms import problem_of
from benchmarks.contestants import BareProxqp, Contestant, Ours, PeerContestant
from benchmarks.motions import Motion, record_motions
from benchmarks.peers.process import PeerProcess
from benchmarks.tables import Table, machine
from benchmarks.timing import Stopwatch, Timing, one_core, take_turns

ROBOTS = ("arm3dof", "ur5", "panda")
HORIZONS = (10, 20, 40)
RESULTS = Path(__file__).parent / "results" / "control.json"

OURS, PROXQP = "arm3dof", "ProxQP"
PEERS = {
    "Crocoddyl, 1 iteration": "crocoddyl, 1 iteration",
    "Crocoddyl, converged": "crocoddyl, converged",
    "IPOPT": "ipopt, soft limits",
    "IPOPT, hard limits": "ipopt",
}
ONE_ITERATION = "Crocoddyl, 1 iteration"
ROUNDS, BUDGET = 25, 10.0  # [s]: what a contestant may take for its rounds
MOTIONS, DURATION = 4, 2.0  # [s]


class Case(NamedTuple):
    """What was measured for one robot and one horizon.

    Attributes:
        robot: name.
        joints: number of joints.
        horizon: number of stages N.
        timings: of each contestant.
        parts: share of our time in each part.
        facts: what else is worth keeping.
    """

    robot: str
    joints: int
    horizon: int
    timings: dict[str, Timing]
    parts: dict[str, float]
    facts: dict[str, Any]

    def ratio(self, other: str) -> float:
        """Return our median time by another's."""
        return self.timings[OURS].ratio(self.timings[other])

    def to_dict(self) -> dict[str, Any]:
        """Return the case as values that JSON can hold."""
        others = [name for name in self.timings if name != OURS]
        return {
            "robot": self.robot,
            "joints": self.joints,
            "horizon": self.horizon,
            "timings": {name: timing.to_dict() for name, timing in self.timings.items()},
            "ratios": {name: round(self.ratio(name), 4) for name in others},
            "parts": {name: round(share, 3) for name, share in self.parts.items()},
            **self.facts,
        }


def run(*, quick: bool) -> list[Table]:
    """Measure all robots and horizons; ``quick`` measures ours and ProxQP for a moment."""
    if quick:
        return tables([measure(load_robot("arm3dof"), 10, None, motions=1, rounds=1)])
    cases = measure_all(ROBOTS, HORIZONS, ROUNDS)
    goals = judge(cases)
    RESULTS.parent.mkdir(exist_ok=True)
    found = {"machine": machine(), "cases": [case.to_dict() for case in cases], "goals": goals}
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")
    return [*tables(cases), goal_table(goals)]


def measure_all(robots: Sequence[str], horizons: Sequence[int], rounds: int) -> list[Case]:
    """Time some robots and horizons, with the peers.

    Args:
        robots: names.
        horizons: numbers of stages N.
        rounds: how often each motion is answered.
    """
    cases = []
    with one_core(), PeerProcess() as peers:
        for name in robots:
            for horizon in horizons:
                print(f"   {name}, N = {horizon}", file=sys.stderr, flush=True)
                cases.append(measure(load_robot(name), horizon, peers, rounds=rounds))
    return cases


def measure(
    robot: Robot,
    horizon: int,
    peers: PeerProcess | None,
    *,
    motions: int = MOTIONS,
    rounds: int = ROUNDS,
) -> Case:
    """Time one robot and one horizon.

    Args:
        robot: the robot.
        horizon: number of stages N.
        peers: the peers' process; without it ours and ProxQP are timed alone.
        motions: number of closed loops.
        rounds: how often each is answered, at most; by the slow ones less often.
    """
    settings = MpcSettings(horizon=horizon)
    recorded = record_motions(robot, settings, motions, DURATION)
    bare = BareProxqp(robot, settings, recorded)
    contestants: dict[str, Contestant] = {
        OURS: Ours(robot, settings, recorded),
        PROXQP: bare,
    }
    facts: dict[str, Any] = {
        "saturation": round(float(np.mean([motion.saturation for motion in recorded])), 3),
        "qp_size": [round(size, 1) for size in bare.sizes],
    }
    asked: dict[str, PeerContestant] = {}
    if peers is not None:
        facts["disagreement"] = peers.load(problem_of(robot, settings))
        asked = {label: PeerContestant(peers, name, recorded) for label, name in PEERS.items()}
        contestants |= asked
    timings = take_turns(contestants, motions, rounds, BUDGET)
    facts["peers"] = {label: peer.facts() for label, peer in asked.items()}
    parts = shares(robot, settings, recorded)
    return Case(robot.name, robot.nv, horizon, timings, parts, facts)


def shares(robot: Robot, settings: MpcSettings, motions: list[Motion]) -> dict[str, float]:
    """Return the share of a step's time that each part takes, over the middle half of the steps."""
    controller = MpcController(robot, settings)
    watch = Stopwatch(
        {
            "step": (MpcController, "step"),
            "observe": (Observer, "measure"),
            "build": (type(controller._formulation), "build"),
            "program": (ProgramSolver, "solve"),
            "dual": (solver, "solve_box"),
        }
    )
    laps = []
    with watch.running():
        for motion in motions:
            controller.reset()
            for state in motion.states:
                controller.step(state, motion.q_target)
                laps.append(watch.lap())
    laps.sort(key=lambda lap: lap["step"])
    quarter = len(laps) // 4
    usual = laps[quarter : len(laps) - quarter]
    spent = {part: sum(lap[part] for lap in usual) for part in usual[0]}
    parts = {
        "observer": spent["observe"],
        "torque rows, prediction": spent["build"],
        "limits": spent["program"] - spent["dual"],
        "dual": spent["dual"],
    }
    parts["rest"] = spent["step"] - sum(parts.values())
    return {part: seconds / spent["step"] for part, seconds in parts.items()}


def judge(cases: list[Case]) -> list[dict[str, Any]]:
    """Return each goal of speed with its figure."""
    found = {(case.robot, case.horizon): case for case in cases}
    arm, panda = found["arm3dof", 20], found["panda", 20]
    ours = arm.timings[OURS]
    grows = {name: growth(cases, "arm3dof", name) for name in (OURS, ONE_ITERATION)}
    goals = [
        ("3 joints, N = 20: p50 by Crocoddyl's one iteration", arm.ratio(ONE_ITERATION), 0.8),
        ("3 joints, N = 20: p50 by IPOPT", arm.ratio("IPOPT"), 1 / 40),
        ("the same by IPOPT with hard limits", arm.ratio("IPOPT, hard limits"), 1 / 40),
        ("3 joints, N = 20: p50 by ProxQP alone", arm.ratio(PROXQP), 2.0),
        ("3 joints, N = 20: p99 by p50", ours.p99 / ours.p50, 3.0),
        ("the same within a round, median of the rounds", ours.spread, 3.0),
        ("the same, each step in its best round", ours.calm_p99 / ours.calm_p50, 3.0),
        ("7 joints, N = 20: p50 by Crocoddyl's one iteration", panda.ratio(ONE_ITERATION), 1.0),
        (
            "3 joints: growth of p50 from N = 10 to 40 by Crocoddyl's",
            grows[OURS] / grows[ONE_ITERATION],
            1.0,
        ),
    ]
    return [
        {"goal": goal, "figure": round(figure, 4), "limit": limit, "met": figure <= limit}
        for goal, figure, limit in goals
    ]


def growth(cases: list[Case], robot: str, contestant: str) -> float:
    """Return the median time at the longest horizon by that at the shortest."""
    p50 = {case.horizon: case.timings[contestant].p50 for case in cases if case.robot == robot}
    return p50[max(p50)] / p50[min(p50)]


def tables(cases: list[Case]) -> list[Table]:
    """Return the times, the ratios and the shares as tables."""
    names = list(cases[0].timings)
    others = [name for name in names if name != OURS]
    parts = list(cases[0].parts)
    labels = [(case.robot, str(case.joints), str(case.horizon)) for case in cases]
    heads = ("robot", "joints", "N")
    return [
        Table(
            "Control step: time",
            (*heads, *(f"{name} p50 / p99 [us]" for name in names)),
            [
                (*label, *(_times(case.timings[name]) for name in names))
                for label, case in zip(labels, cases, strict=True)
            ],
            "Ours is a whole MpcController.step from Python: state in, torque out; torque, "
            "velocity and joint limits on. Of the others it is the solver's call alone.",
        ),
        Table(
            "Control step: ours by theirs",
            (*heads, *others, "our p99 / p50", "a round's", "best rounds'"),
            [
                (*label, *(f"{case.ratio(name):.3f}" for name in others), *_spread(case))
                for label, case in zip(labels, cases, strict=True)
            ],
            "Ratio of medians, measured in turns; below 1 ours is faster. A machine that changes "
            "its pace widens p99 / p50 of all rounds together, but not that of one round (the "
            "median is shown); each step's best round leaves out all else that the machine did.",
        ),
        Table(
            "Control step: where the time goes",
            (*heads, *parts),
            [
                (*label, *(f"{100 * case.parts[part]:.0f} %" for part in parts))
                for label, case in zip(labels, cases, strict=True)
            ],
        ),
    ]


def goal_table(goals: list[dict[str, Any]]) -> Table:
    """Return the goals of speed as a table."""
    rows = [
        (g["goal"], f"{g['figure']:.3f}", f"<= {g['limit']:.3f}", "yes" if g["met"] else "no")
        for g in goals
    ]
    return Table("Control step: goals", ("goal", "figure", "limit", "met"), rows)


def _times(timing: Timing) -> str:
    return f"{1e6 * timing.p50:.0f} / {1e6 * timing.p99:.0f}"


def _spread(case: Case) -> tuple[str, ...]:
    ours = case.timings[OURS]
    spreads = ours.p99 / ours.p50, ours.spread, ours.calm_p99 / ours.calm_p50
    return tuple(f"{spread:.2f}" for spread in spreads)


def main() -> None:
    """Measure a part and print its tables, without keeping them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bench_control")
    parser.add_argument("--robots", nargs="+", default=ROBOTS, choices=ROBOTS)
    parser.add_argument("--horizons", nargs="+", type=int, default=HORIZONS)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    asked = parser.parse_args()
    for table in tables(measure_all(asked.robots, asked.horizons, asked.rounds)):
        print(f"\n{table.text()}")


if __name__ == "__main__":
    main()
