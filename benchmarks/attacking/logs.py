"""Damaged logs of every kind: random bytes, and single values, messages, metadata and attachments."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import yaml
from attacking.measured import Attack, Row, commanded, measured
from google.protobuf.message import Message as ProtobufMessage
from kinds import FAST, MULTI
from mcap import records
from store.conftest import record_names, rewritten
from store.forgeries import FORGERIES, Forgery

import pushplan
import pushplan.logging.schemas as schemas
from pushplan.closed_loop import run_closed_loop
from pushplan.errors import RunLogError
from pushplan.logging.reader import load_run
from pushplan.plans.robustness import TrialUncertainty
from pushplan.scenario.file import example_text, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.trial import write_trial

SLIPPERY = TrialUncertainty(contact_friction=0.6, load=0.3, position=2e-3)


def sound(folder: Path) -> dict[str, Path]:
    """Return a sound log of every kind, written once for a folder."""
    logs = {
        name: folder / f"sound-{name}.mcap"
        for name in ("push", "several-pushes", "rearrangement", "closed-loop", "trial", "trials")
    }
    if all(path.exists() for path in logs.values()):
        return logs
    plain, options = pushplan.load_scenario("two-crates"), {"seed": 1, "first": True, "time_limit": 60.0}
    run = pushplan.run(plain, log=logs["push"], **options)  # type: ignore[arg-type]
    several = pushplan.scenario_from_text(MULTI)
    pushplan.run(several, log=logs["several-pushes"], **options)  # type: ignore[arg-type]
    apart = pushplan.scenario_from_text(FAST["rearrangement"])
    pushplan.run(apart, log=logs["rearrangement"], **options)  # type: ignore[arg-type]
    run_closed_loop(_short(), disturbances=[Disturbance(1.0, 1, 0.0, -5e-3, 0.05)], log=logs["closed-loop"])
    trials = pushplan.trial(run.plan, 3, uncertainty=SLIPPERY, seed=3, log=logs["trials"])
    write_trial(trials, trials.worst, logs["trial"])
    for path in logs.values():
        assert pushplan.verify_log(path).matches, path
    return logs


def _short() -> Scenario:
    """Return a push of 3 s, because the verification of a closed loop repeats all of its control."""
    stated = yaml.safe_load(example_text("free-space"))
    return scenario_from_document({**stated, "goal": {"pose": [0.5, 0.1, "15 deg"], "of": "far"}})


def mutations(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Attack]]:
    """Yield logs with bits flipped, pieces left out, repeated or overwritten, or cut off."""
    logs = sound(folder)
    data = {kind: path.read_bytes() for kind, path in logs.items()}
    for k in range(count):
        kind, key = list(logs)[k % len(logs)], f"{seed}-mutation-{k}"
        yield (
            key,
            lambda kind=kind, key=key: {  # type: ignore[misc]
                "group": kind,
                **measured(partial(_taken, mutated(data[kind], Random(key)))),
            },
        )


def mutated(log: bytes, random: Random) -> bytes:
    """Return a log with one to four pieces altered; every fourth has a single bit flipped."""
    made = bytearray(log)
    if random.random() < 0.25:
        made[random.randrange(len(made))] ^= 1 << random.randrange(8)
        return bytes(made)
    for _ in range(random.randint(1, 4)):
        at, size = random.randrange(len(made)), random.randint(1, 64)
        match random.choice(("flip", "drop", "repeat", "overwrite", "cut")):
            case "flip":
                made[at] ^= 1 << random.randrange(8)
            case "drop":
                del made[at : at + size]
            case "repeat":
                made[at:at] = made[at : at + size]
            case "overwrite":
                made[at : at + size] = random.randbytes(size)
            case "cut":
                del made[max(at, 1) :]
    return bytes(made)


WORDS = {0: "harmless", 2: "refused as damaged (2)", 4: "a mismatch (4)"}


def _taken(data: bytes, folder: Path) -> Row:
    """Verify a log by the command, and recover it."""
    path = folder / "evil.mcap"
    path.write_bytes(data)
    code, _, err = commanded(["replay", str(path), "--verify", "--json"])
    if code not in WORDS:
        return {"verdict": "WRONG", "why": f"exit code {code}: {err[-600:]}"}
    try:
        load_run(path, recover=True)
    except RunLogError:
        return {"verdict": WORDS[code]}
    return {"verdict": WORDS[code] + ("" if code == 0 else ", recovered in part")}


def tampering(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Attack]]:
    """Yield sound files with a value changed, a record dropped or repeated: each topic, metadata and attachment."""
    logs = sound(folder)
    groups = []
    for kind, path in logs.items():
        alike: dict[str, list[Any]] = {}
        for name, found in record_names(path).items():
            alike.setdefault(re.sub(r"\d+", "N", name), []).extend(found)
        for name, found in alike.items():
            hows = ("changed",) if name in ("schema", "channel") else ("changed", "dropped", "repeated")
            groups += [(kind, name, found, how) for how in hows]
    for k in range(count):
        kind, name, found, how = groups[k % len(groups)]
        key = f"{seed}-tampering-{k}"
        yield key, partial(_tampered, logs[kind], kind, name, found, how, key)


def _tampered(log: Path, kind: str, name: str, found: list[Any], how: str, key: str) -> Row:
    random = Random(key)
    victim = random.choice(found)
    instead, what = _instead(victim, name, how, random)
    if not what:
        return {"group": kind, "verdict": "nothing to change", "seconds": 0.0, "mb": 0.0}

    def work(folder: Path) -> Row:
        done: list[int] = []

        def edit(record: Any) -> Iterator[Any]:
            if not done and record == victim:
                done.append(1)
                yield from instead
            else:
                yield record

        path = rewritten(log, folder / "altered.mcap", edit)
        assert done
        code, _, err = commanded(["replay", str(path), "--verify", "--json"])
        if code in (2, 4):
            return {"verdict": f"{how}: {WORDS[code]}"}
        return {"verdict": "WRONG", "why": f"{name}: {what}: exit code {code} {err[-400:]}"}

    return {"group": kind, "what": f"{name} {what}", **measured(work)}


def forgeries(count: int) -> Iterator[tuple[str, Attack]]:
    """Yield forged logs: plans that are invalid in the stated scenario, or wrong numbers."""
    for forgery in FORGERIES[:count]:
        key = f"{forgery.kind}: {forgery.name}"
        yield key, lambda forgery=forgery: {"group": forgery.kind, **measured(partial(_forged, forgery))}  # type: ignore[misc]


def _forged(forgery: Forgery, folder: Path) -> Row:
    path = folder / "forged.mcap"
    forgery.write(path)
    code, _, err = commanded(["replay", str(path), "--verify", "--json"])
    if code == 0:
        return {"verdict": "WRONG", "why": "confirmed"}
    return (
        {"verdict": WORDS[code]} if code in WORDS else {"verdict": "WRONG", "why": f"exit code {code}: {err[-600:]}"}
    )


def _instead(victim: Any, name: str, how: str, random: Random) -> tuple[list[Any], str]:
    """Return the replacement of a record and its description, which is empty for an empty record."""
    if how != "changed":
        return [victim, victim] if how == "repeated" else [], how
    if isinstance(victim, records.Metadata):
        words = dict(victim.metadata)
        word = random.choice(sorted(words))
        words[word] = random.choice((words[word] + "1", words[word][:-1], ""))
        if words == victim.metadata:
            words[word] = "x"
        return [replace(victim, metadata=words)], f"{word} = {words[word]!r:.60}"
    if isinstance(victim, records.Attachment):
        data = bytearray(victim.data)
        at = random.randrange(len(data))
        data[at] ^= 1 << random.randrange(8)
        return [replace(victim, data=bytes(data))], f"byte {at}"
    if isinstance(victim, records.Schema):
        return [replace(victim, data=victim.data + bytes(2))], "declaration"
    if isinstance(victim, records.Channel):
        return [replace(victim, metadata={"by": "somebody"})], "declaration"
    if random.random() < 0.2:
        word = random.choice(("log_time", "publish_time", "sequence"))
        return [replace(victim, **{word: getattr(victim, word) + random.choice((1, 10**6))})], word
    kind = next(topic.message for topic in schemas.TOPICS if topic.name == name)
    message = kind.FromString(victim.data)
    leaves = [*_leaves(message)]
    if not leaves:
        return [victim], ""
    holder, field, k = random.choice(leaves)
    old = getattr(holder, field) if k is None else getattr(holder, field)[k]
    new = _other(old, random)
    if k is None:
        setattr(holder, field, new)
    else:
        getattr(holder, field)[k] = new
    data = message.SerializeToString()
    return [replace(victim, data=data)], "" if data == victim.data else f"{field}: {old!r:.40} -> {new!r:.40}"


def _leaves(message: Any) -> Iterator[tuple[Any, str, int | None]]:
    for field, value in message.ListFields():
        if isinstance(value, str | bytes | int | float | ProtobufMessage):
            if isinstance(value, ProtobufMessage):
                yield from _leaves(value)
            else:
                yield message, field.name, None
            continue
        for k, member in enumerate(value):
            if isinstance(member, ProtobufMessage):
                yield from _leaves(member)
            else:
                yield message, field.name, k


def _other(old: Any, random: Random) -> Any:
    if isinstance(old, str):
        return old + "x"
    if isinstance(old, bool):
        return not old
    if isinstance(old, int):
        return old + 1
    # Above what counts as rounding, 1e-9 of a number or of 1.
    return 0.5 if old != old else old + max(1.0, abs(old)) * random.choice((1e-8, 1e-4, 1.0))
