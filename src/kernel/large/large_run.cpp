// The run around the steps: inputs of a step, step control, outputs.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"
#include "network/knees.hpp"
#include "large/large.hpp"

namespace thermid {

namespace {
constexpr double HOTTEST = 1e6;  // [K]
constexpr int MOST_KINKS = 200;
constexpr double MOST_STAGES = 5000.0;  // of a step of RKC2
constexpr long POLL_CELLS = 20000000;
constexpr int PARTS = 2;  // of a step, where a largest or smallest temperature is looked at
}  // namespace

LargeRun::LargeRun(const LargeProblem& p, const LargeOptions& o)
    : p_(p), o_(o), n_(p.n), inverse_c_(p.n), settles_(p.n), link_sum_(p.n), T_(p.links), T1_(p.links), G_(p.n), G1_(p.n), u_(p.inputs.size()),
      in_(p.inputs.size()), hint_(p.inputs.size(), -1), start_(p), rows_(p), energy_(p.tags + p.nb), gain_(p.tags + p.nb) {
    for (int i = 0; i < n_; ++i) {
        if (p.capacity[i] == 0.0) massless_.push_back(i);
        inverse_c_[i] = p.capacity[i] > 0.0 ? 1.0 / p.capacity[i] : 0.0;
        settles_[i] = p.capacity[i] > 0.0 ? 1.0 / p.heavy[i] : 0.0;
    }
    for (const RowGroup& g : p.rows) linear_ = linear_ && is(g.kind, STRAIGHT);
    for (const LoadGroup& g : p.loads) linear_ = linear_ && g.kind == SIGNAL && g.control < 0;
    linear_ = linear_ && p.stored.empty();
    if (!p.stored.empty()) warm_ = Field(p.links);
    p.links.sums(link_sum_.data());
}

void LargeRun::fail(int status) { throw Failure{status, r_->node}; }

void LargeRun::polled() {
    since_poll_ += n_;
    if (since_poll_ < POLL_CELLS) return;
    since_poll_ = 0;
    if (o_.poll) o_.poll();
}

void LargeRun::inputs_at(double s) {
    for (size_t k = 0; k < u_.size(); ++k) u_[k] = p_.inputs[k].sampled() ? in_[k].at(s) : p_.inputs[k].at(t_ + s);
}

void LargeRun::begin_inputs() {
    for (size_t k = 0; k < u_.size(); ++k)
        if (p_.inputs[k].sampled()) in_[k].project(p_.inputs[k], t_, t_ + h_, hint_[k]);
}

// The error inside a step that what is left of a sampled input causes, relative to its tolerance. A node feels it through its rate times
// the integral of the left-over, and never by more than three times its root mean square; a massless one at once. At the end of the
// step three moments agree, so that nothing is left of it there.
double LargeRun::leftover() {
    double worst = 0.0;
    for (size_t k = 0; k < u_.size(); ++k) {
        if (!p_.inputs[k].sampled() || in_[k].exact) continue;
        Cursor c;
        c.begin(&p_.inputs[k], t_);
        double w = 0.0;
        for (int q = 1; q < 8; ++q) {
            const double s = h_ * q / 8.0;
            c.move(t_ + s);
            w = std::max(w, std::fabs(in_[k].w(s, c.sum)));
        }
        const double most = 3.0 * std::sqrt(in_[k].variance);
        const double scale = std::max(std::fabs(u_[k]), 1e-300);
        auto felt = [&](int node, int place, double heat) {  // heat per unit of the input
            const double all = std::max(link_sum_[node] + start_.slope[place], heat);
            const double at_once = all > 0.0 ? heat / all * most : 0.0, slowly = heat * inverse_c_[node] * w;
            worst = std::max(worst, p_.capacity[node] > 0.0 ? std::min(slowly, at_once) : at_once);
        };
        for (const RowGroup& g : p_.rows) {
            const bool by_boundary = g.boundary >= 0 && p_.boundary_input[g.boundary] == static_cast<int>(k);
            if (!by_boundary && g.input != static_cast<int>(k)) continue;
            for (int r = g.begin; r < g.end; ++r) {
                const double heat = by_boundary ? std::fabs(start_.pair[r]) : std::fabs(start_.q[r]) / scale;
                felt(p_.a[r], p_.a_slot[r], heat);
                if (g.boundary < 0) felt(p_.b[r], p_.b_slot[r], heat);
            }
        }
        for (const LoadGroup& g : p_.loads)
            if (g.input == static_cast<int>(k))
                for (int r = g.begin; r < g.end; ++r) felt(p_.node[r], p_.node_slot[r], std::fabs(p_.c[0][r]));
    }
    return worst / o_.input_atol;
}

void LargeRun::gather(RowHeat& rows, const double* t) const {
    for (size_t k = 0; k < p_.special.size(); ++k) rows.t[k] = t[p_.special[k]];
}

// Temperature of a node from its state, and its slope.
double LargeRun::warm(size_t i, double state, double* slope) const {
    if (slope) *slope = 1.0;
    if (p_.store.empty() || p_.store[i] < 0) return state;
    double t, rise;
    p_.tables[p_.store[i]].eval(state, t, rise);
    if (slope) *slope = rise;
    return t;
}

const Field& LargeRun::warm(const Field& state) {
    if (p_.stored.empty()) return state;
    std::copy(state.data(), state.data() + n_, warm_.data());
    for (int i : p_.stored) warm_[i] = warm(i, state[i]);
    return warm_;
}

void LargeRun::full_rate(const Field& at, RowHeat& rows, std::vector<double>& g) {
    const Field& t = warm(at);
    gather(rows, t.data());
    rows.evaluate(p_, u_.data(), true);
    p_.links.flow(t.data(), g.data());
    for (size_t k = 0; k < p_.special.size(); ++k) g[p_.special[k]] += rows.heat[k];
    for (int i = 0; i < n_; ++i) g[i] *= inverse_c_[i];
}

// The inputs of this step at its start may differ from those at the end of the last one: rows again, links as they are.
void LargeRun::refresh_start() {
    inputs_at(0.0);
    rows_.t = start_.t;
    rows_.evaluate(p_, u_.data(), true);
    for (size_t k = 0; k < p_.special.size(); ++k) G_[p_.special[k]] += inverse_c_[p_.special[k]] * (rows_.heat[k] - start_.heat[k]);
    std::swap(start_, rows_);
}

double LargeRun::first_step() {
    double fastest = 0.0;
    for (int i = 0; i < n_; ++i) fastest = std::max(fastest, std::fabs(G_[i]));
    const double span = t_end_ - t_, by_rate = 1.0 / std::max(row_rate() + link_rate_, 1.0 / span);
    return std::min({o_.max_step, span, std::max(std::min(o_.tolerance / std::max(fastest, 1e-300), 0.1 * span), 0.25 * by_rate)});
}

// Cubic Hermite over the step: weights of the temperatures and rates at its ends.
Hermite LargeRun::hermite(double s) const {
    const double x = s / h_, y = 1.0 - x, bend = x * y * (y - x);
    return {y + bend, x - bend, x * y * y * h_, -x * x * y * h_, s};
}

// Temperature of a boundary at a time since the step's start, as the step has it.
double LargeRun::outer(size_t k, double s) const {
    const int u = p_.boundary_input[k];
    return p_.boundary_offset[k] + (u < 0 ? 0.0 : p_.inputs[u].sampled() ? in_[u].at(s) : p_.inputs[u].at(t_ + s));
}

// Temperature, or from n on level, of a node at the weights of a time; from 2 n on of a boundary.
double LargeRun::seen(size_t i, const Hermite& w) const {
    const size_t n = n_;
    return i < n ? warm(i, between(i, w)) : i < 2 * n ? between(i - n, w) : outer(i - 2 * n, w.s);
}

// Of all nodes.
Summary LargeRun::whole(const Hermite& w) const {
    if (p_.stored.empty()) return summary(T_.data(), T1_.data(), G_.data(), G1_.data(), n_, w);
    Summary s;
    for (int i = 0; i < n_; ++i) {
        const double v = seen(i, w);
        s.sum += v;
        s.low = std::min(s.low, v);
        s.high = std::max(s.high, v);
    }
    return s;
}

// What is observed, at the weights of a time; over all nodes, `whole` is theirs.
double LargeRun::observed(const Observed& what, int k, const Hermite& w, const Summary* all) const {
    const int from = what.indptr[k], to = what.indptr[k + 1];
    Summary s;
    if (from == to) {
        s = all ? *all : whole(w);
        s.sum /= n_;
    }
    for (int j = from; j < to; ++j) {
        const double v = seen(what.indices[j], w);
        s.sum += what.weights[j] * v;
        s.low = std::min(s.low, v);
        s.high = std::max(s.high, v);
    }
    return what.kind[k] == 0 ? s.sum : (what.kind[k] == 1 ? s.high : s.low);
}

void LargeRun::write(const std::vector<double>& times, size_t& next, const Observed& seen, double until) {
    for (; next < times.size() && times[next] <= until; ++next) {
        const Hermite w = hermite(times[next] - t_);
        Summary all;
        bool known = false;
        for (int k = 0; k < seen.size(); ++k) {
            if (seen.indptr[k] == seen.indptr[k + 1] && !known) {
                all = whole(w);
                known = true;
            }
            r_->traces[next * seen.size() + k] = observed(seen, k, w, &all);
        }
    }
}

void LargeRun::write_fields(const std::vector<double>& times, size_t& next, double until) {
    for (; next < times.size() && times[next] <= until; ++next) {
        const Hermite w = hermite(times[next] - t_);
        for (int i = 0; i < n_; ++i) r_->fields[next * n_ + i] = seen(i, w);
    }
}

// Turning points of what is observed inside the step just made: of a weighted sum those of its cubic, of a largest or smallest those of
// parabolas through samples.
void LargeRun::turn(const Observed& seen, double reached) {
    Summary whole[PARTS + 1];  // of all nodes, shared by those that read it
    bool known = false;
    for (int k = 0; k < seen.size(); ++k) {
        const int from = seen.indptr[k], to = seen.indptr[k + 1];
        bool smooth = true, noisy = false;
        for (int j = from; j < to; ++j) {
            const int i = seen.indices[j], b = i - 2 * n_;
            if (b < 0) smooth = smooth && (p_.stored.empty() || (i < n_ && p_.store[i] < 0));
            else if (const int u = p_.boundary_input[b]; u >= 0) noisy = noisy || (p_.inputs[u].sampled() && !in_[u].exact);
        }
        if (noisy) {
            turn_among_knots(seen, k, reached);
            continue;
        }
        if (seen.kind[k] == 0 && from < to && smooth) {
            double y0 = 0.0, y1 = 0.0, d0 = 0.0, d1 = 0.0;
            for (int j = from; j < to; ++j) {
                const double w = seen.weights[j];
                const int i = seen.indices[j], b = i - 2 * n_, u = b < 0 ? -1 : p_.boundary_input[b];
                auto slope = [&](double s) { return u < 0 ? 0.0 : p_.inputs[u].sampled() ? in_[u].slope(s) : p_.inputs[u].slope(t_ + s); };
                y0 += w * (b < 0 ? T_[i] : outer(b, 0.0));
                y1 += w * (b < 0 ? T1_[i] : outer(b, h_));
                d0 += w * h_ * (b < 0 ? G_[i] : slope(0.0));
                d1 += w * h_ * (b < 0 ? G1_[i] : slope(h_));
            }
            const double c[] = {y0, d0, 3.0 * (y1 - y0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (y1 - y0), 0.0, 0.0};
            turnings_.see_polynomial(k, c, 1, t_, h_, reached, y1);
            continue;
        }
        double at[PARTS + 1], y[PARTS + 1];
        for (int q = 0; q <= PARTS; ++q) {
            const Hermite w = hermite(h_ * q / PARTS);
            if (from == to && !known) whole[q] = summary(T_.data(), T1_.data(), G_.data(), G1_.data(), n_, w);
            at[q] = q == PARTS ? reached : t_ + h_ * q / PARTS;
            y[q] = observed(seen, k, w, &whole[q]);
        }
        known = known || from == to;
        turnings_.see(k, at[0], y[0]);
        for (int q = 2; q <= PARTS; q += 2) turnings_.see_three(k, at[q - 2], y[q - 2], at[q - 1], y[q - 1], at[q], y[q]);
    }
}

// Of a sum with boundaries that are logs with noise: at every knot, and what the logs have there in place of what stands for them in the step.
void LargeRun::turn_among_knots(const Observed& seen, int k, double reached) {
    std::vector<double> times{t_, t_ + 0.5 * h_, reached};
    for (int j = seen.indptr[k]; j < seen.indptr[k + 1]; ++j) {
        const int b = seen.indices[j] - 2 * n_, u = b < 0 ? -1 : p_.boundary_input[b];
        if (u >= 0 && p_.inputs[u].sampled()) p_.inputs[u].knots(t_, t_ + h_, times);
    }
    std::sort(times.begin(), times.end());
    for (double t : times) {
        double sum = 0.0;
        for (int j = seen.indptr[k]; j < seen.indptr[k + 1]; ++j) {
            const int i = seen.indices[j], b = i - 2 * n_, u = b < 0 ? -1 : p_.boundary_input[b];
            const bool logged = u >= 0 && p_.inputs[u].sampled() && !in_[u].exact;
            sum += seen.weights[j] * (logged ? p_.boundary_offset[b] + p_.inputs[u].at(t) : this->seen(i, hermite(t - t_)));
        }
        turnings_.see(k, t, sum);
    }
}

// As Integrator::clear_of_knees, with the inertia of the node itself: what it gets its neighbours take up the sooner the less it has.
bool LargeRun::clear_of_knees(double& next) {
    Knee knee;
    u0_.resize(u_.size());
    inputs_at(0.0);
    u0_.swap(u_);
    inputs_at(h_);
    auto state = [&](int i) -> Sweep {
        const double move = T1_[i] - T_[i];
        return p_.capacity[i] > 0.0 ? Sweep{T_[i], T1_[i], h_ * G_[i], h_ * G1_[i]} : Sweep{T_[i], T1_[i], move, move};
    };
    auto sweep = [&](int i) -> Sweep {
        Sweep s = state(i);
        if (p_.store.empty() || p_.store[i] < 0) return s;
        double before, after;
        s.t0 = warm(i, s.t0, &before);
        s.t1 = warm(i, s.t1, &after);
        return {s.t0, s.t1, before * s.a, after * s.b};
    };
    auto outer = [&](int b) -> Sweep {
        const int k = p_.boundary_input[b];
        const double from = p_.boundary_offset[b] + (k >= 0 ? u0_[k] : 0.0), to = p_.boundary_offset[b] + (k >= 0 ? u_[k] : 0.0);
        return {from, to, to - from, to - from};
    };
    auto felt = [&](int i) { return h_ / (p_.heavy[i] + h_ * link_sum_[i]); };
    for (const LoadGroup& g : p_.loads) {
        if (!g.bent) continue;
        const double f = g.input >= 0 ? u_[g.input] : 1.0;
        const Table* table = p_.tables.data() + g.table;
        for (int r = g.begin; r < g.end; ++r) {
            const int i = p_.node[r];
            auto each = [&] { return felt(i); };
            if (LOAD_LAWS[g.kind].tables) knee.table(sweep(i), *table, [&] { return std::fabs(f * p_.c[0][r]) * each(); });
            if (g.control != PROPORTIONAL) continue;
            const double c[4] = {f * p_.c[0][r], p_.c[1][r], p_.c[2][r], p_.c[3][r]};
            const double power = load<double>(g.kind, -1, warm(i, T1_[i]), 0.0, c, nullptr, Tables{table}, true, false).p;
            knee.heater(sweep(i), p_.d[0][r], p_.d[1][r], std::isnan(p_.d[2][r]) ? c[0] : p_.d[2][r], power, each);
        }
    }
    for (const RowGroup& g : p_.rows) {
        if (!g.bent) continue;
        const double f = g.input >= 0 ? u_[g.input] : 1.0;
        for (int r = g.begin; r < g.end; ++r) {
            const int i = p_.a[r], j = p_.b[r];
            knee.conductor(g.kind, sweep(i), g.boundary < 0 ? sweep(j) : outer(g.boundary), f * p_.c0[r], g.c1, p_.tables.data() + g.table,
                           [&] { return g.boundary < 0 ? std::max(felt(i), felt(j)) : felt(i); });
        }
    }
    row_rate();
    for (size_t k = 0; k < p_.stored.size(); ++k) {  // where its heat passes a knee, its neighbours see another temperature
        const int i = p_.stored[k], place = p_.stored_slot[k];
        auto each = [&] { return felt(i) * (link_sum_[i] + (place >= 0 ? std::fabs(rates_[place]) : 0.0)); };
        knee.table(state(i), p_.tables[p_.store[i]], each);
    }
    if (knee.error <= o_.tolerance) return true;
    const double wanted = knee.retry(h_, o_.tolerance);
    if (t_ + wanted == t_ || wanted < 1e-9 * (t_end_ - t_)) return true;
    next = wanted;
    return false;
}

// Tries a step of length h_; true when it is accepted. `next`: the length to try afterwards.
bool LargeRun::advance(double end, double& next) {
    h_ = std::min({next, o_.max_step, end - t_});
    if (end - t_ - h_ < 1e-9 * (end - t_)) h_ = end - t_;
    else if (end - t_ < 2.0 * h_) h_ = 0.5 * (end - t_);  // no sliver before a break
    if (r_->method == RKC2) {  // given up at once where steps of so many stages would be too many
        const double longest = MOST_STAGES * MOST_STAGES / (1.54 * std::max(row_rate() + link_rate_, 1e-300));
        if ((t_end_ - t_) / longest > static_cast<double>(o_.max_steps)) fail(MAX_STEPS);
        if (h_ > longest) h_ = longest;
    }
    const double least = 1e-13 * std::max(std::fabs(t_), t_end_ - t_);
    for (begin_inputs(); leftover() > 1.0; begin_inputs()) {
        h_ *= 0.5;
        next = h_;
        if (h_ < least) fail(STEP_UNDERFLOW);
    }
    refresh_start();
    const double error = r_->method == RKC2 ? rkc() : trbdf();
    const double order = 1.0 / 3.0;
    if (!(error <= 1.0)) {
        ++r_->rejected;
        rejected_ = true;
        next = h_ * (std::isfinite(error) ? std::max(0.1, 0.8 * std::pow(error, -order)) : 0.1);
        if (next < least || next < 1e-9 / std::max(r_->rate, 1.0 / (t_end_ - t_))) fail(std::isfinite(error) ? STEP_UNDERFLOW : NON_FINITE);
        return false;
    }
    if (p_.knees && !clear_of_knees(next)) {
        ++r_->rejected;
        return false;
    }
    double grow = 0.8 * std::pow(std::max(error, 1e-10), -order);
    if (error > 1e-10 && r_->steps > 0) grow = std::min(grow, grow * std::pow(old_error_ / error, order) + 0.5);
    next = h_ * std::min(rejected_ ? 1.0 : 10.0, std::max(0.2, grow));
    old_error_ = std::max(error, 1e-10);
    rejected_ = false;
    for (int i = 0; i < n_; ++i)
        if (!(T1_[i] > COLDEST && T1_[i] < HOTTEST)) {
            r_->node = i;
            fail(RUN_AWAY);
        }
    return true;
}

// At the start, at a jump and at the end: massless nodes at the inputs' values from now on.
void LargeRun::settle() {
    for (size_t k = 0; k < u_.size(); ++k) u_[k] = p_.inputs[k].at(t_);
    full_rate(T_, start_, G_);
    if (r_->method == AUTO) choose();
    if (massless_.empty()) return;
    if (!settle_massless()) fail(SINGULAR_NODE);
    full_rate(T_, start_, G_);
}

void LargeRun::run(const double* t0_nodes, double t0, double t_end, const std::vector<double>& times, const Observed& seen,
                   const std::vector<double>& field_times, LargeResult& r) {
    r_ = &r;
    t_ = t0;
    t_end_ = t_end;
    std::vector<double> stops(o_.breaks);
    stops.push_back(t_end);
    std::vector<double> kinks;  // of sampled inputs, where they are few: steps end there
    for (const Input& in : p_.inputs) in.breaks(t0, t_end, MOST_KINKS, kinks);
    kinks.push_back(t_end);
    std::sort(kinks.begin(), kinks.end());
    size_t next_time = 0, next_field = 0, kink = 0;
    if (o_.turnings) turnings_.begin(seen.size(), times.data(), static_cast<long>(times.size()));
    try {
        for (int i = 0; i < n_; ++i) {
            T_[i] = t0_nodes[i];
            if (!(T_[i] >= 0.0 && T_[i] < HOTTEST)) {
                r.node = i;
                fail(BAD_INPUT);
            }
        }
        double next = 0.0;
        for (double stop : stops) {
            if (stop <= t_ && t_ < t_end) continue;
            settle();
            if (h_ > 0.0) {  // what waited for the jump
                write(times, next_time, seen, t_);
                write_fields(field_times, next_field, t_);
            }
            if (stop > t_) next = first_step();
            while (t_ < stop) {
                if (r.steps + r.rejected >= o_.max_steps) fail(MAX_STEPS);
                while (kinks[kink] <= t_ && kinks[kink] < t_end) ++kink;
                const double until = std::min(stop, kinks[kink]);
                if (!advance(until, next)) continue;
                ++r.steps;
                r.longest = std::max(r.longest, h_);
                for (size_t k = 0; k < massless_.size(); ++k) {  // a parabola through the stages
                    const int i = massless_[k];
                    G_[i] = (T1_[i] - T_[i] + bend_[k]) / h_;
                    G1_[i] = (T1_[i] - T_[i] - bend_[k]) / h_;
                }
                const double reached = h_ == until - t_ ? until : t_ + h_;
                const double now = reached == stop ? std::nextafter(stop, t_) : reached;  // at a jump: after it
                const bool due = (next_time < times.size() && times[next_time] <= now) ||
                                 (next_field < field_times.size() && field_times[next_field] <= now);
                if ((due || o_.turnings) && r.method == TRBDF2) draw_parabolas();
                if (o_.turnings) turn(seen, reached);
                write(times, next_time, seen, now);
                write_fields(field_times, next_field, now);
                if ((due || o_.turnings) && r.method == TRBDF2) restore_slopes();
                for (size_t k = 0; k < energy_.size(); ++k) energy_[k] += gain_[k];
                t_ = reached;
                T_.swap(T1_);
                G_.swap(G1_);
                std::swap(start_, rows_);
            }
        }
        if (!massless_.empty()) settle();
        h_ = 1.0;  // what is asked for at the very end, or of a run without duration
        for (int i = 0; i < n_; ++i) T1_[i] = T_[i];
        std::fill(G_.begin(), G_.end(), 0.0);
        std::fill(G1_.begin(), G1_.end(), 0.0);
        write(times, next_time, seen, t_);
        write_fields(field_times, next_field, t_);
    } catch (const Failure& f) {
        r.status = f.status;
        r.node = f.node;
    }
    if (o_.turnings) turnings_.end();
    r.turnings.swap(turnings_.found);
    r.time = t_;
    r.final_state.assign(T_.data(), T_.data() + n_);
    const Field& last = warm(T_);
    r.final_t.assign(last.data(), last.data() + n_);
    r.load_energy.assign(energy_.begin(), energy_.begin() + p_.tags);
    r.boundary_energy.assign(energy_.begin() + p_.tags, energy_.end());
}

}  // namespace thermid
