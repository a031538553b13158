"""Those who are timed: each answers the states of a motion one by one and says how long it took."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from proxsuite import proxqp

from arm3dof import MpcController, MpcSettings
from arm3dof.control.optimum import Optimum
from arm3dof.control.qp import QuadraticProgram
from arm3dof.model.robot import Robot
from arm3dof.state import Array
from benchmarks.motions import Motion
from benchmarks.peers.process import PeerProcess


class Contestant(Protocol):
    """Answers a motion's states in order."""

    def times(self, motion: int) -> Array:
        """Return the time of each answer to one of the motions [s]; the first starts cold."""


class Ours:
    """A whole ``MpcController.step``: state in, torque out."""

    def __init__(self, robot: Robot, settings: MpcSettings, motions: Sequence[Motion]) -> None:
        self._controller = MpcController(robot, settings)
        self._motions = [(motion.states, motion.q_target) for motion in motions]

    def times(self, motion: int) -> Array:
        """Return the time of each step [s]."""
        states, target = self._motions[motion]
        controller, clock = self._controller, time.perf_counter
        times = np.empty(len(states))
        controller.reset()
        for i, state in enumerate(states):
            start = clock()
            controller.step(state, target)
            times[i] = clock() - start
        return times


class BareProxqp:
    """ProxQP alone, on the QPs that the controller's steps come down to.

    They have every limit as a row. One object is updated in place and solved to the controller's
    tolerance, with the backend and the start that were found fastest on these QPs among all that
    solved them.
    """

    def __init__(self, robot: Robot, settings: MpcSettings, motions: Sequence[Motion]) -> None:
        self._tolerance = settings.tolerance
        self._programs: list[list[QuadraticProgram]] = []
        controller = MpcController(robot, settings)
        for motion in motions:
            programs = []
            for state in motion.states:
                programs.append(_feasible(controller.optimise(state, motion.q_target)))
            self._programs.append(programs)

    @property
    def sizes(self) -> tuple[float, float]:
        """Mean numbers of variables and of rows."""
        programs = [program for programs in self._programs for program in programs]
        n, m = np.mean([(p.g.size, p.lower.size) for p in programs], axis=0)
        return float(n), float(m)

    def times(self, motion: int) -> Array:
        """Return the time of each update and solve [s]."""
        programs, clock = self._programs[motion], time.perf_counter
        solvers: dict[tuple[int, int], proxqp.dense.QP] = {}
        times = np.empty(len(programs))
        previous: QuadraticProgram | None = None
        for i, program in enumerate(programs):
            size = (program.g.size, program.lower.size)
            fresh = size not in solvers
            if fresh:
                solvers[size] = self._solver(*size)
            solver = solvers[size]
            same = previous is not None and np.array_equal(previous.H, program.H)
            start = clock()
            if fresh:
                solver.init(
                    program.H, program.g, None, None, program.C, program.lower, program.upper
                )
            elif same:
                solver.update(g=program.g, C=program.C, l=program.lower, u=program.upper)
            else:
                solver.update(
                    H=program.H, g=program.g, C=program.C, l=program.lower, u=program.upper
                )
            solver.solve()
            times[i] = clock() - start
            previous = program
        return times

    def _solver(self, n: int, m: int) -> proxqp.dense.QP:
        dense = proxqp.dense
        backend = dense.DenseBackend.PrimalDualLDLT
        solver = dense.QP(n, 0, m, False, dense.HessianType.Dense, backend)
        solver.settings.eps_abs = self._tolerance
        solver.settings.eps_rel = 0.0
        solver.settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
        return solver


def _feasible(optimum: Optimum) -> QuadraticProgram:
    """Return an optimum's QP with all limits; those that cannot be kept give way to the optimum."""
    program = optimum.quadratic_program()
    reached = program.C @ optimum.w
    return program._replace(
        lower=np.minimum(program.lower, reached), upper=np.maximum(program.upper, reached)
    )


class PeerContestant:
    """A peer in its own process: the time of its solver's call alone, without our pipe.

    What a user of the peer does around that call (shifting the previous solution, copying the
    answer) is left out, in the peer's favour; ``step_times`` has it.
    """

    def __init__(self, process: PeerProcess, peer: str, motions: Sequence[Motion]) -> None:
        self._process, self._peer, self._motions = process, peer, motions
        self._step_times: list[Array] = []
        self._converged: list[Array] = []

    def times(self, motion: int) -> Array:
        """Return the time of each call of the solver [s]."""
        asked = self._motions[motion]
        answers = self._process.run(self._peer, asked.q_target, asked.q, asked.v)
        self._step_times.append(answers["step_time"][1:])
        self._converged.append(answers["converged"][1:])
        return answers["solve_time"]

    def facts(self) -> dict[str, float]:
        """Return the median time of a whole step around the call, and the share that converged."""
        return {
            "step_p50_us": round(1e6 * float(np.median(self._step_times)), 1),
            "converged": round(float(np.mean(self._converged)), 4),
        }
