"""Race a planner of your own, an RRT that looks for the nearest of a few nodes only, against pushplan's."""

from ompl import base, control, util

import pushplan


class LazyRRT(base.Planner):
    """RRT whose nodes are states and the arcs that led there from the start."""

    def __init__(self, information):
        super().__init__(information, "lazy-rrt")
        self.information, self.tree, self.random = information, [], util.RNG()

    def clear(self):
        super().clear()
        self.tree = []

    def solve(self, stop):
        info, problem = self.information, self.getProblemDefinition()
        states, controls, sample = info.allocStateSampler(), info.allocControlSampler(), info.allocState()
        if not self.tree:
            self.tree.append((info.cloneState(self.getPlannerInputStates().nextStart()), ()))
        while not stop():
            states.sampleUniform(sample)
            few = [self.tree[self.random.uniformInt(0, len(self.tree) - 1)] for _ in range(20)]
            state, way = min(few, key=lambda node: info.distance(node[0], sample))
            arc, end = info.allocControl(), info.allocState()
            controls.sample(arc)
            if info.propagateWhileValid(state, arc, 1, end) == 1:
                self.tree.append((end, (*way, (state, arc))))
                if problem.getGoal().isSatisfied(end):  # a word of stable arcs leads from here to the goal
                    path = control.PathControl(info)
                    for before, arc in self.tree[-1][1]:
                        path.append(before, arc, 1.0)
                    path.append(end)
                    problem.addSolutionPath(path, False, 0.0, self.getName())
                    return base.PlannerStatus(base.PlannerStatus.EXACT_SOLUTION)
        return base.PlannerStatus(base.PlannerStatus.TIMEOUT)


for planner in (LazyRRT, "auto") if __name__ == "__main__" else ():
    print(planner, pushplan.plan(pushplan.load_scenario("two-crates"), planner=planner).improvements[-1])
