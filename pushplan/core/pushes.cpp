#include "pushes.hpp"

#include "arrays.hpp"
#include "numpy_poses.hpp"

#include <algorithm>

namespace pushplan {
namespace {

// Maximum number of steering paths checked for a push.
constexpr int PUSH_TRIES = 6;

// Number of poses along a turn or a straight push, from which the nearest to a goal is chosen.
constexpr int ALONG = 400;

} // namespace

Pose PackedMode::robot_at(const Pose &load, double behind) const {
    Pose pose = joined(joined(load, contact), robot);
    pose.x -= behind * std::cos(pose.theta);
    pose.y -= behind * std::sin(pose.theta);
    return pose;
}

std::vector<double> word_costs(const PackedMode &mode, const std::vector<Pose> &starts, const std::vector<Pose> &goals,
                               Row<const double> sofar, Row<const double> left, double below) {
    std::vector<double> out(starts.size() * goals.size(), INF);
    std::vector<Pose> ends;
    for (const Pose &goal : goals)
        ends.push_back(joined(goal, mode.contact));
    for (std::size_t i = 0; i < starts.size(); ++i) {
        const Pose begin = mode.settled(joined(starts[i], mode.contact));
        for (std::size_t j = 0; j < goals.size(); ++j) {
            const double away = std::hypot(goals[j].x - starts[i].x, goals[j].y - starts[i].y);
            // Check the distance first: it is much cheaper than the steering paths, and rules out most pairs.
            if (sofar[i] + away / mode.faster + left[j] >= below)
                continue;
            double &cost = out[i * goals.size() + j];
            for (const Family &family : mode.families)
                for (const Word &word : find_words(family, begin, ends[j]))
                    cost = std::min(cost, mode.settle + word.cost);
        }
    }
    return out;
}

Push find_push(const Scene &scene, const PackedMode &mode, const Pose &start, const Pose &goal) {
    const Pose first = joined(start, mode.contact), last = joined(goal, mode.contact);
    const double enough = mode.clearance + SLACK;
    const double gap = std::min(separation(scene, first, enough), separation(scene, last, enough));
    if (gap < mode.clearance - ROUNDING)
        return {};
    const Scene between = scene_with_gap(scene, gap, mode.clearance);
    const Twist straight{mode.settling.vx, mode.settling.vy, 0.0};
    if (!sweep_is_free(between, first, straight, mode.settle))
        return {};
    const Connection found = connect(between, mode.family_row(), mode.settled(first), last, INF, PUSH_TRIES);
    if (found.cost == INF)
        return {};
    return {mode.settle + found.cost, {Arc{straight, mode.settle}, found.arcs[0], found.arcs[1], found.arcs[2]}};
}

bool settles(const Scene &scene, const PackedMode &mode, const Pose &load) {
    const Pose at = joined(load, mode.contact);
    const double gap = separation(scene, at, mode.clearance + SLACK);
    if (gap < mode.clearance - ROUNDING)
        return false;
    const Scene between = scene_with_gap(scene, gap, mode.clearance);
    return sweep_is_free(between, at, {mode.settling.vx, mode.settling.vy, 0.0}, mode.settle);
}

bool approach_is_free(const Scene &robot, const PackedMode &mode, const Pose &load, bool back) {
    const double behind = back ? mode.retreat : mode.approach, enough = mode.clearance + SLACK;
    const Pose near = mode.robot_at(load, 0.0), away = mode.robot_at(load, behind);
    const double gap = separation(robot, near, enough);
    // Where the robot drives on, it keeps the distance of a transit.
    if (gap < mode.clearance - ROUNDING || separation(robot, away, enough) < enough)
        return false;
    return sweep_is_free(scene_with_gap(robot, gap, mode.clearance), away, {1.0, 0.0, 0.0}, behind);
}

std::vector<Passing> find_passings(const PackedMode &mode, const Pose &load, const Pose &inner,
                                   const std::vector<Pose> &goals, double distance, double angle, double far) {
    const Pose begin = mode.settled(joined(load, mode.contact)), back = seen_from(mode.contact, {0.0, 0.0, 0.0});
    const Pose own = joined(back, inner);
    const double stride = far / (ALONG - 1);
    std::vector<Passing> found;
    for (const Family &family : mode.families) {
        for (const Twist &twist : family) {
            if (twist.is_zero())
                continue;
            const double speed = std::hypot(twist.vx - twist.omega * own.y, twist.vy + twist.omega * own.x);
            double best = INF;
            Passing passing{};
            for (int k = 0; k < ALONG;) {
                const Pose at = step(begin, twist, k * stride), pose = joined(at, own);
                double nearest = INF;
                for (std::size_t g = 0; g < goals.size(); ++g) {
                    const double away = std::hypot(pose.x - goals[g].x, pose.y - goals[g].y);
                    const double turned = std::abs(floored_mod(pose.theta - goals[g].theta + PI, 2.0 * PI) - PI);
                    const double share = std::max(away / distance, turned / angle);
                    if (share <= 1.0 && share < best)
                        best = share, passing = {joined(at, back), static_cast<int>(g)};
                    nearest = std::min(nearest, away);
                }
                // Until then, no pose is within the distance.
                const double strides = (nearest - distance) / (speed * stride);
                k += strides >= ALONG ? ALONG : strides > 1.0 ? static_cast<int>(strides) : 1;
            }
            if (best <= 1.0)
                found.push_back(passing);
        }
    }
    return found;
}

namespace {

PackedMode to_mode(const Numbers &families, const Numbers &contact, const Numbers &robot, const Numbers &settling,
                   double settle, double approach, double retreat, double clearance, double faster) {
    if (families.size() == 0)
        throw std::invalid_argument("a contact needs at least one family of twists");
    return {to_families(families),
            to_pose(contact),
            to_pose(robot),
            to_twist(settling),
            require_not_negative(settle, "settle"),
            require_not_negative(approach, "approach"),
            require_not_negative(retreat, "retreat"),
            require_finite(clearance, "clearance"),
            require_positive(faster, "faster")};
}

Made<double> families_array(const PackedMode &mode) {
    return copied(&mode.families[0][0].vx, {static_cast<std::ptrdiff_t>(mode.families.size()), 3, 3});
}

Made<double> settling_array(const PackedMode &mode) { return copied(&mode.settling.vx, {3}); }

void bind_mode(nb::module_ &m) {
    nb::class_<PackedMode>(m, "PackedMode", R"(
    A contact and the pushes that it can make.

    Attributes:
        families: (f, 3, 3) left, straight and right twists in the contact's chain frame; f is at most 3.
        contact: (3,) pose of that frame in the load's frame.
        robot: (3,) pose of the robot's frame in that frame.
        settling: (3,) twist of the settling push, the straight push that begins every push.
        settle: Length of the settling push, m.
        approach: Length of the straight approach to the contact, m.
        retreat: Length of the straight retreat from it, m.
        clearance: Clearance, m.
        faster: Maximum ratio of the travel of the load frame's origin to the cost of a push.
    )")
        .def(MadeBy(&to_mode), nb::arg("families"), nb::arg("contact"), nb::arg("robot"), nb::arg("settling"),
             nb::arg("settle"), nb::arg("approach"), nb::arg("retreat"), nb::arg("clearance"), nb::arg("faster"))
        .def_prop_ro("families", &families_array)
        .def_prop_ro("contact", [](const PackedMode &mode) { return to_array(mode.contact); })
        .def_prop_ro("robot", [](const PackedMode &mode) { return to_array(mode.robot); })
        .def_prop_ro("settling", &settling_array)
        .def_ro("settle", &PackedMode::settle)
        .def_ro("approach", &PackedMode::approach)
        .def_ro("retreat", &PackedMode::retreat)
        .def_ro("clearance", &PackedMode::clearance)
        .def_ro("faster", &PackedMode::faster)
        .def(
            "robot_at",
            [](const PackedMode &mode, const Numbers &load, double behind) {
                return to_array(mode.robot_at(to_pose(load), require_finite(behind, "behind")));
            },
            nb::arg("load"), nb::arg("behind"),
            "Return the robot's pose (3,) at a distance (m) behind the contact, with the load at a pose (3,).")
        .def(PickledBy{"families", "contact", "robot", "settling", "settle", "approach", "retreat", "clearance",
                       "faster"});
}

Made<double> costs_between(const PackedMode &mode, const Numbers &starts, const Numbers &goals, const Numbers &sofar,
                           const Numbers &left, double below) {
    const auto from = to_rows<Pose>(starts, "starts"), to = to_rows<Pose>(goals, "goals");
    const auto before = row(sofar), after = row(left);
    if (before.size != starts.shape(0) || after.size != goals.shape(0))
        throw std::invalid_argument("there must be one cost for each start and each goal");
    std::vector<double> costs;
    {
        nb::gil_scoped_release free;
        costs = word_costs(mode, from, to, before, after, below);
    }
    return to_numpy(std::move(costs), {starts.shape(0), goals.shape(0)});
}

auto push_between(const Scene &scene, const PackedMode &mode, const Numbers &start, const Numbers &goal) {
    const Pose first = to_pose(start), last = to_pose(goal);
    Push found;
    {
        nb::gil_scoped_release free;
        found = find_push(scene, mode, first, last);
    }
    return std::make_tuple(found.cost, to_table(found.arcs));
}

// Return the costs (r, m, g) of single pushes in rooms, by contacts, to goals; infinite if none is free.
Made<double> push_costs(const std::vector<Scene> &rooms, const std::vector<std::pair<Scene, PackedMode>> &contacts,
                        const Numbers &start, const Numbers &goals, const Given<bool> &asked) {
    const auto ends = to_rows<Pose>(goals, "goals");
    const Pose first = to_pose(start);
    const Shape shape{static_cast<std::ptrdiff_t>(rooms.size()), static_cast<std::ptrdiff_t>(contacts.size()),
                      static_cast<std::ptrdiff_t>(ends.size())};
    require_shape(asked, {shape[1], shape[2]}, "table of the requested pushes");
    std::vector<double> costs;
    {
        nb::gil_scoped_release free;
        for (const Scene &robot : rooms) {
            const bool *wanted = asked.data();
            for (const auto &[chain, mode] : contacts) {
                const Scene scene{chain.body, robot.obstacles, chain.clearance, chain.kept};
                const bool begins = approach_is_free(robot, mode, first, false);
                for (const Pose &end : ends) {
                    const bool looked_at = *wanted++ && begins && approach_is_free(robot, mode, end, true);
                    costs.push_back(looked_at ? find_push(scene, mode, first, end).cost : INF);
                }
            }
        }
    }
    return to_numpy(std::move(costs), shape);
}

auto passings_of(const PackedMode &mode, const Numbers &load, const Numbers &inner, const Numbers &goals,
                 const Numbers &within, double far) {
    if (within.size() != 2)
        throw std::invalid_argument("a tolerance must be a distance and an angle");
    for (int k = 0; k < 2; ++k)
        require_positive(within.data()[k], "a tolerance");
    require_not_negative(far, "far");
    const auto found = find_passings(mode, to_pose(load), to_pose(inner), to_rows<Pose>(goals, "goals"),
                                     within.data()[0], within.data()[1], far);
    std::vector<Pose> poses;
    std::vector<std::int64_t> rows;
    for (const Passing &one : found)
        poses.push_back(one.load), rows.push_back(one.goal);
    return std::make_tuple(to_table(poses), to_numpy(std::move(rows)));
}

bool settles_at(const Scene &scene, const PackedMode &mode, const Numbers &load) {
    const Pose at = to_pose(load);
    nb::gil_scoped_release free;
    return settles(scene, mode, at);
}

Made<bool> approaches_are_free(const Scene &robot, const PackedMode &mode, const Numbers &loads, bool back) {
    const auto poses = to_rows<Pose>(loads, "loads");
    auto out = new_array<bool>({static_cast<std::ptrdiff_t>(poses.size())});
    bool *is_free = out.data();
    nb::gil_scoped_release free;
    for (const Pose &pose : poses)
        *is_free++ = approach_is_free(robot, mode, pose, back);
    return out;
}

} // namespace

void bind_pushes(nb::module_ &core) {
    auto m = core.def_submodule(
        "pushes",
        "Pushes of the load by one contact between two poses, and the straight approaches and retreats.");
    bind_mode(m);
    m.attr("ARCS") = std::tuple_size_v<decltype(Push::arcs)>;
    m.def("word_costs", &costs_between, nb::arg("mode"), nb::arg("starts"), nb::arg("goals"), nb::arg("sofar"),
          nb::arg("left"), nb::arg("below"), R"(
    Return the costs of the cheapest pushes from load poses `starts` (n, 3) to `goals` (m, 3), ignoring obstacles.

    The cost is infinite if the pair cannot be part of a plan cheaper than `below`. `sofar` (n,) and `left` (m,) are
    lower bounds of the costs before the start and after the goal.
    )");
    m.def("find_push", &push_between, nb::arg("scene"), nb::arg("mode"), nb::arg("start"), nb::arg("goal"), R"(
    Find the cheapest free push between two poses of the load.

    Args:
        scene: The chain with this contact in the room.
        mode: The contact.
        start: (3,) pose of the load.
        goal: (3,) goal pose of the load.

    Returns:
        Cost of the push, m, infinite if there is none; and its twists (in the contact's frame) and lengths (ARCS, 4).
    )");
    m.def("push_costs", &push_costs, nb::arg("rooms"), nb::arg("contacts"), nb::arg("start"), nb::arg("goals"),
          nb::arg("asked"), R"(
    Return the costs (r, m, g) of single pushes from a load pose that leave room for approach and retreat, m.

    Args:
        rooms: r scenes of the robot among the obstacles.
        contacts: m pairs: scene of the chain with a contact (in any room), and the contact.
        start: (3,) pose of the load.
        goals: (g, 3) goal poses of the load.
        asked: (m, g) whether each push is requested. Pushes that are not requested or not free have infinite cost.
    )");
    m.def("find_passings", &passings_of, nb::arg("mode"), nb::arg("load"), nb::arg("inner"), nb::arg("goals"),
          nb::arg("within"), nb::arg("far"), R"(
    Return the load poses (k, 3) at which turns and straight pushes pass by goals, and the goals' rows (k,).

    Args:
        mode: The contact.
        load: (3,) load pose at the beginning of the pushes.
        inner: (3,) pose of the goals' frame in the load's frame.
        goals: (g, 3) goal poses of that frame.
        within: (2,) tolerance of a goal, m and rad.
        far: Length of each push, m. Of 400 poses along it, the nearest to a goal is taken.
    )");
    m.def("settles", &settles_at, nb::arg("scene"), nb::arg("mode"), nb::arg("load"),
          "Return whether the settling push is free with the load at a pose (3,).");
    m.def(
        "approaches_are_free", &approaches_are_free, nb::arg("robot"), nb::arg("mode"), nb::arg("loads"),
        nb::arg("back"),
        "Return (k,) whether the approach to the contact, or the retreat, is free with the load at poses (k, 3).");
}

} // namespace pushplan
