// `pushplan.core.boundary`: the boundary of stable sets on and between meridians.
#include "arrays.hpp"
#include "boundary.hpp"

#include <optional>
#include <tuple>

namespace pushplan::boundary {

namespace {

// A `meridians.Table`: longitudes (m,), counts (m,), ends (m, c, 2), bends (m, c, 2).
using TableArrays = std::tuple<Numbers, Integers, Numbers, Numbers>;

// Gaps (g,): meridians to the left and to the right, and longitudes between.
using GapArrays = std::tuple<Integers, Integers, Numbers>;

MeridianTable meridian_table(const TableArrays &arrays) {
    const auto &[at, counts, ends, bend] = arrays;
    require_shape(at, {-1}, "at");
    const std::ptrdiff_t m = at.shape(0);
    require_shape(counts, {m}, "counts");
    require_shape(ends, {m, -1, 2}, "ends");
    require_shape(bend, {m, ends.shape(1), 2}, "bend");
    const MeridianTable table{row(at), row(counts), ends.data(), bend.data(), ends.shape(1)};
    for (const std::int64_t count : table.counts)
        if (count < 0 || count > table.width)
            throw std::invalid_argument("a meridian has more intervals than the table can hold");
    return table;
}

Gaps gaps_in(const MeridianTable &table, const GapArrays &arrays) {
    const Gaps gaps{row(std::get<0>(arrays)), row(std::get<1>(arrays)), row(std::get<2>(arrays))};
    if (gaps.right.size != gaps.left.size || gaps.middle.size != gaps.left.size)
        throw std::invalid_argument("the numbers of meridians on both sides of gaps differ");
    for (std::ptrdiff_t g = 0; g < gaps.size(); ++g)
        if (std::min(gaps[g].left, gaps[g].right) < 0 || std::max(gaps[g].left, gaps[g].right) >= table.at.size)
            throw std::out_of_range("gap " + std::to_string(g) + " is not between meridians of the table");
    return gaps;
}

Row<const std::int64_t> chosen_of(const Gaps &gaps, const Integers &chosen) {
    const auto found = row(chosen);
    for (const std::int64_t g : found)
        if (g < 0 || g >= gaps.size())
            throw std::out_of_range("there is no gap " + std::to_string(g));
    return found;
}

auto arrays_of(Questions &&questions) {
    return std::make_tuple(to_numpy(std::move(questions.member)), to_numpy(std::move(questions.x)));
}

auto arrays_of(Intervals &&intervals) {
    static_assert(sizeof(Ends) == 8 * sizeof(double), "brackets (2, 4)");
    const auto n = static_cast<std::ptrdiff_t>(intervals.member.size());
    auto ends = new_array<double>({n, 2, 4});
    std::copy_n(reinterpret_cast<const double *>(intervals.ends.data()), 8 * n, ends.data());
    return std::make_tuple(to_numpy(std::move(intervals.member)), ends);
}

auto bends_of(const TableArrays &arrays, const GapArrays &between, const TableArrays &middle) {
    const MeridianTable table = meridian_table(arrays), found = meridian_table(middle);
    const Gaps gaps = gaps_in(table, between);
    if (found.at.size != gaps.size())
        throw std::invalid_argument("there must be one meridian for every gap");
    Bends known = bends(table, gaps, found);
    auto more = new_array<bool>({gaps.size()});
    std::copy(known.more.begin(), known.more.end(), more.data());
    return std::make_tuple(to_numpy(std::move(known.bend), {gaps.size(), found.width, 2}), more);
}

template <class Search> void take(Search &search, const Numbers &values) {
    require_shape(values, {static_cast<std::ptrdiff_t>(search.questions().x.size())}, "table of values");
    search.take(values.data());
}

template <class Search> void bind_questions(nb::class_<Search> &bound) {
    bound.def_prop_ro("member", [](const Search &search) { return copied(search.questions().member); });
    bound.def_prop_ro("x", [](const Search &search) { return copied(search.questions().x); });
    bound.def("take", &take<Search>, nb::arg("values"));
    bound.def("__bool__", [](const Search &search) { return !search.questions().x.empty(); });
}

void bind_root_search(nb::module_ &m) {
    nb::class_<RootSearch> bound(m, "RootSearch", R"(
    Search for the last points with f > 0 between the inside (f > 0) and the outside (f <= 0).

    It uses the ITP method (Oliveira & Takahashi 2020): superlinear on smooth functions, and at most a few steps slower
    than bisection, even at jumps.

    Args:
        brackets: (m, 4) places inside and outside, and the values at them.

    Attributes:
        ends: (m,) outermost places known to be inside.
    )");
    bound.def(MadeBy(+[](const Numbers &brackets) {
                  require_shape(brackets, {-1, 4}, "brackets");
                  static_assert(sizeof(Bracket) == 4 * sizeof(double), "a row of a table");
                  const auto *first = reinterpret_cast<const Bracket *>(brackets.data());
                  return RootSearch(std::vector<Bracket>(first, first + brackets.shape(0)));
              }),
              nb::arg("brackets"));
    bind_questions(bound);
    bound.def_prop_ro("ends", [](const RootSearch &search) {
        std::vector<double> ends(search.count());
        for (std::size_t i = 0; i < ends.size(); ++i)
            ends[i] = search.end(i);
        return to_numpy(std::move(ends));
    });
}

PeakSearch peak_search(const Numbers &low, const Numbers &high, double goal, int iterations,
                       const std::optional<std::tuple<Numbers, Numbers>> &ends) {
    const auto begin = row(low), end = row(high);
    if (begin.size != end.size)
        throw std::invalid_argument("the numbers of lower and upper ends differ");
    require_count(iterations, "iterations");
    PeakSearch search({begin.begin(), begin.end()}, {end.begin(), end.end()}, goal, iterations);
    if (ends) {
        const auto at_low = row(std::get<0>(*ends)), at_high = row(std::get<1>(*ends));
        if (at_low.size != begin.size || at_high.size != begin.size)
            throw std::invalid_argument("the numbers of ends and of their values differ");
        search.know_ends({at_low.begin(), at_low.end()}, {at_high.begin(), at_high.end()});
    }
    return search;
}

void bind_peak_search(nb::module_ &m) {
    nb::class_<PeakSearch> bound(m, "PeakSearch", R"(
    Golden-section searches of maxima; each stops once above `goal`.

    Args:
        low: (m,) lower ends.
        high: (m,) upper ends.
        goal: Value at which a search stops.
        iterations: Maximum number of values after the first two.
        ends: (m,) values at `low` and `high`. With them, a search is given up if 4 times the largest possible rise of a
            concave function would not reach the goal.

    Attributes:
        best: Best places and their values, (m,) each.
    )");
    bound.def(MadeBy(&peak_search), nb::arg("low"), nb::arg("high"), nb::arg("goal"), nb::arg("iterations"),
              nb::arg("ends") = nb::none());
    bind_questions(bound);
    bound.def_prop_ro("best", [](const PeakSearch &search) {
        std::vector<double> places, values;
        for (const Section &section : search.sections()) {
            places.push_back(section.fb >= section.fc ? section.b : section.c);
            values.push_back(section.fb >= section.fc ? section.fb : section.fc);
        }
        return std::make_tuple(to_numpy(std::move(places)), to_numpy(std::move(values)));
    });
}

void bind_functions(nb::module_ &m) {
    m.def(
        "fans",
        [](const TableArrays &arrays, const GapArrays &between, const Integers &chosen) {
            const MeridianTable table = meridian_table(arrays);
            const Gaps gaps = gaps_in(table, between);
            return arrays_of(fans(table, gaps, chosen_of(gaps, chosen)));
        },
        nb::arg("table"), nb::arg("gaps"), nb::arg("chosen"), R"(
    Return gaps (k,) and latitudes (k,) around the intervals on both sides of chosen gaps, and the poles.

    A fan widens with the distance in longitude, because intervals can slope. Wide gaps get more latitudes.
    )");
    m.def(
        "probes",
        [](const TableArrays &arrays, const GapArrays &between, const Integers &chosen, double wider) {
            const MeridianTable table = meridian_table(arrays);
            const Gaps gaps = gaps_in(table, between);
            return arrays_of(probes(table, gaps, chosen_of(gaps, chosen), wider));
        },
        nb::arg("table"), nb::arg("gaps"), nb::arg("chosen"), nb::arg("wider"), R"(
    Return gaps (k,) and latitudes (k,) that test whether the intervals are as expected from both sides.

    For each interval: outside and inside its lower end, its middle, inside and outside its upper end. And one between
    two intervals.
    )");
    m.def(
        "followed",
        [](const Numbers &x, const Numbers &value, const Integers &member) {
            if (value.size() != x.size() || member.size() != x.size())
                throw std::invalid_argument("the numbers of latitudes, values and members differ");
            return arrays_of(followed(row(x), row(value), row(member)));
        },
        nb::arg("x"), nb::arg("value"), nb::arg("member"), R"(
    Return the members (c,) of the intervals that are as expected, and brackets (c, 2, 4) of their ends.

    Args:
        x: (k,) latitudes; see `probes`.
        value: (k,) excess at these latitudes.
        member: (k,) interval of each latitude.
    )");
    m.def(
        "bends", &bends_of, nb::arg("table"), nb::arg("gaps"), nb::arg("found"),
        "Return the bends (g, c, 2) of meridians found in gaps, and (g,) whether the boundary is not yet flat there.");
}

} // namespace

} // namespace pushplan::boundary

namespace pushplan {

void bind_boundary(nb::module_ &core) {
    using namespace boundary;
    nb::module_ m = core.def_submodule(
        "boundary",
        "The boundary of stable sets on and between meridians: brackets of ends, and latitudes to evaluate.");
    m.attr("TOLERANCE") = TOLERANCE;
    m.attr("FLATNESS") = FLATNESS;
    bind_root_search(m);
    bind_peak_search(m);
    bind_functions(m);
}

} // namespace pushplan
