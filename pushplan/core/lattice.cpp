#include "lattice.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace pushplan {

namespace {

// Number of arcs from a node: left turn, straight push, right turn, and a random stable twist.
constexpr int CHILDREN = 4;

// Weight of the cost to go while there is no path: weighted A* finds a first path sooner.
constexpr double HEURISTIC_WEIGHT = 2.0;

// The cells whose middles keep a distance from everything. Blocks of cells are halved until one check at a middle
// decides for the whole block.
class FreeCells {
  public:
    FreeCells(const Scene &point, const Grid &grid, double least)
        : point_(point), grid_(grid), least_(least), free_(static_cast<std::size_t>(grid.columns * grid.rows)) {
        std::int64_t block = 1;
        while (block < std::max(grid.columns, grid.rows))
            block *= 2;
        mark(0, 0, block);
    }

    char operator[](std::size_t cell) const { return free_[cell]; }

  private:
    void mark(std::int64_t i, std::int64_t j, std::int64_t block) {
        const std::int64_t i_end = std::min(i + block, grid_.columns), j_end = std::min(j + block, grid_.rows);
        if (i >= i_end || j >= j_end)
            return;
        const double half = 0.5 * static_cast<double>(block) * grid_.side;
        const Pose middle{grid_.x + static_cast<double>(i) * grid_.side + half,
                          grid_.y + static_cast<double>(j) * grid_.side + half, 0.0};
        const double enough = least_ + std::sqrt(2.0) * (half - 0.5 * grid_.side);
        if (separation(point_, middle, enough) >= enough) {
            for (std::int64_t a = i; a < i_end; ++a)
                std::fill(free_.begin() + a * grid_.rows + j, free_.begin() + a * grid_.rows + j_end, 1);
        } else if (block > 1) {
            const std::int64_t part = block / 2;
            for (int quarter = 0; quarter < 4; ++quarter)
                mark(i + quarter / 2 * part, j + quarter % 2 * part, part);
        }
    }

    const Scene &point_;
    const Grid &grid_;
    double least_;
    std::vector<char> free_;
};

} // namespace

// Dijkstra's algorithm over the cells and their diagonals.
std::vector<double> floor_distances(const Scene &point, const Grid &grid, double least, std::int64_t place) {
    const FreeCells free(point, grid, least);
    const std::int64_t rows = grid.rows, columns = grid.columns;
    const double through_blocked = static_cast<double>(columns + rows) * grid.side;
    std::vector<double> away(static_cast<std::size_t>(columns * rows), INF);
    std::vector<std::pair<double, std::int64_t>> queue{{0.0, place}};
    away[place] = 0.0;
    while (!queue.empty()) {
        std::pop_heap(queue.begin(), queue.end(), std::greater<>());
        const auto [length, cell] = queue.back();
        queue.pop_back();
        if (length > away[cell])
            continue;
        const std::int64_t i = cell / rows, j = cell % rows;
        for (std::int64_t a = std::max<std::int64_t>(i - 1, 0); a <= std::min(i + 1, columns - 1); ++a)
            for (std::int64_t b = std::max<std::int64_t>(j - 1, 0); b <= std::min(j + 1, rows - 1); ++b) {
                const std::int64_t next = a * rows + b;
                double longer = length + grid.side * (a != i && b != j ? std::sqrt(2.0) : 1.0);
                if (!free[cell] || !free[next])
                    longer += through_blocked;
                if (longer < away[next]) {
                    away[next] = longer;
                    queue.push_back({longer, next});
                    std::push_heap(queue.begin(), queue.end(), std::greater<>());
                }
            }
    }
    return away;
}

void Lattice::plant(const Area &area, const LatticeSizes &sizes, std::int64_t room) {
    area_ = area, sizes_ = sizes, room_ = static_cast<std::size_t>(room);
    nodes_.clear();
    nodes_.reserve(room_);
    queue_.clear();
    // Twice as many slots as nodes keep chains of occupied slots short.
    cells_.clear(2 * room_);
    if (costs_.size() < 2 * room_)
        costs_.resize(2 * room_);
    nodes_.push_back({start_, 0.0, -1.0, {}});
    queue_.push_back({0.0, 0});
    tried_ = 0;
    partner_ = -1;
}

