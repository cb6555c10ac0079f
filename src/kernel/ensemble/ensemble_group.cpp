// The steps of one group. The rules are those of Integrator::advance; the error is the largest over the lanes.
#include <algorithm>
#include <cmath>

#include "ensemble/ensemble.hpp"
#include "network/knees.hpp"

namespace thermid {

void Group::inputs_at(double s) {
    for (int k = 0; k < g_.plan->nk; ++k) {
        const Input& in = input(k);
        u_[k] = in.sampled() ? in_[k].at(s) : in.at(t_ + s);
    }
}

void Group::project() {
    leftover_ = false;
    for (int k = 0; k < g_.plan->nk; ++k) {
        worst_[k] = 0.0;
        active_[k] = 0;
        const Input& in = input(k);
        if (!in.sampled()) continue;
        worst_[k] = in_[k].project(in, t_, end_, hint_[k]);
        active_[k] = !in_[k].exact;
        leftover_ = leftover_ || active_[k];
    }
}

double Group::input_error() {
    double total = 0.0;
    for (int k = 0; k < g_.plan->nk; ++k) {
        if (!active_[k]) continue;
        total += s_.code.noise(g_, k) * 0.25 * g_.h * worst_[k];
        if (const double bend = s_.code.curvature(g_, k); bend > 0.0) total += bend * in_[k].variance;
    }
    return total;
}

double Group::first_step() const {
    const double span = s_.t_end - t_;
    double a = 0.0, b = 0.0;
    for (int i = 0; i < g_.plan->n * LANES; ++i)
        if (g_.cap[i] > -1e-3 * span * g_.J0[i]) {
            a = std::max(a, std::fabs(g_.d0[i]));
            b = std::max(b, std::fabs(g_.dd0[i]));
        }
    const double h = b > 0.0 ? 0.1 * a / b : 0.01 * span;
    return std::min(std::max(h, 1e-6 * span), 0.05 * span);
}

// A step did not succeed. Lanes that fail again and again are given up, so that they do not hold up the others.
bool Group::failed(unsigned lanes, double& next, double factor) {
    next = factor * g_.h;
    if (++fails_ >= 12 || t_ + next == t_ || next < 1e-9 * (s_.t_end - s_.t0)) {
        drop(lanes ? lanes : alive_);
        next = g_.h;
    }
    return false;
}

// A node that follows the others within a small part of a step would need the care that the integrator takes of it.
bool Group::too_fast(double& next) {
    const double most = leftover_ ? 1e4 : 1e2, span = s_.t_end - s_.t0;
    double fastest = 0.0;
    unsigned lanes = 0;
    for (int l = 0; l < LANES; ++l) {
        fastest = std::max(fastest, g_.lane[l]);
        if (g_.lane[l] * span > most * 5000.0) lanes |= 1u << l;
    }
    if (g_.h * fastest <= most) return false;
    if (lanes) drop(lanes);
    else next = 0.9 * most / fastest;
    return true;
}

unsigned Group::check_state() {
    unsigned bad = 0;
    for (int i = 0; i < g_.plan->n; ++i)
        for (int l = 0; l < LANES; ++l)
            if (const double t = g_.T1[i * LANES + l]; !(t > COLDEST && t < 1e5)) bad |= 1u << l;
    return bad;
}

// As Integrator::clear_of_knees, for the lane that needs it most.
bool Group::clear_of_knees(const double* tolerance, double& next) const {
    const LanePlan& p = *g_.plan;
    const double* last = g_.F + static_cast<size_t>(STAGES - 1) * p.n * LANES;
    double most = 1.0, wanted = 0.0;
    for (int l = 0; l < LANES; ++l) {
        Knee knee;
        auto sweep = [&](int i) -> Sweep {
            const int s = i * LANES + l;
            if (i >= p.n) {
                const double t0 = outer_[s - p.n * LANES], move = g_.T[s] - t0;
                return {t0, g_.T[s], move, move};
            }
            return {g_.Tn[s], g_.T1[s], g_.h * g_.d0[s], g_.h * g_.icap[s] * last[s]};
        };
        auto felt = [&](int i) {
            const int s = i * LANES + l;
            return i >= 0 && i < p.n ? g_.h / (g_.cap[s] + g_.h * std::fabs(g_.J0[s])) : 0.0;
        };
        auto c = [&](int k) { return g_.ceff[k * LANES + l]; };
        for (int r : s_.p.bent_loads) {
            const LaneLoad& x = p.loads[r];
            double own[4];
            for (int k = 0; k < 4; ++k) own[k] = c(x.c[k]);
            const Table* tables = s_.p.tables.data() + x.table;
            auto each = [&] { return felt(x.node); };
            if (LOAD_LAWS[x.kind].tables) knee.table(sweep(x.follows), *tables, [&] { return std::fabs(own[0]) * each(); });
            if (x.control != PROPORTIONAL) continue;
            const double power = load<double>(x.kind, -1, g_.T[x.follows * LANES + l], 0.0, own, nullptr, Tables{tables}, true, false).p;
            knee.heater(sweep(x.sensor), c(x.d[0]), c(x.d[1]), c(x.d[2]), power, each);
        }
        for (int r : s_.p.bent_conductors) {
            const LaneRow& x = p.rows[r];
            knee.conductor(x.kind, sweep(x.a), sweep(x.b), c(x.c0), c(x.c1), s_.p.tables.data() + x.table, [&] { return std::max(felt(x.from), felt(x.to)); });
        }
        if (!(knee.error > most * tolerance[l])) continue;
        most = knee.error / tolerance[l];
        wanted = knee.retry(g_.h, tolerance[l]);
    }
    if (most <= 1.0 || t_ + wanted == t_ || wanted < 1e-9 * (s_.t_end - s_.t0)) return true;
    next = wanted;
    return false;
}

bool Group::attempt(double& next) {
    const LaneCode& code = s_.code;
    g_.h = end_ - t_;
    project();
    inputs_at(0.0);
    for (int k = 0; k < g_.plan->nk; ++k) {
        const bool sampled = input(k).sampled();
        slopes_[k] = sampled ? in_[k].slope(0.0) : input(k).slope(t_);
        bends_[k] = sampled ? 2.0 * in_[k].p2 : 0.0;
    }
    code.start(g_);
    if (s_.p.knees()) outer_.assign(g_.T + g_.plan->n * LANES, g_.T + (g_.plan->n + g_.plan->nb) * LANES);
    if (g_.bad) {
        drop(g_.bad);
        return false;
    }
    if (!begun_) {
        begun_ = true;
        next = first_step();
        return false;
    }
    if (too_fast(next)) return false;
    const double left = leftover_ ? input_error() : 0.0;
    if (left > s_.options.input_atol) {
        hold_ = g_.h * std::max(0.2, 0.8 * std::pow(s_.options.input_atol / left, 0.4));
        return false;
    }
    double tolerance[LANES], least = std::numeric_limits<double>::infinity();
    for (int l = 0; l < LANES; ++l) {
        const double tol = s_.options.atol + s_.options.rtol * (high_[l] - low_[l]);
        tolerance[l] = leftover_ ? std::max(tol, 0.25 * s_.options.input_atol) : tol;
        least = std::min(least, tolerance[l]);
    }
    g_.close = std::min(5e-7, std::max(2e-10, 5e-2 * least));
    code.matrix(g_);
    if (g_.bad) return failed(g_.bad, next, 0.25);
    for (int s = 1; s < STAGES; ++s) {
        inputs_at(NODE[s] * g_.h);
        if (!code.stage(g_, s)) return failed(g_.bad, next, 0.25);
    }
    double err = 0.0;
    const auto too_long = [&] {
        unsigned guilty = 0;
        for (int l = 0; l < LANES; ++l) {
            const double e = g_.lane[l] / tolerance[l];
            if (!(e <= 1.0)) guilty |= 1u << l;
            err = e <= err ? err : e;
        }
        if (guilty) failed(guilty, next, std::isfinite(err) ? std::max(0.2, 0.9 * std::pow(err, -0.25)) : 0.2);
        return guilty != 0;
    };
    code.error(g_);
    if (too_long()) return false;
    if (s_.p.knees() && !clear_of_knees(tolerance, next)) return false;
    if (leftover_) code.improve(g_);
    if (const unsigned bad = check_state()) {
        drop(bad);
        return false;
    }
    if (turnings_.on() || s_.times[out_next_] <= end_) {
        dense();
        code.apart(g_);
        for (double& each : tolerance) each = leftover_ ? std::max(each, s_.options.input_atol) : each;
        if (too_long()) return false;
    }
    fails_ = 0;
    // As in Integrator::attempt; of the worst of eight members, chance makes less, so that a step answers a little more.
    const double wish = leftover_ && err > 1e-3 ? std::pow(err, -0.07) : std::pow(std::max(err, 1e-6), -0.175) * std::pow(old_error_, 0.1);
    next = g_.h * std::min(5.0, std::max(0.2, 0.9 * wish));
    old_error_ = std::max(err, 1e-3);
    if (leftover_)
        hold_ = left > 0.0 ? g_.h * std::min(2.0, 0.8 * std::pow(s_.options.input_atol / left, 0.4)) : 2.0 * g_.h;
    else if (hold_ < std::numeric_limits<double>::infinity())
        hold_ *= 1.02;
    return true;
}

void Group::dense() {
    inputs_at(g_.h);
    for (int k = 0; k < g_.plan->nk; ++k) {
        const Input& in = input(k);
        slopes_[k] = in.sampled() ? in_[k].slope(g_.h) : in.slope(end_);
        if (in.sampled()) cursor_[k].begin(&in, t_);
    }
    s_.code.dense(g_);
}

static double snapped(double h) {
    int exponent;
    const double digits = std::frexp(h, &exponent);  // 0.5 to 1
    return std::ldexp(std::floor(digits * 64.0) / 64.0, exponent);
}

// Where the next step is to end: by its own error, what is left of the inputs, and the next jump.
void Group::choose(double& next) {
    while (s_.stops[stop_] <= t_) ++stop_;
    const double room = s_.stops[stop_] - t_;
    clipped_ = false;
    double knot = -1.0, h = wish_ = std::min(next, s_.limit);
    if (hold_ < h) {
        knot = std::numeric_limits<double>::infinity();
        for (int k = 0; k < g_.plan->nk; ++k)
            if (input(k).sampled()) knot = std::min(knot, input(k).next_knot(t_, hint_[k]));
        h = hold_ < 2.0 * (knot - t_) ? std::min(h, knot - t_) : hold_;
        clipped_ = h < wish_;
    }
    // Lengths with five binary digits: rounding that differs between instruction sets is forgotten from step to step.
    if (h != knot - t_) h = snapped(h);
    end_ = h == knot - t_ ? knot : t_ + h;
    if (h > room || (h > 0.99 * room && end_ != knot)) {  // a jump between that knot and the stop has a step of its own
        clipped_ = clipped_ || h > room;
        end_ = s_.stops[stop_];
    } else if (h > 0.5 * room && end_ != knot) {
        end_ = t_ + 0.5 * room;  // no tiny step before a break
        clipped_ = true;
    }
}

// What is left over of the inputs at a time of the step that began at origin_.
void Group::weigh(double time) {
    const double s = time - origin_;
    weights_[0] = s;
    for (int k = 0; k < g_.plan->nk; ++k) {
        if (!active_[k]) continue;
        cursor_[k].move(time);
        weights_[1 + 3 * k] = in_[k].w(s, cursor_[k].sum);
        weights_[2 + 3 * k] = in_[k].ww(s, cursor_[k].sum);
        weights_[3 + 3 * k] = in_[k].www(s, cursor_[k].sum);
    }
}

void Group::emit(long from, long last, double* out) {
    const size_t nobs = s_.observed.size();
    for (; out_next_ < last && s_.times[out_next_] <= end_; ++out_next_) {
        const double time = s_.times[out_next_], x = g_.h > 0.0 ? (time == end_ ? 1.0 : (time - origin_) / g_.h) : 0.0;
        weigh(time);
        s_.code.output(g_, x, weights_.data(), s_.observed.data(), static_cast<int>(nobs), out + (out_next_ - from) * nobs * LANES);
    }
}

// Turning points inside the step just made, as Integrator::turnings_end; nodes of the lane code all have a delay.
void Group::turn() {
    const int m = g_.plan->n * LANES, nobs = static_cast<int>(s_.observed.size()), columns = nobs * LANES;
    double rate = 0.0, moved = 0.0;
    for (int k = 0; leftover_ && k < g_.plan->nk; ++k) {
        if (!active_[k]) continue;
        const double b = strongest(k), spread = g_.h * std::sqrt(in_[k].variance);
        const double most = b * spread < 0.1 * Turnings::NOISE ? 2.0 * spread / g_.h : input(k).furthest(in_[k], origin_, end_, hint_[k]);
        rate += b * most;
        moved += b * std::min(0.5 * g_.h * most, spread);
    }
    if (moved < Turnings::NOISE) {
        for (int j = 0, many = 1; j < nobs; j += many) {  // nodes that stand side by side at once
            const int i = s_.observed[j];
            for (many = 1; j + many < nobs && s_.observed[j + many] == i + many;) ++many;
            turnings_.see_polynomials(j * LANES, many * LANES, g_.poly + i * LANES, m, origin_, g_.h, end_, g_.T1 + i * LANES);
        }
        return;
    }
    std::vector<double>& at = seen_times_;
    at.clear();
    double bend = 0.0;
    for (int i : s_.observed) bend = std::max(bend, Turnings::most_bent(g_.poly + i * LANES, m, LANES));
    const double gap = Turnings::gap(rate, bend / (g_.h * g_.h));
    for (int k = 0; k < g_.plan->nk; ++k)
        if (active_[k]) input(k).knots(origin_, end_, at, gap);
    std::sort(at.begin(), at.end());
    turnings_.among_outputs(at, out_next_, end_, gap);
    seen_.resize(at.size() * columns);
    for (size_t r = 0; r < at.size(); ++r) {
        weigh(at[r]);
        s_.code.output(g_, at[r] == end_ ? 1.0 : (at[r] - origin_) / g_.h, weights_.data(), s_.observed.data(), nobs, seen_.data() + r * columns);
    }
    turnings_.see_rows(at.data(), static_cast<long>(at.size()), seen_.data());
    for (int k = 0; k < g_.plan->nk; ++k)  // the outputs of the step begin at its start again
        if (input(k).sampled()) cursor_[k].begin(&input(k), origin_);
}

// The fastest that an input moves an observed node. [K/s per unit]
double Group::strongest(int k) const {
    const double* b = g_.b + static_cast<size_t>(k) * g_.plan->n * LANES;
    double most = 0.0;
    for (int i : s_.observed) most = std::max(most, Turnings::steepest(b + i * LANES, LANES));
    return most;
}

const std::vector<Turnings::Point>& Group::turnings() {
    if (turnings_.on()) turnings_.end();
    return turnings_.found;
}

void Group::advance(long from, long last, double* out, const std::atomic<bool>& stop) {
    if (!begun_) {
        initial();
        if (s_.options.turnings) turnings_.begin(static_cast<int>(s_.observed.size()) * LANES, s_.times.data(), static_cast<long>(s_.times.size()));
        end_ = s_.t_end;
        g_.h = 0.0;
        origin_ = t_;
        const double whole = end_;
        end_ = t_;  // outputs at the start
        emit(from, last, out);
        end_ = whole;
    } else if (alive_) {
        emit(from, last, out);
    }
    const bool watch = turnings_.on();
    const auto open = [&] { return out_next_ < last || (watch && last == static_cast<long>(s_.times.size())); };
    while (alive_ && open() && t_ < s_.t_end) {
        if (stop) return;
        if (steps + rejected >= s_.options.max_steps) return drop(alive_);
        if (begun_) choose(next_);
        if (!attempt(next_)) {
            if (begun_) ++rejected;
            continue;
        }
        ++steps;
        if (clipped_) next_ = std::max(next_, wish_);
        origin_ = t_;
        if (watch) turn();
        for (int i = 0; i < g_.plan->n; ++i)
            for (int l = 0; l < LANES; ++l) {
                low_[l] = std::min(low_[l], g_.T1[i * LANES + l]);
                high_[l] = std::max(high_[l], g_.T1[i * LANES + l]);
            }
        std::swap(g_.Tn, g_.T1);
        t_ = end_;
        emit(from, last, out);
    }
}

}  // namespace thermid
