#include "shortening.hpp"

#include "local_changes.hpp"

#include <algorithm>

namespace pushplan {

namespace {

// Difference below which two twists are the same motion up to rounding. Their arcs become one, without a stop or a
// further price.
constexpr double SAME_MOTION = 1e-12;

// Maximum number of steering paths checked between two corners.
constexpr int CORNER_TRIES = 3;

// Minimum rate of a family's turn, rad per metre of cost.
constexpr double LEAST_TURN = 1e-6;

// Append an arc, or lengthen the last one if it is the same motion.
void append(std::vector<Arc> &arcs, const Arc &arc) {
    if (arc.length <= 0.0)
        return;
    if (!arcs.empty()) {
        const Twist &last = arcs.back().twist, &twist = arc.twist;
        if (std::max({std::abs(last.vx - twist.vx), std::abs(last.vy - twist.vy),
                      std::abs(last.omega - twist.omega)}) < SAME_MOTION) {
            arcs.back().length += arc.length;
            return;
        }
    }
    arcs.push_back(arc);
}

double travel_of(const std::vector<Arc> &path) {
    double travel = 0.0;
    for (const Arc &arc : path)
        travel += arc.length;
    return travel;
}

// A place on a path: arc, distance from its beginning (m of cost), and pose.
struct PlaceOnPath {
    std::size_t arc;
    double into;
    Pose pose;
};

// Return the place at the cost `s` along a path that is not empty.
PlaceOnPath locate(const Pose &start, const std::vector<Arc> &path, double s) {
    Pose pose = start;
    std::size_t i = 0;
    for (; i + 1 < path.size() && s > path[i].length; ++i) {
        pose = step(pose, path[i].twist, path[i].length);
        s -= path[i].length;
    }
    s = std::min(s, path[i].length);
    return {i, s, step(pose, path[i].twist, s)};
}

// Return the travel (m) below which a steering path is cheaper than the piece of path between two places.
double worth(const Objective &objective, const std::vector<Arc> &path, const PlaceOnPath &begin, const PlaceOnPath &end,
             double travel) {
    if (objective.kind == TRAVEL)
        return travel + objective.per_arc * static_cast<double>(end.arc - begin.arc + 1);
    double total = 0.0;
    for (std::size_t k = begin.arc; k <= end.arc; ++k) {
        const double length =
            (k == end.arc ? end.into : path[k].length) - (k == begin.arc ? begin.into : 0.0);
        total += arc_value(objective, path[k].twist, std::max(length, 0.0));
    }
    return total / objective.lowest;
}

// Return the path with the piece between two places replaced by a steering path.
std::vector<Arc> spliced(const std::vector<Arc> &path, const PlaceOnPath &begin, const std::array<Arc, 3> &word,
                         const PlaceOnPath &end) {
    std::vector<Arc> joined;
    joined.reserve(path.size() + 5);
    for (std::size_t k = 0; k < begin.arc; ++k)
        append(joined, path[k]);
    append(joined, {path[begin.arc].twist, begin.into});
    for (const Arc &arc : word)
        append(joined, arc);
    append(joined, {path[end.arc].twist, path[end.arc].length - end.into});
    for (std::size_t k = end.arc + 1; k < path.size(); ++k)
        append(joined, path[k]);
    return joined;
}

// Return a piece of a path with a log-uniform length at a uniform place, clipped to the path.
struct Piece {
    double low;
    double high;
};

Piece draw_piece(double total, Random &random) {
    // Log-uniform from 7 % of the path on. Short pieces need many attempts with little gain, long ones few with much
    // gain.
    const double length = total * std::exp(std::log(0.07) * random());
    const double low = -0.5 * length + random() * total;
    return {std::max(0.0, low), std::min(total, low + length)};
}

// Return a steering family of the problem, or one drawn from the whole stable set.
Family some_family(const Problem &problem, Random &random) {
    if (random() < 0.8)
        return random_family(problem.segments, random);
    return problem.families[static_cast<std::size_t>(random() * static_cast<double>(problem.families.size()))];
}

} // namespace

double objective_value(const Objective &objective, const std::vector<Arc> &path) {
    if (objective.kind == TRAVEL)
        return travel_of(path) + objective.per_arc * static_cast<double>(path.size());
    double total = 0.0;
    for (const Arc &arc : path)
        total += arc_value(objective, arc);
    return total;
}

std::vector<Arc> merged(const std::vector<Arc> &arcs) {
    std::vector<Arc> path;
    path.reserve(arcs.size());
    for (const Arc &arc : arcs)
        append(path, arc);
    return path;
}

Family random_family(const std::vector<Segment> &segments, Random &random) {
    Family family{};
    for (int letter = LEFT; letter <= RIGHT; ++letter) {
        const bool right = letter == RIGHT;
        const auto drawn = static_cast<std::size_t>(random() * static_cast<double>(segments.size()));
        const Segment &segment = segments[drawn];
        // Along a segment, omega increases: right turns, translation (at `level`), left turns.
        const double low = segment.low.omega, high = segment.high.omega;
        const double level = low * high < 0.0 ? low / (low - high) : -1.0;
        double b = right ? 0.0 : 1.0;
        if (random() < 0.5) {
            b = level > 0.0 ? random() * (right ? level : 1.0 - level) : random();
            b = right ? b : 1.0 - b;
        }
        Twist &twist = family[static_cast<std::size_t>(letter)];
        if (letter == STRAIGHT) {
            if (level > 0.0) {
                const Twist ahead = between(segment, level);
                twist = {ahead.vx, ahead.vy, 0.0};
            }
        } else if (right ? low < 0.0 : high > 0.0) {
            const Twist turn = between(segment, b);
            if (turn.omega * (right ? -1.0 : 1.0) >= LEAST_TURN)
                twist = turn;
        }
    }
    return family;
}

std::vector<Arc> shorten(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, Random &random,
                         std::int64_t attempts) {
    std::vector<Arc> path = merged(arcs);
    LocalChanges changes(problem);
    for (std::int64_t attempt = 0; attempt < attempts && !path.empty(); ++attempt) {
        // Steering paths find a path's form, and local changes its best twists and lengths. Use each for half of the
        // attempts.
        if (random() < 0.5) {
            changes.vary(start, path, random);
            continue;
        }
        const auto [low, high] = draw_piece(travel_of(path), random);
        const PlaceOnPath begin = locate(start, path, low), end = locate(start, path, high);
        // Find a steering path that costs less than the piece. The value of its arcs is only known then.
        const double bound = worth(problem.objective, path, begin, end, high - low);
        const Family family = some_family(problem, random);
        const Connection word = connect(problem.scene, {&family, 1}, begin.pose, end.pose, bound, TRIES);
        if (!(word.cost < bound))
            continue;
        std::vector<Arc> exchanged = spliced(path, begin, word.arcs, end);
        if (objective_value(problem.objective, exchanged) < objective_value(problem.objective, path) - GAIN)
            path = std::move(exchanged);
    }
    return path;
}

std::vector<Arc> cut_short(const Problem &problem, const Pose &start, const std::vector<Arc> &arcs, double per_arc) {
    const std::size_t count = arcs.size();
    std::vector<Pose> corners{start};
    corners.reserve(count + 1);
    for (const Arc &arc : arcs)
        corners.push_back(step(corners.back(), arc.twist, arc.length));
    std::vector<Arc> path;
    for (std::size_t i = 0; i < count;) {
        std::size_t j = count;
        Connection word;
        for (; j > i + 1; --j) {
            double bound = 0.0;
            for (std::size_t k = i; k < j; ++k)
                bound += arcs[k].length;
            // A steering path has three arcs, so it can be longer by the price of the arcs that it saves.
            bound += per_arc * (static_cast<double>(j - i) - 3.0);
            word = connect(problem.scene, problem.all_families(), corners[i], corners[j], bound, CORNER_TRIES);
            if (word.cost < bound)
                break;
        }
        if (j > i + 1)
            for (const Arc &arc : word.arcs)
                append(path, arc);
        else
            append(path, arcs[i]);
        i = j;
    }
    return path;
}

} // namespace pushplan
