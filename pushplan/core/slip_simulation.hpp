// Quasi-static pushing in which contacts stick, slide, roll off an end, open and close again.
#pragma once

#include "slip_work.hpp"

#include <memory>

namespace pushplan::slip {

// Mode of a contact: open; both ends stick; both ends slide; one end sticks; one end slides.
enum Mode { OPEN = 0, STICK = 1, SLIDE = 2, ROLL = 3, ROLL_SLIDE = 4 };

// Outcome of a step: solved by Newton's method; solved with the fallback; no motion found that balances all forces; no
// motion satisfies all contacts; too many manifolds; the plate would need more force than it has. After the last four,
// nothing has moved.
enum End { CONVERGED = 0, FALLBACK = 1, UNSOLVED = 2, JAMMED = 3, CROWDED = 4, STALLED = 5 };

// The multipliers of a pair of pieces in the last step; without points if the pair did not touch.
struct Memory {
    std::array<double, 3> force{};
    int points = 0;
};

// The poses of all bodies, and the last step's solution, with which the next step begins.
struct State {
    std::vector<Pose> poses;                  // world poses of the objects and, last, of the plate
    std::vector<Vector> twists;               // U divided by the size of the plate's step, in the plate's axes
    std::vector<std::array<double, 2>> drag;  // friction forces of the objects, in their own axes, N
    std::vector<Memory> memory;               // by pair
    std::int64_t steps = 0;                   // number of steps since the beginning
};

// Result of a step: residual of the balance (N), and outcome.
struct Solution {
    double residual;
    End end;

    bool failed() const { return end >= UNSOLVED; }
};

// The record of a sequence of steps. Columns are the caller's objects.
struct Trace {
    std::vector<double> poses;        // (m, n, 3) after every step
    std::vector<std::int64_t> modes;  // (m, n) of the chain's contacts
    std::vector<double> forces;       // (m, n, 3) normal at the right and left end, tangential, N
    std::vector<double> wrenches;     // (m, 3) of the plate on all touched bodies, in its frame
    std::vector<std::int64_t> others; // (m, n) other active contacts of every object
    std::vector<double> residual;     // (m,) divided by the sum of mu N of all objects
    std::vector<std::int64_t> end;    // (m,)
};

struct Simulation {
    Simulation(std::shared_ptr<World> world, State state);

    // Poses of the objects before any motion, in the caller's order.
    Simulation(std::shared_ptr<World> world, const std::vector<Pose> &objects, const Pose &plate);

    // Move the plate by a sequence of body twists times time (m, 3), with a force (N) up to a limit. A failed step is
    // the last one.
    Trace march(Table<const double> twists, double limit);

    // Move the plate by a body twist times time, and the objects with it. Forces and modes stay in `work`.
    Solution step(const Twist &twist, double limit);

    mutable Lock lock;
    std::shared_ptr<World> world;
    State state;
    Work work;

  private:
    void place();
    void place_feet(int i);
    void command(const Twist &twist);
    void predict(double size, bool rigid);
    void begin_drag(const Scale &scale);
    void keep_drag();
    void keep_motion(double size);
    void keep_forces();
    void recall_forces(bool fresh, double force);
    bool all_stick() const;
    Solution solve(const Scale &scale);
    Solution solve_here(const Scale &scale, double left);
    Solution solve_midway(const Scale &scale);
    void note_contacts(Trace &trace) const;
    void note_wrench(Trace &trace) const;
    Vector plate_wrench() const;

    std::vector<Pose> poses; // poses at which contacts are searched
};

} // namespace pushplan::slip
