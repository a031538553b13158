"""One clear line for a settings file that does not fit its model."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ValidationError

# the cure for each kind of error that pydantic can find in our models
_CURES = {
    "missing": "add it",
    "greater_than": "give a number above {gt:g}",
    "greater_than_equal": "give {ge:g} or more",
    "less_than": "give a number below {lt:g}",
    "less_than_equal": "give {le:g} or less",
    "finite_number": "give a finite number",
    "int_type": "give a whole number",
    "int_from_float": "give a whole number",
    "int_parsing": "give a whole number",
    "float_type": "give a number",
    "float_parsing": "give a number",
    "bool_type": "give true or false",
    "bool_parsing": "give true or false",
    "string_type": "give a text in quotes",
    "tuple_type": "give a list in brackets",
    "model_type": "give a table",
    "dict_type": "give a table",
    "literal_error": "give {expected}",
    "string_pattern_mismatch": "use letters, digits, - and _ only",
}


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Say in one line what is wrong with each key, its value and the cure.

    Args:
        error: what pydantic found.
        model: the model that was validated, for the names of its keys.
    """
    problems = error.errors(include_url=False)
    # a list that is too short has each missing entry counted; one word on it is enough
    lines = dict.fromkeys(_line(dict(problem), model) for problem in problems)
    return " | ".join(lines)


def _line(problem: dict[str, Any], model: type[BaseModel]) -> str:
    kind, place = problem["type"], tuple(problem["loc"])
    entry = next((k for k, part in enumerate(place) if isinstance(part, int)), None)
    if kind == "missing" and entry is not None:
        return f"{_name(place[:entry])} has too few entries; add the missing ones"
    if kind == "too_long":
        context = problem["ctx"]
        return (
            f"{_name(place)} has {context['actual_length']} entries; give {context['max_length']}"
        )
    if kind == "missing":
        return f"{_name(place)} is missing; add it"
    if kind == "extra_forbidden":
        known = ", ".join(_keys(model, place[:-1]))
        return f"{_name(place)} is not a known key; remove it or use one of: {known}"
    if place[-1:] == ("[key]",):
        return f"{_name(place[:-2])} has the name '{problem['input']}'; {_cure(problem)}"
    return f"{_name(place)} is {problem['input']!r}; {_cure(problem)}"


def _cure(problem: dict[str, Any]) -> str:
    if problem["type"] in _CURES:
        return _CURES[problem["type"]].format(**problem.get("ctx", {}))
    return str(problem["msg"]).lower()


def _name(place: tuple[str | int, ...]) -> str:
    """Write a place as TOML does: ``targets.red.hsv_low[2]``."""
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.lstrip(".")


def _keys(model: type[BaseModel], place: tuple[str | int, ...]) -> tuple[str, ...]:
    """Return the keys that the table at a place may have."""
    for part in place:
        field = model.model_fields.get(str(part))
        if field is not None:
            model = _model_in(field.annotation) or model
    return tuple(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """Find the model in an annotation: the model itself, or a table's values."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_model_in(inner) for inner in getattr(annotation, "__args__", ()))
    return next((model for model in found if model is not None), None)
