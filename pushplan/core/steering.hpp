// Steering paths: exact connections of two poses by three stable arcs (Dubins paths).
#pragma once

#include "scene.hpp"

#include <array>
#include <vector>

namespace pushplan {

// Maximum number of steering paths per family: four turn-straight-turn with two roots, two turn-turn-turn with two
// apexes.
constexpr int MAX_WORDS = 12;

// Maximum number of families for a connection.
constexpr int MOST_FAMILIES = 3;

// Maximum number of steering paths checked to connect a new node.
constexpr int TRIES = 2;

// A steering path: three letters (rows of a family) and their lengths, m of cost.
struct Word {
    double cost;
    std::array<int, 3> letters;
    std::array<double, 3> lengths;

    std::array<Arc, 3> arcs(const Family &family) const {
        return {Arc{family[letters[0]], lengths[0]}, Arc{family[letters[1]], lengths[1]},
                Arc{family[letters[2]], lengths[2]}};
    }
};

// A list with room for all steering paths of one family, or of MOST_FAMILIES.
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

// Return every steering path of a family from one pose to another.
Words find_words(const Family &family, const Pose &start, const Pose &goal);

// Return the cheapest item of a range with a `cost` below a bound, the first one among equals; null without one.
template <class Item> Item *cheapest(Item *first, Item *last, double bound) {
    Item *best = nullptr;
    for (; first != last; ++first)
        if (first->cost < bound && (best == nullptr || first->cost < best->cost))
            best = first;
    return best;
}

// The cheapest steering path of all families, blocked or not.
struct BestWord {
    double cost = INF;
    std::array<Arc, 3> arcs;
};
BestWord best_word(Row<const Family> families, const Pose &start, const Pose &goal);

// Return whether three arcs are collision-free. The middle one, usually the longest, is checked first.
bool word_is_free(const Scene &scene, const std::array<Arc, 3> &arcs, const Pose &start);

struct Connection {
    double cost = INF;      // infinite if there is none
    double promise = INF;   // cost of the cheapest steering path, free or not
    std::array<Arc, 3> arcs; // valid only for a connection
};

// Find the cheapest free connection below a bound.
//
// Only steering paths cheaper than `bound` count. At most `tries` of them are checked for collisions, cheapest first.
// Throws std::invalid_argument for more than MOST_FAMILIES families.
Connection connect(const Scene &scene, Row<const Family> families, const Pose &start, const Pose &goal, double bound,
                   int tries);

// Write the costs of the cheapest free steering paths from starts to goals, one row per start; infinite if none is
// free.
//
// Start and goal must have at least the clearance. Between two poses, the scene keeps the distance that the nearer end
// allows; see `scene_with_gap`.
void reach(const Scene &scene, Row<const Family> families, const std::vector<Pose> &starts,
           const std::vector<Pose> &goals, double clearance, Table<double> costs);

} // namespace pushplan
