// Poses, arcs and families from NumPy's arrays, and back.
#pragma once

#include "numpy.hpp"
#include "poses.hpp"

#include <vector>

namespace pushplan {

inline const double *three_finite(const Numbers &array, const char *name) {
    if (array.size() != 3)
        throw std::invalid_argument(std::string(name) + " has three numbers, not " + std::to_string(array.size()));
    require_all_finite(array.data(), 3, name);
    return array.data();
}

inline Pose to_pose(const Numbers &array) { return pose_at(three_finite(array, "a pose")); }
inline Twist to_twist(const Numbers &array) { return twist_at(three_finite(array, "a twist")); }

// Return a copy of rows (n, columns) of finite numbers as structs of as many numbers.
template <class Struct, class Number> std::vector<Struct> to_rows(const Array<Number> &array, const char *what) {
    constexpr auto columns = static_cast<std::ptrdiff_t>(sizeof(Struct) / sizeof(double));
    if (array.ndim() < 2 || array.size() != array.shape(0) * columns)
        throw std::invalid_argument(std::string(what) + " is not a table of " + std::to_string(columns) +
                                    " numbers a row");
    require_all_finite(array.data(), array.size(), what);
    std::vector<Struct> rows(static_cast<std::size_t>(array.shape(0)));
    copy_bytes(rows.data(), array.data(), rows.size() * sizeof(Struct));
    return rows;
}

inline std::vector<Family> to_families(const Numbers &array) { return to_rows<Family>(array, "families"); }
inline std::vector<Arc> to_arcs(const Numbers &array) {
    auto arcs = to_rows<Arc>(array, "a path");
    for (const Arc &arc : arcs)
        require_not_negative(arc.length, "an arc's length");
    return arcs;
}

// Return the three coordinates of an arc: two from 0 to 1 (`choose_twist`), and its length as a share of the longest
// arc.
inline std::array<double, 3> to_controls(const double *of) {
    for (int k = 0; k < 2; ++k)
        if (!(of[k] >= 0.0 && of[k] <= 1.0))
            refuse(of[k], "a control", "from 0 to 1");
    return {of[0], of[1], require_not_negative(of[2], "a control")};
}

// Return a copy of rows as a table (n, numbers per row).
template <class Struct> Made<double> to_table(const Struct *rows, std::size_t count) {
    constexpr auto columns = static_cast<std::ptrdiff_t>(sizeof(Struct) / sizeof(double));
    auto made = new_array<double>({static_cast<std::ptrdiff_t>(count), columns});
    copy_bytes(made.data(), rows, count * sizeof(Struct));
    return made;
}

template <class Rows> auto to_table(const Rows &rows) { return to_table(rows.data(), rows.size()); }

inline Made<double> to_array(const Pose &pose) {
    auto made = new_array<double>({3});
    put(made.data(), pose);
    return made;
}

} // namespace pushplan
