"""Encoding of plans, executions and related records as attachments of a log, every number bit for bit, and back.

An attachment is the line `pushplan-arrays/1 SIZE`, a line of JSON, and the numbers of all arrays, SIZE bytes, as one
zstd frame. The JSON has `value` and `arrays`, the type and shape of each array in NumPy's notation. In `value` an
array is `{"array": index}`, an object `{"type": name, field: value, ...}`, a mapping `{"mapping": {...}}`, and a
number that is not finite `{"number": "nan" | "inf" | "-inf"}`. The frame has byte 0 of every number of an array, then
byte 1 of every number, and so on (like Parquet's BYTE_STREAM_SPLIT), because neighbours share their high bytes.

A load is written as its objects, the face and offset at which the plate pushes them, and the poses of plate (3,),
objects (n, 3) and contacts (n, 2, 2) in the contact frame, with the contacts' friction. These differ from the
scenario if a closed loop plans for a measured chain with caution. Everything else comes from the scenario.
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
from pushplan.mechanics.faces import face_pairs, pushed_at, pusher_at
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
"""Types of objects in attachments."""

_LEFT_OUT = {"Plan": {"scenario", "execution", "improvements"}}
"""Fields that are stored elsewhere."""

_NUMBERS = ("<f8", "<i8", "|b1")
"""Types of arrays."""

_MEMORY = 24
"""Largest memory of each byte of JSON after decoding, bytes."""


class CodecError(PushplanError, ValueError):
    """Raised when bytes do not come from `encode`."""


def encode(value: object) -> bytes:
    """Return a value as an attachment: numbers, texts, arrays, sequences, mappings, and the types above."""
    arrays: list[NDArray[Any]] = []
    tree = _plain(value, arrays)
    types = {"f": "<f8", "i": "<i8", "u": "<i8", "b": "|b1"}
    kept = [np.asarray(array, dtype=types[array.dtype.kind]) for array in arrays]
    data = b"".join(_planes(array) for array in kept)
    layouts = [[array.dtype.str, list(array.shape)] for array in kept]
    head = json.dumps({"value": tree, "arrays": layouts}, separators=(",", ":"))
    return _HEAD + b"%d\n" % len(data) + head.encode() + b"\n" + zstandard.compress(data)


def _planes(array: NDArray[Any]) -> bytes:
    """Return the bytes of an array (m, ...), column by column, split into byte planes."""
    if not array.size:
        return b""
    columns = np.ascontiguousarray(array.reshape(len(array) if array.ndim else 1, -1).T)
    return columns.view(np.uint8).reshape(-1, array.itemsize).T.tobytes()


def _array(data: bytes, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the read-only array from the bytes of `_planes`."""
    width, rows = np.dtype(dtype).itemsize, shape[0] if shape else 1
    if not math.prod(shape):
        return np.zeros(shape, dtype=dtype)
    numbers = np.ascontiguousarray(np.frombuffer(data, dtype=np.uint8).reshape(width, -1).T).view(dtype)
    found = np.ascontiguousarray(numbers.reshape(-1, rows).T).reshape(shape)
    found.setflags(write=False)
    return found


