// `pushplan.core.slip`: quasi-static pushing with slip.
#include "numpy_poses.hpp"
#include "slip_simulation.hpp"

namespace pushplan::slip {

namespace {

void require(bool fits, const char *what) {
    if (!fits)
        throw std::invalid_argument(what);
}

// Return the objects of a world from columns described in `slip.pyi`.
std::vector<Object> objects_of(const Integers &first_foot, const Numbers &loads, const Numbers &center) {
    const auto first = row(first_foot);
    const auto load = table(loads), middle = table(center);
    require(load.columns == 5 && middle.columns == 2, "loads need 5 columns, and center needs 2");
    require(middle.rows == load.rows && first.size == load.rows + 1,
            "every object needs a load, a centre and a first foot");
    std::vector<Object> objects;
    require_all_finite(loads.data(), loads.size(), "loads");
    require_all_finite(center.data(), center.size(), "center");
    for (std::ptrdiff_t i = 0; i < load.rows; ++i)
        objects.push_back({to_int(first[i], "first_foot"), to_int(first[i + 1], "first_foot"), load[i][0], load[i][1],
                           load[i][2], load[i][3], load[i][4], middle[i][0], middle[i][1]});
    return objects;
}

std::vector<Piece> pieces_of(const Integers &parts, const Numbers &circles) {
    const auto part = table(parts);
    const auto circle = to_rows<Circle>(circles, "circles");
    require(part.columns == 3, "parts need 3 columns");
    require(part.rows == static_cast<std::ptrdiff_t>(circle.size()), "every piece needs a circle");
    std::vector<Piece> pieces;
    for (std::ptrdiff_t p = 0; p < part.rows; ++p)
        pieces.push_back(
            {to_int(part[p][0], "parts"), to_int(part[p][1], "parts"), to_int(part[p][2], "parts"), circle[p]});
    return pieces;
}

std::vector<Pair> pairs_between(const Integers &pairs, const Numbers &friction) {
    const auto pair = table(pairs);
    const auto coefficient = row(friction);
    require(pair.columns == 3 || pair.rows == 0, "pairs need 3 columns");
    require(coefficient.size == pair.rows, "every pair needs a friction");
    std::vector<Pair> found;
    for (std::ptrdiff_t q = 0; q < pair.rows; ++q)
        found.push_back({to_int(pair[q][0], "pairs"), to_int(pair[q][1], "pairs"), to_int(pair[q][2], "pairs"),
                         require_not_negative(coefficient[q], "friction")});
    return found;
}

// Throw if feet, pieces, pairs or the order of a world refer to something missing.
void check(const World &world) {
    const int n = world.plate();
    int feet = 0;
    for (const Object &object : world.objects) {
        require(object.first_foot == feet && object.last_foot >= feet, "feet must be ordered by object");
        feet = object.last_foot;
    }
    require(feet == static_cast<int>(world.feet.size()), "every foot must belong to an object");
    for (const Piece &piece : world.pieces)
        require(0 <= piece.body && piece.body <= n + 1 && 0 <= piece.first && piece.first < piece.last &&
                    piece.last <= static_cast<int>(world.corners.size()),
                "every piece must belong to a body and have corners");
    const int pieces = static_cast<int>(world.pieces.size());
    for (const Pair &pair : world.pairs) {
        require(0 <= pair.a && pair.a < pieces && 0 <= pair.b && pair.b < pieces, "every pair must be of two pieces");
        require(-1 <= pair.contact && pair.contact < n, "a contact must be that of an object, or -1");
    }
    std::vector<int> order = world.order;
    std::sort(order.begin(), order.end());
    require(static_cast<int>(order.size()) == n, "the order must contain every object once");
    for (int i = 0; i < n; ++i)
        require(order[i] == i, "the order must contain every object once");
}

World make_world(const Numbers &feet, const Integers &first_foot, const Numbers &loads, const Numbers &center,
                 const Numbers &corners, const Integers &parts, const Numbers &circles, const Integers &pairs,
                 const Numbers &friction, double length, const Integers &order) {
    const auto own = row(order);
    World world;
    world.feet = to_rows<Foot>(feet, "feet");
    world.objects = objects_of(first_foot, loads, center);
    world.corners = to_rows<Corner>(corners, "corners");
    world.pieces = pieces_of(parts, circles);
    world.pairs = pairs_between(pairs, friction);
    world.length = require_positive(length, "length");
    for (const std::int64_t object : own)
        world.order.push_back(to_int(object, "order"));
    check(world);
    return world;
}

World with_loads(const World &world, const Numbers &friction_loads, const Numbers &foot_loads,
                 const Numbers &contact_frictions) {
    const auto loads = row(friction_loads), of_feet = row(foot_loads), frictions = row(contact_frictions);
    require(loads.size == world.plate() && of_feet.size == static_cast<std::ptrdiff_t>(world.feet.size()),
            "every object and every foot needs a load");
    World changed = world;
    for (const auto &array : {friction_loads, foot_loads, contact_frictions})
        require_all_finite(array.data(), array.size(), "loads and frictions");
    for (std::ptrdiff_t j = 0; j < of_feet.size; ++j)
        changed.feet[j].load = of_feet[j];
    for (std::ptrdiff_t i = 0; i < loads.size; ++i) {
        // h mu is proportional to mu, and mu to the sum of mu N, because the weight stays.
        Object &object = changed.objects[i];
        object.shift *= loads[i] / object.load;
        object.load = loads[i];
    }
    for (Pair &pair : changed.pairs)
        if (pair.contact >= 0) {
            require(pair.contact < frictions.size, "every contact of the chain needs a friction");
            pair.friction = frictions[pair.contact];
        }
    return changed;
}

// Return an array (n, columns) with a row of `numbers_of` for each thing.
template <class Number, std::size_t columns, class Thing, class Function>
Made<Number> rows_of(const std::vector<Thing> &things, Function numbers_of) {
    std::vector<Number> numbers;
    for (const Thing &thing : things)
        for (const auto number : std::array<Number, columns>(numbers_of(thing)))
            numbers.push_back(number);
    const auto count = static_cast<std::ptrdiff_t>(things.size());
    return to_numpy(std::move(numbers), {count, static_cast<std::ptrdiff_t>(columns)});
}

using Index = std::int64_t;

Made<Index> first_foot_of(const World &world) {
    std::vector<Index> first{0};
    for (const Object &object : world.objects)
        first.push_back(object.last_foot);
    return to_numpy(std::move(first));
}

Made<double> loads_of(const World &world) {
    return rows_of<double, 5>(world.objects, [](const Object &object) -> std::array<double, 5> {
        return {object.load, object.shift, object.sxx, object.sxy, object.syy};
    });
}

Made<double> center_of(const World &world) {
    return rows_of<double, 2>(world.objects,
                              [](const Object &object) -> std::array<double, 2> { return {object.cx, object.cy}; });
}

Made<Index> parts_of(const World &world) {
    return rows_of<Index, 3>(
        world.pieces, [](const Piece &piece) -> std::array<Index, 3> { return {piece.body, piece.first, piece.last}; });
}

Made<double> circles_of(const World &world) {
    std::vector<Circle> circles;
    for (const Piece &piece : world.pieces)
        circles.push_back(piece.circle);
    return to_table(circles);
}

Made<Index> pairs_of(const World &world) {
    return rows_of<Index, 3>(world.pairs,
                             [](const Pair &pair) -> std::array<Index, 3> { return {pair.a, pair.b, pair.contact}; });
}

Made<double> friction_of(const World &world) {
    std::vector<double> friction;
    for (const Pair &pair : world.pairs)
        friction.push_back(pair.friction);
    return to_numpy(std::move(friction));
}

Made<Index> order_of(const World &world) {
    return to_numpy(std::vector<Index>(world.order.begin(), world.order.end()));
}

Simulation make_simulation(std::shared_ptr<World> world, const Numbers &object_poses, const Numbers &plate_pose) {
    const auto objects = to_rows<Pose>(object_poses, "poses of the objects");
    require(static_cast<int>(objects.size()) == world->plate(), "every object needs a pose");
    return Simulation(std::move(world), objects, to_pose(plate_pose));
}

Made<double> object_poses_of(const Simulation &simulation) {
    const InUse use(simulation.lock);
    std::vector<Pose> poses(simulation.world->objects.size());
    for (std::size_t i = 0; i < poses.size(); ++i)
        poses[simulation.world->order[i]] = simulation.state.poses[i];
    return to_table(poses);
}

nb::tuple simulation_to_tuple(const Simulation &simulation) {
    const InUse use(simulation.lock);
    const State &state = simulation.state;
    const auto memory = rows_of<double, 4>(state.memory, [](const Memory &memory) -> std::array<double, 4> {
        return {memory.force[0], memory.force[1], memory.force[2], double(memory.points)};
    });
    return nb::make_tuple(simulation.world, to_table(state.poses), to_table(state.twists), to_table(state.drag), memory,
                          state.steps);
}

Simulation simulation_from_tuple(const nb::tuple &t) {
    auto world = nb::cast<std::shared_ptr<World>>(t[0]);
    State state;
    state.poses = to_rows<Pose>(nb::cast<Numbers>(t[1]), "poses");
    state.twists = to_rows<Vector>(nb::cast<Numbers>(t[2]), "twists");
    state.drag = to_rows<std::array<double, 2>>(nb::cast<Numbers>(t[3]), "drag");
    for (const auto &old : to_rows<std::array<double, 4>>(nb::cast<Numbers>(t[4]), "memory"))
        state.memory.push_back({{old[0], old[1], old[2]}, old[3] > 1.0 ? 2 : old[3] > 0.0 ? 1 : 0});
    state.steps = nb::cast<std::int64_t>(t[5]);
    const std::size_t n = world->objects.size();
    require(state.poses.size() == n + 1 && state.twists.size() == n && state.drag.size() == n &&
                state.memory.size() == world->pairs.size(),
            "every body and pair needs a state");
    return Simulation(std::move(world), std::move(state));
}

// A trace in the form of arrays.
struct TraceArrays {
    using Reals = nb::typed<nb::object, Made<double>>;
    using Wholes = nb::typed<nb::object, Made<std::int64_t>>;

