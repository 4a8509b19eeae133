// `pushplan.core.improve`: the Python bindings of `shortening.hpp` and `local_changes.hpp`.
#include "local_changes.hpp"
#include "numpy_poses.hpp"
#include "shortening.hpp"

namespace pushplan {

namespace {

Made<double> bind_shorten(const Problem &problem, const Numbers &start, const Numbers &arcs, RandomState state,
                          std::int64_t attempts) {
    const Pose pose = to_pose(start);
    std::vector<Arc> path = to_arcs(arcs);
    require_count(attempts, "attempts");
    Random &random = random_of(state);
    {
        nb::gil_scoped_release free;
        path = shorten(problem, pose, path, random, attempts);
    }
    return to_table(path);
}

Made<double> bind_vary(const Problem &problem, const Numbers &start, const Numbers &arcs, RandomState state,
                       std::int64_t attempts) {
    const Pose pose = to_pose(start);
    std::vector<Arc> path = to_arcs(arcs);
    if (path.empty())
        throw std::invalid_argument("a path to change needs at least one arc");
    require_count(attempts, "attempts");
    Random &random = random_of(state);
    {
        nb::gil_scoped_release free;
        LocalChanges changes(problem);
        for (std::int64_t attempt = 0; attempt < attempts; ++attempt)
            changes.vary(pose, path, random);
    }
    return to_table(path);
}

Made<double> bind_cut_short(const Problem &problem, const Numbers &start, const Numbers &arcs, double per_arc) {
    const Pose pose = to_pose(start);
    std::vector<Arc> path = to_arcs(arcs);
    require_finite(per_arc, "per_arc");
    {
        nb::gil_scoped_release free;
        path = cut_short(problem, pose, path, per_arc);
    }
    return to_table(path);
}

} // namespace

void bind_improve(nb::module_ &core) {
    auto m = core.def_submodule("improve", "Shortening of paths by steering paths between their points, and by small "
                                        "changes of their twists and lengths.");
    m.def(
        "objective_value",
        [](const Objective &objective, const Numbers &path) { return objective_value(objective, to_arcs(path)); },
        nb::arg("objective"), nb::arg("path"), "Return the value of a path (k, 4).");
    m.def(
        "merged", [](const Numbers &arcs) { return to_table(merged(to_arcs(arcs))); }, nb::arg("arcs"),
        "Return a path (k, 4) without empty arcs and with neighbouring arcs of the same motion merged.");
    m.def("vary", &bind_vary, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("state"),
          nb::arg("attempts") = 1, R"(
    Return a path (k, 4) after local changes: change one arc, adapt three to close the path, and keep it if it is
    cheaper.

    Args:
        problem: Push problem.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) twists and lengths of a path to the goal.
        state: (1,) state of the random generator.
        attempts: Number of changes to try.

    Raises:
        ValueError: If the path has no arcs.
    )");
    m.def("shorten", &bind_shorten, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("state"),
          nb::arg("attempts"), R"(
    Return the shortened path (k, 4) of twists and lengths.

    Args:
        problem: Push problem.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) the path.
        state: (1,) state of the random generator.
        attempts: Number of pairs of poses, or local changes, to try.
    )");
    m.def("cut_short", &bind_cut_short, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("per_arc"), R"(
    Return the path (k, 4) with pieces replaced by free steering paths that are shorter or have fewer arcs.

    Args:
        problem: Push problem.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) twists and lengths.
        per_arc: Cost of an arc in addition to its length, m.
    )");
}

} // namespace pushplan
