// Thermostats: find the switching instant on the dense output, end the step there, and let the sensitivities jump.
#include <algorithm>
#include <cmath>

#include "integrator/integrator.hpp"

namespace thermid {

// Positive once the thermostat must switch; temperatures and coefficients of eo_.
double Integrator::gap(int l) const {
    const double t = eo_.t[p_.control.sensor[l]];
    return eo_.on[l] ? t - eo_.ceff[p_.control.c[1][l]] : eo_.ceff[p_.control.c[0][l]] - t;
}

double Integrator::gap_at(int l, double s) {
    nodes_at(s, sensor_slaved_);
    return gap(l);
}

// d gap / dt at the end of the step.
double Integrator::gap_rate(int l) const {
    auto follow = [&](int c) { return c < p_.nc && p_.coef_input[c] >= 0 ? coef_[c] * uder1_[p_.coef_input[c]] : 0.0; };
    const int s = p_.control.sensor[l];
    const double rate = s < n_ ? d1_[s] : follow(p_.gain[s - n_]) + follow(p_.offset[s - n_]);
    return eo_.on[l] ? rate - follow(p_.control.c[1][l]) : follow(p_.control.c[0][l]) - rate;
}

// At the start: on if the sensor is at or below the lower threshold, unless given. eo_ holds the initial temperatures. A massless node feels its
// heater at once, so what its sensor then says may switch off again, before anything is seen of it.
void Integrator::decide_thermostats() {
    auto given = [&](int l) { return o_.on.empty() ? -1 : o_.on[l]; };
    for (int l : p_.thermostats)
        if (!(eo_.ceff[p_.control.c[0][l]] < eo_.ceff[p_.control.c[1][l]])) throw Failure{BAD_INPUT, p_.control.node[l]};
    for (int l : p_.thermostats) eo_.on[l] = given(l) >= 0 ? given(l) : eo_.t[p_.control.sensor[l]] <= eo_.ceff[p_.control.c[0][l]];
    for (size_t k = 0; !massless_.nodes.empty(); ++k) {
        solve_slaved(massless_, eo_);
        const auto due = std::find_if(p_.thermostats.begin(), p_.thermostats.end(), [&](int l) { return given(l) < 0 && gap(l) >= 0.0; });
        if (due == p_.thermostats.end()) break;
        if (k > 2 * p_.thermostats.size() + 2) throw Failure{CHATTER, p_.control.node[*due]};
        eo_.on[*due] = !eo_.on[*due];
    }
    e_.on = eo_.on;
}

// Earliest switching inside the step just made; dense() has been called.
bool Integrator::find_event(double& s, int& l) {
    std::vector<double>& at = samples_;
    at.clear();
    for (int k = 1; k <= 8; ++k) at.push_back(k * h_ / 8.0);
    if (sensor_boundary_) {
        // A sensor on a measured boundary may cross between any two samples of it.
        for (const Input& in : p_.inputs)
            if (in.sampled())
                for (double t = in.next_knot(t_, -1); t < end_; t = in.next_knot(t, -1)) at.push_back(t - t_);
        std::sort(at.begin(), at.end());
    }
    double before = 0.0;
    for (double now : at) {
        nodes_at(now, sensor_slaved_);
        found_.clear();
        for (int k : p_.thermostats)
            if (gap(k) >= 0.0) found_.push_back(k);
        if (found_.empty()) { before = now; continue; }
        double best = std::numeric_limits<double>::infinity();
        for (int k : found_) {
            double a = before, b = now, fa = gap_at(k, a), fb = gap_at(k, b);
            int side = 0;
            for (int it = 0; it < 100 && b - a > 1e-10 * std::max(1.0, h_ * 1e-3) && fa < 0.0; ++it) {  // Illinois
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
    nodes_at(h_, sensor_slaved_);
    found_.clear();
    rates_.clear();
    for (int l : p_.thermostats) {
        const double rate = gap_rate(l), g = gap(l);
        if (l != pending_ && !(g >= 0.0) && !(rate > 0.0 && -g <= 1e-8 * rate)) continue;
        found_.push_back(l);
        rates_.push_back(e_.on[l] ? rate : -rate);  // of sensor minus threshold
    }
    T_.swap(T1_);
    S_.swap(S1_);
    t_ = end_;
    for (size_t k = 0; k < found_.size(); ++k) apply_event(found_[k], rates_[k]);
}

// S jumps by (dT/dt before - after) dt*/dp.
void Integrator::apply_event(int l, double rate) {
    const size_t np = np_;
    const int threshold = p_.control.c[e_.on[l] ? 1 : 0][l], sensor = p_.control.sensor[l];
    if (same_time_ > 2 * static_cast<int>(p_.thermostats.size()) + 2) throw Failure{CHATTER, p_.control.node[l]};
    e_.on[l] = eo_.on[l] = !e_.on[l];
    r_->events.push_back({t_, l, e_.on[l]});
    std::copy(T_.begin(), T_.end(), e_.t.begin());
    if (!massless_.nodes.empty()) solve_slaved(massless_, e_);
    if (np == 0 || rate == 0.0) return;
    e_.rows();
    std::vector<double>& when = when_;  // dt*/dp
    std::fill(when.begin(), when.end(), 0.0);
    auto coefficient = [&](int c, double scale) {
        if (c >= p_.nc) return;
        const double u = p_.coef_input[c] < 0 ? 1.0 : e_.u[p_.coef_input[c]];
        for (int q = d_.indptr[c]; q < d_.indptr[c + 1]; ++q) when[d_.indices[q]] += scale * u * d_.data[q];
    };
    if (sensor < n_) {
        for (size_t q = 0; q < np; ++q) when[q] -= S_[sensor * np + q] / rate;
    } else {
        coefficient(p_.gain[sensor - n_], -1.0 / rate);
        coefficient(p_.offset[sensor - n_], -1.0 / rate);
    }
    coefficient(threshold, 1.0 / rate);
    for (int i = 0; i < n_; ++i) {
        if (cap_[i] == 0.0) continue;
        axpy(S_.data() + i * np, d1_[i] - e_.f[i] / cap_[i], when.data(), np_);
        d1_[i] = e_.f[i] / cap_[i];
    }
}

}  // namespace thermid
