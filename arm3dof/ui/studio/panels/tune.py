"""Tune: the controller and the arm itself, with what differs from the defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from nicegui import run, ui

from arm3dof.control.tuning import Gains, tune_gains
from arm3dof.errors import ArmError
from arm3dof.model.servos import SERVOS
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.ui.studio.fields import (
    CONTROL_FIELDS,
    CONTROLLER_NAMES,
    FORMULATIONS,
    Field,
    arm_values,
    control_values,
    part_fields,
    parts_of,
    with_value,
)
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading, slider


class Tune:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab, self._studio = tab, tab.studio
        self._shown: Tuned | None = None
        self._quiet = True
        self._sliders: dict[str, ui.slider] = {}
        self._wanted: tuple[Mapping[str, float], str] | None = None
        self._building = False
        heading("Controller")
        with ui.element("div").classes("line"):
            self._controller = self._select(CONTROLLER_NAMES, "Controller", self._choose)
            self._controller.tooltip("MPC, or a controller to measure it against")
            self._formulation = self._select(FORMULATIONS, "Formulation", self._formulate)
            self._formulation.tooltip("What the MPC decides: accelerations, torques, or as printed")
        self._numbers = {
            field.key: slider(field, field.low, partial(self._set, field))
            for field in CONTROL_FIELDS
        }
        declared = ui.switch("Tell the controller of the delay")
        declared.on_value_change(self._declare)
        declared.tooltip("Whether the MPC predicts the state over the motors' delay")
        self._declared = declared
        heading("Arm")
        with ui.element("div").classes("line"):
            self._part = self._select(parts_of(self._studio.robot), "Part", self._show_part)
            self._part.tooltip("The link or joint whose numbers are shown below")
            servos = {"": "as in the URDF", **{name: name for name in SERVOS}}
            self._servo = self._select(servos, "Servos", self._drive)
            self._servo.tooltip("The servo in every joint, whose torque and speed are the limits")
        self._parts = ui.element("div")
        heading("What changed")
        self._changes = ui.element("ul").classes("changes")
        with ui.element("div").classes("line"):
            button("Defaults", "restart_alt", "Take back every change", self._reset)
        self.refresh()

    def refresh(self) -> None:
        """Show what is tuned now, whoever changed it."""
        studio = self._studio
        now = studio.tuned
        if now is self._shown:
            return
        self._shown = now
        self._quiet = True
        control = studio.tuned.control
        self._controller.set_value(control.controller)
        self._formulation.set_value(control.settings().formulation)
        values = control_values(control)
        for key, made in self._numbers.items():
            made.set_value(values[key])
        self._declared.set_value(bool(control.mpc.get("delay")))
        self._servo.set_value(studio.tuned.servo)
        if self._part.value is None:
            self._part.set_value(next(iter(parts_of(studio.robot))))
            self._show_part()
        values = arm_values(studio.robot)
        for key, made in self._sliders.items():
            made.set_value(values[key])
        self._list_changes()
        self._quiet = False

    # ---- the controller ------------------------------------------------------------------------

    def _select(self, options: dict[str, str], label: str, act: Callable[[], Any]) -> ui.select:
        made = ui.select(options, label=label).props("dense outlined options-dense")
        made.classes("short")
        made.on_value_change(lambda: None if self._quiet else act())
        return made

    async def _choose(self) -> None:
        name = self._controller.value
        await self._apply(name, dict(self._studio.tuned.control.mpc))

    async def _apply(self, name: cmd.ControllerName, mpc: dict[str, Any]) -> None:
        """Choose a controller; the gains of PD and PID are found in another process first."""
        gains = None
        if name in ("pd", "pd-gravity", "pid"):
            note = ui.notification("Finding gains …", spinner=True, timeout=None)
            dt = cmd.Control(mpc=mpc).settings().dt
            packed = PackedRobot.of(self._studio.robot)
            gains = await run.cpu_bound(_tune, packed, name, dt)
            note.dismiss()
        self._send(lambda: cmd.Control(name, mpc, self._studio.tuned.control.delay, gains))

    def _send(self, make: Callable[[], cmd.Control]) -> None:
        if not self._tab.ask(make):
            self._shown = None  # show again what is in force

    def _formulate(self) -> None:
        mpc = {**self._studio.tuned.control.mpc, "formulation": self._formulation.value}
        self._send(lambda: self._with(mpc=mpc))

    def _set(self, field: Field, value: float) -> None:
        self._send(lambda: with_value(self._studio.tuned.control, field.key, value))

    def _declare(self) -> None:
        if self._quiet:
            return
        control = self._studio.tuned.control
        mpc = {**control.mpc, "delay": control.delay if self._declared.value else 0.0}
        self._send(lambda: self._with(mpc=mpc))

    def _with(self, **changes: Any) -> cmd.Control:
        control = self._studio.tuned.control
        values = {"mpc": control.mpc, "delay": control.delay, "gains": control.gains, **changes}
        return cmd.Control(control.controller, **values)

    # ---- the arm -------------------------------------------------------------------------------

    def _show_part(self) -> None:
        self._parts.clear()
        with self._parts:
            self._sliders = {
                field.key: slider(field, value, partial(self._override, field))
                for field, value in part_fields(self._studio.robot, str(self._part.value))
            }

    async def _override(self, field: Field, value: float) -> None:
        overrides = self._wanted[0] if self._wanted else self._studio.tuned.overrides
        await self._rebuild({**overrides, field.key: value}, self._studio.tuned.servo)

    async def _drive(self) -> None:
        await self._rebuild(self._studio.tuned.overrides, str(self._servo.value or ""))

    async def _rebuild(self, overrides: Mapping[str, float], servo: str) -> None:
        if not self._tab.attempt(lambda: None):
            self._shown = None
            return
        self._wanted = (overrides, servo)
        if self._building:  # whoever builds will see to it
            return
        self._building = True
        try:
            while self._wanted is not None:
                wanted, self._wanted = self._wanted, None
                await run.io_bound(self._studio.rebuild, *wanted)
        except ArmError as error:
            ui.notify(str(error), type="negative", multi_line=True, close_button="Close")
            self._shown = None
        finally:
            self._building = False

    # ---- what changed --------------------------------------------------------------------------

    def _list_changes(self) -> None:
        self._changes.clear()
        with self._changes:
            changes = self._studio.changes()
            if not changes:
                with ui.element("li"):
                    ui.label("Nothing: all is as it comes.")
            for text in changes:
                with ui.element("li"):
                    ui.label(text)

    async def _reset(self) -> None:
        if self._tab.ask(cmd.Control):
            await self._rebuild({}, "")


def _tune(packed: PackedRobot, name: str, dt: float) -> Gains:
    robot = packed.unpack()
    return tune_gains(robot, dt, carries_weight=name == "pd-gravity", integrates=name == "pid")
