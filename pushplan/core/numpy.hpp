// NumPy arrays as tables. Views are taken while the interpreter's lock is held; what runs long then lets it go:
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
// Without its header a type compiles, too, and is refused when it is handed over: a test looks for such types.
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

// An array that a caller hands over, contiguous, with sizes that may be subtracted from one another.
template <class Number> struct Array : nb::ndarray<Number, nb::c_contig, nb::device::cpu> {
    using Base = nb::ndarray<Number, nb::c_contig, nb::device::cpu>;
    using value_type = std::remove_const_t<Number>;

    std::ptrdiff_t ndim() const { return static_cast<std::ptrdiff_t>(Base::ndim()); }
    std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(Base::size()); }
    std::ptrdiff_t shape(std::ptrdiff_t axis) const { return static_cast<std::ptrdiff_t>(Base::shape(axis)); }
    Shape shape() const { return {Base::shape_ptr(), Base::shape_ptr() + ndim()}; }
};

// What is handed over is converted to contiguous numbers if it is not: to be read only, a copy may be made.
template <class Number> using Given = Array<const Number>;
using Numbers = Given<double>;
using Integers = Given<std::int64_t>;
// What is written to has to be the caller's own memory: `nb::arg(...).noconvert()` refuses another layout or kind.
using Written = Array<double>;

// The state of a `Random`, (1,): a caller's generator goes on where a call has left it.
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

// std::memcpy, also of nothing: an empty vector has no address, and memcpy must not be given none.
inline void copy_bytes(void *to, const void *from, std::size_t count) {
    if (count != 0)
        std::memcpy(to, from, count);
}

// An array of NumPy's that is made here, and given back.
template <class Number> struct Made : nb::ndarray<nb::numpy, Number> {
    Made(Number *numbers, const std::vector<std::size_t> &shape, nb::handle owner)
        : nb::ndarray<nb::numpy, Number>(numbers, shape.size(), shape.data(), owner) {}
};

inline std::vector<std::size_t> sizes_of(const Shape &shape) { return {shape.begin(), shape.end()}; }

// A vector's numbers as an array of a given shape that owns them: nothing is copied.
template <class Number> Made<Number> to_numpy(std::vector<Number> &&numbers, const Shape &shape) {
    auto *kept = new std::vector<Number>(std::move(numbers));
    nb::capsule owner(kept, [](void *pointer) noexcept { delete static_cast<std::vector<Number> *>(pointer); });
    return {kept->data(), sizes_of(shape), owner};
}

// A row (n,) of a vector's numbers: nothing is copied.
template <class Number> Made<Number> to_numpy(std::vector<Number> &&numbers) {
    const auto count = static_cast<std::ptrdiff_t>(numbers.size());
    return to_numpy(std::move(numbers), {count});
}

// An array of a shape, to be filled in.
template <class Number> Made<Number> new_array(const Shape &shape) {
    auto *numbers = new Number[static_cast<std::size_t>(require_room(shape, "an array"))];
    nb::capsule owner(numbers, [](void *pointer) noexcept { delete[] static_cast<Number *>(pointer); });
    return {numbers, sizes_of(shape), owner};
}

// An array of a shape with a copy of the numbers from an address on.
template <class Number> Made<Number> copied(const Number *numbers, const Shape &shape) {
    Made<Number> made = new_array<Number>(shape);
    copy_bytes(made.data(), numbers, made.nbytes());
    return made;
}

template <class Number> Made<Number> copied(const std::vector<Number> &numbers) {
    return copied(numbers.data(), {static_cast<std::ptrdiff_t>(numbers.size())});
}

// Numbers that `owner` keeps, to be read only: nothing is copied.
template <class Number> Made<const Number> read_only(const Number *numbers, const Shape &shape, nb::handle owner) {
    return {numbers, sizes_of(shape), owner};
}

// A constructor: the object that a function makes of the arguments.
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

// How an object is pickled: by the arguments of its constructor, all of which it shows by their names.
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

// How one is pickled that has changed since: by a tuple, and made of it again.
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
    // What stubs say: kind of the numbers alone.
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

    // It has its owner: no policy has a say in that.
    static handle from_cpp(const Base &array, rv_policy, cleanup_list *cleanup) noexcept {
        return make_caster<Base>::from_cpp(array, rv_policy::automatic, cleanup);
    }
};
