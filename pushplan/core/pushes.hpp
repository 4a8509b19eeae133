// Pushes of the load by one contact between two poses, and the straight approaches and retreats.
#pragma once

#include "steering.hpp"

#include <vector>

namespace pushplan {

// A contact and the pushes that it can make.
struct PackedMode {
    std::vector<Family> families; // in the contact's chain frame
    Pose contact;                 // pose of that frame in the load's frame
    Pose robot;                   // pose of the robot's frame in that frame
    Twist settling;               // twist of the straight push that begins every push
    double settle;                // its length, m
    double approach;              // length of the straight approach to the contact, m
    double retreat;               // length of the straight retreat from it, m
    double clearance;             // m
    double faster;                // maximum ratio of the travel of the load's origin to a push's cost

    // Return the robot's pose at a distance (m) behind the contact, with the load at a pose.
    Pose robot_at(const Pose &load, double behind) const;
    // Return the pose of the contact's frame after the settling push.
    Pose settled(const Pose &contact_at) const {
        return step(contact_at, {settling.vx, settling.vy, 0.0}, settle);
    }
    Row<const Family> family_row() const {
        return {families.data(), static_cast<std::ptrdiff_t>(families.size())};
    }
};

// Return the costs (n, m) of the cheapest pushes from load poses `starts` (n) to `goals` (m), ignoring obstacles.
//
// The cost is infinite if the pair cannot be part of a plan cheaper than `below`. `sofar` (n) and `left` (m) are lower
// bounds of the costs before the start and after the goal.
std::vector<double> word_costs(const PackedMode &mode, const std::vector<Pose> &starts, const std::vector<Pose> &goals,
                               Row<const double> sofar, Row<const double> left, double below);

// The arcs of the settling push and a steering path in the contact's frame, padded with arcs of zero length.
struct Push {
    double cost = INF; // m; infinite if there is none
    std::array<Arc, 4> arcs{};
};

// Find the cheapest free push between two poses of the load; the scene is the chain with this contact in the room.
Push find_push(const Scene &scene, const PackedMode &mode, const Pose &start, const Pose &goal);

// Return whether the settling push is free with the load at a pose.
bool settles(const Scene &scene, const PackedMode &mode, const Pose &load);

// Return whether the approach to the contact, or the retreat, is free with the load at a pose.
bool approach_is_free(const Scene &robot, const PackedMode &mode, const Pose &load, bool back);

// A load pose at which a turn or a straight push passes by a goal, and the goal's row.
struct Passing {
    Pose load;
    int goal;
};

// Return the poses at which turns and straight pushes of a contact pass by goals within a distance (m) and an angle
// (rad).
//
// `inner` is the pose of the goals' frame in the load's frame. Of the poses along each push of length `far` (m), the
// nearest to a goal is taken.
std::vector<Passing> find_passings(const PackedMode &mode, const Pose &load, const Pose &inner,
                                   const std::vector<Pose> &goals, double distance, double angle, double far);

} // namespace pushplan
