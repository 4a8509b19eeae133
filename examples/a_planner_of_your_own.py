"""Race a planner of your own, an RRT that looks for the nearest of a few nodes only, against pushplan's."""

import random

from ompl import base, control

import pushplan


class LazyRRT(base.Planner):
    def __init__(self, information):
        super().__init__(information, "lazy-rrt")
        self.information, self.tree, self.random = information, [], random.Random(1)

    def clear(self):
        super().clear()
        self.tree = []

    def solve(self, stop):
        info, problem = self.information, self.getProblemDefinition()
        states, controls, sample = info.allocStateSampler(), info.allocControlSampler(), info.allocState()
        if not self.tree:  # nodes are states, the arcs that led there, and the nodes before
            self.tree.append((info.cloneState(self.getPlannerInputStates().nextStart()), None, None))
        while not stop():
            states.sampleUniform(sample)
            node = min(self.random.choices(self.tree, k=20), key=lambda one: info.distance(one[0], sample))
            arc, end = info.allocControl(), info.allocState()
            controls.sample(arc)
            info.propagate(node[0], arc, 1, end)
            if info.isValid(end):
                self.tree.append((end, arc, node))
                if problem.getGoal().isSatisfied(end):  # a word of stable arcs leads from here to the goal
                    problem.addSolutionPath(self.path_to(self.tree[-1]), False, 0.0, self.getName())
                    return base.PlannerStatus(base.PlannerStatus.EXACT_SOLUTION)
        return base.PlannerStatus(base.PlannerStatus.TIMEOUT)

    def path_to(self, node):
        path, steps = control.PathControl(self.information), [node]
        while steps[-1][2] is not None:
            steps.append(steps[-1][2])
        for before, (_, arc, _) in zip(steps[:0:-1], steps[-2::-1], strict=True):
            path.append(before[0], arc, 1.0)
        path.append(node[0])
        return path


if __name__ == "__main__":
    for name in (LazyRRT, "auto"):
        plan = pushplan.plan(pushplan.load_scenario("two-crates"), planner=name, time_limit=2.0)
        print(
            f"{plan.planner}: first path after {1e3 * plan.first_solution_s:.0f} ms, {plan.path.cost:.3f} m"
        )
