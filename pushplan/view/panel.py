"""HTML of the window's panel: the numbers of the plan, or the errors, and the stable set."""

from __future__ import annotations

from html import escape
from math import degrees

import numpy as np
import shapely

from pushplan.drawing.palette import ALONE as GREY
from pushplan.drawing.palette import MARGIN_WORDS, PLATE, SLIPS, TURNS, object_colours
from pushplan.sets.cor import Window
from pushplan.sets.stable_set import StableSet, default_window
from pushplan.util.arrays import FloatArray
from pushplan.view.answers import Answer
from pushplan.view.draft import MOST_DRAGGED, ROBOT, START, Draft

_FINE = 'vector-effect="non-scaling-stroke"'
_STYLE = "padding:0 12px;font-size:13px;line-height:1.45"
_RULES = """<style>
#pushplan-answer { height: calc(9 * 1.45em); overflow-y: auto; overflow-wrap: anywhere; }
[data-mantine-color-scheme="dark"] #pushplan-trouble { filter: brightness(1.5); }
[data-mantine-color-scheme="dark"] .pushplan-set span { filter: brightness(1.6); }
@media (max-width: 576px) { #pushplan-answer { height: calc(4 * 1.45em); } .pushplan-set { display: none; } }
</style>"""
"""The answer has a fixed height, so that nothing below it jumps; it is smaller on phones."""


def help_html(draft: Draft) -> str:
    """Return the line about what the user can drag."""
    what = ["start", "goal"] if START in draft.poses else ["objects", "goals"]
    what += ["robot"] * (ROBOT in draft.poses)
    if 0 < len(draft.original.obstacles) <= MOST_DRAGGED:
        what.append("obstacles")
    slides = ", slide objects along their contacts" if len(draft.slides) else ""
    text = f"Drag {', '.join(what[:-1])} and {what[-1]}, turn them with the arcs{slides}."
    return f'{_RULES}<div style="{_STYLE};color:{GREY}">{text}</div>'


def answer_html(answer: Answer, number: int, milliseconds: float, dropped: bool) -> str:
    """Return the HTML of an answer.

    Args:
        answer: The answer.
        number: Number of the answer; scripts wait for it and the other `data-` attributes.
        milliseconds: Time for the answer, ms.
        dropped: Whether the user has dropped the dragged body.
    """
    data = f'data-number="{number}" data-stage="{answer.stage}" data-dropped="{str(dropped).lower()}"'
    if answer.solved:
        text = _plan(answer, milliseconds)
    else:
        items = "".join(f"<li>{escape(line)}</li>" for line in answer.findings)
        text = f'<b id="pushplan-trouble" style="color:{SLIPS}">no plan</b>'
        text += f'<ul style="margin:0;padding-left:18px">{items}</ul>'
    return f'<div id="pushplan-answer" {data} style="{_STYLE}">{text}</div>'


def _plan(answer: Answer, milliseconds: float) -> str:
    plan = answer.plan
    assert plan is not None
    rows = []
    if plan.path is not None:
        rows.append(("path", f"{plan.path.cost:.3f} m in {len(plan.path.twists)} arcs"))
    else:
        count = len(plan.pushes)
        rows.append(("pushed", f"{plan.pushed_distance:.3f} m in {count} push{'' if count == 1 else 'es'}"))
        for k, push in enumerate(plan.pushes, start=1):
            at = f"{', '.join(push.pushed)} at its {push.pushed_load.face} face"
            rows.append((f"push {k}", f"{at}, {push.cost:.2f} m"))
    if plan.min_margin is not None:
        rows.append(("smallest margin", f"{plan.min_margin:.3f} ({MARGIN_WORDS})"))
    if plan.force_words:
        rows.append(("force", plan.force_words))
    if plan.duration is not None:
        rows.append(("duration", f"{plan.duration:.1f} s"))
    if plan.robustness is not None:
        rows.append(("robustness", plan.robustness_words))
    rows += [("note", note) for note in plan.notes]
    rows.append(("answered in", f"{milliseconds:.0f} ms ({_STAGES[answer.stage]})"))
    return "".join(f"<div><b>{name}</b>: {escape(text)}</div>" for name, text in rows)


_STAGES = {"path": "first plan", "timed": "first plan, timed", "polished": "improved plan"}


def stable_set_html(stable: StableSet | None) -> str:
    """Return an SVG of the stable centres of rotation in the chain frame, with x to the right as in `plot_plan`."""
    if stable is None:
        return ""
    window = default_window(stable.chain, [stable])
    regions = "".join(_region(stable, sense, window) for sense in (+1, -1))
    chain, cone = stable.chain, stable.translation_cone()
    straight = "; no straight push is stable"
    if cone is not None:
        low, high = sorted(degrees(float(np.arctan2(dy, dx))) for dx, dy in cone)
        straight = f"; straight pushes from {low:+.1f} to {high:+.1f} deg"
    fills = [PLATE] * len(chain.carried) + object_colours([obj.name for obj in chain.objects])
    shapes = [
        f'<polygon points="{_points(body.outline)}" fill="{fill}" stroke="#333" stroke-width="1" {_FINE}/>'
        for body, fill in zip(chain.bodies, fills, strict=True)
    ]
    drive, dashes = chain.pusher.drive, 'stroke="currentColor" stroke-width="1" stroke-dasharray="4 2"'
    ends = drive.turning_centres(10.0 * (window[3] - window[1]))
    lines = [f'<polyline points="{_points(each)}" fill="none" {dashes} {_FINE}/>' for each in ends]
    words = f"; dashed: {drive.turning_words}" if drive.turning_words else ""
    xmin, ymin, xmax, ymax = window
    view = f"{xmin:.4g} {-ymax:.4g} {xmax - xmin:.4g} {ymax - ymin:.4g}"
    return (
        f'<div class="pushplan-set" style="{_STYLE}"><b>stable centres of rotation</b> '
        f'(<span style="color:{TURNS[+1]}">left turns</span>, '
        f'<span style="color:{TURNS[-1]}">right turns</span>){straight}{words}'
        f'<svg id="pushplan-set" viewBox="{view}" style="width:100%;max-height:230px">'
        f"{regions}{''.join(lines)}{''.join(shapes)}</svg></div>"
    )


def _region(stable: StableSet, sense: int, window: Window) -> str:
    parts = shapely.get_parts(stable.cor_region(sense, window))
    rings = [ring for part in parts if isinstance(part, shapely.Polygon) for ring in (part.exterior, *part.interiors)]
    data = " ".join(f"M {_points(np.asarray(ring.coords)[:, :2])} Z" for ring in rings)
    return f'<path d="{data}" fill="{TURNS[sense]}" fill-opacity="0.35" fill-rule="evenodd"/>'


def _points(points: FloatArray) -> str:
    return " ".join(f"{x:.4f},{-y:.4f}" for x, y in points)
