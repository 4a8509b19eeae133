// A push problem as `peers.py` writes it, for planners in C++ beside the project's own: its arrays (name, rows,
// columns, numbers), a random stable arc, a swept collision check by conservative advancement, and the cheapest two of
// all exact words to the goal.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <vector>

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kTwoPi = 6.283185307179586;

struct Pose { double x, y, theta; };
struct Twist { double vx, vy, omega; };
struct Array {
    int rows = 0, cols = 0;
    std::vector<double> data;
    const double *row(int i) const { return &data[i * cols]; }
};

inline std::map<std::string, Array> read(const char *path) {
    std::map<std::string, Array> arrays;
    std::ifstream in(path);
    std::string name;
    Array array;
    while (in >> name >> array.rows >> array.cols) {
        array.data.resize(array.rows * array.cols);
        std::string word;
        for (double &value : array.data) {
            in >> word;
            value = std::stod(word);
        }
        arrays[name] = array;
    }
    return arrays;
}

inline Pose step(const Pose &p, const Twist &v, double length) {
    const double half = 0.5 * v.omega * length;
    const double chord = std::abs(half) < 1e-8 ? length : length * std::sin(half) / half;
    const double c = chord * std::cos(p.theta + half), s = chord * std::sin(p.theta + half);
    return {p.x + c * v.vx - s * v.vy, p.y + s * v.vx + c * v.vy, p.theta + 2.0 * half};
}

// Corners as rows x, y, and the outward normal of the edge that begins there.
struct Polygon {
    const double *corners;
    int count;
    const double *bound;
};

struct Frame { double c, s, x, y; };

inline double axisSeparation(const Polygon &a, const Polygon &b, const Frame &f) {
    double best = -kInf;
    for (int i = 0; i < a.count; ++i) {
        const double *p = a.corners + 4 * i;
        const double nx = f.c * p[2] - f.s * p[3], ny = f.s * p[2] + f.c * p[3];
        const double offset = nx * (f.x + f.c * p[0] - f.s * p[1]) + ny * (f.y + f.s * p[0] + f.c * p[1]);
        double nearest = kInf;
        for (int j = 0; j < b.count; ++j) nearest = std::min(nearest, nx * b.corners[4 * j] + ny * b.corners[4 * j + 1]);
        best = std::max(best, nearest - offset);
    }
    return best;
}

inline double pointSegment(double px, double py, const double *a, const double *b) {
    const double ex = b[0] - a[0], ey = b[1] - a[1];
    const double t = std::clamp(((px - a[0]) * ex + (py - a[1]) * ey) / (ex * ex + ey * ey), 0.0, 1.0);
    const double dx = px - a[0] - t * ex, dy = py - a[1] - t * ey;
    return dx * dx + dy * dy;
}

inline double cornerDistance(const Polygon &a, const Polygon &b, const Frame &f) {
    double best = kInf;
    for (int i = 0; i < a.count; ++i) {
        const double *p = a.corners + 4 * i;
        const double px = f.x + f.c * p[0] - f.s * p[1], py = f.y + f.s * p[0] + f.c * p[1];
        for (int j = 0; j < b.count; ++j)
            best = std::min(best, pointSegment(px, py, b.corners + 4 * j, b.corners + 4 * ((j + 1) % b.count)));
    }
    return best;
}

inline double polygonSeparation(const Polygon &a, const Polygon &b, const Frame &f, double exactBelow) {
    const double forward = axisSeparation(a, b, f);
    if (forward >= exactBelow) return forward;
    const Frame back{f.c, -f.s, -(f.c * f.x + f.s * f.y), f.s * f.x - f.c * f.y};
    const double both = std::max(forward, axisSeparation(b, a, back));
    if (both <= 0.0 || both >= exactBelow) return both;
    return std::sqrt(std::min(cornerDistance(a, b, f), cornerDistance(b, a, back)));
}

inline double discSeparation(const Polygon &a, const double *disc, const Frame &f) {
    const double px = f.c * (disc[0] - f.x) + f.s * (disc[1] - f.y), py = -f.s * (disc[0] - f.x) + f.c * (disc[1] - f.y);
    double inside = -kInf, nearest = kInf;
    for (int i = 0; i < a.count; ++i) {
        const double *p = a.corners + 4 * i;
        inside = std::max(inside, p[2] * (px - p[0]) + p[3] * (py - p[1]));
        nearest = std::min(nearest, pointSegment(px, py, p, a.corners + 4 * ((i + 1) % a.count)));
    }
    return inside <= 0.0 ? inside - disc[2] : std::sqrt(nearest) - disc[2];
}

