// Steering paths: exact connections of two poses by three stable arcs (Dubins paths).
#pragma once

#include "scene.hpp"

#include <array>
#include <vector>

namespace pushplan {

// Words per family: four turn-straight-turn with up to two roots each, two turn-turn-turn with two apexes.
constexpr int MAX_WORDS = 12;

// Families that a connection is looked for in, at most.
constexpr int MOST_FAMILIES = 3;

// Words that are swept, at most, in the attempt to connect a new node.
constexpr int TRIES = 2;

// Three letters, which are rows of a family, and how long each is driven, m of cost.
struct Word {
    double cost;
    std::array<int, 3> letters;
    std::array<double, 3> lengths;

    std::array<Arc, 3> arcs(const Family &family) const {
        return {Arc{family[letters[0]], lengths[0]}, Arc{family[letters[1]], lengths[1]},
                Arc{family[letters[2]], lengths[2]}};
    }
};

// A list with room for all words of one family, or of MOST_FAMILIES.
template <int capacity> struct WordList {
    std::array<Word, capacity> words;
    int count = 0;

    void add(int a, int b, int c, double p, double q, double r) { words[count++] = {p + q + r, {a, b, c}, {p, q, r}}; }
    Word *begin() { return words.data(); }
    Word *end() { return words.data() + count; }
    const Word *begin() const { return words.data(); }
    const Word *end() const { return words.data() + count; }
};

using Words = WordList<MAX_WORDS>;

// Return every word of a family from one pose to another.
Words find_words(const Family &family, const Pose &start, const Pose &goal);

// The cheapest of a range of items with a `cost` that costs less than a bound, the first one of equals; null without.
template <class Item> Item *cheapest(Item *first, Item *last, double bound) {
    Item *best = nullptr;
    for (; first != last; ++first)
        if (first->cost < bound && (best == nullptr || first->cost < best->cost))
            best = first;
    return best;
}

// The cheapest word over all families, blocked or not.
struct BestWord {
    double cost = INF;
    std::array<Arc, 3> arcs;
};
BestWord best_word(Row<const Family> families, const Pose &start, const Pose &goal);

// Return whether three arcs keep clear of everything: first the middle one, mostly the longest.
bool word_is_free(const Scene &scene, const std::array<Arc, 3> &arcs, const Pose &start);

struct Connection {
    double cost = INF;      // infinite if there is none
    double promise = INF;   // the cheapest word's cost, free or not
    std::array<Arc, 3> arcs; // only of a connection
};

// Find the cheapest free connection below a bound.
//
// Only words cheaper than `bound` are looked at; `tries` of them, cheapest first, are swept for collisions at most. At
// most MOST_FAMILIES families, or std::invalid_argument is thrown.
Connection connect(const Scene &scene, Row<const Family> families, const Pose &start, const Pose &goal, double bound,
                   int tries);

// Write the costs of the cheapest free words from starts to goals, a row a start, infinite where there is none.
//
// Start and goal must have the clearance at least; between two poses the scene keeps what the nearer of them leaves,
// see `scene_with_gap`.
void reach(const Scene &scene, Row<const Family> families, const std::vector<Pose> &starts,
           const std::vector<Pose> &goals, double clearance, Table<double> costs);

} // namespace pushplan
