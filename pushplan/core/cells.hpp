// Cells of a lattice of poses, found by a key.
#pragma once

#include "poses.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace pushplan {

// Maximum number of columns, rows and headings in a key.
constexpr std::int64_t MOST_CELLS = std::int64_t{1} << 20;

// Return the key (> 0) of a cell. Each index must be below `MOST_CELLS`.
inline std::int64_t cell_key(std::int64_t i, std::int64_t j, std::int64_t k) {
    return (((i << 20) + j) << 20) + k + 1;
}

// A hash table of cells. 0 marks a free slot. The number of slots is a power of two up to 2^23.
class CellTable {
  public:
    // Clear a number of slots and use only these.
    void clear(std::size_t slots) {
        if (keys_.size() < slots)
            keys_.resize(slots);
        std::fill(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(slots), 0);
        last_ = slots - 1;
    }

    // Return the slot that holds a key, or a free slot for it.
    std::size_t slot_of(std::int64_t key) const {
        // Shift by 40, because columns do not change the lower bits.
        std::size_t slot = (static_cast<std::uint64_t>(key) * 0x9E3779B97F4A7C1ULL >> 40) & last_;
        while (keys_[slot] != 0 && keys_[slot] != key)
            slot = (slot + 1) & last_;
        return slot;
    }

    std::int64_t &operator[](std::size_t slot) { return keys_[slot]; }
    std::int64_t operator[](std::size_t slot) const { return keys_[slot]; }

  private:
    std::vector<std::int64_t> keys_;
    std::size_t last_ = 0;
};

} // namespace pushplan
