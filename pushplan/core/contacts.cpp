// Contacts of chains with known loads: the transmitted wrenches, and their margins against slip.
#include "inertia.hpp"
#include "packed.hpp"

#include <algorithm>
#include <tuple>

namespace pushplan::mechanics {

namespace {

double size_of(const Twist &twist, double length) {
    return std::max(std::max(std::abs(twist.vx), std::abs(twist.vy)), std::abs(twist.omega) * length);
}

Twist scaled(const Twist &twist, double size) { return {twist.vx / size, twist.vy / size, twist.omega / size}; }

// Add object k's wrench to that of its contact, which is then complete, and this to the contact of its pusher.
void load(Wrench *carried, std::ptrdiff_t k, std::int64_t pusher, const Wrench &wrench) {
    Wrench &own = carried[k];
    own.x += wrench.x, own.y += wrench.y, own.m += wrench.m;
    if (pusher >= 0)
        carried[pusher].x += own.x, carried[pusher].y += own.y, carried[pusher].m += own.m;
}

// Compute the wrench that each contact transmits. Only the direction of the twist matters; the zero twist gives 0.
void contact_wrenches(const PackedChain &packed, const Twist &twist, Wrench *carried) {
    const std::ptrdiff_t n = packed.count();
    std::fill(carried, carried + n, Wrench{0.0, 0.0, 0.0});
    const double size = size_of(twist, packed.length);
    if (!(size > 0.0))
        return;
    const Supports supports = packed.supports();
    const Twist direction = scaled(twist, size);
    for (std::ptrdiff_t k = n - 1; k >= 0; --k)
        load(carried, k, packed.pusher(k), carried_wrench(supports, k, direction));
}

// Return the margin of a contact for a transmitted wrench: the sine of the angle to the nearest facet; 0 for no wrench.
// The moment is divided by the length.
double wrench_margin(const Facets &facets, const Wrench &wrench) {
    const double size = length_of(wrench);
    if (size == 0.0)
        return 0.0;
    double lowest = INF;
    for (const Facet &g : facets)
        lowest = std::min(lowest, dot(g, wrench));
    return lowest / size;
}

// Return the smallest margin over the contacts, > 0 exactly if the twist keeps all of them. As soon as a contact's
// margin is at most `floor`, return it. `carried` (n,) is overwritten.
double least_margin(const PackedChain &packed, const Twist &twist, double floor, std::vector<Wrench> &carried) {
    const double size = size_of(twist, packed.length);
    if (!(size > 0.0))
        return 0.0;
    const Supports supports = packed.supports();
    const Twist direction = scaled(twist, size);
    std::fill(carried.begin(), carried.end(), Wrench{0.0, 0.0, 0.0});
    double lowest = 1.0;
    for (std::ptrdiff_t k = packed.count() - 1; k >= 0; --k) {
        load(carried.data(), k, packed.pusher(k), carried_wrench(supports, k, direction));
        const Wrench &w = carried[k];
        lowest = std::min(lowest, wrench_margin(packed.facets(k), {w.x, w.y, w.m / packed.length}));
        if (lowest <= floor)
            break;
    }
    return lowest;
}

Made<double> margins_of(const PackedChain &packed, const Numbers &twists, double floor) {
    packed.require_contacts();
    const auto rows = twist_table(twists);
    auto out = new_array<double>({rows.rows});
    double *margins = out.data();
    nb::gil_scoped_release free;
    std::vector<Wrench> carried(packed.count());
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i)
        margins[i] = least_margin(packed, twist_at(rows[i]), floor, carried);
    return out;
}

Made<double> wrenches_of(const PackedChain &packed, const Numbers &twists) {
    const auto rows = twist_table(twists);
    const std::ptrdiff_t n = packed.count();
    auto out = new_array<double>({rows.rows, n, 3});
    auto *wrenches = reinterpret_cast<Wrench *>(out.data());
    nb::gil_scoped_release free;
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i)
        contact_wrenches(packed, twist_at(rows[i]), wrenches + i * n);
    return out;
}

Made<double> contact_margins_of(const PackedChain &packed, const Numbers &wrenches) {
    packed.require_contacts();
    const std::ptrdiff_t n = packed.count();
    require_shape(wrenches, {-1, n, 3}, "wrenches");
    const std::ptrdiff_t count = wrenches.shape(0);
    auto out = new_array<double>({count, n});
    double *margins = out.data();
    const double *numbers = wrenches.data();
    nb::gil_scoped_release free;
    for (std::ptrdiff_t k = 0; k < n; ++k) {
        const Facets facets = packed.facets(k);
        for (std::ptrdiff_t i = 0; i < count; ++i) {
            const Wrench w = read<Wrench>(numbers + 3 * (i * n + k));
            margins[i * n + k] = wrench_margin(facets, {w.x, w.y, w.m / packed.length});
        }
    }
    return out;
}

