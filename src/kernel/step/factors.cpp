// Factors of the iteration matrix: made where they are asked for, or kept and refined.
#include "step/factors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thermid {

namespace {
constexpr int KEPT_FROM = 300;     // nodes; with sensitivities 1.25 times faster at 216, 1.65 at 343, 2.3 at 1,000
constexpr size_t MOST_RUNGS = 12;  // sets of factors that are kept
constexpr double SLOW = 0.5;      // contraction of the refinement beyond which a rung is made anew
}  // namespace

// a = capacities on the diagonal - length j; rows without a capacity are of the same size then, which LU without pivoting needs.
THERMID_CLONES static void shifted(double* THERMID_RESTRICT a, const double* THERMID_RESTRICT cap, double length, const double* THERMID_RESTRICT j, int m) {
    for (int k = 0; k < m; ++k) a[k] = cap[k] - length * j[k];
}

Factors::Factors(const Setup& setup) : kept(setup.n >= KEPT_FROM), setup_(setup), pattern_(setup.p.pattern) {
    const Elimination& e = setup.p.elimination;
    if (kept) {
        every_.assign(setup.n, 1);
        a_.assign(pattern_.size(), 0.0);
        rungs_.reserve(MOST_RUNGS);
        const double n = setup.n;
        price_ = e.full ? n / 3.0 : e.products() / std::max<double>(static_cast<double>(e.low_col.size() + e.up_col.size()), 1.0);
    } else {
        rungs_.resize(1);
        rungs_[0].lu.resize(pattern_, e);
    }
}

double Factors::rung(double h) const {
    const int half = static_cast<int>(std::floor(2.0 * std::log2(h) + 1e-9));
    return std::ldexp(half % 2 == 0 ? 1.0 : std::sqrt(2.0), (half - (half & 1)) / 2);
}

void Factors::take(double length, const double* j) {
    if (!kept) {
        shifted(rungs_[0].lu.data(), setup_.cap_at.data(), length, j, pattern_.size());
        return make(rungs_[0]);
    }
    shifted(a_.data(), setup_.cap_at.data(), length, j, pattern_.size());
    length_ = length;
    const int exponent = static_cast<int>(std::lround(2.0 * std::log2(length)));
    const auto at = std::find_if(rungs_.begin(), rungs_.end(), [=](const Rung& r) { return r.exponent == exponent; });
    if (at != rungs_.end()) {
        now_ = at - rungs_.begin();
        all_exact_ = exact_ = std::equal(a_.begin(), a_.end(), at->lu.data());
        weight_ = 2.0 / (1.0 + length / at->length);
        return;
    }
    if (rungs_.size() < MOST_RUNGS) {
        rungs_.emplace_back();
        rungs_.back().lu.resize(pattern_, setup_.p.elimination);
        now_ = rungs_.size() - 1;
    } else {  // in place of the one furthest away
        auto apart = [=](const Rung& r) { return std::abs(r.exponent - exponent); };
        now_ = std::max_element(rungs_.begin(), rungs_.end(), [&](const Rung& a, const Rung& b) { return apart(a) < apart(b); }) - rungs_.begin();
    }
    rungs_[now_].exponent = exponent;
    all_exact_ = true;
    make(rungs_[now_]);
}

void Factors::make(Rung& r) {
    if (kept) {
        std::copy(a_.begin(), a_.end(), r.lu.data());
        r.length = length_;
        r.spent = 0.0;
        exact_ = true;
        weight_ = 1.0;
    }
    ++made;
    const int bad = r.lu.factor();
    if (bad < 0) return;
    r.exponent = std::numeric_limits<int>::min();
    throw Failure{setup_.cap[bad] > 0.0 ? NEWTON_FAILED : SINGULAR_NODE, bad};
}

void Factors::substitute(double* b, int m) const {
    if (m == 1) rungs_[now_].lu.solve(b);
    else rungs_[now_].lu.solve_many(b, m);
}

void Factors::solve(double* b, double accuracy) {
    if (exact_ || !refine(b, 1, accuracy)) substitute(b, 1);
}

void Factors::solve_many(double* b, int m, double accuracy) {
    if (exact_ || !refine(b, m, accuracy)) rungs_[now_].lu.solve_many(b, m);
}

// True where x became the solution of M x = what stood there; else that stands there again, and the rung has been made anew of M.
bool Factors::refine(double* x, int m, double accuracy) {
    const size_t n = setup_.n, all = n * m;
    Rung& r = rungs_[now_];
    b_.assign(x, x + all);
    left_.resize(all);
    auto sizes = [&](const double* of, std::vector<double>& to) {
        to.assign(m, 0.0);
        largest(to.data(), of, every_.data(), static_cast<int>(n), m);
    };
    auto scale = [&](double* v) { for (size_t k = 0; k < all; ++k) v[k] *= weight_; };
    substitute(x, m);
    scale(x);
    sizes(x, before_);
    for (;;) {
        if (m == 1) pattern_.times(a_.data(), x, left_.data());
        else pattern_.times(a_.data(), x, left_.data(), m);
        for (size_t k = 0; k < all; ++k) left_[k] = b_[k] - left_[k];
        substitute(left_.data(), m);
        scale(left_.data());
        sizes(left_.data(), change_);
        for (size_t k = 0; k < all; ++k) x[k] += left_[k];
        sizes(x, size_);
        r.spent += m;
        double rate = 0.0;
        bool close = true;
        for (int q = 0; q < m; ++q) {
            if (change_[q] <= 1e-14 * size_[q]) continue;  // rounding
            const double own = change_[q] / before_[q];
            rate = std::max(rate, own);
            close = close && own < 1.0 && change_[q] * own / (1.0 - own) <= accuracy * size_[q];
        }
        if (close) return true;
        if (!(rate <= SLOW) || r.spent > price_) break;
        before_.swap(change_);
    }
    std::copy(b_.begin(), b_.end(), x);
    make(r);
    return false;
}

}  // namespace thermid
