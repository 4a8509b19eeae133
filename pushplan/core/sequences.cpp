// The cheapest sequence of pushes through a graph of poses of the load, and the cheapest tour through loads.
#include "arrays.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace pushplan {
namespace {

// A push by a mode from one node to another.
struct SequenceStep {
    std::int64_t mode, first, last;
};

struct Sequence {
    double cost = INF; // infinite if there is none
    std::vector<SequenceStep> steps;
};

// Costs of pushes between nodes and of mode changes, as contiguous blocks in memory.
struct SequenceCosts {
    std::ptrdiff_t modes, nodes;
    const double *pushes;  // (modes, nodes, nodes): by mode, from node to node
    const double *changes; // (nodes, modes, modes): at a node, from mode to mode
    const double *first;   // (modes,): before the first push

    // Return the costs of pushes by a mode from a node to every node.
    const double *pushes_from(std::ptrdiff_t mode, std::ptrdiff_t node) const {
        return pushes + (mode * nodes + node) * nodes;
    }
    // Return the costs of changes at a node from a mode to every mode.
    const double *changes_from(std::ptrdiff_t node, std::ptrdiff_t mode) const {
        return changes + (node * modes + mode) * modes;
    }
};

// Maximum number of loads in a tour. Each further load doubles time and memory.
constexpr std::ptrdiff_t MOST_STOPS = 20;

// A number for each mode and node. The nodes of a mode are contiguous.
template <class Number> struct ModesByNodes {
    std::vector<Number> numbers;
    std::ptrdiff_t nodes;

    ModesByNodes(std::ptrdiff_t modes, std::ptrdiff_t nodes, Number value)
        : numbers(static_cast<std::size_t>(modes * nodes), value), nodes(nodes) {}
    Number *operator[](std::ptrdiff_t mode) { return numbers.data() + mode * nodes; }
    const Number *operator[](std::ptrdiff_t mode) const { return numbers.data() + mode * nodes; }
};

// Costs of the cheapest sequences with a given number of pushes.
struct Round {
    ModesByNodes<double> ready;        // by mode and first node of the last push: cost before that push
    ModesByNodes<std::int64_t> before; // by the same: mode of the push before it
    ModesByNodes<double> done;         // by mode and last node of the last push: cost including that push

