// Intermediate poses of the load: ends of random pushes, and results of descents that shorten whole sequences.
#include "numpy_poses.hpp"
#include "pushes.hpp"
#include "transit.hpp"

#include <algorithm>
#include <vector>

namespace pushplan {
namespace {

using Modes = std::vector<const PackedMode *>;

// Scale of the first moves, m; a turn of 1 rad counts as TURN_LENGTH.
constexpr double WIDEST = 0.3;

// Number of moves of a random descent for each pose.
constexpr int MOVES = 120;

// Return the cost of the cheapest push.
double push_cost(const PackedMode &mode, const Pose &start, const Pose &goal) {
    const Pose begin = mode.settled(joined(start, mode.contact)), end = joined(goal, mode.contact);
    double best = INF;
    for (const Family &family : mode.families)
        for (const Word &word : find_words(family, begin, end))
            best = std::min(best, word.cost);
    return best + mode.settle;
}

// Draw a normally distributed number (Box and Muller 1958).
double normal(Random &random) {
    const double away = std::sqrt(-2.0 * std::log(1.0 - random()));
    return away * std::cos(2.0 * PI * random());
}

// Return the load's pose for a contact at a world pose; `contact` is the contact's pose in the load's frame.
Pose seen_from_contact(const Pose &at, const Pose &contact) {
    const double theta = at.theta - contact.theta, c = std::cos(theta), s = std::sin(theta);
    return {at.x - c * contact.x + s * contact.y, at.y - s * contact.x - c * contact.y, theta};
}

// Draw an index below a count.
std::size_t choose(std::size_t count, Random &random) {
    return static_cast<std::size_t>(random() * static_cast<double>(count));
}

// Return the end of a random push of a load or, with sense -1, its beginning.
Pose pushed_at_random(const PackedMode &mode, const Pose &pose, double sense, Random &random) {
    const Twist &twist = mode.families[0][choose(3, random)];
    double length = 0.03 * std::pow(50.0, random()); // length of straight pushes, from 0.03 to 1.5 m
    if (twist.omega != 0.0)
        length = 0.75 * PI * random() / std::abs(twist.omega);
    return seen_from_contact(step(joined(pose, mode.contact), twist, sense * length), mode.contact);
}

// Move the poses (k - 1) between the pushes (k) of a sequence so that the pushes get cheaper. Return the sum of their
// costs. The first moves have a scale in m; at most `moves` moves are tried.
double descend(const Modes &sequence, const std::array<Pose, 2> &ends, Row<Pose> poses, double scale, int moves,
               Random &random) {
    const std::size_t count = sequence.size();
    const auto before = [&](std::size_t i) -> const Pose & { return i == 0 ? ends[0] : poses[i - 1]; };
    const auto after = [&](std::size_t i) -> const Pose & { return i == count - 1 ? ends[1] : poses[i]; };
    std::vector<double> costs;
    for (std::size_t i = 0; i < count; ++i)
        costs.push_back(push_cost(*sequence[i], before(i), after(i)));
    for (int move = 0; move < moves && scale >= 1e-5; ++move) {
        const std::size_t i = choose(count - 1, random);
        // Moves without a turn keep a heading that is already right, e.g. that of a straight push.
        const double turn = random() < 0.3 ? 0.0 : scale / TURN_LENGTH;
        Pose moved = poses[i];
        moved.x += scale * normal(random);
        moved.y += scale * normal(random);
        moved.theta += turn * normal(random);
        const double first = push_cost(*sequence[i], before(i), moved);
        // A move changes only two pushes. The second one is computed only if the first one allows a gain.
        if (first < costs[i] + costs[i + 1]) {
            const double second = push_cost(*sequence[i + 1], moved, after(i + 1));
            if (first + second < costs[i] + costs[i + 1]) {
                poses[i] = moved;
                costs[i] = first, costs[i + 1] = second;
                scale = std::min(1.6 * scale, WIDEST);
                continue;
            }
        }
        scale *= 0.93;
    }
    double sum = 0.0;
    for (const double cost : costs)
        sum += cost;
    return sum;
}

// Limits of the drawn sequences.
struct Draws {
    Pose start;
    std::vector<Pose> goals;
    std::vector<std::int64_t> firsts; // possible modes of the first push
    std::vector<std::int64_t> lasts;  // possible modes of the last push
    Table<const double> changes;      // (m, m) lower bounds of the costs of mode changes
    std::int64_t most;                // maximum number of pushes
    double below;                     // upper limit of the total cost, m
};

// Draw a sequence of modes and the poses between its pushes, and descend. Return these poses; none if the sequence
// costs too much.
std::vector<Pose> random_descent(const Modes &modes, const Draws &draws, Random &random) {
    // Draw few pushes more often than many.
    const double share = random();
    const auto count = 2 + static_cast<std::int64_t>(static_cast<double>(draws.most - 1) * (share * share));
    const std::array<Pose, 2> ends{draws.start, draws.goals[choose(draws.goals.size(), random)]};
    std::vector<std::int64_t> chosen;
    double extra = 0.0;
    for (std::int64_t i = 0; i < count; ++i) {
        auto mode = static_cast<std::int64_t>(choose(modes.size(), random));
        if (i == 0)
            mode = draws.firsts[choose(draws.firsts.size(), random)];
        else if (i == count - 1)
            mode = draws.lasts[choose(draws.lasts.size(), random)];
        if (i > 0) {
            extra += draws.changes.at(chosen.back(), mode);
            if (mode == chosen.back())
                return {};
        }
        chosen.push_back(mode);
    }
    if (extra >= draws.below)
        return {};
    Modes sequence;
    for (const std::int64_t mode : chosen)
        sequence.push_back(modes[mode]);
    // From both ends towards the middle.
    std::vector<Pose> poses(static_cast<std::size_t>(count - 1));
    Pose front = ends[0], back = ends[1];
    for (std::int64_t i = 0, j = count - 2; i <= j;) {
        if (random() < 0.5) {
            front = pushed_at_random(*sequence[i], front, 1.0, random);
            poses[i++] = front;
        } else {
            back = pushed_at_random(*sequence[j + 1], back, -1.0, random);
            poses[j--] = back;
        }
    }
    const Row<Pose> between{poses.data(), count - 1};
    const double cost = descend(sequence, ends, between, WIDEST, MOVES * static_cast<int>(count - 1), random);
    return cost + extra < draws.below ? poses : std::vector<Pose>{};
}

std::vector<std::int64_t> indices_of(const Integers &numbers, std::size_t count) {
    const auto indices = row(numbers);
    for (const std::int64_t i : indices)
        if (i < 0 || i >= static_cast<std::int64_t>(count))
            throw std::invalid_argument("there is no contact " + std::to_string(i));
    return {indices.begin(), indices.end()};
}

double descend_between(const Modes &modes, const Integers &sequence, const Numbers &ends, Written poses, double scale,
                       int moves, RandomState state) {
    Modes chosen;
    for (const std::int64_t mode : indices_of(sequence, modes.size()))
        chosen.push_back(modes[mode]);
    const auto both = to_rows<Pose>(ends, "ends");
    const auto rows = table(poses);
    if (chosen.size() < 2 || both.size() != 2 || rows.columns != 3 || rows.rows + 1 != sequence.size())
        throw std::invalid_argument("a descent needs k > 1 pushes, ends (2, 3) and poses between pushes (k - 1, 3)");
    require_positive(scale, "scale");
    require_count(moves, "moves");
    Random &random = random_of(state);
    auto between = to_rows<Pose>(poses, "poses");
    nb::gil_scoped_release free;
    const double cost = descend(chosen, {both[0], both[1]}, {between.data(), rows.rows}, scale, moves, random);
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i)
        put(rows[i], between[i]);
    return cost;
}

Made<double> descent_at_random(const Modes &modes, const Numbers &start, const Numbers &goals, const Integers &firsts,
                               const Integers &lasts, std::int64_t most, const Numbers &changes, double below,
                               RandomState state) {
    const auto count = static_cast<std::ptrdiff_t>(modes.size());
    const Draws draws{to_pose(start),
                      to_rows<Pose>(goals, "goals"),
                      indices_of(firsts, modes.size()),
                      indices_of(lasts, modes.size()),
                      table(changes),
                      most,
                      below};
    if (draws.goals.empty() || draws.firsts.empty() || draws.lasts.empty() || most < 2 || draws.changes.rows != count ||
        draws.changes.columns != count)
        throw std::invalid_argument("a random descent needs two pushes or more, goals, first and last contacts, and "
                                        "the costs of contact changes (m, m)");
    require_count(most, "most", 1'000);
    require_number(below, "below");
    Random &random = random_of(state);
    std::vector<Pose> poses;
    {
        nb::gil_scoped_release free;
        poses = random_descent(modes, draws, random);
    }
    return to_table(poses);
}

} // namespace

void bind_samples(nb::module_ &core) {
    auto m = core.def_submodule(
        "samples",
        "Intermediate poses of the load: random ones, and results of descents that shorten whole sequences.");
    m.def(
        "pushed_at_random",
        [](const PackedMode &mode, const Numbers &pose, double sense, RandomState state) {
            return to_array(pushed_at_random(mode, to_pose(pose), require_finite(sense, "sense"), random_of(state)));
        },
        nb::arg("mode"), nb::arg("pose"), nb::arg("sense"), nb::arg("state").noconvert(),
        "Return the end of a random push by a contact from a load pose (3,) or, with sense -1, its beginning.");
    m.def("descend", &descend_between, nb::arg("modes"), nb::arg("sequence"), nb::arg("ends"),
          nb::arg("poses").noconvert(), nb::arg("scale"), nb::arg("moves"), nb::arg("state").noconvert(), R"(
    Move the poses between pushes so that the pushes get cheaper. Return the sum of their costs.

    Args:
        modes: All contacts.
        sequence: (k,) contact of each push.
        ends: (2, 3) first and last pose of the load.
        poses: (k - 1, 3) poses between the pushes; changed in place.
        scale: Scale of the first moves, m.
        moves: Maximum number of moves.
        state: State of the random numbers.
    )");
    m.def("random_descent", &descent_at_random, nb::arg("modes"), nb::arg("start"), nb::arg("goals"), nb::arg("firsts"),
          nb::arg("lasts"), nb::arg("most"), nb::arg("changes"), nb::arg("below"), nb::arg("state").noconvert(), R"(
    Draw a sequence of contacts and the poses between its pushes, and descend.

    Args:
        modes: All contacts.
        start: (3,) pose of the load.
        goals: (g, 3) goal poses of the load.
        firsts: Possible contacts of the first push.
        lasts: Possible contacts of the last push.
        most: Maximum number of pushes.
        changes: (m, m) lower bounds of the costs of contact changes, m.
        below: Upper limit of the total cost, m.
        state: State of the random numbers.

    Returns:
        The poses (k, 3) between the pushes; empty if the sequence costs too much.
    )");
}

} // namespace pushplan
