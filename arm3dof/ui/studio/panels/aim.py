"""Aim: choose where the arm is to go, and learn at once whether it gets there."""

from __future__ import annotations

from functools import partial

import numpy as np
from nicegui import ui

from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.reach import Reach
from arm3dof.runtime.live import commands as cmd
from arm3dof.state import Array
from arm3dof.ui.studio.fields import Field
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading, slider


class Aim:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab = tab
        self._robot = tab.studio.robot
        self._shown: Array = np.full(self._robot.nv, np.nan)
        heading("A point")
        with ui.element("div").classes("line"):
            self._xyz = [
                ui.number(f"{axis} [cm]", value=value, step=1.0, format="%.1f")
                .props("dense outlined")
                .classes("short")
                .tooltip(f"{axis} of the point in the base frame [cm]")
                for axis, value in zip("xyz", (16.0, -3.0, -9.0), strict=True)
            ]
        button(
            "Aim there",
            "my_location",
            "Ask which joint angles reach the point",
            self._aim,
            color="primary",
        )
        self._answer = ui.label("").classes("answer").props('role="status"')
        self._branches = ui.element("div").classes("branches")
        heading("Joints")
        limits = self._robot.limits
        self._joints = [
            slider(
                Field(
                    name,
                    name,
                    "°",
                    float(np.rad2deg(limits.q_min[k])),
                    float(np.rad2deg(limits.q_max[k])),
                    0.5,
                    "Target angle of this joint",
                ),
                0.0,
                lambda _: self._aim_joints(),
            )
            for k, name in enumerate(self._robot.joint_names)
        ]
        heading("Reach")
        ui.switch(
            "Show the reachable region", on_change=lambda e: tab.studio.show_region(e.value)
        ).tooltip("Draw where the tool can be inside the joint limits in the 3-D view")

    def refresh(self) -> None:
        """Show where the arm is to go, whoever chose it."""
        frame = self._tab.studio.arm.ring.latest()
        if frame is None or np.array_equal(frame["q_target"], self._shown):
            return
        self._shown = np.array(frame["q_target"])
        for joint, value in zip(self._joints, np.rad2deg(self._shown), strict=True):
            joint.set_value(round(float(value), 1))

    def at(self, point: Array) -> None:
        """Aim at a point of the base frame, shape (3,) [m]."""
        for box, value in zip(self._xyz, 100 * point, strict=True):
            box.set_value(round(float(value), 2))
        self._reach(point)

    def _aim(self) -> None:
        self._reach(np.array([0.01 * float(box.value or 0.0) for box in self._xyz]))

    def _reach(self, point: Array) -> None:
        frame = self._tab.studio.arm.ring.latest()
        near = None if frame is None else np.array(frame["q"])
        reach = inverse_kinematics(self._robot.clone(), point, near=near)
        self._show(reach)
        if reach.best is not None:
            self._choose(reach.best)

    def _choose(self, q: Array) -> None:
        self._tab.ask(lambda: cmd.Aim(tuple(q.tolist())))

    def _aim_joints(self) -> None:
        q = np.deg2rad([float(joint.value) for joint in self._joints])
        self._tab.ask(lambda: cmd.Aim(tuple(q.tolist())))

    def _show(self, reach: Reach) -> None:
        self._answer.set_text(reach.sentence[0].upper() + reach.sentence[1:])
        self._answer.classes(
            add="good" if reach.reachable else "warn", remove="warn" if reach.reachable else "good"
        )
        self._branches.clear()
        with self._branches:
            for k, q in enumerate(reach.solutions):
                angles = ", ".join(f"{angle:.0f}" for angle in np.rad2deg(q))
                inside = bool(reach.within_limits[k])
                where = reach.branches[k].replace("/", ", ").replace("-", " ")
                text = f"{where}: {angles}°" + ("" if inside else ", outside")
                made = button(
                    text,
                    "check" if k == 0 and inside else "remove",
                    "Take this posture",
                    partial(self._choose, q),
                )
                made.props("flat align=left").classes(remove="plain")
                made.set_enabled(inside)
