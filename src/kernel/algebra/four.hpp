// Four numbers side by side: what the compiler turns into the vector instructions of the machine.
#pragma once

namespace thermid {

#if defined(__GNUC__)
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
#else
struct Four {
    double v[4] = {0.0, 0.0, 0.0, 0.0};
    void operator+=(const Four& o) { for (int j = 0; j < 4; ++j) v[j] += o.v[j]; }
};
inline Four operator*(const Four& x, const Four& y) {
    Four r;
    for (int j = 0; j < 4; ++j) r.v[j] = x.v[j] * y.v[j];
    return r;
}
inline Four operator+(const Four& x, const Four& y) {
    Four r;
    for (int j = 0; j < 4; ++j) r.v[j] = x.v[j] + y.v[j];
    return r;
}
inline Four operator-(const Four& x, const Four& y) {
    Four r;
    for (int j = 0; j < 4; ++j) r.v[j] = x.v[j] - y.v[j];
    return r;
}
inline Four operator*(double a, const Four& x) {
    Four r;
    for (int j = 0; j < 4; ++j) r.v[j] = a * x.v[j];
    return r;
}
#endif

}  // namespace thermid
