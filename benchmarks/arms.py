"""From a robot and a controller's settings to the problem that the peers are given."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof import MpcSettings
from arm3dof.control.formulation import Weights, damping_share, discretise
from arm3dof.control.prediction import double_integrator
from arm3dof.model.robot import Robot
from arm3dof.state import Array
from benchmarks.peers.problem import Arm, Problem


def problem_of(robot: Robot, settings: MpcSettings) -> Problem:
    """Return the optimal control problem that the ``tracking`` formulation stands for.

    Args:
        robot: a robot of revolute joints, without Coulomb friction.
        settings: of its controller.
    """
    nv = robot.nv
    system = discretise(double_integrator(nv), settings)
    weights = Weights(settings, nv)
    return Problem(
        arm=arm_of(robot),
        horizon=settings.horizon,
        dt=settings.dt,
        A=system.A,
        B=system.B,
        Q=weights.Q,
        R=weights.R,
        P=weights.P,
        damping=robot.damping,
        damping_share=damping_share(robot, settings.dt),
        tau_max=robot.limits.tau_max,
        v_max=robot.limits.v_max,
        q_min=robot.limits.q_min,
        q_max=robot.limits.q_max,
        limit_price=settings.limit_weight * max(float(np.abs(weights.Q).max()), 1e-6),
    )


def arm_of(robot: Robot) -> Arm:
    """Return a robot's tree of joints and bodies as arrays."""
    model = robot.model
    joints = range(1, model.njoints)
    placements = [model.jointPlacements[i] for i in joints]
    bodies = [model.inertias[i] for i in joints]
    return Arm(
        parents=np.array([model.parents[i] - 1 for i in joints]),
        rotations=np.array([placement.rotation for placement in placements]),
        translations=np.array([placement.translation for placement in placements]),
        axes=np.array([_axis(model.joints[i]) for i in joints]),
        masses=np.array([body.mass for body in bodies]),
        centres=np.array([body.lever for body in bodies]),
        inertias=np.array([body.inertia for body in bodies]),
        gravity=robot.gravity_acceleration,
    )


def _axis(joint: pin.JointModel) -> Array:
    motion = np.ravel(joint.createData().S)
    if motion[:3].any():
        raise ValueError(f"{joint.shortname()} slides; the peers take arms of revolute joints")
    return motion[3:]