// Return the key of a pose's cell; 0 outside the area.
std::int64_t Lattice::key_of(const Pose &pose) const {
    if (!(pose.x >= area_.xmin && pose.y >= area_.ymin && pose.x <= area_.xmax && pose.y <= area_.ymax))
        return 0;
    return cell_key(static_cast<std::int64_t>((pose.x - area_.xmin) / sizes_.side),
                    static_cast<std::int64_t>((pose.y - area_.ymin) / sizes_.side),
                    static_cast<std::int64_t>(floored_mod(pose.theta, 2.0 * PI) / sizes_.angle));
}

// Return the estimated cost to go, m, from the floor distances and the cheapest steering path.
//
// Floor distances ignore turns, and steering paths ignore obstacles, so the larger one is used. Neither is a lower
// bound (one family of steering paths, paths from cell to cell). So the result is good but not proven optimal.
double Lattice::left(const Pose &pose) const {
    const double c = std::cos(pose.theta), s = std::sin(pose.theta);
    const double px = pose.x + c * middle_[0] - s * middle_[1];
    const double py = pose.y + s * middle_[0] + c * middle_[1];
    const Words words = find_words(problem_->families[0], pose, problem_->goal);
    double word = INF;
    for (const Word &other : words)
        word = std::min(word, other.cost);
    if (words.count == 0)
        word = remaining(pose, problem_->goal);
    return std::max(word, away_[grid_.cell(px, py)]);
}

// Try an arc of a node.
void Lattice::grow(std::int64_t parent, int number, double bound, Random &random) {
    const Problem &problem = *problem_;
    Twist twist{0.0, 0.0, 0.0};
    if (number < 3)
        twist = problem.families[0][number];
    if (twist.is_zero()) { // the fourth arc, or a motion that the family lacks
        const double u0 = random(), u1 = random();
        twist = choose_twist(problem, u0, u1);
    }
    const double length = sizes_.arc * (0.6 + 0.8 * random());
    ++tried_;
    const Pose from = nodes_[parent].pose;
    const double cost = nodes_[parent].cost + length;
    const Pose pose = step(from, twist, length);
    // Cheap tests first, because the collision check takes most of the time.
    const std::int64_t key = key_of(pose);
    if (key == 0)
        return;
    const std::size_t slot = cells_.slot_of(key);
    if (cells_[slot] == key && costs_[slot] <= cost)
        return;
    const double promise = cost + (std::isinf(bound) ? HEURISTIC_WEIGHT : 1.0) * left(pose);
    if (promise >= bound || !sweep_is_free(problem.scene, from, twist, length))
        return;
    cells_[slot] = key, costs_[slot] = cost;
    nodes_.push_back({pose, cost, static_cast<double>(parent), {twist, length}});
    queue_.push_back({promise, static_cast<std::int64_t>(nodes_.size()) - 1});
    std::push_heap(queue_.begin(), queue_.end());
}

std::pair<double, bool> Lattice::expand(double bound, std::int64_t arcs, Random &random) {
    const std::int64_t enough = tried_ + arcs;
    const bool weighted = std::isinf(bound);
    while (tried_ < enough) {
        // Without nodes to expand, or without room, the round ends. The next one has other cells.
        if (queue_.empty() || nodes_.size() + CHILDREN > room_)
            return {bound, true};
        std::pop_heap(queue_.begin(), queue_.end());
        const Entry entry = queue_.back();
        queue_.pop_back();
        // Nothing else in the queue has a lower estimate.
        if (entry.promise >= bound)
            return {bound, true};
        const Node node = nodes_[entry.row];
        const std::int64_t key = key_of(node.pose);
        const std::size_t slot = cells_.slot_of(key);
        if (cells_[slot] == key && costs_[slot] < node.cost) // a cheaper node has since reached its cell
            continue;
        const Connection found = connect(problem_->scene, problem_->first_family(), node.pose, problem_->goal,
                                         bound - node.cost, TRIES);
        if (node.cost + found.cost < bound) {
            bound = node.cost + found.cost;
            partner_ = entry.row;
            word_ = found.arcs;
            if (weighted) // the estimates in the queue are weighted, so the round ends here
                return {bound, true};
        }
        for (int number = 0; number < CHILDREN; ++number)
            grow(entry.row, number, bound, random);
    }
    return {bound, false};
}

std::vector<Arc> Lattice::path() const {
    std::vector<Arc> path;
    if (partner_ < 0)
        return path;
    trace(nodes_, partner_, path);
    append_word(word_, path);
    return path;
}

} // namespace pushplan
