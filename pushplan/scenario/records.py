"""Records: mappings of a file with typed values, read from plain data with everything that is wrong told at once.

A record is a class whose annotations say what its keys hold: `str`, `bool`, `float` and `int` with how they may be
written (`Stated`), `Literal`, tuples, mappings of texts, other records, `... | None`, and in `Annotated` the rules
below. What reads them is made when a record is read first, and its JSON Schema when it is asked for: a command that
reads one scenario does not wait for all that a file may hold.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Self,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from pushplan.scenario.source import Place
from pushplan.scenario.units import NotAllowedError, Stated, nearest, show


class Wrong(NamedTuple):
    """What is wrong at a place, whose key is meant where there should be none."""

    place: Place
    what: str
    at_key: bool = False


Faults = list[Wrong]
Reader = Callable[[Any, Place, Faults], Any]
"""Reads a value at a place, and adds what is wrong with it to the faults; what it then returns means nothing."""


@dataclass(frozen=True)
class Before:
    """Reads a value before the type that it stands beside, and may refuse it with a fault."""

    read: Callable[[Any], Any]


@dataclass(frozen=True)
class After:
    """Reads what the type that it stands beside has read, and may refuse it with a fault."""

    read: Callable[[Any], Any]


@dataclass(frozen=True)
class Several:
    """Requires a list of `low` to `high` values."""

    low: int
    high: int

    def read(self, value: Any) -> Any:
        """Return `value` when it is such a list."""
        if not isinstance(value, list) or not self.low <= len(value) <= self.high:
            raise NotAllowedError(show(value))
        return value


@dataclass(frozen=True)
class Chosen:
    """Tells which of the forms of a union a value has: its index, or None where it has none of them."""

    form: Callable[[Any], int | None]


def by_key(*keys: str, word: bool = False) -> Chosen:
    """Return what tells forms of a mapping apart: each has one key that the others lack.

    With `word`, the first form of all is that of what is no mapping.
    """

    def form(value: Any) -> int | None:
        if not isinstance(value, dict):
            return 0 if word else None
        given = [i for i, key in enumerate(keys) if value.get(key) is not None]
        return given[0] + word if len(given) == 1 else None

    return Chosen(form)


ONE_OR_LIST = Chosen(lambda value: int(isinstance(value, list)))
"""Tells a single value, the first form, from a list of them."""


@dataclass(frozen=True)
class Key:
    """A key of a record.

    Attributes:
        description: What may be written, in words.
        default: Its value where it is left out, if it may be.
        factory: What makes that value instead.
        extra: What its JSON Schema says beside what its type says.
        form: Its annotation.
    """

    description: str = ""
    default: Any = inspect.Parameter.empty
    factory: Callable[[], Any] | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    form: Any = None

    @property
    def required(self) -> bool:
        """Whether it may not be left out."""
        return self.default is inspect.Parameter.empty and self.factory is None

    def left_out(self) -> Any:
        """Return its value where it is left out."""
        return self.default if self.factory is None else self.factory()


def key(
    *,
    description: str,
    default: Any = inspect.Parameter.empty,
    default_factory: Callable[[], Any] | None = None,
    extra: Mapping[str, Any] | None = None,
) -> Any:
    """Return what is said of a key beside its type; see `Key`."""
    return Key(description, default, default_factory, extra or {})


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(key,))
class Record:
    """A mapping that takes no other keys than its own; equal to those of its class with equal values."""

    others: ClassVar[bool] = False
    """Whether other keys are left to others."""

    _keys: ClassVar[dict[str, Key]]
    _readers: ClassVar[dict[str, Reader]]

    def __init__(self, **values: Any) -> None:
        """Make a record of values as a file states them, lists or tuples.

        Raises:
            ValueError: With everything that is wrong.
        """
        faults: Faults = []
        made = self.read({name: _listed(value) for name, value in values.items()}, (), faults)
        if made is None or faults:
            raise ValueError("; ".join(f"{'.'.join(map(str, one.place))}: {one.what}" for one in faults))
        self.__dict__.update(made.__dict__)

    @classmethod
    def fields(cls) -> dict[str, Key]:
        """Return its keys, those of its base first."""
        if "_keys" not in cls.__dict__:
            hints = get_type_hints(cls, include_extras=True)
            found = {name: getattr(cls, name, None) for name in hints}
            cls._keys = {
                name: Key(said.description, said.default, said.factory, said.extra, hints[name])
                for name, said in found.items()
                if isinstance(said, Key)
            }
        return cls._keys

    @classmethod
    def read(cls, value: Any, place: Place, faults: Faults) -> Self | None:
        """Return the record that plain data at a place of a file state; see `Reader`."""
        keys, before = cls.fields(), len(faults)
        if not isinstance(value, dict):
            faults.append(
                Wrong(place, f"{show(value)}; allowed: a mapping with the keys {', '.join(cls.fields())}")
            )
            return None
        if "_readers" not in cls.__dict__:
            cls._readers = {name: _reader(said.form, said.description) for name, said in keys.items()}
        stated = {}
        for name, said in keys.items():
            if name in value:
                stated[name] = cls._readers[name](value[name], (*place, name), faults)
            elif said.required:
                faults.append(Wrong((*place, name), f"is missing; needed: {said.description}"))
        for name in [] if cls.others else [name for name in value if name not in keys]:
            what = f"unknown key{nearest(str(name), list(keys))} allowed: {', '.join(keys)}"
            faults.append(Wrong((*place, name), what, at_key=True))
        if len(faults) > before:
            return None
        made = cls.of_values(**stated)
        _ruled(lambda _: made.checked(), "")(None, place, faults)
        return made

    def checked(self) -> Self:
        """Return the record itself, or raise the fault of values that do not go together."""
        return self

    @classmethod
    def of_values(cls, **values: Any) -> Self:
        """Return a record of values in SI, which are not checked; the others have their defaults."""
        made = object.__new__(cls)
        for name, said in cls.fields().items():
            made.__dict__[name] = values[name] if name in values else said.left_out()
        made.__dict__["_stated"] = frozenset(values)
        return made

    @property
    def stated(self) -> frozenset[str]:
        """The keys that are stated; the others have their defaults."""
        return frozenset(self.__dict__["_stated"])

    def values(self) -> dict[str, Any]:
        """Return the values by key."""
        return {name: self.__dict__[name] for name in self.fields()}

    def replaced(self, **values: Any) -> Self:
        """Return a copy with other values, which are not checked, in place of some."""
        stated = {name: value for name, value in self.values().items() if name in self.stated}
        return self.of_values(**stated | values)

    def plain(self) -> dict[str, Any]:
        """Return it as plain data: mappings, lists and scalars, without what is None."""
        return {name: _plain(value) for name, value in self.values().items() if value is not None}

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a {type(self).__name__} cannot be changed; use replaced({name}=...)")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and isinstance(other, Record) and self.values() == other.values()

    def __hash__(self) -> int:
        return hash((type(self), *self.values().values()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.values().items())})"


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.plain()
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _listed(value: Any) -> Any:
    return [_listed(one) for one in value] if isinstance(value, tuple) else value


# --- what reads a type ------------------------------------------------------------------------------------------


def _reader(form: Any, described: str) -> Reader:
    """Return what reads values of an annotation; `described` says what is allowed where a fault does not."""
    if isinstance(form, type) and issubclass(form, Record):
        return form.read
    origin, parts = get_origin(form), get_args(form)
    if origin is Annotated:
        return _annotated(parts[0], parts[1:], described)
    if origin is Literal:
        return _ruled(partial(_word, parts), described)
    if origin in (Union, UnionType):
        inner = _reader(_but_none(parts), described)
        return lambda value, place, faults: None if value is None else inner(value, place, faults)
    if origin is tuple and parts[-1] is not Ellipsis:
        return _each([_reader(part, described) for part in parts], described)
    if origin is tuple:
        return _every(_reader(parts[0], described), described)
    if origin is dict:
        return _mapping(_reader(parts[1], described), described)
    return _ruled(partial(_instance, form), described)


def _annotated(form: Any, rules: tuple[Any, ...], described: str) -> Reader:
    """Return what reads values of a type with its rules, the last of which looks at a value first."""
    first, *others = rules
    if isinstance(first, Stated):
        read = _ruled((lambda value: int(first.read(value))) if form is int else first.read, described)
    elif isinstance(first, Chosen):
        read = _choice(first, get_args(form), described)
    else:
        read, others = _reader(form, described), list(rules)
    for rule in others:
        read = _after(read, rule, described) if isinstance(rule, After) else _before(read, rule, described)
    return read


def _but_none(parts: tuple[Any, ...]) -> Any:
    """Return the one part of an optional type that is not None."""
    (form,) = (part for part in parts if part is not NoneType)
    return form


def _ruled(rule: Callable[[Any], Any], described: str) -> Reader:
    def read(value: Any, place: Place, faults: Faults) -> Any:
        try:
            return rule(value)
        except NotAllowedError as fault:
            faults.append(Wrong(place, fault.sentence(described)))
        return None

    return read


def _after(inner: Reader, rule: After, described: str) -> Reader:
    last = _ruled(rule.read, described)

    def read(value: Any, place: Place, faults: Faults) -> Any:
        before, found = len(faults), inner(value, place, faults)
        return found if len(faults) > before else last(found, place, faults)

    return read


def _before(inner: Reader, rule: Before | Several, described: str) -> Reader:
    first = _ruled(rule.read, described)

    def read(value: Any, place: Place, faults: Faults) -> Any:
        before, found = len(faults), first(value, place, faults)
        return found if len(faults) > before else inner(found, place, faults)

    return read


def _choice(chosen: Chosen, forms: tuple[Any, ...], described: str) -> Reader:
    readers = [_reader(form, described) for form in forms]
    records = [form for form in forms if isinstance(form, type) and issubclass(form, Record)]

    def read(value: Any, place: Place, faults: Faults) -> Any:
        form = chosen.form(value)
        if form is not None:
            return readers[form](value, place, faults)
        found, near = show(value), ";"
        if isinstance(value, dict):
            keys = [name for record in records for name in record.fields()]
            found = f"has {' and '.join(map(str, value)) or 'no keys'}"
            near = next((nearest(str(name), keys) for name in value if name not in keys), ";")
        faults.append(Wrong(place, f"{found}{near} allowed: {described}"))
        return None

    return read


def _each(readers: list[Reader], described: str) -> Reader:
    def read(value: Any, place: Place, faults: Faults) -> Any:
        if not isinstance(value, list) or len(value) != len(readers):
            faults.append(Wrong(place, f"{show(value)}; allowed: {described}"))
            return None
        return tuple(one(value[i], (*place, i), faults) for i, one in enumerate(readers))

    return read


def _every(inner: Reader, described: str) -> Reader:
    def read(value: Any, place: Place, faults: Faults) -> Any:
        if not isinstance(value, list):
            faults.append(Wrong(place, f"{show(value)}; allowed: {described}"))
            return None
        return tuple(inner(one, (*place, i), faults) for i, one in enumerate(value))

    return read


def _mapping(inner: Reader, described: str) -> Reader:
    def read(value: Any, place: Place, faults: Faults) -> Any:
        if not isinstance(value, dict) or not value:
            faults.append(Wrong(place, f"{show(value)}; allowed: {described}"))
            return None
        return {name: inner(one, (*place, name), faults) for name, one in value.items()}

    return read


def _word(words: tuple[Any, ...], value: Any) -> Any:
    if value not in words or isinstance(value, bool):
        raise NotAllowedError(show(value), hint=nearest(value, words) if isinstance(value, str) else ";")
    return value


def _instance(kind: type, value: Any) -> Any:
    if not isinstance(value, kind):
        raise NotAllowedError(show(value))
    return value


# --- its JSON Schema --------------------------------------------------------------------------------------------


def json_schema(form: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of an annotation; those of the records in it are added to the definitions."""
    if isinstance(form, type) and issubclass(form, Record):
        return _reference(form, definitions)
    origin, parts = get_origin(form), get_args(form)
    if origin is Annotated:
        return _ruled_schema(parts[0], parts[1:], definitions)
    if origin is Literal:
        return {"type": "string", **({"const": parts[0]} if len(parts) == 1 else {"enum": list(parts)})}
    if origin in (Union, UnionType):
        inner = json_schema(_but_none(parts), definitions)
        forms = inner["anyOf"] if inner.keys() == {"anyOf"} else [inner]
        return {"anyOf": [*forms, {"type": "null"}]}
    if origin is tuple and parts[-1] is not Ellipsis:
        items = [json_schema(part, definitions) for part in parts]
        return {"type": "array", "prefixItems": items, "minItems": len(parts), "maxItems": len(parts)}
    if origin is tuple:
        return {"type": "array", "items": json_schema(parts[0], definitions)}
    if origin is dict:
        values = json_schema(parts[1], definitions)
        return {"type": "object", "additionalProperties": values, "minProperties": 1}
    return {"type": {str: "string", bool: "boolean"}[form]}