    Reals poses;
    Wholes modes;
    Reals forces, wrenches;
    Wholes others;
    Reals residual;
    Wholes end;
};

TraceArrays march(Simulation &simulation, const Numbers &twists, double limit) {
    const auto rows = table(twists);
    require(rows.columns == 3, "twists must be v_x, v_y, omega");
    require_all_finite(twists.data(), twists.size(), "twists");
    require_number(limit, "limit");
    const InUse use(simulation.lock);
    Trace trace;
    {
        nb::gil_scoped_release free;
        trace = simulation.march(rows, limit);
    }
    const auto m = static_cast<std::ptrdiff_t>(trace.end.size()),
               n = static_cast<std::ptrdiff_t>(simulation.world->plate());
    return {nb::cast(to_numpy(std::move(trace.poses), {m, n, 3})),
            nb::cast(to_numpy(std::move(trace.modes), {m, n})),
            nb::cast(to_numpy(std::move(trace.forces), {m, n, 3})),
            nb::cast(to_numpy(std::move(trace.wrenches), {m, 3})),
            nb::cast(to_numpy(std::move(trace.others), {m, n})),
            nb::cast(to_numpy(std::move(trace.residual))),
            nb::cast(to_numpy(std::move(trace.end)))};
}

void bind_constants(nb::module_ &m) {
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
    m.attr("STALLED") = static_cast<int>(STALLED);
}

} // namespace

} // namespace pushplan::slip

