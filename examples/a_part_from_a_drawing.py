"""Take the outline of an L-shaped part from an SVG drawing, and ask which pushes keep it on the plate."""

from pathlib import Path

import pushplan
from pushplan.scenario.builders import build_scenario, plate, polygon
from pushplan.scenario.drawings import read_svg_outlines

Path("part.svg").write_text("""\
<svg xmlns="http://www.w3.org/2000/svg" width="200mm" height="200mm" viewBox="0 0 200 200">
  <path id="bracket" d="M 0 0 L 60 0 L 60 140 Q 60 160 80 160 L 160 160 L 160 200 L 0 200 Z"/>
</svg>""")
outline = read_svg_outlines("part.svg")["bracket"]  # its centroid is its origin, y is up
scenario = build_scenario(
    "bracket", [polygon("bracket", outline, mass=1.5)], plate(0.3, 0.5), goal=(1.0, 0.5, 0.5), floor_friction=0.3
)
radii = pushplan.stable_set(scenario.chain).turning_radii()
print(f"{len(outline)} corners; tightest turns: left {radii.left:.3f} m, right {radii.right:.3f} m")
