// Local changes of a path: change one arc's twist or length, or leave an arc out, and adapt three lengths to close it.
//
// Steering paths (`shortening.hpp`) find a path's form. Local changes find the best twists and lengths of that form.
#pragma once

#include "problem.hpp"

#include <array>
#include <vector>

namespace pushplan {

// Random changes of paths in one problem. The problem must outlive this object.
class LocalChanges {
  public:
    explicit LocalChanges(const Problem &problem);

    // Change one arc of a path from `start` to the goal, and close the path with three others. The path stays unchanged
    // if nothing is gained. Return whether it has changed.
    bool vary(const Pose &start, std::vector<Arc> &path, Random &random);

  private:
    // The arcs to change, from the first to the last one, their target, and the upper limit of their value.
    struct Window {
        int first;
        int last;
        Pose target;
        double value;

        bool is_too_small() const { return last - first < 2; }
    };

    // The segment that a twist lies on, or nearly (-1 for none), and the share of its second end.
    struct Place {
        int segment;
        double share;
    };

    bool leave_out(const Pose &start, const std::vector<Arc> &path, int k, Random &random);
    bool closes(const Window &window, Random &random);
    bool close(const Window &window, const std::array<int, 3> &chosen);
    bool is_free(const Window &window) const;
    bool change_twist(Twist &twist, Random &random) const;
    Place place_of(const Twist &twist) const;
    double value_of(const std::vector<Arc> &path, int first, int last) const;
    void find_poses(const std::vector<Arc> &path, int first, int last);

    const Problem &problem_;
    std::vector<std::array<double, 3>> normals_; // normals of the planes through the segments; zero for single twists
    std::vector<Arc> trial_;                     // the changed path
    std::vector<Pose> poses_;                    // poses before its first arc and after some of its arcs
};

} // namespace pushplan
