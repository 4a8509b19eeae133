// One step of a world: the plate moves by a given twist, and balance and contacts determine the objects' motions.
//
// If everything sticks, it moves exactly as one body with the plate. If anything slides or opens, motions are
// recomputed at the middle of the step and applied from its start: the midpoint rule, of second order in the step.
#include "slip_simulation.hpp"

namespace pushplan::slip {

static State at_rest(const World &world, const std::vector<Pose> &objects, const Pose &plate) {
    State state;
    for (const int own : world.order)
        state.poses.push_back(objects[own]);
    state.poses.push_back(plate);
    state.twists.resize(world.objects.size());
    state.drag.resize(world.objects.size());
    state.memory.resize(world.pairs.size());
    return state;
}

Simulation::Simulation(std::shared_ptr<World> known, State begun)
    : world(std::move(known)), state(std::move(begun)), work(*world), poses(state.poses) {}

Simulation::Simulation(std::shared_ptr<World> known, const std::vector<Pose> &objects, const Pose &plate)
    : Simulation(known, at_rest(*known, objects, plate)) {}

// Return a pose moved by the exact exponential of a share of a twist about the reference point.
static Pose moved(const Pose &pose, const Pose &reference, const Vector &u, double share, double length) {
    const double turn = share * u.w / length, half = 0.5 * turn;
    // The remainder of the series, half^4 / 120, is below 1e-18 here.
    const double sinc = share * (std::abs(half) < 1e-4 ? 1.0 - half * half / 6.0 : std::sin(half) / half);
    const double c = std::cos(turn), s = std::sin(turn);
    const double vx = sinc * (std::cos(half) * u.x - std::sin(half) * u.y);
    const double vy = sinc * (std::sin(half) * u.x + std::cos(half) * u.y);
    const double dx = pose.x - reference.x, dy = pose.y - reference.y;
    return {reference.x + c * dx - s * dy + vx, reference.y + s * dx + c * dy + vy, pose.theta + turn};
}

Solution Simulation::step(const Twist &twist, double limit) {
    // Displacement of the plate, including its turn as a length. eps, reach and gaps are shares of it, so that a push
    // is the same for steps of any size.
    const double turn = world->length * twist.omega;
    const Scale scale{std::sqrt(twist.vx * twist.vx + twist.vy * twist.vy + turn * turn), world->friction()};
    work.manifolds.clear();
    if (!(scale.size > 0.0))
        return {0.0, CONVERGED};
    poses = state.poses;
    place();
    command(twist);
    if (state.steps == 0)
        begin_drag(scale);
    predict(scale.size, state.steps == 0);
    Solution solution = solve_here(scale, 1.0);
    if (solution.failed())
        return solution;
    keep_forces();
    // One rigid body moves exactly by the exponential of its twist. The midpoint rule only helps if something slides or
    // opens.
    if (!all_stick()) {
        solution = solve_midway(scale);
        if (solution.failed())
            return solution;
        keep_forces();
    }
    const Vector wrench = plate_wrench();
    if (std::hypot(wrench.x, wrench.y) > limit)
        return {solution.residual, STALLED};
    keep_motion(scale.size);
    const Pose reference = state.poses.back();
    for (std::size_t i = 0; i < state.poses.size(); ++i)
        state.poses[i] = moved(state.poses[i], reference, work.bodies[i].u, 1.0, world->length);
    return solution;
}

// Place bodies and feet at `poses` relative to the plate's reference point at the step's start.
void Simulation::place() {
    // Relative to the plate, because moments would lose precision far from the world's origin.
    const double ox = state.poses.back().x, oy = state.poses.back().y;
    for (std::size_t i = 0; i < poses.size(); ++i) {
        Body &body = work.bodies[i];
        body.x = poses[i].x - ox;
        body.y = poses[i].y - oy;
        body.c = std::cos(poses[i].theta);
        body.s = std::sin(poses[i].theta);
    }
    Body &standing = work.bodies[world->standing()];
    standing.x = -ox;
    standing.y = -oy;
    standing.c = 1.0;
    standing.s = 0.0;
    for (int i = 0; i < world->plate(); ++i)
        place_feet(i);
}

// Place the feet of an object. A push above the floor shifts its load by h mu drag, as in the last step.
void Simulation::place_feet(int i) {
    const Body &there = work.bodies[i];
    const Object &object = world->objects[i];
    // The load is N_j + k_j (p_j - c) . b with b = S^-1 (h mu drag): the support's stiffnesses k carry the moment of a
    // push at height h.
    const double det = object.sxx * object.syy - object.sxy * object.sxy;
    const double fx = object.shift * state.drag[i][0], fy = object.shift * state.drag[i][1];
    double bx = 0.0, by = 0.0;
    if (object.shift > 0.0) {
        bx = (object.syy * fx - object.sxy * fy) / det;
        by = (object.sxx * fy - object.sxy * fx) / det;
    }
    for (int j = object.first_foot; j < object.last_foot; ++j) {
        const Foot &foot = world->feet[j];
        const double shift = bx * (foot.x - object.cx) + by * (foot.y - object.cy);
        work.feet[j] = {(there.x + there.c * foot.x - there.s * foot.y) / world->length,
                        (there.y + there.s * foot.x + there.c * foot.y) / world->length,
                        foot.load + foot.stiffness * shift};
    }
}

// Set the displacement of the plate, and zero for fixed bodies.
//
// A twist about a fixed point, in the world's axes, is constant during the step.
void Simulation::command(const Twist &twist) {
    Body &plate = work.bodies[world->plate()];
    const double c = plate.c, s = plate.s;
    plate.u = {c * twist.vx - s * twist.vy, s * twist.vx + c * twist.vy, world->length * twist.omega};
    work.bodies[world->standing()].u = {};
}

// Set U as in the last step, or as for one rigid body with the plate.
void Simulation::predict(double size, bool rigid) {
    // In the plate's axes, a steady push is the same from step to step, even if the plate turns.
    const double c = std::cos(state.poses.back().theta), s = std::sin(state.poses.back().theta);
    for (int i = 0; i < world->plate(); ++i) {
        const Vector &last = state.twists[i];
        work.bodies[i].u =
            rigid ? work.bodies[world->plate()].u
                  : Vector{size * (c * last.x - s * last.y), size * (s * last.x + c * last.y), size * last.w};
    }
}

// Compute the friction forces of one rigid body. Loads that a push above the floor shifts depend on them.
void Simulation::begin_drag(const Scale &scale) {
    constexpr int SHIFTS = 5;
    predict(scale.size, true);
    // Fixed-point iteration: friction shifts the load, which changes friction. Later steps use the drag of the step
    // before.
    for (int round = 0; round < SHIFTS; ++round) {
        floor_terms(work, scale.eps());
        keep_drag();
        for (int i = 0; i < world->plate(); ++i)
            place_feet(i);
    }
}

// Store every object's friction force, in its own axes, for the shift of its load.
void Simulation::keep_drag() {
    for (int i = 0; i < world->plate(); ++i) {
        const Vector &g = work.floors[i].g;
        const double c = work.bodies[i].c, s = work.bodies[i].s;
        state.drag[i] = {c * g.x + s * g.y, c * g.y - s * g.x};
    }
}

// Store the motion and the objects' friction forces.
void Simulation::keep_motion(double size) {
    const double c = std::cos(state.poses.back().theta), s = std::sin(state.poses.back().theta);
    for (int i = 0; i < world->plate(); ++i) {
        const Vector &u = work.bodies[i].u;
        state.twists[i] = {(c * u.x + s * u.y) / size, (c * u.y - s * u.x) / size, u.w / size};
    }
    keep_drag();
    ++state.steps;
}

// Store the forces of all pairs.
void Simulation::keep_forces() {
    for (std::size_t q = 0; q < state.memory.size(); ++q) {
        Memory &memory = state.memory[q];
        if (work.found[q] >= 0) {
            const Manifold &m = work.manifolds[work.found[q]];
            memory = {m.force, m.points};
        } else {
            memory.points = 0;
        }
    }
}

// Begin with the last forces or, in the first step, with a force on every touching pair.
void Simulation::recall_forces(bool fresh, double force) {
    // In the first step there is no memory. Without a force, all contacts would be guessed open, and nothing would
    // move.
    for (Manifold &m : work.manifolds)
        if (fresh && m.gap[0] < 1e-6 * world->length)
            m.force = {0.5 * force, 0.5 * force, 0.0};
    // Several pairs can share a manifold. The first pair's memory, which identifies it, is written last.
    for (std::size_t q = state.memory.size(); q-- > 0;) {
        const Memory &memory = state.memory[q];
        if (work.found[q] < 0 || memory.points == 0)
            continue;
        Manifold &m = work.manifolds[work.found[q]];
        m.force = memory.force;
        // Distribute evenly if the manifold's number of points has changed.
        if (memory.points != m.points)
            m.force[0] = m.force[1] = (memory.force[0] + memory.force[1]) / m.points;
    }
    for (Manifold &m : work.manifolds)
        if (m.points == 1)
            m.force[1] = 0.0;
}

// Return whether every pressing contact sticks at both ends.
bool Simulation::all_stick() const {
    for (const Manifold &m : work.manifolds) {
        const int pressed = m.mode[0] + (m.points == 2 ? m.mode[1] : 0);
        if (pressed > 0 && (pressed < 2 || m.mode[TANGENT] != 1))
            return false;
    }
    return true;
}

// Find the contacts at the current places, and solve. Gaps must close in a share `left` of the step.
Solution Simulation::solve_here(const Scale &scale, double left) {
    constexpr double REACH = 2.5; // gap over the size of a step up to which contacts count
    place_corners(work);
    if (!find_manifolds(work, REACH * scale.size))
        return {0.0, CROWDED};
    // A point must not pass its gap in the rest of the step, but motions are for a whole step. Overlaps separate by
    // half a step at a time.
    for (Manifold &m : work.manifolds)
        for (int k = 0; k < m.points; ++k)
            m.gap[k] = std::max(m.gap[k] / left, -0.5 * scale.size);
    recall_forces(state.steps == 0 && left == 1.0, scale.force);
    return solve(scale);
}

// Solve with everything at the middle of the step; if that fails, at its start again.
Solution Simulation::solve_midway(const Scale &scale) {
    for (std::size_t i = 0; i < poses.size(); ++i)
        poses[i] = moved(poses[i], state.poses.back(), work.bodies[i].u, 0.5, world->length);
    place();
    // In the middle of a step that closes a contact, there may be no solution although there is one at its start.
    const Solution solution = solve_here(scale, 0.5);
    if (!solution.failed())
        return solution;
    poses = state.poses;
    place();
    predict(scale.size, state.steps == 0);
    return solve_here(scale, 1.0);
}

// Run Newton's method from the fallback's solution, which stays if it fails. Return the residual.
static double polished(Work &work, const Scale &scale) {
    // A failed Newton iteration leaves arbitrary U and forces.
    const double before = balance_residual(work);
    const std::vector<Body> bodies = work.bodies;
    std::vector<std::array<double, 3>> forces;
    for (const Manifold &m : work.manifolds)
        forces.push_back(m.force);
    const double residual = newton(work, scale);
    if (residual < INF)
        return residual;
    for (int i = 0; i < work.plate(); ++i)
        work.bodies[i].u = bodies[i].u;
    for (std::size_t c = 0; c < forces.size(); ++c)
        work.manifolds[c].force = forces[c];
    return before;
}

// Compute the motions of all objects in a step.
Solution Simulation::solve(const Scale &scale) {
    // An attempt of the fallback: from the last motion or that of one rigid body, with the smallest and the largest
    // tau.
    struct Attempt {
        bool rigid;
        double least, most;
    };
    constexpr Attempt ATTEMPTS[] = {{false, 0.0, 1.0}, {false, 0.0, 16.0}, {false, 1.0, 1.0},
                                    {false, 4.0, 4.0}, {true, 0.0, 1.0},   {true, 0.0, 16.0}};
    const double residual = newton(work, scale);
    if (residual < INF)
        return {residual, CONVERGED};
    bool jam = true;
    double left = INF;
    for (const Attempt &attempt : ATTEMPTS) {
        predict(scale.size, attempt.rigid);
        // It is a jam only if all attempts end with a ray.
        if (reweighted(work, scale, attempt.least, attempt.most) == Ending::RAY)
            continue;
        jam = false;
        left = polished(work, scale);
        if (left <= scale.accepted())
            return {left, FALLBACK};
    }
    return {left, jam ? JAMMED : UNSOLVED};
}

Trace Simulation::march(Table<const double> twists, double limit) {
    const std::size_t n = world->objects.size();
    Trace trace;
    for (std::ptrdiff_t m = 0; m < twists.rows; ++m) {
        const Solution solution = step(twist_at(twists[m]), limit);
        trace.residual.push_back(solution.residual / world->friction());
        trace.end.push_back(solution.end);
        trace.poses.resize(trace.poses.size() + 3 * n);
        for (std::size_t i = 0; i < n; ++i)
            put(trace.poses.data() + trace.poses.size() - 3 * n + 3 * world->order[i], state.poses[i]);
        trace.modes.resize(trace.modes.size() + n, OPEN);
        trace.forces.resize(trace.forces.size() + 3 * n, 0.0);
        trace.others.resize(trace.others.size() + n, 0);
        trace.wrenches.resize(trace.wrenches.size() + 3, 0.0);
        if (solution.failed())
            break;
        note_contacts(trace);
        note_wrench(trace);
    }
    return trace;
}

static Mode mode_of(const Manifold &m) {
    const int ends = m.mode[0] + (m.points == 2 ? m.mode[1] : 0);
    if (ends == 0)
        return OPEN;
    if (m.mode[TANGENT] == 1)
        return ends == 2 ? STICK : ROLL;
    return ends == 2 ? SLIDE : ROLL_SLIDE;
}

// Record the contacts of the last step.
void Simulation::note_contacts(Trace &trace) const {
    const std::size_t n = world->objects.size(), first = trace.others.size() - n;
    for (const Manifold &m : work.manifolds) {
        const Mode mode = mode_of(m);
        const int contact = world->pairs[m.pair].contact;
        if (contact >= 0) {
            const std::size_t at = first + world->order[contact];
            trace.modes[at] = mode;
            std::copy(m.force.begin(), m.force.end(), trace.forces.begin() + 3 * at);
        } else if (mode != OPEN) {
            // For a contact outside the chain, only record that the object, or both objects, touch something.
            for (const int body : {m.a, m.b})
                if (work.is_object(body))
                    ++trace.others[first + world->order[body]];
        }
    }
}

// Return the plate's wrench in the last step, with moments divided by the length of the world.
Vector Simulation::plate_wrench() const {
    Vector sum{0.0, 0.0, 0.0};
    for (const Manifold &m : work.manifolds)
        if (m.a == world->plate()) {
            const Vector wrench = m.wrench();
            sum = {sum.x + wrench.x, sum.y + wrench.y, sum.w + wrench.w};
        }
    return sum;
}

// Record the plate's wrench in its own frame at the place where the step was solved.
//
// The step has it in the world's axes, about the plate's reference point at the step's start.
void Simulation::note_wrench(Trace &trace) const {
    const auto [fx, fy, moment] = plate_wrench();
    const double torque = world->length * moment;
    // Rotate it into the plate's axes, and shift the moment from the point O to the plate.
    const Body &there = work.bodies[world->plate()];
    double *out = trace.wrenches.data() + trace.wrenches.size() - 3;
    out[0] = there.c * fx + there.s * fy;
    out[1] = there.c * fy - there.s * fx;
    out[2] = torque - (there.x * fy - there.y * fx);
}

} // namespace pushplan::slip
