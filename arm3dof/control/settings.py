"""What a user can choose about the model predictive controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.control.qp import QpSettings
from arm3dof.errors import InputError

Formulation = Literal["tracking", "torque", "paper"]
Discretisation = Literal["euler", "exact"]


@dataclass(frozen=True)
class MpcSettings:
    """Settings of ``MpcController``.

    The state is x = [e; v]: e = q_target - q in rad, v in rad/s; the input u is a joint
    acceleration in rad/s^2, so one choice of weights suits light and heavy arms alike. A ratio
    ``position weight / input_weight`` = w^4 makes each joint behave like a servo of about w rad/s
    with a damping ratio of 0.71: the default, w = 10, settles in roughly 0.8 s. A larger
    velocity weight slows the arm and damps it; a larger input weight saves energy and lets the
    error live longer.

    Attributes:
        formulation: ``"tracking"``: decide accelerations, with torques exact up to tangents;
            ``"torque"``: decide torques, on dynamics linearised along the last plan; ``"paper"``:
            the error dynamics frozen at the measured state, (22)-(38).
        horizon: number of stages N.
        dt: sampling time T [s]; the controller is called once every ``dt``.
        state_weight: Q: two numbers (position [1/rad^2], velocity [s^2/rad^2]), one number a
            component of x, or the (2 nv, 2 nv) matrix.
        input_weight: R: one number, one a joint, or the (nv, nv) matrix [s^4/rad^2].
        terminal_weight: P, given like ``state_weight``; ``None`` takes the solution of the
            Riccati equation, with which the end of the horizon costs what an endless one would.
        discretisation: ``"euler"`` is (30)-(33), ``"exact"`` holds u over each sample; ``None``
            takes the paper's for ``"paper"`` and the exact one otherwise.
        blocks: move blocking: how many stages share their decisions, in order of time, adding up
            to ``horizon``; ``None`` decides for every stage.
        torque_rate: largest change of torque, one number or one a joint [N m/s], counted at first
            from the torque that holds the arm; ``None``: any. A fallback may exceed it.
        observer_gain: share of an unexplained torque that is taken for a disturbance in each
            step, from 0 (no observer) to 1; less is taken under noise. ``None`` is 0 for
            ``"paper"`` and 0.75 otherwise.
        measurement_noise: standard deviation of measured positions [rad], against which the state
            is filtered; ``None`` learns it from the measurements (``"paper"``: takes 0), 0
            believes every measurement.
        delay: time from a measurement to when the torque computed from it acts [s]; the state is
            predicted over it.
        limit_weight: price of leaving a velocity or joint limit, in multiples of the largest
            state weight [1/rad, s/rad]; large enough that a limit is only ever left when the
            torque cannot prevent it.
        max_iterations: iteration cap of one solve.
        tolerance: largest residual of a solved problem.
        max_step_time: a step that takes longer begins no further solve, and answers with the
            previous plan [s]; ``None`` sets no deadline, only a bound on the work.
        plan_validity: how long the previous plan may stand in for a missing optimum [s]; after
            it the arm brakes.

    Raises:
        InputError: a value is outside its domain.
    """

    formulation: Formulation = "tracking"
    horizon: int = 20
    dt: float = 0.05
    state_weight: ArrayLike = (1.0, 0.0)
    input_weight: ArrayLike = 1e-4
    terminal_weight: ArrayLike | None = None
    discretisation: Discretisation | None = None
    blocks: tuple[int, ...] | None = None
    torque_rate: ArrayLike | None = None
    observer_gain: float | None = None
    measurement_noise: float | None = None
    delay: float = 0.0
    limit_weight: float = 1000.0
    max_iterations: int = 20
    tolerance: float = 1e-8
    max_step_time: float | None = None
    plan_validity: float = 0.25

    def __post_init__(self) -> None:
        _one_of("formulation", self.formulation, get_args(Formulation))
        if self.discretisation is None:
            exact: Discretisation = "euler" if self.formulation == "paper" else "exact"
            object.__setattr__(self, "discretisation", exact)
        _one_of("discretisation", str(self.discretisation), get_args(Discretisation))
        if not (isinstance(self.horizon, int) and 1 <= self.horizon <= 500):
            raise InputError(f"horizon is {self.horizon!r}; give a whole number from 1 to 500")
        if self.blocks is not None and (
            any(size < 1 for size in self.blocks) or sum(self.blocks) != self.horizon
        ):
            raise InputError(
                f"blocks is {self.blocks}; give numbers of stages, 1 or more each, that add up to "
                f"the horizon, {self.horizon}"
            )
        if self.observer_gain is None:
            object.__setattr__(self, "observer_gain", 0.0 if self.formulation == "paper" else 0.75)
        if not 0 <= self.gain <= 1:
            raise InputError(f"observer_gain is {self.observer_gain!r}; give a number from 0 to 1")
        for name in ("dt", "limit_weight"):
            _positive(name, getattr(self, name))
        for name in ("delay", "plan_validity"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"{name} is {value!r}; give 0 or more seconds")
        if self.measurement_noise is None and self.formulation == "paper":
            object.__setattr__(self, "measurement_noise", 0.0)
        if self.measurement_noise is not None and not 0 <= self.measurement_noise < np.inf:
            raise InputError(
                f"measurement_noise is {self.measurement_noise!r}; give 0 or more radians, or None"
            )
        if self.max_step_time is not None:
            _positive("max_step_time", self.max_step_time)
        QpSettings(tolerance=self.tolerance, max_iterations=self.max_iterations)

    @property
    def gain(self) -> float:
        """The observer's gain as a number."""
        return float(self.observer_gain or 0.0)

    @staticmethod
    def tuned(settling_time: float, **settings: Any) -> MpcSettings:
        """Return settings with which a joint reaches its target in a given time.

        With weights 1 and r the unconstrained optimum moves each joint like a second-order system
        of w = r^(-1/4) rad/s and damping ratio 0.71, which is within 1 % after 6.5 / w; so
        r = (settling_time / 6.5)^4. The sampling time becomes a twentieth of the settling time,
        within 5 to 50 ms, and the horizon covers it. Torque and velocity limits make it longer.

        Args:
            settling_time: time from start to within 1 % of the way [s].
            settings: any other setting, by name.

        Raises:
            InputError: the settling time is not positive, or a setting is outside its domain.
        """
        _positive("settling_time", settling_time)
        dt = min(max(settling_time / 20, 0.005), 0.05)
        chosen: dict[str, Any] = {
            "dt": dt,
            "horizon": min(max(round(settling_time / dt), 10), 40),
            "input_weight": (settling_time / 6.5) ** 4,
        }
        return MpcSettings(**{**chosen, **settings})

    @property
    def qp_settings(self) -> QpSettings:
        """Tolerance and iteration cap as the QP solver takes them."""
        return QpSettings(tolerance=self.tolerance, max_iterations=self.max_iterations)


def _positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value!r}; give a positive number")


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} is {value!r}; give one of: {', '.join(known)}")
