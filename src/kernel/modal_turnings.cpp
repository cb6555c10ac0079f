// Turning points of the modal solution. Between two knots of the inputs a temperature is a sum of exponentials, a straight line and waves;
// its slope is looked at where stretches end and, after a knot, at a quarter of the stretch, a sixteenth and so on, down to the fastest mode.
#include <algorithm>
#include <cmath>

#include "modal.hpp"

namespace thermid {

namespace {
constexpr double SHORT = 0.1;  // of the shortest time constant: a slope changes sign once at most
constexpr double CLOSE = 1e-9; // of a stretch: where its slope is zero
}  // namespace

// Shares of modes, inputs and waves in every column: the observed nodes, then the sums.
void Modal::follow(const double* out_t, long nout, const int* obs, int nobs, const Sums& sums, double t0) {
    const int ns = modes_, nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size()), columns = nobs + sums.size();
    turnings_.begin(columns, out_t, nout);
    course_shape_.assign(static_cast<size_t>(columns) * ns, 0.0);
    course_base_.assign(columns, 0.0);
    course_direct_.assign(static_cast<size_t>(columns) * nin, 0.0);
    course_wave_.assign(static_cast<size_t>(columns) * 2 * nw, 0.0);
    auto add = [&](int c, int i, double weight) {
        for (int j = 0; j < ns; ++j) course_shape_[c * ns + j] += weight * shape_[i * ns + j];
        course_base_[c] += weight * (ref_ + direct_[i * cols_]);
        for (int k = 0; k < nin; ++k) course_direct_[c * nin + k] += weight * direct_[i * cols_ + 1 + sampled_[k]];
        for (int k = 0; k < nw; ++k) {
            double* to = course_wave_.data() + 2 * (c * nw + k);
            to[0] += weight * direct_[i * cols_ + 1 + sines_[k]] * p_.inputs[sines_[k]].amplitude;
            for (int j = 0; j < ns; ++j) {
                to[0] += weight * shape_[i * ns + j] * wave_s_[j * nw + k];
                to[1] += weight * shape_[i * ns + j] * wave_c_[j * nw + k];
            }
        }
    };
    for (int c = 0; c < nobs; ++c) add(c, obs[c], 1.0);
    for (int c = 0; c < sums.size(); ++c)
        for (int k = sums.begin[c]; k < sums.begin[c + 1]; ++k) add(nobs + c, sums.node[k], sums.weight[k]);
    jumps_ = std::any_of(course_direct_.begin(), course_direct_.end(), [](double x) { return x != 0.0; });
    fastest_ = ns > 0 ? *std::max_element(rate_.begin(), rate_.begin() + ns) : 0.0;
    kink_ = t0;
    for (auto* v : {&level_, &tilt_, &reached_}) v->assign(ns, 0.0);
    for (auto& v : slope_) v.assign(columns, 0.0);
}

void Modal::parts_of(Stretch& x) const {
    if (!x.parts.empty()) return;
    double s = x.h;
    do {
        s *= 0.25;
        std::vector<Phi> own;
        for (int j = 0; j < modes_; ++j) own.push_back(phi(rate_[j] * s));
        x.parts.push_back(std::move(own));
    } while (fastest_ * s > SHORT);
}

// A column at s from the start of a stretch at t, where the states are z and inputs, by value and slope, are `drive` at its start.
double Modal::course(int column, const double* z, const double* drive, double s, double t) const {
    const int nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size());
    double y = course_base_[column];
    for (int j = 0; j < modes_; ++j) y += course_shape_[column * modes_ + j] * z[j];
    for (int k = 0; k < nin; ++k) y += course_direct_[column * nin + k] * (drive[2 * k] + s * drive[2 * k + 1]);
    for (int k = 0; k < nw; ++k) {
        const double* w = course_wave_.data() + 2 * (column * nw + k);
        y += w[0] * wave(k, t + s, true) + w[1] * wave(k, t + s, false);
    }
    return y;
}

