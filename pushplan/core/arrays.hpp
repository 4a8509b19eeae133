// Arrays whose shape is known: those that are handed over, and those that an object of the core keeps.
#pragma once

#include "numpy.hpp"

#include <functional>
#include <numeric>
#include <type_traits>

namespace pushplan {

// A shape in words; -1 stands for any length.
inline std::string words(const std::vector<py::ssize_t> &lengths) {
    std::string found = "(";
    for (std::size_t k = 0; k < lengths.size(); ++k)
        found += (k ? ", " : "") + (lengths[k] < 0 ? std::string("any") : std::to_string(lengths[k]));
    return found + ")";
}

// Throw std::invalid_argument unless an array has a shape; `name` is what it holds.
inline void require_shape(const py::array &array, const std::vector<py::ssize_t> &wanted, const char *name) {
    const std::vector<py::ssize_t> shape(array.shape(), array.shape() + array.ndim());
    bool fits = shape.size() == wanted.size();
    for (std::size_t k = 0; fits && k < wanted.size(); ++k)
        fits = wanted[k] < 0 || wanted[k] == shape[k];
    if (!fits)
        throw std::invalid_argument(std::string(name) + " has shape " + words(shape) + "; it must be " +
                                    words(wanted));
}

// Twists (k, 3), or their time derivatives.
inline Table<const double> twist_table(const Numbers &twists) {
    require_shape(twists, {-1, 3}, "table of twists");
    return table(twists);
}

// A copy of an array. std::vector<bool> has no numbers in a row: a bool is kept as a byte.
template <class Number> struct Kept {
    using Stored = std::conditional_t<std::is_same_v<Number, bool>, std::uint8_t, Number>;
    using Array = py::array_t<Number, py::array::c_style | py::array::forcecast>;

    std::vector<Stored> numbers;
    std::vector<py::ssize_t> shape;
    py::ssize_t columns = 1; // all that one index of the first axis holds is a row

    Kept() = default;
    Kept(const Array &array, const std::vector<py::ssize_t> &wanted, const char *name)
        : numbers(array.data(), array.data() + array.size()), shape(array.shape(), array.shape() + array.ndim()) {
        require_shape(array, wanted, name);
        columns = std::accumulate(shape.begin() + 1, shape.end(), columns, std::multiplies<py::ssize_t>());
    }

    py::ssize_t size() const { return shape.empty() ? 0 : shape[0]; }
    Table<const Stored> table() const { return {numbers.data(), size(), columns}; }

    // The array again, as one that shares the memory, read-only; `owner` is the Python object whose it is.
    py::array_t<Number> shown(const py::object &owner) const {
        static_assert(sizeof(Number) == sizeof(Stored), "the same memory");
        py::array_t<Number> array(shape, reinterpret_cast<const Number *>(numbers.data()), owner);
        py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
        return array;
    }
};

// Bind a read-only property that shows what an object keeps.
template <class Class, class Object, class Number>
void def_shown(Class &bound, const char *name, Kept<Number> Object::*member) {
    bound.def_property_readonly(
        name, [member](const py::object &self) { return (self.cast<const Object &>().*member).shown(self); });
}

} // namespace pushplan
