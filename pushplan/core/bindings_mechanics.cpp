// One translation unit for several bindings: what nanobind makes of its templates is compiled once for all of them, which
// takes two thirds of the time.
#include "pushes.cpp"
#include "samples.cpp"
#include "sequences.cpp"
#include "slip.cpp"
#include "boundary_module.cpp"
#include "contacts.cpp"
#include "robustness.cpp"
#include "sphere.cpp"
#include "uncertain.cpp"
#include "uncertain_module.cpp"