auto facet_rows(const Numbers &facets, const Numbers &wrenches, double length) {
    require_shape(facets, {-1, 4, 3}, "facets");
    const std::ptrdiff_t n = facets.shape(0);
    require_shape(wrenches, {-1, n, 3}, "wrenches");
    const std::ptrdiff_t count = wrenches.shape(0);
    auto rows = new_array<double>({count, n, 4}), size = new_array<double>({count, n});
    double *row = rows.data(), *sizes = size.data();
    const double *cones = facets.data(), *numbers = wrenches.data();
    {
        nb::gil_scoped_release free;
        for (std::ptrdiff_t i = 0; i < count * n; ++i) {
            Wrench w = read<Wrench>(numbers + 3 * i);
            w.m = w.m / length;
            sizes[i] = length_of(w);
            for (const Facet &g : read<Facets>(cones + FACET_NUMBERS * (i % n)))
                *row++ = dot(g, w);
        }
    }
    return std::make_tuple(rows, size);
}

Made<double> moved_wrenches_of(const PackedChain &packed, const Numbers &twists, const Numbers &moves) {
    const auto rows = twist_table(twists);
    const std::ptrdiff_t n = packed.count();
    require_shape(moves, {rows.rows, n, 2}, "moves");
    auto out = new_array<double>({rows.rows, n, 3});
    auto *wrench = reinterpret_cast<Wrench *>(out.data());
    const double *move = moves.data();
    nb::gil_scoped_release free;
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i) {
        const Twist twist = twist_at(rows[i]);
        const Twist direction = scaled(twist, size_of(twist, packed.length));
        for (std::ptrdiff_t k = 0; k < n; ++k, ++wrench, move += 2)
            *wrench = moved_wrench(packed.supports(), k, direction, move[0], move[1]);
    }
    return out;
}

Made<double> object_wrenches_of(const PackedChain &packed, const Numbers &twists) {
    const auto rows = twist_table(twists);
    auto out = new_array<double>({rows.rows, 3});
    auto *wrenches = reinterpret_cast<Wrench *>(out.data());
    nb::gil_scoped_release free;
    for (std::ptrdiff_t i = 0; i < rows.rows; ++i) {
        const Twist twist = twist_at(rows[i]);
        wrenches[i] = carried_wrench(packed.supports(), 0, scaled(twist, size_of(twist, packed.length)));
    }
    return out;
}

// Masses (n,), centres (n, 2) and moments of inertia (n,).
using InertiaTable = std::tuple<Numbers, Numbers, Numbers>;

Made<double> inertia_per_object(const InertiaTable &inertia, const Numbers &twists, const Numbers &rates) {
    const auto &[masses, centers, moments] = inertia;
    const auto mass = row(masses), moment = row(moments);
    const auto center = table(centers), twist = twist_table(twists), rate = twist_table(rates);
    const std::ptrdiff_t n = mass.size;
    if (moment.size != n || center.rows != n || center.columns != 2 || rate.rows != twist.rows)
        throw std::invalid_argument("the numbers of masses, centres and moments, or of twists and rates, differ");
    auto out = new_array<double>({twist.rows, n, 3});
    double *wrench = out.data();
    nb::gil_scoped_release free;
    for (std::ptrdiff_t i = 0; i < twist.rows; ++i) {
        const Twist v = twist_at(twist[i]), dv = twist_at(rate[i]);
        for (std::ptrdiff_t k = 0; k < n; ++k, wrench += 3) {
            const double x = center[k][0], y = center[k][1];
            const auto [fx, fy] = inertia_force(mass[k], x, y, v, dv);
            wrench[0] = fx, wrench[1] = fy, wrench[2] = moment[k] * dv.omega + x * fy - y * fx;
        }
    }
    return out;
}

using Series = Kept<std::complex<double>>::Array;

PackedChain packed_chain(const Numbers &objects, const Numbers &parts, const Series &series, const Integers &links,
                         const Numbers &rows, double length) {
    PackedChain packed{{objects, {-1, OBJECT_COLUMNS}, "objects"},
                       {parts, {-1, PART_COLUMNS}, "parts"},
                       {series, {WEIGHTS * objects.shape(0), TERMS}, "series"},
                       {links, {objects.shape(0), LINK_COLUMNS}, "links"},
                       {rows, {-1, 4, 3}, "rows"},
                       length};
    packed.check();
    return packed;
}