def _ruled_schema(form: Any, rules: tuple[Any, ...], definitions: dict[str, Any]) -> dict[str, Any]:
    if isinstance(rules[0], Stated):
        return rules[0].schema()
    if isinstance(rules[0], Chosen):
        schema: dict[str, Any] = {"oneOf": [json_schema(part, definitions) for part in get_args(form)]}
    else:
        schema = json_schema(form, definitions)
    for rule in rules:
        if isinstance(rule, Several):
            schema |= {"minItems": rule.low, "maxItems": rule.high}
    return schema


def _reference(record: type[Record], definitions: dict[str, Any]) -> dict[str, Any]:
    name = record.__name__
    if name not in definitions:
        definitions[name] = {}  # its own place, should a record hold itself
        properties = {}
        for of, said in record.fields().items():
            default = {} if said.default is inspect.Parameter.empty else {"default": _plain(said.default)}
            schema = json_schema(said.form, definitions) | dict(said.extra)
            properties[of] = _sorted({**schema, "description": said.description, **default})
        required = [of for of, said in record.fields().items() if said.required]
        definitions[name] = {
            **({} if record.others else {"additionalProperties": False}),
            "description": inspect.cleandoc(record.__doc__ or ""),
            "properties": properties,
            **({"required": required} if required else {}),
            "type": "object",
        }
    return {"$ref": f"#/$defs/{name}"}


def _sorted(node: Any) -> Any:
    if isinstance(node, dict):
        return {name: _sorted(node[name]) for name in sorted(node)}
    return [_sorted(one) for one in node] if isinstance(node, list) else node