    Round(std::ptrdiff_t modes, std::ptrdiff_t nodes)
        : ready(modes, nodes, INF), before(modes, nodes, 0), done(modes, nodes, INF) {}
};

// The last push of a sequence: round, node and mode.
struct Last {
    double cost = INF;
    std::ptrdiff_t round = -1, node = -1, mode = -1;
};

// Add a push to sequences that cost less than the best whole plan. No cost is negative.
void add_push(const SequenceCosts &costs, double below, Round &round) {
    for (std::ptrdiff_t m = 0; m < costs.modes; ++m) {
        double *done = round.done[m];
        for (std::ptrdiff_t u = 0; u < costs.nodes; ++u) {
            const double sofar = round.ready[m][u];
            if (!(sofar < below))
                continue;
            // The beginning of the best push is found afterwards, because computing only minima takes half of the time.
            const double *push = costs.pushes_from(m, u);
            for (std::ptrdiff_t v = 0; v < costs.nodes; ++v) {
                const double cost = sofar + push[v];
                done[v] = cost < done[v] ? cost : done[v];
            }
        }
    }
}

// Return the node at which the last push by a mode to a node begins: the first one with the minimal cost.
std::ptrdiff_t begin_of(const SequenceCosts &costs, const Round &round, std::ptrdiff_t mode, std::ptrdiff_t node) {
    const double *ready = round.ready[mode];
    std::ptrdiff_t u = 0;
    while (u + 1 < costs.nodes && ready[u] + costs.pushes_from(mode, u)[node] != round.done[mode][node])
        ++u;
    return u;
}

// Add a mode change to the sequences of a round. At a goal, the sequence ends. At the start (node 0), there is no
// contact to change.
void add_change(const SequenceCosts &costs, const Round &round, std::ptrdiff_t goals, double below, Round &next) {
    for (std::ptrdiff_t v = goals + 1; v < costs.nodes; ++v) {
        for (std::ptrdiff_t m = 0; m < costs.modes; ++m) {
            const double sofar = round.done[m][v];
            if (!(sofar < below))
                continue;
            const double *change = costs.changes_from(v, m);
            for (std::ptrdiff_t q = 0; q < costs.modes; ++q) {
                const double cost = sofar + change[q];
                if (cost < next.ready[q][v])
                    next.ready[q][v] = cost, next.before[q][v] = m;
            }
        }
    }
}

// Find the cheapest sequence of at most `most` pushes from node 0 to one of nodes 1 to `goals`.
//
// The recursion of Bellman and Ford goes over the number of pushes.
Sequence cheapest_sequence(const SequenceCosts &costs, std::ptrdiff_t goals, std::ptrdiff_t most) {
    std::vector<Round> rounds(static_cast<std::size_t>(most), Round(costs.modes, costs.nodes));
    for (std::ptrdiff_t m = 0; m < costs.modes; ++m)
        rounds[0].ready[m][0] = costs.first[m];
    Last best;
    for (std::ptrdiff_t k = 0; k < most; ++k) {
        add_push(costs, best.cost, rounds[k]);
        for (std::ptrdiff_t v = 1; v <= goals; ++v) {
            for (std::ptrdiff_t m = 0; m < costs.modes; ++m) {
                if (rounds[k].done[m][v] < best.cost)
                    best = {rounds[k].done[m][v], k, v, m};
            }
        }
        if (k + 1 < most)
            add_change(costs, rounds[k], goals, best.cost, rounds[k + 1]);
    }
    Sequence found{best.cost, std::vector<SequenceStep>(static_cast<std::size_t>(best.round + 1))};
    for (std::ptrdiff_t k = best.round, at = best.node, by = best.mode; k >= 0; --k) {
        const std::ptrdiff_t u = begin_of(costs, rounds[k], by, at);
        found.steps[k] = {by, u, at};
        at = u, by = rounds[k].before[by][u];
    }
    return found;
}

// A load that is pushed once in a tour, from one of its entries to one of its exits.
struct TourStop {
    std::ptrdiff_t entries, exits;
    const double *ways;   // (exits of all, entries): transits from the end of any push
    const double *pushes; // (loads, 2, entries, exits): with one other load, at its goal or not yet

