#include "steering.hpp"

#include <cmath>

namespace pushplan {

namespace {

struct Point {
    double x, y;
};

// Return an angle in [0, 2 pi), where rounding just below a full turn gives 0.
double turned(double angle) {
    const double wrapped = angle - 2.0 * PI * std::floor(angle / (2.0 * PI)); // takes half the time of a remainder
    if (wrapped > 2.0 * PI - 1e-11)
        return 0.0;
    return 0.0 > wrapped ? 0.0 : wrapped;
}

// Return the centre of rotation of a turning body twist, in the body frame.
Point cor(const Twist &twist) { return {-twist.vy / twist.omega, twist.vx / twist.omega}; }

// Return the world position of a body-fixed point at a pose.
Point moved(const Pose &pose, const Point &point) {
    const double c = std::cos(pose.theta), s = std::sin(pose.theta);
    return {pose.x + c * point.x - s * point.y, pose.y + s * point.x + c * point.y};
}

// Append the steering paths turn-straight-turn with the given turns. The straight part carries c1 to c2's goal.
void add_straight_words(const Family &family, int first, int last, const Pose &start, const Pose &goal, Words &words) {
    const double ux = family[STRAIGHT].vx, uy = family[STRAIGHT].vy;
    const Point c1 = cor(family[first]), c2 = cor(family[last]);
    const Point p0 = moved(start, c1), q0 = moved(goal, c2);
    // c1 rests at p during the first turn, and c2 at q during the last. In between, R(heading) (e + p u) = d = q - p,
    // with e = c2 - c1 in the body and |u| = 1. So p = -e.u +- sqrt((e.u)^2 - |e|^2 + |d|^2).
    const double ex = c2.x - c1.x, ey = c2.y - c1.y;
    const double dx = q0.x - p0.x, dy = q0.y - p0.y;
    const double along = ex * ux + ey * uy;
    const double under_root = along * along - ex * ex - ey * ey + dx * dx + dy * dy;
    if (under_root < 0.0)
        return;
    const double root = std::sqrt(under_root);
    for (const double sign : {1.0, -1.0}) {
        const double p = -along + sign * root;
        if (p < 0.0 || (sign < 0.0 && root == 0.0))
            continue;
        double heading = start.theta;
        // If d is 0, every heading is possible. That of the start saves the first turn.
        if (dx * dx + dy * dy > 1e-24)
            heading = std::atan2(dy, dx) - std::atan2(ey + p * uy, ex + p * ux);
        const double omega1 = family[first].omega, omega2 = family[last].omega;
        // Angles count in the sense of their turn, because no motion is driven backwards.
        const double turn1 = turned(std::copysign(1.0, omega1) * (heading - start.theta));
        const double turn2 = turned(std::copysign(1.0, omega2) * (goal.theta - heading));
        words.add(first, STRAIGHT, last, turn1 / std::abs(omega1), p, turn2 / std::abs(omega2));
    }
}

// Append the steering paths turn-turn-turn with equal outer turns. The middle COR is the apex of a triangle.
void add_turning_words(const Family &family, int first, int middle, const Pose &start, const Pose &goal, Words &words) {
    const Point c1 = cor(family[first]), c2 = cor(family[middle]);
    const Point p = moved(start, c1), q = moved(goal, c1);
    const double dx = q.x - p.x, dy = q.y - p.y;
    // The apex a is c2 during the middle turn: |a - p| = |a - q| = |c2 - c1|, and half the base of this triangle is arm
    // cos(opening).
    const double arm = std::hypot(c2.x - c1.x, c2.y - c1.y);
    const double distance = std::hypot(dx, dy);
    if (distance > 2.0 * arm || distance < 1e-12)
        return;
    const double arm_angle = std::atan2(c2.y - c1.y, c2.x - c1.x);
    const double opening = std::acos(distance / (2.0 * arm));
    const double omega1 = family[first].omega, omega2 = family[middle].omega;
    for (const double sign : {1.0, -1.0}) {
        const double reach = std::atan2(dy, dx) + sign * opening;
        const double ax = p.x + arm * std::cos(reach), ay = p.y + arm * std::sin(reach);
        const double heading1 = reach - arm_angle;
        const double heading2 = std::atan2(ay - q.y, ax - q.x) - arm_angle;
        const double turn1 = turned(std::copysign(1.0, omega1) * (heading1 - start.theta));
        const double turn2 = turned(std::copysign(1.0, omega2) * (heading2 - heading1));
        const double turn3 = turned(std::copysign(1.0, omega1) * (goal.theta - heading2));
        words.add(first, middle, first, turn1 / std::abs(omega1), turn2 / std::abs(omega2), turn3 / std::abs(omega1));
    }
}

bool arc_is_free(const Scene &scene, const Pose &pose, const Arc &arc) {
    return arc.length <= 0.0 || sweep_is_free(scene, pose, arc.twist, arc.length);
}

} // namespace

Words find_words(const Family &family, const Pose &start, const Pose &goal) {
    Words words;
    const bool straight = family[STRAIGHT].vx != 0.0 || family[STRAIGHT].vy != 0.0;
    for (const int first : {LEFT, RIGHT})
        for (const int last : {LEFT, RIGHT})
            if (family[first].omega != 0.0 && family[last].omega != 0.0) {
                if (straight)
                    add_straight_words(family, first, last, start, goal, words);
                if (first != last)
                    add_turning_words(family, first, last, start, goal, words);
            }
    return words;
}

BestWord best_word(Row<const Family> families, const Pose &start, const Pose &goal) {
    BestWord best;
    for (const Family &family : families)
        for (const Word &word : find_words(family, start, goal))
            if (word.cost < best.cost)
                best = {word.cost, word.arcs(family)};
    return best;
}

bool word_is_free(const Scene &scene, const std::array<Arc, 3> &arcs, const Pose &start) {
    const Pose second = step(start, arcs[0].twist, arcs[0].length);
    if (!arc_is_free(scene, second, arcs[1]) || !arc_is_free(scene, start, arcs[0]))
        return false;
    return arc_is_free(scene, step(second, arcs[1].twist, arcs[1].length), arcs[2]);
}

Connection connect(const Scene &scene, Row<const Family> families, const Pose &start, const Pose &goal, double bound,
                   int tries) {
    if (families.size > MOST_FAMILIES)
        throw std::invalid_argument("too many families");
    WordList<MOST_FAMILIES * MAX_WORDS> words;
    std::array<int, MOST_FAMILIES * MAX_WORDS> owner;
    Connection found;
    for (int f = 0; f < families.size; ++f)
        for (const Word &word : find_words(families[f], start, goal)) {
            found.promise = word.cost < found.promise ? word.cost : found.promise;
            owner[words.count] = f;
            words.words[words.count++] = word;
        }
    // Select the cheapest one by one: of at most 36 steering paths, only a few are checked, so sorting is not
    // worthwhile.
    for (int i = 0; i < tries; ++i) {
        Word *best = cheapest(words.begin(), words.end(), bound);
        if (best == nullptr)
            break;
        found.arcs = best->arcs(families[owner[best - words.begin()]]);
        if (word_is_free(scene, found.arcs, start)) {
            found.cost = best->cost;
            return found;
        }
        best->cost = INF;
    }
    return found;
}

void reach(const Scene &scene, Row<const Family> families, const std::vector<Pose> &starts,
           const std::vector<Pose> &goals, double clearance, Table<double> costs) {
    std::vector<double> gaps;
    for (const Pose &goal : goals)
        gaps.push_back(separation(scene, goal, clearance + SLACK));
    for (std::size_t i = 0; i < starts.size(); ++i) {
        const double gap = separation(scene, starts[i], clearance + SLACK);
        for (std::size_t j = 0; j < goals.size(); ++j) {
            // Search with the distance of the nearer end.
            const double least = gaps[j] < gap ? gaps[j] : gap;
            double &cost = costs[static_cast<std::ptrdiff_t>(i)][j];
            cost = INF;
            if (least < clearance - ROUNDING)
                continue;
            const Scene between = scene_with_gap(scene, least, clearance);
            cost = connect(between, families, starts[i], goals[j], INF, MAX_WORDS).cost;
        }
    }
}

} // namespace pushplan