// Its slope: z' = -rate z + force.
double Modal::course_slope(int column, const double* z, const double* drive, double s, double t) const {
    const int nin = static_cast<int>(sampled_.size()), nw = static_cast<int>(sines_.size());
    double y = 0.0;
    for (int j = 0; j < modes_; ++j) y += course_shape_[column * modes_ + j] * (level_[j] + s * tilt_[j] - rate_[j] * z[j]);
    for (int k = 0; k < nin; ++k) y += course_direct_[column * nin + k] * drive[2 * k + 1];
    for (int k = 0; k < nw; ++k) {
        const double *w = course_wave_.data() + 2 * (column * nw + k), omega = 2.0 * 3.14159265358979323846 / p_.inputs[sines_[k]].period;
        y += omega * (w[0] * wave(k, t + s, false) - w[1] * wave(k, t + s, true));
    }
    return y;
}

double Modal::slope_at(int column, const double* drive, double s, double t) {
    for (int j = 0; j < modes_; ++j) {
        const Phi f = phi(rate_[j] * s);
        reached_[j] = f.e * before_[j] + s * (f.p1 * level_[j] + s * f.p2 * tilt_[j]);
    }
    return course_slope(column, reached_.data(), drive, s, t);
}

// One stretch that has been carried out, from t to `until`: states before_ at its start, z_ at its end.
void Modal::turn(Stretch& x, const double* drive, double t, double until) {
    const int columns = static_cast<int>(course_base_.size()), nin = static_cast<int>(sampled_.size());
    if (!(x.h > 0.0)) return;
    for (int j = 0; j < modes_; ++j) {
        level_[j] = force_[j * cols_];
        tilt_[j] = 0.0;
        for (int k = 0; k < nin; ++k) {
            level_[j] += force_[j * cols_ + 1 + sampled_[k]] * drive[2 * k];
            tilt_[j] += force_[j * cols_ + 1 + sampled_[k]] * drive[2 * k + 1];
        }
    }
    // From the end to the start: the parts that the fastest mode, and the time since the last knot, ask for.
    const double least = std::max(fastest_ > 0.0 ? SHORT / fastest_ : x.h, 0.3 * (t - kink_));
    int many = 0;
    if (0.25 * x.h > least || t == kink_) {
        parts_of(x);
        for (double s = 0.25 * x.h; many < static_cast<int>(x.parts.size()) && (many == 0 || s > 0.25 * least); s *= 0.25) ++many;
    }
    for (int c = 0; c < columns; ++c) {
        slope_[0][c] = course_slope(c, before_.data(), drive, 0.0, t);
        turnings_.see(c, t, course(c, before_.data(), drive, 0.0, t));
    }
    double from = 0.0;
    for (int k = many; k >= 0; --k) {
        const double to = k == 0 ? x.h : x.h * std::pow(0.25, k);
        const double* z = z_.data();
        if (k > 0) {
            const std::vector<Phi>& own = x.parts[k - 1];
            for (int j = 0; j < modes_; ++j) reached_[j] = own[j].e * before_[j] + to * (own[j].p1 * level_[j] + to * own[j].p2 * tilt_[j]);
            z = reached_.data();
        }
        for (int c = 0; c < columns; ++c) slope_[1][c] = course_slope(c, z, drive, to, t);
        for (int c = 0; c < columns; ++c) {
            if (!(slope_[0][c] * slope_[1][c] < 0.0) || (std::fabs(slope_[0][c]) + std::fabs(slope_[1][c])) * (to - from) < 1e-6) continue;
            const auto f = [&](double s) { return slope_at(c, drive, s, t); };
            const double s = Turnings::root(f, from, slope_[0][c], to, slope_[1][c], CLOSE * x.h);
            f(s);
            turnings_.see(c, t + s, course(c, reached_.data(), drive, s, t));
        }
        slope_[0].swap(slope_[1]);
        from = to;
    }
    for (int c = 0; c < columns; ++c) turnings_.see(c, until, course(c, z_.data(), drive, x.h, t));
}

}  // namespace thermid
