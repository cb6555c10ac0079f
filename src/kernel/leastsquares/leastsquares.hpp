// Least squares collected while a run goes on: readings against temperatures and sensitivities, kept as a triangle R with R'R = J'J.
// Householder reflections throughout, so that directions survive which J'J would lose.
#pragma once
#include <cstddef>
#include <vector>

namespace thermid {

// The triangle of a growing matrix (rows, columns); the first `pivots` columns are reflected, the others (right-hand sides) go along.
class Triangle {
  public:
    void reset(int columns, int pivots);
    int stride() const { return stride_; }
    double* row(int k) { return r_.data() + static_cast<size_t>(k) * stride_; }
    const double* row(int k) const { return r_.data() + static_cast<size_t>(k) * stride_; }
    void absorb(double* rows, int count);  // (count, stride), overwritten

  private:
    int stride_ = 0, pivots_ = 0;
    std::vector<double> r_, weight_, product_;
};

// Channels whose readings are of the same instants. One that stands alone reads one node; the others read sums of several.
struct ReadingGroup {
    bool alone = true;
    std::vector<int> channels, nodes;          // a channel that stands alone reads the node at its own position
    std::vector<int> begin, at, term;          // per channel: its terms, each a position in `nodes` and a position among all terms
    std::vector<long> index;                   // of output times
    std::vector<double> values;                // (index, channels)
};

struct Readings {
    std::vector<double> times;
    int channels = 0, terms = 0;
    std::vector<ReadingGroup> groups;
};

enum Loss { SQUARE = 0, SOFT_L1, HUBER, CAUCHY };

// What one evaluation weighs the readings by.
struct Weighing {
    const double *sigma, *bias;      // per channel
    const int* bias_column;          // per channel; -1: its constant error is not looked for
    int biases = 0;                  // columns of constant errors, after those of the parameters
    const double *weight, *slope;    // per term: what its node counts, and the derivatives of that (terms, np)
    int loss = SQUARE;
    double knee = 1.0;
};

// Of the residuals of each channel of a group in kelvin; sum, squares and products of neighbours are of what each exceeds the first by.
struct GroupSums {
    double count = 0.0;
    std::vector<double> bias, first, before, total, squares, lagged, plain, high, low;  // plain: squares of the residuals themselves
};

class LeastSquares {
  public:
    LeastSquares(const Readings& readings, const Weighing& weighing, int np);

    size_t groups() const { return readings_.groups.size(); }
    const ReadingGroup& group(size_t g) const { return readings_.groups[g]; }
    long open(size_t g, long last, int terms, long most);  // how many readings of the group lie before output `last`; taken `most` at a time
    const long* upcoming() const { return group_->index.data() + next_[g_]; }
    double* predicted(long m);               // room for (m, nodes)
    double* slopes(long m);                  // room for (m, nodes, np); none without parameters
    double* shares() { return room_.data(); }  // room for (m, terms), rows stride() apart
    int stride() const { return stride_; }
    void take(long m);                       // m readings whose sensitivities are their shares times what close() brings
    void close(const double* terms);         // (terms, channels x np)
    void take_rows(long m);                  // m readings with sensitivities of their own
    void finish();

    const Triangle& triangle() const { return all_; }
    int columns() const { return columns_; }
    double cost = 0.0, chi_square = 0.0;     // knee^2 sum rho; sum of weighted squares
    std::vector<double> sums;                // (channels, 7): count, first, last, total, squares, lagged, largest

  private:
    const Readings& readings_;
    const Weighing& w_;
    const int np_, columns_;
    size_t g_ = 0;
    const ReadingGroup* group_ = nullptr;
    std::vector<long> next_;
    std::vector<GroupSums> told_;
    int terms_ = 0, kept_ = 0, stride_ = 0;  // of the step under way: terms, rows of each triangle, numbers in a row
    bool raw_ = false;                       // fewer readings than terms: the rows stand as they are
    std::vector<Triangle> local_;            // one for all channels, or one each where the loss weighs them apart
    Triangle all_;
    std::vector<double> block_, room_, own_, predicted_, slopes_, mixed_;
    int filled_ = 0;

    double* rows(int count);
    void flush();
    void residuals(long m, double* left, int stride);
    double weigh(double scaled);             // root of the weight of a residual in units of its noise; adds to the cost
    void absorb(Triangle& to, double* rows, long m);
};

}  // namespace thermid
