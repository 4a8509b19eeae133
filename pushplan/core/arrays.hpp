// Arrays with checked shapes: arguments, and arrays that an object of the core stores.
#pragma once

#include "numpy.hpp"

#include <numeric>
#include <type_traits>

namespace pushplan {

// Return a shape as text; -1 means any length.
inline std::string words(const Shape &lengths) {
    std::string found = "(";
    for (std::size_t k = 0; k < lengths.size(); ++k)
        found += (k ? ", " : "") + (lengths[k] < 0 ? std::string("any") : std::to_string(lengths[k]));
    return found + ")";
}

// Throw std::invalid_argument unless an array has a shape; `name` describes the array.
template <class Number> void require_shape(const Array<Number> &array, const Shape &wanted, const char *name) {
    const Shape shape = array.shape();
    bool fits = shape.size() == wanted.size();
    for (std::size_t k = 0; fits && k < wanted.size(); ++k)
        fits = wanted[k] < 0 || wanted[k] == shape[k];
    if (!fits)
        throw std::invalid_argument(std::string(name) + " has shape " + words(shape) + "; it must be " + words(wanted));
}

// Twists (k, 3), or their time derivatives.
inline Table<const double> twist_table(const Numbers &twists) {
    require_shape(twists, {-1, 3}, "table of twists");
    return table(twists);
}

// A copy of an array. Bools are stored as bytes, because std::vector<bool> is not contiguous.
template <class Number> struct Kept {
    using Stored = std::conditional_t<std::is_same_v<Number, bool>, std::uint8_t, Number>;
    using Array = Given<Number>;

    std::vector<Stored> numbers;
    Shape shape;
    std::ptrdiff_t columns = 1; // a row is everything at one index of the first axis

    Kept() = default;
    Kept(const Array &array, const Shape &wanted, const char *name)
        : numbers(array.data(), array.data() + array.size()), shape(array.shape()) {
        require_shape(array, wanted, name);
        columns = std::accumulate(shape.begin() + 1, shape.end(), columns, std::multiplies<std::ptrdiff_t>());
    }

    std::ptrdiff_t size() const { return shape.empty() ? 0 : shape[0]; }
    Table<const Stored> table() const { return {numbers.data(), size(), columns}; }

    // Return a read-only array that shares the memory; `owner` is the Python object that owns it.
    Made<const Number> shown(const nb::object &owner) const {
        static_assert(sizeof(Number) == sizeof(Stored), "the same memory");
        return read_only(reinterpret_cast<const Number *>(numbers.data()), shape, owner);
    }
};

// Bind a read-only property that returns a stored array.
template <class Class, class Object, class Number>
void def_shown(Class &bound, const char *name, Kept<Number> Object::*member) {
    bound.def_prop_ro(
        name, [member](const nb::object &self) { return (nb::cast<const Object &>(self).*member).shown(self); });
}

} // namespace pushplan
