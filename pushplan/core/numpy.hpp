// NumPy arrays as tables. Views are taken while the interpreter's lock is held; what runs long then lets it go:
//
//     m.def("grow", [](const Scene &scene, Numbers path) {
//         const auto rows = table(path);
//         py::gil_scoped_release free;  // from here on no Python object is touched
//         return grow(scene, rows);
//     });
#pragma once

#include "tables.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstring>
#include <vector>

namespace pushplan {

namespace py = pybind11;

// What a caller hands over is converted to contiguous numbers if it is not: to be read only, a copy may be made.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Integers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
// What is written to has to be the caller's own memory: another layout or kind of number is refused.
using Written = py::array_t<double, py::array::c_style>;
using WrittenIntegers = py::array_t<std::int64_t, py::array::c_style>;

// The state of a `Random`, (1,): a caller's generator goes on where a call has left it.
using RandomState = py::array_t<std::uint64_t, py::array::c_style>;

inline Random &random_of(RandomState &state) {
    static_assert(sizeof(Random) == sizeof(std::uint64_t), "a generator is its state");
    if (state.size() != 1)
        throw std::invalid_argument("a random state is one number, not " + std::to_string(state.size()));
    return *reinterpret_cast<Random *>(state.mutable_data());
}

template <class Array> auto table(const Array &array) {
    using Number = typename Array::value_type;
    if (array.ndim() != 2)
        throw std::invalid_argument("a table has two dimensions, not " + std::to_string(array.ndim()));
    return Table<const Number>{array.data(), array.shape(0), array.shape(1)};
}

template <class Array> auto written_table(Array &array) {
    using Number = typename Array::value_type;
    if (array.ndim() != 2)
        throw std::invalid_argument("a table has two dimensions, not " + std::to_string(array.ndim()));
    return Table<Number>{array.mutable_data(), array.shape(0), array.shape(1)};
}

template <class Array> auto row(const Array &array) {
    using Number = typename Array::value_type;
    if (array.ndim() != 1)
        throw std::invalid_argument("a row has one dimension, not " + std::to_string(array.ndim()));
    return Row<const Number>{array.data(), array.shape(0)};
}

template <class Array> auto written_row(Array &array) {
    using Number = typename Array::value_type;
    if (array.ndim() != 1)
        throw std::invalid_argument("a row has one dimension, not " + std::to_string(array.ndim()));
    return Row<Number>{array.mutable_data(), array.shape(0)};
}

// std::memcpy, also of nothing: an empty vector has no address, and memcpy must not be given none.
inline void copy_bytes(void *to, const void *from, std::size_t count) {
    if (count != 0)
        std::memcpy(to, from, count);
}

// Numbers that `owner` keeps, to be read only: nothing is copied.
inline py::array_t<double> read_only(const double *numbers, std::vector<py::ssize_t> shape, py::handle owner) {
    py::array_t<double> view(std::move(shape), numbers, owner);
    view.attr("flags").attr("writeable") = false;
    return view;
}

// A vector's numbers as an array of a given shape that owns them: nothing is copied.
template <class Number> py::array_t<Number> to_numpy(std::vector<Number> &&numbers, std::vector<py::ssize_t> shape) {
    auto *kept = new std::vector<Number>(std::move(numbers));
    py::capsule owner(kept, [](void *pointer) { delete static_cast<std::vector<Number> *>(pointer); });
    return py::array_t<Number>(std::move(shape), kept->data(), owner);
}

} // namespace pushplan
