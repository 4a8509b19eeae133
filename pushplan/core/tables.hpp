// Views of tables in other memory (a NumPy array, a std::vector), and arithmetic that must be the same on every
// machine.
#pragma once

#include "border.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

namespace pushplan {

constexpr double PI = 3.14159265358979323846;
constexpr double INF = std::numeric_limits<double>::infinity();

// Contiguous rows of equal length; `table[i][k]` is row i, column k.
template <class Number> struct Table {
    Number *data = nullptr;
    std::ptrdiff_t rows = 0;
    std::ptrdiff_t columns = 0;

    Number *operator[](std::ptrdiff_t row) const { return data + row * columns; }
    Number &at(std::ptrdiff_t row, std::ptrdiff_t column) const { return data[row * columns + column]; }
};

// A view of a row of numbers.
template <class Number> struct Row {
    Number *data = nullptr;
    std::ptrdiff_t size = 0;

    Number &operator[](std::ptrdiff_t i) const { return data[i]; }
    Number *begin() const { return data; }
    Number *end() const { return data + size; }
};

// Return the remainder with the sign of the divisor, as Python's %. std::fmod has the sign of the dividend.
inline double floored_mod(double value, double divisor) {
    const double rest = std::fmod(value, divisor);
    if (rest != 0.0 && (rest < 0.0) != (divisor < 0.0))
        return rest + divisor;
    return rest;
}

// Random numbers that are the same on every machine (splitmix64, Steele et al. 2014), unlike std::*_distribution.
struct Random {
    std::uint64_t state;

    // In [0, 1).
    double operator()() {
        state += 0x9E3779B97F4A7C15ULL;
        std::uint64_t z = state;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
        z ^= z >> 31;
        return static_cast<double>(z >> 11) * (1.0 / 9007199254740992.0);
    }
};

} // namespace pushplan
