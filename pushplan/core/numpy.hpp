// NumPy arrays as tables. Views are taken while holding the interpreter's lock. Long work then releases it:
//
//     m.def("grow", [](const Scene &scene, Numbers path) {
//         const auto rows = table(path);
//         nb::gil_scoped_release free;  // from here on no Python object is touched
//         return grow(scene, rows);
//     });
#pragma once

#include "tables.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
// Without its header, a type still compiles but is refused as an argument. A test checks for such types.
#include <nanobind/stl/array.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <functional>
#include <numeric>
#include <string>
#include <type_traits>
#include <vector>

namespace pushplan {

namespace nb = nanobind;

using Shape = std::vector<std::ptrdiff_t>;

// A contiguous array argument. Its sizes are signed, so that they can be subtracted.
template <class Number> struct Array : nb::ndarray<Number, nb::c_contig, nb::device::cpu> {
    using Base = nb::ndarray<Number, nb::c_contig, nb::device::cpu>;
    using value_type = std::remove_const_t<Number>;

    std::ptrdiff_t ndim() const { return static_cast<std::ptrdiff_t>(Base::ndim()); }
    std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(Base::size()); }
    std::ptrdiff_t shape(std::ptrdiff_t axis) const { return static_cast<std::ptrdiff_t>(Base::shape(axis)); }
    Shape shape() const { return {Base::shape_ptr(), Base::shape_ptr() + ndim()}; }
};

// A read-only argument, converted to a contiguous copy if necessary.
template <class Number> using Given = Array<const Number>;
using Numbers = Given<double>;
using Integers = Given<std::int64_t>;
// A written argument must be the caller's own memory: `nb::arg(...).noconvert()` refuses another layout or type.
using Written = Array<double>;

// The state (1,) of a `Random`. A caller's generator continues where the last call stopped.
using RandomState = Array<std::uint64_t>;

inline Random &random_of(RandomState &state) {
    static_assert(sizeof(Random) == sizeof(std::uint64_t), "a generator is its state");
    if (state.size() != 1)
        throw std::invalid_argument("a random state is one number, not " + std::to_string(state.size()));
    return *reinterpret_cast<Random *>(state.data());
}

template <class Number> auto table(const Array<Number> &array) {
    if (array.ndim() != 2)
        throw std::invalid_argument("a table has two dimensions, not " + std::to_string(array.ndim()));
    return Table<Number>{array.data(), array.shape(0), array.shape(1)};
}

template <class Number> auto row(const Array<Number> &array) {
    if (array.ndim() != 1)
        throw std::invalid_argument("a row has one dimension, not " + std::to_string(array.ndim()));
    return Row<Number>{array.data(), array.shape(0)};
}

// std::memcpy that also accepts empty vectors, whose address is null.
inline void copy_bytes(void *to, const void *from, std::size_t count) {
    if (count != 0)
        std::memcpy(to, from, count);
}

// A NumPy array that is made here and returned.
template <class Number> struct Made : nb::ndarray<nb::numpy, Number> {
    Made(Number *numbers, const std::vector<std::size_t> &shape, nb::handle owner)
        : nb::ndarray<nb::numpy, Number>(numbers, shape.size(), shape.data(), owner) {}
};

inline std::vector<std::size_t> sizes_of(const Shape &shape) { return {shape.begin(), shape.end()}; }

// Return a vector's numbers as an array of a shape that owns them, without a copy.
template <class Number> Made<Number> to_numpy(std::vector<Number> &&numbers, const Shape &shape) {
    auto *kept = new std::vector<Number>(std::move(numbers));
    nb::capsule owner(kept, [](void *pointer) noexcept { delete static_cast<std::vector<Number> *>(pointer); });
    return {kept->data(), sizes_of(shape), owner};
}

// Return a vector's numbers as a row (n,), without a copy.
template <class Number> Made<Number> to_numpy(std::vector<Number> &&numbers) {
    const auto count = static_cast<std::ptrdiff_t>(numbers.size());
    return to_numpy(std::move(numbers), {count});
}

