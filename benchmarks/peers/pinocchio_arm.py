"""The arm as a Pinocchio model, for Crocoddyl and to check the other dynamics against."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from benchmarks.peers.problem import Arm, Problem

_ALONG = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)


def build_model(problem: Problem) -> pin.Model:
    """Return a model with the problem's arm and its limits.

    A joint about a frame's own axis gets the joint type that Pinocchio computes fastest, as its
    URDF reader would choose it.
    """
    arm = problem.arm
    model = pin.Model()
    model.gravity.linear = arm.gravity
    for i in range(arm.joints):
        placement = pin.SE3(arm.rotations[i], arm.translations[i])
        index = model.addJoint(int(arm.parents[i]) + 1, _joint(arm, i), placement, f"joint{i + 1}")
        inertia = pin.Inertia(float(arm.masses[i]), arm.centres[i], arm.inertias[i])
        model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
    model.effortLimit = problem.tau_max
    model.velocityLimit = problem.v_max
    model.lowerPositionLimit = problem.q_min
    model.upperPositionLimit = problem.q_max
    return model


def _joint(arm: Arm, index: int) -> object:
    axis = arm.axes[index]
    for unit, joint in zip(np.eye(3), _ALONG, strict=True):
        if np.array_equal(axis, unit):
            return joint()
    return pin.JointModelRevoluteUnaligned(axis)
