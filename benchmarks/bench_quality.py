"""What real-time iteration costs in quality: our closed loops beside NMPC solved to convergence.

Each pair of start and target is run once with every controller on the same simulated arm, with
weights so eager that torques are often at their limits. A run's cost is (37) summed up over what
really happened: the states at the control steps, and as input the mean acceleration in between.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from arm3dof import (
    ControlStatus,
    ControlStep,
    JointState,
    MpcController,
    MpcSettings,
    PinocchioPlant,
    load_robot,
    run_loop,
    summarise,
)
from arm3dof.control.settings import Formulation
from arm3dof.control.step import Controller, TorqueSource
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from benchmarks.arms import problem_of
from benchmarks.motions import random_pair
from benchmarks.peers.process import PYTHON, PeerProcess
from benchmarks.tables import Table, machine

RESULTS = Path(__file__).parent / "results" / "quality.json"
NMPC = "NMPC"
FORMULATIONS: tuple[Formulation, ...] = ("tracking", "paper")
PAIRS, DURATION = 200, 1.5  # [s]
OVERRIDES = {  # a load, and servos that can just hold it: it takes 91 % of joint2's torque
    "link3.mass": 0.45,
    "joint1.effort": 0.15,
    "joint2.effort": 0.95,
    "joint3.effort": 0.36,
}
WEIGHTS: Mapping[str, Any] = {"input_weight": 1e-4}
MEAN_LIMIT, WORST_LIMIT, LEAST_SATURATION = 1.02, 1.10, 0.2


class Outcome(NamedTuple):
    """What one run cost.

    Attributes:
        cost: of (37), over the run.
        saturation: share of control steps with a torque at its limit.
        settled: whether the run ended at rest on the target.
        over_speed: share of plant steps over a speed limit by more than 1 %.
        out_of_range: share of plant steps over 0.5 deg outside a joint's range.
        not_optimal: share of control steps that ended without an optimum.
    """

    cost: float
    saturation: float
    settled: bool
    over_speed: float
    out_of_range: float
    not_optimal: float


class NmpcController:
    """Nonlinear MPC solved to convergence by IPOPT, in the peers' process."""

    def __init__(self, robot: Robot, settings: MpcSettings, peers: PeerProcess) -> None:
        self._peers, self._settings = peers, settings
        self._nv, self._tau_max = robot.nv, robot.limits.tau_max
        peers.load(problem_of(robot, settings))
        self._fresh = True

    @property
    def dt(self) -> float:
        """Time between two steps [s]."""
        return self._settings.dt

    def reset(self) -> None:
        """Forget the past."""
        self._fresh = True

    def step(self, state: JointState, q_target: ArrayLike) -> ControlStep:
        """Return the torque to apply until the next step."""
        target = np.asarray(q_target, float)
        answer = self._peers.run(
            "ipopt, soft limits",
            target,
            state.q[np.newaxis],
            state.v[np.newaxis],
            fresh=self._fresh,
        )
        self._fresh = False
        return ControlStep(
            tau=np.clip(answer["tau"][0], -self._tau_max, self._tau_max),
            u=answer["u"][0],
            plan=np.concatenate([target - state.q, state.v])[np.newaxis],
            status=ControlStatus.SOLVED if answer["converged"][0] else ControlStatus.NOT_SOLVED,
            source=TorqueSource.OPTIMUM,
            solve_time=float(answer["step_time"][0]),
        )


def run(*, quick: bool) -> list[Table]:
    """Run all pairs; ``quick`` runs two, without NMPC."""
    if quick:
        return [table(compare(2, FORMULATIONS, workers=1, with_nmpc=False))]
    found = compare(PAIRS, FORMULATIONS, workers=os.cpu_count() or 1)
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")
    return [table(found)]


def compare(
    pairs: int, formulations: Sequence[str], *, workers: int, with_nmpc: bool = True
) -> dict[str, Any]:
    """Run every pair with every controller and return the figures.

    Args:
        pairs: number of pairs of start and target.
        formulations: of ours.
        workers: number of processes.
        with_nmpc: whether NMPC runs too; without it there are no ratios.
    """
    names = ((NMPC,) if with_nmpc else ()) + tuple(formulations)
    outcomes: list[dict[str, Outcome]] = []
    began = time.perf_counter()
    with ProcessPoolExecutor(workers) as pool:
        for outcome in pool.map(_run_pair, range(pairs), [names] * pairs):
            outcomes.append(outcome)
            if len(outcomes) % 10 == 0:
                spent = time.perf_counter() - began
                print(f"   {len(outcomes)} of {pairs} pairs, {spent:.0f} s", file=sys.stderr)
    return {
        "machine": machine(),
        "pairs": pairs,
        "duration_s": DURATION,
        "overrides": OVERRIDES,
        "settings": dict(WEIGHTS),
        "controllers": {name: _figures(outcomes, name) for name in names},
    }


