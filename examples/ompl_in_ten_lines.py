"""Run one of OMPL's own control planners on a push: ten lines, and its tools work on what it leaves."""

from ompl import base, control, util

import pushplan
from pushplan.ompl import pose, push_path

util.setLogLevel(util.LOG_WARN)

scenario = pushplan.load_scenario("two-crates")
information, problem = pose(scenario)
planner = control.KPIECE1(information)
planner.setProblemDefinition(problem)
planner.setup()
planner.solve(base.timedPlannerTerminationCondition(5.0))
path = push_path(problem)

tree = base.PlannerData(information)
planner.getPlannerData(tree)
print(problem.getSolutionPath().printAsMatrix())
print(f"{tree.numVertices()} states; {len(path.lengths)} arcs of {path.cost:.2f} m end at {path.end.round(9)}")
