"""Take obstacles from a ROS map (here drawn by this script) and push a table through the door."""

from pathlib import Path

import numpy as np
from PIL import Image

import pushplan
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.maps import read_ros_map

FREE, WALL, UNKNOWN = 254, 0, 205
cells = np.full((100, 160), FREE, np.uint8)  # 5 m x 8 m, row 0 is at the top
cells[[0, -1], :] = cells[:, [0, -1]] = cells[:60, 80:83] = WALL  # a wall with a door at its lower end
cells[:20, 120:] = UNKNOWN
Image.fromarray(cells).save("room.pgm")
Path("room.yaml").write_text("image: room.pgm\nresolution: 0.05\norigin: [-1.0, -1.5, 0.0]\nnegate: 0\n")

room = read_ros_map("room.yaml")
feet = [[x, y, 0.25] for x in (-0.25, 0.25) for y in (-0.35, 0.35)]
scenario = build_scenario(
    "room",
    [box("table", 0.6, 0.8, mass=18.0, support={"feet": feet})],
    plate(0.8, friction=0.6),
    goal=(5.0, 1.0, np.pi / 2),
    floor_friction=0.3,
    obstacles=room.obstacles,
    workspace={"x": [room.workspace.xmin, room.workspace.xmax], "y": [room.workspace.ymin, room.workspace.ymax]},
)
run = pushplan.run(scenario, time_limit=2.0)
print(f"{len(room.obstacles)} obstacles; {run.plan.path.cost:.2f} m to the goal")
pushplan.plot_plan(run.plan, "room.png")