struct Word {
    double cost;
    int letters[3];
    double lengths[3];
    int family;
};

class Problem {
public:
    explicit Problem(std::map<std::string, Array> arrays) : a_(std::move(arrays)) {
        body_ = polygons("body"), obstacles_ = polygons("obstacles");
        const double *n = a_["numbers"].row(0);
        clearance_ = n[0], kept_ = n[1], longest_ = n[2], headingLength_ = n[3];
        exactBelow_ = std::max(0.01, 2.0 * clearance_);
        goal_ = pose("goal");
    }

    Pose pose(const std::string &name) { return {a_[name].data[0], a_[name].data[1], a_[name].data[2]}; }
    const Array &array(const std::string &name) { return a_[name]; }
    double headingLength() const { return headingLength_; }
    double longest() const { return longest_; }

    Twist choose(double u0, double u1) const {
        const Array &families = a_.at("families"), &segments = a_.at("segments");
        const double letterShare = 0.3, endShare = 0.25;
        if (u0 < letterShare) {
            const double *t = families.row(std::min(int(u0 / letterShare * families.rows), families.rows - 1));
            if (t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0) return {t[0], t[1], t[2]};
            u0 = letterShare + (1.0 - letterShare) * u1;
        }
        u0 = (u0 - letterShare) / (1.0 - letterShare);
        const double *s = segments.row(std::min(int(u0 * segments.rows), segments.rows - 1));
        const double b = std::clamp((u1 - endShare) / (1.0 - 2.0 * endShare), 0.0, 1.0);
        double v[3];
        for (int k = 0; k < 3; ++k) v[k] = (1.0 - b) * s[k] + b * s[3 + k];
        const double rate = std::hypot(v[0], v[1]) + 0.1 * std::abs(v[2]);
        return {v[0] / rate, v[1] / rate, v[2] / rate};
    }

    double separation(const Pose &p, double enough) const {
        const Frame f{std::cos(p.theta), std::sin(p.theta), p.x, p.y};
        const double *walls = a_.at("walls").row(0), *bound = a_.at("body_bound").row(0);
        const double cx = f.x + f.c * bound[0] - f.s * bound[1], cy = f.y + f.s * bound[0] + f.c * bound[1];
        double best = enough;
        if (std::min({cx - walls[0], cy - walls[1], walls[2] - cx, walls[3] - cy}) < enough + bound[2])
            for (const Polygon &piece : body_)
                for (int i = 0; i < piece.count; ++i) {
                    const double *q = piece.corners + 4 * i;
                    const double x = f.x + f.c * q[0] - f.s * q[1], y = f.y + f.s * q[0] + f.c * q[1];
                    best = std::min({best, x - walls[0], y - walls[1], walls[2] - x, walls[3] - y});
                }
        for (const Polygon &o : obstacles_) {
            if (!near(cx, cy, o.bound, best + bound[2])) continue;
            for (const Polygon &piece : body_) {
                const double x = f.x + f.c * piece.bound[0] - f.s * piece.bound[1];
                const double y = f.y + f.s * piece.bound[0] + f.c * piece.bound[1];
                if (near(x, y, o.bound, best + piece.bound[2]))
                    best = std::min(best, polygonSeparation(piece, o, f, exactBelow_));
            }
        }
        const Array &circles = a_.at("circles");
        for (int o = 0; o < circles.rows; ++o)
            if (near(cx, cy, circles.row(o), best + bound[2]))
                for (const Polygon &piece : body_) best = std::min(best, discSeparation(piece, circles.row(o), f));
        return best;
    }

