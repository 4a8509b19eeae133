"""What verifying a log comes to, for people and as a JSON object."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from pushplan.cli.terminal.console import Console

if TYPE_CHECKING:
    from pushplan.logging.verify import VerifyReport


def tell_verification(report: VerifyReport, console: Console) -> VerifyReport:
    """Tell what differs, and return the report."""
    if not report.checks:
        console.say("nothing to verify: no plan was found")
    elif report.matches:
        console.say(console.paint(f"verified: all {len(report.checks)} comparisons match", "green"))
    else:
        console.say(console.paint("the log differs from what its scenario and its plan lead to:", "red"))
        for check in report.mismatches:
            console.say(f"  {check.text}")
    return report


def verification(report: VerifyReport) -> dict[str, object]:
    """Return the JSON object of a report."""
    checks = [
        {
            "quantity": check.quantity,
            "matches": check.matches,
            "difference": check.difference if isfinite(check.difference) else None,
            "tolerance": check.tolerance,
            "time": check.time,
            "what": check.what or None,
        }
        for check in report.checks
    ]
    return {"matches": report.matches, "checks": checks}
