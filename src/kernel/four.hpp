// Four numbers side by side: what the compiler turns into the vector instructions of the machine.
#pragma once

#if defined(_MSC_VER)
#define THERMID_INLINE __forceinline
#else
#define THERMID_INLINE inline __attribute__((always_inline))
#endif

namespace thermid {

#if defined(__GNUC__)
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
#else
struct Four {
    double v[4] = {0.0, 0.0, 0.0, 0.0};
    void operator+=(const Four& o) { for (int j = 0; j < 4; ++j) v[j] += o.v[j]; }
};
inline Four operator*(double a, const Four& x) {
    Four r;
    for (int j = 0; j < 4; ++j) r.v[j] = a * x.v[j];
    return r;
}
#endif

}  // namespace thermid