def _plain(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return a value as plain data for JSON; its arrays are appended to `arrays`."""
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
        raise TypeError(f"an attachment cannot hold a {name}")
    names = [field.name for field in fields(value) if field.name not in _LEFT_OUT.get(name, ())]
    return {"type": name, **{name: _plain(getattr(value, name), arrays) for name in names}}


def _parts(data: bytes) -> tuple[int, bytes, bytes]:
    """Return the size of the arrays, the line of JSON, and the zstd frame of an attachment."""
    first = data.find(b"\n", 0, 64)
    line = data.find(b"\n", first + 1, first + 1 + _JSON_LIMIT)
    size = data[len(_HEAD) : first]
    if first < 0 or line < 0 or not data.startswith(_HEAD) or not size.isdigit():
        raise CodecError("an attachment of another kind, or of another version of pushplan")
    return int(size), data[first + 1 : line], data[line + 1 :]


def memory(data: bytes) -> int:
    """Return an upper bound of the memory of a decoded attachment, bytes.

    Raises:
        CodecError: If `encode` has not written it.
    """
    size, head, _ = _parts(data)
    return 2 * size + _MEMORY * len(head)


def decode(data: bytes, scenario: Scenario) -> Any:
    """Return the value of an attachment; sequences become tuples, arrays are read-only.

    Args:
        data: Attachment.
        scenario: Scenario of the run, for its loads and plans.

    Raises:
        CodecError: If `encode` has not written the bytes, or a value does not fit its type.
        PushplanError: If an object cannot have its fields.
    """
    size, head, frame = _parts(data)
    try:
        if zstandard.frame_content_size(frame) != size:
            raise CodecError(f"an attachment claims {size} bytes of arrays, but its data have another size")
        numbers = zstandard.ZstdDecompressor().decompress(frame, max_output_size=size) if size else b""
        document = json.loads(head)
        return _Decoder(_arrays(numbers, document["arrays"]), scenario).value(document["value"])
    except PushplanError:
        raise
    except (ValueError, LookupError, TypeError, RecursionError, OverflowError, zstandard.ZstdError) as error:
        raise CodecError(f"a damaged attachment ({type(error).__name__}: {error})") from error


def _arrays(data: bytes, layouts: list[list[Any]]) -> list[NDArray[Any]]:
    found, at = [], 0
    for dtype, sides in layouts:
        shape = tuple(sides)
        if dtype not in _NUMBERS or len(shape) > 4 or not all(type(n) is int and n >= 0 for n in shape):
            raise CodecError(f"an array has the invalid type {dtype!r} or shape {shape}")
        end = at + math.prod(shape) * np.dtype(dtype).itemsize
        if end > len(data):
            raise CodecError(f"an array of shape {shape} is cut off")
        found.append(_array(data[at:end], dtype, shape))
        at = end
    return found


class _Decoder:
    """Decoder of plain data."""

    def __init__(self, arrays: list[NDArray[Any]], scenario: Scenario) -> None:
        self._arrays, self._scenario = arrays, scenario

    def value(self, plain: Any) -> Any:
        """Return the value from the result of `_plain`."""
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
    """Return the load of some objects of a scenario for a face and an offset; equal arguments give the same object.

    Args:
        scenario: Scenario with the objects.
        names: Names of the objects, from the plate outward.
        face: Face of the first object that the plate pushes.
        offset: Offset of the plate on this face, m.
        faces: Pushed face of each object of a row.

    Raises:
        PushplanError: If there is no such load.
    """
    known: dict[_Key, Load] = vars(scenario).setdefault("_loads_of_logs", {})  # loads cache their stable sets
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
        else:  # the initial load, near which the plate stands without a face
            load = Load.of(base)
            load = replace(load, links=tuple(replace(link, face="", offset=0.0) for link in load.links))
    if load.names != names:
        raise CodecError(f"no load of the scenario is {', '.join(names)}")
    return load


def _in_row(scenario: Scenario, names: tuple[str, ...], faces: tuple[str, ...], offset: float) -> Load:
    """Return the load of objects in a row.

    A measured load of a closed loop names faces in its own frame. If an object has no face of this name, any face is
    used, because the log has the poses of all bodies.
    """
    members = []
    for name, face in zip(names, faces, strict=True):
        own = [
            way for way in face_pairs(scenario.task.by_name[name].chain.objects[0].outline) if way.across is not None
        ]
        known = [way.face for way in own]
        members.append((name, face if face in known or not known else known[0]))
    load = row_load(scenario, tuple(members))
    links = (replace(link, face=face) for link, face in zip(load.links, faces, strict=True))
    first, *others = links
    return Load((replace(first, offset=offset), *others), load.problem, load.sets)


def _placed(load: Load, plate: FloatArray, places: FloatArray, ends: FloatArray, friction: FloatArray) -> Load:
    """Return a load with plate (3,), objects (n, 3), contacts (n, 2, 2) and their friction (n,) from a log.

    If these equal the scenario's up to rounding, the load itself is returned.
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
    """Return whether a value fits the annotation of a field."""
    origin, args = get_origin(hint), get_args(hint)
    alias = getattr(origin, "__value__", None)
    if alias is not None:  # NumPy's array types are type aliases from Python 3.12 on
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
