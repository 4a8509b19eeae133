#include "sequences.hpp"

#include "numpy.hpp"

#include <algorithm>

namespace pushplan {
namespace {

// A number for each mode and node; the nodes of a mode are neighbours in memory.
template <class Number> struct ModesByNodes {
    std::vector<Number> numbers;
    std::ptrdiff_t nodes;

    ModesByNodes(std::ptrdiff_t modes, std::ptrdiff_t nodes, Number value)
        : numbers(static_cast<std::size_t>(modes * nodes), value), nodes(nodes) {}
    Number *operator[](std::ptrdiff_t mode) { return numbers.data() + mode * nodes; }
    const Number *operator[](std::ptrdiff_t mode) const { return numbers.data() + mode * nodes; }
    void fill(Number value) { std::fill(numbers.begin(), numbers.end(), value); }
};

// The sequences of one length more than those before.
struct Round {
    ModesByNodes<std::int64_t> came;   // by the mode of the last push and where it ends: where it began
    ModesByNodes<std::int64_t> before; // by the mode of the next push and where it begins: the mode of the one before
};

// A last push: its round, node and mode.
struct Last {
    double cost = INF;
    std::ptrdiff_t round = -1, node = -1, mode = -1;
};

// Add a push to the sequences that are `ready` for one, where they cost less than a whole plan does already: no cost is
// negative.
void add_push(const SequenceCosts &costs, const ModesByNodes<double> &ready, double below, ModesByNodes<double> &done,
              Round &round) {
    done.fill(INF);
    for (std::ptrdiff_t m = 0; m < costs.modes; ++m) {
        double *best = done[m];
        std::int64_t *came = round.came[m];
        for (std::ptrdiff_t u = 0; u < costs.nodes; ++u) {
            const double sofar = ready[m][u];
            if (!(sofar < below))
                continue;
            const double *push = costs.pushes_from(m, u);
            for (std::ptrdiff_t v = 0; v < costs.nodes; ++v) {
                const double cost = sofar + push[v];
                if (cost < best[v])
                    best[v] = cost, came[v] = u;
            }
        }
    }
}

// Add a change of the mode to the sequences that are `done`. At a goal the sequence ends; at the start (node 0) no
// contact has been made that could be changed.
void add_change(const SequenceCosts &costs, const ModesByNodes<double> &done, std::ptrdiff_t goals, double below,
                ModesByNodes<double> &ready, Round &next) {
    ready.fill(INF);
    for (std::ptrdiff_t v = goals + 1; v < costs.nodes; ++v) {
        for (std::ptrdiff_t m = 0; m < costs.modes; ++m) {
            if (!(done[m][v] < below))
                continue;
            const double *change = costs.changes_from(v, m);
            for (std::ptrdiff_t q = 0; q < costs.modes; ++q) {
                const double cost = done[m][v] + change[q];
                if (cost < ready[q][v])
                    ready[q][v] = cost, next.before[q][v] = m;
            }
        }
    }
}

} // namespace

Sequence cheapest_sequence(const SequenceCosts &costs, std::ptrdiff_t goals, std::ptrdiff_t most) {
    const std::ptrdiff_t modes = costs.modes, nodes = costs.nodes;
    ModesByNodes<double> ready(modes, nodes, INF), done(modes, nodes, INF);
    for (std::ptrdiff_t m = 0; m < modes; ++m)
        ready[m][0] = costs.first[m];
    const ModesByNodes<std::int64_t> none(modes, nodes, 0);
    std::vector<Round> rounds(static_cast<std::size_t>(most), {none, none});
    Last best;
    for (std::ptrdiff_t k = 0; k < most; ++k) {
        add_push(costs, ready, best.cost, done, rounds[k]);
        for (std::ptrdiff_t v = 1; v <= goals; ++v) {
            for (std::ptrdiff_t m = 0; m < modes; ++m) {
                if (done[m][v] < best.cost)
                    best = {done[m][v], k, v, m};
            }
        }
        if (k + 1 < most)
            add_change(costs, done, goals, best.cost, ready, rounds[k + 1]);
    }
    Sequence found{best.cost, std::vector<SequenceStep>(static_cast<std::size_t>(best.round + 1))};
    for (std::ptrdiff_t k = best.round, at = best.node, by = best.mode; k >= 0; --k) {
        const std::ptrdiff_t u = rounds[k].came[by][at];
        found.steps[k] = {by, u, at};
        at = u, by = rounds[k].before[by][u];
    }
    return found;
}

namespace {

SequenceCosts to_costs(const Numbers &pushes, const Numbers &changes, const Numbers &first) {
    bool fits = pushes.ndim() == 3 && changes.ndim() == 3 && first.ndim() == 1;
    if (fits) {
        const py::ssize_t modes = pushes.shape(0), nodes = pushes.shape(1);
        fits = pushes.shape(2) == nodes && changes.shape(0) == nodes && changes.shape(1) == modes &&
               changes.shape(2) == modes && first.shape(0) == modes;
    }
    if (!fits)
        throw std::invalid_argument("costs are (m, v, v) of pushes, (v, m, m) of changes and (m,) before a first push, "
                                    "for m modes and v nodes");
    return {pushes.shape(0), pushes.shape(1), pushes.data(), changes.data(), first.data()};
}

py::tuple cheapest_rows(const Numbers &pushes, const Numbers &changes, const Numbers &first, std::ptrdiff_t goals,
                        std::ptrdiff_t most) {
    const SequenceCosts costs = to_costs(pushes, changes, first);
    if (goals < 1 || goals >= costs.nodes || most < 1)
        throw std::invalid_argument("there are a start, one goal or more among the nodes, and one push or more");
    Sequence found;
    {
        py::gil_scoped_release free;
        found = cheapest_sequence(costs, goals, most);
    }
    std::vector<std::int64_t> rows;
    for (const SequenceStep &step : found.steps)
        rows.insert(rows.end(), {step.mode, step.first, step.last});
    const auto count = static_cast<py::ssize_t>(found.steps.size());
    return py::make_tuple(found.cost, to_numpy(std::move(rows), {count, 3}));
}

} // namespace

void bind_sequences(py::module_ &core) {
    auto m = core.def_submodule("sequences");
    m.def("cheapest_sequence", &cheapest_rows, py::arg("pushes"), py::arg("changes"), py::arg("first"),
          py::arg("goals"), py::arg("most"));
}

} // namespace pushplan
