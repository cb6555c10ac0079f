// Readings against the model, reduced to few rows, which go into one triangle.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"  // functions that return vectors are inlined: they have no binary interface
#endif
#include "leastsquares/leastsquares.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "algebra/four.hpp"
#include "algebra/linear.hpp"
#include "algebra/traces.hpp"

namespace thermid {

namespace {
constexpr int BLOCK = 128;  // rows that are reflected together
constexpr int WIDE = 4;     // numbers side by side
}  // namespace

template <class V>
THERMID_INLINE V get(const double* from) {
    V v;
    std::memcpy(&v, from, sizeof v);
    return v;
}
template <class V>
THERMID_INLINE void put(double* to, const V& v) { std::memcpy(to, &v, sizeof v); }

// Of some channels that stand together (one or four): measured less predicted into rows, and what is told of them.
template <class V>
THERMID_INLINE void tell_of(double* left, int stride, const double* y, const double* t, long m, int channels, GroupSums& s, int c) {
    const V bias = get<V>(&s.bias[c]), first = get<V>(&s.first[c]);
    V before = get<V>(&s.before[c]), total = get<V>(&s.total[c]), squares = get<V>(&s.squares[c]);
    V lagged = get<V>(&s.lagged[c]), plain = get<V>(&s.plain[c]);
    left += c;
    y += c;
    t += c;
    for (long i = 0; i < m; ++i, left += stride, y += channels, t += channels) {
        const V e = get<V>(y) - (get<V>(t) + bias), more = e - first;
        put(left, e);
        total = total + more;
        squares = squares + more * more;
        lagged = lagged + more * before;
        plain = plain + e * e;
        before = more;
    }
    put(&s.before[c], before);
    put(&s.total[c], total);
    put(&s.squares[c], squares);
    put(&s.lagged[c], lagged);
    put(&s.plain[c], plain);
}

THERMID_CLONES static void tell(double* left, int stride, const double* y, const double* t, long m, int channels, GroupSums& s) {
    int c = 0;
    for (; c + WIDE <= channels; c += WIDE) tell_of<Four>(left, stride, y, t, m, channels, s, c);
    for (; c < channels; ++c) tell_of<double>(left, stride, y, t, m, channels, s, c);
    double *high = s.high.data(), *low = s.low.data();
    for (long i = 0; i < m; ++i, left += stride)
        for (c = 0; c < channels; ++c) {
            high[c] = std::max(high[c], left[c]);
            low[c] = std::min(low[c], left[c]);
        }
}

LeastSquares::LeastSquares(const Readings& readings, const Weighing& weighing, int np)
    : readings_(readings), w_(weighing), np_(np), columns_(np + weighing.biases) {
    next_.assign(readings.groups.size(), 0);
    told_.resize(readings.groups.size());
    for (size_t g = 0; g < told_.size(); ++g) {
        GroupSums& s = told_[g];
        const size_t channels = readings.groups[g].channels.size();
        for (auto* v : {&s.first, &s.before, &s.total, &s.squares, &s.lagged, &s.plain, &s.high, &s.low}) v->assign(channels, 0.0);
        for (int c : readings.groups[g].channels) s.bias.push_back(weighing.bias[c]);
    }
    all_.reset(columns_ + 1, columns_);
    block_.assign(static_cast<size_t>(BLOCK) * all_.stride(), 0.0);
}

long LeastSquares::open(size_t g, long last, int terms, long most) {
    g_ = g;
    group_ = &readings_.groups[g];
    long end = next_[g];
    const long all = static_cast<long>(group_->index.size());
    while (end < all && group_->index[end] < last) ++end;
    const long many = end - next_[g];
    terms_ = terms;
    raw_ = many <= terms;
    kept_ = raw_ ? static_cast<int>(many) : terms;
    const int channels = static_cast<int>(group_->channels.size());
    const bool together = w_.loss == SQUARE;
    stride_ = padded(terms + channels);
    room_.resize(std::max(room_.size(), static_cast<size_t>(most) * stride_));
    if (many == 0 || columns_ == 0) return many;
    const size_t apart = together ? 1 : channels;
    if (local_.size() < apart) local_.resize(apart);
    for (size_t c = 0; c < apart; ++c) local_[c].reset(terms + (together ? channels : 1), terms);
    return many;
}

double* LeastSquares::predicted(long m) {
    predicted_.resize(std::max(predicted_.size(), m * group_->nodes.size()));
    return predicted_.data();
}

double* LeastSquares::slopes(long m) {
    if (np_ == 0) return nullptr;
    slopes_.resize(std::max(slopes_.size(), m * group_->nodes.size() * np_));
    return slopes_.data();
}

void LeastSquares::residuals(long m, double* left, int stride) {
    const ReadingGroup& g = *group_;
    const size_t channels = g.channels.size(), nodes = g.nodes.size();
    const double *y = g.values.data() + next_[g_] * channels, *t = predicted_.data();
    if (!g.alone) {
        mixed_.resize(std::max(mixed_.size(), m * channels));
        for (long i = 0; i < m; ++i)
            for (size_t c = 0; c < channels; ++c) {
                double sum = 0.0;
                for (int k = g.begin[c]; k < g.begin[c + 1]; ++k) sum += w_.weight[g.term[k]] * predicted_[i * nodes + g.at[k]];
                mixed_[i * channels + c] = sum;
            }
        t = mixed_.data();
    }
    GroupSums& s = told_[g_];
    if (s.count == 0.0)
        for (size_t c = 0; c < channels; ++c) s.first[c] = s.high[c] = s.low[c] = y[c] - (t[c] + s.bias[c]);
    tell(left, stride, y, t, m, static_cast<int>(channels), s);
    s.count += static_cast<double>(m);
    next_[g_] += m;
}

double LeastSquares::weigh(double scaled) {
    const double z = scaled * scaled / (w_.knee * w_.knee);
    double rho = z, slope = 1.0;
    if (w_.loss == SOFT_L1) {
        const double root = std::sqrt(1.0 + z);
        rho = 2.0 * (root - 1.0);
        slope = 1.0 / root;
    } else if (w_.loss == CAUCHY) {
        rho = std::log1p(z);
        slope = 1.0 / (1.0 + z);
    } else if (z > 1.0) {
        const double root = std::sqrt(z);
        rho = 2.0 * root - 1.0;
        slope = 1.0 / root;
    }
    cost += w_.knee * w_.knee * rho;
    chi_square += slope * scaled * scaled;
    return std::sqrt(slope);
}

void LeastSquares::absorb(Triangle& to, double* rows, long m) {
    if (raw_) std::copy(rows, rows + m * to.stride(), to.row(0));
    else to.absorb(rows, static_cast<int>(m));
}

void LeastSquares::take(long m) {
    const ReadingGroup& g = *group_;
    const int channels = static_cast<int>(g.channels.size()), end = terms_ + channels;
    residuals(m, room_.data() + terms_, stride_);
    if (w_.loss == SQUARE) {
        if (columns_ == 0) return;
        for (long i = 0; i < m; ++i) std::fill(room_.begin() + i * stride_ + end, room_.begin() + (i + 1) * stride_, 0.0);
        absorb(local_[0], room_.data(), m);
        return;
    }
    const int stride = padded(terms_ + 1);
    own_.resize(std::max(own_.size(), static_cast<size_t>(m) * stride));
    for (int c = 0; c < channels; ++c) {
        const double inverse = 1.0 / w_.sigma[g.channels[c]];
        for (long i = 0; i < m; ++i) {
            const double* from = room_.data() + i * stride_;
            double* to = own_.data() + i * stride;
            const double e = from[terms_ + c], weight = weigh(e * inverse);
            for (int k = 0; k < terms_; ++k) to[k] = weight * from[k];
            to[terms_] = weight * e;
            for (int k = terms_ + 1; k < stride; ++k) to[k] = 0.0;
        }
        if (columns_ > 0) absorb(local_[c], own_.data(), m);
    }
}

// out (rows, stride) = scale * r (rows, terms) x (terms, width), where r is a triangle unless it stands raw; x is `wide`.
THERMID_CLONES static void spread(double* THERMID_RESTRICT out, int stride, int rows, const double* r, int of, bool raw,
                                  const double* THERMID_RESTRICT x, int wide, int terms, int width, double scale) {
    for (int k = 0; k < rows; ++k, r += of, out += stride) {
        int j = 0;
        for (; j + 4 <= width; j += 4) {
            double sum[4] = {0.0, 0.0, 0.0, 0.0};
            for (int t = raw ? 0 : k; t < terms; ++t) {
                const double a = r[t];
                const double* from = x + static_cast<size_t>(t) * wide + j;
                for (int q = 0; q < 4; ++q) sum[q] += a * from[q];
            }
            for (int q = 0; q < 4; ++q) out[j + q] = scale * sum[q];
        }
        for (; j < width; ++j) {
            double sum = 0.0;
            for (int t = raw ? 0 : k; t < terms; ++t) sum += r[t] * x[static_cast<size_t>(t) * wide + j];
            out[j] = scale * sum;
        }
    }
}

// Room for some more rows of the whole; they are zero.
double* LeastSquares::rows(int count) {
    if (filled_ + count > BLOCK) flush();
    double* first = block_.data() + static_cast<size_t>(filled_) * all_.stride();
    std::fill(first, first + static_cast<size_t>(count) * all_.stride(), 0.0);
    filled_ += count;
    return first;
}

void LeastSquares::close(const double* terms) {
    if (columns_ == 0) return;
    const ReadingGroup& g = *group_;
    const int channels = static_cast<int>(g.channels.size()), stride = all_.stride();
    const bool together = w_.loss == SQUARE;
    for (int c = 0; c < channels; ++c) {
        const Triangle& local = local_[together ? 0 : c];
        const double scale = -1.0 / w_.sigma[g.channels[c]];
        const int bias = w_.bias_column[g.channels[c]], right = terms_ + (together ? c : 0);
        double* to = rows(kept_);
        spread(to, stride, kept_, local.row(0), local.stride(), raw_, terms + static_cast<size_t>(c) * np_, padded(channels * np_), terms_, np_, scale);
        for (int k = 0; k < kept_; ++k, to += stride) {
            if (bias >= 0) to[np_ + bias] = scale * local.row(k)[0];  // a constant is the first of the terms
            to[columns_] = -scale * local.row(k)[right];
        }
    }
}

void LeastSquares::take_rows(long m) {
    const ReadingGroup& g = *group_;
    const size_t channels = g.channels.size(), nodes = g.nodes.size(), np = np_;
    residuals(m, room_.data(), stride_);
    if (columns_ == 0 && w_.loss == SQUARE) return;
    for (long i = 0; i < m; ++i)
        for (size_t c = 0; c < channels; ++c) {
            const double inverse = 1.0 / w_.sigma[g.channels[c]], scaled = room_[i * stride_ + c] * inverse;
            const double weight = w_.loss == SQUARE ? 1.0 : weigh(scaled), scale = -inverse * weight;
            if (columns_ == 0) continue;
            double* to = rows(1);
            auto add = [&](size_t node, double share) { axpy(to, scale * share, slopes_.data() + (i * nodes + node) * np, np_); };
            if (np > 0 && g.alone) add(c, 1.0);
            if (np > 0 && !g.alone)
                for (int k = g.begin[c]; k < g.begin[c + 1]; ++k) {
                    add(g.at[k], w_.weight[g.term[k]]);
                    axpy(to, scale * predicted_[i * nodes + g.at[k]], w_.slope + static_cast<size_t>(g.term[k]) * np, np_);
                }
            if (w_.bias_column[g.channels[c]] >= 0) to[np + w_.bias_column[g.channels[c]]] = scale;
            to[columns_] = weight * scaled;
        }
}

void LeastSquares::flush() {
    all_.absorb(block_.data(), filled_);
    filled_ = 0;
}

void LeastSquares::finish() {
    flush();
    sums.assign(7 * static_cast<size_t>(readings_.channels), 0.0);
    for (size_t g = 0; g < told_.size(); ++g) {
        const GroupSums& s = told_[g];
        const std::vector<int>& channels = readings_.groups[g].channels;
        for (size_t c = 0; c < channels.size(); ++c) {
            const double largest = s.high[c] > -s.low[c] ? s.high[c] : s.low[c], sigma = w_.sigma[channels[c]];
            const double line[] = {s.count, s.first[c], s.first[c] + s.before[c], s.total[c], s.squares[c], s.lagged[c], largest};
            std::copy(line, line + 7, sums.begin() + 7 * static_cast<size_t>(channels[c]));
            if (w_.loss == SQUARE) cost += s.plain[c] / (sigma * sigma);
        }
    }
    if (w_.loss == SQUARE) chi_square = cost;
}

}  // namespace thermid
