"""Whether a scenario's chain can be pushed at all: the check of the stable set, which takes longer than reading."""

from __future__ import annotations

import numpy as np

from pushplan.chain import PLATE, Chain
from pushplan.errors import Finding, PushplanError
from pushplan.names import KNOWN_LOAD_SETS, STABLE_SETS
from pushplan.report import Report
from pushplan.scenario import Scenario
from pushplan.stable_set import StableSet, stable_set
from pushplan.yaml_tree import read_document


def check_scenario(scenario: Scenario) -> tuple[Finding, ...]:
    """Return what is wrong with the stable set of a scenario; see `pushplan.scenario.check_scenario`."""
    report = Report(read_document(scenario.source))
    unknown = [obj.name for obj in scenario.chain.objects if not obj.support.known]
    if unknown and scenario.stability.set in KNOWN_LOAD_SETS:
        report.add(("stability", "set"), _needs_loads(scenario.stability.set, unknown))
        return report.findings
    try:
        stable = stable_set(scenario.chain, scenario.stability.set)
        _check_not_empty(stable, scenario.stability.margin, report)
    except PushplanError as error:
        report.add(("stability", "set"), str(error))
    return report.findings


def _needs_loads(name: str, unknown: list[str]) -> str:
    others = ", ".join(other for other in STABLE_SETS if other not in KNOWN_LOAD_SETS)
    objects = ", ".join(f"'{other}'" for other in unknown)
    return (
        f"'{name}' needs to know how loads rest on the floor, which is not stated for {objects}; "
        f"allowed: {others}, or a support with known loads"
    )


def _check_not_empty(stable: StableSet, minimum: float, report: Report) -> None:
    twists, margins = stable.peaks
    best = float(margins.max(initial=-1.0))
    if best > minimum:
        return
    if best > 0.0:
        what = f"no push has a margin above {minimum:.3g}; the largest is {best:.3g}; allowed: less than that"
        report.add(("stability", "margin"), what)
        return
    at_best = f" (the best misses by a margin of {-best:.3g})" if len(margins) else ""
    weakest = 0 if not len(margins) else int(np.argmin(stable.contact_margins(twists[[margins.argmax()]])[0]))
    names, place = _contact(stable.chain, weakest)
    what = f"the stable set is empty: no push keeps {names} together with the rest{at_best}"
    report.add(place, f"{what}; allowed: more friction there, a wider contact, or fewer objects")


def _contact(chain: Chain, index: int) -> tuple[str, tuple[str, ...]]:
    """Return what messages call the two bodies of a contact, and where their friction is stated."""
    contact = chain.contacts[index]
    pushed = f"'{chain.objects[contact.pushed].name}'"
    if contact.pusher == PLATE:
        return f"{pushed} on the plate", ("pusher", "friction")
    return f"{pushed} on '{chain.objects[contact.pusher].name}'", ("contacts",)
