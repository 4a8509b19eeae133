"""What a log says about itself, beside the plan and the execution."""

from __future__ import annotations

from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun


def summary(run: RecordedRun) -> list[tuple[str, str]]:
    """Return labels and values: outcome, when and with what the run was made, and what of the log is lost."""
    words = run.words.get(metadata.RUN, {})
    rows = [("outcome", run.outcome)]
    error = run.words.get(metadata.RESULT, {}).get("error")
    rows += [("error", error)] if error else []
    rows += [("started", words["started_at"])] if "started_at" in words else []
    rows.append(
        (
            "written by",
            f"pushplan {words.get('version.pushplan', '?')}, log format {words.get('format', '?')}",
        )
    )
    rows.append(("machine", words.get("machine", "?")))
    if run.execution is not None:
        contacts = run.execution.margins.shape[1]
        rows.append(("samples", f"{len(run.execution.t)} of {contacts} contacts"))
    if run.plan is not None and metadata.PLANNING not in run.words:
        rows.append(
            ("plan", "the best path that the log holds, timed and executed anew: the run was cut off before")
        )
    warnings = [line for line in run.lines if line.level not in ("debug", "info")]
    rows += [(line.level, f"{line.time:.3f} s: {line.text}") for line in warnings]
    earlier = run.words.get(metadata.RECOVERY, {})
    rows += [("recovered from", earlier["from"])] if "from" in earlier else []
    lost = (loss for key, loss in sorted(earlier.items()) if key.startswith("lost_"))
    rows += [("lost before", loss) for loss in lost]
    return rows + [("lost", loss) for loss in run.losses]
