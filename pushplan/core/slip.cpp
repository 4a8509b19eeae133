// Pushing with slip as Python sees it: `pushplan.core.slip`.
#include "numpy.hpp"
#include "slip_simulation.hpp"

namespace pushplan::slip {

namespace {

void require(bool fits, const char *what) {
    if (!fits)
        throw std::invalid_argument(what);
}

// Whether numbers begin with 0 and do not become less.
bool grows_from_zero(Row<const std::int64_t> numbers) {
    if (numbers.size == 0 || numbers[0] != 0)
        return false;
    for (std::ptrdiff_t i = 1; i < numbers.size; ++i)
        if (numbers[i] < numbers[i - 1])
            return false;
    return true;
}

// What a world is made of, as `slip.pyi` describes it.
struct Rows {
    Table<const double> feet;
    Row<const std::int64_t> first_foot;
    Table<const double> loads, center, corners;
    Table<const std::int64_t> parts;
    Table<const double> circles;
    Table<const std::int64_t> pairs;
    Row<const double> friction;
    Row<const std::int64_t> order;
};

void check(const Rows &rows) {
    const std::ptrdiff_t n = rows.loads.rows;
    require(rows.feet.columns == 4 && rows.loads.columns == 5 && rows.center.columns == 2 &&
                rows.corners.columns == 5 && rows.parts.columns == 3 && rows.circles.columns == 4,
            "feet, loads, center, corners, parts and circles have 4, 5, 2, 5, 3 and 4 columns");
    require(rows.pairs.columns == 3 || rows.pairs.rows == 0, "pairs have 3 columns");
    require(rows.center.rows == n && rows.order.size == n && rows.first_foot.size == n + 1,
            "there is a load, a centre, a first foot and a place in the order for every object");
    require(grows_from_zero(rows.first_foot) && rows.first_foot[n] == rows.feet.rows,
            "feet are those of one object after another");
    require(rows.circles.rows == rows.parts.rows && rows.friction.size == rows.pairs.rows,
            "there is a circle for every piece, and a friction for every pair");
    for (std::ptrdiff_t p = 0; p < rows.parts.rows; ++p) {
        const std::int64_t *part = rows.parts[p];
        require(0 <= part[0] && part[0] <= n + 1 && 0 <= part[1] && part[1] < part[2] && part[2] <= rows.corners.rows,
                "a piece is of a body, and has corners");
    }
    for (std::ptrdiff_t q = 0; q < rows.pairs.rows; ++q) {
        const std::int64_t *pair = rows.pairs[q];
        for (int k = 0; k < 2; ++k)
            require(0 <= pair[k] && pair[k] < rows.parts.rows, "a pair is of two pieces");
        require(-1 <= pair[2] && pair[2] < n, "a contact is that of an object, or -1");
    }
    std::vector<char> there(n, 0);
    for (const std::int64_t own : rows.order) {
        require(0 <= own && own < n && !there[own], "the order names every object once");
        there[own] = 1;
    }
}

std::shared_ptr<World> make_world(const Numbers &feet, const Integers &first_foot, const Numbers &loads,
                                  const Numbers &center, const Numbers &corners, const Integers &parts,
                                  const Numbers &circles, const Integers &pairs, const Numbers &friction,
                                  double length, const Integers &order) {
    const Rows rows{table(feet),  row(first_foot), table(loads), table(center),   table(corners),
                    table(parts), table(circles),  table(pairs), row(friction), row(order)};
    check(rows);
    auto world = std::make_shared<World>();
    world->length = length;
    world->order.assign(rows.order.begin(), rows.order.end());
    for (std::ptrdiff_t j = 0; j < rows.feet.rows; ++j)
        world->feet.push_back({rows.feet[j][0], rows.feet[j][1], rows.feet[j][2], rows.feet[j][3]});
    for (std::ptrdiff_t i = 0; i < rows.loads.rows; ++i) {
        const double *load = rows.loads[i];
        world->objects.push_back({static_cast<int>(rows.first_foot[i]), static_cast<int>(rows.first_foot[i + 1]),
                                  load[0], load[1], load[2], load[3], load[4], rows.center[i][0], rows.center[i][1]});
    }
    for (std::ptrdiff_t k = 0; k < rows.corners.rows; ++k) {
        const double *corner = rows.corners[k];
        world->corners.push_back({corner[0], corner[1], corner[2], corner[3], corner[4] != 0.0});
    }
    for (std::ptrdiff_t p = 0; p < rows.parts.rows; ++p) {
        const std::int64_t *part = rows.parts[p];
        const double *circle = rows.circles[p];
        world->pieces.push_back({static_cast<int>(part[0]), static_cast<int>(part[1]), static_cast<int>(part[2]),
                                 circle[0], circle[1], circle[2], circle[3]});
    }
    for (std::ptrdiff_t q = 0; q < rows.pairs.rows; ++q) {
        const std::int64_t *pair = rows.pairs[q];
        world->pairs.push_back(
            {static_cast<int>(pair[0]), static_cast<int>(pair[1]), static_cast<int>(pair[2]), rows.friction[q]});
    }
    return world;
}

std::shared_ptr<World> with_loads(const World &world, const Numbers &friction_loads, const Numbers &foot_loads,
                                  const Numbers &contact_frictions) {
    const auto loads = row(friction_loads), of_feet = row(foot_loads), frictions = row(contact_frictions);
    require(loads.size == world.plate() && of_feet.size == static_cast<std::ptrdiff_t>(world.feet.size()),
            "there is a load for every object, and for every foot");
    auto changed = std::make_shared<World>(world);
    for (std::ptrdiff_t j = 0; j < of_feet.size; ++j)
        changed->feet[j].load = of_feet[j];
    for (std::ptrdiff_t i = 0; i < loads.size; ++i) {
        // h mu goes with mu, and mu with the sum of mu N: the weight stays.
        Object &object = changed->objects[i];
        object.shift *= loads[i] / object.load;
        object.load = loads[i];
    }
    for (Pair &pair : changed->pairs)
        if (pair.contact >= 0) {
            require(pair.contact < frictions.size, "there is a friction for every contact of the chain");
            pair.friction = frictions[pair.contact];
        }
    return changed;
}

// An array with a row for each thing, of numbers that `numbers_of` names.
template <class Number, std::size_t columns, class Thing, class Function>
py::array_t<Number> rows_of(const std::vector<Thing> &things, Function numbers_of) {
    std::vector<Number> numbers;
    for (const Thing &thing : things)
        for (const auto number : std::array<Number, columns>(numbers_of(thing)))
            numbers.push_back(number);
    const auto count = static_cast<py::ssize_t>(things.size());
    if (columns == 1)
        return to_numpy(std::move(numbers), {count});
    return to_numpy(std::move(numbers), {count, static_cast<py::ssize_t>(columns)});
}

using Index = std::int64_t;

py::array_t<double> feet_of(const World &world) {
    return rows_of<double, 4>(world.feet, [](const Foot &foot) -> std::array<double, 4> {
        return {foot.x, foot.y, foot.load, foot.stiffness};
    });
}

py::array_t<Index> first_foot_of(const World &world) {
    std::vector<Index> first{0};
    for (const Object &object : world.objects)
        first.push_back(object.last_foot);
    const auto count = static_cast<py::ssize_t>(first.size());
    return to_numpy(std::move(first), {count});
}

py::array_t<double> loads_of(const World &world) {
    return rows_of<double, 5>(world.objects, [](const Object &object) -> std::array<double, 5> {
        return {object.load, object.shift, object.sxx, object.sxy, object.syy};
    });
}

py::array_t<double> center_of(const World &world) {
    return rows_of<double, 2>(world.objects,
                              [](const Object &object) -> std::array<double, 2> { return {object.cx, object.cy}; });
}

py::array_t<double> corners_of(const World &world) {
    return rows_of<double, 5>(world.corners, [](const Corner &corner) -> std::array<double, 5> {
        return {corner.x, corner.y, corner.nx, corner.ny, corner.outer ? 1.0 : 0.0};
    });
}

py::array_t<Index> parts_of(const World &world) {
    return rows_of<Index, 3>(world.pieces, [](const Piece &piece) -> std::array<Index, 3> {
        return {piece.body, piece.first, piece.last};
    });
}

py::array_t<double> circles_of(const World &world) {
    return rows_of<double, 4>(world.pieces, [](const Piece &piece) -> std::array<double, 4> {
        return {piece.cx, piece.cy, piece.radius, piece.rounding};
    });
}

py::array_t<Index> pairs_of(const World &world) {
    return rows_of<Index, 3>(world.pairs,
                             [](const Pair &pair) -> std::array<Index, 3> { return {pair.a, pair.b, pair.contact}; });
}

py::array_t<double> friction_of(const World &world) {
    return rows_of<double, 1>(world.pairs, [](const Pair &pair) -> std::array<double, 1> { return {pair.friction}; });
}

py::array_t<Index> order_of(const World &world) {
    return rows_of<Index, 1>(world.order, [](int own) -> std::array<Index, 1> { return {own}; });
}

py::tuple world_to_tuple(const World &world) {
    return py::make_tuple(feet_of(world), first_foot_of(world), loads_of(world), center_of(world), corners_of(world),
                          parts_of(world), circles_of(world), pairs_of(world), friction_of(world), world.length,
                          order_of(world));
}

std::shared_ptr<World> world_from_tuple(const py::tuple &t) {
    return make_world(t[0].cast<Numbers>(), t[1].cast<Integers>(), t[2].cast<Numbers>(), t[3].cast<Numbers>(),
                      t[4].cast<Numbers>(), t[5].cast<Integers>(), t[6].cast<Numbers>(), t[7].cast<Integers>(),
                      t[8].cast<Numbers>(), t[9].cast<double>(), t[10].cast<Integers>());
}

std::vector<Pose> poses_of(Table<const double> rows, std::ptrdiff_t count) {
    require(rows.rows == count && rows.columns == 3, "there is a pose x, y, theta for every body");
    std::vector<Pose> poses;
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i)
        poses.push_back({rows[i][0], rows[i][1], rows[i][2]});
    return poses;
}

Simulation make_simulation(std::shared_ptr<World> world, const Numbers &object_poses, const Numbers &plate_pose) {
    const auto plate = row(plate_pose);
    require(plate.size == 3, "the pose of the plate is x, y, theta");
    const auto objects = poses_of(table(object_poses), world->plate());
    return Simulation(std::move(world), objects, {plate[0], plate[1], plate[2]});
}

py::array_t<double> object_poses_of(const Simulation &simulation) {
    const std::size_t n = simulation.world->objects.size();
    std::vector<double> numbers(3 * n);
    for (std::size_t i = 0; i < n; ++i) {
        const Pose &pose = simulation.state.poses[i];
        double *row = numbers.data() + 3 * simulation.world->order[i];
        row[0] = pose.x;
        row[1] = pose.y;
        row[2] = pose.theta;
    }
    return to_numpy(std::move(numbers), {static_cast<py::ssize_t>(n), 3});
}

py::array_t<double> plate_pose_of(const Simulation &simulation) {
    const Pose &pose = simulation.state.poses.back();
    return to_numpy(std::vector<double>{pose.x, pose.y, pose.theta}, {3});
}

py::tuple simulation_to_tuple(const Simulation &simulation) {
    const State &state = simulation.state;
    const auto triple = [](double x, double y, double w) { return std::array<double, 3>{x, y, w}; };
    return py::make_tuple(
        simulation.world,
        rows_of<double, 3>(state.poses, [&](const Pose &pose) { return triple(pose.x, pose.y, pose.theta); }),
        rows_of<double, 3>(state.twists, [&](const Vector &u) { return triple(u.x, u.y, u.w); }),
        rows_of<double, 2>(state.drag, [](const std::array<double, 2> &drag) { return drag; }),
        rows_of<double, 4>(state.memory,
                           [](const Memory &memory) -> std::array<double, 4> {
                               return {memory.force[0], memory.force[1], memory.force[2], double(memory.points)};
                           }),
        state.steps);
}

Simulation simulation_from_tuple(const py::tuple &t) {
    auto world = t[0].cast<std::shared_ptr<World>>();
    const auto n = world->plate();
    const auto kept = t[1].cast<Numbers>(), twists = t[2].cast<Numbers>(), drag = t[3].cast<Numbers>(),
               memory = t[4].cast<Numbers>();
    const auto poses = poses_of(table(kept), n + 1), motions = poses_of(table(twists), n);
    const auto drags = table(drag), memories = table(memory);
    require(drags.rows == n && drags.columns == 2 && memories.columns == 4 &&
                memories.rows == static_cast<std::ptrdiff_t>(world->pairs.size()),
            "there is a drag for every object, and a memory for every pair");
    Simulation simulation(world, poses, poses.back());
    simulation.state.poses = poses;
    for (int i = 0; i < n; ++i) {
        simulation.state.twists[i] = {motions[i].x, motions[i].y, motions[i].theta};
        simulation.state.drag[i] = {drags[i][0], drags[i][1]};
    }
    for (std::ptrdiff_t q = 0; q < memories.rows; ++q) {
        const double *old = memories[q];
        simulation.state.memory[q] = {{old[0], old[1], old[2]}, static_cast<int>(old[3])};
    }
    simulation.state.steps = t[5].cast<std::int64_t>();
    return simulation;
}

// A trace as arrays.
struct TraceArrays {
    py::array poses, modes, forces, wrenches, others, residual, end;
};

TraceArrays march(Simulation &simulation, const Numbers &twists) {
    const auto rows = table(twists);
    require(rows.columns == 3, "twists are v_x, v_y, omega");
    Trace trace;
    {
        py::gil_scoped_release free;
        trace = simulation.march(rows);
    }
    const auto m = static_cast<py::ssize_t>(trace.end.size()), n = static_cast<py::ssize_t>(simulation.world->plate());
    return {to_numpy(std::move(trace.poses), {m, n, 3}),    to_numpy(std::move(trace.modes), {m, n}),
            to_numpy(std::move(trace.forces), {m, n, 3}),   to_numpy(std::move(trace.wrenches), {m, 3}),
            to_numpy(std::move(trace.others), {m, n}),      to_numpy(std::move(trace.residual), {m}),
            to_numpy(std::move(trace.end), {m})};
}

void bind_constants(py::module_ &m) {
    m.attr("OPEN") = static_cast<int>(OPEN);
    m.attr("STICK") = static_cast<int>(STICK);
    m.attr("SLIDE") = static_cast<int>(SLIDE);
    m.attr("ROLL") = static_cast<int>(ROLL);
    m.attr("ROLL_SLIDE") = static_cast<int>(ROLL_SLIDE);
    m.attr("CONVERGED") = static_cast<int>(CONVERGED);
    m.attr("FALLBACK") = static_cast<int>(FALLBACK);
    m.attr("UNSOLVED") = static_cast<int>(UNSOLVED);
    m.attr("JAMMED") = static_cast<int>(JAMMED);
    m.attr("CROWDED") = static_cast<int>(CROWDED);
}

} // namespace

} // namespace pushplan::slip

