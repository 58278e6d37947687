"""The sentence for a mistake in a configuration: which key, what is there, what is expected."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Final, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

_EXPECTED: Final[Mapping[str, str]] = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a section of keys and values",
    "finite_number": "a finite number, 2.5 for example",
    "float_parsing": "a number, 2.5 for example",
    "float_type": "a number, 2.5 for example",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_type": "a whole number",
    "frozen_set_type": "a list, [a, b] for example",
    "int_parsing_size": "a whole number of fewer digits",
    "list_type": "a list, [a, b] for example",
    "model_attributes_type": "a section of keys and values",
    "model_type": "a section of keys and values",
    "path_type": "a path, /dev/video11 for example",
    "string_type": "a text; write numbers and dates in quotation marks",
    "tuple_type": "a list, [a, b] for example",
}
"""What is expected, by pydantic's type of the error."""
_WITH_VALUES: Final[Mapping[str, Callable[[Mapping[str, Any]], str]]] = {
    "greater_than": lambda values: f"more than {values['gt']:g}",
    "greater_than_equal": lambda values: f"at least {values['ge']:g}",
    "less_than": lambda values: f"less than {values['lt']:g}",
    "less_than_equal": lambda values: f"at most {values['le']:g}",
    "multiple_of": lambda values: f"a multiple of {values['multiple_of']:g}",
    "string_too_long": lambda values: f"a text of at most {values['max_length']} characters",
    "string_too_short": lambda _: "a text that is not empty",
    "too_short": lambda values: f"at least {values['min_length']} of them",
    "union_tag_not_found": lambda values: f"a section with the key {values['discriminator']}",
    "value_error": lambda values: str(values["error"]),
}
"""The same where the sentence needs the error's own values."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A mistake.

    Attributes:
        location: the keys and list positions that lead to it.
        text: which key, what is there, what is expected.
    """

    location: tuple[int | str, ...]
    text: str


def first_problem(error: ValidationError, settings_type: type[BaseModel], *, noun: str = "key") -> Problem:
    """Returns the first mistake, with the number of the others.

    Args:
        error: of the validation.
        settings_type: the model that was validated, for the keys that it has.
        noun: what its users call a key.
    """
    # A default that needs a wrong value is no mistake of its own.
    problems = [
        each for each in error.errors(include_url=False) if each["type"] != "default_factory_not_called"
    ]
    first = problems[0]
    location = first["loc"]
    spelled = {python: file for file, python in getattr(settings_type, "spellings", {}).items()}
    # [key] is pydantic's mark of a wrong key of a mapping.
    key = ".".join(spelled.get(part, str(part)) for part in location if part != "[key]") or "(top)"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        return Problem(location, f"unknown {noun} '{key}'{more}. {_allowed(settings_type, location)}")
    if first["type"] == "missing":
        return Problem(location, f"{noun} '{key}' is missing{more}")
    return Problem(location, f"{noun} '{key}' is {first['input']!r}, expected: {expected(first)}{more}")


def expected(problem: ErrorDetails) -> str:
    """Returns what is expected in place of a wrong value."""
    kind, values = problem["type"], problem.get("ctx", {})
    if kind in {"enum", "literal_error"}:
        return _one_of(values["expected"], problem["input"])
    if kind == "union_tag_invalid":
        return f"{values['discriminator']} {_one_of(values['expected_tags'], values['tag'])}"
    if sentence := _EXPECTED.get(kind):
        return sentence
    if sentence_of := _WITH_VALUES.get(kind):
        return sentence_of(values)
    # Of a type that no setting has so far; pydantic's sentences are for programmers.
    return "another value (docs/configuration.md)"


def _one_of(quoted: str, value: Any) -> str:
    """Returns pydantic's enumeration of words without quotation marks, and the probable one."""
    words = quoted.replace("'", "").replace(" or ", ", ")
    meant = get_close_matches(str(value).lower(), words.split(", "), n=1)
    return f"one of {words}" + (f"; did you mean {meant[0]}?" if meant else "")


def _allowed(settings_type: type[BaseModel], location: tuple[int | str, ...]) -> str:
    """Returns the allowed keys beside an unknown one, and the one that was probably meant."""
    *above, unknown = location
    models = [settings_type]
    for part in above:
        # List positions and members of unions have no field of that name; they stay where they are.
        models = [
            inner
            for model in models
            if (field := model.model_fields.get(str(part).replace("-", "_")))
            for inner in models_in(field.annotation)
        ] or models
    fields = [pair for model in models for pair in model.model_fields.items()]
    allowed = list(dict.fromkeys(field.alias or name for name, field in fields))
    meant = get_close_matches(str(unknown), allowed, n=1)
    return (f"Did you mean '{meant[0]}'? " if meant else "") + f"Allowed: {', '.join(allowed)}"


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yields the sections that an annotation has in it."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)
