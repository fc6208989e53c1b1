"""The page of HTTP, out of the service's own OpenAPI document."""

from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from service.app import create_app
from service.settings import Settings

_HEAD = """\
# HTTP

Bodies are JSON unless a row says otherwise. Errors are `application/problem+json` (RFC 9457) with
a stable `code`. Angles are in degrees, lengths in metres, times RFC 3339 in UTC; names say units.
*Scope* is what a token has to hold. `/docs` of a running service has the same to try, and
`/openapi.json` for programs, with an example of every request and answer. Unknown fields of a body
refuse nothing, but those of a new token: the answer names up to 20 of them (`ignored`). [How the
API changes](../guides/changes.md) is promised. The guides say how these belong together.
"""
_ERRORS = """\
## Errors

| Status | Meaning |
|---|---|
"""

_FIELDS = "| Field | Type | Meaning |\n|---|---|---|"

Document = dict[str, Any]


def http_page() -> str:
    """The paths by tag, the errors, the schemas."""
    document = _document()
    return "\n".join([_HEAD, *_paths(document), _errors(document), *_schemas(document)])


def _document() -> Document:
    with TemporaryDirectory() as folder:
        app = create_app(Settings(data_dir=Path(folder), workers=0))
        document: Document = app.openapi()
        return document


def _operations(document: Document) -> list[tuple[str, str, Document]]:
    return [
        (path, method.upper(), operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]


def _paths(document: Document) -> list[str]:
    by_tag: dict[str, list[str]] = defaultdict(list)
    for path, method, operation in _operations(document):
        by_tag[operation["tags"][0]].append(_operation(path, method, operation))
    return [f"## {tag.capitalize()}\n\n{''.join(each)}" for tag, each in by_tag.items()]


def _operation(path: str, method: str, operation: Document) -> str:
    lines = [f"### {method} {path}\n", f"{operation['summary']}.\n"]
    lines += [f"{operation['description']}\n"] if operation.get("description") else []
    scopes = [scope for each in operation.get("security", []) for scope in each["token"]]
    lines.append(f"Scope: {f'`{scopes[0]}`' if scopes else 'none'}.")
    lines += [_body(operation["requestBody"])] if "requestBody" in operation else []
    lines.append(_answers(operation))
    return "\n".join([*lines, _parameters(operation), ""])


def _body(body: Document) -> str:
    said = f"Body: {_contents(body['content'])}."
    own = body["content"].get("application/json", {}).get("schema", {})
    return f"{said}\n\n{_fields(own)}" if "properties" in own else said


def _fields(schema: Document, within: str = "") -> str:
    """The rows of an object that has no name of its own, and of the objects in its lists."""
    rows = []
    for name, field in schema["properties"].items():
        rows.append(_row(within + name, field, name in schema.get("required", [])))
        if "properties" in field.get("items", {}):
            rows.append(_fields(field["items"], f"{within}{name}[]."))
    return "\n".join(rows if within else [_FIELDS, *rows, ""])


def _answers(operation: Document) -> str:
    well = [
        f"{status}{_content_of(answer)}"
        for status, answer in operation["responses"].items()
        if int(status) < 400
    ]
    wrong = [status for status in sorted(operation["responses"]) if int(status) >= 400]
    told = f"Answer: {', '.join(well)}."
    return f"{told} Errors: {', '.join(wrong)}." if wrong else told


def _content_of(answer: Document) -> str:
    return f" {_contents(answer['content'])}" if answer.get("content") else ""


def _contents(contents: Document) -> str:
    said = []
    for kind, content in contents.items():
        schema = content.get("schema", {})
        name = _type(schema) if "$ref" in schema or kind == "application/json" else ""
        said.append(name if kind == "application/json" else f"`{kind}`{' ' + name if name else ''}")
    return ", ".join(said)


def _parameters(operation: Document) -> str:
    asked = [each for each in operation.get("parameters", []) if each["in"] != "path"]
    if not asked:
        return ""
    rows = [
        _row(each["name"], each["schema"] | {"in": each["in"]}, each.get("required", False))
        for each in asked
    ]
    return "\n| Parameter | Type | Meaning |\n|---|---|---|\n" + "\n".join(rows) + "\n"


def _errors(document: Document) -> str:
    told: dict[str, set[str]] = defaultdict(set)
    for _, _, operation in _operations(document):
        for status, answer in operation["responses"].items():
            if "application/problem+json" in answer.get("content", {}):
                told[status].add(answer["description"])
    rows = [f"| {status} | {'; '.join(sorted(told[status]))} |\n" for status in sorted(told)]
    return _ERRORS + "".join(rows)


def _schemas(document: Document) -> list[str]:
    schemas = document["components"]["schemas"]
    return ["## Schemas\n", *(_schema(name, schemas[name]) for name in sorted(schemas))]


def _schema(name: str, schema: Document) -> str:
    lines = [f"### {name}\n", f"{schema.get('description', '').strip()}\n"]
    if "enum" in schema:
        return "\n".join([*lines, f"One of {_values(schema)}.\n"])
    required = schema.get("required", [])
    rows = [_row(each, field, each in required) for each, field in schema["properties"].items()]
    return "\n".join([*lines, _FIELDS, *rows, ""])


def _row(name: str, schema: Document, required: bool) -> str:
    meaning = [schema["description"]] if schema.get("description") else []
    if schema.get("in") == "header":
        meaning.append("a header")
    if required:
        meaning.append("required")
    elif schema.get("default") is not None:
        meaning.append(f"`{schema['default']}` unless given")
    described = "; ".join(meaning).replace("|", "\\|").replace("\n", " ")
    return f"| `{name}` | {_type(schema)} | {described} |"


def _type(schema: Document) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        return " or ".join(_type(each) for each in schema["anyOf"])
    if "enum" in schema:
        return _values(schema) if len(schema["enum"]) < 10 else "text"
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    if isinstance(schema.get("type"), list):
        return " or ".join(_name(each) for each in schema["type"])
    return _name(schema.get("type", "object")) + _limits(schema)


def _name(kind: str) -> str:
    return {"string": "text", "boolean": "true or false"}.get(kind, kind)


def _values(schema: Document) -> str:
    return ", ".join(f"`{value}`" for value in schema["enum"])


def _limits(schema: Document) -> str:
    if schema.get("format") == "date-time":
        return ", a time"
    signs = {
        "minimum": "≥",
        "exclusiveMinimum": "&gt;",
        "maximum": "≤",
        "exclusiveMaximum": "&lt;",
        "maxLength": "length ≤",
    }
    said = [f"{sign} {schema[name]:g}" for name, sign in signs.items() if name in schema]
    return f" {', '.join(said)}" if said else ""
