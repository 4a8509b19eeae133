// `pushplan.core.uncertain`: chains whose loads and frictions are only known within bounds.
#include "uncertain.hpp"

#include <algorithm>

namespace pushplan::mechanics {

namespace {

using Bools = Kept<bool>::Array;

PackedLoads packed_loads(const PackedChain &units, const Integers &unit, const Numbers &points, const Integers &first,
                         const Numbers &total, const Numbers &miss, const Numbers &centers, const Integers &free,
                         const Numbers &corners, const Integers &corner, bool centred, const Numbers &loads,
                         const Bools &carried, const Numbers &facets, double length) {
    const py::ssize_t n = loads.ndim() > 0 ? loads.shape(0) : 0;
    PackedLoads packed{units,
                       {unit, {n}, "unit"},
                       {points, {-1, 4}, "points"},
                       {first, {n + 1}, "first"},
                       {total, {n}, "total"},
                       {miss, {n, 2}, "miss"},
                       {centers, {n, 8}, "centers"},
                       {free, {n}, "free"},
                       {corners, {-1, 2}, "corners"},
                       {corner, {n + 1}, "corner"},
                       centred,
                       {loads, {n, 2}, "loads"},
                       {carried, {n, n}, "carried"},
                       {facets, {n, 4, 3}, "facets"},
                       length};
    packed.check();
    return packed;
}

PackedLoads without_miss(PackedLoads packed) {
    std::fill(packed.miss.numbers.begin(), packed.miss.numbers.end(), 0.0);
    return packed;
}

py::array_t<double> least_margins_of(const PackedLoads &packed, const Numbers &twists, double floor) {
    const auto rows = twist_table(twists);
    py::array_t<double> out(rows.rows);
    double *margins = out.mutable_data();
    py::gil_scoped_release free;
    LeastRows least(packed);
    for (std::ptrdiff_t t = 0; t < rows.rows; ++t) {
        least.set_twist(twist_at(rows[t]));
        margins[t] = least.margin(floor);
    }
    return out;
}

py::array_t<double> least_contact_margins_of(const PackedLoads &packed, const Numbers &twists) {
    const auto rows = twist_table(twists);
    const std::ptrdiff_t n = packed.count();
    py::array_t<double> out({rows.rows, n});
    double *margins = out.mutable_data();
    py::gil_scoped_release free;
    LeastRows least(packed);
    for (std::ptrdiff_t t = 0; t < rows.rows; ++t) {
        least.set_twist(twist_at(rows[t]));
        least.work_out(packed.loads.table());
        for (std::ptrdiff_t k = 0; k < n; ++k) {
            const auto &row = least.rows()[k];
            const double size = least.sizes()[k];
            *margins++ = size > 0.0 ? *std::min_element(row.begin(), row.end()) / size : 0.0;
        }
    }
    return out;
}

// The forces that `set` and `ranges` lead to at each of many moments.
template <class Set>
py::array_t<double> forces_at(const PackedLoads &packed, std::ptrdiff_t count, Table<const double> ranges,
                              const Set &set) {
    py::array_t<double> forces({count, std::ptrdiff_t{3}});
    double *force = forces.mutable_data();
    py::gil_scoped_release free;
    LeastRows least(packed);
    for (std::ptrdiff_t t = 0; t < count; ++t) {
        set(least, t);
        const auto found = least.force(ranges);
        force = std::copy(found.begin(), found.end(), force);
    }
    return forces;
}

// The rows and sizes that `set` and `ranges` lead to at each of many moments: `set(least, t)` prepares moment t.
template <class Set>
py::tuple rows_at(const PackedLoads &packed, std::ptrdiff_t count, Table<const double> ranges, const Set &set,
                  bool slopes = false) {
    const std::ptrdiff_t n = packed.count();
    const std::ptrdiff_t leaning = slopes ? n : 0;
    py::array_t<double> rows({count, n, std::ptrdiff_t{4}}), sizes({count, n}),
        steep({count, n, std::ptrdiff_t{4}, leaning});
    double *row = rows.mutable_data(), *size = sizes.mutable_data(), *slope = steep.mutable_data();
    {
        py::gil_scoped_release free;
        LeastRows least(packed);
        for (std::ptrdiff_t t = 0; t < count; ++t) {
            set(least, t);
            least.work_out(ranges);
            for (const auto &found : least.rows())
                row = std::copy(found.begin(), found.end(), row);
            size = std::copy(least.sizes().begin(), least.sizes().end(), size);
            if (slopes)
                slope = std::copy(least.slopes().begin(), least.slopes().end(), slope);
        }
    }
    if (slopes)
        return py::make_tuple(rows, sizes, steep);
    return py::make_tuple(rows, sizes);
}

py::tuple rows_of(const PackedLoads &packed, const Numbers &twists) {
    const auto twist = twist_table(twists);
    const auto set = [&](LeastRows &least, std::ptrdiff_t t) { least.set_twist(twist_at(twist[t])); };
    return rows_at(packed, twist.rows, packed.loads.table(), set);
}

py::tuple sloped_rows_of(const PackedLoads &packed, const Numbers &twists) {
    const auto twist = twist_table(twists);
    const auto set = [&](LeastRows &least, std::ptrdiff_t t) { least.set_twist(twist_at(twist[t])); };
    return rows_at(packed, twist.rows, packed.loads.table(), set, true);
}

void require_places(const PackedLoads &packed) {
    if (packed.centred)
        throw std::invalid_argument("a load of which only the centre is known has no known place");
}

py::array_t<double> forces_of(const PackedLoads &packed, const Numbers &twists) {
    require_places(packed);
    const auto twist = twist_table(twists);
    const auto set = [&](LeastRows &least, std::ptrdiff_t t) { least.set_twist(twist_at(twist[t])); };
    return forces_at(packed, twist.rows, packed.loads.table(), set);
}

void require_wrenches(const PackedLoads &packed, const Numbers &masses, const Numbers &known, const Numbers &pulls) {
    const std::ptrdiff_t n = packed.count(), p = packed.points.size();
    require_places(packed);
    require_shape(masses, {n, 2}, "masses");
    require_shape(known, {-1, n, 3}, "known");
    require_shape(pulls, {known.shape(0), p, 3}, "pulls");
}

auto wrenches_at(const PackedLoads &packed, const Numbers &known, const Numbers &pulls) {
    const std::ptrdiff_t n = packed.count(), p = packed.points.size();
    const double *of_known = known.data(), *of_points = pulls.data();
    return [=](LeastRows &least, std::ptrdiff_t t) {
        least.set_wrenches(of_known + 3 * n * t, of_points + 3 * p * t);
    };
}

py::array_t<double> inertia_forces_of(const PackedLoads &packed, const Numbers &masses, const Numbers &known,
                                      const Numbers &pulls) {
    require_wrenches(packed, masses, known, pulls);
    return forces_at(packed, known.shape(0), table(masses), wrenches_at(packed, known, pulls));
}

py::tuple inertia_rows_of(const PackedLoads &packed, const Numbers &masses, const Numbers &known,
                          const Numbers &pulls) {
    require_wrenches(packed, masses, known, pulls);
    return rows_at(packed, known.shape(0), table(masses), wrenches_at(packed, known, pulls));
}

py::tuple worst_spreads(const PackedLoads &packed, const Numbers &twist, std::ptrdiff_t k, int j) {
    const std::ptrdiff_t n = packed.count();
    require_shape(twist, {3}, "twist");
    if (k < 0 || k >= n || j < 0 || j >= 4)
        throw std::invalid_argument("there is no such contact or row");
    py::array_t<double> values(n), spreads({n, std::ptrdiff_t{3}, std::ptrdiff_t{3}});
    std::fill_n(values.mutable_data(), n, 0.0);
    std::fill_n(spreads.mutable_data(), 9 * n, 0.0);
    LeastRows rows(packed);
    rows.set_twist(twist_at(twist.data()));
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        if (!packed.carries(k, i) || !packed.by_centre(i))
            continue;
        const double least = rows.least_centred(i, packed.facet(k, j));
        values.mutable_at(i) = read<Range>(packed.loads.table()[i]).least(least);
        const CentredLoad &load = rows.centred(i);
        const Shares parts = load.shares(0.0, 0.0);
        const Centre centre = load.centre();
        for (int b = 0; b < 3; ++b) {
            const UnitLoad &basic = load.basis()[b].load;
            spreads.mutable_at(i, b, 0) = basic.x + centre.x + basic.shift * basic.pull.x;
            spreads.mutable_at(i, b, 1) = basic.y + centre.y + basic.shift * basic.pull.y;
            spreads.mutable_at(i, b, 2) = parts[b];
        }
    }
    return py::make_tuple(values, spreads);
}

py::tuple state_of(const py::object &self) {
    const auto &packed = self.cast<const PackedLoads &>();
    return py::make_tuple(packed.units, packed.unit.shown(self), packed.points.shown(self), packed.first.shown(self),
                          packed.total.shown(self), packed.miss.shown(self), packed.centers.shown(self),
                          packed.free.shown(self), packed.corners.shown(self), packed.corner.shown(self),
                          packed.centred, packed.loads.shown(self), packed.carried.shown(self),
                          packed.facets.shown(self), packed.length);
}

PackedLoads of_state(const py::tuple &s) {
    return packed_loads(s[0].cast<const PackedChain &>(), s[1].cast<Integers>(), s[2].cast<Numbers>(),
                        s[3].cast<Integers>(), s[4].cast<Numbers>(), s[5].cast<Numbers>(), s[6].cast<Numbers>(),
                        s[7].cast<Integers>(), s[8].cast<Numbers>(), s[9].cast<Integers>(), s[10].cast<bool>(),
                        s[11].cast<Numbers>(), s[12].cast<Bools>(), s[13].cast<Numbers>(), s[14].cast<double>());
}

void bind_packed_loads(py::module_ &m) {
    py::class_<PackedLoads> bound(m, "PackedLoads");
    bound.def(py::init(&packed_loads), py::kw_only(), py::arg("units"), py::arg("unit"), py::arg("points"),
              py::arg("first"), py::arg("total"), py::arg("miss"), py::arg("centers"), py::arg("free"),
              py::arg("corners"), py::arg("corner"), py::arg("centred"), py::arg("loads"), py::arg("carried"),
              py::arg("facets"), py::arg("length"));
    def_shown(bound, "points", &PackedLoads::points);
    def_shown(bound, "first", &PackedLoads::first);
    def_shown(bound, "total", &PackedLoads::total);
    def_shown(bound, "miss", &PackedLoads::miss);
    def_shown(bound, "free", &PackedLoads::free);
    def_shown(bound, "carried", &PackedLoads::carried);
    def_shown(bound, "facets", &PackedLoads::facets);
    bound.def_readonly("length", &PackedLoads::length);
    bound.def("without_miss", &without_miss);
    bound.def(py::pickle(&state_of, &of_state));
}

} // namespace

} // namespace pushplan::mechanics

namespace pushplan {

void bind_uncertain(py::module_ &core) {
    using namespace mechanics;
    py::module_ m = core.def_submodule("uncertain", "The least of the contact conditions over uncertain loads.");
    bind_packed_loads(m);
    m.def("margins_of", &least_margins_of, py::arg("packed"), py::arg("twists"), py::arg("floor"));
    m.def("contact_margins_of", &least_contact_margins_of, py::arg("packed"), py::arg("twists"));
    m.def("rows_of", &rows_of, py::arg("packed"), py::arg("twists"));
    m.def("sloped_rows_of", &sloped_rows_of, py::arg("packed"), py::arg("twists"));
    m.def("forces_of", &forces_of, py::arg("packed"), py::arg("twists"));
    m.def("inertia_forces_of", &inertia_forces_of, py::arg("packed"), py::arg("masses"), py::arg("known"),
          py::arg("pulls"));
    m.def("inertia_rows_of", &inertia_rows_of, py::arg("packed"), py::arg("masses"), py::arg("known"),
          py::arg("pulls"));
    m.def("worst_spreads", &worst_spreads, py::arg("packed"), py::arg("twist"), py::arg("k"), py::arg("j"));
}

} // namespace pushplan
