"""The peers' side of a benchmark: reads one request a line, answers with one line of JSON.

    {"do": "load", "problem": {...}}            -> what was checked
    {"do": "run", "peer": NAME, "fresh": true, "q_target": [...], "q": [[...]], "v": [[...]]}
                                                -> one list a field of Answer, one entry a state

Run by ``.venv-peers/bin/python -m benchmarks.peers.worker`` from the project's folder.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.peers.answer import Peer
from benchmarks.peers.casadi_dynamics import inverse_dynamics
from benchmarks.peers.crocoddyl_ddp import BoxFddp
from benchmarks.peers.ipopt import Ipopt
from benchmarks.peers.pinocchio_arm import build_model
from benchmarks.peers.problem import Problem

PEERS: dict[str, Callable[[Problem], Peer]] = {
    "crocoddyl, 1 iteration": lambda problem: BoxFddp(problem, max_iterations=1),
    "crocoddyl, 1 iteration, torque limits alone": lambda problem: BoxFddp(
        problem, max_iterations=1, limits=False
    ),
    "crocoddyl, converged": lambda problem: BoxFddp(problem, max_iterations=100),
    "ipopt": lambda problem: Ipopt(problem, soft_limits=False, tolerance=1e-6),
    "ipopt, soft limits": lambda problem: Ipopt(problem, soft_limits=True, tolerance=1e-8),
}


class Worker:
    """Holds one problem and the peers that have been asked about it."""

    def __init__(self) -> None:
        self._problem: Problem | None = None
        self._peers: dict[str, Peer] = {}

    def load(self, problem: dict[str, Any]) -> dict[str, Any]:
        """Take a problem; check that all peers solve the same one."""
        self._problem, self._peers = Problem.from_dict(problem), {}
        return {
            "dynamics_error": _dynamics_error(self._problem),
            "cost_error": _cost_error(self._problem),
        }

    def run(
        self,
        peer: str,
        q_target: list[float],
        q: list[list[float]],
        v: list[list[float]],
        fresh: bool,
    ) -> dict[str, Any]:
        """Let a peer answer some consecutive states.

        Args:
            peer: one of ``PEERS``.
            q_target: the target.
            q: positions, one row a control step.
            v: velocities, likewise.
            fresh: whether to forget what was solved before.
        """
        if peer not in self._peers:
            self._peers[peer] = PEERS[peer](self._problem)
        solver = self._peers[peer]
        if fresh:
            solver.reset(np.array(q_target))
        answers = [
            asdict(solver.step(np.array(position), np.array(velocity)))
            for position, velocity in zip(q, v, strict=True)
        ]
        return {
            name: [np.asarray(answer[name]).tolist() for answer in answers] for name in answers[0]
        }


def _dynamics_error(problem: Problem) -> float:
    """Return the largest difference of CasADi's and Pinocchio's torques, over random states."""
    model = build_model(problem)
    data, tau = model.createData(), inverse_dynamics(problem.arm)
    rng = np.random.default_rng(0)
    states = rng.uniform(-3, 3, (100, 3, model.nv))
    return max(
        float(np.abs(pin.rnea(model, data, *state) - tau(*state).full().ravel()).max())
        for state in states
    )


def _cost_error(problem: Problem) -> float:
    """Return how far apart, relatively, the peers' optimal costs are on a problem that all share.

    Crocoddyl's integrator is semi-implicit and its dynamics have no damping; given the same, IPOPT
    must find the same optimum.
    """
    n, dt = problem.arm.joints, problem.dt
    B = np.concatenate([-(dt**2) * np.eye(n), dt * np.eye(n)])
    A = np.block([[np.eye(n), -dt * np.eye(n)], [np.zeros((n, n)), np.eye(n)]])
    shared = replace(problem, A=A, B=B, damping=np.zeros(n), horizon=10)
    middle = problem.q_min / 2 + problem.q_max / 2
    centre = np.where(np.isfinite(middle), middle, 0.0)
    peers = (
        BoxFddp(shared, max_iterations=100, limits=False),
        Ipopt(shared, soft_limits=False, tolerance=1e-8),
    )
    costs = []
    for peer in peers:
        peer.reset(centre)
        costs.append(peer.step(centre + 0.02, np.zeros(n)).cost)
    return abs(costs[0] - costs[1]) / costs[1]


def main() -> None:
    """Answer requests until the input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what solvers print must not come between the answers
    worker = Worker()
    for line in sys.stdin:
        request = json.loads(line)
        do = {"load": worker.load, "run": worker.run}[request.pop("do")]
        answers.write(json.dumps(do(**request)) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
