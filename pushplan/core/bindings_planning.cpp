// One translation unit for several bindings: what nanobind makes of its templates is compiled once for all of them, which
// takes two thirds of the time.
#include "collision.cpp"
#include "search_module.cpp"
#include "problem_module.cpp"
#include "infeasible.cpp"
#include "improve.cpp"
#include "timing.cpp"
#include "driving.cpp"
#include "transit.cpp"
#include "module.cpp"
