// Inputs u(t): sampled, sine, constant. Sampled ones are projected: over a step they are replaced by the quadratic
// with the same three moments, from exact iterated integrals of the piecewise-linear signal.
#pragma once
#include <cstddef>
#include <vector>

namespace thermid {

// Iterated integrals of a signal from a start: int u, int int u, int int int u.
struct Integrals {
    double i1 = 0.0, i2 = 0.0, i3 = 0.0;
    // Appends a stretch of given length whose own integrals are b.
    void append(double length, double b1, double b2, double b3) {
        i3 += length * (i2 + 0.5 * length * i1) + b3;
        i2 += length * i1 + b2;
        i1 += b1;
    }
    void append_line(double length, double u, double slope) {
        const double l2 = length * length;
        append(length, length * (u + 0.5 * slope * length), l2 * (0.5 * u + slope * length * (1.0 / 6.0)),
               l2 * length * (u * (1.0 / 6.0) + slope * length * (1.0 / 24.0)));
    }
};

class Input {
  public:
    int kind = 3;
    double mean = 0.0, amplitude = 0.0, period = 1.0, phase = 0.0;  // CONSTANT uses mean; sampled: mean is the reference level, their median
    void set_samples(const double* times, const double* values, int m);
    void sum_blocks();  // after segments have changed
    bool sampled() const { return kind <= 1; }
    double at(double t) const;     // value, right-continuous
    double slope(double t) const;  // derivative of a smooth input; 0 for a sampled one
    int segment(double t, int hint) const;  // last knot at or before t; -1 before the first
    // Appends the knots inside (t0, t1) where the signal is not smooth, if there are at most `most`.
    void breaks(double t0, double t1, int most, std::vector<double>& out) const;
    double next_knot(double t, int hint) const;
    double at(double t, int& hint) const;
    // Appends the knots of a sampled input inside (t0, t1), where they are more than `gap` apart; of many, those that begin a block.
    void knots(double t0, double t1, std::vector<double>& out, double gap = 0.0) const;
    // The furthest that a sampled input is from what stands for it over a step, at knots and at the step's ends.
    double furthest(const struct StepInput& x, double t0, double t1, int hint) const;

    struct Segment { double t, u, s; };
    std::vector<Segment> seg;  // u is relative to mean
    static constexpr int BLOCK = 8;
    std::vector<Integrals> block;  // of each full block of segments
    std::vector<double> block_square;
    // Integral of the square (relative to mean) over [t0, t1], which start in the segments i0 and i1.
    double square(double t0, int i0, double t1, int i1) const;
};

// Walks a sampled input forward from a start time, keeping the integrals since then.
class Cursor {
  public:
    void begin(const Input* input, double t);
    void move(double t) {  // to a later time
        if (next_ <= t) advance(t);
        const double l = t - from_;
        sum = base_;
        level_ = u_;
        if (l == 0.0) return;
        sum.append_line(l, u_, s_);
        level_ = u_ + s_ * l;
    }
    // To many later times, one after the other: sums (3, stride) there.
    void move(const double* t, int rows, double* sums, int stride);
    double value() const { return in_->mean + level_; }
    int segment() const { return seg_; }
    Integrals sum;

  private:
    const Input* in_ = nullptr;
    int seg_ = -1;
    double from_ = 0.0, next_ = 0.0, u_ = 0.0, s_ = 0.0, level_ = 0.0;  // u_ + s_ (t - from_) up to next_
    Integrals base_;
    void enter(double t);
    void advance(double t);
};

// An input over one step of length h: mean + p0 + p1 s + p2 s^2 with s from the step's start.
struct StepInput {
    double base = 0.0, p0 = 0.0, p1 = 0.0, p2 = 0.0;
    bool exact = true;  // the polynomial is the input itself
    double variance = 0.0;  // mean square of what is left over
    double at(double s) const { return base + p0 + s * (p1 + s * p2); }
    double slope(double s) const { return p1 + 2.0 * s * p2; }
    // Integrals of what is left over, at s, given those of the input (relative to base).
    double w(double s, const Integrals& i) const { return i.i1 - s * (p0 + s * (p1 / 2.0 + s * p2 / 3.0)); }
    double ww(double s, const Integrals& i) const { return i.i2 - s * s * (p0 / 2.0 + s * (p1 / 6.0 + s * p2 / 12.0)); }
    double www(double s, const Integrals& i) const { return i.i3 - s * s * s * (p0 / 6.0 + s * (p1 / 24.0 + s * p2 / 60.0)); }
    // Projects over [t, end]; returns the largest |www| seen inside.
    double project(const Input& input, double t, double end, int& hint);
};

}  // namespace thermid