// Return an uninitialised array of a shape.
template <class Number> Made<Number> new_array(const Shape &shape) {
    auto *numbers = new Number[static_cast<std::size_t>(require_room(shape, "an array"))];
    nb::capsule owner(numbers, [](void *pointer) noexcept { delete[] static_cast<Number *>(pointer); });
    return {numbers, sizes_of(shape), owner};
}

// Return an array of a shape with a copy of the numbers at an address.
template <class Number> Made<Number> copied(const Number *numbers, const Shape &shape) {
    Made<Number> made = new_array<Number>(shape);
    copy_bytes(made.data(), numbers, made.nbytes());
    return made;
}

template <class Number> Made<Number> copied(const std::vector<Number> &numbers) {
    return copied(numbers.data(), {static_cast<std::ptrdiff_t>(numbers.size())});
}

// Return a read-only array of numbers that `owner` keeps, without a copy.
template <class Number> Made<const Number> read_only(const Number *numbers, const Shape &shape, nb::handle owner) {
    return {numbers, sizes_of(shape), owner};
}

// A constructor that calls a function with the arguments.
template <class Class, class... Args> struct MadeBy : nb::def_visitor<MadeBy<Class, Args...>> {
    Class (*make)(Args...);

    explicit MadeBy(Class (*make)(Args...)) : make(make) {}

    template <class Bound, class... Extra> void execute(Bound &bound, const Extra &...extra) {
        bound.def(
            "__init__",
            [make = make](Class *self, Args... args) { new (self) Class(make(std::forward<Args>(args)...)); },
            extra...);
    }
};

// Pickling by the constructor's arguments, which the object has as properties of the same names.
struct PickledBy : nb::def_visitor<PickledBy> {
    std::vector<const char *> names;

    PickledBy(std::initializer_list<const char *> names) : names(names) {}

    template <class Bound> void execute(Bound &bound) {
        bound.def(
            "__reduce__",
            [names = names](const nb::object &self) {
                nb::dict arguments;
                for (const char *name : names)
                    arguments[name] = self.attr(name);
                const nb::object partial = nb::module_::import_("functools").attr("partial");
                return nb::make_tuple(partial(self.type(), **arguments), nb::tuple());
            },
            nb::sig("def __reduce__(self) -> tuple[object, ...]"));
    }
};

// Pickling of an object that can change: its state is a tuple.
template <class Class, class Self> struct Pickled : nb::def_visitor<Pickled<Class, Self>> {
    nb::tuple (*state)(Self);
    Class (*make)(const nb::tuple &);

    Pickled(nb::tuple (*state)(Self), Class (*make)(const nb::tuple &)) : state(state), make(make) {}

    template <class Bound> void execute(Bound &bound) {
        bound.def("__getstate__", state, nb::sig("def __getstate__(self) -> tuple[object, ...]"));
        bound.def(
            "__setstate__", [make = make](Class &self, const nb::tuple &state) { new (&self) Class(make(state)); },
            nb::sig("def __setstate__(self, state: tuple[object, ...], /) -> None"));
    }
};

} // namespace pushplan

template <class Number> struct nanobind::detail::type_caster<pushplan::Array<Number>> {
    using Base = typename pushplan::Array<Number>::Base;
    // Type in stubs: the type of the numbers only.
    static constexpr auto Kind = dtype_name<std::remove_const_t<Number>>::name;
    NB_TYPE_CASTER(pushplan::Array<Number>, const_name("numpy.ndarray[") + Kind + const_name("]"))

    bool from_python(handle source, uint32_t flags, cleanup_list *cleanup) noexcept {
        make_caster<Base> caster;
        if (!caster.from_python(source, flags, cleanup))
            return false;
        static_cast<Base &>(value) = std::move(caster.value);
        return true;
    }
};

template <class Number> struct nanobind::detail::type_caster<pushplan::Made<Number>> {
    using Base = ndarray<numpy, Number>;
    static constexpr auto Name = make_caster<Base>::Name;
    template <class> using Cast = pushplan::Made<Number>;

    // The array has its owner, so the policy does not matter.
    static handle from_cpp(const Base &array, rv_policy, cleanup_list *cleanup) noexcept {
        return make_caster<Base>::from_cpp(array, rv_policy::automatic, cleanup);
    }
};
