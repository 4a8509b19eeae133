// OMPL's control RRT in C++ with the work that the project does per extension: a random stable arc, a swept collision
// check by conservative advancement, and the cheapest two of all exact words to the goal tried from the arc's end.
//
// Usage: extensions PROBLEM EXTENSIONS SEED rrt|sst|est|kpiece [SECONDS]. With seconds it searches for so long: arcs
// that cannot lead to a better path count as blocked, all but SST are cleared after 2,000, 4,000, 8,000 ... extensions, and
// every improvement is printed: CPU seconds, cost. Reads the arrays that extensions_cpp.py writes (name, rows, columns,
// numbers), prints the CPU seconds per extension, the share of arcs kept and the share of nodes that connect.
#include "push_problem.hpp"

#include <ctime>
#include <iostream>
#include <memory>

#include <ompl/base/spaces/RealVectorStateProjections.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/base/OptimizationObjective.h>
#include <ompl/control/SpaceInformation.h>
#include <ompl/control/planners/est/EST.h>
#include <ompl/control/planners/kpiece/KPIECE1.h>
#include <ompl/control/planners/rrt/RRT.h>
#include <ompl/control/planners/sst/SST.h>
#include <ompl/control/spaces/RealVectorControlSpace.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

namespace ob = ompl::base;
namespace oc = ompl::control;

// Distances in x, y, r cos(theta), r sin(theta); theta and the cost from the start ride along.
class Space : public ob::RealVectorStateSpace {
public:
    Space() : ob::RealVectorStateSpace(6) {}
    double distance(const ob::State *a, const ob::State *b) const override {
        const double *p = a->as<StateType>()->values, *q = b->as<StateType>()->values;
        double sum = 0.0;
        for (int i = 0; i < 4; ++i) sum += (p[i] - q[i]) * (p[i] - q[i]);
        return std::sqrt(sum);
    }
};

using State = ob::RealVectorStateSpace::StateType;

void set(ob::State *state, const Pose &p, double cost, double r) {
    double *v = state->as<State>()->values;
    v[0] = p.x, v[1] = p.y, v[2] = r * std::cos(p.theta), v[3] = r * std::sin(p.theta), v[4] = p.theta, v[5] = cost;
}

// What a motion costs is what the cost that rides along grows by.
class Travel : public ob::OptimizationObjective {
public:
    explicit Travel(const ob::SpaceInformationPtr &information) : ob::OptimizationObjective(information) {}
    ob::Cost stateCost(const ob::State *) const override { return ob::Cost(0.0); }
    ob::Cost motionCost(const ob::State *a, const ob::State *b) const override {
        return ob::Cost(std::max(0.0, b->as<State>()->values[5] - a->as<State>()->values[5]));
    }
};

ob::PlannerPtr made(const oc::SpaceInformationPtr &information, const ob::ProblemDefinitionPtr &definition,
                    const std::string &name, double diagonal) {
    ob::PlannerPtr planner;
    if (name == "sst") {
        definition->setOptimizationObjective(std::make_shared<Travel>(information));
        auto sst = std::make_shared<oc::SST>(information);
        sst->setSelectionRadius(0.08 * diagonal), sst->setPruningRadius(0.04 * diagonal); // shares of the room's diagonal
        planner = sst;
    } else if (name == "est") {
        planner = std::make_shared<oc::EST>(information);
    } else if (name == "kpiece") {
        planner = std::make_shared<oc::KPIECE1>(information);
    } else {
        planner = std::make_shared<oc::RRT>(information);
    }
    planner->setProblemDefinition(definition);
    planner->setup();
    return planner;
}

void improve(const ob::PlannerPtr &planner, const std::string &name, double seconds, const long &extensions) {
    const std::clock_t end = std::clock() + std::clock_t(seconds * CLOCKS_PER_SEC);
    for (long room = 2000; std::clock() < end; room *= 2) {
        const long target = name == "sst" ? std::numeric_limits<long>::max() : extensions + room;
        planner->solve(ob::PlannerTerminationCondition([&] { return extensions >= target || std::clock() >= end; }));
        planner->clear();
    }
}