namespace pushplan {

void bind_slip(py::module_ &parent) {
    using namespace slip;
    py::module_ m = parent.def_submodule("slip");
    bind_constants(m);
    py::class_<World, std::shared_ptr<World>>(m, "World")
        .def(py::init(&make_world), py::kw_only(), py::arg("feet"), py::arg("first_foot"), py::arg("loads"),
             py::arg("center"), py::arg("corners"), py::arg("parts"), py::arg("circles"), py::arg("pairs"),
             py::arg("friction"), py::arg("length"), py::arg("order"))
        .def("with_loads", &with_loads, py::arg("friction_loads"), py::arg("foot_loads"), py::arg("contact_frictions"))
        .def_property_readonly("feet", &feet_of)
        .def_property_readonly("first_foot", &first_foot_of)
        .def_property_readonly("loads", &loads_of)
        .def_property_readonly("center", &center_of)
        .def_property_readonly("corners", &corners_of)
        .def_property_readonly("parts", &parts_of)
        .def_property_readonly("circles", &circles_of)
        .def_property_readonly("pairs", &pairs_of)
        .def_property_readonly("friction", &friction_of)
        .def_readonly("length", &World::length)
        .def_property_readonly("order", &order_of)
        .def_property_readonly("room", &World::room)
        .def(py::pickle(&world_to_tuple, &world_from_tuple));
    py::class_<TraceArrays>(m, "Trace")
        .def_readonly("poses", &TraceArrays::poses)
        .def_readonly("modes", &TraceArrays::modes)
        .def_readonly("forces", &TraceArrays::forces)
        .def_readonly("wrenches", &TraceArrays::wrenches)
        .def_readonly("others", &TraceArrays::others)
        .def_readonly("residual", &TraceArrays::residual)
        .def_readonly("end", &TraceArrays::end)
        .def(py::pickle(
            [](const TraceArrays &t) {
                return py::make_tuple(t.poses, t.modes, t.forces, t.wrenches, t.others, t.residual, t.end);
            },
            [](const py::tuple &t) { return TraceArrays{t[0], t[1], t[2], t[3], t[4], t[5], t[6]}; }));
    py::class_<Simulation>(m, "Simulation")
        .def(py::init(&make_simulation), py::arg("world"), py::arg("object_poses"), py::arg("plate_pose"))
        .def_property_readonly("world", [](const Simulation &simulation) { return simulation.world; })
        .def_property_readonly("object_poses", &object_poses_of)
        .def_property_readonly("plate_pose", &plate_pose_of)
        .def("march", &march, py::arg("twists"))
        .def(py::pickle(&simulation_to_tuple, &simulation_from_tuple));
}

} // namespace pushplan
