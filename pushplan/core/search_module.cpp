// `pushplan.core.search`: searches that grow trees of arcs, one class for each kind.
#include "lattice.hpp"
#include "numpy_poses.hpp"
#include "tree.hpp"

namespace pushplan {

namespace {

using Shared = std::shared_ptr<Problem>;

Area to_area(const Numbers &array) {
    if (array.size() != 4)
        throw std::invalid_argument("a box needs four numbers, not " + std::to_string(array.size()));
    const double *of = array.data();
    require_all_finite(of, 4, "a box");
    return {of[0], of[1], of[2], of[3]};
}

// Return a path (k, 4), or None if it is empty.
std::optional<Made<double>> path_or_none(const std::vector<Arc> &path) {
    if (path.empty())
        return std::nullopt;
    return to_table(path);
}

// Check and return the pose of a tree's row (-1 for none) from which a call continues towards another tree.
Pose check_place(const Tree &tree, std::int64_t row, const std::array<double, 3> &pose, double bound,
                 const Tree &other) {
    if (other.back() == tree.back())
        throw std::invalid_argument("one of two meeting trees must grow back from the goal");
    require_index(row, -1, static_cast<std::int64_t>(tree.nodes().size()), "row");
    require_all_finite(pose.data(), 3, "pose");
    require_number(bound, "bound");
    return pose_at(pose.data());
}

// Wrap a function of an object so that it throws while another thread uses the object.
template <class Result, class Class> auto used(Result (*function)(const Class &)) {
    return [function](const Class &self) {
        const InUse use(self.lock);
        return function(self);
    };
}

// Throw unless the number of cells fits into the keys of `cells.hpp`.
void require_cells(double cells, const char *name) {
    if (!(cells < static_cast<double>(MOST_CELLS)))
        throw std::invalid_argument(std::string(name) + " must be fewer than 2^20");
}

void bind_tree(nb::module_ &m) {
    using Row = std::int64_t;
    nb::class_<Tree>(m, "Tree", R"(
    A tree that OMPL's planners grow: they choose the node and the control of each extension.

    An extension is (kept, cost, promise, x, y, theta): whether a new node can be on a path below the bound; the cost of
    the whole path through it, infinite if all connections are blocked; the cost of the cheapest steering path to the
    other tree's root, blocked or not; and its pose.

    Args:
        problem: Push problem.
        root: (3,) pose.
        heading_length: Distance that a radian counts as in the choice of the other tree's nearest nodes, m.
        back: Whether the tree grows against the direction of travel, so that its arcs lead to the root.

    Attributes:
        nodes: Copy (n, 9) of the tree: pose, cost to the root, parent, and the arc between them (vx, vy, omega,
            length).
        path: Path (k, 4) of the last connection, from the start to the goal; None before the first one.
    )")
        .def(MadeBy(+[](const Shared &problem, const Numbers &root, double heading_length, bool back) {
                 return Tree(problem, to_pose(root), require_positive(heading_length, "heading_length"), back);
             }),
             nb::arg("problem"), nb::arg("root"), nb::arg("heading_length"), nb::arg("back") = false)
        .def(
            "take", [](Tree &self, const Shared &problem) { self.take(problem); }, nb::arg("problem"),
            "Use another problem from now on.")
        .def(
            "clear", [](Tree &self, const Numbers &root) { self.clear(to_pose(root)); }, nb::arg("root"),
            "Clear the tree except for its root.")
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
    Grow by one arc from the pose of a row, and try to connect its end exactly to the opposite tree.

    Args:
        row: Row of the parent. A kept node becomes the last row. With -1 (no arc leads to the pose), no row is added.
        pose: x, y and theta.
        controls: Segment of the stable set, place on it, and share of the longest arc, each in [0, 1].
        bound: Upper limit of a whole path's cost.
        other: The opposite tree. Its root and its nearest nodes are tried.

    Returns:
        Whether the node was kept, the cost of the whole path, the cost of the cheapest steering path, and the pose.

    Raises:
        ValueError: If the row or a number is invalid, or both trees grow in the same direction.
    )")
        .def(
            "connect",
            [](const Tree &self, Row row, const std::array<double, 3> &pose, double bound, const Tree &other) {
                const Extension found = self.connect(row, check_place(self, row, pose, bound, other), bound, other);
                return std::make_tuple(found.cost, found.promise);
            },
            nb::arg("row"), nb::arg("pose"), nb::arg("bound"), nb::arg("other"), R"(
    Return the cost of a path through a row (-1: none) and a free steering path, and the cost of the cheapest one.

    The steering paths lead to the root of the other tree.
    )")
        .def(
            "room_at",
            [](const Tree &self, double x, double y, double theta) {
                for (const double number : {x, y, theta})
                    require_finite(number, "pose");
                return self.room_at({x, y, theta});
            },
            nb::arg("x"), nb::arg("y"), nb::arg("theta"), R"(
    Return the body's distance (m) from all obstacles at a pose, beyond the clearance; negative if too near.

    Distances are capped at twice the clearance.
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

// Return the grid of a table from the lower left corner and the side of its cells (3,), m.
Grid to_grid(const Numbers &grid, std::ptrdiff_t columns, std::ptrdiff_t rows) {
    const double *of = three_finite(grid, "a grid");
    if (require_room(std::array{columns, rows}, "a grid") == 0)
        throw std::invalid_argument("a grid needs at least one cell");
    return {of[0], of[1], require_positive(of[2], "the side of a grid's cells"), columns, rows};
}

std::array<double, 2> to_place(const Numbers &array) {
    if (array.size() < 2)
        throw std::invalid_argument("a place needs two numbers, not " + std::to_string(array.size()));
    require_all_finite(array.data(), 2, "a place");
    return {array.data()[0], array.data()[1]};
}

Lattice to_lattice(const Shared &problem, const Numbers &start, const Numbers &middle, const Numbers &grid,
                   const Numbers &away) {
    const auto of = table(away);
    const auto cells = of.rows * of.columns;
    for (std::ptrdiff_t i = 0; i < cells; ++i)
        require_number(of.data[i], "a distance");
    return Lattice(problem, to_pose(start), to_place(middle), to_grid(grid, of.rows, of.columns),
                   std::vector<double>(of.data, of.data + cells));
}

void bind_lattice(nb::module_ &m) {
    nb::class_<Lattice>(m, "Lattice", R"(
    Best-first search over a lattice of poses. Each search reuses the memory of the one before.

    Args:
        problem: Push problem.
        start: (3,) start pose.
        middle: (2 or more,) reference point of the floor distances on the body, chain frame, m.
        grid: (3,) lower left corner and side of the floor cells, m.
        away: (nx, ny) distances from the goal around the obstacles, m.

    Attributes:
        path: Best path (k, 4); None if there is none.
        tried: Number of arcs tried.
        nodes: Copy of the nodes (n, 9); see `Tree.nodes`.
    )")
        .def(MadeBy(&to_lattice), nb::arg("problem"), nb::arg("start"), nb::arg("middle"), nb::arg("grid"),
             nb::arg("away"))
        .def(
            "plant",
            [](Lattice &self, const Numbers &box, double side, double angle, double arc, std::int64_t room) {
                const InUse use(self.lock);
                if (room < 1 || (room & (room - 1)) != 0 || room > std::int64_t{1} << 22)
                    throw std::invalid_argument("the room for nodes must be a power of two up to 2^22, not " +
                                                std::to_string(room));
                const Area area = to_area(box);
                const double longer = std::max(area.xmax - area.xmin, area.ymax - area.ymin);
                require_cells(longer / require_positive(side, "side"), "cells of the box");
                require_cells(2.0 * PI / require_positive(angle, "angle"), "cells of a turn");
                self.plant(area, {side, angle, require_positive(arc, "arc")}, room);
            },
            nb::arg("box"), nb::arg("side"), nb::arg("angle"), nb::arg("arc"), nb::arg("room"), R"(
    Begin a search with the start alone.

    Args:
        box: (4,) xmin, ymin, xmax, ymax that the cells cover, m.
        side: Side of a cell, m.
        angle: Angle of a cell, rad.
        arc: Typical length of an arc, m of cost.
        room: Maximum number of nodes, a power of two.
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
    Expand nodes, lowest estimate first, until arcs are tried or no estimate is below the bound.

    Args:
        state: (1,) state of the random generator.
        bound: Upper limit of a path's cost, m. It falls to the cost of each path found.
        arcs: Number of arcs to try; up to three more are possible.

    Returns:
        The final bound, and whether the search is over.
    )")
        .def_prop_ro("path", used(+[](const Lattice &self) { return path_or_none(self.path()); }))
        .def_prop_ro("tried", used(+[](const Lattice &self) { return self.tried(); }))
        .def_prop_ro("nodes", used(+[](const Lattice &self) { return to_table(self.nodes()); }));
    m.def(
        "floor_distances",
        [](const Scene &point, const Numbers &grid, std::ptrdiff_t columns, std::ptrdiff_t rows, double least,
           const Numbers &place) {
            const Grid cells = to_grid(grid, columns, rows);
            const auto [x, y] = to_place(place);
            require_finite(least, "least");
            std::vector<double> away;
            {
                nb::gil_scoped_release free;
                away = floor_distances(point, cells, least, cells.cell(x, y));
            }
            return to_numpy(std::move(away), {columns, rows});
        },
        nb::arg("point"), nb::arg("grid"), nb::arg("columns"), nb::arg("rows"), nb::arg("least"), nb::arg("place"),
        R"(
    Return the lengths (columns, rows) of paths to a place, m.

    The paths lead through cells whose middles keep `least` from everything. A step to or from another cell costs as
    much as a path along the whole floor. So a gap that the cells miss is not closed, but searched last.

    Args:
        point: A scene in which a point moves.
        grid: (3,) lower left corner of the cells and their side, m.
        columns: Number of cells along x.
        rows: Number of cells along y.
        least: Distance from everything, m.
        place: (2,) position, m.
    )");
}

} // namespace

void bind_search(nb::module_ &core) {
    auto m = core.def_submodule("search", "Searches that grow trees of arcs, one class for each kind.");
    bind_tree(m);
    bind_lattice(m);
}

} // namespace pushplan
