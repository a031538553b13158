"""Inverse kinematics of any robot: closed form where the paper's chain fits, else a search."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm3dof.errors import Problem
from arm3dof.model.dh import DhGeometry, fit_dh
from arm3dof.model.planar_ik import BRANCHES, singularities, solve_points, to_dh_frame
from arm3dof.model.reach import (
    POSITION_TOLERANCE,
    Reach,
    Reason,
    Singularity,
    joint_at_fault,
)
from arm3dof.model.robot import Limits, Robot
from arm3dof.model.turns import excess, into_limits
from arm3dof.model.workspace import nearest_configuration
from arm3dof.state import Array, finite_vector

__all__ = ["Reach", "Reason", "Singularity", "closed_form_reach", "inverse_kinematics"]


def inverse_kinematics(robot: Robot, p: ArrayLike, *, near: ArrayLike | None = None) -> Reach:
    """Return the joint positions that bring the robot's tool to a point.

    An arm that fits the paper's chain gets every solution, in closed form. Any other robot gets
    distinct postures found by a deterministic numerical search (see ``numeric_ik``), all inside
    the limits.

    Args:
        robot: the robot; its ``tool_frame`` is brought to the point, in any orientation.
        p: the point in the base frame, shape (3,) [m].
        near: configuration to stay near, shape (nv,) [rad]; it ranks the solutions, and picks the
            angle of joints that are free.

    Returns:
        Solutions, or the reason why there is none, the nearest reachable point and its distance.

    Raises:
        InputError: ``p`` or ``near`` has another shape, or is not finite.
    """
    target = finite_vector(p, 3, "p")
    reference = None if near is None else finite_vector(near, robot.nv, "near")
    geometry = _geometry(robot)
    if isinstance(geometry, Problem):
        from arm3dof.model.numeric_ik import search_reach  # scipy loads only where it is needed

        return search_reach(robot, target, reference)
    return closed_form_reach(geometry, robot.limits, robot.joint_names, target, reference)


_FITS: WeakKeyDictionary[Robot, DhGeometry | Problem] = WeakKeyDictionary()


def _geometry(robot: Robot) -> DhGeometry | Problem:
    """Return the paper's chain in a robot, fitted once: its kinematics never change."""
    found = _FITS.get(robot)
    if found is None:
        found = _FITS[robot] = fit_dh(robot)
    return found


def closed_form_reach(
    geometry: DhGeometry,
    limits: Limits,
    joint_names: tuple[str, ...],
    p: Array,
    near: Array | None = None,
) -> Reach:
    """Return all solutions of the paper's arm for one finite point.

    Args:
        geometry: the arm.
        limits: its joint limits.
        joint_names: names of its three joints.
        p: the point in the base frame, shape (3,) [m].
        near: configuration to stay near, shape (3,) [rad].
    """
    reference = np.zeros(3) if near is None else near
    points = solve_points(geometry, p[None])
    if not points.exists[0]:
        nearest_q = nearest_configuration(geometry, limits, p, reference)
        return Reach(
            target=p,
            solutions=np.empty((0, 3)),
            branches=(),
            within_limits=np.empty(0, dtype=np.bool_),
            reason=_too_far_or_near(geometry, p),
            nearest=geometry.tool_position(nearest_q),
            nearest_q=nearest_q,
        )
    special = singularities(geometry, p)
    branches, q = _distinct(points.q[0], special)
    free = [joint for joint, kind in enumerate(_FREE_JOINT_KINDS) if kind in special]
    q[:, free] = np.clip(reference, limits.q_min, limits.q_max)[free]
    q, within = _choose_turns(geometry, limits, q, reference)
    effort = np.zeros(len(q)) if near is None else np.linalg.norm(q - near, axis=1)
    order = np.lexsort((effort, ~within))
    reached = bool(within.any())
    fault = None
    if reached:
        nearest_q = q[order[0]]
    else:
        nearest_q = nearest_configuration(geometry, limits, p, reference)
        fault = joint_names[joint_at_fault(excess(q, limits.q_min, limits.q_max))]
    return Reach(
        target=p,
        solutions=q[order],
        branches=tuple(branches[row] for row in order),
        within_limits=within[order],
        reason=None if reached else Reason.OUTSIDE_LIMITS,
        nearest=p if reached else geometry.tool_position(nearest_q),
        nearest_q=nearest_q,
        joint=fault,
        singularities=special,
        free_joints=tuple(joint_names[joint] for joint in free),
    )


_FREE_JOINT_KINDS = (Singularity.BASE_FREE, Singularity.SHOULDER_FREE)
"""The singularity that frees the first joint, and the one that frees the second."""


def _distinct(q: Array, special: tuple[Singularity, ...]) -> tuple[list[str], Array]:
    """Return the branches that differ, with their names; ``q`` has shape (4, 3).

    Where the first joint is free, turning it by pi leads from the branches in front to those at
    the back. Where the elbow is straight or folded, up and down are the same.
    """
    names, rows = list(BRANCHES), [0, 1, 2, 3]
    for kind, elbow in (
        (Singularity.STRETCHED, "elbow-straight"),
        (Singularity.FOLDED, "elbow-folded"),
    ):
        if kind in special:
            rows = [0, 2]
            names = [name.replace("elbow-up", elbow) for name in names]
    if Singularity.BASE_FREE in special:
        rows = [row for row in rows if row < 2]
    return [names[row] for row in rows], q[rows]


def _choose_turns(
    geometry: DhGeometry, limits: Limits, q: Array, reference: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Choose the turn of every joint, and return which solutions are inside the limits.

    A solution outside by rounding is put on the limit: near a singularity rounding can be large,
    so what decides is how far that moves the tool.
    """
    q = into_limits(q, limits.q_min, limits.q_max, reference)
    clipped = np.clip(q, limits.q_min, limits.q_max)
    if np.array_equal(clipped, q):
        return q, np.ones(len(q), dtype=np.bool_)
    put, meant = geometry.tool_position(np.stack([clipped, q]))
    within = np.linalg.norm(put - meant, axis=1) <= POSITION_TOLERANCE
    return np.where(within[:, None], clipped, q), within


def _too_far_or_near(geometry: DhGeometry, p: Array) -> Reason:
    """Return why the arm's lengths do not reach a point."""
    distance = math.hypot(*to_dh_frame(geometry, p))
    return Reason.TOO_FAR if distance > max(geometry.a2, geometry.a3) else Reason.TOO_NEAR
