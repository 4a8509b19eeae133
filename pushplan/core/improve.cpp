// What Python calls of `shortening.hpp` and `local_changes.hpp`: `pushplan.core.improve`.
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
        throw std::invalid_argument("a path to change has an arc at least");
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
    auto m = core.def_submodule("improve");
    m.def(
        "objective_value",
        [](const Objective &objective, const Numbers &path) { return objective_value(objective, to_arcs(path)); },
        nb::arg("objective"), nb::arg("path"));
    m.def("merged", [](const Numbers &arcs) { return to_table(merged(to_arcs(arcs))); }, nb::arg("arcs"));
    m.def("vary", &bind_vary, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("state"),
          nb::arg("attempts") = 1);
    m.def("shorten", &bind_shorten, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("state"),
          nb::arg("attempts"));
    m.def("cut_short", &bind_cut_short, nb::arg("problem"), nb::arg("start"), nb::arg("arcs"), nb::arg("per_arc"));
}

} // namespace pushplan
