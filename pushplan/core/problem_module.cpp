// `pushplan.core.problem`: objectives, problems, and the steering paths in them.
#include "chart.hpp"
#include "numpy_poses.hpp"
#include "problem.hpp"

namespace pushplan {

namespace {

Objective to_objective(int kind, double per_arc, double lowest, double length, const Numbers &box,
                       const Numbers &table) {
    if (table.ndim() != 3 || table.shape(0) != table.shape(1) || table.shape(0) < 2 || table.shape(2) != 3)
        throw std::invalid_argument("an objective's table is (n, n, 3)");
    if (box.size() != 4)
        throw std::invalid_argument("an objective's box has four angles, not " + std::to_string(box.size()));
    if (kind < TRAVEL || kind > PASSING)
        throw std::invalid_argument("there is no objective of kind " + std::to_string(kind));
    std::vector<Objective::Entry> entries(static_cast<std::size_t>(table.shape(0) * table.shape(1)));
    copy_bytes(entries.data(), table.data(), entries.size() * sizeof(Objective::Entry));
    const double *of = box.data();
    return {kind, per_arc, lowest, length, {of[0], of[1], of[2], of[3]}, table.shape(0),
            std::make_shared<const std::vector<Objective::Entry>>(std::move(entries))};
}

void bind_objective(py::module_ &m) {
    m.attr("TRAVEL") = TRAVEL;
    m.attr("MARGIN") = MARGIN;
    m.attr("REST_TO_REST") = REST_TO_REST;
    m.attr("PASSING") = PASSING;
    m.attr("GAIN") = GAIN;
    py::class_<Objective>(m, "Objective")
        .def(py::init(&to_objective), py::arg("kind"), py::arg("per_arc"), py::arg("lowest"), py::arg("length"),
             py::arg("box"), py::arg("table"))
        .def_readonly("kind", &Objective::kind)
        .def_readonly("per_arc", &Objective::per_arc)
        .def_readonly("lowest", &Objective::lowest)
        .def_readonly("length", &Objective::length)
        .def_property_readonly("box", [](const Objective &self) { return py::array_t<double>(4, self.box.data()); })
        .def_property_readonly("table",
                               [](const py::object &self) {
                                   const auto &of = self.cast<const Objective &>();
                                   return read_only(of.table->front().data(), {of.side, of.side, 3}, self);
                               })
        .def(py::pickle(
            [](const py::object &self) {
                return py::make_tuple(self.attr("kind"), self.attr("per_arc"), self.attr("lowest"),
                                      self.attr("length"), self.attr("box"), self.attr("table"));
            },
            [](const py::tuple &state) {
                return to_objective(state[0].cast<int>(), state[1].cast<double>(), state[2].cast<double>(),
                                    state[3].cast<double>(), state[4].cast<Numbers>(), state[5].cast<Numbers>());
            }));
    m.def("rest_to_rest_time", &rest_to_rest_time, py::arg("length"), py::arg("speed"), py::arg("acceleration"),
          py::arg("jerk"));
    m.def(
        "arc_value",
        [](const Objective &objective, double vx, double vy, double omega, double length) {
            return arc_value(objective, Twist{vx, vy, omega}, length);
        },
        py::arg("objective"), py::arg("vx"), py::arg("vy"), py::arg("omega"), py::arg("length"));
}

Problem to_problem(const Scene &scene, const Numbers &segments, const Numbers &families, const Numbers &goal,
                   double longest, const Objective &objective) {
    Problem problem{scene,        to_rows<Segment>(segments, "segments"), to_families(families), to_pose(goal), longest,
                    objective};
    if (problem.segments.empty() || problem.families.empty())
        throw std::invalid_argument("a problem has a segment and a family at least");
    return problem;
}

void bind_problem_class(py::module_ &m) {
    m.attr("NODE") = NODE;
    m.attr("LETTER_SHARE") = LETTER_SHARE;
    m.attr("END_SHARE") = END_SHARE;
    m.attr("TURN_WEIGHT") = TURN_WEIGHT;
    py::class_<Problem, std::shared_ptr<Problem>>(m, "Problem")
        .def(py::init(&to_problem), py::arg("scene"), py::arg("segments"), py::arg("families"), py::arg("goal"),
             py::arg("longest"), py::arg("objective"))
        .def_readonly("scene", &Problem::scene)
        .def_property_readonly("segments",
                               [](const py::object &self) {
                                   const auto &of = self.cast<const Problem &>().segments;
                                   return read_only(&of.data()->low.vx, {static_cast<py::ssize_t>(of.size()), 6}, self);
                               })
        .def_property_readonly("families",
                               [](const py::object &self) {
                                   const auto &of = self.cast<const Problem &>().families;
                                   return read_only(&of.front().front().vx,
                                                    {static_cast<py::ssize_t>(of.size()), 3, 3}, self);
                               })
        .def_property_readonly("goal", [](const Problem &self) { return to_array(self.goal); })
        .def_readonly("longest", &Problem::longest)
        .def_readonly("objective", &Problem::objective)
        .def(
            "with_goal",
            [](Problem self, const Numbers &goal) {
                self.goal = to_pose(goal);
                return self;
            },
            py::arg("goal"))
        .def(
            "with_segments",
            [](Problem self, const Numbers &segments) {
                self.segments = to_rows<Segment>(segments, "segments");
                if (self.segments.empty())
                    throw std::invalid_argument("a problem has a segment at least");
                return self;
            },
            py::arg("segments"))
        .def(
            "with_objective",
            [](Problem self, const Objective &objective) {
                self.objective = objective;
                return self;
            },
            py::arg("objective"))
        .def(py::pickle(
            [](const py::object &self) {
                return py::make_tuple(self.attr("scene"), self.attr("segments"), self.attr("families"),
                                      self.attr("goal"), self.attr("longest"), self.attr("objective"));
            },
            [](const py::tuple &state) {
                return to_problem(state[0].cast<const Scene &>(), state[1].cast<Numbers>(), state[2].cast<Numbers>(),
                                  state[3].cast<Numbers>(), state[4].cast<double>(),
                                  state[5].cast<const Objective &>());
            }));
    m.def(
        "remaining",
        [](double x, double y, double theta, const Numbers &goal) { return remaining({x, y, theta}, to_pose(goal)); },
        py::arg("x"), py::arg("y"), py::arg("theta"), py::arg("goal"));
    m.def("random", [](RandomState state) { return random_of(state)(); }, py::arg("state"));
}

// Cost, letters and lengths of words (n, 7).
py::array_t<double> words_table(const Words &words) {
    py::array_t<double> made({static_cast<py::ssize_t>(words.count), py::ssize_t{7}});
    double *to = made.mutable_data();
    for (const Word &word : words) {
        *to++ = word.cost;
        for (const int letter : word.letters)
            *to++ = letter;
        for (const double length : word.lengths)
            *to++ = length;
    }
    return made;
}

void bind_steering(py::module_ &m) {
    m.attr("LEFT") = LEFT;
    m.attr("STRAIGHT") = STRAIGHT;
    m.attr("RIGHT") = RIGHT;
    m.attr("MAX_WORDS") = MAX_WORDS;
    m.attr("MOST_FAMILIES") = MOST_FAMILIES;
    m.attr("TRIES") = TRIES;
    m.def(
        "find_words",
        [](const Numbers &family, const Numbers &start, const Numbers &goal) {
            if (family.size() != 9)
                throw std::invalid_argument("a family has three twists");
            Family letters;
            std::memcpy(&letters, family.data(), sizeof(Family));
            return words_table(find_words(letters, to_pose(start), to_pose(goal)));
        },
        py::arg("family"), py::arg("start"), py::arg("goal"));
    m.def(
        "connect",
        [](const Scene &scene, const Numbers &families, const Numbers &start, const Numbers &goal, double bound,
           int tries) {
            const auto rows = to_families(families);
            const Connection found = connect(scene, {rows.data(), static_cast<std::ptrdiff_t>(rows.size())},
                                             to_pose(start), to_pose(goal), bound, tries);
            py::object arcs = py::none();
            if (found.cost < INF)
                arcs = to_table(found.arcs);
            return py::make_tuple(found.cost, found.promise, arcs);
        },
        py::arg("scene"), py::arg("families"), py::arg("start"), py::arg("goal"), py::arg("bound") = INF,
        py::arg("tries") = MAX_WORDS);
    m.def(
        "reach",
        [](const Scene &scene, const Numbers &families, const Numbers &starts, const Numbers &goals, double clearance) {
            const auto of = to_families(families);
            const auto from = to_rows<Pose>(starts, "starts"), to = to_rows<Pose>(goals, "goals");
            py::array_t<double> costs({static_cast<py::ssize_t>(from.size()), static_cast<py::ssize_t>(to.size())});
            const auto out = written_table(costs);
            {
                py::gil_scoped_release free;
                reach(scene, {of.data(), static_cast<std::ptrdiff_t>(of.size())}, from, to, clearance, out);
            }
            return costs;
        },
        py::arg("scene"), py::arg("families"), py::arg("starts"), py::arg("goals"), py::arg("clearance"));
}

void bind_chart(py::module_ &m) {
    m.def(
        "arcs_at",
        [](const Problem &problem, const Numbers &controls) {
            std::vector<Arc> arcs;
            for (const Control &control : to_rows<Control>(controls, "controls"))
                arcs.push_back(arc_of(problem, control));
            return to_table(arcs);
        },
        py::arg("problem"), py::arg("controls"));
    m.def(
        "controls_of",
        [](const Problem &problem, const Numbers &path) {
            const auto arcs = to_arcs(path);
            std::vector<Control> controls;
            for (const Arc &arc : arcs)
                controls.push_back(control_of(problem, arc));
            return to_table(controls);
        },
        py::arg("problem"), py::arg("arcs"));
    m.def(
        "poses_along",
        [](const Scene &scene, const Numbers &start, const Numbers &path) {
            const Followed followed = follow(scene, to_pose(start), to_arcs(path));
            return py::make_tuple(to_table(followed.poses), followed.free);
        },
        py::arg("scene"), py::arg("start"), py::arg("arcs"));
}

} // namespace

void bind_problem(py::module_ &core) {
    auto m = core.def_submodule("problem");
    bind_objective(m);
    bind_problem_class(m);
    bind_steering(m);
    bind_chart(m);
}

} // namespace pushplan
