"""Plans, executions and what belongs to them as bytes, every number bit for bit, and back: the attachments of a log.

An attachment is the line `pushplan-arrays/1 SIZE`, a line of JSON, and the numbers of all arrays, SIZE bytes, as one
zstd frame. The JSON has `value` and `arrays`, type and shape of each as NumPy writes them. In `value` an array is
`{"array": index}`, an object `{"type": name, field: value, ...}`, a mapping `{"mapping": {...}}`, and a number that
is not finite `{"number": "nan" | "inf" | "-inf"}`. Inside the frame lie byte 0 of every number of an array, then
byte 1 of every number, and so on (as Parquet's BYTE_STREAM_SPLIT): neighbours share their high bytes.

A load is written as its objects, the face and offset at which the plate pushes them, and where plate, objects and
contacts are in the contact's frame, (3,), (n, 3) and (n, 2, 2), with the contacts' friction: a closed loop plans for
a chain as measured, and with caution. All else of its chain is that of the scenario.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import zstandard
from numpy.typing import NDArray

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.faces import pushed_at, pusher_at, ways_through
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.execution import Execution, StabilityLoss, TrialEnd
from pushplan.plans.load import Load, row_load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Improvement, LazyField, Nearest, Plan
from pushplan.plans.robustness import Robustness
from pushplan.plans.run import Event, Measured, Replan
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

MEDIA_TYPE = "application/x-pushplan-arrays"

_HEAD = b"pushplan-arrays/1 "

_JSON_LIMIT = 4 << 20
"""Longest line of JSON, bytes."""

_TYPES: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        Plan,
        PushPath,
        Trajectory,
        Segment,
        Improvement,
        Diagnosis,
        Nearest,
        Robustness,
        StabilityLoss,
        Event,
        Measured,
        Replan,
        TrialEnd,
    )
}
"""What an attachment may hold."""

_LEFT_OUT = {"Plan": {"scenario", "execution", "improvements"}}
"""Fields that have attachments of their own."""

_NUMBERS = ("<f8", "<i8", "|b1")
"""Types of arrays."""

_MEMORY = 24
"""Bytes of memory that each byte of JSON may take once it is read."""


class CodecError(PushplanError, ValueError):
    """Bytes that are none of what `encode` writes."""


def encode(value: object) -> bytes:
    """Return the attachment that holds a value: numbers, texts, arrays, sequences, mappings, the types above."""
    arrays: list[NDArray[Any]] = []
    tree = _plain(value, arrays)
    types = {"f": "<f8", "i": "<i8", "u": "<i8", "b": "|b1"}
    kept = [np.asarray(array, dtype=types[array.dtype.kind]) for array in arrays]
    data = b"".join(_planes(array) for array in kept)
    told = [[array.dtype.str, list(array.shape)] for array in kept]
    head = json.dumps({"value": tree, "arrays": told}, separators=(",", ":"))
    return _HEAD + b"%d\n" % len(data) + head.encode() + b"\n" + zstandard.compress(data)


def _planes(array: NDArray[Any]) -> bytes:
    """Return the bytes of an array (m, ...): its columns one after another, split into planes."""
    if not array.size:
        return b""
    columns = np.ascontiguousarray(array.reshape(len(array) if array.ndim else 1, -1).T)
    return columns.view(np.uint8).reshape(-1, array.itemsize).T.tobytes()


def _array(data: bytes, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the array, read-only, of which `_planes` returned the bytes."""
    width, rows = np.dtype(dtype).itemsize, shape[0] if shape else 1
    if not math.prod(shape):
        return np.zeros(shape, dtype=dtype)
    numbers = np.ascontiguousarray(np.frombuffer(data, dtype=np.uint8).reshape(width, -1).T).view(dtype)
    found = np.ascontiguousarray(numbers.reshape(-1, rows).T).reshape(shape)
    found.setflags(write=False)
    return found


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return a value as JSON has it; arrays are added to `arrays`."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {"number": repr(float(value))}
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return _plain(value.item(), arrays)
    if isinstance(value, Mapping):
        return {"mapping": {str(key): _plain(one, arrays) for key, one in value.items()}}
    if isinstance(value, Sequence):
        return [_plain(one, arrays) for one in value]
    if isinstance(value, Load):
        chain = value.chain
        ends = np.array([[contact.right, contact.left] for contact in chain.contacts])
        return {
            "type": "Load",
            "names": list(value.names),
            "face": value.face,
            "faces": list(value.faces),
            "offset": value.offset,
            "plate": _plain(chain.pusher.plate_pose, arrays),
            "places": _plain(np.asarray(chain.places), arrays),
            "ends": _plain(ends, arrays),
            "friction": _plain(np.array([contact.friction for contact in chain.contacts]), arrays),
        }
    name = type(value).__name__
    if name not in _TYPES:
        raise TypeError(f"no attachment holds a {name}")
    names = [field.name for field in fields(value) if field.name not in _LEFT_OUT.get(name, ())]
    return {"type": name, **{name: _plain(getattr(value, name), arrays) for name in names}}


