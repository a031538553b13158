"""The torque that a motion takes at every stage of the horizon, and how it changes with the motion.

A stage holds its acceleration u for one sample. Its torque is evaluated in the middle of the
sample, where position, velocity and u belong together:

    tau = M(q) u + C(q, v) v + g(q) + D v_damped,

with v_damped the velocity where damping acts on average (``damping_share``).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof.control.formulation import damping_share
from arm3dof.model.robot import Robot
from arm3dof.state import Array


class HorizonTorque:
    """Inverse dynamics of all stages in one call, and their derivatives stage by stage.

    Attributes:
        damping: D of every stage, shape (N, nv) [N m s/rad].
    """

    def __init__(self, robot: Robot, dt: float, horizon: int) -> None:
        """Create the evaluator of a robot.

        Args:
            robot: the robot; after its masses have changed, call ``refresh``.
            dt: length of a sample [s].
            horizon: number of samples N.
        """
        # damping counts from the middle of the sample: D (v + (share - 1/2) dt u), and what it
        # takes in proportion to u is as if the joint had a rotor
        rotor = robot.damping * (damping_share(robot, dt) - 0.5) * dt
        self._pool = pin.ModelPool(robot.model, 1)
        self._model = self._pool.getModel(0)  # a copy, which the pool evaluates as it is
        self._robot, self._own = robot, self._model.inertias
        self._model.armature = robot.model.armature + rotor
        self._data = self._model.createData()
        self.damping = np.tile(robot.damping, (horizon, 1))  # as large as v: faster to multiply
        self._rigid = np.empty_like(self.damping)
        self._rigid_by_joint = self._rigid.T
        self._damping_slope = np.diag(robot.damping)

    def refresh(self) -> None:
        """Take over the robot's masses as they are now."""
        for joint, body in enumerate(self._robot.bodies, start=1):  # joint 0 is the world
            self._own[joint] = body

    def add(self, q: Array, v: Array, u: Array, out: Array, *, damping: bool = True) -> None:
        """Add the torques of all stages.

        Args:
            q: positions in the middle of the samples, shape (N, nv) [rad].
            v: velocities there, shape (N, nv) [rad/s].
            u: accelerations, shape (N, nv) [rad/s^2].
            out: what they are added to, shape (N, nv) [N m].
            damping: whether ``D v`` is to be added; if not, it is there already.
        """
        # one call, on this one thread
        pin.rneaInParallel(1, self._pool, q.T, v.T, u.T, self._rigid_by_joint)
        out += self._rigid
        if damping:
            out += self.damping * v

    def linearise(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return the torques of some stages, and how they change with the motion there.

        Args:
            q: positions in the middle of these samples, shape (k, nv) [rad].
            v: velocities there, shape (k, nv) [rad/s].
            u: accelerations, shape (k, nv) [rad/s^2].

        Returns:
            tau, shape (k, nv) [N m], and d tau / d [q, v, u] in the middle of each sample,
            shape (k, nv, 3, nv).
        """
        tau = np.empty_like(q)
        slopes = np.empty((len(q), 3, q.shape[1], q.shape[1]))
        model, data = self._model, self._data
        for k, at in enumerate(zip(q, v, u, strict=True)):
            slopes[k, 0], slopes[k, 1], slopes[k, 2] = pin.computeRNEADerivatives(model, data, *at)
            tau[k] = data.tau
        slopes[:, 1] += self._damping_slope
        tau += self.damping[0] * v
        return tau, slopes.swapaxes(1, 2)
