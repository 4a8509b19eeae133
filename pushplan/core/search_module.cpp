// `pushplan.core.search`: what grows trees of arcs, one class for each way.
#include "forest.hpp"
#include "lattice.hpp"
#include "numpy_poses.hpp"
#include "sparse_tree.hpp"
#include "tree.hpp"

namespace pushplan {

namespace {

using Shared = std::shared_ptr<Problem>;

Area to_area(const Numbers &array) {
    if (array.size() != 4)
        throw std::invalid_argument("a box has four numbers, not " + std::to_string(array.size()));
    const double *of = array.data();
    return {of[0], of[1], of[2], of[3]};
}

// A path (k, 4), or None where there is none.
py::object path_or_none(const std::vector<Arc> &path) {
    if (path.empty())
        return py::none();
    return to_table(path);
}

void check_row(std::int64_t row, std::size_t rows) {
    if (row < 0 || row >= static_cast<std::int64_t>(rows))
        throw py::index_error("a tree has no row " + std::to_string(row));
}

py::tuple extension_tuple(const Extension &of) {
    return py::make_tuple(of.kept, of.cost, of.promise, of.pose.x, of.pose.y, of.pose.theta);
}

void bind_tree(py::module_ &m) {
    using Row = std::int64_t;
    py::class_<Tree>(m, "Tree")
        .def(py::init([](const Shared &problem, const Numbers &start) { return Tree(problem, to_pose(start)); }),
             py::arg("problem"), py::arg("start"))
        .def("take", [](Tree &self, const Shared &problem) { self.take(problem); }, py::arg("problem"))
        .def("clear", [](Tree &self, const Numbers &start) { self.clear(to_pose(start)); }, py::arg("start"))
        .def("__len__", [](const Tree &self) { return self.nodes().size(); })
        .def_property_readonly("nodes", [](const Tree &self) { return to_table(self.nodes()); })
        .def(
            "extend",
            [](Tree &self, Row row, double u0, double u1, double u2, double bound) {
                check_row(row, self.nodes().size());
                return extension_tuple(self.extend(row, {u0, u1, u2}, bound));
            },
            py::arg("row"), py::arg("u0"), py::arg("u1"), py::arg("u2"), py::arg("bound"))
        .def(
            "extend_from",
            [](const Tree &self, double x, double y, double theta, double u0, double u1, double u2, double bound) {
                return extension_tuple(self.extend_from({x, y, theta}, {u0, u1, u2}, bound));
            },
            py::arg("x"), py::arg("y"), py::arg("theta"), py::arg("u0"), py::arg("u1"), py::arg("u2"),
            py::arg("bound"))
        .def(
            "connect",
            [](const Tree &self, Row row, double bound) {
                check_row(row, self.nodes().size());
                const Extension found = self.connect(row, bound);
                return py::make_tuple(found.cost, found.promise);
            },
            py::arg("row"), py::arg("bound"))
        .def(
            "connect_from",
            [](const Tree &self, double x, double y, double theta, double bound) {
                const Extension found = self.connect_from({x, y, theta}, bound);
                return py::make_tuple(found.cost, found.promise);
            },
            py::arg("x"), py::arg("y"), py::arg("theta"), py::arg("bound"))
        .def(
            "room_at", [](const Tree &self, double x, double y, double theta) { return self.room_at({x, y, theta}); },
            py::arg("x"), py::arg("y"), py::arg("theta"));
    m.def(
        "branch",
        [](const Numbers &nodes, Row node) {
            const auto rows = to_rows<Node>(nodes, "a tree");
            check_row(node, rows.size());
            std::vector<Arc> path;
            trace(rows, node, path);
            return to_table(path);
        },
        py::arg("nodes"), py::arg("node"));
}

// Lets a search grow; returns the iterations done and the path found.
template <class Search>
py::tuple grown(Search &search, const Problem &problem, RandomState &state, double bound, std::int64_t iterations) {
    Random &random = random_of(state);
    std::vector<Arc> path;
    std::int64_t done = 0;
    {
        py::gil_scoped_release free;
        done = search.grow(problem, random, bound, iterations, path);
    }
    return py::make_tuple(done, path_or_none(path));
}

void bind_forest(py::module_ &m) {
    py::class_<Forest>(m, "Forest")
        .def(py::init([](const Numbers &box, double heading_length, double reach) {
                 return Forest(to_area(box), heading_length, reach);
             }),
             py::arg("box"), py::arg("heading_length"), py::arg("reach"))
        .def(
            "plant",
            [](Forest &self, const Numbers &start, const Numbers &goal) { self.plant(to_pose(start), to_pose(goal)); },
            py::arg("start"), py::arg("goal"))
        .def_property_readonly("start_tree", [](const Forest &self) { return to_table(self.start_tree()); })
        .def_property_readonly("goal_tree", [](const Forest &self) { return to_table(self.goal_tree()); })
        .def(
            "grow",
            [](Forest &self, const Problem &problem, RandomState state, double bound, std::int64_t iterations) {
                if (self.start_tree().empty())
                    throw std::invalid_argument("a forest is planted before it grows");
                return grown(self, problem, state, bound, iterations);
            },
            py::arg("problem"), py::arg("state"), py::arg("bound"), py::arg("iterations"));
}

void bind_sparse_tree(py::module_ &m) {
    py::class_<SparseTree>(m, "SparseTree")
        .def(py::init([](const Numbers &start, const Numbers &goal, const Numbers &box, double heading_length,
                         double selection, double witness) {
                 return SparseTree(to_pose(start), to_pose(goal), to_area(box), {heading_length, selection, witness});
             }),
             py::arg("start"), py::arg("goal"), py::arg("box"), py::arg("heading_length"), py::arg("selection"),
             py::arg("witness"))
        .def_property_readonly("nodes", [](const SparseTree &self) { return to_table(self.nodes()); })
        .def_property_readonly("to_go",
                               [](const SparseTree &self) {
                                   std::vector<double> values;
                                   for (const Role &role : self.roles())
                                       values.push_back(role.to_go);
                                   return py::array_t<double>(values.size(), values.data());
                               })
        .def_property_readonly("children",
                               [](const SparseTree &self) {
                                   std::vector<std::int64_t> values;
                                   for (const Role &role : self.roles())
                                       values.push_back(role.children);
                                   return py::array_t<std::int64_t>(values.size(), values.data());
                               })
        .def_property_readonly("active",
                               [](const SparseTree &self) {
                                   py::array_t<bool> made(static_cast<py::ssize_t>(self.roles().size()));
                                   bool *to = made.mutable_data();
                                   for (const Role &role : self.roles())
                                       *to++ = role.active;
                                   return made;
                               })
        .def_property_readonly("witnesses",
                               [](const SparseTree &self) {
                                   std::vector<Arc> rows; // four numbers each
                                   for (const auto &[pose, row] : self.witnesses())
                                       rows.push_back({{pose.x, pose.y, pose.theta}, static_cast<double>(row)});
                                   return to_table(rows);
                               })
        .def_property_readonly("unused",
                               [](const SparseTree &self) {
                                   return py::array_t<std::int64_t>(self.unused().size(), self.unused().data());
                               })
        .def(
            "grow",
            [](SparseTree &self, const Problem &problem, RandomState state, double bound, std::int64_t iterations) {
                return grown(self, problem, state, bound, iterations);
            },
            py::arg("problem"), py::arg("state"), py::arg("bound"), py::arg("iterations"));
}

// Lower left corner and side of the cells (3,), m, of a table.
Grid to_grid(const Numbers &grid, py::ssize_t columns, py::ssize_t rows) {
    if (grid.size() != 3 || columns < 1 || rows < 1)
        throw std::invalid_argument("a grid has a corner, a side, and cells");
    return {grid.data()[0], grid.data()[1], grid.data()[2], columns, rows};
}

Lattice to_lattice(const Shared &problem, const Numbers &start, const Numbers &middle, const Numbers &grid,
                   const Numbers &to_start, const Numbers &to_goal) {
    const auto first = table(to_start), second = table(to_goal);
    if (first.rows != second.rows || first.columns != second.columns)
        throw std::invalid_argument("distances to the start and to the goal are of the same cells");
    if (middle.size() < 2)
        throw std::invalid_argument("a middle has two numbers");
    const auto cells = first.rows * first.columns;
    return Lattice(problem, to_pose(start), {middle.data()[0], middle.data()[1]},
                   to_grid(grid, first.rows, first.columns),
                   {std::vector<double>(first.data, first.data + cells),
                    std::vector<double>(second.data, second.data + cells)});
}

void bind_lattice(py::module_ &m) {
    py::class_<Lattice>(m, "Lattice")
        .def(py::init(&to_lattice), py::arg("problem"), py::arg("start"), py::arg("middle"), py::arg("grid"),
             py::arg("to_start"), py::arg("to_goal"))
        .def(
            "plant",
            [](Lattice &self, bool back, const Numbers &box, double side, double angle, double arc, std::int64_t room) {
                if (room < 1 || (room & (room - 1)) != 0 || room > std::int64_t{1} << 22)
                    throw std::invalid_argument("there is room for a power of two of nodes up to 2^22, not for " +
                                                std::to_string(room));
                self.plant(back, to_area(box), {side, angle, arc}, room);
            },
            py::arg("back"), py::arg("box"), py::arg("side"), py::arg("angle"), py::arg("arc"), py::arg("room"))
        .def(
            "expand",
            [](Lattice &self, RandomState state, double bound, std::int64_t arcs) {
                Random &random = random_of(state);
                py::gil_scoped_release free;
                return self.expand(bound, arcs, random);
            },
            py::arg("state"), py::arg("bound"), py::arg("arcs"))
        .def_property_readonly("path", [](const Lattice &self) { return path_or_none(self.path()); })
        .def_property_readonly("box", [](const Lattice &self) { return py::array_t<double>(4, &self.area().xmin); })
        .def_property_readonly("side", [](const Lattice &self) { return self.sizes().side; })
        .def_property_readonly("angle", [](const Lattice &self) { return self.sizes().angle; })
        .def_property_readonly("tried", &Lattice::tried)
        .def_property_readonly("nodes", [](const Lattice &self) { return to_table(self.nodes()); })
        .def_property_readonly("open",
                               [](const Lattice &self) {
                                   auto open = self.open();
                                   const auto count = static_cast<py::ssize_t>(open.size());
                                   return to_numpy(std::move(open), {count});
                               })
        .def_property_readonly("cell_costs", [](const Lattice &self) {
            auto costs = self.cell_costs();
            const auto count = static_cast<py::ssize_t>(costs.size());
            return to_numpy(std::move(costs), {count});
        });
    m.def(
        "floor_distances",
        [](const Scene &point, const Numbers &grid, py::ssize_t columns, py::ssize_t rows, double least,
           const Numbers &start, const Numbers &goal) {
            const Grid cells = to_grid(grid, columns, rows);
            std::array<std::int64_t, 2> places;
            for (int k = 0; k < 2; ++k) {
                const Numbers &place = k == 0 ? start : goal;
                if (place.size() != 2)
                    throw std::invalid_argument("a place has two numbers");
                places[k] = cells.cell(place.data()[0], place.data()[1]);
            }
            std::array<std::vector<double>, 2> away;
            {
                py::gil_scoped_release free;
                away = floor_distances(point, cells, least, places);
            }
            return py::make_tuple(to_numpy(std::move(away[0]), {columns, rows}),
                                  to_numpy(std::move(away[1]), {columns, rows}));
        },
        py::arg("point"), py::arg("grid"), py::arg("columns"), py::arg("rows"), py::arg("least"), py::arg("start"),
        py::arg("goal"));
}

} // namespace

void bind_search(py::module_ &core) {
    auto m = core.def_submodule("search");
    bind_tree(m);
    bind_forest(m);
    bind_sparse_tree(m);
    bind_lattice(m);
}

} // namespace pushplan