void bind_packed_chain(nb::module_ &m) {
    nb::class_<PackedChain> bound(m, "PackedChain", R"(
    Objects and contacts in the chain frame.

    Attributes:
        objects: (n, 11) friction load mu N (N), anchor x, y, radius (m), density a and gradient b (2) of the base
            pressure of a unit weight, h mu (m), stiffness moments S_xx, S_xy, S_yy. The anchor is the centroid of a
            polygon, the stiffness centre of points.
        parts: (e, 5) polygon edges about the anchor: t_x, t_y, n . p, t . p and length, with the first vertex p; or
            points about the anchor: x, y, fraction of the weight, stiffness, 0.
        series: (5 n, TERMS) power series of the polygons (see `packed.series_coefficients`); zero for points.
        links: (n, 4) kind, first part, one past the last part, pushing object (an earlier one) or -1.
        rows: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0; (0, 4, 3) without contacts.
        length: Characteristic length of the chain, m.

    Raises:
        ValueError: If the arrays do not fit together.
    )");
    bound.def(MadeBy(&packed_chain), nb::kw_only(), nb::arg("objects"), nb::arg("parts"), nb::arg("series"),
              nb::arg("links"), nb::arg("rows"), nb::arg("length"));
    def_shown(bound, "objects", &PackedChain::objects);
    def_shown(bound, "parts", &PackedChain::parts);
    def_shown(bound, "series", &PackedChain::series);
    def_shown(bound, "links", &PackedChain::links);
    def_shown(bound, "rows", &PackedChain::rows);
    bound.def_ro("length", &PackedChain::length);
    bound.def(PickledBy{"objects", "parts", "series", "links", "rows", "length"});
}

} // namespace

} // namespace pushplan::mechanics

namespace pushplan {

void bind_contacts(nb::module_ &core) {
    using namespace mechanics;
    nb::module_ m = core.def_submodule("contacts", "Contacts of chains with known loads: floor friction, "
                                        "transmitted wrenches and margins against slip.");
    bind_packed_chain(m);
    m.attr("ORDER") = ORDER;
    m.attr("REACH") = REACH;
    m.attr("TERMS") = TERMS;
    m.attr("UNIFORM") = UNIFORM;
    m.attr("AFFINE") = AFFINE;
    m.attr("POINTS") = POINTS;
    m.def("margins_of", &margins_of, nb::arg("packed"), nb::arg("twists"), nb::arg("floor") = -2.0, R"(
    Return the smallest margin (k,) over the contacts at many body twists (k, 3) in the chain frame.

    The margin is in [-1, 1]. It is > 0 exactly if the twist keeps all contacts, and 0 at the zero twist. As soon as a
    contact's margin is at most `floor`, it is returned.
    )");
    m.def("wrenches_of", &wrenches_of, nb::arg("packed"), nb::arg("twists"), R"(
    Return the wrenches (k, n, 3) that contacts transmit at many twists (k, 3): f_x, f_y (N), moment (N m) about 0.

    Only a twist's direction matters; the zero twist gives zero wrenches.
    )");
    m.def("contact_margins_of", &contact_margins_of, nb::arg("packed"), nb::arg("wrenches"),
          "Return the margins (k, n) of transmitted wrenches (k, n, 3), in [-1, 1]; 0 for no wrench.");
    m.def("facet_rows", &facet_rows, nb::arg("facets"), nb::arg("wrenches"), nb::arg("length"), R"(
    Return the rows g . w (k, n, 4) of facets (n, 4, 3) and wrenches (k, n, 3), and the wrenches' sizes (k, n).

    Moments are divided by `length`, m.
    )");
    m.def("object_wrenches_of", &object_wrenches_of, nb::arg("packed"), nb::arg("twists"),
          "Return the wrenches (k, 3) that move the first object at many twists (k, 3), none of them zero.");
    m.def("moved_wrenches_of", &moved_wrenches_of, nb::arg("packed"), nb::arg("twists"), nb::arg("moves"), R"(
    Return the change of each object's wrench (m, n, 3) if the centre of its load moves by (m, n, 2), m.

    Args:
        packed: The objects.
        twists: (m, 3) body twists of sliding, none of them 0.
        moves: (m, n, 2) moves in the chain frame, in addition to the shift by the object's own friction.
    )");
    m.def("inertia_per_object", &inertia_per_object, nb::arg("table"), nb::arg("twists"), nb::arg("rates"), R"(
    Return the wrench (m, n, 3) that each object's inertia needs, about the chain frame's origin.

    By Newton and Euler (m a(c), I domega/dt + c x m a(c)) with the acceleration of the centre of mass

        a(c) = dv/dt + domega/dt J c + omega J (v + omega J c).

    Args:
        table: An `InertiaTable`: masses (n,), centres (n, 2), moments of inertia (n,).
        twists: (m, 3) body twists V in the chain frame.
        rates: (m, 3) their time derivatives dV/dt.
    )");
}

} // namespace pushplan
