// `pushplan.core.collision`: scenes and collision checks.
#include "numpy_poses.hpp"
#include "obstacle_tree.hpp"
#include "scene.hpp"

namespace pushplan {

namespace {

constexpr std::ptrdiff_t TREE_COLUMNS = 9;

Circle to_circle(const Numbers &array) {
    const double *of = three_finite(array, "a circle");
    return {of[0], of[1], require_not_negative(of[2], "the radius of a circle")};
}

Area to_walls(const Numbers &array) {
    if (array.size() != 4)
        throw std::invalid_argument("walls are four numbers, not " + std::to_string(array.size()));
    for (int k = 0; k < 4; ++k)
        require_number(array.data()[k], "a wall");
    return {array.data()[0], array.data()[1], array.data()[2], array.data()[3]};
}

void require_starts(Row<const std::int64_t> starts, std::size_t corners) {
    bool whole = starts.size > 0 && starts[0] == 0 && starts[starts.size - 1] == static_cast<std::int64_t>(corners);
    for (std::ptrdiff_t i = 0; whole && i + 1 < starts.size; ++i)
        whole = starts[i] < starts[i + 1];
    if (!whole)
        throw std::invalid_argument("the starts of the polygons do not match their corners");
}

Shapes to_shapes(const Numbers &corners, const Integers &starts, const Numbers &bounds) {
    Shapes shapes;
    shapes.corners = to_rows<Corner>(corners, "corners");
    const auto begins = row(starts);
    shapes.starts.assign(begins.begin(), begins.end());
    shapes.bounds = to_rows<Circle>(bounds, "bounds");
    require_starts(begins, shapes.corners.size());
    if (begins.size != shapes.count() + 1)
        throw std::invalid_argument("the numbers of polygons and of bounds differ");
    return shapes;
}

std::vector<TreeNode> to_tree(const Numbers &array, std::int64_t polygons, std::int64_t circles) {
    const auto numbers = table(array);
    if (numbers.columns != TREE_COLUMNS)
        throw std::invalid_argument("nodes of a tree have 9 numbers");
    std::vector<TreeNode> tree;
    for (std::ptrdiff_t i = 0; i < numbers.rows; ++i) {
        const double *of = numbers[i];
        const auto whole = [of](int k) {
            return std::abs(of[k]) < MOST_NUMBERS ? static_cast<std::int64_t>(of[k]) : std::int64_t{-1};
        };
        const TreeNode node{of[0], of[1], of[2], of[3], whole(4), whole(5), whole(6), whole(7), whole(8)};
        for (int k = 0; k < 4; ++k)
            require_number(of[k], "a node of a tree");
        if (node.after <= i || node.first_polygon < 0 || node.last_polygon > polygons || node.first_circle < 0 ||
            node.last_circle > circles)
            throw std::invalid_argument("a node of a tree has missing obstacles, or ends before itself");
        tree.push_back(node);
    }
    return tree;
}

Made<double> from_tree(const std::vector<TreeNode> &tree) {
    auto made = new_array<double>({static_cast<std::ptrdiff_t>(tree.size()), TREE_COLUMNS});
    double *to = made.data();
    for (const TreeNode &node : tree) {
        for (const double value : {node.xmin, node.ymin, node.xmax, node.ymax})
            *to++ = value;
        for (const auto value :
             {node.after, node.first_polygon, node.last_polygon, node.first_circle, node.last_circle})
            *to++ = static_cast<double>(value);
    }
    return made;
}

std::shared_ptr<const Body> to_body(const std::shared_ptr<Shapes> &pieces, const Numbers &bound) {
    return std::make_shared<const Body>(Body{pieces, to_circle(bound)});
}

std::shared_ptr<const Obstacles> to_obstacles(const std::shared_ptr<Shapes> &polygons, const Numbers &circles,
                                              const Numbers &tree, const Numbers &walls) {
    auto discs = to_rows<Circle>(circles, "circles");
    auto nodes = to_tree(tree, polygons->count(), static_cast<std::int64_t>(discs.size()));
    return std::make_shared<const Obstacles>(Obstacles{polygons, std::move(discs), std::move(nodes), to_walls(walls)});
}

std::shared_ptr<Shapes> shared(const std::shared_ptr<const Shapes> &shapes) {
    return std::const_pointer_cast<Shapes>(shapes); // Python only reads them
}

Made<double> circle_array(const Circle &circle) { return copied(&circle.x, {3}); }

void bind_shapes(nb::module_ &m) {
    nb::class_<Shapes>(m, "Shapes", R"(
    Convex polygons, flattened.

    Attributes:
        corners: (v, 4) counter-clockwise corners and the outward unit normal of the edge that begins there.
        starts: (q + 1,) index of each polygon's first corner.
        bounds: (q, 3) centre and radius of a circle around each polygon.
    )")
        .def(MadeBy(&to_shapes), nb::arg("corners"), nb::arg("starts"), nb::arg("bounds"))
        .def_prop_ro("corners",
                     [](const nb::object &self) {
                         const auto &of = nb::cast<const Shapes &>(self).corners;
                         return read_only(&of.data()->x, {static_cast<std::ptrdiff_t>(of.size()), 4}, self);
                     })
        .def_prop_ro("starts", [](const Shapes &self) { return copied(self.starts); })
        .def_prop_ro("bounds",
                     [](const nb::object &self) {
                         const auto &of = nb::cast<const Shapes &>(self).bounds;
                         return read_only(&of.data()->x, {static_cast<std::ptrdiff_t>(of.size()), 3}, self);
                     })
        .def(PickledBy{"corners", "starts", "bounds"});
}

Scene to_scene(const std::shared_ptr<Shapes> &body, const Numbers &body_bound, const std::shared_ptr<Shapes> &obstacles,
               const Numbers &circles, const Numbers &tree, const Numbers &walls, double clearance, double kept) {
    return {to_body(body, body_bound), to_obstacles(obstacles, circles, tree, walls),
            require_finite(clearance, "clearance"), require_finite(kept, "kept")};
}

void bind_scene(nb::module_ &m) {
    nb::class_<Scene>(m, "Scene", R"(
    The moving body and the obstacles.

    Attributes:
        body: Convex pieces of pusher and objects in the chain frame.
        body_bound: (3,) centre and radius of a circle around the body, chain frame.
        obstacles: Convex pieces of polygonal obstacles, world frame.
        circles: (c, 3) centre and radius of round obstacles, world frame.
        tree: (t, 9) tree of boxes around groups of obstacles, in preorder; see `standing_shapes`.
        walls: (4,) workspace (xmin, ymin, xmax, ymax); infinite if there is none.
        clearance: Distance (m) from all obstacles at checked poses.
        kept: Smaller distance (m) that is proven between checked poses.
    )")
        .def(MadeBy(&to_scene), nb::arg("body"), nb::arg("body_bound"), nb::arg("obstacles"), nb::arg("circles"),
             nb::arg("tree"), nb::arg("walls"), nb::arg("clearance"), nb::arg("kept"))
        .def_prop_ro("body", [](const Scene &self) { return shared(self.body->pieces); })
        .def_prop_ro("body_bound", [](const Scene &self) { return circle_array(self.body->bound); })
        .def_prop_ro("obstacles", [](const Scene &self) { return shared(self.obstacles->polygons); })
        .def_prop_ro("circles", [](const Scene &self) { return to_table(self.obstacles->circles); })
        .def_prop_ro("tree", [](const Scene &self) { return from_tree(self.obstacles->tree); })
        .def_prop_ro("walls", [](const Scene &self) { return copied(&self.obstacles->walls.xmin, {4}); })
        .def_ro("clearance", &Scene::clearance)
        .def_ro("kept", &Scene::kept)
        .def(
            "with_distances",
            [](const Scene &self, double clearance, double kept) {
                return self.with_distances(require_finite(clearance, "clearance"), require_finite(kept, "kept"));
            },
            nb::arg("clearance"), nb::arg("kept"), "Return the scene with other distances, m.")
        .def(
            "with_gap",
            [](const Scene &self, double gap, double clearance) {
                return scene_with_gap(self, require_finite(gap, "gap"), require_finite(clearance, "clearance"));
            },
            nb::arg("gap"), nb::arg("clearance"), R"(
    Return the scene with the distances that can be kept if start and goal have the distance `gap`, m.

    Checked poses keep this distance, or the clearance if that is more. Poses between them keep the clearance, reduced
    by at most `CLEARANCE_ROOM` if start and goal are too near to prove it.
    )")
        .def(
            "with_body",
            [](const Scene &self, const std::shared_ptr<Shapes> &body, const Numbers &body_bound) {
                return Scene{to_body(body, body_bound), self.obstacles, self.clearance, self.kept};
            },
            nb::arg("body"), nb::arg("body_bound"), "Return the scene with another moving body.")
        .def(
            "with_obstacles",
            [](const Scene &self, const std::shared_ptr<Shapes> &obstacles, const Numbers &circles, const Numbers &tree,
               const Numbers &walls) {
                return Scene{self.body, to_obstacles(obstacles, circles, tree, walls), self.clearance, self.kept};
            },
            nb::arg("obstacles"), nb::arg("circles"), nb::arg("tree"), nb::arg("walls"),
            "Return the scene with other obstacles.")
        .def(PickledBy{"body", "body_bound", "obstacles", "circles", "tree", "walls", "clearance", "kept"});
}

Outlines to_outlines(const Numbers &corners, const Integers &starts) {
    Outlines polygons{to_rows<Point>(corners, "corners"), row(starts)};
    require_starts(polygons.starts, polygons.corners.size());
    return polygons;
}

std::shared_ptr<Shapes> flat(const Numbers &corners, const Integers &starts) {
    return std::make_shared<Shapes>(flattened(to_outlines(corners, starts)));
}

auto bulges(const Numbers &corners, const Integers &starts) {
    Bulges found = bulges_of(to_outlines(corners, starts));
    return std::make_tuple(to_numpy(std::move(found.out)), to_numpy(std::move(found.left)));
}

auto standing_shapes(const Numbers &corners, const Integers &starts, const Numbers &circles) {
    const Outlines polygons = to_outlines(corners, starts);
    const auto discs = to_rows<Circle>(circles, "circles");
    std::vector<Area> boxes = boxes_around(polygons);
    for (const auto &[x, y, radius] : discs)
        boxes.push_back({x - radius, y - radius, x + radius, y + radius});
    const auto [tree, order] = obstacle_tree(boxes, polygons.count());
    Outlines standing;
    std::vector<std::int64_t> begins{0};
    std::vector<Circle> round;
    for (const std::int64_t i : order) {
        if (i >= polygons.count()) {
            round.push_back(discs[i - polygons.count()]);
            continue;
        }
        const auto first = polygons.corners.begin();
        standing.corners.insert(standing.corners.end(), first + polygons.starts[i], first + polygons.starts[i + 1]);
        begins.push_back(static_cast<std::int64_t>(standing.corners.size()));
    }
    standing.starts = {begins.data(), static_cast<std::ptrdiff_t>(begins.size())};
    return std::make_tuple(std::make_shared<Shapes>(flattened(standing)), to_table(round), from_tree(tree));
}

auto rings_of(const Numbers &corners, const Integers &origin, const Integers &twin) {
    const auto points = to_rows<Point>(corners, "corners");
    const auto begins = row(origin), twins = row(twin);
    const auto inside = [](Row<const std::int64_t> numbers, std::int64_t first, std::size_t last) {
        for (const std::int64_t number : numbers)
            if (number < first || number >= static_cast<std::int64_t>(last))
                return false;
        return true;
    };
    if (begins.size % 3 != 0 || twins.size != begins.size || !inside(begins, 0, points.size()) ||
        !inside(twins, -1, static_cast<std::size_t>(begins.size)))
        throw std::invalid_argument("each triangle needs three edges that begin at corners");
    Rings rings = join_triangles(points, begins, twins);
    return std::make_tuple(to_numpy(std::move(rings.corners)), to_numpy(std::move(rings.starts)));
}

Made<double> separations(const Scene &scene, const Numbers &poses, double enough) {
    const auto rows = to_rows<Pose>(poses, "poses");
    require_number(enough, "enough");
    std::vector<double> gaps(rows.size());
    {
        nb::gil_scoped_release free;
        for (std::size_t i = 0; i < rows.size(); ++i)
            gaps[i] = separation(scene, rows[i], enough);
    }
    return to_numpy(std::move(gaps));
}

} // namespace

void bind_collision(nb::module_ &core) {
    auto m = core.def_submodule("collision", R"(
    Collision checks of the chain: scenes, separations and swept arcs.

    A swept arc is proven free by conservative advancement (Mirtich 1996): from a pose with a separation d from every
    obstacle, no point of the body can touch anything before it has travelled d.
    )");
    bind_shapes(m);
    bind_scene(m);
    m.attr("SLACK") = SLACK;
    m.attr("ROUNDING") = ROUNDING;
    m.attr("CLEARANCE_ROOM") = CLEARANCE_ROOM;
    m.def("flatten", &flat, nb::arg("corners"), nb::arg("starts"), R"(
    Return convex polygons with edge normals and bounding circles.

    Args:
        corners: (v, 2) counter-clockwise corners, polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
    )");
    m.def("bulges", &bulges, nb::arg("corners"), nb::arg("starts"), R"(
    Return how far corners stick out of polygons (v,), < 0 inwards, m, and whether each polygon turns left (q,), 0 or 1.

    Args:
        corners: (v, 2) corners, polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
    )");
    m.def("standing_shapes", &standing_shapes, nb::arg("corners"), nb::arg("starts"), nb::arg("circles"), R"(
    Return obstacles in the order of their tree.

    The tree is halved at the median along the longer side of the extent of the obstacles' centres.

    Args:
        corners: (v, 2) counter-clockwise corners of convex polygons, polygon after polygon.
        starts: (q + 1,) index of each polygon's first corner.
        circles: (c, 3) centre and radius of round obstacles.

    Returns:
        The polygons; the circles (c, 3); and nodes (t, 9) in preorder. A node holds its box, the row of the next node
        that is not below it, and the ranges (first, last + 1) of its polygons and circles. The ranges are empty except
        in leaves.
    )");
    m.def("join_triangles", &rings_of, nb::arg("corners"), nb::arg("origin"), nb::arg("twin"), R"(
    Join triangles to convex pieces (Hertel and Mehlhorn 1983).

    Args:
        corners: (n, 2) points.
        origin: (3 t,) first point of each edge, three edges per triangle.
        twin: (3 t,) the opposite edge of each edge, or -1.

    Returns:
        The corners (k,) of convex pieces, piece after piece, and the first corner of each (p + 1,).
    )");
    m.def(
        "separations", &separations, nb::arg("scene"), nb::arg("poses"), nb::arg("enough"),
        "Return lower bounds (m,) of the body's distance from all obstacles at poses (m, 3), capped at `enough`, m.");
    m.def(
        "sweep_is_free",
        [](const Scene &scene, const Numbers &pose, const Numbers &twist, double length) {
            return sweep_is_free(scene, to_pose(pose), to_twist(twist), require_not_negative(length, "length"));
        },
        nb::arg("scene"), nb::arg("pose"), nb::arg("twist"), nb::arg("length"), R"(
    Return whether an arc from a pose (3,) is proven to be collision-free.

    Every checked pose has at least `scene.clearance`, every pose in between at least `scene.kept`: a separation d at s
    covers all s' with |s' - s| <= (d - kept) / (top speed of the body). Intervals are checked in the middle first,
    where a collision is found soonest. An arc that comes closer than `scene.clearance` can be refused.
    )");
}

} // namespace pushplan
