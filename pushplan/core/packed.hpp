// A chain with known loads: objects and contacts in the chain frame.
#pragma once

#include "arrays.hpp"
#include "friction.hpp"

namespace pushplan::mechanics {

// The n objects and their contacts; the arrays are described in `contacts.pyi`.
struct PackedChain {
    Kept<double> objects, parts;
    Kept<std::complex<double>> series;
    Kept<std::int64_t> links;
    Kept<double> rows;
    double length = 1.0;

    std::ptrdiff_t count() const { return links.size(); }
    Supports supports() const { return {objects.table(), parts.table(), series.table(), links.table()}; }
    std::int64_t pusher(std::ptrdiff_t k) const { return links.table()[k][PUSHER]; }
    Facets facets(std::ptrdiff_t k) const { return read<Facets>(rows.table()[k]); }

    // Throw std::invalid_argument if an index is outside an array.
    void check() const {
        if (rows.size() != 0 && rows.size() != count())
            throw std::invalid_argument("the rows must be given for every contact or for none");
        for (std::ptrdiff_t i = 0; i < count(); ++i) {
            const std::int64_t *link = links.table()[i];
            if (link[FIRST_PART] < 0 || link[FIRST_PART] >= link[PAST_LAST_PART] ||
                link[PAST_LAST_PART] > parts.size())
                throw std::invalid_argument("the parts of object " + std::to_string(i) + " are not among all parts");
            if (link[PUSHER] >= i)
                throw std::invalid_argument("object " + std::to_string(i) + " is pushed by a later one");
        }
    }

    // Throw std::invalid_argument unless the contacts were packed as well.
    void require_contacts() const {
        if (rows.size() != count())
            throw std::invalid_argument("these objects were packed without contacts");
    }
};

} // namespace pushplan::mechanics
