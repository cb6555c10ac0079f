// Turning points: where the course of a temperature changes from rising to falling, or back, between the times at which it is stored.
// Every integrator shows the ends of its steps and the extremes inside them; between two outputs the highest and the lowest are kept.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace thermid {

// Weighted sums of temperatures of nodes and boundaries, such as those of nodes that were eliminated: (rows) CSR.
struct Sums {
    std::vector<int> begin{0}, node;
    std::vector<double> weight;
    int size() const { return static_cast<int>(begin.size()) - 1; }
    double of(int row, const double* t) const {
        double x = 0.0;
        for (int k = begin[row]; k < begin[row + 1]; ++k) x += weight[k] * t[node[k]];
        return x;
    }
};

class Turnings {
  public:
    static constexpr double SMALL = 1e-6;  // a course that moves by less stands still [K]
    static constexpr double NOISE = 1e-3;  // what is left over of the inputs and moves a node by less is not looked at [K]
    // How far points may be apart under noise that moves a node by `rate` [K/s] at most, where polynomials bend by `bend` [K/s^2]: between two of
    // them it strays by rate gap / 2 and bend gap^2 / 8.
    static double gap(double rate, double bend) { return std::min(2.0 * NOISE / rate, std::sqrt(2.0 * NOISE / std::max(bend, 1e-300))); }
    static double steepest(const double* b, int count);                           // the largest magnitude
    static double most_bent(const double* c, std::size_t stride, int count);      // of polynomials in s / h: h^2 times the most they bend
    struct Point { int column; double time, kelvin; };
    std::vector<Point> found;