def table(found: dict[str, Any]) -> Table:
    """Return the figures as a table."""
    rows = []
    for name, figures in found["controllers"].items():
        ratio = figures.get("ratio")
        rows.append(
            (
                name,
                f"{ratio['mean']:.4f}" if ratio else "",
                f"{ratio['worst']:.4f}" if ratio else "",
                f"{figures['mean_cost']:.2f}",
                *(f"{100 * figures[share]:.1f} %" for share in ("saturation", "settled")),
                *(f"{100 * figures[share]:.2f} %" for share in ("over_speed", "out_of_range")),
                f"{100 * figures['not_optimal']:.2f} %",
            )
        )
    return Table(
        "Closed-loop quality",
        (
            "controller",
            "cost by NMPC's, mean",
            "worst",
            "mean cost",
            "at a torque limit",
            "settled",
            "over speed",
            "out of range",
            "not optimal",
        ),
        rows,
        f"{found['pairs']} random pairs of start and target on the reference arm, "
        f"{found['duration_s']} s each, with {found['settings']} and {found['overrides']}. "
        f"Goal: mean <= {MEAN_LIMIT}, worst <= {WORST_LIMIT}, with a torque at its limit in "
        f"{100 * LEAST_SATURATION:.0f} % of the steps or more.",
    )


def closed_loop_cost(recording: Recording, settings: MpcSettings) -> float:
    """Return (37) of what happened: sum x' Q x + u' R u, and x' P x at the end.

    Args:
        recording: the run, from a control step to a control step.
        settings: weights and sampling time.
    """
    problem = problem_of(recording.load_robot(), settings)
    x = np.hstack([recording.e, recording.v])[recording.control_rows]
    n = recording.q_target.size
    u = np.diff(x[:, n:], axis=0) / settings.dt
    stages = np.einsum("ki,ij,kj", x[:-1], problem.Q, x[:-1])
    inputs = np.einsum("ki,ij,kj", u, problem.R, u)
    return float(stages + inputs + x[-1] @ problem.P @ x[-1])


def _run_pair(index: int, names: Sequence[str]) -> dict[str, Outcome]:
    robot = _robot()
    start, target = random_pair(robot, np.random.default_rng([7, index]))
    return {name: _run_one(robot, _controller(name), start, target) for name in names}


def _run_one(robot: Robot, controller: Controller, start: Array, target: Array) -> Outcome:
    plant = PinocchioPlant(robot)
    plant.reset(JointState(0.0, start, np.zeros(robot.nv)))
    controller.reset()
    # one plant step more, so that the last row is the control step at the end
    recording = run_loop(plant, controller, target, DURATION + plant.dt)
    metrics = summarise(recording)
    counts = metrics.status_counts
    good = counts.get("solved", 0) + counts.get("softened", 0)
    return Outcome(
        cost=closed_loop_cost(recording, _settings("tracking")),
        saturation=metrics.saturation,
        settled=metrics.settled,
        over_speed=metrics.velocity_violations / len(recording),
        out_of_range=metrics.position_violations / len(recording),
        not_optimal=1 - good / sum(counts.values()),
    )


def _figures(outcomes: Sequence[Mapping[str, Outcome]], name: str) -> dict[str, Any]:
    own = [outcome[name] for outcome in outcomes]
    figures: dict[str, Any] = {
        "mean_cost": float(np.mean([o.cost for o in own])),
        **{
            share: float(np.mean([getattr(o, share) for o in own])) for share in Outcome._fields[1:]
        },
    }
    if NMPC in outcomes[0]:
        ratios = np.array([outcome[name].cost / outcome[NMPC].cost for outcome in outcomes])
        figures["ratio"] = {
            "mean": float(ratios.mean()),
            "median": float(np.median(ratios)),
            "p95": float(np.percentile(ratios, 95)),
            "worst": float(ratios.max()),
            "worst_pair": int(ratios.argmax()),
        }
    return figures


@cache
def _robot() -> Robot:
    return load_robot("arm3dof", overrides=OVERRIDES)


@cache
def _settings(formulation: str) -> MpcSettings:
    return {name: MpcSettings(formulation=name, **WEIGHTS) for name in get_args(Formulation)}[
        formulation
    ]


@cache
def _controller(name: str) -> Controller:
    """Return a controller; each process makes its own, and with NMPC its own peers."""
    if name == NMPC:
        return NmpcController(_robot(), _settings("tracking"), PeerProcess())
    return MpcController(_robot(), _settings(name))


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bench_quality")
    parser.add_argument("--pairs", type=int, default=PAIRS)
    parser.add_argument(
        "--formulations", nargs="+", default=FORMULATIONS, choices=get_args(Formulation)
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    if not PYTHON.exists():
        parser.error("the peers are missing: python3 benchmarks/peers/install.py")
    print(json.dumps(compare(asked.pairs, asked.formulations, workers=asked.workers), indent=1))


if __name__ == "__main__":
    main()
