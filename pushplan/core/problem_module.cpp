// `pushplan.core.problem`: objectives, problems, and the steering paths in them.
#include "chart.hpp"
#include "numpy_poses.hpp"
#include "problem.hpp"

namespace pushplan {

namespace {

Objective to_objective(int kind, double per_arc, double lowest, double length, const Numbers &box,
                       const Numbers &table) {
    if (table.ndim() != 3 || table.shape(0) != table.shape(1) || table.shape(0) < 2 || table.shape(2) != 3)
        throw std::invalid_argument("an objective's table must be (n, n, 3)");
    if (box.size() != 4)
        throw std::invalid_argument("an objective's box needs four angles, not " + std::to_string(box.size()));
    require_index(kind, TRAVEL, PASSING + 1, "kind");
    require_all_finite(box.data(), 4, "box");
    require_all_finite(table.data(), table.size(), "table");
    std::vector<Objective::Entry> entries(static_cast<std::size_t>(table.shape(0) * table.shape(1)));
    copy_bytes(entries.data(), table.data(), entries.size() * sizeof(Objective::Entry));
    const double *of = box.data();
    return {kind,
            require_finite(per_arc, "per_arc"),
            require_finite(lowest, "lowest"),
            require_finite(length, "length"),
            {of[0], of[1], of[2], of[3]},
            table.shape(0),
            std::make_shared<const std::vector<Objective::Entry>>(std::move(entries))};
}

void bind_objective(nb::module_ &m) {
    m.attr("TRAVEL") = TRAVEL;
    m.attr("MARGIN") = MARGIN;
    m.attr("REST_TO_REST") = REST_TO_REST;
    m.attr("PASSING") = PASSING;
    m.attr("GAIN") = GAIN;
    nb::class_<Objective>(m, "Objective", R"(
    Objective that ranks paths. The table holds the values that its kind needs, for twists scaled to a cost rate of 1.

    Attributes:
        kind: `TRAVEL` (no table), `MARGIN` (rate), `REST_TO_REST` or `PASSING` (top speed; time to it from rest, s;
            exponent of the length in the time of shorter arcs).
        per_arc: Value of an arc in addition to its length.
        lowest: Smallest value of a metre of arc.
        length: Characteristic length of the twist sphere, m.
        box: (4,) first and last longitude, first and last latitude of the table, rad.
        table: (n, n, 3) by longitude and latitude.
    )")
        .def(MadeBy(&to_objective), nb::arg("kind"), nb::arg("per_arc"), nb::arg("lowest"), nb::arg("length"),
             nb::arg("box"), nb::arg("table"))
        .def_ro("kind", &Objective::kind)
        .def_ro("per_arc", &Objective::per_arc)
        .def_ro("lowest", &Objective::lowest)
        .def_ro("length", &Objective::length)
        .def_prop_ro("box", [](const Objective &self) { return copied(self.box.data(), {4}); })
        .def_prop_ro("table",
                     [](const nb::object &self) {
                         const auto &of = nb::cast<const Objective &>(self);
                         return read_only(of.table->front().data(), {of.side, of.side, 3}, self);
                     })
        .def(PickledBy{"kind", "per_arc", "lowest", "length", "box", "table"});
}

Problem to_problem(const Scene &scene, const Numbers &segments, const Numbers &families, const Numbers &goal,
                   double longest, const Objective &objective) {
    Problem problem{scene,         to_rows<Segment>(segments, "segments"), to_families(families),
                    to_pose(goal), require_positive(longest, "longest"),   objective};
    if (problem.segments.empty() || problem.families.empty())
        throw std::invalid_argument("a problem needs at least one segment and one family");
    return problem;
}

void bind_problem_class(nb::module_ &m) {
    m.attr("TURN_WEIGHT") = TURN_WEIGHT;
    nb::class_<Problem>(m, "Problem", R"(
    A push problem: the input of a search.

    Attributes:
        scene: The body and the obstacles.
        segments: (k, 6) stable twists between two end twists: every positive combination of them is stable.
        families: (f, 3, 3) left, straight and right twists for exact connections.
        goal: (3,) pose of the chain frame in the world.
        longest: Longest arc sampled, m of cost.
        objective: Objective that ranks paths.
    )")
        .def(MadeBy(&to_problem), nb::arg("scene"), nb::arg("segments"), nb::arg("families"), nb::arg("goal"),
             nb::arg("longest"), nb::arg("objective"))
        .def_ro("scene", &Problem::scene)
        .def_prop_ro("segments",
                     [](const nb::object &self) {
                         const auto &of = nb::cast<const Problem &>(self).segments;
                         return read_only(&of.data()->low.vx, {static_cast<std::ptrdiff_t>(of.size()), 6}, self);
                     })
        .def_prop_ro("families",
                     [](const nb::object &self) {
                         const auto &of = nb::cast<const Problem &>(self).families;
                         return read_only(&of.front().front().vx, {static_cast<std::ptrdiff_t>(of.size()), 3, 3}, self);
                     })
        .def_prop_ro("goal", [](const Problem &self) { return to_array(self.goal); })
        .def_ro("longest", &Problem::longest)
        .def_ro("objective", &Problem::objective)
        .def(
            "with_goal",
            [](Problem self, const Numbers &goal) {
                self.goal = to_pose(goal);
                return self;
            },
            nb::arg("goal"), "Return the problem with another goal (3,).")
        .def(
            "with_segments",
            [](Problem self, const Numbers &segments) {
                self.segments = to_rows<Segment>(segments, "segments");
                if (self.segments.empty())
                    throw std::invalid_argument("a problem needs at least one segment");
                return self;
            },
            nb::arg("segments"), "Return the problem with other stable twists (k, 6).")
        .def(
            "with_objective",
            [](Problem self, const Objective &objective) {
                self.objective = objective;
                return self;
            },
            nb::arg("objective"), "Return the problem with another objective.")
        .def(PickledBy{"scene", "segments", "families", "goal", "longest", "objective"});
    m.def(
        "remaining", [](const Numbers &pose, const Numbers &goal) { return remaining(to_pose(pose), to_pose(goal)); },
        nb::arg("pose"), nb::arg("goal"),
        "Return a lower bound of the cost from a pose (3,) to the goal: straight travel plus the smallest turn.");
    m.def(
        "random", [](RandomState state) { return random_of(state)(); }, nb::arg("state"),
        "Draw a number in [0, 1) from the generator's state (1,) uint64 (splitmix64, Steele et al. 2014).");
}

// Return cost, letters and lengths of steering paths (n, 7).
Made<double> words_table(const Words &words) {
    auto made = new_array<double>({static_cast<std::ptrdiff_t>(words.count), 7});
    double *to = made.data();
    for (const Word &word : words) {
        *to++ = word.cost;
        for (const int letter : word.letters)
            *to++ = letter;
        for (const double length : word.lengths)
            *to++ = length;
    }
    return made;
}

void bind_steering(nb::module_ &m) {
    m.attr("LEFT") = LEFT;
    m.attr("STRAIGHT") = STRAIGHT;
    m.attr("RIGHT") = RIGHT;
    m.attr("TRIES") = TRIES;
    m.def(
        "find_words",
        [](const Numbers &family, const Numbers &start, const Numbers &goal) {
            if (family.size() != 9)
                throw std::invalid_argument("a family needs three twists");
            Family letters;
            require_all_finite(family.data(), 9, "family");
            std::memcpy(&letters, family.data(), sizeof(Family));
            return words_table(find_words(letters, to_pose(start), to_pose(goal)));
        },
        nb::arg("family"), nb::arg("start"), nb::arg("goal"),
        "Return cost, letters and lengths (n, 7) of every steering path of a family (3, 3) between two poses (3,).");
    m.def(
        "connect",
        [](const Scene &scene, const Numbers &families, const Numbers &start, const Numbers &goal, double bound,
           int tries) {
            const auto rows = to_families(families);
            require_number(bound, "bound");
            const Connection found = connect(scene, {rows.data(), static_cast<std::ptrdiff_t>(rows.size())},
                                             to_pose(start), to_pose(goal), bound, tries);
            std::optional<Made<double>> arcs;
            if (found.cost < INF)
                arcs = to_table(found.arcs);
            return std::make_tuple(found.cost, found.promise, arcs);
        },
        nb::arg("scene"), nb::arg("families"), nb::arg("start"), nb::arg("goal"), nb::arg("bound") = INF,
        nb::arg("tries") = MAX_WORDS, R"(
    Find the cheapest free connection below a bound.

    Args:
        scene: The body and the obstacles.
        families: (f, 3, 3) left, straight and right twists; f is at most 3.
        start: (3,) pose.
        goal: (3,) pose.
        bound: Upper limit of the cost; infinite by default.
        tries: Maximum number of steering paths checked for collisions, cheapest first; all by default.

    Returns:
        (cost, promise, arcs): cost of the connection, infinite if there is none; cost of the cheapest steering path,
        free or not; twists and lengths (3, 4) of the connection, None if there is none.

    Raises:
        ValueError: If there are more families.
    )");
    m.def(
        "reach",
        [](const Scene &scene, const Numbers &families, const Numbers &starts, const Numbers &goals, double clearance) {
            const auto of = to_families(families);
            require_finite(clearance, "clearance");
            const auto from = to_rows<Pose>(starts, "starts"), to = to_rows<Pose>(goals, "goals");
            const auto rows = static_cast<std::ptrdiff_t>(from.size()),
                       columns = static_cast<std::ptrdiff_t>(to.size());
            auto costs = new_array<double>({rows, columns});
            const Table<double> out{costs.data(), rows, columns};
            {
                nb::gil_scoped_release free;
                reach(scene, {of.data(), static_cast<std::ptrdiff_t>(of.size())}, from, to, clearance, out);
            }
            return costs;
        },
        nb::arg("scene"), nb::arg("families"), nb::arg("starts"), nb::arg("goals"), nb::arg("clearance"), R"(
    Return the costs (n, m) of the cheapest free steering paths from starts (n, 3) to goals (m, 3); inf if none is free.

    Args:
        scene: An `open_scene`. Between two poses, it keeps the distance that the nearer end allows; see
            `Scene.with_gap`.
        families: (f, 3, 3) left, straight and right twists.
        starts: (n, 3) start poses of the chain frame.
        goals: (m, 3) goal poses of the chain frame.
        clearance: Minimum clearance of start and goal, m.
    )");
}

void bind_chart(nb::module_ &m) {
    m.def(
        "arcs_at",
        [](const Problem &problem, const Numbers &controls) {
            std::vector<Arc> arcs;
            for (const Control &control : to_rows<Control>(controls, "controls")) {
                to_controls(control.data());
                require_not_negative(control[3], "the units of a control");
                arcs.push_back(arc_of(problem, control));
            }
            return to_table(arcs);
        },
        nb::arg("problem"), nb::arg("controls"),
        "Return the arcs (k, 4), twists and lengths, of controls (k, 4): coordinates, and durations in units.");
    m.def(
        "controls_of",
        [](const Problem &problem, const Numbers &path) {
            const auto arcs = to_arcs(path);
            std::vector<Control> controls;
            for (const Arc &arc : arcs)
                controls.push_back(control_of(problem, arc));
            return to_table(controls);
        },
        nb::arg("problem"), nb::arg("arcs"),
        "Return controls (k, 4) of arcs (k, 4), with whole units; not finite if a twist is on no segment.");
    m.def(
        "poses_along",
        [](const Scene &scene, const Numbers &start, const Numbers &path) {
            const Followed followed = follow(scene, to_pose(start), to_arcs(path));
            return std::make_tuple(to_table(followed.poses), followed.free);
        },
        nb::arg("scene"), nb::arg("start"), nb::arg("arcs"),
        "Return the poses (k + 1, 3) at the ends of arcs (k, 4), and the number of arcs before one that is not free.");
}

} // namespace

void bind_problem(nb::module_ &core) {
    auto m = core.def_submodule("problem", "Objectives, problems, and the steering paths that connect their poses.");
    bind_objective(m);
    bind_problem_class(m);
    bind_steering(m);
    bind_chart(m);
}

} // namespace pushplan
