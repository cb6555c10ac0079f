// Thermostats and machines: find the instant of a switching on the dense output, end the step there, and let the sensitivities jump.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"

namespace thermid {

// Positive once a guard is passed; temperatures and coefficients of outputs_.view. Below every number while its machine is in another state.
double Integrator::gap(const Guard& g, double time) const {
    if (outputs_.view.on[g.machine] != g.from) return -std::numeric_limits<double>::infinity();
    if (g.delay >= 0) return time - state_.entered[g.machine] - outputs_.view.ceff[g.delay];
    return g.sign * (outputs_.view.probe(g.of) - outputs_.view.ceff[g.level]);
}

double Integrator::gap_at(int l, double s) {
    outputs_.nodes_at(s, sensor_slaved_);
    return gap(p_.guards[l], s == step_.h ? step_.end : state_.t + s);
}

// d gap / dt at the end of the step.
double Integrator::gap_rate(const Guard& g) const {
    if (g.delay >= 0) return 1.0;
    auto follow = [&](int c) { return c < p_.nc && p_.coef_input[c] >= 0 ? coef_[c] * step_.uder1[p_.coef_input[c]] : 0.0; };
    double rate = follow(g.of.c0) - follow(g.level);
    for (int k = 0; k < 3; ++k) {
        const int i = g.of.node[k];
        if (i < 0) continue;
        rate += outputs_.view.ceff[g.of.c[k]] * (i < n_ ? step_.d1[i] : follow(p_.gain[i - n_]) + follow(p_.offset[i - n_])) + follow(g.of.c[k]) * outputs_.view.t[i];
    }
    return g.sign * rate;
}

// At the start, unless given: a thermostat is on at or below its lower threshold, a machine in its first state. outputs_.view holds the initial temperatures.
// What is due at once happens: a massless node feels its heater at once, so what its sensor then says may switch again, before anything is seen.
void Integrator::decide() {
    auto given = [&](int l) { return o_.on.empty() ? -1 : o_.on[l]; };
    for (int l : p_.thermostats)
        if (!(outputs_.view.ceff[p_.control.c[0][l]] < outputs_.view.ceff[p_.control.c[1][l]])) throw Failure{BAD_INPUT, p_.control.node[l]};
    for (int l = 0; l < p_.switches(); ++l)
        if (given(l) >= 0) outputs_.view.on[l] = static_cast<uint8_t>(given(l));
    for (int l : p_.thermostats)
        if (given(l) < 0) outputs_.view.on[l] = outputs_.view.t[p_.control.sensor[l]] <= outputs_.view.ceff[p_.control.c[0][l]];
    for (size_t k = 0;; ++k) {
        if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, outputs_.view);
        const auto due = std::find_if(p_.guards.begin(), p_.guards.end(),
                                      [&](const Guard& g) { return g.delay < 0 && given(g.machine) < 0 && gap(g, state_.t) >= 0.0; });
        if (due == p_.guards.end()) break;
        if (k > p_.guards.size() + 2) throw Failure{CHATTER, p_.switch_node(due->machine)};
        outputs_.view.on[due->machine] = static_cast<uint8_t>(due->to);
    }
    step_.e.on = outputs_.view.on;
}

// Earliest switching inside the step just made; outputs_.dense() has been called.
bool Integrator::find_event(double& s, int& l) {
    std::vector<double>& at = samples_;
    at.clear();
    for (int k = 1; k <= 8; ++k) at.push_back(k * step_.h / 8.0);
    if (sensor_boundary_) {
        // A sensor on a measured boundary may cross between any two samples of it.
        for (const Input& in : p_.inputs)
            if (in.sampled())
                for (double t = in.next_knot(state_.t, -1); t < step_.end; t = in.next_knot(t, -1)) at.push_back(t - state_.t);
        std::sort(at.begin(), at.end());
    }
    double before = 0.0;
    for (double now : at) {
        outputs_.nodes_at(now, sensor_slaved_);
        found_.clear();
        for (int k = 0; k < static_cast<int>(p_.guards.size()); ++k)
            if (gap(p_.guards[k], now == step_.h ? step_.end : state_.t + now) >= 0.0) found_.push_back(k);
        if (found_.empty()) { before = now; continue; }
        double best = std::numeric_limits<double>::infinity();
        for (int k : found_) {
            double a = before, b = now, fa = gap_at(k, a), fb = gap_at(k, b);
            int side = 0;
            for (int it = 0; it < 100 && b - a > 1e-10 * std::max(1.0, step_.h * 1e-3) && fa < 0.0; ++it) {  // Illinois
                double c = b - fb * (b - a) / (fb - fa);
                if (!(c > a && c < b)) c = 0.5 * (a + b);
                const double fc = gap_at(k, c);
                if (fc >= 0.0) {
                    b = c;
                    fb = fc;
                    if (side == 1) fa *= 0.5;
                    side = 1;
                } else {
                    a = c;
                    fa = fc;
                    if (side == -1) fb *= 0.5;
                    side = -1;
                }
                if (std::fabs(fc) < 1e-14) break;
            }
            if (fa >= 0.0) b = a;  // already due where the stretch begins
            if (b < best) {
                best = b;
                l = k;
            }
        }
        s = best;
        return true;
    }
    return false;
}

