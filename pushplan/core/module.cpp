// The compiled core as Python sees it: `pushplan.core`, with a submodule for each kind of work.
//
// Numbers only cross over: no Python object is called from here, and no state outlives a call but that of the objects
// that callers hold. A submodule NAME is bound in NAME.cpp and described in NAME.pyi.
#include "numpy.hpp"

namespace pushplan {
void bind_boundary(py::module_ &);
void bind_collision(py::module_ &);
void bind_contacts(py::module_ &);
void bind_driving(py::module_ &);
void bind_improve(py::module_ &);
void bind_infeasible(py::module_ &);
void bind_problem(py::module_ &);
void bind_pushes(py::module_ &);
void bind_robustness(py::module_ &);
void bind_samples(py::module_ &);
void bind_search(py::module_ &);
void bind_sequences(py::module_ &);
void bind_slip(py::module_ &);
void bind_sphere(py::module_ &);
void bind_timing(py::module_ &);
void bind_transit(py::module_ &);
void bind_uncertain(py::module_ &);

extern const char *const SOURCES; // in sources.cpp, which alone is compiled anew with every change
} // namespace pushplan

PYBIND11_MODULE(core, m) {
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
