// A group's memory, and its members' numbers in their lanes.
#include <algorithm>
#include <cmath>

#include "ensemble/ensemble.hpp"

namespace thermid {

Group::Group(const EnsembleSetup& s, long first)
    : s_(s), first_(first), count_(static_cast<int>(std::min<long>(LANES, s.members - first))), t_(s.t0), end_(s.t0), origin_(s.t0),
      hold_(std::numeric_limits<double>::infinity()) {
    layout();
    for (int l = 0; l < LANES; ++l) fill(l, first + std::min(l, count_ - 1));
    alive_ = (1u << LANES) - 1;
}

// One block of memory, aligned for the widest instructions.
void Group::layout() {
    const LanePlan& p = s_.network.plan;
    const size_t n = p.n, nk = p.nk, rows = p.kind_begin[CONDUCTOR_KINDS];
    struct Part { double** at; size_t size; };
    const Part parts[] = {{&g_.coef, size_t(p.nc) + 2}, {&g_.ceff, size_t(p.nc) + 2}, {&g_.cap, n}, {&g_.icap, n}, {&g_.T, n + p.nb},
                          {&g_.Tn, n}, {&g_.T1, n}, {&g_.f, n}, {&g_.qa, rows}, {&g_.qb, rows}, {&g_.phi, rows},
                          {&g_.kept, size_t(KEPT) * p.looked}, {&g_.slope, size_t(p.nloads)}, {&g_.bent, size_t(p.nloads)}, {&g_.power0, size_t(p.nloads)}, {&g_.J0, size_t(p.entries)}, {&g_.J1, size_t(p.entries)},
                          {&g_.lu, size_t(p.matrix)}, {&g_.inv, n}, {&g_.F, STAGES * n}, {&g_.d0, n}, {&g_.dd0, n}, {&g_.ddd0, n}, {&g_.d1, n}, {&g_.g, n},
                          {&g_.base, n}, {&g_.guess, n}, {&g_.bend, n}, {&g_.delta, n}, {&g_.err, n}, {&g_.fu, nk * n},
                          {&g_.poly, STAGES * n}, {&g_.b, nk * n}, {&g_.ab, nk * n}, {&g_.aab, nk * n}, {&g_.db, nk * n}, {&g_.c, nk * n}};
    size_t total = 1;
    for (const Part& x : parts) total += x.size;
    memory_.assign(total * LANES, 0.0);
    const size_t offset = reinterpret_cast<uintptr_t>(memory_.data()) / sizeof(double) % LANES;
    double* at = memory_.data() + (offset ? LANES - offset : 0);
    for (const Part& x : parts) {
        *x.at = at;
        at += x.size * LANES;
    }
    quarter_.assign(rows + 1, 0);
    active_.assign(nk + 1, 0);
    u_.assign(nk + 1, 0.0);
    slopes_.assign(nk + 1, 0.0);
    bends_.assign(nk + 1, 0.0);
    worst_.assign(nk + 1, 0.0);
    weights_.assign(1 + 3 * nk, 0.0);
    in_.resize(nk);
    hint_.assign(nk, -1);
    cursor_.resize(nk);
    g_.plan = &p;
    g_.quarter = quarter_.data();
    g_.active = active_.data();
    g_.u = u_.data();
    g_.slopes = slopes_.data();
    g_.bends = bends_.data();
    g_.rho = 0.1;
}

// A member's numbers into a lane.
void Group::fill(int lane, long member) {
    const Problem& p = s_.p;
    for (int j = 0; j < p.nc; ++j) g_.coef[j * LANES + lane] = g_.ceff[j * LANES + lane] = s_.coef[static_cast<size_t>(j) * s_.members + member];
    for (int j : p.timed)  // those that follow an input which does not change; the others are set with it
        g_.ceff[j * LANES + lane] *= p.inputs[p.coef_input[j]].at(s_.t0);
    g_.coef[p.nc * LANES + lane] = g_.ceff[p.nc * LANES + lane] = 0.0;
    g_.coef[(p.nc + 1) * LANES + lane] = g_.ceff[(p.nc + 1) * LANES + lane] = std::numeric_limits<double>::infinity();
    for (int i = 0; i < p.n; ++i) {
        g_.cap[i * LANES + lane] = g_.coef[p.capacity[i] * LANES + lane];
        g_.icap[i * LANES + lane] = 1.0 / g_.cap[i * LANES + lane];
        g_.Tn[i * LANES + lane] = s_.start[static_cast<size_t>(i) * s_.members + member];
        g_.poly[i * LANES + lane] = g_.Tn[i * LANES + lane];
    }
}

// Lanes whose numbers are no numbers are left to the integrator, which says why.
void Group::initial() {
    const Problem& p = s_.p;
    unsigned bad = 0;
    const LanePlan& plan = *g_.plan;
    for (int k = 0; k < plan.nk; ++k) u_[k] = input(k).at(t_);
    for (int j = 0; j < plan.ntimed; ++j)
        for (int l = 0; l < LANES; ++l) g_.ceff[plan.timed[j] * LANES + l] = g_.coef[plan.timed[j] * LANES + l] * u_[plan.timed_input[j]];
    for (int l = 0; l < LANES; ++l) {
        bool ok = true;
        for (int i = 0; i < p.n; ++i) {
            const double t = g_.Tn[i * LANES + l], c = g_.cap[i * LANES + l];
            ok = ok && std::isfinite(t) && t >= 0.0 && std::isfinite(c) && c > 0.0;
        }
        for (int j = 0; j < p.nc; ++j) ok = ok && std::isfinite(g_.coef[j * LANES + l]);
        for (int k = 0; k < p.nb; ++k) {
            const double t = g_.ceff[plan.gain[k] * LANES + l] + g_.ceff[plan.offset[k] * LANES + l];
            ok = ok && std::isfinite(t) && t >= 0.0;
        }
        if (!ok) bad |= 1u << l;
        low_[l] = high_[l] = g_.Tn[l];
    }
    if (bad) drop(bad);
    for (int r = p.kind_begin[POWER]; r < p.kind_begin[POWER + 1]; ++r) {
        quarter_[r] = 1;
        for (int l = 0; l < LANES; ++l) quarter_[r] = quarter_[r] && g_.ceff[p.con.c1[r] * LANES + l] == 0.25;
    }
}

// Gives lanes up: their members are left to the integrator, and a healthy lane's numbers take their place.
void Group::drop(unsigned lanes) {
    const unsigned keep = alive_ & ~lanes;
    for (int l = 0; l < count_; ++l)
        if ((alive_ & lanes) >> l & 1u) dropped.push_back(first_ + l);
    alive_ = keep & ((1u << count_) - 1) ? keep : 0;
    if (!alive_) {
        dropped.clear();
        for (int l = 0; l < count_; ++l) dropped.push_back(first_ + l);
        return;
    }
    int from = 0;
    while (!(alive_ >> from & 1u)) ++from;
    const size_t size = memory_.size() / LANES - 1;
    for (int l = 0; l < LANES; ++l)
        if (lanes >> l & 1u) {
            for (size_t k = 0; k < size; ++k) g_.coef[k * LANES + l] = g_.coef[k * LANES + from];
            low_[l] = low_[from];
            high_[l] = high_[from];
        }
    fails_ = 0;
}

}  // namespace thermid