def _parts(data: bytes) -> tuple[int, bytes, bytes]:
    """Return the size of the arrays, the line of JSON and the frame of an attachment."""
    first = data.find(b"\n", 0, 64)
    line = data.find(b"\n", first + 1, first + 1 + _JSON_LIMIT)
    size = data[len(_HEAD) : first]
    if first < 0 or line < 0 or not data.startswith(_HEAD) or not size.isdigit():
        raise CodecError("an attachment of another kind, or of another version of pushplan")
    return int(size), data[first + 1 : line], data[line + 1 :]


def memory(data: bytes) -> int:
    """Return the bytes of memory that an attachment may take once it is decoded, whatever it holds.

    Raises:
        CodecError: When it is none of `encode`'s.
    """
    size, head, _ = _parts(data)
    return 2 * size + _MEMORY * len(head)


def decode(data: bytes, scenario: Scenario) -> Any:
    """Return the value that an attachment holds; sequences become tuples, arrays are read-only.

    Args:
        data: The attachment.
        scenario: Of the run: loads are those of its objects, plans are plans of it.

    Raises:
        CodecError: When the bytes are none of `encode`'s, or what they hold fits no type.
        PushplanError: When an object cannot be of its fields.
    """
    size, head, frame = _parts(data)
    try:
        if zstandard.frame_content_size(frame) != size:
            raise CodecError(f"an attachment that states other than the {size} bytes that it holds")
        numbers = zstandard.ZstdDecompressor().decompress(frame, max_output_size=size) if size else b""
        told = json.loads(head)
        return _Decoder(_arrays(numbers, told["arrays"]), scenario).value(told["value"])
    except PushplanError:
        raise
    except (ValueError, LookupError, TypeError, RecursionError, OverflowError, zstandard.ZstdError) as error:
        raise CodecError(f"a damaged attachment ({type(error).__name__}: {error})") from error


def _arrays(data: bytes, told: list[list[Any]]) -> list[NDArray[Any]]:
    found, at = [], 0
    for dtype, sides in told:
        shape = tuple(sides)
        if dtype not in _NUMBERS or len(shape) > 4 or not all(type(n) is int and n >= 0 for n in shape):
            raise CodecError(f"an array of type {dtype!r} and shape {shape}")
        end = at + math.prod(shape) * np.dtype(dtype).itemsize
        if end > len(data):
            raise CodecError(f"an array of shape {shape} is cut off")
        found.append(_array(data[at:end], dtype, shape))
        at = end
    return found


class _Decoder:
    """Makes values of plain data."""

    def __init__(self, arrays: list[NDArray[Any]], scenario: Scenario) -> None:
        self._arrays, self._scenario = arrays, scenario

    def value(self, plain: Any) -> Any:
        """Return the value that `_plain` made plain."""
        if isinstance(plain, list):
            return tuple(self.value(one) for one in plain)
        if not isinstance(plain, dict):
            return plain
        if "array" in plain:
            return self._arrays[plain["array"]]
        if "number" in plain:
            return float(plain["number"])
        if "mapping" in plain:
            return {key: self.value(one) for key, one in plain["mapping"].items()}
        name = plain.pop("type")
        if name == "Load":
            names, faces = tuple(plain["names"]), tuple(plain.get("faces", ()))
            load = load_of(self._scenario, names, plain["face"], plain["offset"], faces)
            return _placed(load, *(self.value(plain[key]) for key in ("plate", "places", "ends", "friction")))
        kind, values = _TYPES[name], {field: self.value(one) for field, one in plain.items()}
        hints = _hints(kind)
        for field, value in values.items():
            if field not in hints or not _fits(value, hints[field]):
                raise CodecError(f"field {field!r} of a {name} cannot be {value!r:.60}")
        if kind is not Plan:
            return kind(**values)
        scenario, segments = self._scenario, values["segments"]
        if segments:
            scenario = scenario.settled(segments[-1].after).without_goals(values.get("undelivered", {}))
        return kind(**values, scenario=scenario)


_Key = tuple[tuple[str, ...], str, float, tuple[str, ...]]


def load_of(
    scenario: Scenario, names: tuple[str, ...], face: str, offset: float, faces: tuple[str, ...] = ()
) -> Load:
    """Return the load of some objects of a scenario, pushed at a place; the same object for the same place.

    Args:
        scenario: With the objects.
        names: Of them, from the plate outward.
        face: Through which the plate pushes the first one.
        offset: Of the plate there, m.
        faces: Through which each one is pushed, where they stand in a row.

    Raises:
        PushplanError: When there is no such load.
    """
    known: dict[_Key, Load] = vars(scenario).setdefault("_loads_of_logs", {})  # each has stable sets of its own
    key = (names, face, offset, faces)
    if key not in known:
        known[key] = _load(scenario, *key)
    return known[key]


