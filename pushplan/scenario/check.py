"""Whether a scenario's chain can be pushed at all: the check of the stable set, which takes longer than reading."""

from __future__ import annotations

from pushplan.errors import Finding, PushplanError
from pushplan.mechanics.chain import PLATE
from pushplan.scenario.model import Scenario
from pushplan.scenario.yaml.report import Report
from pushplan.scenario.yaml.tree import read_document
from pushplan.sets.stable_set import StableSet
from pushplan.sets.weakest import emptiness
from pushplan.util.names import AUTO, KNOWN_LOAD_SETS, STABLE_SETS


def check_scenario(scenario: Scenario) -> tuple[Finding, ...]:
    """Return what `load_scenario` leaves out because it takes longer: whether the stable set is empty.

    The set is that of `scenario.stability`; one that needs loads which the scenario does not state is a finding too.
    """
    report = Report(read_document(scenario.source))
    unknown = [obj.name for obj in scenario.chain.objects if not obj.support.known]
    if unknown and scenario.stability.set in KNOWN_LOAD_SETS:
        report.add(("stability", "set"), _needs_loads(scenario.stability.set, unknown))
        return report.findings
    needed = _numbers_needed(scenario)
    if needed:
        report.add(("uncertainty",), needed)
        return report.findings
    if (
        scenario.pushes is not None
    ):  # the contact that the file states is only one of those that may be chosen
        return report.findings
    try:
        stable = scenario.stable_set()
        margin = scenario.stability.margin
        _check_not_empty(stable, 0.0 if margin == AUTO else margin, report)
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


def _numbers_needed(scenario: Scenario) -> str:
    """Return why `uncertainty` does not go with a push above the floor, or nothing when it does."""
    height, name = scenario.chain.pusher.contact_height, scenario.stability.set
    shares = {"floor_friction": scenario.uncertainty.floor_friction} if name in ("ecof", "robust") else {}
    if name == "ecof":
        shares["load"] = scenario.uncertainty.load
    barred = [key for key, share in shares.items() if share > 0.0]
    if height == 0.0 or not barred:
        return ""
    return (
        f"pusher.contact_height is {height:.6g} m, and a push above the floor shifts the loads by their floor "
        f"friction: the set '{name}' needs numbers for {' and '.join(barred)}; "
        f"leave {'it' if len(barred) == 1 else 'them'} out "
        "(contact_friction may stay) and ask for a larger stability.margin, or set contact_height: 0"
    )


def _check_not_empty(stable: StableSet, minimum: float, report: Report) -> None:
    what, contact = emptiness(stable, minimum)
    if contact is not None:
        on_plate = stable.chain.contacts[contact].pusher == PLATE
        report.add(("pusher", "friction") if on_plate else ("contacts",), what)
    elif what:
        report.add(("stability", "margin"), what)
