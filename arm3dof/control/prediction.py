"""From the arm's dynamics to a prediction over the horizon and its quadratic cost: (22)-(38).

The state is x = [e; v] with e = q_target - q, so that x = 0 at the target. Stage vectors are
stacked in time order: X = [x_0, ..., x_N], U = [u_0, ..., u_{N-1}].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from arm3dof.errors import InputError
from arm3dof.state import Array

_MOST_DOUBLINGS = 30
_VANISHED = 1e-10  # what the closed loop leaves of a state when the horizon counts as infinite
_WORST_CONDITION = 1e8  # of R, whose inverse the doubling begins with


class StateSpace(NamedTuple):
    """A linear system, either x' = A x + B u or x(k+1) = A x(k) + B u(k).

    Attributes:
        A: shape (nx, nx).
        B: shape (nx, nu).
    """

    A: Array
    B: Array


class Condensed(NamedTuple):
    """The whole prediction X = C x_0 + F U of (36).

    Attributes:
        C: shape ((N + 1) nx, nx).
        F: shape ((N + 1) nx, N nu).
    """

    C: Array
    F: Array


class QuadraticCost(NamedTuple):
    """The cost J = 1/2 x' Y x + x' M U + 1/2 U' H U of (38).

    Attributes:
        Y: shape (nx, nx).
        M: shape (nx, N nu).
        H: shape (N nu, N nu).
    """

    Y: Array
    M: Array
    H: Array


def error_dynamics(mass_matrix: Array, coriolis: Array) -> StateSpace:
    """Return the continuous error dynamics of (27): e' = -v, v' = -M^-1 C v + u.

    Args:
        mass_matrix: M(q), shape (nv, nv) [kg m^2].
        coriolis: C(q, v), shape (nv, nv) [kg m^2/s].
    """
    nv = mass_matrix.shape[0]
    A = np.zeros((2 * nv, 2 * nv))
    A[:nv, nv:] = -np.eye(nv)
    A[nv:, nv:] = -np.linalg.solve(mass_matrix, coriolis)
    B = np.zeros((2 * nv, nv))
    B[nv:] = np.eye(nv)
    return StateSpace(A, B)


def double_integrator(nv: int) -> StateSpace:
    """Return the error dynamics when u is the joint acceleration: e' = -v, v' = u."""
    return error_dynamics(np.eye(nv), np.zeros((nv, nv)))


def discretise_euler(system: StateSpace, dt: float) -> StateSpace:
    """Return A_d = T A + I and B_d = T B of (33), the forward Euler method.

    Args:
        system: continuous system.
        dt: sampling time T [s].
    """
    return StateSpace(np.eye(system.A.shape[0]) + dt * system.A, dt * system.B)


def discretise_exact(system: StateSpace, dt: float) -> StateSpace:
    """Return the exact discrete system for an input that is held over each sample.

    It is the matrix exponential of [[A, B], [0, 0]] dt (Van Loan 1978). For integrators, such as
    ``double_integrator``, its power series ends.

    Args:
        system: continuous system.
        dt: sampling time T [s].
    """
    nx, nu = system.B.shape
    block = np.zeros((nx + nu, nx + nu))
    block[:nx, :nx] = system.A * dt
    block[:nx, nx:] = system.B * dt
    square = block @ block / 2
    if (square @ block).any():
        from scipy.linalg import expm  # here, because SciPy takes as long to load as the rest

        exponential = expm(block)
    else:
        exponential = np.eye(nx + nu) + block + square
    return StateSpace(exponential[:nx, :nx], exponential[:nx, nx:])


def condense(system: StateSpace, horizon: int) -> Condensed:
    """Return the matrices C and F of (36) for a system that is the same at every stage.

    Args:
        system: discrete system.
        horizon: number of stages N.
    """
    A, B = system
    nx, nu = B.shape
    powers = np.empty((horizon + 1, nx, nx))
    powers[0] = np.eye(nx)
    for k in range(horizon):
        powers[k + 1] = A @ powers[k]
    responses = powers[:-1] @ B  # A^k B: the answer, k + 1 stages on, to an impulse
    F = np.zeros((horizon + 1, nx, horizon, nu))
    for stage in range(horizon):
        F[stage + 1 :, :, stage, :] = responses[: horizon - stage]
    return Condensed(powers.reshape(-1, nx), F.reshape((horizon + 1) * nx, horizon * nu))


def quadratic_cost(prediction: Condensed, Q: Array, R: Array, P: Array) -> QuadraticCost:
    """Return Y, M and H of (38) from the stage and terminal weights of (37).

    Args:
        prediction: the condensed prediction.
        Q: weight of the state at stages 0..N-1, shape (nx, nx).
        R: weight of the input, shape (nu, nu).
        P: weight of the state at stage N, shape (nx, nx).
    """
    C, F = prediction
    nx, nu = Q.shape[0], R.shape[0]
    weigh_C = _weigh(C, Q, P, nx)
    weigh_F = _weigh(F, Q, P, nx)
    H = F.T @ weigh_F
    for stage in range(F.shape[1] // nu):
        at = slice(stage * nu, (stage + 1) * nu)
        H[at, at] += R
    return QuadraticCost(2 * C.T @ weigh_C, 2 * C.T @ weigh_F, H + H.T)


def riccati(system: StateSpace, Q: Array, R: Array) -> Array:
    """Return the terminal weight P with which the horizon's end is worth an infinite one.

    Args:
        system: discrete system.
        Q: weight of the state, shape (nx, nx).
        R: weight of the input, shape (nu, nu).

    Raises:
        InputError: the discrete algebraic Riccati equation has no finite solution.
    """
    if (doubled := _riccati_by_doubling(system, Q, R)) is not None:
        return doubled
    from scipy.linalg import solve_discrete_are  # here for the same reason

    try:
        P = np.asarray(solve_discrete_are(system.A, system.B, Q, R))
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(
            "no terminal weight follows from these weights by the Riccati equation; "
            "give a positive input_weight and position weight, or give terminal_weight"
        ) from None
    return np.asarray((P + P.T) / 2)


@np.errstate(over="ignore", invalid="ignore")
def _riccati_by_doubling(system: StateSpace, Q: Array, R: Array) -> Array | None:
    """Return P by doubling the horizon over and over; ``None`` where that does not settle.

    It is the structure-preserving algorithm of Chu, Fan, Lin and Wang (2004): ``P`` is the cost
    over 2^k stages, ``A`` its closed loop over as many, which vanishes when P stabilises.
    """
    if np.linalg.cond(R) > _WORST_CONDITION:
        return None
    A, identity = system.A, np.eye(system.A.shape[0])
    G, P = system.B @ np.linalg.solve(R, system.B.T), Q
    for _ in range(_MOST_DOUBLINGS):
        through = np.linalg.solve(identity + G @ P, np.hstack([A, G]))
        onward, spread = through[:, : A.shape[0]], through[:, A.shape[0] :]
        G, more, A = G + A @ spread @ A.T, A.T @ P @ onward, A @ onward
        G, P = (G + G.T) / 2, P + (more + more.T) / 2
        if not all(np.isfinite(each).all() for each in (A, G, P)):
            return None
        if np.abs(A).max() < _VANISHED:
            return P
    return None


def weight_matrix(weight: ArrayLike, parts: int, nv: int, name: str) -> Array:
    """Expand a weight into a symmetric matrix of side ``parts * nv``.

    Args:
        weight: one number a part, one a component, or the whole matrix.
        parts: kinds of component: 2 for [e; v], 1 for u.
        nv: number of joints.
        name: what the message calls the weight.

    Raises:
        InputError: the weight has another shape, is not finite, or is not positive semidefinite.
    """
    array = np.atleast_1d(np.asarray(weight, dtype=float))
    size = parts * nv
    if array.shape == (parts,):
        array = np.repeat(array, nv)
    if array.shape == (size,):
        array = np.diag(array)
    if array.shape != (size, size):
        raise InputError(
            f"{name} has shape {array.shape}; give {parts} number(s), {size} numbers or a "
            f"({size}, {size}) matrix"
        )
    scale = np.abs(array).max()
    if not np.isfinite(scale) or np.abs(array - array.T).max() > 1e-9 * scale:
        raise InputError(f"{name} is not finite and symmetric; give a symmetric matrix")
    if np.linalg.eigvalsh(array).min() < -1e-9 * scale:
        raise InputError(f"{name} has a negative eigenvalue; give a positive semidefinite matrix")
    return array


def _weigh(columns: Array, Q: Array, P: Array, nx: int) -> Array:
    """Multiply a stack of stages by diag(Q, ..., Q, P)."""
    stages = columns.reshape(-1, nx, columns.shape[1])
    weighed = Q @ stages
    weighed[-1] = P @ stages[-1]
    return weighed.reshape(columns.shape)
