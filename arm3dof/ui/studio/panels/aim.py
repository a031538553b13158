"""Aim: choose where the arm is to go, and learn at once whether it gets there."""

from __future__ import annotations

from functools import partial

import numpy as np
from nicegui import ui

from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.reach import Reach
from arm3dof.runtime.live import commands as cmd
from arm3dof.state import Array
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import Field, button, heading, slider


def build(tab: Tab) -> None:
    """Build the panel for a tab."""
    _Aim(tab)


class _Aim:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self._robot = tab.studio.robot
        heading("A point")
        with ui.element("div").classes("line"):
            self._xyz = [
                ui.number(f"{axis} [cm]", value=value, step=1.0, format="%.1f")
                .props("dense outlined")
                .classes("short")
                .tooltip(f"{axis} of the point in the base frame [cm]")
                for axis, value in zip("xyz", (16.0, -3.0, -9.0), strict=True)
            ]
        button("Aim there", "my_location", "Ask which joint angles reach the point", self._aim)
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

    def _aim(self) -> None:
        point = [0.01 * float(box.value or 0.0) for box in self._xyz]
        frame = self._tab.studio.arm.ring.latest()
        near = None if frame is None else np.array(frame["q"])
        reach = inverse_kinematics(self._robot.clone(), point, near=near)
        self._show(reach)
        if reach.best is not None:
            self._choose(reach.best)

    def _choose(self, q: Array) -> None:
        if self._tab.ask(lambda: cmd.Aim(tuple(q.tolist()))):
            for joint, value in zip(self._joints, np.rad2deg(q), strict=True):
                joint.set_value(round(float(value), 1))

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
                angles = ", ".join(f"{angle:.1f}" for angle in np.rad2deg(q))
                inside = bool(reach.within_limits[k])
                text = f"{reach.branches[k]}: {angles}°" + ("" if inside else " (outside)")
                made = button(
                    text,
                    "check" if k == 0 and inside else "",
                    "Take this posture",
                    partial(self._choose, q),
                )
                made.props("flat align=left")
                made.set_enabled(inside)