def _load(scenario: Scenario, names: tuple[str, ...], face: str, offset: float, faces: tuple[str, ...]) -> Load:
    if scenario.task.held:
        load = Load.of(scenario)
    elif scenario.task.flush and (offset == 0.0 or len(names) > 1):
        load = _in_row(scenario, names, faces, offset)
    else:
        base = scenario if scenario.task.one_load else scenario.alone(names[0])
        if face:
            load = Load.pushed_from(base, pushed_at(base.chain, face, offset), face, offset)
        else:  # near which the plate stands at first, at no face
            load = Load.of(base)
            load = replace(load, links=tuple(replace(link, face="", offset=0.0) for link in load.links))
    if load.names != names:
        raise CodecError(f"no load of the scenario is {', '.join(names)}")
    return load


def _in_row(scenario: Scenario, names: tuple[str, ...], faces: tuple[str, ...], offset: float) -> Load:
    """Return the load of objects in a row.

    A load as measured, which closed loops plan for, names faces by its own frame: where objects have none of that
    name any other one will do, as the log has the places of all bodies.
    """
    members = []
    for name, face in zip(names, faces, strict=True):
        own = [
            way
            for way in ways_through(scenario.task.by_name[name].chain.objects[0].outline)
            if way.across is not None
        ]
        known = [way.face for way in own]
        members.append((name, face if face in known or not known else known[0]))
    load = row_load(scenario, tuple(members))
    links = (replace(link, face=face) for link, face in zip(load.links, faces, strict=True))
    first, *others = links
    return Load((replace(first, offset=offset), *others), load.problem, load.sets)


def _placed(load: Load, plate: FloatArray, places: FloatArray, ends: FloatArray, friction: FloatArray) -> Load:
    """Return a load with plate (3,), objects (n, 3), contacts (n, 2, 2) and their friction (n,) as a log has them.

    It is the load itself where they are where the scenario has them, but for rounding.
    """
    chain = load.chain
    own = np.array([[contact.right, contact.left] for contact in chain.contacts])
    shapes = (plate.shape, places.shape, ends.shape, friction.shape)
    if shapes != ((3,), (len(load.names), 3), own.shape, (len(load.names),)):
        raise CodecError(f"a load of {len(load.names)} objects cannot have places {places.shape}")
    same = (
        np.allclose(plate, chain.pusher.plate_pose, rtol=0.0, atol=1e-12)
        and np.allclose(places, chain.places, rtol=0.0, atol=1e-12)
        and np.allclose(ends, own, rtol=0.0, atol=1e-12)
        and np.allclose(friction, [one.friction for one in chain.contacts], rtol=0.0, atol=1e-12)
    )
    if same:
        return load
    objects = tuple(replace(obj, pose_chain=place) for obj, place in zip(chain.objects, places, strict=True))
    contacts = tuple(
        replace(contact, right=right, left=left, friction=float(mu))
        for contact, (right, left), mu in zip(chain.contacts, ends, friction, strict=True)
    )
    moved = Chain(objects, contacts, pusher_at(chain.pusher, float(plate[1])))
    interval = load.problem.interval
    carried = None if interval is None else interval.carried_by(moved)
    return Load(load.links, load.problem.with_load(chain=moved, interval=carried))


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, localns={**_TYPES, "Execution": Execution, "Load": Load, "Scenario": Scenario})


def _fits(value: Any, hint: Any) -> bool:
    """Tell whether a value may be of a field with that annotation."""
    origin, args = get_origin(hint), get_args(hint)
    alias = getattr(origin, "__value__", None)
    if alias is not None:  # NumPy's arrays are aliases of their own from Python 3.12 on
        return _fits(value, alias[args])
    if origin in (Union, UnionType):
        return any(_fits(value, one) for one in args)
    if origin is LazyField:
        return _fits(value, args[0])
    if origin is tuple:
        rest = args[0] if args[-1] is Ellipsis else None
        if not isinstance(value, tuple) or (rest is None and len(value) != len(args)):
            return False
        kinds = [rest] * len(value) if rest is not None else list(args)
        return all(_fits(one, kind) for one, kind in zip(value, kinds, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return isinstance(value, dict) and all(_fits(one, args[1]) for one in value.values())
    if origin is np.ndarray:
        return isinstance(value, np.ndarray)
    if hint in (None, NoneType):
        return value is None
    if hint is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if hint in (int, bool, str):
        return type(value) is hint
    return is_dataclass(hint) and isinstance(value, hint)  # type: ignore[arg-type]