    // Mark the cells (x0 + side i, y0 + side j) whose middles are nearer than `least` to an obstacle.
    void mark(double x0, double y0, double side, int nx, int ny, double least, std::vector<char> &blocked) const {
        const Frame own{1.0, 0.0, 0.0, 0.0};
        auto around = [&](const double *bound, auto &&distance) {
            const double reach = bound[2] + least;
            const int i0 = std::max(0, int((bound[0] - reach - x0) / side)), j0 = std::max(0, int((bound[1] - reach - y0) / side));
            for (int j = j0; j < ny && y0 + j * side <= bound[1] + reach; ++j)
                for (int i = i0; i < nx && x0 + i * side <= bound[0] + reach; ++i) {
                    const double middle[3] = {x0 + (i + 0.5) * side, y0 + (j + 0.5) * side, 0.0};
                    if (distance(middle) < least) blocked[j * nx + i] = 1;
                }
        };
        for (const Polygon &o : obstacles_)
            around(o.bound, [&](const double *middle) { return discSeparation(o, middle, own); });
        const Array &circles = a_.at("circles");
        for (int o = 0; o < circles.rows; ++o) {
            const double *c = circles.row(o);
            around(c, [&](const double *middle) { return std::hypot(middle[0] - c[0], middle[1] - c[1]) - c[2]; });
        }
    }

    bool sweepIsFree(const Pose &p, const Twist &v, double length) const {
        double top = 0.0;
        for (const Polygon &piece : body_)
            for (int i = 0; i < piece.count; ++i) {
                const double *q = piece.corners + 4 * i;
                top = std::max(top, std::hypot(v.vx - v.omega * q[1], v.vy + v.omega * q[0]));
            }
        std::array<std::array<double, 2>, 128> open;
        open[0] = {0.0, length};
        for (int n = 1; n > 0;) {
            const auto [begin, end] = open[--n];
            const double middle = 0.5 * (begin + end);
            const double gap = separation(step(p, v, middle), 0.5 * (end - begin) * top + 2.0 * clearance_);
            if (gap < clearance_) return false;
            const double covered = (gap - kept_) / top;
            if (middle - covered > begin) {
                open[n++] = {begin, middle - covered};
                open[n++] = {middle + covered, end};
            }
        }
        return true;
    }

    // Cost of the cheapest of two words that is free, infinite if none is.
    double connect(const Pose &start) const {
        std::array<Word, 36> words;
        int n = 0;
        const Array &families = a_.at("families");
        for (int f = 0; f < families.rows / 3; ++f) findWords(f, start, words, n);
        for (int tries = 0; tries < 2; ++tries) {
            int best = -1;
            for (int i = 0; i < n; ++i)
                if (words[i].cost < kInf && (best < 0 || words[i].cost < words[best].cost)) best = i;
            if (best < 0) return kInf;
            if (wordIsFree(words[best], start)) return words[best].cost;
            words[best].cost = kInf;
        }
        return kInf;
    }

private:
    static bool near(double x, double y, const double *bound, double reach) {
        const double dx = x - bound[0], dy = y - bound[1], r = reach + bound[2];
        return dx * dx + dy * dy < r * r;
    }

    std::vector<Polygon> polygons(const std::string &name) {
        std::vector<Polygon> found;
        const Array &corners = a_[name + "_corners"], &starts = a_[name + "_starts"], &bounds = a_[name + "_bounds"];
        for (int i = 0; i + 1 < starts.rows; ++i) {
            const int first = int(starts.data[i]), last = int(starts.data[i + 1]);
            found.push_back({corners.row(first), last - first, bounds.row(i)});
        }
        return found;
    }

    Twist letter(int family, int i) const {
        const double *t = a_.at("families").row(3 * family + i);
        return {t[0], t[1], t[2]};
    }

    static double turn(double angle) {
        double wrapped = std::fmod(angle, kTwoPi);
        if (wrapped < 0.0) wrapped += kTwoPi;
        return wrapped > kTwoPi - 1e-11 ? 0.0 : wrapped;
    }

    static std::array<double, 2> moved(const Pose &p, double x, double y) {
        const double c = std::cos(p.theta), s = std::sin(p.theta);
        return {p.x + c * x - s * y, p.y + s * x + c * y};
    }

    static void store(std::array<Word, 36> &words, int &n, int f, int a, int b, int c, double p, double q, double r) {
        words[n++] = {p + q + r, {a, b, c}, {p, q, r}, f};
    }

    void findWords(int f, const Pose &start, std::array<Word, 36> &words, int &n) const {
        const Twist straight = letter(f, 1);
        for (int first : {0, 2})
            for (int last : {0, 2}) {
                const Twist v1 = letter(f, first), v2 = letter(f, last);
                if (v1.omega == 0.0 || v2.omega == 0.0) continue;
                if (straight.vx != 0.0 || straight.vy != 0.0) straightWords(f, first, last, start, words, n);
                if (first != last) turningWords(f, first, last, start, words, n);
            }
    }

