// nanobind's own functions, compiled along with the core: it comes as source.
//
// It reads Python's objects as other types than they were written as, which optimizers take for impossible.
#pragma GCC optimize("Os", "no-strict-aliasing")
#include <nb_combined.cpp>
