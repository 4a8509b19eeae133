#include "problem.hpp"

#include <algorithm>

namespace pushplan {

Twist choose_twist(const Problem &problem, double u0, double u1) {
    const auto families = static_cast<std::int64_t>(problem.families.size());
    const auto segments = static_cast<std::int64_t>(problem.segments.size());
    if (u0 < LETTER_SHARE) {
        const double place = u0 / LETTER_SHARE * 3.0 * static_cast<double>(families);
        const std::int64_t i = std::min(static_cast<std::int64_t>(place), 3 * families - 1);
        const Twist &twist = problem.families[i / 3][i % 3];
        if (!twist.is_zero())
            return twist;
        u0 = LETTER_SHARE + (1.0 - LETTER_SHARE) * u1;
    }
    u0 = (u0 - LETTER_SHARE) / (1.0 - LETTER_SHARE);
    const std::int64_t i = std::min(static_cast<std::int64_t>(u0 * static_cast<double>(segments)), segments - 1);
    // Clamped, so that the ends, the boundary of the stable set, are drawn with a positive probability.
    const double b = std::clamp((u1 - END_SHARE) / (1.0 - 2.0 * END_SHARE), 0.0, 1.0);
    return between(problem.segments[i], b);
}

void trace(const std::vector<Node> &nodes, std::int64_t node, std::vector<Arc> &path) {
    const auto begun = static_cast<std::ptrdiff_t>(path.size());
    for (; nodes[node].parent >= 0.0; node = static_cast<std::int64_t>(nodes[node].parent))
        path.push_back(nodes[node].arc);
    std::reverse(path.begin() + begun, path.end());
}

void append_word(const std::array<Arc, 3> &word, std::vector<Arc> &path) {
    for (const Arc &arc : word)
        if (arc.length > 0.0)
            path.push_back(arc);
}

} // namespace pushplan