    void straightWords(int f, int first, int last, const Pose &start, std::array<Word, 36> &words, int &n) const {
        const Twist u = letter(f, 1), v1 = letter(f, first), v2 = letter(f, last);
        const double c1x = -v1.vy / v1.omega, c1y = v1.vx / v1.omega, c2x = -v2.vy / v2.omega, c2y = v2.vx / v2.omega;
        const auto p1 = moved(start, c1x, c1y), p2 = moved(goal_, c2x, c2y);
        const double ex = c2x - c1x, ey = c2y - c1y, dx = p2[0] - p1[0], dy = p2[1] - p1[1];
        const double along = ex * u.vx + ey * u.vy;
        const double under = along * along - ex * ex - ey * ey + dx * dx + dy * dy;
        if (under < 0.0) return;
        const double root = std::sqrt(under);
        for (double sign : {1.0, -1.0}) {
            const double p = -along + sign * root;
            if (p < 0.0 || (sign < 0.0 && root == 0.0)) continue;
            double heading = start.theta;
            if (dx * dx + dy * dy > 1e-24) heading = std::atan2(dy, dx) - std::atan2(ey + p * u.vy, ex + p * u.vx);
            const double t1 = turn(std::copysign(1.0, v1.omega) * (heading - start.theta));
            const double t2 = turn(std::copysign(1.0, v2.omega) * (goal_.theta - heading));
            store(words, n, f, first, 1, last, t1 / std::abs(v1.omega), p, t2 / std::abs(v2.omega));
        }
    }

    void turningWords(int f, int first, int middle, const Pose &start, std::array<Word, 36> &words, int &n) const {
        const Twist v1 = letter(f, first), v2 = letter(f, middle);
        const double c1x = -v1.vy / v1.omega, c1y = v1.vx / v1.omega, c2x = -v2.vy / v2.omega, c2y = v2.vx / v2.omega;
        const auto p = moved(start, c1x, c1y), q = moved(goal_, c1x, c1y);
        const double dx = q[0] - p[0], dy = q[1] - p[1];
        const double arm = std::hypot(c2x - c1x, c2y - c1y), distance = std::hypot(dx, dy);
        if (distance > 2.0 * arm || distance < 1e-12) return;
        const double armAngle = std::atan2(c2y - c1y, c2x - c1x), opening = std::acos(distance / (2.0 * arm));
        for (double sign : {1.0, -1.0}) {
            const double reach = std::atan2(dy, dx) + sign * opening;
            const double ax = p[0] + arm * std::cos(reach), ay = p[1] + arm * std::sin(reach);
            const double heading1 = reach - armAngle, heading2 = std::atan2(ay - q[1], ax - q[0]) - armAngle;
            const double t1 = turn(std::copysign(1.0, v1.omega) * (heading1 - start.theta));
            const double t2 = turn(std::copysign(1.0, v2.omega) * (heading2 - heading1));
            const double t3 = turn(std::copysign(1.0, v1.omega) * (goal_.theta - heading2));
            const double w1 = std::abs(v1.omega), w2 = std::abs(v2.omega);
            store(words, n, f, first, middle, first, t1 / w1, t2 / w2, t3 / w1);
        }
    }

    // The middle arc first: it is mostly the longest.
    bool wordIsFree(const Word &word, const Pose &start) const {
        const Twist first = letter(word.family, word.letters[0]), middle = letter(word.family, word.letters[1]);
        const Pose joint = step(start, first, word.lengths[0]);
        if (!arcIsFree(joint, middle, word.lengths[1]) || !arcIsFree(start, first, word.lengths[0])) return false;
        return arcIsFree(step(joint, middle, word.lengths[1]), letter(word.family, word.letters[2]), word.lengths[2]);
    }

    bool arcIsFree(const Pose &p, const Twist &v, double length) const { return length <= 0.0 || sweepIsFree(p, v, length); }

    std::map<std::string, Array> a_;
    std::vector<Polygon> body_, obstacles_;
    double clearance_, kept_, longest_, headingLength_, exactBelow_;
    Pose goal_;
};

// Straight travel and the smallest turn: less than any way from a pose to another.
inline double atLeast(const Pose &p, const Pose &q) {
    return std::hypot(q.x - p.x, q.y - p.y) + 0.1 * std::abs(std::remainder(q.theta - p.theta, kTwoPi));
}