    // Outputs (n) increase and outlive this.
    void begin(int columns, const double* times, long n) {
        times_ = times;
        n_ = n;
        columns_.assign(columns, Column());
        time_.assign(columns, 0.0);
        kelvin_.assign(columns, 0.0);
        way_.assign(columns, NEW);
        open_ = false;
        busy_.assign(columns, 0.0);
        found.clear();
    }
    bool on() const { return !columns_.empty(); }
    // The course of a column at a time that is not before the last one; at a jump, twice the same time.
    void see(int column, double time, double kelvin) {
        if (open_) close();
        double& way = way_[column];
        const double up = kelvin - kelvin_[column];
        if (way == NEW) {
            way = 0.0;
            time_[column] = time;
            kelvin_[column] = kelvin;
            if (n_ == 0 || times_[0] > time) turn(column);
            return;
        }
        if (!(up > SMALL || up < -SMALL)) return;
        const double now = up > 0.0 ? 1.0 : -1.0;
        if (way == -now) turn(column);
        time_[column] = time;
        kelvin_[column] = kelvin;
        way = now;
    }
    // Polynomials of `count` columns from `first`, side by side, `stride` from power to power, as below; y: values at the step's end.
    void see_polynomials(int first, int count, const double* c, std::size_t stride, double t, double h, double end, const double* y);
    // A polynomial of fifth degree in x = s / h over a step from t to `end`, of length h, with the value y at its end.
    void see_polynomial(int column, const double* c, std::size_t stride, double t, double h, double end, double y) {
        const double c1 = c[stride], c2 = c[2 * stride], c3 = c[3 * stride], c4 = c[4 * stride], c5 = c[5 * stride];
        see(column, t, c[0]);
        const auto slope = [=](double x) { return c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))); };
        // Between these parts of a step its slope changes sign at most once; where it moves by less than FLAT no turning point counts.
        if (std::fabs(c1) + std::fabs(c2) + std::fabs(c3) + std::fabs(c4) + std::fabs(c5) > FLAT) {
            double a = 0.0, fa = c1;
            for (double b : {0.25, 0.5, 0.75, 1.0}) {
                const double fb = slope(b);
                if (fa * fb < 0.0) {
                    const double x = root(slope, a, fa, b, fb, 1e-7);
                    see(column, t + x * h, c[0] + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))));
                }
                a = b;
                fa = fb;
            }
        }
        see(column, end, y);
    }
    // Where f changes sign between a and b, to `close`; Illinois.
    template <class F>
    static double root(const F& f, double a, double fa, double b, double fb, double close) {
        for (int it = 0, side = 0; it < 40 && b - a > close; ++it) {
            double x = b - fb * (b - a) / (fb - fa);
            if (!(x > a && x < b)) x = 0.5 * (a + b);
            const double fx = f(x);
            if (fx == 0.0) return x;
            if ((fx > 0.0) == (fb > 0.0)) {
                b = x;
                fb = fx;
                if (side == 1) fa *= 0.5;
                side = 1;
            } else {
                a = x;
                fa = fx;
                if (side == -1) fb *= 0.5;
                side = -1;
            }
        }
        return b - fb * (b - a) / (fb - fa);
    }
    // Three points of a smooth course: the vertex of their parabola, where it lies inside, then the last two.
    void see_three(int column, double t0, double y0, double t1, double y1, double t2, double y2) {
        const double a = (y1 - y0) / (t1 - t0), b = (y2 - y1) / (t2 - t1), bend = (b - a) / (t2 - t0);
        const double at = bend != 0.0 ? 0.5 * (t0 + t1) - 0.5 * a / bend : t0;
        const bool inside = at > t0 && at < t2;
        const double top = y0 + (at - t0) * (a + bend * (at - t1));
        if (inside && at < t1) see(column, at, top);
        see(column, t1, y1);
        if (inside && at > t1) see(column, at, top);
        see(column, t2, y2);
    }
    // Under noise: increasing times of all columns, y (rows, columns), outputs among them. What passes the outputs around it by less than NOISE
    // is left out.
    void see_rows(const double* times, long rows, const double* y);
    // Adds the outputs from `next` up to `end` to times of a step, in order, and `end`; where outputs are nowhere more than `gap` apart, these
    // say it all, and the last of them and `end` are what is left.
    void among_outputs(std::vector<double>& times, long next, double end, double gap) const;
    // The end of the run, or of what is known of it.
    void end() {
        if (open_) close();
        for (std::size_t k = 0; k < columns_.size(); ++k) {
            if (way_[k] != NEW && (n_ == 0 || time_[k] > times_[n_ - 1])) turn(static_cast<int>(k));
            keep(static_cast<int>(k), columns_[k]);
        }
        // In order of columns; those of a column are in order of time.
        std::vector<std::size_t> first(columns_.size() + 1);
        for (const Point& p : found) ++first[p.column + 1];
        for (std::size_t k = 0; k < columns_.size(); ++k) first[k + 1] += first[k];
        std::vector<Point> ordered(found.size());
        for (const Point& p : found) ordered[first[p.column]++] = p;
        found.swap(ordered);
    }

  private:
    static constexpr double FLAT = 1e-5;  // [K]
    static constexpr double NEW = 2.0;
    struct Column {
        long row = 0;  // the output that ends the interval under way
        double low = std::numeric_limits<double>::infinity(), high = -low, low_time = 0.0, high_time = 0.0;
        double low_there = low, high_there = high;  // at these times, less than NOISE from the lowest and the highest
    };
    std::vector<Column> columns_;
    std::vector<double> time_, kelvin_, way_;  // of each column: the point seen last, and whether it rose (1) or fell (-1) to it
    std::vector<double> busy_;
    // Under noise: the highest and lowest since the last output, and the temperature there.
    bool open_ = false;
    std::vector<double> high_, low_, high_time_, low_time_, above_, below_;

    void open();
    void close();
    void note(int column);
    const double* times_ = nullptr;
    long n_ = 0;

    void turn(int column) { turn(column, time_[column], kelvin_[column]); }
    void turn(int column, double time, double kelvin) {
        Column& c = columns_[column];
        if (c.row < n_ && times_[c.row] < time) {
            keep(column, c);
            while (c.row < n_ && times_[c.row] < time) ++c.row;
        }
        // Of equal peaks the first counts, since a limit is crossed there; equal ones differ by the error of a run.
        if (kelvin < c.low_there - NOISE) {
            c.low_there = kelvin;
            c.low_time = time;
        }
        if (kelvin > c.high_there + NOISE) {
            c.high_there = kelvin;
            c.high_time = time;
        }
        c.low = std::min(c.low, kelvin);
        c.high = std::max(c.high, kelvin);
    }
    void keep(int column, Column& c) {
        if (!(c.low <= c.high)) return;
        const bool first = c.low_time <= c.high_time;
        found.push_back({column, first ? c.low_time : c.high_time, first ? c.low : c.high});
        if (c.low_time != c.high_time || c.low != c.high) found.push_back({column, first ? c.high_time : c.low_time, first ? c.high : c.low});
        c.low = c.low_there = std::numeric_limits<double>::infinity();
        c.high = c.high_there = -c.low;
    }
};

}  // namespace thermid
