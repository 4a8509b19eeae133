// Checks of arguments from Python. They run once, at the border; the code behind them trusts numbers and indices.
//
// For poses, twists and tables of structs, `to_pose`, `to_twist` and `to_rows` of `numpy_poses.hpp` check that all
// numbers are finite. A binding checks its other arguments itself, before it releases the interpreter's lock:
//
//     require_finite(length, "length");
//     require_index(row, 0, tree.size(), "row");
//
// An object that changes while it works without the interpreter's lock has a `Lock` as a member. Each of its methods,
// even one that only reads, begins with `const InUse use(self.lock);`.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

namespace pushplan {

// Largest accepted number. Products of three accepted numbers do not overflow.
constexpr double LARGEST = 1e100;

// Maximum number of cells of a grid, or of numbers in an array made here: a gigabyte.
constexpr std::ptrdiff_t MOST_NUMBERS = std::ptrdiff_t{1} << 27;

[[noreturn]] inline void refuse(double value, const char *name, const char *allowed) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + "; it must be " + allowed);
}

inline bool is_finite(double value) { return std::abs(value) <= LARGEST; }

inline double require_finite(double value, const char *name) {
    if (!is_finite(value))
        refuse(value, name, "a finite number up to 1e100");
    return value;
}

// Throw if a number is NaN. Costs, bounds and limits can be infinite.
inline double require_number(double value, const char *name) {
    if (std::isnan(value))
        refuse(value, name, "a number");
    return value;
}

inline double require_positive(double value, const char *name) {
    if (!(value > 0.0) || !is_finite(value))
        refuse(value, name, "above 0 and finite");
    return value;
}

inline double require_not_negative(double value, const char *name) {
    if (!(value >= 0.0) || !is_finite(value))
        refuse(value, name, "0 or above and finite");
    return value;
}

// Throw unless all numbers are finite.
inline void require_all_finite(const double *numbers, std::ptrdiff_t count, const char *name) {
    for (std::ptrdiff_t i = 0; i < count; ++i)
        require_finite(numbers[i], name);
}

// Throw std::out_of_range unless first <= index < end.
inline std::int64_t require_index(std::int64_t index, std::int64_t first, std::int64_t end, const char *name) {
    if (index < first || index >= end)
        throw std::out_of_range(std::string(name) + " is " + std::to_string(index) + "; it must be from " +
                                std::to_string(first) + " to " + std::to_string(end - 1));
    return index;
}

// Throw unless a count is from 0 to a limit.
inline std::int64_t require_count(std::int64_t count, const char *name,
                                  std::int64_t most = std::numeric_limits<int>::max()) {
    if (count < 0 || count > most)
        throw std::invalid_argument(std::string(name) + " is " + std::to_string(count) + "; it must be from 0 to " +
                                    std::to_string(most));
    return count;
}

// Return an index or a number of columns as an int.
inline int to_int(std::int64_t value, const char *name) {
    return static_cast<int>(require_index(value, std::numeric_limits<int>::min(),
                                          std::int64_t{std::numeric_limits<int>::max()} + 1, name));
}

// Return the product of sizes, none negative; throw std::invalid_argument if it is too large for an array.
template <class Sizes> std::ptrdiff_t require_room(const Sizes &sizes, const char *name) {
    std::ptrdiff_t product = 1;
    for (const std::ptrdiff_t size : sizes) {
        if (size < 0 || (product > 0 && size > MOST_NUMBERS / product))
            throw std::invalid_argument(std::string(name) + " has a side of " + std::to_string(size) +
                                        "; sides must be 0 or more, and their product at most " +
                                        std::to_string(MOST_NUMBERS));
        product *= size;
    }
    return product;
}

// Whether an object is in use. Read and change it only while holding the interpreter's lock.
struct Lock {
    bool taken = false;
};

// Marks an object as in use; throws std::runtime_error if another thread uses it.
class InUse {
  public:
    explicit InUse(Lock &lock) : lock_(lock) {
        if (lock.taken)
            throw std::runtime_error("another thread uses this object; give each thread its own");
        lock.taken = true;
    }
    ~InUse() { lock_.taken = false; }
    InUse(const InUse &) = delete;
    InUse &operator=(const InUse &) = delete;

  private:
    Lock &lock_;
};

} // namespace pushplan