// Switches what is due at the end of the accepted step: the one the step was ended for, and any that coincide with it.
void Integrator::apply_events() {
    outputs_.nodes_at(step_.h, sensor_slaved_);
    found_.clear();
    rates_.clear();
    for (int l = 0; l < static_cast<int>(p_.guards.size()); ++l) {
        if (outputs_.view.on[p_.guards[l].machine] != p_.guards[l].from) continue;
        const double rate = gap_rate(p_.guards[l]), g = gap(p_.guards[l], step_.end);
        if (l != pending_ && !(g >= 0.0) && !(rate > 0.0 && -g <= 1e-8 * rate)) continue;
        found_.push_back(l);
        rates_.push_back(rate);
    }
    if (shortened_)  // what jumps is the difference of two evaluations at one place
        for (int i = 0; i < n_; ++i) step_.d1[i] = step_.e.f[i] * setup_.inv_cap[i];
    state_.T.swap(step_.T1);
    state_.S.swap(step_.S1);
    state_.t = step_.end;
    for (size_t k = 0; k < found_.size(); ++k)
        if (step_.e.on[p_.guards[found_[k]].machine] == p_.guards[found_[k]].from) apply_event(found_[k], rates_[k]);
    // What the new state finds passed already happens at the same instant, which moves with parameters as the first switching does.
    for (size_t k = 0;; ++k) {
        outputs_.view.t = step_.e.t;
        const auto due = std::find_if(p_.guards.begin(), p_.guards.end(), [&](const Guard& g) { return g.delay < 0 && gap(g, state_.t) >= 0.0; });
        if (due == p_.guards.end()) return;
        if (k > p_.guards.size() + 2) throw Failure{CHATTER, p_.switch_node(due->machine)};
        apply_event(static_cast<int>(due - p_.guards.begin()), 0.0);
    }
}

// dt*/dp into when_: by what the gap changes with parameters, over its rate. Inputs of step_.e stand at the instant.
void Integrator::gap_slope(const Guard& g, double rate) {
    const size_t np = np_;
    std::fill(when_.begin(), when_.end(), 0.0);
    auto coefficient = [&](int c, double scale) {
        if (c >= p_.nc) return;
        const double u = p_.coef_input[c] < 0 ? 1.0 : step_.e.u[p_.coef_input[c]];
        for (int q = d_.indptr[c]; q < d_.indptr[c + 1]; ++q) when_[d_.indices[q]] -= scale / rate * u * d_.data[q];
    };
    if (g.delay >= 0) {
        for (size_t q = 0; q < np; ++q) when_[q] = state_.entered_s[g.machine * np + q];
        return coefficient(g.delay, -1.0);
    }
    for (int k = 0; k < 3; ++k) {
        const int i = g.of.node[k];
        if (i < 0) continue;
        const double w = g.sign * step_.e.ceff[g.of.c[k]];
        coefficient(g.of.c[k], g.sign * step_.e.t[i]);
        if (i < n_) {
            for (size_t q = 0; q < np; ++q) when_[q] -= w * state_.S[i * np + q] / rate;
        } else {
            coefficient(p_.gain[i - n_], w);
            coefficient(p_.offset[i - n_], w);
        }
    }
    coefficient(g.of.c0, g.sign);
    coefficient(g.level, -g.sign);
}

// S jumps by (dT/dt before - after) dt*/dp. A rate of zero: that of the switching before, at the same instant.
void Integrator::apply_event(int l, double rate) {
    const size_t np = np_;
    const Guard& g = p_.guards[l];
    if (same_time_ > static_cast<int>(p_.guards.size()) + 2) throw Failure{CHATTER, p_.switch_node(g.machine)};
    if (np > 0 && rate != 0.0) gap_slope(g, rate);  // zero: at the instant of the switching before
    step_.e.on[g.machine] = outputs_.view.on[g.machine] = static_cast<uint8_t>(g.to);
    state_.entered[g.machine] = state_.t;
    state_.most_switched = std::max(state_.most_switched, ++state_.switched[g.machine]);
    r_->events.push_back({state_.t, g.machine, g.to, g.from});
    std::copy(state_.T.begin(), state_.T.end(), step_.e.t.begin());
    if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, step_.e);
    if (np == 0) return;
    std::copy(when_.begin(), when_.end(), state_.entered_s.begin() + g.machine * np);
    step_.e.rows();
    for (int i = 0; i < n_; ++i) {
        if (setup_.cap[i] == 0.0) continue;
        axpy(state_.S.data() + i * np, step_.d1[i] - step_.e.f[i] / setup_.cap[i], when_.data(), np_);
        step_.d1[i] = step_.e.f[i] / setup_.cap[i];
    }
}

// At the instant of a jump that is looked for S jumps too, by (dT/dt before - after) dt*/dp.
void Integrator::pass_edges() {
    for (const Edge& g : p_.edges) {
        if (g.time != state_.t || !d_.any(g.coef)) continue;
        const Input& in = p_.inputs[g.input];
        const int at = in.segment(g.time, -1);
        if (at < 1) continue;  // nothing was there before
        std::fill(when_.begin(), when_.end(), 0.0);
        for (int q = d_.indptr[g.coef]; q < d_.indptr[g.coef + 1]; ++q) when_[d_.indices[q]] = d_.data[q] * g.interval;
        for (const double sign : {1.0, -1.0}) {
            for (int k : p_.moving) step_.e.u[k] = p_.inputs[k].at(state_.t);
            if (sign > 0.0) step_.e.u[g.input] = in.mean + in.seg[at - 1].u;
            step_.e.move_inputs();
            std::copy(state_.T.begin(), state_.T.end(), step_.e.t.begin());
            if (!slaved_.massless.nodes.empty()) slaved_.solve(slaved_.massless, step_.e);
            step_.e.rows();
            for (int i = 0; i < n_; ++i) axpy(state_.S.data() + static_cast<size_t>(i) * np_, sign * step_.e.f[i] * setup_.inv_cap[i], when_.data(), np_);
        }
    }
}

}  // namespace thermid
