"""Inverse dynamics in CasADi symbols: the wheel of Pinocchio comes without ``pinocchio.casadi``."""

from __future__ import annotations

import casadi as ca
import numpy as np

from benchmarks.peers.problem import Arm


def inverse_dynamics(arm: Arm) -> ca.Function:
    """Return tau(q, v, a) = M(q) a + C(q, v) v + g(q), by Newton and Euler's recursion.

    Angular quantities and the force at each joint's origin are held in that joint's frame.
    Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 5.

    Args:
        arm: the arm.
    """
    n = arm.joints
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    to_parent: list[ca.SX] = []
    spin, spin_rate, linear = [], [], []  # w, dw/dt, and acceleration of the origin less gravity
    force, moment = [], []
    for i in range(n):
        parent = int(arm.parents[i])
        still = ca.SX.zeros(3)
        w, dw = (spin[parent], spin_rate[parent]) if parent >= 0 else (still, still)
        base = ca.SX(ca.DM(-arm.gravity))
        origin = arm.translations[i]
        carried = (linear[parent] if parent >= 0 else base) + _swing(w, dw, origin)
        to_parent.append(_sparse(arm.rotations[i]) @ _turn(arm.axes[i], q[i]))
        back, axis = to_parent[i].T, ca.DM(arm.axes[i])
        w_in = back @ w
        spin.append(w_in + axis * v[i])
        spin_rate.append(back @ dw + axis * a[i] + ca.cross(w_in, axis * v[i]))
        linear.append(back @ carried)
        push = arm.masses[i] * (linear[i] + _swing(spin[i], spin_rate[i], arm.centres[i]))
        inertia = _sparse(arm.inertias[i])
        turn = inertia @ spin_rate[i] + ca.cross(spin[i], inertia @ spin[i])
        force.append(push)
        moment.append(turn + ca.cross(ca.DM(arm.centres[i]), push))
    tau = ca.SX.zeros(n)
    for i in reversed(range(n)):
        tau[i] = ca.dot(ca.DM(arm.axes[i]), moment[i])
        parent = int(arm.parents[i])
        if parent >= 0:
            handed = to_parent[i] @ force[i]
            force[parent] += handed
            moment[parent] += to_parent[i] @ moment[i]
            moment[parent] += ca.cross(ca.DM(arm.translations[i]), handed)
    return ca.Function("tau", [q, v, a], [tau], ["q", "v", "a"], ["tau"])


def _swing(w: ca.SX, dw: ca.SX, arm: np.ndarray) -> ca.SX:
    """Return the acceleration of a point of a body beyond that of the body's origin."""
    r = ca.DM(arm)
    return ca.cross(dw, r) + ca.cross(w, ca.cross(w, r))


def _turn(axis: np.ndarray, angle: ca.SX) -> ca.SX:
    """Return the rotation by an angle about a unit axis (Rodrigues)."""
    cross = _sparse(np.cross(np.eye(3), axis))
    around = _sparse(np.outer(axis, axis))
    return around + ca.cos(angle) * (ca.DM.eye(3) - around) + ca.sin(angle) * cross


def _sparse(matrix: np.ndarray) -> ca.DM:
    """Return a matrix without the round-off that would be carried as if it were structure."""
    return ca.sparsify(ca.DM(np.where(np.abs(matrix) < 1e-15, 0.0, matrix)))
