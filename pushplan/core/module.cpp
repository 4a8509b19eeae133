// The Python module of the compiled core: `pushplan.core`, with a submodule for each kind of work.
//
// Only numbers are exchanged. The core calls no Python object, and the only state between calls is in objects that
// callers hold. Stubs are generated from these bindings and their docstrings.
#include "numpy.hpp"

namespace pushplan {
void bind_boundary(nb::module_ &);
void bind_collision(nb::module_ &);
void bind_contacts(nb::module_ &);
void bind_driving(nb::module_ &);
void bind_improve(nb::module_ &);
void bind_infeasible(nb::module_ &);
void bind_problem(nb::module_ &);
void bind_pushes(nb::module_ &);
void bind_robustness(nb::module_ &);
void bind_samples(nb::module_ &);
void bind_search(nb::module_ &);
void bind_sequences(nb::module_ &);
void bind_slip(nb::module_ &);
void bind_sphere(nb::module_ &);
void bind_timing(nb::module_ &);
void bind_transit(nb::module_ &);
void bind_uncertain(nb::module_ &);

extern const char *const SOURCES; // digest of the sources, defined by `building.py`
} // namespace pushplan

NB_MODULE(core, m) {
    nanobind::set_leak_warnings(false); // objects that live until the process ends are no leak
    m.attr("__doc__") = "Compiled inner loops: collision, steering, search, timing, mechanics, driving, slip.";
    m.attr("SOURCES") = pushplan::SOURCES;
    pushplan::bind_boundary(m);
    pushplan::bind_collision(m);
    pushplan::bind_contacts(m);
    pushplan::bind_driving(m);
    pushplan::bind_improve(m);
    pushplan::bind_infeasible(m);
    pushplan::bind_problem(m);
    pushplan::bind_pushes(m);
    pushplan::bind_robustness(m);
    pushplan::bind_samples(m);
    pushplan::bind_search(m);
    pushplan::bind_sequences(m);
    pushplan::bind_slip(m);
    pushplan::bind_sphere(m);
    pushplan::bind_timing(m);
    pushplan::bind_transit(m);
    pushplan::bind_uncertain(m);
}
