// How the robot drives alone: shortest words of its wheels (Reeds-Shepp for a car), and whether they are free.
#pragma once

#include "reeds_shepp.hpp"
#include "scene.hpp"

namespace pushplan {

enum class WheelKind { OMNIDIRECTIONAL, DIFFERENTIAL, CAR };

// Letters of a car's words by the sign of the curvature: right, straight, left. Each of some twenty words has three to
// five of them.
struct Letters {
    std::array<Twist, 3> ahead; // of the robot, scaled to a cost rate of 1
    std::array<double, 3> rate;
    std::array<double, 3> extent; // how fast the axle moves and turns
};

// How the robot can move alone.
//
// Words are about the axle: a frame, at a pose in the robot's frame, in the axle's middle with +x forward; of an
// omnidirectional robot, in its middle.
struct Wheels {
    WheelKind kind;
    Pose axle;
    double radius; // m, smallest turning radius of the axle's middle; of a car only
    Letters letters{}; // of a car only

    Wheels(WheelKind kind, const Pose &axle, double radius);

    // The robot's twist when the axle's frame moves along one.
    Twist of_robot(const Twist &twist) const {
        const double c = std::cos(axle.theta), s = std::sin(axle.theta);
        // The velocity of the robot's origin, which lies at -(x, y) from the axle's middle.
        return {c * twist.vx - s * twist.vy + twist.omega * axle.y, s * twist.vx + c * twist.vy - twist.omega * axle.x,
                twist.omega};
    }
};

// Arcs of the robot that lead from one pose to another, each scaled to a cost rate of 1, and what they cost, m.
struct DrivenWord {
    double cost = 0.0;
    int count = 0;
    std::array<Arc, ReedsSheppWord::MOST_LETTERS> arcs;

    // Append a twist of the axle's frame that is driven for `time`.
    void add(const Wheels &wheels, const Twist &twist, double time);
    // Append an arc whose twist has a cost rate of 1.
    void add(const Twist &twist, double length) {
        arcs[count++] = {twist, length};
        cost += length;
    }

    const Arc *begin() const { return arcs.data(); }
    const Arc *end() const { return arcs.data() + count; }
};

struct DrivenWords {
    int count = 0;
    std::array<DrivenWord, ReedsSheppWords::MOST> words;

    DrivenWord &next() {
        words[count].cost = 0.0, words[count].count = 0;
        return words[count++];
    }
    DrivenWord *begin() { return words.data(); }
    DrivenWord *end() { return words.data() + count; }
};

// Find the words between two poses of the robot, whatever is in the way.
void find_drives(const Wheels &wheels, const Pose &start, const Pose &goal, DrivenWords &found);

// Return the cost of the cheapest of them, m.
double shortest_drive(const Wheels &wheels, const Pose &start, const Pose &goal);

// What the robot must not touch when it drives alone: what stands in the room, and the objects, which are in the frame
// of the load.
struct Surroundings {
    Scene room, load;
    Pose place; // of that frame in the world

    // Return whether the robot keeps the clearance at a pose.
    bool is_clear(const Pose &pose) const;
    // Return whether the robot keeps clear of everything along an arc from a pose.
    bool is_free(const Pose &pose, const Arc &arc) const;
};

// Find the cheapest free word between two poses; its cost is infinite where there is none.
//
// Only words that cost less than `bound` count, and so many are swept, cheapest first, at most.
DrivenWord drive(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal, double bound,
                 int tries);

} // namespace pushplan
