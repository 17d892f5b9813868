"""A small JSON Schema validator: the keywords that this project's schemas use, and no others.

It stands on the standard alone (json-schema.org, 2020-12) and refuses a keyword that it does not
know, so that nothing passes unseen.
"""

from __future__ import annotations

import re
from datetime import datetime

_TELLING = {"title", "description", "$defs", "default", "contentEncoding", "$schema", "$comment"}
_TELLING |= {"definitions", "examples", "subtopic", "unit"}
_TYPES = {
    "object": dict,
    "array": (list, tuple),
    "string": (str, bytes),
    "boolean": bool,
    "null": type(None),
}


def problems(schema, value, root=None, place="$"):
    """Yield what is wrong with a value, nothing when it fits; bytes stand for encoded strings."""
    root = schema if root is None else root
    for word, wanted in schema.items():
        if word not in _TELLING:
            for problem in _RULES[word](wanted, value, schema, root, place):
                yield problem if isinstance(problem, str) else f"{place}: {word} {wanted!r}"


def _type(wanted, value, *_):
    if isinstance(wanted, list):
        if all(list(_type(one, value)) for one in wanted):
            yield True
        return
    if wanted in ("number", "integer"):
        kinds = (int,) if wanted == "integer" else (int, float)
        fits = isinstance(value, kinds) and not isinstance(value, bool)
    else:
        fits = isinstance(value, _TYPES[wanted])
    if not fits:
        yield True


def _bound(fits):
    def rule(wanted, value, *_):
        if (
            not isinstance(value, bool)
            and isinstance(value, (int, float))
            and not fits(value, wanted)
        ):
            yield True

    return rule


def _length(kinds, fits):
    def rule(wanted, value, *_):
        if isinstance(value, kinds) and not fits(len(value), wanted):
            yield True

    return rule


def _pattern(wanted, value, *_):
    if isinstance(value, str) and not re.search(wanted, value):
        yield True


def _format(wanted, value, *_):
    if wanted != "date-time":
        raise KeyError(wanted)
    try:
        told = not isinstance(value, str) or datetime.fromisoformat(value).tzinfo is not None
    except ValueError:
        told = False
    if not told:
        yield True


def _ref(wanted, value, _schema, root, place):
    target = root
    for part in wanted.removeprefix("#/").split("/"):
        target = target[part]
    yield from problems(target, value, root, place)


def _any_of(wanted, value, _schema, root, place):
    if all(list(problems(one, value, root, place)) for one in wanted):
        yield True


def _one_of(wanted, value, _schema, root, place):
    if sum(not list(problems(one, value, root, place)) for one in wanted) != 1:
        yield True


def _properties(wanted, value, _schema, root, place):
    if isinstance(value, dict):
        for name, schema in wanted.items():
            if name in value:
                yield from problems(schema, value[name], root, f"{place}.{name}")


def _required(wanted, value, *_):
    if isinstance(value, dict) and not set(wanted) <= set(value):
        yield True


def _prefix_items(wanted, value, _schema, root, place):
    if isinstance(value, (list, tuple)):
        for i, (schema, item) in enumerate(zip(wanted, value, strict=False)):
            yield from problems(schema, item, root, f"{place}[{i}]")


def _items(wanted, value, schema, root, place):
    if not isinstance(value, (list, tuple)):
        return
    for i, item in enumerate(value[len(schema.get("prefixItems", ())) :]):
        if wanted is False:
            yield True
        else:
            yield from problems(wanted, item, root, f"{place}[{i}]")


def _equals(wanted, value, *_):
    if value not in (wanted if isinstance(wanted, list) else [wanted]):
        yield True


_RULES = {
    "type": _type,
    "minimum": _bound(lambda value, least: value >= least),
    "maximum": _bound(lambda value, most: value <= most),
    "exclusiveMinimum": _bound(lambda value, least: value > least),
    "exclusiveMaximum": _bound(lambda value, most: value < most),
    "minLength": _length((str, bytes), lambda size, least: size >= least),
    "maxLength": _length((str, bytes), lambda size, most: size <= most),
    "minItems": _length((list, tuple), lambda size, least: size >= least),
    "maxItems": _length((list, tuple), lambda size, most: size <= most),
    "pattern": _pattern,
    "format": _format,
    "$ref": _ref,
    "anyOf": _any_of,
    "oneOf": _one_of,
    "properties": _properties,
    "required": _required,
    "prefixItems": _prefix_items,
    "items": _items,
    "enum": _equals,
    "const": _equals,
}
