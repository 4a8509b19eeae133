// Pushes of the load by one contact between two poses, and the straight ways to the contact and back.
#pragma once

#include "steering.hpp"

#include <vector>

namespace pushplan {

// A contact and the pushes that it can make.
struct PackedMode {
    std::vector<Family> families; // in the contact's chain frame
    Pose contact;                 // of that frame in the load's
    Pose robot;                   // of the robot's frame in that frame
    Twist settling;               // of the straight push that a push begins with
    double settle;                // its length, m
    double approach;              // length of the straight way to the contact, m
    double retreat;               // length of the straight way back from it, m
    double clearance;             // what is kept from everything, m
    double faster;                // how much faster than a push's cost grows the load's origin moves, at most

    // The robot's pose so far behind the contact, m, with the load at a pose.
    Pose robot_at(const Pose &load, double behind) const;
    // Where the contact's frame is after the settling push.
    Pose settled(const Pose &contact_at) const {
        return step(contact_at, {settling.vx, settling.vy, 0.0}, settle);
    }
    Row<const Family> family_row() const {
        return {families.data(), static_cast<std::ptrdiff_t>(families.size())};
    }
};

// Return (n, m) what the cheapest pushes from loads at `starts` (n) to `goals` (m) cost, whatever is in the way.
//
// A pair is left out (infinite) that cannot be part of a plan which costs less than `below`, as what comes before the
// start costs at least `sofar` (n) and what comes after the goal `left` (m).
std::vector<double> word_costs(const PackedMode &mode, const std::vector<Pose> &starts, const std::vector<Pose> &goals,
                               Row<const double> sofar, Row<const double> left, double below);

// The settling push and those of a word, in the contact's frame, of no length where there are fewer.
struct Push {
    double cost = INF; // m; infinite where there is none
    std::array<Arc, 4> arcs{};
};

// Find the cheapest free push between two poses of the load; the scene is the chain with this contact in the room.
Push find_push(const Scene &scene, const PackedMode &mode, const Pose &start, const Pose &goal);

// Return whether the settling push is free with the load at a pose.
bool settles(const Scene &scene, const PackedMode &mode, const Pose &load);

// Return whether the straight way to the contact, or back from it, is free with the load at a pose.
bool approach_is_free(const Scene &robot, const PackedMode &mode, const Pose &load, bool back);

// A load's pose where a turn or a straight push passes by one of some goals, and that goal's row.
struct Passing {
    Pose load;
    int goal;
};

// Return where turns and straight pushes of a contact pass by goals within a distance (m) and an angle (rad).
//
// `inner` is the frame, in the load's, that the goals are of; of each push as long as `far`, m, the pose of so many
// that is nearest to a goal is taken.
std::vector<Passing> find_passings(const PackedMode &mode, const Pose &load, const Pose &inner,
                                   const std::vector<Pose> &goals, double distance, double angle, double far);

} // namespace pushplan