namespace pushplan {

void bind_slip(nb::module_ &parent) {
    using namespace slip;
    nb::module_ m = parent.def_submodule(
        "slip", "Quasi-static pushing in which contacts stick, slide, roll off an end, open and close again.");
    bind_constants(m);
    nb::class_<World>(m, "World", R"(
    The constant data of bodies that are pushed.

    Bodies have numbers: first the n objects, then the pusher (n), then all fixed bodies together (n + 1).

    Attributes:
        feet: (f, 4) x, y in the object's frame (m), mu N (N), share of a shifted load.
        first_foot: (n + 1,) first foot of each object.
        loads: (n, 5) sum of mu N (N), h mu (m), second moments of the stiffness xx, xy, yy (m^2).
        center: (n, 2) stiffness centre in the object's frame, m.
        corners: (v, 5) x, y (m) and outward normal of the edge that begins there, in the body's frame; and 1 for an
            edge of the outline, 0 for an edge between two convex pieces.
        parts: (p, 3) body, first corner and one past the last corner of each convex piece. A piece with one corner is a
            disc.
        circles: (p, 4) centre and radius (m) of a circle around each piece in the body's frame, and the rounding of its
            corners.
        pairs: (q, 3) pieces a and b that can touch, and the chain's contact between their bodies, or -1.
        friction: (q,) friction coefficient of each pair.
        length: Characteristic length L, m.
        order: (n,) caller's number of each object: the order of poses and columns outside.
        room: Maximum number of manifolds in a step: 16 for each object and 16 more, or one for each pair.
    )")
        .def(MadeBy(&make_world), nb::kw_only(), nb::arg("feet"), nb::arg("first_foot"), nb::arg("loads"),
             nb::arg("center"), nb::arg("corners"), nb::arg("parts"), nb::arg("circles"), nb::arg("pairs"),
             nb::arg("friction"), nb::arg("length"), nb::arg("order"))
        .def("with_loads", &with_loads, nb::arg("friction_loads"), nb::arg("foot_loads"), nb::arg("contact_frictions"),
             R"(
    Return the world with other frictions and loads and the same weights.

    Args:
        friction_loads: (n,) sum of mu N of every object, N.
        foot_loads: (f,) mu N of every foot, N.
        contact_frictions: (k,) coefficients of the chain's contacts.

    Raises:
        ValueError: If the sizes are wrong.
    )")
        .def_prop_ro("feet", [](const World &world) { return to_table(world.feet); })
        .def_prop_ro("first_foot", &first_foot_of)
        .def_prop_ro("loads", &loads_of)
        .def_prop_ro("center", &center_of)
        .def_prop_ro("corners", [](const World &world) { return to_table(world.corners); })
        .def_prop_ro("parts", &parts_of)
        .def_prop_ro("circles", &circles_of)
        .def_prop_ro("pairs", &pairs_of)
        .def_prop_ro("friction", &friction_of)
        .def_ro("length", &World::length)
        .def_prop_ro("order", &order_of)
        .def_prop_ro("room", &World::room)
        .def(PickledBy{"feet", "first_foot", "loads", "center", "corners", "parts", "circles", "pairs", "friction",
                       "length", "order"});
    nb::class_<TraceArrays>(m, "Trace", R"(
    The record of m steps. Columns are the caller's objects.

    Attributes:
        poses: (m, n, 3) poses of the objects after each step.
        modes: (m, n) modes of the chain's contacts, `OPEN` to `ROLL_SLIDE`.
        forces: (m, n, 3) forces of the chain's contacts: normal force at the right and the left end, tangential force,
            N.
        wrenches: (m, 3) wrenches of the plate on all bodies that it touches, in its own frame: N, N, N m.
        others: (m, n) number of other active contacts of each object, with obstacles, walls or bodies outside its chain
            contact.
        residual: (m,) residual of the balance, divided by the sum of mu N of all objects.
        end: (m,) outcome of each step, `CONVERGED` to `STALLED`.
    )")
        .def_ro("poses", &TraceArrays::poses)
        .def_ro("modes", &TraceArrays::modes)
        .def_ro("forces", &TraceArrays::forces)
        .def_ro("wrenches", &TraceArrays::wrenches)
        .def_ro("others", &TraceArrays::others)
        .def_ro("residual", &TraceArrays::residual)
        .def_ro("end", &TraceArrays::end)
        .def(Pickled(
            +[](const TraceArrays &t) {
                return nb::make_tuple(t.poses, t.modes, t.forces, t.wrenches, t.others, t.residual, t.end);
            },
            +[](const nb::tuple &t) { return TraceArrays{t[0], t[1], t[2], t[3], t[4], t[5], t[6]}; }));
    nb::class_<Simulation>(m, "Simulation", R"(
    The poses of all bodies, and the last step's solution, with which the next step begins.

    Attributes:
        world: The world.
        object_poses: (n, 3) poses of the caller's objects in the world.
        plate_pose: (3,) pose of the plate's frame in the world.
    )")
        .def(MadeBy(&make_simulation), nb::arg("world"), nb::arg("object_poses"), nb::arg("plate_pose"))
        .def_prop_ro("world", [](const Simulation &simulation) { return simulation.world; })
        .def_prop_ro("object_poses", &object_poses_of)
        .def_prop_ro("plate_pose",
                     [](const Simulation &simulation) {
                         const InUse use(simulation.lock);
                         return to_array(simulation.state.poses.back());
                     })
        .def("march", &march, nb::arg("twists"), nb::arg("limit") = std::numeric_limits<double>::infinity(), R"(
    Move the plate by a sequence of body twists times time (m, 3), and the objects with it.

    It stops early if there is no solution, if there are too many manifolds, or if the plate would push with more than
    `limit` (N; infinite by default). The step that stopped it is the last one in the trace. The interpreter's lock is
    released meanwhile.

    Raises:
        ValueError: If the shape is wrong.
    )")
        .def(Pickled(&simulation_to_tuple, &simulation_from_tuple));
}

} // namespace pushplan
