// The cheapest sequence of pushes through a graph of poses of the load, and the cheapest tour through loads.
#pragma once

#include "tables.hpp"

#include <vector>

namespace pushplan {

// A push by a mode from node to node.
struct SequenceStep {
    std::int64_t mode, first, last;
};

struct Sequence {
    double cost = INF; // infinite where there is none
    std::vector<SequenceStep> steps;
};

// What pushes between nodes and changes of the mode cost, as blocks one after another in memory.
struct SequenceCosts {
    std::ptrdiff_t modes, nodes;
    const double *pushes;  // (modes, nodes, nodes): by mode, from node to node
    const double *changes; // (nodes, modes, modes): at a node, from mode to mode
    const double *first;   // (modes,): of what comes before a first push

    // The costs of pushes by a mode from a node to every node.
    const double *pushes_from(std::ptrdiff_t mode, std::ptrdiff_t node) const {
        return pushes + (mode * nodes + node) * nodes;
    }
    // The costs of changes at a node from a mode to every mode.
    const double *changes_from(std::ptrdiff_t node, std::ptrdiff_t mode) const {
        return changes + (node * modes + mode) * modes;
    }
};

// Find the cheapest sequence of at most `most` pushes from node 0 to one of nodes 1 to `goals`.
//
// By the number of pushes, cheapest first, as in the recursion of Bellman and Ford.
Sequence cheapest_sequence(const SequenceCosts &costs, std::ptrdiff_t goals, std::ptrdiff_t most);

// A load that is pushed once in a tour, from one of some entries to one of some exits.
struct TourStop {
    std::ptrdiff_t entries, exits;
    const double *ways;   // (exits of all, entries): the robot's ways from the end of any push
    const double *pushes; // (loads, 2, entries, exits): each other load alone being at its goal, or not yet

    // What a push costs while the loads of a set, by bits, are not brought to their goals yet.
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

// Return what the cheapest tours cost through each set of loads, by bits, from each exit (Held and Karp 1962).
std::vector<double> cheapest_tours(const std::vector<TourStop> &stops);

} // namespace pushplan
