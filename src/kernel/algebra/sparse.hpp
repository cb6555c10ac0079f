// Sparse square matrices of one fixed pattern: rows of values, products, and LU in an order chosen once.
#pragma once
#include <vector>

#include "algebra/linear.hpp"

namespace thermid {

// Where the entries of a matrix stand: row i in [begin[i], begin[i + 1]), columns ascending, the diagonal always present.
struct Pattern {
    int n = 0;
    std::vector<int> begin, col, diag;
    int size() const { return static_cast<int>(col.size()); }
    int at(int i, int j) const;  // place of an entry, or size() where there is none
    void build(int nodes, std::vector<std::vector<int>> rows);
    // y = v x for a vector, and for (n, m) row-major
    void times(const double* v, const double* x, double* y) const;
    void times(const double* v, const double* x, double* y, int m) const;
    // Row i of y = scale[i] * (that of g + that of v x + that of w z, where there is a w).
    void sum(const double* scale, const double* g, const double* v, const double* x, const double* w, const double* z, double* y, int m) const;
    void row_times(const double* v, int i, double scale, const double* x, double* y, int m) const;  // y += scale * (row i of v) x
};

// The order in which a pattern is eliminated (least degree first), and what each row then holds before and after its diagonal.
struct Elimination {
    std::vector<int> order, rank, low_begin, low_col, up_begin, up_col;
    bool full = false;  // so much fill that a dense matrix does better
    void build(const Pattern& p);
    double products() const;  // multiplications that the elimination takes
};

// LU without pivoting. Where a multiplier grows beyond 10 (or the fill is large) a dense one with threshold pivoting takes over, so the
// answer is as safe as that one.
class SparseLu {
  public:
    void resize(const Pattern& p, const Elimination& e);
    double* data() { return a_.data(); }  // values in the pattern's order
    int factor();                         // -1, or the column at which no usable pivot was found
    void solve(double* b) const;
    void solve_many(double* b, int m) const;  // b is (n, m), row-major

  private:
    const Pattern* p_ = nullptr;
    const Elimination* e_ = nullptr;
    std::vector<double> a_, low_, up_, inv_, work_;  // rows of U are divided by their pivots
    bool dense_ = false;
    Lu lu_;
    bool eliminate();
};

}  // namespace thermid
