// `pushplan.core.search`: what grows trees of arcs, one class for each way.
#include "lattice.hpp"
#include "numpy_poses.hpp"
#include "tree.hpp"

namespace pushplan {

namespace {

using Shared = std::shared_ptr<Problem>;

Area to_area(const Numbers &array) {
    if (array.size() != 4)
        throw std::invalid_argument("a box has four numbers, not " + std::to_string(array.size()));
    const double *of = array.data();
    require_all_finite(of, 4, "a box");
    return {of[0], of[1], of[2], of[3]};
}

// A path (k, 4), or None where there is none.
std::optional<Made<double>> path_or_none(const std::vector<Arc> &path) {
    if (path.empty())
        return std::nullopt;
    return to_table(path);
}

// The pose that a caller names with its row of a tree, -1 for none, to go on from towards another tree.
Pose check_place(const Tree &tree, std::int64_t row, const std::array<double, 3> &pose, double bound,
                 const Tree &other) {
    if (other.back() == tree.back())
        throw std::invalid_argument("of two trees that meet, one grows back from the goal");
    require_index(row, -1, static_cast<std::int64_t>(tree.nodes().size()), "row");
    require_all_finite(pose.data(), 3, "pose");
    require_number(bound, "bound");
    return pose_at(pose.data());
}

// What a function of an object returns, unless another thread's call works on it.
template <class Result, class Class> auto used(Result (*function)(const Class &)) {
    return [function](const Class &self) {
        const InUse use(self.lock);
        return function(self);
    };
}

// So many cells as the keys of `cells.hpp` have room for.
void require_cells(double cells, const char *name) {
    if (!(cells < static_cast<double>(MOST_CELLS)))
        throw std::invalid_argument(std::string(name) + " must be fewer than 2^20");
}

void bind_tree(nb::module_ &m) {
    using Row = std::int64_t;
    nb::class_<Tree>(m, "Tree", R"(
    A tree that another program drives, OMPL's planners, which say from where and along what it grows.

    An extension is (kept, cost, promise, x, y, theta): whether there is a new node that may be on a path below the
    bound; the cost of the whole path through it, infinite when all connections are blocked; the cost of the cheapest
    word to the other tree's root, blocked or not; and its pose.

    Args:
        problem: What to plan.
        root: (3,) pose.
        heading_length: Metres that a radian counts as in the choice of the other tree's nearest nodes.
        back: The tree grows against the direction of travel: its arcs lead to the root.

    Attributes:
        nodes: The tree, a copy (n, 9): pose, cost to the root, parent, arc between both (vx, vy, omega, length).
        path: The path (k, 4) that the last connection closed, from the start to the goal; None before the first
            one.
    )")
        .def(MadeBy(+[](const Shared &problem, const Numbers &root, double heading_length, bool back) {
                 return Tree(problem, to_pose(root), require_positive(heading_length, "heading_length"), back);
             }),
             nb::arg("problem"), nb::arg("root"), nb::arg("heading_length"), nb::arg("back") = false)
        .def(
            "take", [](Tree &self, const Shared &problem) { self.take(problem); }, nb::arg("problem"),
            "Go on with another problem.")
        .def(
            "clear", [](Tree &self, const Numbers &root) { self.clear(to_pose(root)); }, nb::arg("root"),
            "Forget the tree but for its root.")
        .def("__len__", [](const Tree &self) { return self.nodes().size(); })
        .def_prop_ro("nodes", [](const Tree &self) { return to_table(self.nodes()); })
        .def_prop_ro("path", [](const Tree &self) { return path_or_none(self.path()); })
        .def(
            "extend",
            [](Tree &self, Row row, const std::array<double, 3> &pose, const std::array<double, 3> &controls,
               double bound, const Tree &other) {
                const Pose from = check_place(self, row, pose, bound, other);
                const Extension found = self.extend(row, from, to_controls(controls.data()), bound, other);
                return std::make_tuple(found.kept, found.cost, found.promise, found.pose.x, found.pose.y,
                                       found.pose.theta);
            },
            nb::arg("row"), nb::arg("pose"), nb::arg("controls"), nb::arg("bound"), nb::arg("other"), R"(
    Grow by one arc from the pose of a row, and try to connect its end exactly to a tree that grows towards it.

    Args:
        row: Of the parent; what is kept becomes the last row. -1 where no arc led to the pose: nothing becomes a
            row then.
        pose: x, y and theta.
        controls: Which segment of the stable set, where on it, and the share of the longest arc, in [0, 1].
        bound: Cost that a whole path must stay below.
        other: The tree, whose root and two nearest nodes are tried.

    Returns:
        Whether it was kept, the cost of the whole path, that of the cheapest word, and the pose.

    Raises:
        ValueError: Where the row or a number is none, or both trees grow the same way.
    )")
        .def(
            "connect",
            [](const Tree &self, Row row, const std::array<double, 3> &pose, double bound, const Tree &other) {
                const Extension found = self.connect(row, check_place(self, row, pose, bound, other), bound, other);
                return std::make_tuple(found.cost, found.promise);
            },
            nb::arg("row"), nb::arg("pose"), nb::arg("bound"), nb::arg("other"), R"(
    Return the cost of a path through a row (-1: none) and any free word, and the cost of the cheapest word.

    The words are those to the root of the other tree.
    )")
        .def(
            "room_at",
            [](const Tree &self, double x, double y, double theta) {
                for (const double number : {x, y, theta})
                    require_finite(number, "pose");
                return self.room_at({x, y, theta});
            },
            nb::arg("x"), nb::arg("y"), nb::arg("theta"), R"(
    Return how far (m) the body is from everything at a pose, beyond the clearance; negative if too near.

    Distances above twice the clearance are not told apart.
    )");
    m.def(
        "branch",
        [](const Numbers &nodes, Row node) {
            const auto rows = to_rows<Node>(nodes, "a tree");
            require_index(node, 0, static_cast<Row>(rows.size()), "node");
            for (std::size_t i = 0; i < rows.size(); ++i)
                if (!(rows[i].parent >= -1.0 && rows[i].parent < static_cast<double>(i)))
                    throw std::invalid_argument("the parent of node " + std::to_string(i) + " is not before it");
            std::vector<Arc> path;
            trace(rows, node, path);
            return to_table(path);
        },
        nb::arg("nodes"), nb::arg("node"), "Return the arcs (k, 4) from the root of a tree (n, 9) to a node.");
}

// Lower left corner and side of the cells (3,), m, of a table.
Grid to_grid(const Numbers &grid, std::ptrdiff_t columns, std::ptrdiff_t rows) {
    const double *of = three_finite(grid, "a grid");
    if (require_room(std::array{columns, rows}, "a grid") == 0)
        throw std::invalid_argument("a grid has a cell at least");
    return {of[0], of[1], require_positive(of[2], "the side of a grid's cells"), columns, rows};
}

std::array<double, 2> to_place(const Numbers &array) {
    if (array.size() < 2)
        throw std::invalid_argument("a place has two numbers, not " + std::to_string(array.size()));
    require_all_finite(array.data(), 2, "a place");
    return {array.data()[0], array.data()[1]};
}

Lattice to_lattice(const Shared &problem, const Numbers &start, const Numbers &middle, const Numbers &grid,
                   const Numbers &to_start, const Numbers &to_goal) {
    const auto first = table(to_start), second = table(to_goal);
    if (first.rows != second.rows || first.columns != second.columns)
        throw std::invalid_argument("distances to the start and to the goal are of the same cells");
    const auto cells = first.rows * first.columns;
    for (std::ptrdiff_t i = 0; i < cells; ++i)
        require_number(first.data[i] + second.data[i], "a distance");
    return Lattice(
        problem, to_pose(start), to_place(middle), to_grid(grid, first.rows, first.columns),
        {std::vector<double>(first.data, first.data + cells), std::vector<double>(second.data, second.data + cells)});
}

void bind_lattice(nb::module_ &m) {
    nb::class_<Lattice>(m, "Lattice", R"(
    Best-first search over a lattice of poses: one at a time, the next one takes over the memory.

    Args:
        problem: What to plan.
        start: (3,) pose.
        middle: (2 or more,) the body's point for which distances over the floor count, chain frame, m.
        grid: (3,) lower left corner of their cells and the side of these, m.
        to_start: (nx, ny) distance of a place from the start around the obstacles, m.
        to_goal: Likewise from the goal.

    Attributes:
        path: The best path (k, 4), None while there is none.
        tried: Arcs tried.
        nodes: The nodes (n, 9), a copy; see `Tree.nodes`.
    )")
        .def(MadeBy(&to_lattice), nb::arg("problem"), nb::arg("start"), nb::arg("middle"), nb::arg("grid"),
             nb::arg("to_start"), nb::arg("to_goal"))
        .def(
            "plant",
            [](Lattice &self, bool back, const Numbers &box, double side, double angle, double arc, std::int64_t room) {
                const InUse use(self.lock);
                if (room < 1 || (room & (room - 1)) != 0 || room > std::int64_t{1} << 22)
                    throw std::invalid_argument("there is room for a power of two of nodes up to 2^22, not for " +
                                                std::to_string(room));
                const Area area = to_area(box);
                const double longer = std::max(area.xmax - area.xmin, area.ymax - area.ymin);
                require_cells(longer / require_positive(side, "side"), "cells of the box");
                require_cells(2.0 * PI / require_positive(angle, "angle"), "cells of a turn");
                self.plant(back, area, {side, angle, require_positive(arc, "arc")}, room);
            },
            nb::arg("back"), nb::arg("box"), nb::arg("side"), nb::arg("angle"), nb::arg("arc"), nb::arg("room"), R"(
    Begin a search with the start alone.

    Args:
        back: Search from the goal back to the start instead.
        box: (4,) xmin, ymin, xmax, ymax that the cells cover, m.
        side: Of a cell, m.
        angle: Of a cell, rad.
        arc: Typical length of an arc, m of cost.
        room: For so many nodes, a power of two.
    )")
        .def(
            "expand",
            [](Lattice &self, RandomState state, double bound, std::int64_t arcs) {
                Random &random = random_of(state);
                require_number(bound, "bound");
                require_count(arcs, "arcs");
                const InUse use(self.lock);
                nb::gil_scoped_release free;
                return self.expand(bound, arcs, random);
            },
            nb::arg("state"), nb::arg("bound"), nb::arg("arcs"), R"(
    Expand nodes, the most promising first, until arcs are tried or nothing promises less than the bound.

    Args:
        state: (1,) of the random generator.
        bound: Cost that a path must stay below, m; falls to that of each path that is found.
        arcs: To try; may be exceeded by three.

    Returns:
        The bound then, and whether the search is over.
    )")
        .def_prop_ro("path", used(+[](const Lattice &self) { return path_or_none(self.path()); }))
        .def_prop_ro("tried", used(+[](const Lattice &self) { return self.tried(); }))
        .def_prop_ro("nodes", used(+[](const Lattice &self) { return to_table(self.nodes()); }));
    m.def(
        "floor_distances",
        [](const Scene &point, const Numbers &grid, std::ptrdiff_t columns, std::ptrdiff_t rows, double least,
           const Numbers &start, const Numbers &goal) {
            const Grid cells = to_grid(grid, columns, rows);
            std::array<std::int64_t, 2> places;
            for (int k = 0; k < 2; ++k) {
                const auto [x, y] = to_place(k == 0 ? start : goal);
                places[k] = cells.cell(x, y);
            }
            require_finite(least, "least");
            std::array<std::vector<double>, 2> away;
            {
                nb::gil_scoped_release free;
                away = floor_distances(point, cells, least, places);
            }
            return std::make_tuple(to_numpy(std::move(away[0]), {columns, rows}),
                                   to_numpy(std::move(away[1]), {columns, rows}));
        },
        nb::arg("point"), nb::arg("grid"), nb::arg("columns"), nb::arg("rows"), nb::arg("least"), nb::arg("start"),
        nb::arg("goal"), R"(
    Return the lengths (columns, rows) of ways to the start and to the goal, m.

    They lead through cells whose middles keep `least` from everything. Steps to or from other cells count as ways
    along all the floor: a gap that the cells miss is not closed, but looked at last.

    Args:
        point: A scene in which a point moves.
        grid: (3,) lower left corner of the cells and their side, m.
        columns: Number of cells along x.
        rows: Number of cells along y.
        least: Distance from everything, m.
        start: (2,) m.
        goal: (2,) m.
    )");
}

} // namespace

void bind_search(nb::module_ &core) {
    auto m = core.def_submodule("search", "What grows trees of arcs, one class for each way.");
    bind_tree(m);
    bind_lattice(m);
}

} // namespace pushplan
