"""The OpenAPI document of the desk, made from the table of what it can be asked.

Decides: how types and statuses are described.  Must not know: what commands do.
"""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Any, Final

import msgspec

from coordinator.desk.answers import Problem
from coordinator.desk.api import ENDPOINTS, Endpoint
from coordinator.desk.bodies import NoBody
from coordinator.desk.rights import Right

Schema = dict[str, Any]

_VERSION: Final = "3.1.0"
_EVENTS: Final = (
    "Server-sent events: `fleet` (as /api/fleet; after the first one only robots that changed), "
    "`gone` (robots that have left), `order` (an order that has changed).  With `scenes=1` "
    "what the page draws in place of `order`."
)


def openapi(version: str) -> dict[str, Any]:
    """Return the document for this version of splinefleet."""
    types = [Problem, *(one.answer for one in ENDPOINTS), *(one.body for one in ENDPOINTS)]
    schemas, components = msgspec.json.schema_components(
        types, ref_template="#/components/schemas/{name}"
    )
    named = {id(one): schema for one, schema in zip(types, schemas, strict=True)}
    paths: dict[str, Any] = {}
    for one in ENDPOINTS:
        operation = _operation(one, named[id(one.answer)], named[id(one.body)], named[id(Problem)])
        paths.setdefault(one.path, {})[one.method.lower()] = operation
    paths["/api/events"] = {"get": _stream(_EVENTS, "text/event-stream")}
    paths["/metrics"] = {"get": _stream("Metrics in the text format of Prometheus", "text/plain")}
    components.pop("NoBody", None)
    return {
        "openapi": _VERSION,
        "info": {"title": "splinefleet: the operator's desk", "version": version},
        "paths": paths,
        "components": {"schemas": components},
    }


def _operation(one: Endpoint, answer: Schema, body: Schema, problem: Schema) -> dict[str, Any]:
    """Return the description of one endpoint."""
    content = {"application/json": {"schema": problem}}
    statuses = [400, 401, 403] if one.right is Right.COMMAND else [401, 403]
    found: dict[str, Any] = {
        "summary": one.summary,
        "operationId": re.sub(r"\W+", "_", f"{one.method.lower()}{one.path}").strip("_"),
        "responses": {
            str(one.status): {
                "description": HTTPStatus(one.status).phrase,
                "content": {"application/json": {"schema": answer}},
            },
        },
    }
    if "{name}" in one.path:
        named = {"name": "name", "in": "path", "required": True, "schema": {"type": "string"}}
        found["parameters"] = [named]
    if one.body is not NoBody:
        statuses += [400, 413, 415]
    found["responses"] |= {
        str(status): {"description": HTTPStatus(status).phrase, "content": content}
        for status in sorted({*statuses, *one.statuses})
    }
    if one.body is not NoBody:
        found["requestBody"] = {"required": True, "content": {"application/json": {"schema": body}}}
    return found


def _stream(description: str, kind: str) -> dict[str, Any]:
    text = {"description": "OK", "content": {kind: {"schema": {"type": "string"}}}}
    return {"summary": description, "responses": {"200": text}}
