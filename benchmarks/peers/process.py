"""Our side of the pipe to the peers: this module runs in arm3dof's own environment."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from arm3dof.closing import Closing
from benchmarks.peers.problem import Array, Problem

ROOT = Path(__file__).resolve().parents[2]
PYTHON = ROOT / ".venv-peers" / "bin" / "python"
_SAME_TORQUE = 1e-10  # [N m]
_SAME_COST = 1e-8


class PeerProcess(Closing):
    """A process that solves a problem with the peers while ours waits."""

    def __init__(self) -> None:
        """Start the process.

        Raises:
            FileNotFoundError: the peers are not installed.
        """
        if not PYTHON.exists():
            raise FileNotFoundError(
                f"{PYTHON} is missing; install the peers: python3 benchmarks/peers/install.py"
            )
        self._process = subprocess.Popen(
            [PYTHON, "-m", "benchmarks.peers.worker"],
            cwd=ROOT,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def load(self, problem: Problem) -> dict[str, float]:
        """Set the problem; return how far the peers disagree: torque [N m], cost (relative).

        Raises:
            RuntimeError: they do not solve the same problem.
        """
        apart: dict[str, float] = self._ask(do="load", problem=problem.to_dict())
        if not (apart["dynamics_error"] < _SAME_TORQUE and apart["cost_error"] < _SAME_COST):
            raise RuntimeError(f"the peers do not solve the same problem: {apart}")
        return apart

    def run(
        self, peer: str, q_target: Array, q: Array, v: Array, *, fresh: bool = True
    ) -> dict[str, Array]:
        """Let a peer answer consecutive states; return one array a field of ``Answer``.

        Args:
            peer: one of ``worker.PEERS``.
            q_target: target, shape (n,) [rad].
            q: positions, shape (k, n) [rad].
            v: velocities, shape (k, n) [rad/s].
            fresh: whether the first state starts without a previous solution.
        """
        values = self._ask(
            do="run",
            peer=peer,
            q_target=q_target.tolist(),
            q=q.tolist(),
            v=v.tolist(),
            fresh=fresh,
        )
        return {name: np.array(value) for name, value in values.items()}

    def _ask(self, **request: Any) -> dict[str, Any]:
        into, out = self._process.stdin, self._process.stdout
        if into is None or out is None:
            raise RuntimeError("the peers' process has no pipes")
        into.write(json.dumps(request) + "\n")
        into.flush()
        line = out.readline()
        if not line:
            raise RuntimeError(f"the peers' process ended with code {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer
