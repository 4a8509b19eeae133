// Quasi-static pushing in which contacts stick, slide, roll off an end, open and close again.
#pragma once

#include "slip_work.hpp"

#include <memory>

namespace pushplan::slip {

// What a contact does: nothing; both ends hold; both touch and slide; one end holds; one touches and slides.
enum Mode { OPEN = 0, STICK = 1, SLIDE = 2, ROLL = 3, ROLL_SLIDE = 4 };

// How a step ended: by Newton's method; with the fallback's help; no motion was found that balances all forces; no
// motion satisfies all contacts; more manifolds than there is room for; the plate would have to push with more force than
// it has. After the last four nothing has moved.
enum End { CONVERGED = 0, FALLBACK = 1, UNSOLVED = 2, JAMMED = 3, CROWDED = 4, STALLED = 5 };

// The multipliers of a pair of pieces in the last step; no points where the pair did not touch.
struct Memory {
    std::array<double, 3> force{};
    int points = 0;
};

// Where everything is, and the last step's solution, with which the next one begins.
struct State {
    std::vector<Pose> poses;                  // of the objects and, last, of the plate, in the world
    std::vector<Vector> twists;               // U over the plate's size of step, in the plate's axes
    std::vector<std::array<double, 2>> drag;  // with which objects drag over the floor, in their own axes, N
    std::vector<Memory> memory;               // of every pair
    std::int64_t steps = 0;                   // since the beginning
};

// How a step was solved: what is left of the balance (N), and how it ended.
struct Solution {
    double residual;
    End end;

    bool failed() const { return end >= UNSOLVED; }
};

// What steps leave behind, one after the other; columns are the caller's objects.
struct Trace {
    std::vector<double> poses;        // (m, n, 3) of the objects after every step
    std::vector<std::int64_t> modes;  // (m, n) of the chain's contacts
    std::vector<double> forces;       // (m, n, 3) of them: normal at the right and the left end, tangential, N
    std::vector<double> wrenches;     // (m, 3) with which the plate pushes on all that it touches, in its frame
    std::vector<std::int64_t> others; // (m, n) other active contacts of every object
    std::vector<double> residual;     // (m,) over the sum of mu N of all objects
    std::vector<std::int64_t> end;    // (m,)
};

struct Simulation {
    Simulation(std::shared_ptr<World> world, State state);

    // Poses of the objects are in the caller's order; they have not moved yet.
    Simulation(std::shared_ptr<World> world, const std::vector<Pose> &objects, const Pose &plate);

    // Move the plate by body twists times time (m, 3), one after the other, with a force (N) up to a limit; the step
    // that fails is the last one.
    Trace march(Table<const double> twists, double limit);

    // Move the plate by a body twist times time and the objects with it; forces and modes stay in `work`.
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

    std::vector<Pose> poses; // for which the contacts are looked up
};

} // namespace pushplan::slip
