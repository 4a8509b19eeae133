"""Push a row of boxes around a wall: a scenario without a file, a plan, and its picture (`row.png`)."""

import numpy as np

import pushplan
from pushplan.scenario.builders import box, build_scenario, plate

boxes = [box(f"box-{i}", length=0.2, width=0.3, mass=2.0) for i in range(3)]
wall = np.array([[1.2, 0.3], [1.35, 0.3], [1.35, 2.0], [1.2, 2.0]])
scenario = build_scenario(
    "row",
    boxes,
    plate(0.4, friction=0.55),
    goal=(2.4, 1.6, np.pi / 2),
    of="box-2",
    floor_friction=0.3,
    contact_friction=0.4,
    obstacles=[wall],
    workspace={"x": [-0.5, 3.5], "y": [-1.0, 2.5]},
    stability={"margin": 0.02},
)

run = pushplan.run(scenario, time_limit=1.0)
print(f"{scenario.name}: {run.plan.path.cost:.2f} m in {run.plan.trajectory.duration:.1f} s")
pushplan.plot_plan(run.plan, "row.png")
