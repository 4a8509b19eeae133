#include "driving.hpp"

#include "numpy_poses.hpp"
#include "steering.hpp"

#include <algorithm>

namespace pushplan {
namespace {

// Arcs below this (m, rad) are left out.
constexpr double SHORTEST = 1e-12;

void find_car_words(const Wheels &wheels, double x, double y, double phi, DrivenWords &found) {
    const double r = wheels.radius;
    const Letters &letters = wheels.letters;
    ReedsSheppWords words;
    find_reeds_shepp(x / r, y / r, phi, words);
    for (const ReedsSheppWord &word : words) {
        DrivenWord &driven = found.next();
        for (int i = 0; i < word.count; ++i) {
            const int k = 1 + static_cast<int>(word.letters[i]);
            const double time = std::abs(word.lengths[i]) * r;
            if (time * letters.extent[k] > SHORTEST)
                driven.add(word.lengths[i] < 0.0 ? letters.ahead[k].reversed() : letters.ahead[k],
                           time * letters.rate[k]);
        }
    }
}

// Paths of a differential drive: turn, drive straight ahead or back, turn; each turn to either side.
void find_differential_words(const Wheels &wheels, double x, double y, double phi, DrivenWords &found) {
    const double distance = std::hypot(x, y);
    for (const double ahead : {1.0, -1.0}) {
        const double way = distance < SHORTEST ? 0.0 : std::atan2(ahead * y, ahead * x);
        const double first = wrapped(way), last = wrapped(phi - way);
        for (int far_first = 0; far_first < 2; ++far_first) {
            for (int far_last = 0; far_last < 2; ++far_last) {
                const double one = first - far_first * std::copysign(2.0 * PI, first);
                const double two = last - far_last * std::copysign(2.0 * PI, last);
                DrivenWord &word = found.next();
                word.add(wheels, {0.0, 0.0, std::copysign(1.0, one)}, std::abs(one));
                word.add(wheels, {ahead, 0.0, 0.0}, distance);
                word.add(wheels, {0.0, 0.0, std::copysign(1.0, two)}, std::abs(two));
            }
        }
    }
}

// Paths of an omnidirectional drive: move and turn on one circle; move, then turn; turn, then move; to either side.
void find_free_words(const Wheels &wheels, double x, double y, double phi, DrivenWords &found) {
    const double distance = std::hypot(x, y);
    const double ux = distance > SHORTEST ? x / distance : 0.0, uy = distance > SHORTEST ? y / distance : 0.0;
    for (int side = 0; side < 2; ++side) {
        const double angle = phi - side * std::copysign(2.0 * PI, phi), half = 0.5 * angle;
        const Twist turn{0.0, 0.0, std::copysign(1.0, angle)};
        // A full turn on one circle ends where it began, so no circle leads elsewhere.
        if (std::abs(half) < PI - 1e-6) {
            // half / tan(half) = 1 - half^2 / 3 - ... is 1 to the last bit here.
            const double diagonal = std::abs(half) < 1e-8 ? 1.0 : half / std::tan(half);
            found.next().add(wheels, {diagonal * x + half * y, -half * x + diagonal * y, angle}, 1.0);
        }
        DrivenWord &moves_first = found.next();
        moves_first.add(wheels, {ux, uy, 0.0}, distance);
        moves_first.add(wheels, turn, std::abs(angle));
        // After the turn, the path has another direction in the body's frame.
        const double c = std::cos(angle), s = std::sin(angle);
        DrivenWord &turns_first = found.next();
        turns_first.add(wheels, turn, std::abs(angle));
        turns_first.add(wheels, {c * ux + s * uy, -s * ux + c * uy, 0.0}, distance);
    }
}

bool is_free(const Surroundings &around, const Pose &start, const DrivenWord &word) {
    Pose pose = start;
    for (const Arc &arc : word) {
        if (!around.is_free(pose, arc))
            return false;
        pose = step(pose, arc.twist, arc.length);
    }
    return true;
}

} // namespace

Wheels::Wheels(WheelKind kind, const Pose &axle, double radius) : kind(kind), axle(axle), radius(radius) {
    for (int k = 0; kind == WheelKind::CAR && k < 3; ++k) {
        const Twist twist{1.0, 0.0, (k - 1) / radius}, u = of_robot(twist);
        const double rate = cost_rate(u);
        letters.ahead[k] = {u.vx / rate, u.vy / rate, u.omega / rate};
        letters.rate[k] = rate, letters.extent[k] = 1.0 + std::abs(twist.omega);
    }
}

void DrivenWord::add(const Wheels &wheels, const Twist &twist, double time) {
    if (time * (std::hypot(twist.vx, twist.vy) + std::abs(twist.omega)) <= SHORTEST)
        return;
    const Twist u = wheels.of_robot(twist);
    const double rate = cost_rate(u);
    add({u.vx / rate, u.vy / rate, u.omega / rate}, time * rate);
}

void find_drives(const Wheels &wheels, const Pose &start, const Pose &goal, DrivenWords &found) {
    const Pose &a = wheels.axle;
    const double cs = std::cos(start.theta), ss = std::sin(start.theta);
    const double cg = std::cos(goal.theta), sg = std::sin(goal.theta);
    // Displacement of the axle's middle, in the axle's frame at the start.
    const double dx = goal.x + cg * a.x - sg * a.y - start.x - cs * a.x + ss * a.y;
    const double dy = goal.y + sg * a.x + cg * a.y - start.y - ss * a.x - cs * a.y;
    const double heading = start.theta + a.theta, c = std::cos(heading), s = std::sin(heading);
    const double x = c * dx + s * dy, y = -s * dx + c * dy, phi = wrapped(goal.theta - start.theta);
    found.count = 0;
    if (wheels.kind == WheelKind::CAR)
        find_car_words(wheels, x, y, phi, found);
    else if (wheels.kind == WheelKind::DIFFERENTIAL)
        find_differential_words(wheels, x, y, phi, found);
    else
        find_free_words(wheels, x, y, phi, found);
}

double shortest_drive(const Wheels &wheels, const Pose &start, const Pose &goal) {
    DrivenWords found;
    find_drives(wheels, start, goal, found);
    double least = INF;
    for (const DrivenWord &word : found)
        least = std::min(least, word.cost);
    return least;
}

bool Surroundings::is_clear(const Pose &pose) const {
    if (separation(room, pose, room.clearance * 2.0) < room.clearance)
        return false;
    return separation(load, seen_from(place, pose), load.clearance * 2.0) >= load.clearance;
}

bool Surroundings::is_free(const Pose &pose, const Arc &arc) const {
    if (arc.length <= 0.0)
        return true;
    return sweep_is_free(room, pose, arc.twist, arc.length) &&
           sweep_is_free(load, seen_from(place, pose), arc.twist, arc.length);
}

DrivenWord drive(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal, double bound,
                 int tries) {
    DrivenWord none;
    none.cost = INF;
    // The robot's origin moves at least this far, so most shortcuts need no exact paths.
    if (std::hypot(goal.x - start.x, goal.y - start.y) >= bound)
        return none;
    DrivenWords found;
    find_drives(wheels, start, goal, found);
    for (int i = 0; i < tries; ++i) {
        DrivenWord *best = cheapest(found.begin(), found.end(), bound);
        if (best == nullptr)
            break;
        if (is_free(around, start, *best))
            return *best;
        best->cost = INF;
    }
    return none;
}

namespace {

Wheels to_wheels(WheelKind kind, const Numbers &axle, double radius) {
    if (kind == WheelKind::CAR)
        require_positive(radius, "radius");
    return {kind, to_pose(axle), require_finite(radius, "radius")};
}

// Return words as pairs of letters and lengths, each (k,).
auto reeds_shepp_as_arrays(double x, double y, double phi) {
    ReedsSheppWords found;
    for (const double number : {x, y, phi})
        require_finite(number, "pose");
    find_reeds_shepp(x, y, phi, found);
    std::vector<std::tuple<Made<double>, Made<double>>> out;
    for (const ReedsSheppWord &word : found)
        out.emplace_back(copied(word.letters.data(), {word.count}), copied(word.lengths.data(), {word.count}));
    return out;
}

// Return the arcs (k, 4) of every path.
std::vector<Made<double>> drives_as_arrays(const Wheels &wheels, const Numbers &start, const Numbers &goal) {
    DrivenWords found;
    find_drives(wheels, to_pose(start), to_pose(goal), found);
    std::vector<Made<double>> out;
    for (const DrivenWord &word : found)
        out.push_back(to_table(word.arcs.data(), static_cast<std::size_t>(word.count)));
    return out;
}

Made<double> shortest_between(const Wheels &wheels, const Numbers &starts, const Numbers &goals) {
    const auto from = to_rows<Pose>(starts, "starts"), to = to_rows<Pose>(goals, "goals");
    std::vector<double> costs;
    {
        nb::gil_scoped_release free;
        for (const Pose &start : from)
            for (const Pose &goal : to)
                costs.push_back(shortest_drive(wheels, start, goal));
    }
    return to_numpy(std::move(costs), {starts.shape(0), goals.shape(0)});
}

} // namespace

void bind_driving(nb::module_ &core) {
    auto m = core.def_submodule("driving", "Transits of the robot: shortest paths of its drive (Reeds-Shepp for "
                                        "a car), and its surroundings.");
    nb::enum_<WheelKind>(m, "WheelKind", "Kind of a robot's drive.")
        .value("OMNIDIRECTIONAL", WheelKind::OMNIDIRECTIONAL)
        .value("DIFFERENTIAL", WheelKind::DIFFERENTIAL)
        .value("CAR", WheelKind::CAR);
    nb::class_<Wheels>(m, "Wheels", R"(
    Kinematics of the robot in transits.

    Attributes:
        kind: Kind of the drive.
        axle: (3,) pose, in the robot's frame, of the reference point of paths: the axle's middle with +x forward, or an
            omnidirectional robot's middle.
        radius: Smallest turning radius of the axle's middle, m (cars only).
    )")
        .def(MadeBy(&to_wheels), nb::arg("kind"), nb::arg("axle"), nb::arg("radius"))
        .def_ro("kind", &Wheels::kind)
        .def_prop_ro("axle", [](const Wheels &wheels) { return to_array(wheels.axle); })
        .def_ro("radius", &Wheels::radius)
        .def(PickledBy{"kind", "axle", "radius"});
    nb::class_<Surroundings>(m, "Surroundings", R"(
    Obstacles of the robot in transits.

    Attributes:
        room: Scene of the robot among the obstacles.
        load: Scene of the robot among the load's objects, in the load's frame.
        place: (3,) pose of the load's frame in the world.
    )")
        .def(MadeBy(+[](const Scene &room, const Scene &load, const Numbers &place) {
                 return Surroundings{room, load, to_pose(place)};
             }),
             nb::arg("room"), nb::arg("load"), nb::arg("place"))
        .def_ro("room", &Surroundings::room)
        .def_ro("load", &Surroundings::load)
        .def_prop_ro("place", [](const Surroundings &around) { return to_array(around.place); });
    m.def("find_reeds_shepp", &reeds_shepp_as_arrays, nb::arg("x"), nb::arg("y"), nb::arg("phi"), R"(
    Return the words of a car that lead from the origin to a pose, in turning radii and rad (Reeds and Shepp 1990).

    For each word, return its letters (k,), the signs of the curvature (1 left, 0 straight, -1 right), and their lengths
    (k,), < 0 backwards.
    )");
    m.def("find_drives", &drives_as_arrays, nb::arg("wheels"), nb::arg("start"), nb::arg("goal"),
          "Return the arcs (k, 4) of every path between two poses (3,) of the robot, ignoring obstacles.");
    m.def("shortest_drives", &shortest_between, nb::arg("wheels"), nb::arg("starts"), nb::arg("goals"),
          "Return costs (n, m) of the robot's cheapest paths from poses (n, 3) to poses (m, 3) without obstacles, m.");
}

} // namespace pushplan
