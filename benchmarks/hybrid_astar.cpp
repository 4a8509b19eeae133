// Hybrid A* over a push problem, as the navigation of robots uses it: Dolgov, Thrun, Montemerlo, Diebel (2008), "Practical
// search techniques in path planning for autonomous driving", with the choices of Nav2's Smac planner where the paper
// leaves them open.
//
// Nodes are poses, one for each cell of position and heading. From each one lead the turns and straight pushes of the
// exact words, so long that they leave the cell, each swept as everywhere. The cost to go is the larger of straight
// travel with the smallest turn, and of the way of the frame's origin over the floor past all obstacles. The exact
// words to the goal (two at most) are tried from a node the more often the nearer it is. The first round asks for a
// path only; then cells shrink, and each round ends with its cheapest path.
//
// Usage: hybrid_astar PROBLEM SECONDS. Reads what `peers.py` writes; prints CPU seconds and cost (m) of each
// better path, never shortened.
#include "push_problem.hpp"

#include <cstdint>
#include <ctime>
#include <iostream>
#include <queue>
#include <unordered_map>
#include <utility>

constexpr double kCell = 0.1, kShrink = 0.7; // m, of the first round; factor from round to round
constexpr int kHeadings = 72;
constexpr double kMostTurn = kTwoPi / 12.0; // of one arc
constexpr double kHaste = 1.5;              // factor of the cost to go in the first round
constexpr double kRatio = 3.5;              // words are tried after (cost to go / cell / ratio) nodes
constexpr int kFloorCells = 400;            // along the longer side of the room

using Entry = std::pair<double, int>; // priority, node or cell: the smallest first
using Queue = std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>>;

// Lengths of the ways of the frame's origin to the goal, over cells whose middles keep half a cell from everything.
class Floor {
public:
    Floor(Problem &problem, const Pose &goal) {
        const double *box = problem.array("box").row(0);
        x0_ = box[0], y0_ = box[1], side_ = std::max(box[2] - box[0], box[3] - box[1]) / kFloorCells;
        nx_ = int((box[2] - box[0]) / side_) + 1, ny_ = int((box[3] - box[1]) / side_) + 1;
        std::vector<char> blocked(nx_ * ny_, 0);
        problem.mark(x0_, y0_, side_, nx_, ny_, 0.5 * side_, blocked);
        far_.assign(nx_ * ny_, kInf);
        Queue open;
        const int at = cell(goal.x, goal.y);
        far_[at] = 0.0, open.push({0.0, at});
        while (!open.empty()) {
            const auto [length, here] = open.top();
            open.pop();
            if (length > far_[here]) continue;
            for (int dx = -1; dx <= 1; ++dx)
                for (int dy = -1; dy <= 1; ++dy) {
                    const int i = here % nx_ + dx, j = here / nx_ + dy;
                    if (i < 0 || j < 0 || i >= nx_ || j >= ny_ || blocked[j * nx_ + i]) continue;
                    const double there = length + side_ * std::hypot(dx, dy);
                    if (there < far_[j * nx_ + i]) far_[j * nx_ + i] = there, open.push({there, j * nx_ + i});
                }
        }
    }

    double way(const Pose &p) const { return far_[cell(p.x, p.y)]; }

private:
    int cell(double x, double y) const {
        const int i = std::clamp(int((x - x0_) / side_), 0, nx_ - 1);
        return std::clamp(int((y - y0_) / side_), 0, ny_ - 1) * nx_ + i;
    }

    double x0_, y0_, side_;
    int nx_, ny_;
    std::vector<double> far_;
};

struct Node {
    Pose pose;
    double cost, to_go;
    bool closed;
};

class HybridAStar {
public:
    HybridAStar(Problem &problem, double seconds)
        : problem_(problem), start_(problem.pose("start")), goal_(problem.pose("goal")), began_(std::clock()),
          end_(began_ + std::clock_t(seconds * CLOCKS_PER_SEC)), floor_(problem, goal_) {
        const Array &families = problem.array("families");
        for (int i = 0; i < families.rows; ++i) {
            const double *t = families.row(i);
            if (t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0) twists_.push_back({t[0], t[1], t[2]});
        }
    }

    void run() {
        try_words({start_, 0.0, 0.0, false});
        for (double cell = kCell; !over(); cell *= kShrink) round(cell, best_ < kInf ? 1.0 : kHaste);
    }

private:
    bool over() const { return std::clock() >= end_; }

    double to_go(const Pose &p) const { return std::max(atLeast(p, goal_), floor_.way(p)); }

    static std::uint64_t key(const Pose &p, double cell) {
        const auto i = std::uint64_t(std::int64_t(std::floor(p.x / cell)) & 0xffffff);
        const auto j = std::uint64_t(std::int64_t(std::floor(p.y / cell)) & 0xffffff);
        const double turns = p.theta / kTwoPi;
        return i << 40 | j << 16 | std::uint64_t((turns - std::floor(turns)) * kHeadings);
    }

    // So long that the position leaves its cell whichever way it goes, or the heading turns as far as one arc may.
    static double reach(const Twist &v, double cell) {
        const double speed = std::hypot(v.vx, v.vy), straight = speed > 0.0 ? std::sqrt(2.0) * cell / speed : kInf;
        return v.omega != 0.0 ? std::min(straight, kMostTurn / std::abs(v.omega)) : straight;
    }

    void try_words(const Node &node) {
        const double cost = node.cost + problem_.connect(node.pose);
        if (cost >= best_) return;
        best_ = cost;
        std::cout << double(std::clock() - began_) / CLOCKS_PER_SEC << " " << cost << "\n";
    }

    void round(double cell, double haste) {
        std::vector<Node> nodes{{start_, 0.0, to_go(start_), false}};
        std::unordered_map<std::uint64_t, int> at{{key(start_, cell), 0}};
        Queue open;
        open.push({haste * nodes[0].to_go, 0});
        for (double wait = 0.0; !open.empty() && !over(); --wait) {
            const int here = open.top().second;
            const double priority = open.top().first;
            open.pop();
            if (nodes[here].closed) continue;
            if (priority >= best_) return;
            nodes[here].closed = true;
            const Node node = nodes[here];
            if (wait <= 0.0) {
                const bool first = best_ == kInf;
                try_words(node);
                if (first && best_ < kInf) return;
                wait = std::max(1.0, node.to_go / cell / kRatio);
            }
            for (const Twist &twist : twists_) {
                const double length = reach(twist, cell), cost = node.cost + length;
                const Pose pose = step(node.pose, twist, length);
                const double rest = to_go(pose);
                if (cost + rest >= best_) continue;
                const auto [entry, fresh] = at.try_emplace(key(pose, cell), int(nodes.size()));
                if (!fresh && (nodes[entry->second].closed || nodes[entry->second].cost <= cost)) continue;
                if (!problem_.sweepIsFree(node.pose, twist, length)) {
                    if (fresh) at.erase(entry);
                    continue;
                }
                // A cheaper pose takes the cell; the one that had it stays in the queue, and is closed.
                if (!fresh) nodes[entry->second].closed = true, entry->second = int(nodes.size());
                open.push({cost + haste * rest, int(nodes.size())});
                nodes.push_back({pose, cost, rest, false});
            }
        }
    }

    Problem &problem_;
    Pose start_, goal_;
    std::clock_t began_, end_;
    Floor floor_;
    std::vector<Twist> twists_;
    double best_ = kInf;
};

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    Problem problem(read(argv[1]));
    HybridAStar(problem, std::stod(argv[2])).run();
}
