// Transits of the robot: shortest paths of its drive (Reeds-Shepp for a car), and their collision checks.
#pragma once

#include "reeds_shepp.hpp"
#include "scene.hpp"

namespace pushplan {

enum class WheelKind { OMNIDIRECTIONAL, DIFFERENTIAL, CAR };

// Letters of a car's words by the sign of the curvature: right, straight, left. Each of about twenty words has three to
// five letters.
struct Letters {
    std::array<Twist, 3> ahead; // twists of the robot, scaled to a cost rate of 1
    std::array<double, 3> rate;
    std::array<double, 3> extent; // rates of the axle's motion and turning
};

// Kinematics of the robot in transits.
//
// Paths refer to the axle: a frame, given in the robot's frame, in the axle's middle with +x forward, or in an
// omnidirectional robot's middle.
struct Wheels {
    WheelKind kind;
    Pose axle;
    double radius; // m, smallest turning radius of the axle's middle; cars only
    Letters letters{}; // cars only

    Wheels(WheelKind kind, const Pose &axle, double radius);

    // Return the robot's twist for a twist of the axle's frame.
    Twist of_robot(const Twist &twist) const {
        const double c = std::cos(axle.theta), s = std::sin(axle.theta);
        // Velocity of the robot's origin, which lies at -(x, y) from the axle's middle.
        return {c * twist.vx - s * twist.vy + twist.omega * axle.y, s * twist.vx + c * twist.vy - twist.omega * axle.x,
                twist.omega};
    }
};

// Arcs of the robot from one pose to another, each scaled to a cost rate of 1, and their cost, m.
struct DrivenWord {
    double cost = 0.0;
    int count = 0;
    std::array<Arc, ReedsSheppWord::MOST_LETTERS> arcs;

    // Append a twist of the axle's frame with a duration.
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

// Find the paths between two poses of the robot, ignoring obstacles.
void find_drives(const Wheels &wheels, const Pose &start, const Pose &goal, DrivenWords &found);

// Return the cost of the cheapest of these paths, m.
double shortest_drive(const Wheels &wheels, const Pose &start, const Pose &goal);

// Obstacles of the robot in transits: those of the room, and the load's objects in the load's frame.
struct Surroundings {
    Scene room, load;
    Pose place; // pose of the load's frame in the world

    // Return whether the robot keeps the clearance at a pose.
    bool is_clear(const Pose &pose) const;
    // Return whether an arc of the robot from a pose is collision-free.
    bool is_free(const Pose &pose, const Arc &arc) const;
};

// Find the cheapest free path between two poses; its cost is infinite if there is none.
//
// Only paths that cost less than `bound` count. At most `tries` of them are checked, cheapest first.
DrivenWord drive(const Surroundings &around, const Wheels &wheels, const Pose &start, const Pose &goal, double bound,
                 int tries);

} // namespace pushplan