int main(int argc, char **argv) {
    if (argc != 5 && argc != 6) return 2;
    const bool searching = argc == 6;
    ompl::msg::setLogLevel(ompl::msg::LOG_NONE);
    ompl::RNG::setSeed(std::stoul(argv[3]));
    const long limit = std::stol(argv[2]);
    Problem problem(read(argv[1]));
    const double r = problem.headingLength(), *box = problem.array("box").row(0);

    auto space = std::make_shared<Space>();
    ob::RealVectorBounds bounds(6);
    const double lows[] = {box[0], box[1], -r, -r, -1e3, 0.0}, highs[] = {box[2], box[3], r, r, 1e3, 1e3};
    for (int i = 0; i < 6; ++i) bounds.setLow(i, lows[i]), bounds.setHigh(i, highs[i]);
    space->setBounds(bounds);
    const double side = std::hypot(box[2] - box[0], box[3] - box[1]) / 40; // cells in which EST and KPIECE1 count nodes
    space->registerDefaultProjection(std::make_shared<ob::RealVectorOrthogonalProjectionEvaluator>(
        space, std::vector<double>{side, side}, std::vector<unsigned int>{0, 1}));
    auto controls = std::make_shared<oc::RealVectorControlSpace>(space, 3);
    ob::RealVectorBounds unit(3);
    unit.setLow(0.0), unit.setHigh(1.0);
    controls->setBounds(unit);

    long extensions = 0, kept = 0, connected = 0;
    double best = kInf;
    const Pose target = problem.pose("goal");
    const std::clock_t first = std::clock();
    auto information = std::make_shared<oc::SpaceInformation>(space, controls);
    information->setStatePropagator(
        [&](const ob::State *from, const oc::Control *control, double, ob::State *to) {
            ++extensions;
            const double *u = control->as<oc::RealVectorControlSpace::ControlType>()->values;
            const double *v = from->as<State>()->values;
            const Pose p{v[0], v[1], v[4]};
            const double cost = v[5], length = u[2] * problem.longest();
            const Twist twist = problem.choose(u[0], u[1]);
            const Pose end = step(p, twist, length);
            set(to, end, cost + length, r);
            const bool hopeless = searching && cost + length + atLeast(end, target) >= best;
            if (length <= 0.0 || hopeless || !problem.sweepIsFree(p, twist, length)) {
                to->as<State>()->values[0] = 1e9;
                return;
            }
            ++kept;
            const double rest = problem.connect(end);
            connected += rest < kInf;
            if (searching && cost + length + rest < best)
                std::cout << double(std::clock() - first) / CLOCKS_PER_SEC << " " << cost + length + rest << "\n";
            best = std::min(best, cost + length + rest);
        });
    information->setStateValidityChecker([](const ob::State *s) { return s->as<State>()->values[0] < 1e9; });
    information->setPropagationStepSize(1.0);
    information->setMinMaxControlDuration(1, 1);
    information->setup();
    auto definition = std::make_shared<ob::ProblemDefinition>(information);
    ob::ScopedState<> start(information->getStateSpace()), goal(information->getStateSpace());
    set(start.get(), problem.pose("start"), 0.0, r);
    set(goal.get(), problem.pose("goal"), 0.0, r);
    definition->setStartAndGoalStates(start, goal, 1e-12);
    const ob::PlannerPtr planner = made(information, definition, argv[4], std::hypot(box[2] - box[0], box[3] - box[1]));
    if (searching) {
        improve(planner, argv[4], std::stod(argv[5]), extensions);
        return 0;
    }
    const std::clock_t began = std::clock();
    planner->solve(ob::PlannerTerminationCondition([&] { return extensions >= limit; }));
    const double seconds = double(std::clock() - began) / CLOCKS_PER_SEC;
    std::cout << seconds / extensions << " " << double(kept) / extensions << " " << double(connected) / kept << " "
              << best << std::endl;
}
