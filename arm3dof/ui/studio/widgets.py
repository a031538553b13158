"""The controls of the page in one style, each with a tooltip that says its unit and effect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui

from arm3dof.ui.studio.fields import Field


def button(
    text: str, icon: str, tip: str, on_click: Callable[[], Any], *, color: str | None = None
) -> ui.button:
    """Return a button with a tooltip; one without a text is named by it.

    Args:
        text: what it says.
        icon: its symbol; none when empty.
        tip: what the tooltip says.
        on_click: what it does.
        color: its colour; a quiet one with a thin frame without.
    """
    made = ui.button(text, icon=icon or None, on_click=on_click, color=color)
    made.props("no-caps unelevated dense")
    if color is None:
        made.classes("plain")
    if not text:
        made.props(f'aria-label="{tip}" flat round')
    return made.props(f'title="{tip}"')


def heading(text: str) -> None:
    """Begin a part of a panel."""
    ui.html(f"<h2>{text}</h2>", sanitize=False)


def slider(field: Field, value: float, on_release: Callable[[float], Any]) -> ui.slider:
    """Return a labelled slider with its number beside it; it acts when it is let go.

    Args:
        field: what is chosen.
        value: the value at first.
        on_release: called with the value that was chosen.
    """
    props = f'title="{field.tooltip}" data-key="{field.key}"'
    with ui.element("label").classes("field").props(props):
        ui.html(f"<span>{field.label}</span>", sanitize=False)
        made = ui.slider(min=field.low, max=field.high, step=field.step, value=value)
        made.props(f'label-always=false aria-label="{field.label}"')
        shown = ui.label().classes("value")
        shown.bind_text_from(made, "value", lambda x: _text(x, field))
    # the event's own number: the slider's value comes throttled, and may still be an older one
    made.on("change", lambda event: on_release(float(event.args)))
    return made


def _text(value: float | None, field: Field) -> str:
    digits = max(0, len(f"{field.step:g}".partition(".")[2]))
    return "" if value is None else f"{value:.{digits}f} {field.unit}".strip()
