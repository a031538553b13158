"""See: what the eye looks for, in six bounds a colour, and how bright it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, get_args

from nicegui import events, ui

from arm3dof.runtime.live.eye import Learned, Pick, Watch
from arm3dof.ui.studio.fields import Field
from arm3dof.ui.studio.tab import Tab
from arm3dof.ui.studio.widgets import button, heading, slider
from arm3dof.vision.colour import ColourTarget, HsvRange, Shape

_LIGHT = Field("light", "Light", "×", 0.3, 2.0, 0.05, "Brightness of the simulated lamp; 1 is day")
_WIDTH = Field(
    "width", "Width", "cm", 0.5, 10.0, 0.1, "True width of the object, from which its depth follows"
)
_SHAPES: tuple[Shape, ...] = get_args(Shape)
_WRAP = 180  # OpenCV's hues go round: -8 is 172
_CHANNELS = (
    ("Hue", -60, 179, "Hue, in half degrees; below 0 it goes round through red"),
    ("Saturation", 0, 255, "Saturation: 0 is grey, 255 is vivid"),
    ("Value", 0, 255, "Value: 0 is black, 255 is bright"),
)


class See:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        """Build it.

        Args:
            tab: the tab.
        """
        self._tab, self._studio = tab, tab.studio
        self._shown: Watch | None = None
        self._learned = self._studio.learned
        heading("What to look for")
        with ui.element("div").classes("line"):
            self._which = ui.toggle([], on_change=self._choose).props("dense no-caps unelevated")
            self._which.tooltip("The kind of object whose bounds are shown below")
        ui.label("Click an object in the picture to learn its colour.").classes("note")
        self._ranges = [self._range(*channel) for channel in _CHANNELS]
        self._width = slider(_WIDTH, 3.0, lambda _: self._change())
        with ui.element("div").classes("line"):
            self._shape = ui.select(list(_SHAPES), value=_SHAPES[0], label="Shape")
            self._shape.on_value_change(self._user(self._change))
            self._shape.props("dense outlined").classes("short")
            self._shape.tooltip("How the object's outline is measured")
            self._name = ui.input("Name").props("dense outlined").classes("short")
            self._name.tooltip("What the object is called in the camera's file")
        with ui.element("div").classes("line"):
            button("Add", "add", "Add a kind of object with this name and bounds", self._add)
            button("Remove", "remove", "Look for this kind no longer", self._remove)
            button("Save", "save", "Write all kinds to a CAMERA.toml in the folder", self._save)
            button("Load", "folder_open", "Read the kinds of the folder's CAMERA.toml", self._load)
        mask = ui.switch("Show the mask", value=bool(self._studio.watch.shown))
        mask.on_value_change(self._user(lambda: self._mask(bool(mask.value))))
        mask.tooltip("Show beside the picture which pixels lie inside the bounds")
        self._masked = mask
        ui.html(
            '<canvas id="mask" width="640" height="480" role="img" hidden '
            'aria-label="Pixels inside the chosen colour bounds"></canvas>',
            sanitize=False,
        )
        heading("Light")
        self._light = slider(_LIGHT, 1.0, self._dim)
        self._quiet = False
        self.refresh()

    def refresh(self) -> None:
        """Show what the eye looks for now, whoever changed it."""
        watch, learned = self._studio.watch, self._studio.learned
        if learned is not None and learned is not self._learned:
            self._learned = learned
            if learned.pick.tab == self._tab.id:
                self._take(learned)
        if watch is self._shown:
            return
        self._shown = watch
        self._quiet = True
        names = [target.name for target in watch.targets]
        self._which.set_options(names, value=self._kind.name if self._kind else None)
        self._masked.set_value(bool(watch.shown))
        self._light.set_value(watch.light)
        if (kind := self._kind) is not None:
            low, high = kind.hsv.low, kind.hsv.high
            first = low[0] - _WRAP if kind.hsv.wraps else low[0]
            for made, least, most in zip(
                self._ranges, (first, *low[1:]), (high[0], *high[1:]), strict=True
            ):
                made.set_value({"min": least, "max": most})
            self._width.set_value(round(100 * kind.width_m, 2))
            self._shape.set_value(kind.shape)
            self._name.set_value(kind.name)
        self._quiet = False

    def pick(self, u: int, v: int) -> None:
        """Learn the colour at a pixel of the picture."""
        self._tab.attempt(lambda: self._studio.pick(Pick(u, v, self._tab.id)))

    # ---- what a person does --------------------------------------------------------------------

    @property
    def _kind(self) -> ColourTarget | None:
        watch = self._studio.watch
        wanted = self._studio.chosen
        return next((it for it in watch.targets if it.name == wanted), None)

    def _range(self, name: str, low: int, high: int, tip: str) -> ui.range:
        with ui.element("label").classes("field"):
            ui.tooltip(tip)
            ui.html(f"<span>{name}</span>", sanitize=False)
            made = ui.range(min=low, max=high, step=1, value={"min": low, "max": high})
            made.props(f'aria-label="{name}"').classes(f"range-{name.lower()}")
            text = ui.label().classes("value")
            text.bind_text_from(made, "value", lambda x: f"{x['min']:.0f} – {x['max']:.0f}")
        # the event's own numbers: the range's value comes throttled, and may be an older one
        made.on("change", lambda event: made.set_value(event.args))
        made.on("change", self._user(self._change))
        return made

    def _user(self, action: Callable[[], object]) -> Callable[[], None]:
        """Return an action that answers a person and not the page's own refresh."""

        def act() -> None:
            if not getattr(self, "_quiet", True):
                action()

        return act

    def _choose(self, event: events.ValueChangeEventArguments[Any]) -> None:
        if self._quiet or not event.value:
            return
        self._studio.chosen = str(event.value)
        if self._studio.watch.shown:
            self._look(shown=str(event.value))
        self._shown = None

    def _bounds(self) -> HsvRange:
        ends = [(int(made.value["min"]), int(made.value["max"])) for made in self._ranges]
        low = (ends[0][0] % _WRAP, ends[1][0], ends[2][0])
        high = (ends[0][1] % _WRAP, ends[1][1], ends[2][1])
        return HsvRange(low, high)

    def _described(self, name: str) -> ColourTarget:
        return ColourTarget(name, self._bounds(), 0.01 * self._width.value, self._shape.value)

    def _change(self) -> None:
        """Give the chosen kind the bounds that are shown."""
        if (kind := self._kind) is not None:
            self._tab.attempt(lambda: self._replace(kind.name, self._described(kind.name)))

    def _take(self, learned: Learned) -> None:
        """Give the chosen kind a colour that was learned, or say why there was none."""
        kind, hsv = self._kind, learned.hsv
        if hsv is None:
            ui.notify(learned.why[0].upper() + learned.why[1:], multi_line=True)
        elif kind is not None:
            self._tab.attempt(lambda: self._replace(kind.name, dataclasses.replace(kind, hsv=hsv)))
            ui.notify(f"Learned the colour of '{kind.name}'", type="positive")

    def _replace(self, name: str, target: ColourTarget) -> None:
        targets = (target if it.name == name else it for it in self._studio.watch.targets)
        self._look(targets=tuple(targets))

    def _look(self, **changes: Any) -> None:
        self._studio.look_for(dataclasses.replace(self._studio.watch, **changes))

    def _add(self) -> None:
        name = str(self._name.value or "").strip()

        def add() -> None:
            target = self._described(name)
            others = (it for it in self._studio.watch.targets if it.name != name)
            self._studio.chosen = name
            self._look(targets=(*others, target))

        self._tab.attempt(add)

    def _remove(self) -> None:
        if (kind := self._kind) is None:
            return
        left = tuple(it for it in self._studio.watch.targets if it is not kind)

        def remove() -> None:
            self._studio.chosen = left[0].name if left else ""
            self._look(targets=left, shown="")

        self._tab.attempt(remove)

    def _mask(self, shown: bool) -> None:
        self._tab.attempt(lambda: self._look(shown=self._studio.chosen if shown else ""))

    def _dim(self, light: float) -> None:
        self._tab.attempt(lambda: self._look(light=light))

    def _save(self) -> None:
        def save() -> None:
            path = self._studio.save_targets()
            ui.notify(f"Wrote {path}", type="positive")

        self._tab.attempt(save)

    def _load(self) -> None:
        self._tab.attempt(self._studio.load_targets)
