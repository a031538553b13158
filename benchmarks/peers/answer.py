"""What a peer says about one control step, and the protocol that every peer follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from benchmarks.peers.problem import Array


@dataclass(frozen=True, eq=False)
class Answer:
    """One answer of a peer.

    Attributes:
        tau: torque to apply now, shape (n,) [N m].
        u: joint acceleration that goes with it, shape (n,) [rad/s^2].
        cost: optimal cost, as the peer counts it.
        step_time: wall time from a state to a torque, warm start included [s].
        solve_time: wall time of the solver's call alone [s].
        iterations: of the solver.
        converged: whether the solver says that it reached an optimum.
    """

    tau: Array
    u: Array
    cost: float
    step_time: float
    solve_time: float
    iterations: int
    converged: bool


class Peer(Protocol):
    """Solves the problem once a control step, starting from its previous solution."""

    def reset(self, q_target: Array) -> None:
        """Aim at a target; the next step has no previous solution."""

    def step(self, q: Array, v: Array) -> Answer:
        """Return the torque for a measured state."""
