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
from attacking.measured import Attacks, Row, commanded, judged, measured, wrong
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
from pushplan.plans.run import Run
from pushplan.scenario.file import example_text, scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.sim.control.simulated_push import Disturbance
from pushplan.trial import write_trial

KINDS = ("push", "several-pushes", "rearrangement", "closed-loop", "trial", "trials")
SLIPPERY = TrialUncertainty(contact_friction=0.6, load=0.3, position=2e-3)
DAMAGED = {2: "refused as damaged (2)", 4: "a mismatch (4)"}


def sound(folder: Path) -> dict[str, Path]:
    """Return a sound log of every kind, written once for a folder."""
    logs = {kind: folder / f"sound-{kind}.mcap" for kind in KINDS}
    if all(path.exists() for path in logs.values()):
        return logs

    def recorded(kind: str, scenario: Scenario) -> Run:
        return pushplan.run(scenario, log=logs[kind], seed=1, first=True, time_limit=60.0)

    run = recorded("push", pushplan.load_scenario("two-crates"))
    recorded("several-pushes", scenario_from_text(MULTI))
    recorded("rearrangement", scenario_from_text(FAST["rearrangement"]))
    # A push of 3 s, because the verification of a closed loop repeats all of its control.
    goal = {"pose": [0.5, 0.1, "15 deg"], "of": "far"}
    short = scenario_from_document({**yaml.safe_load(example_text("free-space")), "goal": goal})
    run_closed_loop(short, disturbances=[Disturbance(1.0, 1, 0.0, -5e-3, 0.05)], log=logs["closed-loop"])
    trials = pushplan.trial(run.plan, 3, uncertainty=SLIPPERY, seed=3, log=logs["trials"])
    write_trial(trials, trials.worst, logs["trial"])
    for path in logs.values():
        assert pushplan.verify_log(path).matches, path
    return logs


def mutations(folder: Path, count: int, seed: int) -> Attacks:
    """Yield logs with bits flipped, pieces left out, repeated or overwritten, or cut off."""
    logs = sound(folder)
    for k in range(count):
        kind, key = KINDS[k % len(KINDS)], f"{seed}-mutation-{k}"
        yield key, partial(measured, partial(_mutated, logs[kind], key), group=kind)


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


def _mutated(log: Path, key: str, folder: Path) -> Row:
    """Verify a mutated log by the command, and recover it."""
    path = folder / "evil.mcap"
    path.write_bytes(mutated(log.read_bytes(), Random(key)))
    code, _, err = commanded("replay", path, "--verify", "--json")
    row = judged(code, err, {0: "harmless", **DAMAGED})
    try:
        load_run(path, recover=True)
    except RunLogError:
        return row
    return {**row, "verdict": row["verdict"] + ", recovered in part" * (code in DAMAGED)}


def tampering(folder: Path, count: int, seed: int) -> Attacks:
    """Yield sound files with a value changed, a record dropped or repeated: each topic, metadata and attachment."""
    logs, groups = sound(folder), []
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
        yield key, partial(measured, partial(_tampered, logs[kind], name, found, how, key), group=kind)


def _tampered(log: Path, name: str, found: list[Any], how: str, key: str, folder: Path) -> Row:
    random, done = Random(key), list[int]()
    victim = random.choice(found)
    instead, what = _instead(victim, name, how, random)
    if not what:
        return {"verdict": "nothing to change"}

    def edit(record: Any) -> Iterator[Any]:
        if not done and record == victim:
            done.append(1)
            yield from instead
        else:
            yield record

    path = rewritten(log, folder / "altered.mcap", edit)
    assert done
    code, _, err = commanded("replay", path, "--verify", "--json")
    return {"what": f"{name} {what}", **judged(code, err, {code: f"{how}: {word}" for code, word in DAMAGED.items()})}


def forgeries(folder: Path, count: int, seed: int) -> Attacks:
    """Yield forged logs: plans that are invalid in the stated scenario, or wrong numbers."""
    for forgery in FORGERIES[:count]:
        yield f"{forgery.kind}: {forgery.name}", partial(measured, partial(_forged, forgery), group=forgery.kind)


def _forged(forgery: Forgery, folder: Path) -> Row:
    forgery.write(folder / "forged.mcap")
    code, _, err = commanded("replay", folder / "forged.mcap", "--verify", "--json")
    return judged(code, err, DAMAGED) if code else wrong("confirmed")


def _instead(victim: Any, name: str, how: str, random: Random) -> tuple[list[Any], str]:
    """Return the replacement of a record and its description, which is empty for an empty record."""
    if how != "changed":
        return [victim, victim] if how == "repeated" else [], how
    if isinstance(victim, records.Metadata):
        word = random.choice(sorted(victim.metadata))
        old = victim.metadata[word]
        new = random.choice((old + "1", old[:-1], ""))
        new = "x" if new == old else new
        return [replace(victim, metadata={**victim.metadata, word: new})], f"{word} = {new!r:.60}"
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
    return _other_message(victim, name, random)


def _other_message(victim: Any, name: str, random: Random) -> tuple[list[Any], str]:
    """Return a message with one value changed, and what was changed."""
    message = next(topic.message for topic in schemas.TOPICS if topic.name == name).FromString(victim.data)
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
    """Yield holder, field and index (None for a single value) of every value in a message."""
    for field, value in message.ListFields():
        single = isinstance(value, str | bytes | int | float | ProtobufMessage)
        for k, member in [(None, value)] if single else enumerate(value):
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