    // Return the cost of a push while the loads of a set (bits) are not yet at their goals.
    double push(std::size_t set, std::size_t loads, std::ptrdiff_t entry, std::ptrdiff_t exit) const {
        double cost = 0.0;
        for (std::size_t other = 0; other < loads; ++other) {
            const auto block = static_cast<std::ptrdiff_t>(2 * other + (set >> other & 1));
            const double found = pushes[(block * entries + entry) * exits + exit];
            cost = found > cost ? found : cost;
        }
        return cost;
    }
};

// Return the costs of the cheapest tours through each set of loads (bits) from each exit (Held and Karp 1962).
std::vector<double> cheapest_tours(const std::vector<TourStop> &stops) {
    std::size_t exits = 0;
    for (const TourStop &stop : stops)
        exits += static_cast<std::size_t>(stop.exits);
    const std::size_t sets = std::size_t{1} << stops.size();
    std::vector<double> tours(sets * exits, INF);
    std::fill_n(tours.begin(), exits, 0.0);
    for (std::size_t set = 1; set < sets; ++set) {
        std::size_t own = 0; // the first exit of a stop
        for (std::size_t k = 0; k < stops.size(); own += static_cast<std::size_t>(stops[k++].exits)) {
            const TourStop &stop = stops[k];
            if (!(set >> k & 1))
                continue;
            const double *rest = &tours[(set ^ std::size_t{1} << k) * exits + own];
            for (std::ptrdiff_t m = 0; m < stop.entries; ++m) {
                double pushed = INF;
                for (std::ptrdiff_t e = 0; e < stop.exits; ++e)
                    pushed = std::min(pushed, stop.push(set, stops.size(), m, e) + rest[e]);
                for (std::size_t e = 0; e < exits; ++e) {
                    const double way = stop.ways[static_cast<std::ptrdiff_t>(e) * stop.entries + m];
                    tours[set * exits + e] = std::min(tours[set * exits + e], way + pushed);
                }
            }
        }
    }
    return tours;
}

SequenceCosts to_costs(const Numbers &pushes, const Numbers &changes, const Numbers &first) {
    bool fits = pushes.ndim() == 3 && changes.ndim() == 3 && first.ndim() == 1;
    if (fits) {
        const std::ptrdiff_t modes = pushes.shape(0), nodes = pushes.shape(1);
        fits = pushes.shape(2) == nodes && changes.shape(0) == nodes && changes.shape(1) == modes &&
               changes.shape(2) == modes && first.shape(0) == modes;
    }
    if (!fits)
        throw std::invalid_argument("costs must be (m, v, v) for pushes, (v, m, m) for changes and (m,) before a push, "
                                    "for m modes and v nodes");
    return {pushes.shape(0), pushes.shape(1), pushes.data(), changes.data(), first.data()};
}

auto cheapest_rows(const Numbers &pushes, const Numbers &changes, const Numbers &first, std::ptrdiff_t goals,
                   std::ptrdiff_t most) {
    const SequenceCosts costs = to_costs(pushes, changes, first);
    if (goals < 1 || goals >= costs.nodes || most < 1)
        throw std::invalid_argument("there must be a start, at least one goal among the nodes, and at least one push");
    require_room(std::array{costs.modes, costs.nodes, most}, "the table of sequences");
    Sequence found;
    {
        nb::gil_scoped_release free;
        found = cheapest_sequence(costs, goals, most);
    }
    std::vector<std::int64_t> rows;
    for (const SequenceStep &step : found.steps)
        rows.insert(rows.end(), {step.mode, step.first, step.last});
    const auto count = static_cast<std::ptrdiff_t>(found.steps.size());
    return std::make_tuple(found.cost, to_numpy(std::move(rows), {count, 3}));
}

Made<double> tours_of(const std::vector<Numbers> &ways, const std::vector<Numbers> &pushes) {
    const auto loads = static_cast<std::ptrdiff_t>(pushes.size());
    std::vector<TourStop> stops;
    std::ptrdiff_t exits = 0;
    for (const Numbers &costs : pushes) {
        require_shape(costs, {loads, 2, -1, -1}, "table of pushes");
        exits += costs.shape(3);
    }
    if (ways.size() != pushes.size() || loads > MOST_STOPS)
        throw std::invalid_argument("a tour needs transits to each of its loads, and at most " +
                                    std::to_string(MOST_STOPS) + " loads");
    for (std::size_t k = 0; k < ways.size(); ++k) {
        require_shape(ways[k], {exits, pushes[k].shape(2)}, "table of transits");
        stops.push_back({pushes[k].shape(2), pushes[k].shape(3), ways[k].data(), pushes[k].data()});
    }
    require_room(std::array{std::ptrdiff_t{1} << loads, exits}, "the table of tours");
    std::vector<double> tours;
    {
        nb::gil_scoped_release free;
        tours = cheapest_tours(stops);
    }
    return to_numpy(std::move(tours), {std::ptrdiff_t{1} << loads, exits});
}

} // namespace

void bind_sequences(nb::module_ &core) {
    auto m = core.def_submodule(
        "sequences",
        "The cheapest sequence of pushes through a graph of poses of the load, and the cheapest tour through loads.");
    m.def("cheapest_sequence", &cheapest_rows, nb::arg("pushes"), nb::arg("changes"), nb::arg("first"),
          nb::arg("goals"), nb::arg("most"), R"(
    Find the cheapest sequence of pushes from node 0 to one of nodes 1 to `goals`.

    The recursion of Bellman and Ford goes over the number of pushes.

    Args:
        pushes: (m, v, v) costs of pushes by mode, from node to node.
        changes: (v, m, m) costs of changes at a node, from mode to mode.
        first: (m,) costs before the first push.
        goals: Number of goals among the nodes.
        most: Maximum number of pushes.

    Returns:
        The cost, infinite if there is no sequence, and (k, 3) mode, first and last node of each push.
    )");
    m.def("cheapest_tours", &tours_of, nb::arg("ways"), nb::arg("pushes"), R"(
    Return the costs (2^n, k) of the cheapest tours through each set of n loads (bits) from each end of a push.

    Each load is pushed once, by one of its contacts to one of its ends. All loads together have k ends. The function
    uses the recursion of Held and Karp (1962).

    Args:
        ways: For each of the n loads, the costs (k, m) of the transits from all ends to its contacts.
        pushes: For each load, the costs (n, 2, m, e) of its pushes by contact and end, with one other load at its goal
            (0) or not yet (1). The highest of these counts.
    )");
}

} // namespace pushplan
