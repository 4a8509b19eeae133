"""Fields of dataclasses that are worked out when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class LazyField(Generic[T]):
    """A field that takes a value, or a function without arguments that returns it.

    Args:
        default: Its value where none is given.
    """

    def __init__(self, default: T) -> None:
        self._default = default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> T: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: Any, owner: type) -> T:
        """Return the value; without an instance the default, which is how `dataclass` learns of it."""
        if instance is None:
            return self._default
        values = vars(instance)
        if callable(values[self._name]):
            values[self._name] = values[self._name]()
        value: T = values[self._name]
        return value

    def __set__(self, instance: object, value: T | Callable[[], T]) -> None:
        vars(instance)[self._name] = value
